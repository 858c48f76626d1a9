# SPDX-License-Identifier: MIT
"""Discrete transforms of a lapse, the lines that carry energy and the band they lie in.

Time dependence e^{+iωt}: a(t_j) = (1/N) Σ_k â_k e^{+2πi jk/N}, so the forward transform is
scipy's real one. A pure harmonic over whole periods excites one line.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import fft

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


def frequencies(num_samples: int, dt: float) -> RealArray:
    """Frequencies of the lines.

    Args:
        num_samples: Samples in time.
        dt: Time step [s].

    Returns:
        [Hz], shape ``(num_samples // 2 + 1,)``, from 0 to the Nyquist frequency.
    """
    return fft.rfftfreq(num_samples, dt)


def above(frequency: RealArray, max_frequency: float | None) -> npt.NDArray[np.bool_]:
    """Which frequencies lie above a limit; none if it is ``None``, shape as given."""
    # a line that is meant to be at the limit may lie a rounding above it
    limit = np.inf if max_frequency is None else max_frequency * (1.0 + 1e-12)
    return np.asarray(frequency > limit)


def to_frequency(acceleration: npt.ArrayLike) -> ComplexArray:
    """Transform from time to frequency along the last axis.

    Args:
        acceleration: Real samples in any unit, shape ``(..., num_samples)``.

    Returns:
        Coefficients in that unit, shape ``(..., num_samples // 2 + 1)``.
    """
    return fft.rfft(np.asarray(acceleration, dtype=np.float64), axis=-1)


def to_time(coefficients: npt.ArrayLike, num_samples: int) -> RealArray:
    """Transform from frequency to time along the last axis.

    Args:
        coefficients: Shape ``(..., num_samples // 2 + 1)``.
        num_samples: Samples in time; odd and even numbers share a number of lines.

    Returns:
        Real samples, shape ``(..., num_samples)``, in single precision if the coefficients are.

    Raises:
        ValueError: If the numbers of lines and samples do not belong together.
    """
    values = np.asarray(coefficients)
    values = values.astype(np.result_type(values, np.complex64), copy=False)
    if values.shape[-1] != num_samples // 2 + 1:
        raise ValueError(
            f"coefficients: found {values.shape[-1]} lines for {num_samples} samples; expected "
            f"{num_samples // 2 + 1}"
        )
    return fft.irfft(values, n=num_samples, axis=-1)


def excited_lines(
    spectra: npt.ArrayLike,
    dt: float,
    num_samples: int,
    fraction: float = 1e-8,
    max_frequency: float | None = None,
) -> npt.NDArray[np.int64]:
    """Lines that carry energy in any of the motions.

    Args:
        spectra: Coefficients, shape ``(num_motions, num_lines)`` or ``(num_lines,)``.
        dt: Time step [s].
        num_samples: Samples in time.
        fraction: A line counts above this fraction of its motion's largest coefficient. Round-off
            of a transform stays near 1e-15 of it, far below the default.
        max_frequency: Highest frequency [Hz], included; the Nyquist frequency if ``None``.

    Returns:
        Sorted indices of the lines, shape ``(num_excited,)``; empty for motions that are zero.

    Raises:
        ValueError: If the numbers of lines and samples do not belong together.
    """
    amplitude = np.abs(np.atleast_2d(np.asarray(spectra)))
    frequency = frequencies(num_samples, dt)
    if amplitude.shape[-1] != frequency.size:
        raise ValueError(
            f"spectra: found {amplitude.shape[-1]} lines for {num_samples} samples; expected "
            f"{frequency.size}"
        )
    excited = (amplitude > fraction * amplitude.max(axis=1, keepdims=True)).any(axis=0)
    return np.flatnonzero(excited & ~above(frequency, max_frequency))


def band_limited(samples: RealArray, dt: float, max_frequency: float | None) -> RealArray:
    """A record without what lies above a frequency.

    Args:
        samples: Shape ``(num_motions, num_samples)``.
        dt: Time step [s].
        max_frequency: [Hz]; ``None`` leaves the record as it is.

    Returns:
        In the record's unit, same shape.
    """
    if max_frequency is None or max_frequency >= 0.5 / dt:
        return samples
    count = samples.shape[-1]
    period = fft.next_fast_len(2 * count, real=True)  # nothing wraps round
    spectrum = fft.rfft(samples, period, axis=-1)
    spectrum[..., above(frequencies(period, dt), max_frequency)] = 0.0
    return np.asarray(fft.irfft(spectrum, period, axis=-1)[..., :count])


def energy_band(samples: RealArray, dt: float, share: float = 0.99) -> float:
    """Frequency below which lies a share of a record's energy.

    Args:
        samples: Shape ``(num_motions, num_samples)``.
        dt: Time step [s].
        share: [-].

    Returns:
        [Hz]; of several motions the highest; nought for motions that are zero.
    """
    spectrum = np.cumsum(np.abs(fft.rfft(samples, axis=-1)) ** 2, axis=-1)
    frequency = frequencies(samples.shape[-1], dt)
    highest = [frequency[np.searchsorted(e, share * e[-1])] for e in spectrum if e[-1] > 0]
    return float(max(highest, default=0.0))
