# SPDX-License-Identifier: MIT
"""The energy of a lapse: what comes in, what is stored, what is lost.

With u relative to the motion that is given, the power of the input is that of the inertia forces,
−M r a·u̇. What is stored is kinetic, ½ u̇ᵀM u̇, and in the springs of the law, ½ γ:D_r:γ and
½ ζ_m:D_m:ζ_m; what is lost goes into dashpots, u̇ᵀC u̇, and those of the Maxwell branches,
ζ_m:D_m:ζ_m/τ_m. The rest of stress that moduli leave when they change at a seam does work of its
own while it fades. The balance of all that does not close by itself: it is a check.

Integrals over time are those of quadratic forms. The response lies in few directions, u = W x(t),
so a form is a small matrix WᵀKW, once, and its values at all samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc
from scipy.integrate import simpson
from scipy.interpolate import make_interp_spline

from fenics_hytf.frequency import multiply
from fenics_hytf.lapse.response import Response

RealArray = npt.NDArray[np.float64]

_SPLINE = 5  # degree through the power, for its integral
_FINER = 10  # parts of a sample or of a memory that fades: Simpson's rule is then right to 1e-6


@dataclass(frozen=True)
class Energy:
    """Energy ledger of one lapse [J, in 2D J/m].

    Attributes:
        input: Work of the base motion, and of what static stress leaves out of balance.
        damping: Lost in the ground and in dashpots.
        rest: Work done against the rest of stress that fades after the moduli have changed.
        kinetic: At the start and at the end, of what slips as well.
        strain: In the springs of the law, likewise.
        seam: Stored at the start less stored at the end of the lapse before.
        slip: Lost in the mechanism beyond what gravity brings, Q_y λ.
    """

    input: float
    damping: float
    rest: float
    kinetic: tuple[float, float]
    strain: tuple[float, float]
    seam: float
    slip: float = 0.0

    @property
    def stored(self) -> tuple[float, float]:
        """Kinetic and strain energy at the start and at the end."""
        return self.kinetic[0] + self.strain[0], self.kinetic[1] + self.strain[1]

    @property
    def imbalance(self) -> float:
        """Input less what was lost, released and stored; nought but for numerical errors."""
        start, end = self.stored
        return self.input - self.damping - self.rest - self.slip - (end - start)


class Course:
    """The course of a response over a lapse, both ends included, on few directions.

    Args:
        response: The response.
        comm: Communicator of the unknowns.
    """

    def __init__(self, response: Response, comm: MPI.Comm) -> None:
        given = response.excitation
        # One sample more: the start of the next lapse.
        self._given = replace(given, num_samples=given.num_samples + 1, given=None)
        self._comm = comm
        self._start = given.start if response.start is not None else None
        V, self._y = response.sweep.on_directions(given.weights)
        self._complex = V is not None
        parts = [V.real, -V.imag] if V is not None else []
        if response.start is not None:
            self._c = np.concatenate(response.start.blocks, axis=1).real
            parts.append(self._c)
        self._W = np.concatenate(parts, axis=1) if self._complex else None
        self.time = given.dt * np.arange(given.num_samples + 1, dtype=np.float64)

    def coordinates(self, derivative: int = 0, relaxation_time: float | None = None) -> RealArray:
        """Coordinates x at every sample.

        Args:
            derivative: Order of the time derivative.
            relaxation_time: τ of a branch, for its memory instead of the motion itself.

        Returns:
            Shape ``(num_directions, num_samples + 1)``.
        """
        given = self._given
        factor = given.factors(derivative, relaxation_time)
        y = self._y * factor
        x = given.to_time(y)
        if self._complex:  # Re(Vz) of the analytic signal z, whose imaginary part is Re(−iz)
            x = np.concatenate([x, given.to_time(-1j * y)])
        if self._start is None:
            return x
        if relaxation_time is None:
            held = self._start.at(self.time, derivative)
        else:
            held = self._start.remembered(relaxation_time, self.time)
        held = held - given.to_time(given.start_transform * factor)
        return np.concatenate([x, held]) if self._complex else x + self._c @ held

    def quadratic(self, matrix: PETSc.Mat, x: RealArray) -> RealArray:
        """uᵀKu at every sample (collective).

        Args:
            matrix: K, real and symmetric.
            x: Coordinates of u, as :meth:`coordinates` gives them.

        Returns:
            Shape ``(num_samples + 1,)``.
        """
        if self._W is None:
            image = multiply(matrix, x.astype(np.complex128)).real
            return np.asarray(self._comm.allreduce(np.einsum("nt,nt->t", x, image)))
        # Of its own: on every second number of a complex array products are a hundred times slower.
        image = multiply(matrix, self._W.astype(np.complex128)).real.copy()
        form = self._comm.allreduce(self._W.T @ image)
        return np.asarray(np.einsum("at,at->t", x, form @ x))

    def linear(self, vector: PETSc.Vec, x: RealArray) -> RealArray:
        """fᵀu at every sample (collective), shape ``(num_samples + 1,)``."""
        row = vector.array_r.real
        if self._W is None:
            return np.asarray(self._comm.allreduce(row @ x))
        return np.asarray(self._comm.allreduce(row @ self._W) @ x)

    def integral(self, power: RealArray, relaxation_time: float | None = None) -> float:
        """Over the lapse, of a spline through the samples.

        Args:
            power: At the samples and the end, shape ``(num_samples + 1,)``.
            relaxation_time: τ of e^{−t/τ} that it is to be multiplied by [s], which may fade sooner
                than from one sample to the next.

        Returns:
            The integral.
        """
        degree = _SPLINE if len(power) > _SPLINE else 1
        spline = make_interp_spline(self.time, power, k=degree)
        if relaxation_time is None:
            return float(spline.integrate(self.time[0], self.time[-1]))
        apart = min(self._given.dt, relaxation_time) / _FINER
        fine = np.linspace(self.time[0], self.time[-1], 2 * int(np.ceil(self.time[-1] / apart)) + 1)
        return float(simpson(spline(fine) * np.exp(-fine / relaxation_time), x=fine))
