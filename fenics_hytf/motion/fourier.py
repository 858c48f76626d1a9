# SPDX-License-Identifier: MIT
"""Fourier amplitude of a motion, its smoothing for the eye, and where it is largest.

The amplitude |∫a e^{-iωt} dt| is |â_k| dt on the lines of the discrete transform. It is smoothed
by the window of Konno and Ohmachi (1998), of equal width at all frequencies of a logarithmic axis:
W(f) = (sin x / x)⁴ with x = b log₁₀(f/f_c).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import fft

from fenics_hytf.motion.spectra import frequencies, to_frequency

RealArray = npt.NDArray[np.float64]

BANDWIDTH = 40.0
"""The customary b: the window falls to zero at 0.83 and 1.20 times its centre."""

_AT_ONCE = 2_000_000  # weights held at a time


def fourier_amplitude(acceleration: npt.ArrayLike, dt: float) -> tuple[RealArray, RealArray]:
    """Fourier amplitude spectrum along the last axis.

    Args:
        acceleration: [m/s^2], shape ``(..., num_samples)``.
        dt: Time step [s].

    Returns:
        Frequency [Hz], shape ``(num_lines,)``, and amplitude [m/s], shape ``(..., num_lines)``.
    """
    samples = np.asarray(acceleration, dtype=np.float64)
    return frequencies(samples.shape[-1], dt), dt * np.abs(to_frequency(samples))


def smoothed(
    frequency: npt.ArrayLike,
    amplitude: npt.ArrayLike,
    centres: npt.ArrayLike,
    bandwidth: float = BANDWIDTH,
) -> RealArray:
    """Smooth an amplitude spectrum by the window of Konno and Ohmachi.

    Args:
        frequency: Of the lines [Hz], shape ``(num_lines,)``; a line at zero has no weight.
        amplitude: In any unit, shape ``(num_lines,)``.
        centres: Where smoothed values are wanted [Hz], positive, shape ``(num_centres,)``.
        bandwidth: b; the larger, the narrower the window.

    Returns:
        In the unit of the amplitude, shape ``(num_centres,)``; NaN where no line has weight.
    """
    lines, values = np.asarray(frequency, np.float64), np.asarray(amplitude, np.float64)
    lines, values = lines[lines > 0.0], values[np.asarray(frequency) > 0.0]
    wanted = np.asarray(centres, np.float64)
    result = np.empty(wanted.size)
    step = max(1, _AT_ONCE // max(lines.size, 1))
    for start in range(0, wanted.size, step):
        block = wanted[start : start + step]
        distance = bandwidth * np.log10(lines / block[:, None])
        weight = np.sinc(distance / np.pi) ** 4
        weight[np.abs(distance) > np.pi] = 0.0  # the main lobe: the rest is below 0.3 %
        total = weight.sum(axis=1)
        with np.errstate(invalid="ignore"):
            result[start : start + step] = (weight @ values) / total
    return result


def dominant_frequency(samples: RealArray, dt: float) -> float:
    """Frequency of a record's largest smoothed Fourier amplitude.

    Smoothed by the window of Konno and Ohmachi, so that a lone line does not decide.

    Args:
        samples: Shape ``(num_motions, num_samples)``.
        dt: Time step [s].

    Returns:
        [Hz], above zero; of several motions that of the strongest.
    """
    strongest = samples[np.argmax(np.sum(samples**2, axis=-1))]
    frequency = frequencies(len(strongest), dt)[1:]
    amplitude = np.abs(fft.rfft(strongest))[1:]
    if not amplitude.any():
        return float(frequency[0])
    centres = np.geomspace(frequency[0], frequency[-1], 400)
    return float(centres[np.nanargmax(smoothed(frequency, amplitude, centres))])
