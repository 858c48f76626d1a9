# SPDX-License-Identifier: MIT
"""Discrete transforms of a lapse and the lines that carry energy.

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
    if max_frequency is not None:
        # a line that is meant to be at the limit may lie a rounding above it
        excited &= frequency <= max_frequency * (1.0 + 1e-12)
    return np.flatnonzero(excited)
