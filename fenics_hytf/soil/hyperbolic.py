# SPDX-License-Identifier: MIT
"""Curves of a hyperbolic backbone: Hardin and Drnevich (1972), and the modified one of Matasovic.

- B. O. Hardin, V. P. Drnevich, Shear modulus and damping in soils: design equations and curves,
  Journal of the Soil Mechanics and Foundations Division 98(SM7), 1972, 667-692. The backbone is a
  hyperbola, and the damping ratio grows as the modulus falls:

      G/G_max = 1 / (1 + γ/γ_r),   D = D_min + (D_max - D_min) (1 - G/G_max)

  D_min is 0 in the paper.
- N. Matasovic, M. Vucetic, Cyclic characterization of liquefiable sands, Journal of Geotechnical
  Engineering 119(11), 1993, 1805-1822: the modified Kondner-Zelasko backbone (MKZ),

      G/G_max = 1 / (1 + β (γ/γ_r)^s)

  The damping is that of Masing loops of the backbone beside a damping ratio at small strain,
  D = D_min + F D_masing. Masing loops damp too much at large strain; the reduction factor of
  C. Phillips and Y. M. A. Hashash, Soil Dynamics and Earthquake Engineering 29(7), 2009,
  1143-1158, takes that back, F = p₁ - p₂ (1 - G/G_max)^p₃.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.soil.curves import Curve
from fenics_hytf.soil.masing import masing_damping
from fenics_hytf.soil.parameters import check, table_strains

_LARGEST_DMIN = 0.2
_LARGEST_CURVATURE = 1.1  # Masing loops then damp 0.78 at most, with D_min below 1


def hardin_drnevich(
    reference_strain: float,
    max_damping: float,
    small_strain_damping: float = 0.0,
    strain: npt.ArrayLike | None = None,
) -> Curve:
    """Curves of Hardin and Drnevich (1972).

    Args:
        reference_strain: γ_r [-]: shear strength over G_max; G is half of G_max there.
        max_damping: D_max [-], the damping ratio at large strain, in (0, 1).
        small_strain_damping: D_min [-], in [0, D_max].
        strain: Shear strains of the table [-], shape ``(num_points,)``; ten a decade from 1e-6 to
            0.1 if ``None``.

    Returns:
        The curves.

    Raises:
        ValueError: If a parameter is out of range.
    """
    _check_reference_strain(reference_strain)
    check("max_damping", max_damping, 0.0 < max_damping < 1.0, "a damping ratio from 0 to 1")
    check(
        "small_strain_damping",
        small_strain_damping,
        0.0 <= small_strain_damping <= max_damping,
        f"a damping ratio from 0 to max_damping, {max_damping:g}",
    )
    gamma = table_strains(strain, fine=True)
    modulus = np.asarray(1.0 / (1.0 + gamma / reference_strain), dtype=np.float64)
    damping = small_strain_damping + (max_damping - small_strain_damping) * (1.0 - modulus)
    return Curve(gamma, modulus, damping)


def mkz(
    reference_strain: float,
    curvature: float = 1.0,
    beta: float = 1.0,
    small_strain_damping: float = 0.0,
    p1: float = 1.0,
    p2: float = 0.0,
    p3: float = 1.0,
    strain: npt.ArrayLike | None = None,
) -> Curve:
    """Curves of the modified Kondner-Zelasko backbone, damping by Masing's rules.

    Args:
        reference_strain: γ_r [-].
        curvature: s [-], in (0, 1.1]; above, the stress falls at large strain and Masing loops
            soon damp critically.
        beta: β [-], positive.
        small_strain_damping: D_min [-], in [0, 0.2].
        p1: p₁ of the reduction factor F [-], in [0, 1]; 1 with p₂ = 0 reduces nothing.
        p2: p₂ [-], in [0, p₁].
        p3: p₃ [-], positive.
        strain: Shear strains of the table [-], shape ``(num_points,)``; ten a decade from 1e-6 to
            0.1 if ``None``.

    Returns:
        The curves.

    Raises:
        ValueError: If a parameter is out of range.
    """
    _check_reference_strain(reference_strain)
    check(
        "curvature",
        curvature,
        0.0 < curvature <= _LARGEST_CURVATURE,
        f"a number above 0, at most {_LARGEST_CURVATURE:g}",
    )
    check("beta", beta, 0.0 < beta < np.inf, "a positive number")
    check(
        "small_strain_damping",
        small_strain_damping,
        0.0 <= small_strain_damping <= _LARGEST_DMIN,
        f"a damping ratio from 0 to {_LARGEST_DMIN:g}",
    )
    check("p1", p1, 0.0 <= p1 <= 1.0, "a number from 0 to 1")
    check("p2", p2, 0.0 <= p2 <= p1, f"a number from 0 to p1, {p1:g}")
    check("p3", p3, 0.0 < p3 < np.inf, "a positive number")
    gamma = table_strains(strain, fine=True)
    degradation = beta * (gamma / reference_strain) ** curvature
    modulus = np.asarray(1.0 / (1.0 + degradation), dtype=np.float64)
    reduction = p1 - p2 * (1.0 - modulus) ** p3
    damping = small_strain_damping + reduction * masing_damping(degradation, curvature)
    return Curve(gamma, modulus, damping)


def _check_reference_strain(reference_strain: float) -> None:
    inside = 0.0 < reference_strain < 1.0
    check("reference_strain", reference_strain, inside, "a shear strain above 0 and below 1")
