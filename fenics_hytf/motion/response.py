# SPDX-License-Identifier: MIT
"""Response spectra: peak of a damped oscillator under a record, period by period.

The oscillator ü + 2ζωu̇ + ω²u = -a is integrated exactly for an acceleration that is linear
between points (Nigam and Jennings, 1969); its pseudo-acceleration is ω² max|u|. The points are
finer than the samples: straight lines between the samples themselves would lose 2 % of a motion
with 12 samples a cycle. The record is therefore interpolated as the Fourier series it is before it
enters the recursion (Boore and Goulet, 2014, compare the ways).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.fft import next_fast_len
from scipy.linalg import expm
from scipy.signal import lfilter, resample

RealArray = npt.NDArray[np.float64]

STEPS_PER_PERIOD = 40
"""Fewest points in a period of the oscillator.

The peak is taken at the points; one half-way between two is missed by 1 - cos(π/40) = 0.3 %.
"""

MIN_SUBSTEPS = 8
"""Fewest points per sample: straight lines between them lose 0.15 % at a third of Nyquist."""

MAX_SUBSTEPS = 32
"""Most points per sample, reached at periods under 2.5 time steps.

Shorter ones follow the record so closely that what rings on top is a small part of the peak.
"""


def default_periods() -> RealArray:
    """Periods from 0.01 to 10 s, 60 a decade, equally spaced in their logarithm.

    Returns:
        [s], shape ``(181,)``.
    """
    return np.geomspace(0.01, 10.0, 181, dtype=np.float64)


def response_spectrum(
    acceleration: npt.ArrayLike, dt: float, periods: npt.ArrayLike, damping: float = 0.05
) -> RealArray:
    """Pseudo-acceleration response spectrum.

    The oscillator starts at rest; its free vibration after the record's end counts as well. At
    vanishing period the spectrum tends to the peak of the interpolated record, which can lie
    between two samples and then slightly above them.

    Args:
        acceleration: Samples in any unit, shape ``(..., num_samples)``.
        dt: Time step [s].
        periods: Undamped periods of the oscillator [s], shape ``(num_periods,)``.
        damping: Damping ratio ζ of the oscillator [-].

    Returns:
        Pseudo-acceleration ω² max|u| in the unit of the samples, shape ``(..., num_periods)``.

    Raises:
        ValueError: If a period or the damping ratio is out of range.
    """
    samples = np.asarray(acceleration, dtype=np.float64)
    period = np.atleast_1d(np.asarray(periods, dtype=np.float64))
    if not (np.isfinite(period).all() and (period > 0.0).all()):
        raise ValueError(f"periods: found {period.min()} s; expected positive numbers")
    if not 0.0 <= damping < 1.0:
        raise ValueError(f"damping: found {damping}; expected 0 <= damping < 1")
    padded = _padded(samples, math.ceil(0.5 * period.max() / dt) + 1)
    wanted = 2.0 ** np.ceil(np.log2(STEPS_PER_PERIOD * dt / period))
    substeps = np.clip(wanted, MIN_SUBSTEPS, MAX_SUBSTEPS).astype(int)
    spectrum = np.empty((*samples.shape[:-1], period.size))
    for factor in np.unique(substeps):
        fine = resample(padded, factor * padded.shape[-1], axis=-1)
        for index in np.flatnonzero(substeps == factor):
            response = _oscillator(fine, dt / factor, float(period[index]), damping)
            spectrum[..., index] = np.abs(response).max(axis=-1)
    return spectrum


def _padded(samples: RealArray, rest: int) -> RealArray:
    """Samples with at least ``rest`` zeros after: free vibration peaks within half a period."""
    length = next_fast_len(samples.shape[-1] + rest, real=True)
    zeros = np.zeros((*samples.shape[:-1], length - samples.shape[-1]))
    return np.concatenate([samples, zeros], axis=-1)


def _oscillator(points: RealArray, dt: float, period: float, damping: float) -> RealArray:
    """ω²u at every point, from rest, exact for an acceleration linear between points.

    With x = (ω²u, ωu̇) a step is x⁺ = A x + B₀ a + B₁ a⁺, read off one matrix exponential of the
    oscillator with its input and the input's slope as states. Eliminating the velocity leaves a
    recursion of second order in u, which `lfilter` runs.

    Args:
        points: Acceleration a, shape ``(..., num_points)``.
        dt: Step between points [s].
        period: [s].
        damping: ζ [-].

    Returns:
        Shape ``(..., num_points)``, in the unit of the acceleration.
    """
    w = 2.0 * np.pi * dt / period
    rates = np.array(
        [[0.0, w, 0.0, 0.0], [-w, -2.0 * damping * w, -w, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0] * 4]
    )
    step = expm(rates)
    a, b1 = step[:2, :2], step[:2, 3]
    b0 = step[:2, 2] - b1
    numerator = np.array(
        [
            b1[0],
            b0[0] - a[1, 1] * b1[0] + a[0, 1] * b1[1],
            -a[1, 1] * b0[0] + a[0, 1] * b0[1],
        ]
    )
    denominator = np.array([1.0, -np.trace(a), np.linalg.det(a)])
    # delays that make the first point rest, and the second one step from rest
    first = points[..., :1]
    delays = np.concatenate([-numerator[0] * first, (b0[0] - numerator[1]) * first], axis=-1)
    response, _ = lfilter(numerator, denominator, points, axis=-1, zi=delays)
    return response
