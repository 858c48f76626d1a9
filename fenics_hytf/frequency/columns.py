# SPDX-License-Identifier: MIT
"""Columns that become more: a tall matrix in blocks, which grows without being copied."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.frequency.products import multiply, real_rows, times

ComplexArray = npt.NDArray[np.complex128]

_WIDTH = 64  # columns of a block: products with it run at full speed, little is left unused


class Columns:
    """A tall matrix V, its rows distributed over ranks.

    Args:
        num_rows: Rows of this rank.
        width: Columns of a block.
    """

    def __init__(self, num_rows: int, width: int = _WIDTH) -> None:
        self.num_rows, self.size, self._width = num_rows, 0, width
        self._storage: list[ComplexArray] = []

    @property
    def blocks(self) -> list[ComplexArray]:
        """The columns there are, side by side, each shape ``(num_rows, 64 or fewer)``."""
        widths = np.clip(self.size - self._width * np.arange(len(self._storage)), 0, self._width)
        return [block[:, :width] for block, width in zip(self._storage, widths, strict=True)]

    def append(self, columns: ComplexArray) -> None:
        """Add columns, shape ``(num_rows, n)``."""
        while columns.shape[1]:
            used = self.size % self._width
            if not used:
                self._storage.append(np.zeros((self.num_rows, self._width), np.complex128))
            count = min(columns.shape[1], self._width - used)
            self._storage[-1][:, used : used + count] = columns[:, :count]
            self.size += count
            columns = columns[:, count:]

    def __matmul__(self, right: ComplexArray) -> ComplexArray:
        """V X, X of shape ``(size,)`` or ``(size, n)``."""
        total = np.zeros((self.num_rows, *right.shape[1:]), np.complex128)
        for number, block in enumerate(self.blocks):
            total += block @ right[self._width * number : self._width * number + block.shape[1]]
        return total

    def inner(self, comm: MPI.Comm, right: ComplexArray) -> ComplexArray:
        """Vᴴ X over all ranks of a communicator, shape ``(size, n)``."""
        conjugate = np.conj(right)
        parts = [block.T @ conjugate for block in self.blocks]
        empty = np.empty((0, *right.shape[1:]), np.complex128)
        product = np.conj(np.concatenate([empty, *parts]))
        return product if comm.size == 1 else np.asarray(comm.allreduce(product))

    def scale(self, factors: npt.NDArray[np.float64]) -> None:
        """Multiply the rows by numbers, shape ``(num_rows,)``."""
        for block in self._storage:
            block *= factors[:, None]

    def seen_by(self, rows: PETSc.Mat) -> ComplexArray:
        """This rank's rows of a real matrix times V, shape ``(num_local_rows, size)``."""
        # Whole blocks, unused columns and all: those that are used alone would have to be copied.
        if rows.comm.size == 1:
            local = real_rows(rows)
            parts = [times(local, block) for block in self._storage]
        else:
            parts = [multiply(rows, block) for block in self._storage]
        none = np.empty((rows.getLocalSize()[0], 0), np.complex128)
        return np.concatenate([none, *parts], axis=1)[:, : self.size]
