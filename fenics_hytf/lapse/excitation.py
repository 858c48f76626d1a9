# SPDX-License-Identifier: MIT
"""The input of a lapse at the lines that are solved, and the way back to time.

A line is a complex frequency s = η + iω. Under ``steady`` continuity η = 0, the period is the lapse
and only lines that carry energy are solved. On a damped contour the period is longer than the lapse
and every line up to the maximum frequency counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fenics_hytf.motion import Contour, Segment, StartFunctions, to_time

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Excitation:
    """The input of one lapse at the lines that are solved.

    Attributes:
        lines: Numbers of the solved lines, shape ``(num_lines,)``.
        weights: Coefficients of what the right-hand sides are multiplied by, shape
            ``(num_sides, num_lines)``: those of the base acceleration [m/s^2] of each motion and,
            where something is carried over from the lapse before, of that as one more side.
        axes: Component in which each motion acts.
        period: Samples of the transform's period.
        dt: Time step [s].
        excited: Lines above the threshold.
        num_samples: Samples of the lapse; the period's if not given.
        eta: η [1/s].
        given: Base acceleration that total accelerations are made of [m/s^2], shape
            ``(num_motions, num_samples)``; that of the lines if ``None``.
        start: Functions that hold the start of the response, or ``None`` without any.
    """

    lines: npt.NDArray[np.intp]
    weights: ComplexArray
    axes: tuple[int, ...]
    period: int
    dt: float
    excited: int
    num_samples: int = 0
    eta: float = 0.0
    given: RealArray | None = None
    start: StartFunctions | None = None

    def __post_init__(self) -> None:
        """A lapse is as long as the period where nothing else is said."""
        if not self.num_samples:
            object.__setattr__(self, "num_samples", self.period)

    @classmethod
    def on_contour(
        cls,
        contour: Contour,
        max_frequency: float | None,
        weights: ComplexArray,
        axes: tuple[int, ...],
        segment: Segment,
        motion: RealArray,
        start: StartFunctions,
    ) -> Excitation:
        """The input of a lapse on a damped contour.

        Args:
            contour: The contour.
            max_frequency: Of the lines that are solved [Hz]; the Nyquist frequency if ``None``.
            weights: Of the motions on all lines of the contour, shape
                ``(num_motions, period//2 + 1)``.
            axes: Component in which each motion acts.
            segment: The lapse; something is carried into all but the first.
            motion: Base acceleration of the whole record [m/s^2], shape
                ``(num_motions, num_record_samples)``.
            start: Functions that hold the start of the response.

        Returns:
            The input.
        """
        lines = contour.lines(max_frequency)
        weights = weights[:, lines]
        if segment.index:  # the transform of what is carried is over dt as well
            weights = np.concatenate([weights, np.full((1, len(lines)), 1 / contour.dt)])
        return cls(
            lines,
            weights,
            axes,
            contour.period,
            contour.dt,
            excited=len(lines),
            num_samples=segment.num_samples,
            eta=contour.eta,
            given=motion[:, segment.samples],
            start=start,
        )

    @property
    def carries(self) -> bool:
        """Whether what is carried over from the lapse before is one more side."""
        return len(self.weights) > len(self.axes)

    @property
    def duration(self) -> float:
        """Length of the lapse [s]."""
        return self.num_samples * self.dt

    @property
    def frequency(self) -> RealArray:
        """Of the lines [Hz]."""
        return self.lines / (self.period * self.dt)

    @property
    def omega(self) -> RealArray:
        """Circular frequency of the lines [rad/s]."""
        return 2 * np.pi * self.frequency

    @cached_property
    def s(self) -> ComplexArray:
        """Complex frequency η + iω of the lines [rad/s]."""
        return np.asarray(self.eta + 1j * self.omega, np.complex128)

    @property
    def motion_weights(self) -> ComplexArray:
        """Those of the motions alone, shape ``(num_motions, num_lines)``."""
        return self.weights[: len(self.axes)]

    @cached_property
    def base_acceleration(self) -> RealArray:
        """Of the base, on the solved lines [m/s^2], shape ``(num_motions, num_samples)``."""
        return self.to_time(self.motion_weights) if self.given is None else self.given

    @cached_property
    def _places(self) -> slice | npt.NDArray[np.intp]:
        """The lines among all: as a slice where they are neighbours, which is copied faster."""
        first, last = self.lines[[0, -1]] if len(self.lines) else (0, -1)
        return slice(first, last + 1) if last + 1 - first == len(self.lines) else self.lines

    @cached_property
    def _growth(self) -> RealArray | None:
        """e^{ηt} of the samples."""
        time = self.dt * np.arange(self.num_samples)
        return np.exp(self.eta * time) if self.eta else None

    def shortened(self, num_samples: int) -> Excitation:
        """The input of a lapse that ends sooner; the response in it is the same.

        Args:
            num_samples: Samples of it, not more than there are.

        Returns:
            The input.
        """
        given = None if self.given is None else self.given[:, :num_samples]
        return replace(self, num_samples=num_samples, given=given)

    def between(self, coefficients: ComplexArray, substeps: int) -> RealArray:
        """Sum the lines at every sample, between samples, and at the end of the lapse.

        Args:
            coefficients: Shape ``(..., num_lines)``.
            substeps: Steps from one sample to the next.

        Returns:
            Shape ``(..., num_samples·substeps + 1)``.
        """
        longer = replace(self, num_samples=self.num_samples + 1)
        shifts = self.dt / substeps * np.arange(substeps)
        parts = [longer.to_time(coefficients * np.exp(self.s * shift)) for shift in shifts]
        flat = np.stack(parts, axis=-1).reshape(*coefficients.shape[:-1], -1)
        return flat[..., : self.num_samples * substeps + 1]

    def to_time(self, coefficients: ComplexArray) -> RealArray:
        """Sum the lines at every sample.

        Args:
            coefficients: Shape ``(..., num_lines)``.

        Returns:
            Shape ``(..., num_samples)``, of the same precision.
        """
        shape = (*coefficients.shape[:-1], self.period // 2 + 1)
        spectrum = np.zeros(shape, coefficients.dtype)
        spectrum[..., self._places] = coefficients
        values = to_time(spectrum, self.period)[..., : self.num_samples]
        return values if self._growth is None else values * self._growth.astype(values.dtype)

    def factors(self, derivative: int = 0, relaxation_time: float | None = None) -> ComplexArray:
        """What a derivative or a memory multiplies the lines by: s^n, κ = sτ/(1 + sτ).

        Args:
            derivative: n.
            relaxation_time: τ of a Maxwell branch that the lines go through, or ``None``.

        Returns:
            Shape ``(num_lines,)``.
        """
        factor = self.s**derivative
        if relaxation_time is None:
            return factor
        return factor * self.s * relaxation_time / (1 + self.s * relaxation_time)

    def sum_at(self, time: float) -> ComplexArray:
        """Factors of the lines in the sum at one instant.

        Real parts of the sum are the response; lines but the first and the last one of an even
        number of samples stand for their negative twins as well.

        Args:
            time: After the start of the lapse [s].

        Returns:
            Shape ``(num_lines,)``.
        """
        twice = np.where(self.lines == 0, 1.0, 2.0)
        if self.period % 2 == 0:
            twice = np.where(self.lines == self.period // 2, 1.0, twice)
        return np.asarray(twice / self.period * np.exp(self.s * time))

    @cached_property
    def start_transform(self) -> ComplexArray:
        """Coefficients of the start functions on the lines, shape ``(4, num_lines)``."""
        assert self.start is not None
        return self.start.transformed(self.s) / self.dt

    def start_at(
        self, time: float, derivative: int = 0, relaxation_time: float | None = None
    ) -> RealArray:
        """A start function at an instant, less what the lines make of it.

        Args:
            time: After the start of the lapse [s].
            derivative: Order of the time derivative.
            relaxation_time: τ of a Maxwell branch that the function goes through, or ``None``.

        Returns:
            Shape ``(4,)``.
        """
        assert self.start is not None
        instant = np.array([time])
        if relaxation_time is None:
            exact = self.start.at(instant, derivative)
        else:
            exact = self.start.remembered(relaxation_time, instant)
        factors = self.factors(derivative, relaxation_time)
        lines = self.start_transform @ (factors * self.sum_at(time))
        return np.asarray(exact[:, 0] - lines.real)
