# SPDX-License-Identifier: MIT
"""Modulus reduction and damping curves of Ishibashi and Zhang (1993) for sand and clay.

I. Ishibashi, X. Zhang, Unified dynamic shear moduli and damping ratios of sand and clay, Soils and
Foundations 33(1), 1993, 182-191. With the strain γ as a ratio and the stress σ in kPa:

    G/G_max = K σ^m
    K = ½ (1 + tanh(0.492 ln((0.000102 + n)/γ)))
    m = 0.272 (1 - tanh(0.4 ln(0.000556/γ))) exp(-0.0145 PI^1.3)
    n = 0                    PI = 0
        3.37e-6 PI^1.404     0 < PI <= 15
        7.0e-7 PI^1.976      15 < PI <= 70
        2.7e-5 PI^1.115      PI > 70
    D = 0.1665 (1 + exp(-0.0145 PI^1.3)) (0.586 (G/G_max)² - 1.547 G/G_max + 1)

The fit exceeds G/G_max = 1 at small strain where the stress is high, by up to 3 % at 100 kPa and
15 % at 1 MPa, according to PI; it is taken as 1 there, in the damping too.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.soil.curves import Curve
from fenics_hytf.soil.parameters import check_mean_stress, check_plasticity_index, table_strains


def ishibashi_zhang(
    plasticity_index: float, mean_stress: float, strain: npt.ArrayLike | None = None
) -> Curve:
    """Curves of Ishibashi and Zhang (1993).

    Args:
        plasticity_index: PI [%].
        mean_stress: Mean effective confining stress [Pa].
        strain: Shear strains of the table [-], shape ``(num_points,)``; ten a decade from 1e-6 to
            0.1 if ``None``.

    Returns:
        The curves.

    Raises:
        ValueError: If a parameter is out of range.
    """
    check_plasticity_index(plasticity_index)
    check_mean_stress(mean_stress)
    gamma = table_strains(strain, fine=True)
    plasticity = np.exp(-0.0145 * plasticity_index**1.3)
    factor = 0.5 + 0.5 * np.tanh(0.492 * np.log((0.000102 + _shift(plasticity_index)) / gamma))
    exponent = 0.272 * (1.0 - np.tanh(0.4 * np.log(0.000556 / gamma))) * plasticity
    modulus = np.minimum(factor * (1e-3 * mean_stress) ** exponent, 1.0)
    damping = 0.1665 * (1.0 + plasticity) * (0.586 * modulus**2 - 1.547 * modulus + 1.0)
    return Curve(gamma, modulus, damping)


def _shift(plasticity_index: float) -> float:
    """n(PI), by which plasticity moves the modulus to larger strain [-]."""
    if plasticity_index <= 15.0:
        return 3.37e-6 * plasticity_index**1.404
    if plasticity_index <= 70.0:
        return 7.0e-7 * plasticity_index**1.976
    return 2.7e-5 * plasticity_index**1.115
