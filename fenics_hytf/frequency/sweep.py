# SPDX-License-Identifier: MIT
"""What every sweep gives: solutions, projections of them, residuals and counts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fenics_hytf.frequency.columns import Columns

ComplexArray = npt.NDArray[np.complex128]


# From a matrix with as many columns as unknowns to this rank's rows of its product with the
# response, shape (num_local_rows, num_lines).
Response = Callable[[PETSc.Mat], ComplexArray]


class Sweep(Protocol):
    """A solved sweep over frequencies."""

    @property
    def s(self) -> ComplexArray:
        """Complex frequencies [rad/s], shape ``(num_lines,)``."""

    @property
    def residuals(self) -> npt.NDArray[np.float64]:
        """Relative residuals [-], shape ``(num_lines, num_sides)``."""

    @property
    def factorisations(self) -> int:
        """Matrices factorised."""

    @property
    def solves(self) -> int:
        """Solves with them."""

    @property
    def precision(self) -> type[np.complexfloating]:
        """Of responses: single where the tolerance lets nothing finer through."""

    @property
    def has_directions(self) -> bool:
        """Whether all solutions lie in few directions; see :meth:`on_directions`."""

    def solution(self, k: int) -> ComplexArray:
        """Return line ``k``'s solutions on this rank, shape ``(num_local, num_sides)``."""

    def project(self, rows: PETSc.Mat) -> ComplexArray:
        """Multiply every solution by a matrix.

        Args:
            rows: Matrix with as many columns as there are unknowns.

        Returns:
            This rank's rows, shape ``(num_local_rows, num_sides, num_lines)``.
        """

    def response(self, weights: ComplexArray) -> Response:
        """Weigh all right-hand sides together.

        Args:
            weights: Of each right-hand side at each line, shape ``(num_sides, num_lines)``.

        Returns:
            What multiplies the response by matrices, in :attr:`precision`.
        """

    def on_directions(
        self, weights: ComplexArray
    ) -> tuple[tuple[Columns, ...] | None, ComplexArray]:
        """All lines of the weighed response on few directions.

        Args:
            weights: Of each right-hand side at each line, shape ``(num_sides, num_lines)``.

        Returns:
            Directions on this rank, n in all, or ``None`` for the unknowns themselves; and
            coordinates, shape ``(n, num_lines)``.
        """

    def combine(self, weights: ComplexArray) -> ComplexArray:
        """Sum all solutions with weights.

        Args:
            weights: Shape ``(num_sides, num_lines)``.

        Returns:
            Shape ``(num_local,)``.
        """


class DenseSweep:
    """A sweep that holds every solution.

    Args:
        s: Complex frequencies [rad/s], shape ``(num_lines,)``.
        values: This rank's part of the solutions, a column each, all sides of a line together,
            shape ``(num_local, num_lines·num_sides)``, Fortran order.
        residuals: Shape ``(num_lines, num_sides)``.
        factorisations: Matrices factorised.
        solves: Solves.
    """

    precision = np.complex128
    has_directions = False

    def __init__(
        self,
        s: ComplexArray,
        values: ComplexArray,
        residuals: npt.NDArray[np.float64],
        factorisations: int,
        solves: int,
    ) -> None:
        self.s = s
        self.residuals = residuals
        self.factorisations = factorisations
        self.solves = solves
        self._values = values
        self._sides = residuals.shape[1]

    def solution(self, k: int) -> ComplexArray:
        """Return line ``k``'s solutions on this rank, shape ``(num_local, num_sides)``."""
        return self._values[:, k * self._sides : (k + 1) * self._sides]

    def project(self, rows: PETSc.Mat) -> ComplexArray:
        """Multiply every solution by a matrix; see :class:`Sweep`."""
        num_local, count = self._values.shape
        shape = (rows.getLocalSize()[0], len(self.s), self._sides)
        if count == 0:
            return np.empty((shape[0], shape[2], 0), np.complex128)
        everything = PETSc.Mat().createDense(
            ((num_local, None), (None, count)), array=self._values, comm=rows.comm
        )
        product = rows.matMult(everything)
        result = product.getDenseArray().reshape(shape).transpose(0, 2, 1).copy()
        product.destroy()
        everything.destroy()
        return result

    def response(self, weights: ComplexArray) -> Response:
        """Weigh all right-hand sides together; see :class:`Sweep`."""
        return lambda rows: np.einsum("rsk,sk->rk", self.project(rows), weights)

    def on_directions(self, weights: ComplexArray) -> tuple[None, ComplexArray]:
        """The response at the unknowns themselves; see :class:`Sweep`."""
        by_line = self._values.reshape(len(self._values), len(self.s), self._sides)
        return None, np.einsum("nks,sk->nk", by_line, weights)

    def combine(self, weights: ComplexArray) -> ComplexArray:
        """Sum all solutions with weights; see :class:`Sweep`."""
        return self._values @ np.ascontiguousarray(weights.T).ravel()


class JoinedSweep:
    """Sweeps of one system over the same lines, as one: side after side.

    Args:
        parts: The sweeps.
    """

    def __init__(self, *parts: Sweep) -> None:
        self._parts = parts
        self.s = parts[0].s
        self.residuals = np.concatenate([part.residuals for part in parts], axis=1)
        self.factorisations = sum(part.factorisations for part in parts)
        self.solves = sum(part.solves for part in parts)
        self.precision = np.result_type(*(part.precision for part in parts)).type
        self.has_directions = all(part.has_directions for part in parts)
        self._splits = np.cumsum([part.residuals.shape[1] for part in parts])[:-1]

    def solution(self, k: int) -> ComplexArray:
        """Return line ``k``'s solutions on this rank, shape ``(num_local, num_sides)``."""
        return np.concatenate([part.solution(k) for part in self._parts], axis=1)

    def project(self, rows: PETSc.Mat) -> ComplexArray:
        """Multiply every solution by a matrix; see :class:`Sweep`."""
        return np.concatenate([part.project(rows) for part in self._parts], axis=1)

    def response(self, weights: ComplexArray) -> Response:
        """Weigh all right-hand sides together; see :class:`Sweep`."""
        shares = np.split(weights, self._splits)
        responses = [p.response(w) for p, w in zip(self._parts, shares, strict=True)]
        return lambda rows: np.asarray(sum(response(rows) for response in responses))

    def on_directions(
        self, weights: ComplexArray
    ) -> tuple[tuple[Columns, ...] | None, ComplexArray]:
        """On the directions of all parts; see :class:`Sweep`."""
        shares = np.split(weights, self._splits)
        found = [p.on_directions(w) for p, w in zip(self._parts, shares, strict=True)]
        if not self.has_directions:
            return None, np.asarray(sum(y for _, y in found))
        bases = tuple(basis for several, _ in found for basis in several or ())
        return bases, np.concatenate([y for _, y in found])

    def combine(self, weights: ComplexArray) -> ComplexArray:
        """Sum all solutions with weights; see :class:`Sweep`."""
        shares = np.split(weights, self._splits)
        return np.asarray(sum(p.combine(w) for p, w in zip(self._parts, shares, strict=True)))
