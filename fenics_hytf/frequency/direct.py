# SPDX-License-Identifier: MIT
"""The direct sweep: one factorisation a frequency, the reference for every other sweep.

LDLᵀ of the complex symmetric A(s), by MUMPS or, where it is small, by PETSc itself; one matrix is
kept and refilled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.frequency.errors import FactorisationError, ResidualError, ResonanceError
from fenics_hytf.frequency.groups import share, shares, together
from fenics_hytf.frequency.loads import Loads
from fenics_hytf.frequency.sweep import DenseSweep
from fenics_hytf.frequency.system import DynamicSystem

ComplexArray = npt.NDArray[np.complex128]

_PREFIX = "hytf_direct_"

# Inertia forces over the load: 1/2D at a damped resonance. A line within 1e-10 of an undamped one
# is on it: of sixteen digits fewer than six would be left.
RESONANCE = 1e10

_FEW = 200  # unknowns; a cell has 81 at most

# PETSc's own LDLᵀ has no start-up cost: on a column of 192 unknowns it took a quarter of MUMPS'
# time, on a section of 420 two thirds, of 1640 1.2 times as much. It is serial.
_SMALL = 1000


@dataclass(frozen=True)
class _Package:
    """A way to factorise.

    Attributes:
        name: PETSc's name of the solver package.
        pivot: MUMPS' threshold of pivoting; 0 for none.
    """

    name: str
    pivot: float = 0.0


def _packages(A: PETSc.Mat) -> list[_Package]:
    """Ways to factorise, the quickest first; the next one takes over where one fails."""
    small = A.comm.size == 1 and A.getSize()[0] <= _SMALL
    first = PETSc.Mat.SolverType.PETSC if small else PETSc.Mat.SolverType.MUMPS
    return [_Package(first), _Package(PETSc.Mat.SolverType.MUMPS, pivot=0.01)]


class SymmetricFactorisation:
    """LDLᵀ of one system, refilled from frequency to frequency.

    Args:
        system: The system.

    A context manager: it owns a matrix and a factorisation and destroys them at its end.
    """

    def __init__(self, system: DynamicSystem) -> None:
        self._system = system
        self.factorisations = 0
        self.A = system.create_matrix()
        self._residual = self.A.createVecLeft()
        self._correction = self.A.createVecRight()
        self._choices = _packages(self.A)
        self._solver = self._create_solver()

    def __enter__(self) -> SymmetricFactorisation:
        return self

    def __exit__(self, *_: object) -> None:
        for owned in (self._solver, self._residual, self._correction, self.A):
            owned.destroy()

    def _create_solver(self) -> PETSc.KSP:
        solver = PETSc.KSP().create(self.A.comm)
        solver.setOptionsPrefix(_PREFIX)
        solver.setType(PETSc.KSP.Type.PREONLY)
        solver.setErrorIfNotConverged(True)
        pc = solver.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType(self._choices[0].name)
        if self._choices[0].name == PETSc.Mat.SolverType.PETSC:
            pc.setFactorOrdering(PETSc.Mat.OrderingType.ND)
        return solver

    def factorise(self, s: complex) -> None:
        """Fill A(s) and factorise it.

        Args:
            s: Complex frequency η + iω [rad/s].

        Raises:
            FactorisationError: A(s) is singular, or the factorisation failed otherwise.
        """
        self._system.fill(self.A, s)
        self._s = s
        if self.A.comm.size > 1 and self.factorisations:
            # Factorising again where there are factors already took one of two ranks a fifth more
            # memory, and memory is why ranks share a mesh; anew it takes a fifth more time.
            self._solver.destroy()
            self._solver = self._create_solver()
        self._factorise()

    def _factorise(self) -> None:
        self.factorisations += 1
        solver, package = self._solver, self._choices[0]
        # Without setOperators the refactorisation silently does not happen.
        solver.setOperators(self.A)
        try:
            if package.name == PETSc.Mat.SolverType.MUMPS:
                self._tune_mumps(package.pivot)
            solver.setUp()
        except PETSc.Error as error:
            self._fall_back(error)

    def _tune_mumps(self, pivot: float) -> None:
        pc = self._solver.getPC()
        pc.setFactorSetUpSolverType()
        factor = pc.getFactorMatrix()
        # PORD, for the default ordering is worse than LU's in 3D; AMD for few unknowns: where all
        # of them hang together, as in one or two cells, PORD ends the process.
        factor.setMumpsIcntl(7, 4 if self.A.getSize()[0] > _FEW else 0)
        factor.setMumpsIcntl(12, 1)  # no compressed ordering of symmetric indefinite matrices
        factor.setMumpsIcntl(6, 0)  # no column permutation
        factor.setMumpsCntl(1, pivot)

    def _fall_back(self, cause: Exception) -> None:
        """Factorise again with the next package, and stay with it."""
        if len(self._choices) == 1:
            raise FactorisationError(self._s) from cause
        self._choices.pop(0)
        self._solver.destroy()
        self._solver = self._create_solver()
        self._factorise()

    def solve(self, b: PETSc.Vec, x: PETSc.Vec, tolerance: float) -> float:
        """Solve A x = b and return the true relative residual.

        Where the residual exceeds the tolerance the solution is refined once, then the matrix is
        factorised again with pivoting.

        Args:
            b: Right-hand side.
            x: Solution, overwritten.
            tolerance: Wanted relative residual [-].

        Returns:
            ``|b − A x| / |b|``.

        Raises:
            ResidualError: The residual stays above the tolerance.
            ResonanceError: The frequency is that of an undamped resonance.
        """
        scale = b.norm()
        if scale == 0.0:
            x.zeroEntries()
            return 0.0
        self._solver.solve(b, x)
        residual = self._true_residual(b, x) / scale
        if residual > tolerance:
            residual = self._refine(b, x) / scale
        if residual <= tolerance:
            self._require_no_resonance(x, scale)
            return residual
        failure = ResidualError(self._s, residual, tolerance)
        if len(self._choices) == 1:
            raise failure
        self._fall_back(failure)
        return self.solve(b, x, tolerance)

    def _require_no_resonance(self, x: PETSc.Vec, load: float) -> None:
        """|s² M x| against |b|: a small system has a small residual even where A is singular."""
        self._system.mass.mult(x, self._residual)
        amplification = abs(self._s) ** 2 * self._residual.norm() / load
        if amplification > RESONANCE:
            raise ResonanceError(self._s, amplification)

    def backsolve(self, b: PETSc.Vec, x: PETSc.Vec) -> None:
        """Solve A x = b with the factors as they are, whatever the residual.

        Args:
            b: Right-hand side.
            x: Solution, overwritten.
        """
        self._solver.solve(b, x)

    def _true_residual(self, b: PETSc.Vec, x: PETSc.Vec) -> float:
        self.A.mult(x, self._residual)
        self._residual.aypx(-1.0, b)
        return self._residual.norm()

    def _refine(self, b: PETSc.Vec, x: PETSc.Vec) -> float:
        self._solver.solve(self._residual, self._correction)
        x.axpy(1.0, self._correction)
        return self._true_residual(b, x)


def direct_sweep(
    system: DynamicSystem,
    b: PETSc.Vec | Sequence[PETSc.Vec] | Loads,
    s: npt.ArrayLike,
    tolerance: float = 1e-6,
    progress: Callable[[int, int], None] | None = None,
    across: MPI.Comm = MPI.COMM_SELF,
) -> DenseSweep:
    """Solve A(s) x = b at every frequency by factorisation.

    Args:
        system: The system.
        b: Right-hand side, or several; or what gives those of each line.
        s: Complex frequencies η + iω [rad/s], shape ``(num_lines,)``.
        tolerance: Relative residual that every solve must reach [-].
        progress: Called with the lines done and their number.
        across: Communicator of the ranks that hold the same part of the system and share out the
            lines; each has the solutions of all of them in the end.

    Returns:
        The solutions, residuals and counts.

    Raises:
        FactorisationError: A(s) is singular at a line.
        ResonanceError: A line lies on an undamped resonance.
        ResidualError: A residual stays above the tolerance.
    """
    lines = np.atleast_1d(np.asarray(s, np.complex128))
    sides = [b] if isinstance(b, PETSc.Vec) else b
    num_local = system.mass.getLocalSize()[0]
    # One unknown a row of memory: each solution is a column, contiguous for PETSc.
    values = np.empty((num_local, len(lines) * len(sides)), np.complex128, order="F")
    residuals = np.zeros((len(lines), len(sides)))
    column = PETSc.Vec().createWithArray(
        np.empty(num_local, np.complex128), size=system.mass.getSizes()[0], comm=system.comm
    )
    mine = range(*share(len(lines), across).indices(len(lines)))
    try:
        with together(across), SymmetricFactorisation(system) as factorisation:
            for done, line in enumerate(mine, start=1):
                factorisation.factorise(complex(lines[line]))
                rights = sides(line) if callable(sides) else sides
                for side, right in enumerate(rights):
                    column.placeArray(values[:, line * len(sides) + side])
                    residuals[line, side] = factorisation.solve(right, column, tolerance)
                    column.resetArray()
                    if callable(sides):  # made for this line
                        right.destroy()
                if progress is not None:
                    progress(min(done * across.size, len(lines)), len(lines))
            count = factorisation.factorisations
    finally:
        column.destroy()
    if across.size > 1:
        count = across.allreduce(count)
        across.Allreduce(MPI.IN_PLACE, residuals)
        _spread(values, len(sides), len(lines), across)
    return DenseSweep(lines, values, residuals, count, residuals.size)


def _spread(values: ComplexArray, num_sides: int, num_lines: int, across: MPI.Comm) -> None:
    """Give every group the solutions of all, a line at a time: counts of MPI are 32 bits wide."""
    for owner, lines in enumerate(shares(num_lines, across)):
        for line in range(lines.start, lines.stop):
            across.Bcast(values[:, line * num_sides : (line + 1) * num_sides], owner)
