# SPDX-License-Identifier: MIT
"""Damping ratio of hysteresis loops that follow Masing's rules.

Masing's (1926) loop between -γ and γ is the backbone curve τ(γ) stretched by two, so that its
damping ratio is

    D = ΔW / (4π W) = (4/π) ∫₀¹ t (f(tγ)/f(γ) - 1) dt,   f = τ/(G_max γ)

For the backbone of Kondner (1963) and Zelasko as modified by Matasovic and Vucetic (1993),
f = 1/(1 + k) with k = β (γ/γ_r)^s, the integrand is k (1 - t^s) / (1 + k t^s) times t, which
loses no digits however small the strain. For the hyperbola, s = 1, the integral is closed,
D = (1/π) (4 (k - ln(1 + k)) (1 + k)/k² - 2); it tends to 2/π at large strain.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.soil.curves import RealArray

_LOWEST = 20.0  # what lies below t = e^-20 is 2e-18 k at most
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(100)


def masing_damping(degradation: npt.ArrayLike, curvature: float = 1.0) -> RealArray:
    """Damping ratio of Masing loops of the modified Kondner-Zelasko backbone.

    Args:
        degradation: k = G_max/G - 1 [-], not negative, shape ``(num_points,)``.
        curvature: s [-], in (0, 2).

    Returns:
        Damping ratio [-], without small-strain damping, shape ``(num_points,)``.
    """
    # with t = e^-v the integrand is smooth at t = 0, whatever the curvature
    v = 0.5 * _LOWEST * (_NODES + 1.0)
    power = np.exp(-curvature * v)
    k = np.asarray(degradation, dtype=np.float64)[:, None]
    integrand = np.exp(-2.0 * v) * k * (1.0 - power) / (1.0 + k * power)
    return np.asarray(4.0 / np.pi * 0.5 * _LOWEST * (integrand @ _WEIGHTS))
