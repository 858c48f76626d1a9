# SPDX-License-Identifier: MIT
"""Darendeli's (2001) modulus reduction and damping curves.

M. B. Darendeli, Development of a new family of normalized modulus reduction and material damping
curves, The University of Texas at Austin, 2001. With strains in percent, stress over the
atmospheric pressure p_a and natural logarithms:

    strain_r = (0.0352 + 0.0010 PI OCR^0.3246) (stress/p_a)^0.3483
    x = strain/strain_r
    G/G_max = 1 / (1 + x^a),  a = 0.9190
    D_min = (0.8005 + 0.0129 PI OCR^-0.1069) (stress/p_a)^-0.2889 (1 + 0.2919 ln f)
    D = D_min + b (G/G_max)^0.1 D_masing,  b = 0.6329 - 0.00566 ln N
    D_masing = c₁ D₁ + c₂ D₁² + c₃ D₁³
    D₁ = (100/π) (4 (x - ln(1 + x)) (1 + x)/x² - 2)

The coefficient of ln N is printed as 0.0057 as well, rounded. At large strains, beyond the data,
the formula lets the damping fall again; the largest D - D_min reached so far is kept there.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.soil.curves import Curve, RealArray

ATMOSPHERIC_PRESSURE = 101325.0
"""p_a [Pa]."""

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
    _check(
        "plasticity_index",
        plasticity_index,
        0.0 <= plasticity_index < np.inf,
        "at least 0, in percent",
    )
    _check("mean_stress", mean_stress, 0.0 < mean_stress < np.inf, "a positive stress in Pa")
    _check("ocr", ocr, 1.0 <= ocr < np.inf, "at least 1")
    _check("cycles", cycles, 1.0 <= cycles < np.inf, "at least 1")
    lowest = float(np.exp(-1.0 / 0.2919))
    _check(
        "frequency",
        frequency,
        lowest < frequency < np.inf,
        f"above {lowest:.3f} Hz, where D_min is 0",
    )
    gamma = np.asarray(np.logspace(-6.0, -1.5, 20) if strain is None else strain, dtype=np.float64)
    _check(
        "strain", gamma.tolist(), bool(((gamma > 0.0) & (gamma < np.inf)).all()), "positive numbers"
    )
    stress = mean_stress / ATMOSPHERIC_PRESSURE
    reference = 1e-2 * (0.0352 + 0.0010 * plasticity_index * ocr**0.3246) * stress**0.3483
    ratio = gamma / reference
    modulus = 1.0 / (1.0 + ratio**_CURVATURE)
    minimum = (
        (0.8005 + 0.0129 * plasticity_index * ocr**-0.1069)
        * stress**-0.2889
        * (1.0 + 0.2919 * np.log(frequency))
    )
    scaling = (0.6329 - 0.00566 * np.log(cycles)) * modulus**0.1
    growth = np.maximum.accumulate(scaling * _masing(ratio))
    return Curve(gamma, modulus, 1e-2 * (minimum + growth))


def _masing(ratio: RealArray) -> RealArray:
    """Damping of Masing loops [%] at ``ratio``, strain over reference strain."""
    a = _CURVATURE
    simple = 4.0 * (ratio - np.log1p(ratio)) * (1.0 + ratio) / ratio**2 - 2.0
    simple *= 100.0 / np.pi
    c1 = -1.1143 * a**2 + 1.8618 * a + 0.2523
    c2 = 0.0805 * a**2 - 0.0710 * a - 0.0095
    c3 = -0.0005 * a**2 + 0.0002 * a + 0.0003
    return c1 * simple + c2 * simple**2 + c3 * simple**3


def _check(name: str, value: object, inside: bool, expected: str) -> None:
    """Raise ValueError unless the value is inside."""
    if not inside:
        raise ValueError(f"curves.{name}: found {value}; expected {expected}")
