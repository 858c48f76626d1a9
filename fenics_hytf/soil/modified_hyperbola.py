# SPDX-License-Identifier: MIT
"""The modified hyperbola of Darendeli (2001), which Menq (2003) uses as well.

With x = γ/γ_r and natural logarithms, damping in percent:

    G/G_max = 1 / (1 + x^a)
    D = D_min + b (G/G_max)^0.1 D_masing,  b = 0.6329 - 0.00566 ln N
    D_masing = c₁ D₁ + c₂ D₁² + c₃ D₁³
    D₁ = (100/π) (4 (x - ln(1 + x)) (1 + x)/x² - 2)

D₁ is the damping of Masing loops of the hyperbola, c₁ to c₃ correct it for the curvature a. The
coefficient of ln N is printed as 0.0057 as well, rounded. At large strains, beyond the data, the
formula lets the damping fall again; the largest D - D_min reached so far is kept there.
"""

from __future__ import annotations

import numpy as np

from fenics_hytf.soil.curves import Curve, RealArray
from fenics_hytf.soil.masing import masing_damping


def modified_hyperbola(
    strain: RealArray,
    reference_strain: float,
    curvature: float,
    small_strain_damping: float,
    cycles: float,
) -> Curve:
    """Curves of the modified hyperbola.

    Args:
        strain: Shear strains of the table [-], shape ``(num_points,)``.
        reference_strain: γ_r [-], where G is half of G_max.
        curvature: a [-].
        small_strain_damping: D_min [-].
        cycles: Number of loading cycles N [-].

    Returns:
        The curves.

    Raises:
        ValueError: If the strains do not increase, or the damping leaves [0, 1).
    """
    ratio = np.asarray(strain / reference_strain, dtype=np.float64)
    modulus = np.asarray(1.0 / (1.0 + ratio**curvature), dtype=np.float64)
    scaling = (0.6329 - 0.00566 * np.log(cycles)) * modulus**0.1
    growth = np.maximum.accumulate(scaling * _corrected_masing(ratio, curvature))
    return Curve(strain, modulus, small_strain_damping + 1e-2 * growth)


def _corrected_masing(ratio: RealArray, curvature: float) -> RealArray:
    """Damping of Masing loops [%] at ``ratio``, strain over reference strain."""
    a, simple = curvature, 1e2 * masing_damping(ratio)
    c1 = -1.1143 * a**2 + 1.8618 * a + 0.2523
    c2 = 0.0805 * a**2 - 0.0710 * a - 0.0095
    c3 = -0.0005 * a**2 + 0.0002 * a + 0.0003
    return c1 * simple + c2 * simple**2 + c3 * simple**3
