# SPDX-License-Identifier: MIT
"""Convolution quadrature: a convolution in time whose kernel is known by its Laplace transform.

    (P * f)(nδt) ≈ Σ_{m ≤ n} p_{n−m} f(mδt),    Σ_n p_n ζⁿ = P(δ(ζ)/δt)

with δ(ζ) = 3/2 − 2ζ + ζ²/2 of the backward differentiation formula of second order (Lubich 1988,
*Convolution quadrature and discretized operational calculus*, Numer. Math. 52, 129–145 and
413–425). The impulse response is never sampled. The formula is A-stable, so P is asked for in the
right half plane alone, and what a passive P describes stays passive in steps. P may grow with s:
for P = s² the weights are those of the formula itself, taken twice.

The weights are the coefficients of a power series, read off a circle |ζ| = ρ around the origin by
a discrete Fourier transform. With 2N points for N weights and

    ρ = (1e-8)^{1/2N},    ρⁿ p_n = (1/2N) Σ_l P(s_l) ζ_l^{−n} ρⁿ,    s_l = δ(ζ_l)/δt

- what is aliased is ρ^{2N} p_{n+2N} = 1e-8 p_{n+2N};
- an error ε of the values P(s_l) comes out as at most ρ^{−n} ε, which reaches 1e4 ε at the last
  weight; errors that differ from point to point average out by √(2N).

So P has to be known some four digits better than the weights shall be. A smaller circle would
alias less and amplify more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import fft

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

ALIASED = 1e-8
"""ρ^{2N}: the share of p_{n+2N} that is found in p_n."""


@dataclass(frozen=True)
class ConvolutionQuadrature:
    """Weights of a convolution in steps.

    Attributes:
        num_steps: N, number of weights.
        dt: Time step δt [s].

    Raises:
        ValueError: If there is no step, or the time step is not positive.
    """

    num_steps: int
    dt: float

    def __post_init__(self) -> None:
        """Check."""
        if self.num_steps < 1:
            raise ValueError(f"num_steps: found {self.num_steps}; expected a whole number from 1")
        if not (np.isfinite(self.dt) and self.dt > 0.0):
            raise ValueError(f"dt: found {self.dt}; expected a positive time step in seconds")

    @property
    def radius(self) -> float:
        """ρ, radius of the circle of ζ [-]."""
        return float(ALIASED ** (0.5 / self.num_steps))

    @property
    def s(self) -> ComplexArray:
        """Complex frequencies where P is needed [rad/s], shape ``(num_steps + 1,)``.

        They are the half of the 2N points with Im s ≥ 0, for P(s̄) is the conjugate of P(s); the
        first and the last are real. The real part of all is positive.
        """
        angle = np.pi / self.num_steps * np.arange(self.num_steps + 1)
        zeta = self.radius * np.exp(-1j * angle)
        zeta[-1] = -self.radius
        return np.asarray((1.5 - 2.0 * zeta + 0.5 * zeta**2) / self.dt)

    def weights(self, values: npt.ArrayLike) -> RealArray:
        """Weights p_n of a kernel, n = 0 to N − 1.

        Args:
            values: P on :attr:`s`, in any unit, shape ``(..., num_steps + 1)``.

        Returns:
            In the unit of P, shape ``(..., num_steps)``.

        Raises:
            ValueError: If the values are not those of :attr:`s` or not finite.
        """
        P = np.asarray(values, dtype=np.complex128)
        if P.ndim == 0 or P.shape[-1] != self.num_steps + 1:
            raise ValueError(
                f"values: found shape {P.shape}; expected {self.num_steps + 1} along the last "
                "axis, one for each s"
            )
        if not np.isfinite(P).all():
            raise ValueError(
                f"values: found {np.count_nonzero(~np.isfinite(P))} that are not finite; expected "
                "finite numbers"
            )
        scaled = fft.irfft(P, 2 * self.num_steps, axis=-1)[..., : self.num_steps]
        return np.asarray(scaled / self.radius ** np.arange(self.num_steps))
