# SPDX-License-Identifier: MIT
"""Intensity measures of a motion: peaks, Arias intensity, CAV, significant duration.

- Arias intensity I_a = π/(2g) ∫a² dt (Arias 1970).
- Cumulative absolute velocity CAV = ∫|a| dt (EPRI 1988).
- Significant duration D5-95: the time in which I_a grows from 5 to 95 % (Trifunac and Brady 1975).
- Velocity and displacement are integrals of the motion as the periodic one it is: â/(iω) and
  -â/ω², without a line at zero frequency. Both have zero mean; nothing drifts. A motion that is
  periodic in parts is integrated part by part: from one to the next it may jump.

Integrals over time use the trapezoidal rule between samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import cumulative_trapezoid, trapezoid

from fenics_hytf.motion.records import GRAVITY
from fenics_hytf.motion.spectra import frequencies, to_frequency, to_time

RealArray = npt.NDArray[np.float64]

DURATION_FRACTIONS = (0.05, 0.95)
"""Of the Arias intensity, at the start and the end of the significant duration."""


@dataclass(frozen=True)
class Intensity:
    """Intensity measures of one motion.

    Attributes:
        pga: Largest absolute acceleration [m/s^2].
        pgv: Largest absolute velocity [m/s].
        pgd: Largest absolute displacement [m].
        arias: Arias intensity [m/s].
        cav: Cumulative absolute velocity [m/s].
        significant_duration: D5-95 [s], NaN for a motion that is zero.
    """

    pga: float
    pgv: float
    pgd: float
    arias: float
    cav: float
    significant_duration: float


def intensity_measures(
    acceleration: npt.ArrayLike, dt: float, starts: Sequence[int] = (0,)
) -> Intensity:
    """All measures of a motion.

    Args:
        acceleration: [m/s^2], shape ``(num_samples,)``; its measures are NaN where a sample is.
        dt: Time step [s].
        starts: First samples of the parts that are periodic each.

    Returns:
        The measures.
    """
    samples = np.asarray(acceleration, dtype=np.float64)
    parts = np.split(samples, list(starts)[1:])
    return Intensity(
        pga=_peak(samples),
        pgv=max(_peak(integrated(part, dt)) for part in parts),
        pgd=max(_peak(integrated(part, dt, times=2)) for part in parts),
        arias=float(arias_intensity(samples, dt)),
        cav=float(cumulative_absolute_velocity(samples, dt)),
        significant_duration=significant_duration(samples, dt),
    )


def integrated(acceleration: npt.ArrayLike, dt: float, times: int = 1) -> RealArray:
    """Velocity or displacement of a periodic motion: its lines over (iω) to a power.

    Args:
        acceleration: [m/s^2], shape ``(..., num_samples)``.
        dt: Time step [s].
        times: 1 for the velocity [m/s], 2 for the displacement [m].

    Returns:
        Zero-mean samples, shape ``(..., num_samples)``.
    """
    samples = np.asarray(acceleration, dtype=np.float64)
    num_samples = samples.shape[-1]
    lines = to_frequency(samples)
    omega = 2.0 * np.pi * frequencies(num_samples, dt)
    lines[..., 0] = 0.0
    lines[..., 1:] /= (1j * omega[1:]) ** times
    return to_time(lines, num_samples)


def arias_intensity(acceleration: npt.ArrayLike, dt: float) -> RealArray:
    """Arias intensity π/(2g) ∫a² dt along the last axis.

    Args:
        acceleration: [m/s^2], shape ``(..., num_samples)``.
        dt: Time step [s].

    Returns:
        [m/s], shape ``(...)``.
    """
    samples = np.asarray(acceleration, dtype=np.float64)
    return np.asarray(np.pi / (2.0 * GRAVITY) * trapezoid(samples**2, dx=dt, axis=-1))


def cumulative_absolute_velocity(acceleration: npt.ArrayLike, dt: float) -> RealArray:
    """Cumulative absolute velocity ∫|a| dt along the last axis.

    Args:
        acceleration: [m/s^2], shape ``(..., num_samples)``.
        dt: Time step [s].

    Returns:
        [m/s], shape ``(...)``.
    """
    samples = np.asarray(acceleration, dtype=np.float64)
    return np.asarray(trapezoid(np.abs(samples), dx=dt, axis=-1))


def significant_duration(
    acceleration: npt.ArrayLike,
    dt: float,
    fractions: tuple[float, float] = DURATION_FRACTIONS,
) -> float:
    """Time in which the Arias intensity grows from one fraction of its final value to another.

    Args:
        acceleration: [m/s^2], shape ``(num_samples,)``.
        dt: Time step [s].
        fractions: Of the final Arias intensity.

    Returns:
        [s], linear between samples; NaN for a motion that is zero or not finite.
    """
    growth = cumulative_trapezoid(np.asarray(acceleration, np.float64) ** 2, dx=dt, initial=0.0)
    if not (np.isfinite(growth[-1]) and growth[-1] > 0.0):
        return float("nan")
    start, end = np.interp(fractions, growth / growth[-1], dt * np.arange(growth.size))
    return float(end - start)


def _peak(samples: RealArray) -> float:
    return float(np.max(np.abs(samples)))
