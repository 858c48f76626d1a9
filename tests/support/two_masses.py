# SPDX-License-Identifier: MIT
"""Two masses above a seam that yields one way: the kernel of its slip, and its march in time."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from fenics_hytf.motion import ConvolutionQuadrature

STEP = 0.005  # [s]


@dataclass(frozen=True)
class TwoMasses:
    """A spring that yields one way below two masses, damped by the mass and in the upper spring.

    Attributes:
        mass_damping: α of C = αM [1/s].
    """

    mass_damping: float
    mass = np.array([1.5, 1.0])
    seam = 300.0
    spring = 120.0
    spring_damping = 0.4
    phi = np.ones(2)

    @property
    def M(self) -> np.ndarray:
        return np.diag(self.mass)

    @property
    def C(self) -> np.ndarray:
        return self.mass_damping * self.M + self.spring_damping * np.array([[1, -1], [-1, 1.0]])

    @property
    def K(self) -> np.ndarray:
        spring = self.spring * np.array([[1, -1], [-1, 1.0]])
        return spring + np.diag([self.seam, 0.0])

    def kernel(self, s: np.ndarray, damped: bool = True) -> np.ndarray:
        """P = (φᵀb − bᵀA⁻¹b)/s² with b = (s²M + sC)φ, or with s²Mφ alone."""
        z = s[:, None, None]
        A = z**2 * self.M + z * self.C + self.K
        b = (z**2 * self.M + (z * self.C if damped else 0.0)) @ self.phi
        w = np.linalg.solve(A, b[..., None])[..., 0]
        return (b @ self.phi - np.sum(b * w, axis=1)) / s**2

    def weights(self, num: int, dt: float, damped: bool = True) -> np.ndarray:
        quadrature = ConvolutionQuadrature(num, dt)
        return quadrature.weights(self.kernel(quadrature.s, damped))

    def linear(self, force: np.ndarray, dt: float, start: np.ndarray) -> np.ndarray:
        """w and ẇ, shape (4, n), exact for a force (2, n) that is linear from step to step."""
        inverse = np.linalg.inv(self.M)
        rates = np.zeros((8, 8))
        rates[:2, 2:4] = rates[4:6, 6:8] = np.eye(2)
        rates[2:4, :4] = -inverse @ np.hstack([self.K, self.C])
        rates[2:4, 4:6] = inverse
        step = expm(rates * dt)
        state = np.empty((4, force.shape[1]))
        state[:, 0] = start
        for n in range(force.shape[1] - 1):
            slope = (force[:, n + 1] - force[:, n]) / dt
            state[:, n + 1] = step[:4] @ np.concatenate([state[:, n], force[:, n], slope])
        return state

    def elastoplastic(self, drive: np.ndarray, dt: float, limit: float) -> float:
        """Slip by the average acceleration method, with return mapping of the seam's force."""
        above = self.K - np.diag([self.seam, 0.0])
        effective = above + 2 / dt * self.C + 4 / dt**2 * self.M
        slipping = np.linalg.inv(effective)
        sticking = np.linalg.inv(effective + np.diag([self.seam, 0.0]))
        u, v, a, slip = np.zeros(2), np.zeros(2), drive[0] * self.phi, 0.0
        for load in np.outer(drive[1:], self.mass):
            right = load + self.M @ (4 / dt * v + a) + self.C @ v - above @ u
            step = sticking @ (right - [self.seam * (u[0] - slip), 0.0])
            if self.seam * (u[0] + step[0] - slip) > limit:
                step = slipping @ (right - [limit, 0.0])
                slip = u[0] + step[0] - limit / self.seam
            u, a = u + step, 4 / dt**2 * step - 4 / dt * v - a
            v = 2 / dt * step - v
        return slip


LIMIT = 4.0  # [N], of the seam; the linear response drives it with four times as much


def burst(dt: float, duration: float = 6.0) -> np.ndarray:
    """Waves of 0.9 and 2.3 Hz that swell and fade every six seconds."""
    time = dt * np.arange(round(duration / dt) + 1)
    waves = np.sin(2 * np.pi * 0.9 * time) + 0.6 * np.sin(2 * np.pi * 2.3 * time + 1.0)
    return 4.0 * waves * np.sin(np.pi * time / 6.0) ** 2


def linear_driving(system: TwoMasses, drive: np.ndarray, dt: float) -> np.ndarray:
    """Q_lin, which is the force of the seam."""
    load = np.outer(system.mass, drive)
    return system.seam * system.linear(load, dt, np.zeros(4))[0]
