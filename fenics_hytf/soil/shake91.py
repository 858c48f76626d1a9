# SPDX-License-Identifier: MIT
"""Curves that the program SHAKE91 comes with: clay, sand and rock.

I. M. Idriss, J. I. Sun, User's manual for SHAKE91, University of California, Davis, 1992, sample
input. The columns of a curve have strains of their own there; here they are joined, which changes
nothing between them, both being linear in ln γ.

- ``idriss_1990_clay``: modulus of clay by H. B. Seed and J. I. Sun, UCB/EERC-89/15, 1989, upper
  range; ``idriss_1990_sand``: modulus of sand by Seed and Idriss (1970), upper range. The damping
  of both is that of I. M. Idriss, Response of soft soil sites during earthquakes, H. Bolton Seed
  Memorial Symposium, 1990.
- ``schnabel_1973_rock``: P. B. Schnabel, Effects of local geology and distance from source on
  earthquake ground motions, University of California, Berkeley, 1973, average.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from fenics_hytf.soil.curves import Curve

_Column = tuple[tuple[float, ...], tuple[float, ...]]

_SOIL_STRAIN = (1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 1e-1)
_CLAY_MODULUS = (1.0, 1.0, 1.0, 0.981, 0.941, 0.847, 0.656, 0.438, 0.238, 0.144, 0.110)
_SAND_MODULUS = (1.0, 1.0, 0.990, 0.960, 0.850, 0.640, 0.370, 0.180, 0.080, 0.050, 0.035)
_SOIL_DAMPING = (0.0024, 0.0042, 0.008, 0.014, 0.028, 0.051, 0.098, 0.155, 0.21, 0.25, 0.28)
_ROCK_STRAIN = (1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 1e-2)
_ROCK_MODULUS = (1.0, 1.0, 0.9875, 0.9525, 0.9, 0.81, 0.725, 0.55)


def _joined(modulus: _Column, damping: _Column) -> Curve:
    """A curve of two columns, each a pair of strains and values, at the strains of both."""
    strain = np.union1d(modulus[0], damping[0])
    columns = [np.interp(np.log(strain), np.log(at), values) for at, values in (modulus, damping)]
    return Curve(strain, *columns)


_IDRISS = ((*_SOIL_STRAIN[:9], 3.16e-2, 1e-1), _SOIL_DAMPING)

SHAKE91: Mapping[str, Curve] = MappingProxyType(
    {
        "idriss_1990_clay": _joined((_SOIL_STRAIN, _CLAY_MODULUS), _IDRISS),
        "idriss_1990_sand": _joined((_SOIL_STRAIN, _SAND_MODULUS), (_SOIL_STRAIN, _SOIL_DAMPING)),
        "schnabel_1973_rock": _joined(
            (_ROCK_STRAIN, _ROCK_MODULUS),
            ((1e-6, 1e-5, 1e-4, 1e-3, 1e-2), (0.004, 0.008, 0.015, 0.030, 0.046)),
        ),
    }
)
"""Curves by name."""
