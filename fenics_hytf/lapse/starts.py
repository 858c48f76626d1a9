# SPDX-License-Identifier: MIT
"""The start of a lapse on the unknowns: forces, and the coefficients of start functions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.frequency import Columns
from fenics_hytf.motion import StartFunctions

RealArray = npt.NDArray[np.float64]


def product(
    matrices: Sequence[tuple[PETSc.Mat, float]], x: RealArray, like: PETSc.Vec
) -> PETSc.Vec:
    """Σ factor · matrix · x.

    Args:
        matrices: Matrices and their factors.
        x: This rank's unknowns, shape ``(num_local_unknowns,)``.
        like: A vector of the unknowns.

    Returns:
        The sum; the caller destroys it.
    """
    total, vector, part = like.duplicate(), like.duplicate(), like.duplicate()
    total.zeroEntries()
    vector.array[:] = x
    for matrix, factor in matrices:
        if factor:
            matrix.mult(vector, part)
            total.axpy(factor, part)
    vector.destroy()
    part.destroy()
    return total


def start_columns(start: StartFunctions, derivatives: Sequence[RealArray]) -> Columns:
    """C of the start functions on this rank's unknowns.

    Args:
        start: The functions.
        derivatives: Displacement and its derivatives at t = 0, each of shape
            ``(num_local_unknowns,)``.

    Returns:
        The coefficients, a column each.
    """
    c = start.coefficients(np.stack(derivatives, axis=1))
    columns = Columns(len(c), width=c.shape[1])
    columns.append(c.astype(np.complex128))
    return columns


def largest(comm: MPI.Comm, values: RealArray) -> float:
    """Largest length of the vectors of all ranks (collective).

    Args:
        comm: Communicator.
        values: This rank's, shape ``(n, num_components)``.

    Returns:
        Nought without any.
    """
    mine = float(np.linalg.norm(values, axis=1).max(initial=0.0))
    return float(comm.allreduce(mine, MPI.MAX))
