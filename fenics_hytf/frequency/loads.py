# SPDX-License-Identifier: MIT
"""Right-hand sides of all lines as a few vectors: b(s_k) = W c_k.

Loads that differ from line to line come from motions that vary smoothly with frequency, such as
those of level ground beyond a side; a few dozen vectors hold hundreds of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.frequency.products import inner, norm

ComplexArray = npt.NDArray[np.complex128]


class Loads(Protocol):
    """Right-hand sides that differ from line to line."""

    def __len__(self) -> int:
        """How many a line has."""

    def __call__(self, line: int) -> Sequence[PETSc.Vec]:
        """Make those of a line by its number; the caller destroys them."""


@dataclass(frozen=True)
class AffineLoads:
    """Right-hand sides that are sums of a few vectors times known functions of s.

    Attributes:
        vectors: Borrowed from whoever made them.
        coefficients: Of each vector in each side of each line, shape
            ``(len(vectors), num_sides, num_lines)``.
    """

    vectors: Sequence[PETSc.Vec]
    coefficients: ComplexArray

    def __len__(self) -> int:
        """Sides of a line."""
        return int(self.coefficients.shape[1])

    def __call__(self, line: int) -> Sequence[PETSc.Vec]:
        """Make those of a line; see :class:`Loads`."""
        sides = []
        for side in range(len(self)):
            total = self.vectors[0].duplicate()
            total.zeroEntries()
            for vector, factor in zip(self.vectors, self.coefficients[:, side, line], strict=True):
                if factor:
                    total.axpy(factor, vector)
            sides.append(total)
        return sides


@dataclass(frozen=True)
class LoadFactors:
    """b of every line and side as combinations of a few vectors.

    Attributes:
        vectors: W on this rank, shape ``(num_local, n)``.
        coordinates: c, shape ``(n, num_sides, num_lines)``.
        norms: Of the loads, shape ``(num_lines, num_sides)``; 1 where a load is nought.
    """

    vectors: ComplexArray
    coordinates: ComplexArray
    norms: npt.NDArray[np.float64]

    def at(self, line: int) -> ComplexArray:
        """Loads of a line on this rank, shape ``(num_local, num_sides)``."""
        return self.vectors @ self.coordinates[:, :, line]

    def slope(self, line: int) -> ComplexArray:
        """Change of the loads from line to line, likewise; nought where all lines are alike."""
        c = self.coordinates
        before, after = max(line - 1, 0), min(line + 1, c.shape[2] - 1)
        return self.vectors @ (c[:, :, after] - c[:, :, before])

    def scaled(self, scale: npt.NDArray[np.float64]) -> LoadFactors:
        """The loads times numbers, shape ``(num_local,)``; the norms stay those of the loads."""
        return LoadFactors(scale[:, None] * self.vectors, self.coordinates, self.norms)


def factor_loads(
    b: PETSc.Vec | Sequence[PETSc.Vec] | Loads,
    num_lines: int,
    num_local: int,
    comm: MPI.Comm,
    tolerance: float,
) -> LoadFactors:
    """Find the vectors that hold all loads (collective).

    Args:
        b: One or several right-hand sides, or those of each line.
        num_lines: Number of lines.
        num_local: Unknowns of this rank.
        comm: Communicator of the vectors.
        tolerance: What may be left of a load, relative [-].

    Returns:
        The factors.
    """
    if isinstance(b, AffineLoads):
        return _weighed(b, comm)
    if callable(b):
        return _gathered(b, num_lines, num_local, comm, tolerance)
    sides = [b] if isinstance(b, PETSc.Vec) else list(b)
    vectors = np.stack([side.array_r for side in sides], axis=1)
    every = np.broadcast_to(np.eye(len(sides))[:, :, None], (len(sides), len(sides), num_lines))
    norms = np.broadcast_to([side.norm() or 1.0 for side in sides], (num_lines, len(sides)))
    return LoadFactors(vectors.astype(np.complex128), every.astype(np.complex128), norms)


def _weighed(loads: AffineLoads, comm: MPI.Comm) -> LoadFactors:
    """The vectors as they are; norms from an orthonormal basis of them."""
    vectors = np.stack([vector.array_r for vector in loads.vectors], axis=1).astype(np.complex128)
    # Of unit length: the small ones must not drown in the round-off of the large.
    length = np.array([norm(comm, vector) or 1.0 for vector in vectors.T])
    vectors, c = vectors / length, loads.coefficients * length[:, None, None]
    power, directions = np.linalg.eigh(inner(comm, vectors, vectors))
    root = np.sqrt(np.maximum(power, 0.0))[:, None] * directions.conj().T
    norms = np.linalg.norm(np.tensordot(root, c, axes=1), axis=0).T
    return LoadFactors(vectors, c, np.where(norms > 0, norms, 1.0))


def _gathered(
    loads: Loads, num_lines: int, num_local: int, comm: MPI.Comm, tolerance: float
) -> LoadFactors:
    """Gram and Schmidt, line by line: a load that the vectors do not hold becomes one."""
    W = np.empty((num_local, 0), np.complex128)
    norms = np.ones((num_lines, len(loads)))
    found: list[list[ComplexArray]] = []
    for line in range(num_lines):
        found.append([])
        for side, load in enumerate(loads(line)):
            rest, length = load.array_r.copy(), load.norm()
            norms[line, side] = length or 1.0
            c: ComplexArray = np.zeros(W.shape[1], np.complex128)
            for _ in range(2):
                overlap = inner(comm, W, rest)
                rest -= W @ overlap
                c += overlap
            left = norm(comm, rest)
            if left > tolerance * norms[line, side]:
                W = np.column_stack([W, rest / left])
                c = np.append(c, left)
            found[-1].append(c)
            load.destroy()
    if not W.shape[1]:  # loads of nought, or no line: one vector of nought holds them
        W = np.zeros((num_local, 1), np.complex128)
    coordinates = np.zeros((W.shape[1], len(loads), num_lines), np.complex128)
    for line, sides in enumerate(found):
        for side, c in enumerate(sides):
            coordinates[: len(c), side, line] = c
    return LoadFactors(W, coordinates, norms)
