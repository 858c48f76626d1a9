# SPDX-License-Identifier: MIT
"""Products of the system's real matrices with blocks of complex vectors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.frequency.system import DynamicSystem

ComplexArray = npt.NDArray[np.complex128]


class TermProducts:
    """K_j X of each term of a system, in the scale of its stiffness.

    Unknowns are taken times the root of the first term's diagonal, and forces over it: beside soft
    ground the small motion of stiff ground would drown in the round-off of the large one.

    Args:
        system: The system.

    Attributes:
        scale: What an unknown was divided by to be in scale, shape ``(num_local,)``: x = scale x̂,
            b̂ = scale b.
    """

    def __init__(self, system: DynamicSystem) -> None:
        self.functions = [function for _, function in system.terms]
        self.comm: MPI.Comm = system.comm.tompi4py()
        self._matrices = [matrix for matrix, _ in system.terms]
        self.scale = _scale(self._matrices[0], self.comm)
        self._local: list[sparse.csr_matrix] = []
        if self.comm.size == 1:
            scale = sparse.diags(self.scale)
            scaled = [scale @ real_rows(matrix) @ scale for matrix in self._matrices]
            self._local = [sparse.csr_matrix(matrix) for matrix in scaled]

    def __len__(self) -> int:
        return len(self.functions)

    def __call__(self, term: int, X: ComplexArray) -> ComplexArray:
        """K̂_j X.

        Args:
            term: j.
            X: Shape ``(num_local, n)``.

        Returns:
            Shape ``(num_local, n)``.
        """
        if self._local:
            return times(self._local[term], X)
        scale = self.scale[:, None]
        return scale * multiply(self._matrices[term], scale * X)

    def weighted(self, factors: Sequence[complex], x: ComplexArray) -> ComplexArray:
        """Σ factor_j K̂_j x.

        Args:
            factors: Of each term.
            x: Shape ``(num_local,)``.

        Returns:
            Shape ``(num_local,)``.
        """
        total = np.zeros_like(x)
        for term in np.flatnonzero(factors):
            total += factors[term] * self(int(term), x[:, None])[:, 0]
        return total


def _scale(stiffness: PETSc.Mat, comm: MPI.Comm) -> npt.NDArray[np.float64]:
    diagonal = stiffness.getDiagonal()
    size = np.abs(diagonal.array_r)
    diagonal.destroy()
    largest = comm.allreduce(float(size.max(initial=0.0)), MPI.MAX)
    return np.asarray(1 / np.sqrt(np.where(size > 0, size, largest or 1.0)))


def multiply(matrix: PETSc.Mat, block: ComplexArray) -> ComplexArray:
    """A PETSc matrix times a block of this rank's rows (collective).

    Args:
        matrix: The matrix.
        block: Shape ``(num_local_columns, n)``.

    Returns:
        Shape ``(num_local_rows, n)``.
    """
    dense = PETSc.Mat().createDense(
        ((block.shape[0], None), (None, block.shape[1])),
        array=np.asfortranarray(block),
        comm=matrix.comm,
    )
    product = matrix.matMult(dense)
    result = product.getDenseArray().copy()
    product.destroy()
    dense.destroy()
    return np.asarray(result, np.complex128)


def real_rows(matrix: PETSc.Mat) -> sparse.csr_matrix:
    """A serial real matrix without the zeros that only the common pattern holds."""
    start, columns, values = matrix.getValuesCSR()
    rows = sparse.csr_matrix((values.real.copy(), columns, start), shape=matrix.getSize())
    rows.eliminate_zeros()
    return rows


def times(matrix: sparse.csr_matrix | sparse.csc_matrix, block: ComplexArray) -> ComplexArray:
    """A real sparse matrix times a complex block.

    Args:
        matrix: Shape ``(m, n)``.
        block: Shape ``(n, k)``.

    Returns:
        Shape ``(m, k)``.
    """
    pairs = np.ascontiguousarray(block).view(np.float64)
    return np.ascontiguousarray(matrix @ pairs).view(np.complex128)


def inner(comm: MPI.Comm, left: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Inner products leftᴴ right over all ranks, without a copy of the left block.

    Args:
        comm: Communicator.
        left: Shape ``(num_local, n)``.
        right: Shape ``(num_local,)`` or ``(num_local, m)``.

    Returns:
        Shape ``(n,)`` or ``(n, m)``.
    """
    product = np.conj(left.T @ np.conj(right))
    return product if comm.size == 1 else np.asarray(comm.allreduce(product))


def norm(comm: MPI.Comm, x: ComplexArray) -> float:
    """Euclidean norm over all ranks."""
    return float(np.sqrt(comm.allreduce(float(np.vdot(x, x).real))))
