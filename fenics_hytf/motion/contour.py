# SPDX-License-Identifier: MIT
"""The damped contour: transforms along s = η + iω, which know a start and forget a wrap-around.

    X(s) = ∫ x(t) e^{−st} dt,    x(t) = e^{ηt} (1/T_p) Σ_k X(s_k) e^{iω_k t},    ω_k = 2πk/T_p

With η > 0 what would come round after the period T_p comes back e^{−ηT_p} times smaller, and no
undamped resonance lies on the way (exponential window; Kausel and Roësset 1992). A function that
starts with a jump, in itself or in a derivative, has a transform that fades slowly and is aliased;
so a few *start functions* φ_k(t) = t^k/k! e^{−bt}, Φ_k(s) = 1/(s + b)^{k+1}, are fitted to its
first derivatives, taken out before the discrete transform and put back in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb, factorial

import numpy as np
import numpy.typing as npt
from scipy import fft
from scipy.interpolate import BSpline, make_interp_spline

from fenics_hytf.motion.spectra import above, frequencies

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

# b is at least 20/T_p, so that start functions fade, and at least a fraction of the highest
# circular frequency: the slower they fade the larger they become, and what is left after they are
# taken out is a small difference. With more than 0.05 of it the rest is no longer smooth.
_START_RATE, _START_SHARE = 20.0, 0.03
_APART = 0.1  # of a rate 1/τ, by which b keeps away from it: partial fractions would cancel
_SPLINE = 5  # degree through a record, for its derivatives


@dataclass(frozen=True)
class Contour:
    """Lines s_k of a damped transform.

    Attributes:
        period: Samples of the period T_p.
        dt: Time step [s].
        eta: η [1/s].
    """

    period: int
    dt: float
    eta: float

    @classmethod
    def over(cls, num_samples: int, dt: float, times: int, decay: float) -> Contour:
        """The contour for a stretch of time.

        Args:
            num_samples: Samples of the stretch.
            dt: Time step [s].
            times: T_p over the stretch.
            decay: ηT_p [-].

        Returns:
            The contour.
        """
        period = times * num_samples
        return cls(period, dt, decay / (period * dt))

    @property
    def s(self) -> ComplexArray:
        """Complex frequencies up to the Nyquist frequency [rad/s], shape ``(period//2 + 1,)``."""
        return np.asarray(self.eta + 2j * np.pi * frequencies(self.period, self.dt))

    def lines(self, max_frequency: float | None) -> npt.NDArray[np.intp]:
        """Numbers of the lines up to a frequency [Hz]; of all if ``None``."""
        return np.flatnonzero(~above(frequencies(self.period, self.dt), max_frequency))

    def growth(self, num_samples: int) -> RealArray:
        """e^{ηt} of the first samples, shape ``(num_samples,)``."""
        return np.exp(self.eta * self.dt * np.arange(num_samples))

    def transform(self, samples: RealArray, derivatives: RealArray) -> ComplexArray:
        """X(s)/dt of a function that is zero before t = 0.

        Args:
            samples: x from t = 0, at most ``period`` of them; nought after, shape
                ``(..., num_samples)``.
            derivatives: x, ẋ, ẍ at t = 0 from above, shape ``(..., 3)``.

        Returns:
            On :attr:`s`, in the unit of x, shape ``(..., period//2 + 1)``.
        """
        start = StartFunctions.fading_in(self)
        c = start.coefficients(derivatives)
        whole = np.zeros((*samples.shape[:-1], self.period))
        whole[..., : samples.shape[-1]] = samples
        whole -= c @ start.in_time(self.period)[: c.shape[-1]]
        rest = fft.rfft(whole / self.growth(self.period), axis=-1)
        return np.asarray(rest + c @ start.transformed(self.s)[: c.shape[-1]] / self.dt)


@dataclass(frozen=True)
class StartFunctions:
    """φ_k(t) = t^k/k! e^{−bt} for k = 0 to 3, and what becomes of them.

    Attributes:
        rate: b [1/s].
        dt: Time step [s].
    """

    rate: float
    dt: float

    COUNT = 4

    @classmethod
    def fading_in(
        cls,
        contour: Contour,
        max_frequency: float | None = None,
        rates: tuple[float, ...] = (),
    ) -> StartFunctions:
        """Start functions that have faded long before the period ends.

        Args:
            contour: The contour.
            max_frequency: Of the lines that are used [Hz]; the Nyquist frequency if ``None``.
            rates: 1/τ of memories that will be asked for [1/s]; b keeps away from them.

        Returns:
            The functions.
        """
        highest = 2 * np.pi * min(max_frequency or np.inf, 0.5 / contour.dt)
        rate = max(_START_RATE / (contour.period * contour.dt), _START_SHARE * highest)
        for other in sorted(rates):
            if abs(rate - other) < _APART * other:
                rate = (1 + _APART) * other
        return cls(rate, contour.dt)

    def coefficients(self, derivatives: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Of Σ c_k φ_k with given derivatives at t = 0: c_k = Σ_j C(k, j) b^{k−j} x^(j)(0).

        Args:
            derivatives: x, ẋ, ... at t = 0, shape ``(..., n)``, n at most 4.

        Returns:
            c, shape ``(..., n)``.
        """
        given = np.asarray(derivatives)
        n, b = given.shape[-1], self.rate
        rows = [[comb(k, j) * b ** (k - j) if j <= k else 0.0 for j in range(n)] for k in range(n)]
        return np.asarray(given @ np.array(rows).reshape(n, n).T)

    def transformed(self, s: ComplexArray) -> ComplexArray:
        """Φ_k(s) [s^{k+1}], shape ``(4, num_lines)``."""
        orders = np.arange(1, self.COUNT + 1)[:, None]
        return np.asarray(1.0 / (s + self.rate) ** orders)

    def in_time(self, num_samples: int, derivative: int = 0) -> RealArray:
        """A derivative of φ_k at the first samples.

        Args:
            num_samples: Number of samples.
            derivative: Its order.

        Returns:
            Shape ``(4, num_samples)``.
        """
        return self.at(self.dt * np.arange(num_samples, dtype=np.float64), derivative)

    def at(self, time: RealArray, derivative: int = 0) -> RealArray:
        """A derivative of φ_k at some instants [s], shape ``(4, len(time))``.

        By the product rule, dφ_k/dt = φ_{k−1} − b φ_k.
        """
        values = np.stack([time**k / factorial(k) for k in range(self.COUNT)])
        values *= np.exp(-self.rate * time)
        for _ in range(derivative):
            before = np.concatenate([np.zeros((1, len(time))), values[:-1]])
            values = before - self.rate * values
        return values

    def remembered(self, relaxation_time: float, time: RealArray) -> RealArray:
        """L⁻¹[κ Φ_k] with κ = sτ/(1 + sτ): what a Maxwell branch makes of φ_k.

        1/((s + a)(s + b)^{k+1}) = (1/(s + b)^{k+1} − 1/((s + a)(s + b)^k))/(a − b), a = 1/τ,
        term by term; κ Φ_k = Φ_k − a Φ_k/(s + a).

        Args:
            relaxation_time: τ [s].
            time: Instants [s], shape ``(n,)``.

        Returns:
            Shape ``(4, n)``.
        """
        a, values = 1 / relaxation_time, self.at(time)
        found = np.empty_like(values)
        lagged = np.exp(-a * time)
        for k in range(self.COUNT):
            lagged = (values[k] - lagged) / (a - self.rate)
            found[k] = values[k] - a * lagged
        return found


@dataclass(frozen=True)
class LapseRecord:
    """A record as lapses on a damped contour take it: it does not end where a lapse does.

    Attributes:
        samples: The whole record, zero after its end, shape ``(num_motions, num_samples)``.
        dt: Time step [s].
    """

    samples: RealArray
    dt: float

    @cached_property
    def _spline(self) -> BSpline:
        count = self.samples.shape[1]
        time = self.dt * np.arange(count)
        return make_interp_spline(time, self.samples, k=_SPLINE if count > _SPLINE else 1, axis=1)

    @cached_property
    def derivatives(self) -> RealArray:
        """The record with two derivatives, from a spline, shape ``(3, num_motions, num_samples)``.

        Units of the record, over s and over s².
        """
        time = self.dt * np.arange(self.samples.shape[1])
        parts = [self.samples]
        for order in (1, 2):
            known = order <= self._spline.k
            found = self._spline.derivative(order)(time) if known else 0 * self.samples
            parts.append(np.asarray(found))
        return np.stack(parts)

    def between(self, start: int, stop: int, substeps: int) -> RealArray:
        """The record between samples too, from the spline, which is close to what lines make of it.

        Args:
            start: First sample.
            stop: Last one; the record is nought beyond its end.
            substeps: Steps from one sample to the next.

        Returns:
            Shape ``(num_motions, (stop − start)·substeps + 1)``.
        """
        steps = start + np.arange((stop - start) * substeps + 1) / substeps
        inside = steps <= self.samples.shape[1] - 1
        return np.where(inside, self._spline(self.dt * np.where(inside, steps, 0.0)), 0.0)

    def weights(self, contour: Contour, start: int, num_samples: int) -> ComplexArray:
        """Transform of a lapse, X(s)/dt.

        The record runs on past the lapse under a taper of half its length: what is to come must
        not be felt as an end.

        Args:
            contour: The contour.
            start: First sample of the lapse.
            num_samples: Samples of the lapse.

        Returns:
            On the contour's lines, in the record's unit, shape ``(num_motions, num_lines)``.
        """
        # A lapse that was cut short fades as slowly as a whole one.
        over = min(max(num_samples // 2, contour.period // 12), contour.period - num_samples)
        taper = np.cos(0.5 * np.pi * (np.arange(over) + 0.5) / max(over, 1)) ** 2
        shape = np.concatenate([np.ones(num_samples), taper])
        piece = self.samples[:, start : start + len(shape)]
        piece = piece * shape[: piece.shape[1]]
        return contour.transform(piece, self.derivatives[:, :, start].T)
