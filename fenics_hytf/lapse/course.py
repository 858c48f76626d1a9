# SPDX-License-Identifier: MIT
"""The course of a reduced response over a lapse, on the few directions that it lies in.

A reduced sweep gives the response on the columns of V, and with it the course in time:

    u(t) = Re(V z(t)) + C φ(t) = W x(t),    W = [Re V, −Im V, C],

with C φ what the start functions hold. The coordinates x are brought to time once; what rows of a
matrix see is then a product with them, and a quadratic form is a small matrix WᵀKW.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.integrate import simpson
from scipy.interpolate import make_interp_spline

from fenics_hytf.frequency import multiply, real_rows
from fenics_hytf.lapse.response import Response

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_SPLINE = 5  # degree through the power, for its integral
_FINER = 10  # parts of a sample or of a memory that fades: Simpson's rule is then right to 1e-6
_AT_ONCE = 64  # columns of W that a matrix is multiplied by: their images stay small


class Course:
    """The course of a response over a lapse, both ends included.

    Of a sweep that holds every solution the directions are the unknowns themselves, W = I.

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
        self._response = response
        self._bases, self._y = response.sweep.on_directions(given.weights)
        if self._bases is None and response.start is not None:
            self._c = np.concatenate(response.start.blocks, axis=1).real
        self.time = given.dt * np.arange(given.num_samples + 1, dtype=np.float64)
        self._directions: RealArray | None = None

    @property
    def _W(self) -> RealArray | None:
        """W on this rank, shape ``(num_local, num_directions)``; ``None`` for the unknowns."""
        if self._directions is None and self._bases is not None:
            blocks = [block for basis in self._bases for block in basis.blocks]
            parts = [block.real for block in blocks] + [-block.imag for block in blocks]
            if self._response.start is not None:
                parts += [block.real for block in self._response.start.blocks]
            self._directions = np.concatenate(parts, axis=1)
        return self._directions

    def seen_by(self, rows: PETSc.Mat) -> RealArray:
        """A matrix times W (collective).

        Args:
            rows: Matrix with as many columns as there are unknowns.

        Returns:
            This rank's rows, shape ``(num_local_rows, num_directions)``.
        """
        assert self._bases is not None
        seen = [basis.seen_by(rows) for basis in self._bases]
        parts = [part.real for part in seen] + [-part.imag for part in seen]
        if self._response.start is not None:
            parts.append(self._response.start.seen_by(rows).real)
        return np.concatenate(parts, axis=1)

    def coordinates(self, derivative: int = 0, relaxation_time: float | None = None) -> RealArray:
        """Coordinates x at every sample.

        Args:
            derivative: Order of the time derivative.
            relaxation_time: τ of a branch, for its memory instead of the motion itself.

        Returns:
            Shape ``(num_directions, num_samples + 1)``.
        """
        if self._start is None:
            held = None
        elif relaxation_time is None:
            held = self._start.at(self.time, derivative)
        else:
            held = self._start.remembered(relaxation_time, self.time)
        return self.through(self._given.factors(derivative, relaxation_time), held)

    def through(self, factor: ComplexArray, held: RealArray | None) -> RealArray:
        """Coordinates of what the response becomes by a factor on its lines.

        Args:
            factor: Of each line, shape ``(num_lines,)``.
            held: What the start functions become by it at some first samples, shape ``(4, n)``, or
                ``None`` without a start, for all samples.

        Returns:
            Shape ``(num_directions, n)``.
        """
        given = self._given
        y = self._y * factor
        x = given.to_time(y)
        if self._bases is not None:  # Re(Vz) of the analytic signal z; its imaginary part: Re(−iz)
            x = np.concatenate([x, given.to_time(-1j * y)])
        if held is None:
            return x
        count = held.shape[1]
        held = held - given.to_time(given.start_transform * factor)[:, :count]
        x = x[:, :count]
        return x + self._c @ held if self._bases is None else np.concatenate([x, held])

    def quadratic(self, matrix: PETSc.Mat, x: RealArray) -> RealArray:
        """uᵀKu at every sample (collective).

        Args:
            matrix: K, real and symmetric.
            x: Coordinates of u, as :meth:`coordinates` gives them.

        Returns:
            Shape ``(num_samples + 1,)``.
        """
        W = self._W
        rows = real_rows(matrix) if self._comm.size == 1 else None
        if W is None or x.shape[1] < W.shape[1] // 2:
            u = x if W is None else W @ x
            return np.asarray(self._comm.allreduce(np.sum(u * _image(matrix, rows, u), axis=0)))
        form = np.zeros((W.shape[1], W.shape[1]))
        left = W.T
        if rows is not None and 2 * np.count_nonzero(np.diff(rows.indptr)) < len(W):
            some = np.flatnonzero(np.diff(rows.indptr))  # dashpots have few
            left, rows = W[some].T, rows[some]
        for first in range(0, W.shape[1], _AT_ONCE):
            columns = slice(first, first + _AT_ONCE)
            form[first:, columns] = left[first:] @ _image(matrix, rows, W[:, columns])
        lower = np.tril(self._comm.allreduce(form))
        form = lower + np.tril(lower, -1).T
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


def _image(matrix: PETSc.Mat, rows: sparse.csr_matrix | None, u: RealArray) -> RealArray:
    """K u: of a serial matrix by its real rows, or some of them (collective)."""
    if rows is not None:
        return np.asarray(rows @ np.ascontiguousarray(u))
    # Of its own: on every second number of a complex array products are a hundred times slower.
    return multiply(matrix, u.astype(np.complex128)).real.copy()
