# SPDX-License-Identifier: MIT
"""Menq's (2003) modulus reduction and damping curves of sands and gravels.

F. Y. Menq, Dynamic properties of sandy and gravelly soils, The University of Texas at Austin, 2003:
the modified hyperbola of Darendeli (2001) with, strains and damping in percent, stress over the
atmospheric pressure p_a, the uniformity coefficient C_u and the mean grain size d₅₀ in mm,

    strain_r = 0.12 C_u^-0.6 (stress/p_a)^(0.5 C_u^-0.15)
    a = 0.86 + 0.1 log₁₀(stress/p_a)
    D_min = 0.55 C_u^0.1 d₅₀^-0.3 (stress/p_a)^-0.08

The exponent -0.08 of the stress is Menq's fit and what site-response programs use; his text has
the rounded -0.05 beside it, which changes D_min by 7 % at most between 10 and 1000 kPa.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.soil.curves import Curve
from fenics_hytf.soil.modified_hyperbola import modified_hyperbola
from fenics_hytf.soil.parameters import ATMOSPHERIC_PRESSURE, check, check_cycles, table_strains

_LOWEST_STRESS = 100.0  # [Pa]; the curvature, 0.56 here, turns negative at stresses far below


def menq(
    uniformity_coefficient: float,
    d50: float,
    mean_stress: float,
    cycles: float = 10.0,
    strain: npt.ArrayLike | None = None,
) -> Curve:
    """Curves of Menq (2003).

    Args:
        uniformity_coefficient: C_u = d₆₀/d₁₀ [-], at least 1.
        d50: Mean grain size [mm], at least 0.063, where sand begins.
        mean_stress: Mean effective confining stress [Pa], at least 100.
        cycles: Number of loading cycles N [-], at least 1.
        strain: Shear strains of the table [-], shape ``(num_points,)``; 20 from 1e-6 to 10^-1.5
            if ``None``.

    Returns:
        The curves.

    Raises:
        ValueError: If a parameter is out of range.
    """
    cu = uniformity_coefficient
    check("uniformity_coefficient", cu, 1.0 <= cu < np.inf, "at least 1")
    check("d50", d50, 0.063 <= d50 < np.inf, "at least 0.063, in mm, for sand and gravel")
    inside = _LOWEST_STRESS <= mean_stress < np.inf
    check("mean_stress", mean_stress, inside, f"at least {_LOWEST_STRESS:g} Pa")
    check_cycles(cycles)
    stress = mean_stress / ATMOSPHERIC_PRESSURE
    reference = 1e-2 * 0.12 * cu**-0.6 * stress ** (0.5 * cu**-0.15)
    curvature = 0.86 + 0.1 * float(np.log10(stress))
    minimum = 1e-2 * 0.55 * cu**0.1 * d50**-0.3 * stress**-0.08
    return modified_hyperbola(table_strains(strain), reference, curvature, minimum, cycles)
