# SPDX-License-Identifier: MIT
"""Curves digitised from published figures: Vucetic and Dobry (1991), Seed and Idriss (1970).

- M. Vucetic, R. Dobry, Effect of soil plasticity on cyclic response, Journal of Geotechnical
  Engineering 117(1), 1991, 89-107, for plasticity indices 0 to 200.
- H. B. Seed, I. M. Idriss, Soil moduli and damping factors for dynamic response analyses,
  EERC 70-10, University of California, Berkeley, 1970, for sand.

The readings are those of the site-response program Strata (Kottke and Rathje), which has no lower
bound of the modulus and no upper bound of the damping for sand; these two are the mean of two
readings of the figure that agree to 0.02 and 0.004 (F. Gatti, 2015; DynaEngine). Other readings of
all curves differ from these tables by 0.025 in G/G_max and 0.007 in damping, by more at the ends
of some lines: 0.05 in G/G_max at PI = 200 and 1 %, 0.011 in damping below a strain of 3e-5.
"""

from __future__ import annotations

import numpy as np

from fenics_hytf.soil.curves import Curve
from fenics_hytf.soil.parameters import at_index, check

_STRAIN = (1e-6, 3.16e-6, 1e-5, 3.16e-5, 1e-4, 3.16e-4, 1e-3, 3.16e-3, 1e-2)

_PLASTICITY_INDEX = (0.0, 15.0, 30.0, 50.0, 100.0, 200.0)
_VUCETIC_DOBRY_MODULUS = (
    (1.00, 1.00, 0.96, 0.88, 0.70, 0.47, 0.26, 0.11, 0.03),
    (1.00, 1.00, 0.99, 0.94, 0.81, 0.64, 0.41, 0.22, 0.10),
    (1.00, 1.00, 1.00, 0.98, 0.90, 0.75, 0.53, 0.35, 0.17),
    (1.00, 1.00, 1.00, 1.00, 0.95, 0.84, 0.67, 0.47, 0.25),
    (1.00, 1.00, 1.00, 1.00, 0.98, 0.92, 0.81, 0.63, 0.37),
    (1.00, 1.00, 1.00, 1.00, 1.00, 0.96, 0.89, 0.75, 0.53),
)
_VUCETIC_DOBRY_DAMPING = (
    (0.010, 0.010, 0.010, 0.030, 0.054, 0.098, 0.150, 0.203, 0.240),
    (0.010, 0.010, 0.010, 0.026, 0.045, 0.075, 0.116, 0.160, 0.200),
    (0.010, 0.010, 0.010, 0.021, 0.038, 0.059, 0.088, 0.125, 0.169),
    (0.010, 0.010, 0.010, 0.018, 0.029, 0.043, 0.062, 0.095, 0.135),
    (0.010, 0.010, 0.010, 0.015, 0.020, 0.029, 0.041, 0.065, 0.098),
    (0.010, 0.010, 0.010, 0.013, 0.016, 0.021, 0.030, 0.048, 0.081),
)

_SEED_IDRISS_MODULUS = {
    "mean": (1.00, 0.99, 0.96, 0.88, 0.74, 0.52, 0.29, 0.15, 0.06),
    "upper": (1.00, 1.00, 0.99, 0.94, 0.84, 0.65, 0.36, 0.19, 0.08),
    "lower": (1.00, 0.98, 0.92, 0.82, 0.63, 0.42, 0.23, 0.11, 0.05),
}
_SEED_IDRISS_DAMPING = {
    "mean": (0.0057, 0.0086, 0.017, 0.031, 0.055, 0.095, 0.155, 0.211, 0.246),
    "upper": (0.005, 0.006, 0.008, 0.014, 0.028, 0.053, 0.100, 0.158, 0.215),
    "lower": (0.0067, 0.012, 0.027, 0.057, 0.099, 0.151, 0.209, 0.256, 0.277),
}

SEED_IDRISS_BOUNDS = tuple(_SEED_IDRISS_MODULUS)
"""Names of the bounds of Seed and Idriss (1970)."""


def vucetic_dobry_1991(plasticity_index: float) -> Curve:
    """Curves of Vucetic and Dobry (1991), linear in the plasticity index between their six.

    Args:
        plasticity_index: PI [%], 0 to 200.

    Returns:
        The curves.

    Raises:
        ValueError: If the plasticity index is out of range.
    """
    highest = _PLASTICITY_INDEX[-1]
    inside = 0.0 <= plasticity_index <= highest
    check("plasticity_index", plasticity_index, inside, f"0 to {highest:g}, in percent")
    modulus, damping = (
        at_index(plasticity_index, _PLASTICITY_INDEX, table)
        for table in (_VUCETIC_DOBRY_MODULUS, _VUCETIC_DOBRY_DAMPING)
    )
    return Curve(np.array(_STRAIN), modulus, damping)


def seed_idriss_1970(bound: str = "mean") -> Curve:
    """Curves of Seed and Idriss (1970) for sand.

    Args:
        bound: ``"mean"``, ``"upper"`` or ``"lower"``: bound of the modulus. The damping is the
            opposite bound: a sand that stays stiff damps little.

    Returns:
        The curves.

    Raises:
        ValueError: If the bound is unknown.
    """
    if bound not in _SEED_IDRISS_MODULUS:
        raise ValueError(
            f"curves.bound: found {bound!r}; expected one of {', '.join(_SEED_IDRISS_MODULUS)}"
        )
    return Curve(
        np.array(_STRAIN),
        np.array(_SEED_IDRISS_MODULUS[bound]),
        np.array(_SEED_IDRISS_DAMPING[bound]),
    )
