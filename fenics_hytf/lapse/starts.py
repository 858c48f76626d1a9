# SPDX-License-Identifier: MIT
"""The start of a lapse on the unknowns: velocity and its rates, as far as lines can follow them.

A fine mesh has modes far above the highest line. What a start holds of them grows with every rate,
is taken out of the transform and is not put back by lines that are not there: handed on from seam
to seam it grew without bounds. So the start is held by M⁻¹f of the forces in modes that lines can
follow, and the rest is left to the lines:

    F M⁻¹f,    F = (I + (M⁻¹A)²)⁻¹,    A = K/σ² + C/σ

with σ above the highest circular frequency. F is 1/(1 + (ω/σ)⁴) of an undamped mode. For real f it
is the imaginary part of (A − iM)⁻¹f, one more factorisation of the same pattern.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.frequency import (
    Columns,
    DynamicSystem,
    ScalarFunction,
    SymmetricFactorisation,
)
from fenics_hytf.lapse.equations import LapseEquations
from fenics_hytf.motion import StartFunctions

RealArray = npt.NDArray[np.float64]

_ABOVE = 2.0  # σ over the highest circular frequency; 1.4 to 2 kept every case tried bounded


class StartSolver:
    """M⁻¹f in the modes that lines can follow; a context manager that owns a factorisation.

    Args:
        equations: The equations.
        highest: Highest circular frequency of the lines [rad/s].
    """

    def __init__(self, equations: LapseEquations, highest: float) -> None:
        self._sigma = _ABOVE * highest
        terms = [(matrix, _times(share)) for matrix, share in equations.stiff]
        terms += [(matrix, _times(self._sigma)) for matrix in equations.viscous]
        self._factorisation = SymmetricFactorisation(
            DynamicSystem(terms, equations.system.mass)
        )
        # s² M = −iσ² M there, and the matrix is σ²(A − iM)
        self._factorisation.factorise(self._sigma * np.exp(-0.25j * np.pi))

    def __enter__(self) -> StartSolver:
        return self

    def __exit__(self, *error: object) -> None:
        self._factorisation.__exit__(*error)

    def __call__(self, force: PETSc.Vec) -> RealArray:
        """F M⁻¹f on this rank's unknowns (collective), shape ``(num_local_unknowns,)``."""
        x = force.duplicate()
        self._factorisation.backsolve(force, x)
        values = self._sigma**2 * x.array_r.imag
        x.destroy()
        return np.asarray(values)


def _times(factor: float) -> ScalarFunction:
    return lambda s: factor


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
