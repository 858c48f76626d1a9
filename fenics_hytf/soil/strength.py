# SPDX-License-Identifier: MIT
"""Curves whose shear stress approaches the shear strength at large strain.

Curves from laboratory tests end near 1 % of strain and know nothing of the strength: what they give
beyond may be a multiple of it, or a fraction. After E. Yee, J. P. Stewart and K. Tokimatsu, Elastic
and large-strain nonlinear seismic site response from analysis of vertical array recordings, Journal
of Geotechnical and Geoenvironmental Engineering 139(10), 2013, 1789-1801, the backbone is replaced
above a transition strain γ₁ by a hyperbola that goes on from there with the same stress τ₁ and the
same tangent G₁ and tends to the strength τ_f:

    τ = τ₁ + G₁ (γ - γ₁) / (1 + (γ - γ₁)/γ_ref),   γ_ref = (τ_f - τ₁) / G₁

The damping ratio is left as it is. The authors ask for a transition strain with τ₁ <= 0.3 τ_f; the
largest such strain is taken here unless another is given, so that the curve stays as it is
wherever the stress is below 0.3 of the strength. The hyperbola holds at every strain above, within
the table and beyond it: the stress of the curve never falls and never exceeds the strength. An
equivalent-linear analysis reads the curve at the effective strain; its peak stress, |G*| times the
peak strain, may be larger by 1/ratio.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from fenics_hytf.soil.curves import Curve, RealArray

TRANSITION = 0.3
"""Part of the strength that is mobilised at the transition strain, where none is given [-]."""

_END = 0.1  # strain to which the table is extended [-]
_PER_DECADE = 20


@dataclass(frozen=True, eq=False)
class LimitedCurve(Curve):
    """A curve limited by the shear strength; as a table it samples the limited backbone.

    Attributes:
        transition_strain: γ₁ [-]; the curve is that without limit up to here.
        transition_stress: τ₁/G_max [-].
        tangent: G₁/G_max [-], positive.
        strength: τ_f/G_max [-].
    """

    transition_strain: float
    transition_stress: float
    tangent: float
    strength: float

    def evaluate(self, strain: npt.ArrayLike) -> tuple[RealArray, RealArray]:
        """Interpolate up to the transition strain; the hyperbola itself above it.

        Args:
            strain: Effective shear strain [-], any shape; 0 gives the small-strain values.

        Returns:
            G/G_max [-] and damping ratio [-], each with the shape of ``strain``.
        """
        gamma = np.asarray(strain, dtype=np.float64)
        modulus, damping = super().evaluate(gamma)
        excess = np.fmax(gamma - self.transition_strain, 0.0)
        reserve = self.strength - self.transition_stress
        stress = self.transition_stress + self.tangent * excess / (
            1.0 + self.tangent * excess / reserve
        )
        above = excess > 0.0
        return np.where(above, stress / np.where(above, gamma, 1.0), modulus), damping


def limit_strength(
    curve: Curve,
    shear_modulus: float,
    shear_strength: float,
    transition_strain: float | None = None,
) -> LimitedCurve:
    """Limit a curve by the shear strength.

    Args:
        curve: The curve.
        shear_modulus: G_max [Pa].
        shear_strength: τ_f [Pa].
        transition_strain: γ₁ [-]; ``None`` for the strain at which the curve mobilises 0.3 of the
            strength.

    Returns:
        The limited curve.

    Raises:
        ValueError: If the strength is not above the stress that the curve mobilises at its smallest
            strain, or the transition strain is not one where the stress of the curve still grows
            and is below the strength.
    """
    strength = shear_strength / shear_modulus
    smallest = float(curve.strain[0] * curve.modulus[0])
    if not smallest < strength < np.inf:
        raise ValueError(
            f"curves.shear_strength: found {shear_strength:g} Pa; expected more than "
            f"{shear_modulus * smallest:.4g} Pa, which the curve mobilises at its smallest strain, "
            f"{curve.strain[0]:g}, with G_max = {shear_modulus:g} Pa"
        )
    begin = _transition(curve, strength) if transition_strain is None else transition_strain
    if not 0.0 < begin < np.inf:
        raise ValueError(f"curves.transition_strain: found {begin:g}; expected a positive strain")
    secant = float(curve.evaluate(begin)[0])
    tangent = secant + _slope(curve, begin)
    if not begin * secant < strength:
        raise ValueError(
            f"curves.transition_strain: found {begin:g}, where the curve mobilises "
            f"{shear_modulus * begin * secant:.4g} Pa; expected a strain with less than the "
            f"strength, {shear_strength:g} Pa"
        )
    if not tangent > 0.0:
        raise ValueError(
            f"curves.transition_strain: found {begin:g}, where the stress of the curve no longer "
            "grows; expected a smaller strain"
        )
    return _with_table(curve, begin, begin * secant, tangent, strength)


def _transition(curve: Curve, strength: float) -> float:
    """The smallest strain at which the curve, as it is evaluated, mobilises 0.3 of the strength."""
    target = TRANSITION * strength
    reached = np.flatnonzero(curve.strain * curve.modulus >= target)
    if reached.size == 0:  # beyond the table, where the modulus is constant
        return float(target / curve.modulus[-1])
    if reached[0] == 0:
        return float(target / curve.modulus[0])
    below, above = curve.strain[reached[0] - 1 : reached[0] + 1]
    return float(
        brentq(lambda g: g * curve.evaluate(g)[0] - target, below, above, xtol=1e-14 * below)
    )


def _slope(curve: Curve, strain: float) -> float:
    """dG/d ln γ over G_max at a strain.

    The table samples a smooth curve: central differences come closer to its slope than the chords,
    which jump at every point.
    """
    if not curve.strain[0] <= strain <= curve.strain[-1]:
        return 0.0
    x = np.log(curve.strain)
    return float(np.interp(np.log(strain), x, np.gradient(curve.modulus, x)))


def _with_table(
    curve: Curve, begin: float, stress: float, tangent: float, strength: float
) -> LimitedCurve:
    """The limited curve, its table extended over the hyperbola."""
    end = max(_END, float(curve.strain[-1]), 10.0 * begin)
    count = 2 + int(_PER_DECADE * np.log10(end / begin))
    strain = np.union1d(curve.strain, np.geomspace(begin, end, count))
    backbone = begin, stress, tangent, strength
    modulus, damping = LimitedCurve(strain, *curve.evaluate(strain), *backbone).evaluate(strain)
    # at the transition strain both parts hold, to rounding
    return LimitedCurve(strain, np.minimum.accumulate(modulus), damping, *backbone)
