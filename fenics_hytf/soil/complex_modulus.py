# SPDX-License-Identifier: MIT
"""Complex shear modulus G* of a soil with hysteretic damping ratio D, in four conventions.

With e^{+iωt} and ω > 0 the imaginary part is positive; at negative frequencies it takes the sign
of ω, at ω = 0 the modulus is real. The conventions agree to first order in D:

==============  ==================================  =============================================
``hysteretic``  G (1 + 2iD)                         constant real part
``kramer``      G (1 - D² + 2iD)                    Kramer (1996), so that √G* = √G (1 + iD)
``shake91``     G (1 - 2D² + 2iD √(1 - D²))         Udaka (1975), Idriss and Sun (1992): |G*| = G
``dormieux``    G (√(1 - 4D²) + 2iD)                Dormieux and Canou (1990): |G*| = G
==============  ==================================  =============================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


COMPLEX_MODULUS: Mapping[str, Callable[[RealArray], ComplexArray]] = MappingProxyType(
    {
        "hysteretic": lambda d: 1.0 + 2j * d,
        "kramer": lambda d: 1.0 - d**2 + 2j * d,
        "shake91": lambda d: 1.0 - 2.0 * d**2 + 2j * d * np.sqrt(1.0 - d**2),
        "dormieux": lambda d: np.sqrt(1.0 - 4.0 * d**2) + 2j * d,
    }
)
"""G*/G as a function of a damping ratio in range, by the name of the convention."""

_LIMIT = {"dormieux": 0.5}  # of the damping ratio; 1 for the others


def complex_factor(damping: npt.ArrayLike, convention: str = "hysteretic") -> ComplexArray:
    """G*/G at positive frequencies in a named convention.

    Args:
        damping: Damping ratio D [-], any shape, in [0, 1), for ``dormieux`` in [0, 0.5).
        convention: A key of `COMPLEX_MODULUS`.

    Returns:
        G*/G [-], the shape of ``damping``.

    Raises:
        ValueError: If the convention is unknown or a damping ratio is out of range.
    """
    if convention not in COMPLEX_MODULUS:
        raise ValueError(
            f"complex_modulus: found '{convention}'; expected one of {', '.join(COMPLEX_MODULUS)}"
        )
    return np.asarray(COMPLEX_MODULUS[convention](_checked(damping, convention)))


def wave_factors(
    damping: float, poisson: float, convention: str = "hysteretic", keep: str = "poisson"
) -> tuple[complex, complex]:
    """Complex over real modulus of P and of S waves, M*/M and G*/G, at positive frequencies.

    Args:
        damping: Damping ratio of shear D [-].
        poisson: Poisson's ratio of the real moduli [-].
        convention: A key of `COMPLEX_MODULUS`.
        keep: ``"poisson"``: both moduli take the factor G*/G; ``"bulk"``: M* = K + 4G*/3.

    Returns:
        The two factors [-].

    Raises:
        ValueError: If the convention is unknown or the damping ratio is out of range.
    """
    shear = complex(complex_factor(damping, convention))
    if keep == "poisson":
        return shear, shear
    share = 4 / 3 * (1 - 2 * poisson) / (2 - 2 * poisson)  # of 4G/3 in M
    return 1 - share + share * shear, shear


def _checked(damping: npt.ArrayLike, convention: str) -> RealArray:
    """Damping ratios as an array, each in the range of the convention."""
    values, limit = np.asarray(damping, dtype=np.float64), _LIMIT.get(convention, 1.0)
    faulty = ~((values >= 0.0) & (values < limit))
    if faulty.any():
        raise ValueError(
            f"damping: found {values[faulty][0]}; expected 0 <= damping < {limit:g} for the "
            f"complex modulus '{convention}'"
        )
    return values
