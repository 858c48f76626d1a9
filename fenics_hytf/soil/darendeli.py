# SPDX-License-Identifier: MIT
"""Darendeli's (2001) modulus reduction and damping curves.

M. B. Darendeli, Development of a new family of normalized modulus reduction and material damping
curves, The University of Texas at Austin, 2001: a modified hyperbola with the curvature 0.9190 and,
strains and damping in percent, stress over the atmospheric pressure p_a, natural logarithms,

    strain_r = (0.0352 + 0.0010 PI OCR^0.3246) (stress/p_a)^0.3483
    D_min = (0.8005 + 0.0129 PI OCR^-0.1069) (stress/p_a)^-0.2889 (1 + 0.2919 ln f)
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.soil.curves import Curve
from fenics_hytf.soil.modified_hyperbola import modified_hyperbola
from fenics_hytf.soil.parameters import (
    ATMOSPHERIC_PRESSURE,
    check,
    check_cycles,
    check_mean_stress,
    check_plasticity_index,
    table_strains,
)

_CURVATURE = 0.9190


def darendeli(
    plasticity_index: float,
    mean_stress: float,
    ocr: float = 1.0,
    frequency: float = 1.0,
    cycles: float = 10.0,
    strain: npt.ArrayLike | None = None,
) -> Curve:
    """Curves of Darendeli (2001).

    Args:
        plasticity_index: PI [%].
        mean_stress: Mean effective confining stress [Pa].
        ocr: Overconsolidation ratio [-], at least 1.
        frequency: Loading frequency f [Hz].
        cycles: Number of loading cycles N [-], at least 1.
        strain: Shear strains of the table [-], shape ``(num_points,)``; 20 from 1e-6 to 10^-1.5
            if ``None``.

    Returns:
        The curves.

    Raises:
        ValueError: If a parameter is out of range.
    """
    check_plasticity_index(plasticity_index)
    check_mean_stress(mean_stress)
    check("ocr", ocr, 1.0 <= ocr < np.inf, "at least 1")
    check_cycles(cycles)
    lowest = float(np.exp(-1.0 / 0.2919))
    check(
        "frequency",
        frequency,
        lowest < frequency < np.inf,
        f"above {lowest:.3f} Hz, where D_min is 0",
    )
    stress = mean_stress / ATMOSPHERIC_PRESSURE
    reference = 1e-2 * (0.0352 + 0.0010 * plasticity_index * ocr**0.3246) * stress**0.3483
    minimum = (
        1e-2
        * (0.8005 + 0.0129 * plasticity_index * ocr**-0.1069)
        * stress**-0.2889
        * (1.0 + 0.2919 * np.log(frequency))
    )
    return modified_hyperbola(table_strains(strain), reference, _CURVATURE, minimum, cycles)
