# SPDX-License-Identifier: MIT
"""The generalised Maxwell law: a causal shear modulus whose loss factor is nearly constant.

A spring beside four Maxwell branches, the rheology of Emmerich and Korn (1987), has at the complex
frequency s the modulus

    G(s) = G_r (1 + Σ_m a_m κ_m(s)),   κ_m(s) = sτ_m/(1 + sτ_m)

Branch m remembers a strain ζ_m of its own, dζ_m/dt = dγ/dt - ζ_m/τ_m, and the stress is
G_r (γ + Σ_m a_m ζ_m): unlike the hysteretic law this one can be stopped and started again, exactly.

The weights a_m >= 0 of a damping ratio D bring the loss factor Im G/Re G at 80 frequencies, equally
spaced in ln f over the band, as near to 2D as linear least squares can: the rows are

    Σ_m (Im κ_m - 2D Re κ_m) a_m = 2D

The relaxed modulus G_r makes Re G(iω) the given modulus G at a reference frequency. Over 0.2-20 Hz
the loss factor is 2D within

===========  ======  ======  ======  ======  ======  ======  ======  ======
D            1 %     2 %     5 %     10 %    20 %    25 %    30 %    40 %
error        0.7 %   0.8 %   1.3 %   2.3 %   5 %     6.6 %   17 %    39 %
===========  ======  ======  ======  ======  ======  ======  ======  ======

so beyond D = 0.25 four branches no longer hold it. Outside the band it fades.

Causality has a price, dispersion: the modulus grows with frequency, nearly as in the law of exactly
constant loss factor, Re G(iω) ~ ω^2γ with γ = arctan(2D)/π (Kjartansson, 1979).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from fenics_hytf.soil.complex_modulus import ComplexArray
from fenics_hytf.soil.curves import RealArray

_S = TypeVar("_S", complex, ComplexArray)

RELAXATION_TIMES = (0.95747, 0.16630, 0.036013, 0.0063799)
"""τ_m of the branches [s]; 1/(2πτ) is 0.17, 0.96, 4.4 and 25 Hz."""

BAND = (0.2, 20.0)
"""Frequencies between which the loss factor is constant [Hz]."""

HELD_DAMPING = 0.25
"""Damping ratio up to which four branches hold the loss factor, within 6.6 % [-]."""

_FIT_FREQUENCIES = np.geomspace(*BAND, 80)


@dataclass(frozen=True)
class Branch:
    """κ(s) = sτ/(1 + sτ), the modulus of a spring and a dashpot in series over the spring's.

    Attributes:
        relaxation_time: τ [s].
    """

    relaxation_time: float

    def __call__(self, s: _S) -> _S:
        """Evaluate.

        Args:
            s: Complex frequency [rad/s], a number or an array of any shape; not the pole -1/τ.

        Returns:
            κ(s) [-], a number or an array as ``s`` is.
        """
        x = s * self.relaxation_time
        return x / (1.0 + x)


branches = tuple(map(Branch, RELAXATION_TIMES))
"""κ_m as functions of s, in the order of `RELAXATION_TIMES`."""


def branch_weights(damping: npt.ArrayLike) -> RealArray:
    """Weights a_m of the branches over the relaxed modulus.

    a_m/D comes from a table over all of [0, 1), made at the first call and linear in between, which
    alters the loss factor by less than 1e-4 of itself. At D = 0 the weights are zero.

    Args:
        damping: Damping ratio D [-], any shape ``(...)``, in [0, 1).

    Returns:
        The weights [-], not negative, shape ``(..., 4)``.

    Raises:
        ValueError: If a damping ratio is out of range.
    """
    d = np.asarray(damping, dtype=np.float64)
    faulty = ~((d >= 0.0) & (d < 1.0))
    if faulty.any():
        raise ValueError(
            f"damping: found {d[faulty][0]}; expected 0 <= damping < 1, as a ratio, not in "
            "percent, for the complex modulus 'maxwell'"
        )
    grid, table = _table()
    return d[..., None] * np.stack([np.interp(d, grid, column) for column in table.T], axis=-1)


def relaxed_factor(damping: npt.ArrayLike, reference_frequency: float) -> RealArray:
    """Relaxed over given modulus, G_r/G = 1/(1 + Σ a_m Re κ_m(iω_ref)).

    Args:
        damping: Damping ratio D [-], any shape, in [0, 1).
        reference_frequency: Frequency at which the real part of the modulus is G [Hz].

    Returns:
        G_r/G [-], in (0, 1], the shape of ``damping``.

    Raises:
        ValueError: If a damping ratio is out of range or the frequency is not positive and finite.
    """
    if not 0.0 < reference_frequency < np.inf:
        raise ValueError(
            f"reference_frequency: found {reference_frequency}; expected a positive frequency in Hz"
        )
    kappa = _kappa(2j * np.pi * reference_frequency)
    return np.asarray(1.0 / (1.0 + branch_weights(damping) @ kappa.real))


def maxwell_factor(
    damping: npt.ArrayLike, s: npt.ArrayLike, reference_frequency: float
) -> ComplexArray:
    """G(s)/G = (G_r/G) (1 + Σ a_m κ_m(s)).

    Args:
        damping: Damping ratio D [-], in [0, 1), of a shape that broadcasts with that of ``s``.
        s: Complex frequency [rad/s], iω for a harmonic motion.
        reference_frequency: Frequency at which the real part is 1 [Hz].

    Returns:
        G(s)/G [-], the shape that ``damping`` and ``s`` broadcast to.

    Raises:
        ValueError: If a damping ratio is out of range or the frequency is not positive and finite.
    """
    relaxed = relaxed_factor(damping, reference_frequency)
    return np.asarray(relaxed * (1.0 + np.sum(branch_weights(damping) * _kappa(s), axis=-1)))


def _kappa(s: npt.ArrayLike) -> ComplexArray:
    """κ_m(s) of all branches, shape ``(..., 4)`` for s [rad/s] of shape ``(...)``."""
    x = np.asarray(s, dtype=np.complex128)[..., None]
    return np.concatenate([kappa(x) for kappa in branches], axis=-1)


@cache
def _table() -> tuple[RealArray, RealArray]:
    """Damping ratios D [-], shape ``(num_rows,)``, and a_m/D [-], shape ``(num_rows, 4)``.

    a/D has a limit at D = 0 and is smooth but for a few D at which a weight becomes zero, where the
    table is finer.
    """
    even = np.arange(501) / 500.0
    kinks = np.flatnonzero(np.diff(_fit(even) > 0.0, axis=0).any(axis=1))
    finer = even[kinks, None] + even[1] * np.arange(1, 100) / 100.0
    grid = np.sort(np.append(even, finer))
    return grid, _fit(grid)


def _fit(damping: RealArray) -> RealArray:
    """a_m/D [-] by non-negative least squares, shape ``(num, 4)`` for D [-] of shape ``(num,)``."""
    kappa = _kappa(2j * np.pi * _FIT_FREQUENCIES)
    rows = kappa.imag - 2.0 * damping[:, None, None] * kappa.real
    target = np.full(_FIT_FREQUENCIES.size, 2.0)
    return np.array([nnls(matrix, target)[0] for matrix in rows])
