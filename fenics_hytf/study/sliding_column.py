# SPDX-License-Identifier: MIT
"""A column that slides on a seam, marched in time: what slip on level seams is compared with.

Linear cells of lumped mass stand on a seam without mass that yields at Q_y = k_y g × the mass
above and slips by λ, one way. A drive a = −ü_b acts along the slip. Damping C = βK, of a given
ratio at the site period T_s = 4H/V_s, is that of the cells alone: the seam has none. (Damping its
elastic strain makes slips up to a tenth smaller; damping its slip leaves 3 to 36 % of them.)

    M ü + C u̇ + K u + k (u_0 − λ) e_0 = M r a,   Q = k (u_0 − λ) ≤ Q_y,   λ̇ ≥ 0,   λ̇ (Q_y − Q) = 0

The average acceleration method (Newmark 1959) takes each step elastically; where that leaves
Q > Q_y, return mapping (Simo and Hughes 1998, §1.4) finds the Δλ that ends the step on Q = Q_y:
u = u* + Δλ k A⁻¹ e_0, with A the effective stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

RealArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Column:
    """Uniform cells on a seam.

    Attributes:
        shear_wave_velocity: V_s [m/s].
        height: H [m].
        cells: Number of cells.
        density: ρ [kg/m^3].
        seam: Thickness of the seam [m]; it has the modulus of the cells, and no mass.
        damping: Damping ratio at the site period [-].

    Raises:
        ValueError: A number is out of range.
    """

    shear_wave_velocity: float
    height: float = 30.0
    cells: int = 15
    density: float = 1800.0
    seam: float = 0.5
    damping: float = 0.05

    def __post_init__(self) -> None:
        """Check."""
        for name in ("shear_wave_velocity", "height", "cells", "density", "seam"):
            if not (np.isfinite(value := getattr(self, name)) and value > 0):
                raise ValueError(f"{name}: found {value}; expected a positive number")
        if not 0.0 <= self.damping < 1.0:
            raise ValueError(f"damping: found {self.damping}; expected a ratio from 0 to 1")

    @property
    def mass(self) -> RealArray:
        """Of the nodes from the seam up [kg/m^2], shape ``(cells + 1,)``."""
        mass = np.full(self.cells + 1, self.density * self.height / self.cells)
        mass[[0, -1]] /= 2
        return mass

    @property
    def stiffness(self) -> RealArray:
        """Of the cells [N/m^3], shape ``(cells + 1, cells + 1)``."""
        spring = self._modulus * self.cells / self.height
        difference = np.diff(np.eye(self.cells + 1), axis=0)
        return spring * difference.T @ difference

    @property
    def seam_stiffness(self) -> float:
        """Of the seam, k [N/m^3]."""
        return self._modulus / self.seam

    @property
    def beta(self) -> float:
        """β [s]."""
        return self.damping * 4 * self.height / self.shear_wave_velocity / np.pi

    @property
    def _modulus(self) -> float:
        return self.density * self.shear_wave_velocity**2


def elastoplastic_column(
    column: Column,
    drive: npt.ArrayLike,
    dt: float,
    yield_acceleration: float,
    substeps: int = 4,
) -> RealArray:
    """Slip of a column's seam.

    Args:
        column: The column.
        drive: a, minus the acceleration of the base [m/s^2], linear between samples, shape
            ``(num_samples,)``.
        dt: From sample to sample [s].
        yield_acceleration: k_y g [m/s^2].
        substeps: Steps a sample.

    Returns:
        λ at the samples [m], shape ``(num_samples,)``.

    Raises:
        ValueError: A number is out of range.
    """
    samples = np.array(drive, dtype=np.float64)
    if samples.ndim != 1 or samples.size < 2 or not np.isfinite(samples).all():
        raise ValueError(
            f"drive: found shape {samples.shape}; expected one row of at least 2 finite samples"
        )
    if not (dt > 0.0 and yield_acceleration > 0.0 and substeps >= 1):
        raise ValueError(
            f"dt, yield_acceleration, substeps: found {dt}, {yield_acceleration}, {substeps}; "
            "expected positive numbers"
        )
    M, h, k = column.mass, dt / substeps, column.seam_stiffness
    C = column.beta * column.stiffness
    effective = column.stiffness + 2 / h * C + np.diag(4 / h**2 * M)
    effective[0, 0] += k
    inverse = np.linalg.inv(effective)
    strength = yield_acceleration * M.sum()
    steps = np.arange((samples.size - 1) * substeps + 1) / substeps
    fine = np.interp(steps, np.arange(samples.size), samples)
    u, v = np.zeros_like(M), np.zeros_like(M)
    acceleration = np.full_like(M, fine[0])
    slip = np.zeros(fine.size)
    for step, a in enumerate(fine[1:], start=1):
        right = M * (a + acceleration + 4 / h * v + 4 / h**2 * u) + C @ (v + 2 / h * u)
        right[0] += k * slip[step - 1]
        new = inverse @ right
        excess = k * (new[0] - slip[step - 1]) - strength
        advance = max(excess, 0.0) / (k * (1.0 - k * inverse[0, 0]))
        new += advance * k * inverse[:, 0]
        slip[step] = slip[step - 1] + advance
        before, v = v, 2 / h * (new - u) - v
        acceleration = 2 / h * (v - before) - acceleration
        u = new
    return slip[::substeps]
