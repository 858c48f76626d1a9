# SPDX-License-Identifier: MIT
"""The start of a lapse on the unknowns: acceleration and its rate, as far as lines can follow.

A fine mesh has modes, and dashpots rates, far above the highest line. What is not in balance there,
if only round-off, makes accelerations that grow with the square of their frequency; start functions
that hold them are not undone by lines that are not there, and handed on from seam to seam the error
grew without bounds. So accelerations are those of modes that lines can follow,

    a = F M⁻¹f + (I − F) C⁻¹ḟ,    F = (I + (M⁻¹A)²)⁻¹,    A = K/σ² + C/σ

with f the force out of balance, ḟ its rate but for C a, and σ above the highest circular frequency:
F is 1/(1 + (ω/σ)⁴) of an undamped mode. Where viscous forces are stiff the velocity follows the
forces at once, so the acceleration follows their rate; with (I − F) C⁻¹ ≈ (I − F)(M⁻¹A)⁻¹M⁻¹/σ both
come from one complex solve,

    a = Im[(A − iM)⁻¹(f + iḟ/σ)]

a factorisation of the pattern of all others. Velocities are taken as they are: what they hold of
high modes fades from seam to seam.
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

# σ over the highest circular frequency. From 1.4 to 4 every case tried stayed bounded, with 8 fine
# sections between dashpots did not; with 4 jumps beside dashpots are half of those with 2.
_ABOVE = 2.0


class StartSolver:
    """Accelerations that lines can follow; a context manager that owns a factorisation.

    Args:
        equations: The equations.
        highest: Highest circular frequency of the lines [rad/s].
    """

    def __init__(self, equations: LapseEquations, highest: float) -> None:
        self._sigma = _ABOVE * highest
        terms = [(matrix, _times(share)) for matrix, share in equations.stiff]
        terms += [(matrix, _times(self._sigma)) for matrix in equations.viscous]
        self._factorisation = SymmetricFactorisation(DynamicSystem(terms, equations.system.mass))
        # s² M = −iσ² M there, and the matrix is σ²(A − iM)
        self._factorisation.factorise(self._sigma * np.exp(-0.25j * np.pi))

    def __enter__(self) -> StartSolver:
        return self

    def __exit__(self, *error: object) -> None:
        self._factorisation.__exit__(*error)

    def __call__(self, force: PETSc.Vec, rate: PETSc.Vec | None = None) -> RealArray:
        """The acceleration under a force out of balance (collective).

        Args:
            force: f.
            rate: ḟ but for the viscous forces that the acceleration brings; nought if ``None``.

        Returns:
            On this rank's unknowns, shape ``(num_local_unknowns,)``.
        """
        x, right = force.duplicate(), force.copy()
        if rate is not None:
            right.axpy(1j / self._sigma, rate)
        self._factorisation.backsolve(right, x)
        values = self._sigma**2 * x.array_r.imag
        x.destroy()
        right.destroy()
        return np.asarray(values)


def start_accelerations(
    equations: LapseEquations, highest: float, force: PETSc.Vec, rate: PETSc.Vec
) -> tuple[RealArray, RealArray]:
    """Acceleration and its rate as a lapse begins (collective).

    Args:
        equations: The equations.
        highest: Highest circular frequency of the lines [rad/s].
        force: What is out of balance.
        rate: Its rate but for the viscous forces that the acceleration brings.

    Returns:
        Each on this rank's unknowns, shape ``(num_local_unknowns,)``.
    """
    with StartSolver(equations, highest) as accelerate:
        acceleration = accelerate(force, rate)
        slowed = product([(C, 1.0) for C in equations.viscous], acceleration, like=rate)
        slowed.aypx(-1.0, rate)
        jerk = accelerate(slowed)
        slowed.destroy()
    return acceleration, jerk


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
    """Coefficients of the start functions on this rank's unknowns.

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
