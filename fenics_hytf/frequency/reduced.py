# SPDX-License-Identifier: MIT
"""The reduced sweep: Galerkin projection on few directions, grown where the residual is worst.

The basis comes from Krylov blocks at a few expansion points, each one factorisation. The next point
lies amid the lines that are not done yet; with several groups of ranks each takes a point a round.
At the end the worst lines are judged by their true residuals. Memory is the basis and some small
matrices, whatever the number of lines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.frequency.basis import Basis
from fenics_hytf.frequency.columns import Columns
from fenics_hytf.frequency.direct import RESONANCE, SymmetricFactorisation
from fenics_hytf.frequency.errors import ReductionError, ResonanceError
from fenics_hytf.frequency.groups import share, together
from fenics_hytf.frequency.krylov import krylov_block
from fenics_hytf.frequency.loads import Loads, factor_loads
from fenics_hytf.frequency.products import TermProducts, norm
from fenics_hytf.frequency.sweep import Response
from fenics_hytf.frequency.system import DynamicSystem

ComplexArray = npt.NDArray[np.complex128]
RealArray = npt.NDArray[np.float64]
Lines = npt.NDArray[np.intp]

_MARGIN = 0.8  # sketched residuals, right to 4 %, stay below this fraction of the tolerance
_STRIDE = 4  # lines of the first check: every fourth, or so many widths of a damped contour
_DROP = 1e-8  # directions that a block has in common with the basis but for this are dropped
_DROP_OF_SOLUTION = 1e-14  # round-off alone: its share of stiff directions may be small
_WORST = 5  # lines whose true residual is taken at the end
_LOAD_ERROR = 1e-3  # of the tolerance: what may be left of a load that differs between lines
_SINGLE = 1e-7  # responses of sweeps with a looser tolerance are in single precision


@dataclass(frozen=True)
class ReducedSweep:
    """A sweep held as a basis and reduced coordinates; see :class:`Sweep`.

    Attributes:
        s: Complex frequencies [rad/s], shape ``(num_lines,)``.
        residuals: Relative residuals [-], shape ``(num_lines, num_sides)``: true ones of the worst
            lines, sketched ones, right to some per cent, of the others.
        factorisations: Matrices factorised.
        solves: Solves with them.
        basis: V on this rank.
        coordinates: y, shape ``(size, num_sides, num_lines)``.
        expansions: Lines at which a matrix was factorised.
        precision: Of responses.
    """

    s: ComplexArray
    residuals: RealArray
    factorisations: int
    solves: int
    basis: Columns
    coordinates: ComplexArray
    expansions: tuple[int, ...]
    precision: type[np.complexfloating] = np.complex128

    def solution(self, k: int) -> ComplexArray:
        """Return line ``k``'s solutions on this rank, shape ``(num_local, num_sides)``."""
        return self.basis @ self.coordinates[:, :, k]

    def project(self, rows: PETSc.Mat) -> ComplexArray:
        """Multiply every solution by a matrix; see :class:`Sweep`."""
        _, num_sides, num_lines = self.coordinates.shape
        seen = self.basis.seen_by(rows)
        flat = self.coordinates.reshape(len(self.coordinates), num_sides * num_lines)
        return (seen @ flat).reshape(len(seen), num_sides, num_lines)

    def response(self, weights: ComplexArray) -> Response:
        """Weigh all right-hand sides together; see :class:`Sweep`."""
        y = np.einsum("rsk,sk->rk", self.coordinates, weights).astype(self.precision)
        # Rows take differences of neighbours, so they meet the basis in double precision.
        return lambda rows: self.basis.seen_by(rows).astype(self.precision) @ y

    @property
    def has_directions(self) -> bool:
        """Those of the basis; see :class:`Sweep`."""
        return True

    def on_directions(self, weights: ComplexArray) -> tuple[tuple[Columns, ...], ComplexArray]:
        """On the basis; see :class:`Sweep`."""
        return (self.basis,), np.einsum("rsk,sk->rk", self.coordinates, weights)

    def combine(self, weights: ComplexArray) -> ComplexArray:
        """Sum all solutions with weights; see :class:`Sweep`."""
        return self.basis @ np.einsum("rsl,sl->r", self.coordinates, weights)


def reduced_sweep(
    system: DynamicSystem,
    b: PETSc.Vec | Sequence[PETSc.Vec] | Loads,
    s: npt.ArrayLike,
    tolerance: float = 1e-6,
    progress: Callable[[int, int], None] | None = None,
    expansions: Sequence[int] = (),
    budget: int | None = None,
    block: int = 10,
    across: MPI.Comm = MPI.COMM_SELF,
    directions: Columns | None = None,
) -> ReducedSweep:
    """Solve A(s) x = b at every frequency by projection on a basis that grows as needed.

    Args:
        system: The system; its matrices are real.
        b: Right-hand side, or several; or what gives those of each line.
        s: Complex frequencies η + iω [rad/s], shape ``(num_lines,)``.
        tolerance: Relative residual that every line must reach [-].
        progress: Called with the lines that have reached it and their number.
        expansions: Lines to begin with, such as those of a sweep of a system much like this one.
        budget: Factorisations allowed; one a line if ``None``.
        block: Directions a factorisation is used for at first.
        across: Communicator of the ranks that hold the same part of the system and take expansion
            points of their own; the sweep is the same on all of them.
        directions: Of a sweep of the same system, to begin with.

    Returns:
        The sweep.

    Raises:
        ReductionError: Lines that did not reach the tolerance within the budget.
        FactorisationError: A(s) is singular at an expansion point.
        ResidualError: A factorisation there is not good enough.
        ResonanceError: A line lies on an undamped resonance.
    """
    lines = np.atleast_1d(np.asarray(s, np.complex128))
    allowed = len(lines) if budget is None else budget
    block = min(block, len(lines))  # a line alone needs no more than its solution
    with SymmetricFactorisation(system) as factorisation:
        growth = _Growth(system, factorisation, b, lines, tolerance, across)
        if directions is not None:
            growth.begin(directions)
        wanted = growth.first_expansions(expansions, block)
        if len(lines) and not wanted:  # directions that are known may do
            growth.check()
            wanted = growth.next_expansions(block)
        while wanted:
            left = allowed - len(growth.expansions)
            if left <= 0:
                raise ReductionError(lines[growth.pending], growth.worst, tolerance)
            count = min(across.size, left)
            growth.expand(wanted[:count])
            wanted = wanted[count:]
            if not wanted:
                growth.check()
                if progress is not None:
                    progress(len(lines) - len(growth.pending), len(lines))
                wanted = growth.next_expansions(block)
        return growth.result()


class _Growth:
    """The basis as it grows, and how well each line is solved."""

    def __init__(
        self,
        system: DynamicSystem,
        factorisation: SymmetricFactorisation,
        b: PETSc.Vec | Sequence[PETSc.Vec] | Loads,
        lines: ComplexArray,
        tolerance: float,
        across: MPI.Comm,
    ) -> None:
        self._factorisation, self._across = factorisation, across
        self._products = TermProducts(system)
        self._lines, self._tolerance = lines, tolerance
        self._vectors = system.mass.createVecs()
        self._mass = next(i for i, (m, _) in enumerate(system.terms) if m is system.mass)
        comm, num_local = self._products.comm, system.mass.getLocalSize()[0]
        loads = factor_loads(b, len(lines), num_local, comm, _LOAD_ERROR * tolerance)
        self._loads = loads.scaled(self._products.scale)
        self._basis = Basis(self._products, self._loads, lines, tolerance, across)
        self.residuals = np.full(self._loads.norms.shape, np.inf)
        self._coordinates: ComplexArray | None = None  # of all lines, with the basis as it is
        self.expansions: list[int] = []
        self._solves = 0
        self._coarse = True
        self._checked = np.arange(0, len(lines), _stride(lines))
        self.pending = self._checked

    @property
    def worst(self) -> float:
        """Largest residual of the lines that were checked."""
        return float(self.residuals[self._checked].max(initial=0.0))

    def begin(self, directions: Columns) -> None:
        """Take directions of another sweep into the basis, from the first group."""
        known = [block / self._products.scale[:, None] for block in directions.blocks]
        mine = known if self._across.rank == 0 else []
        self._basis.take(self._basis.fresh([(block, _DROP) for block in mine]))

    def expand(self, wanted: Sequence[tuple[int, int]]) -> None:
        """Factorise at lines, one a group, and take the directions found there into the basis.

        Args:
            wanted: Lines and the numbers of directions.
        """
        blocks: list[tuple[ComplexArray, float]] = []
        solved: dict[int, ComplexArray] = {}
        with together(self._across):
            if self._across.rank < len(wanted):
                line, size = wanted[self._across.rank]
                solved[line] = self._solve_line(line)
                blocks = self._directions(line, size, solved[line])
            fresh = self._basis.fresh(blocks)
        self._basis.take(fresh)
        self._basis.remember(solved)
        self._coordinates = None
        self.expansions += [line for line, _ in wanted]

    def _solve_line(self, line: int) -> ComplexArray:
        """Factorise at a line; its solutions, shape ``(num_local, num_sides)``."""
        self._factorisation.factorise(complex(self._lines[line]))
        return np.stack([self._solve(b, check=True) for b in self._loads.at(line).T], axis=1)

    def _directions(
        self, line: int, size: int, solved: ComplexArray
    ) -> list[tuple[ComplexArray, float]]:
        """Solutions of a line, and Krylov blocks about them, with what may be dropped of each."""
        s, comm = complex(self._lines[line]), self._products.comm
        found = []
        for x in solved.T:
            found.append((x[:, None] / (norm(comm, x) or 1.0), _DROP_OF_SOLUTION))
            found.append((krylov_block(self._products, self._solve, x, s, size), _DROP))
        for slope in self._loads.slope(line).T:
            if comm.allreduce(bool(np.any(slope)), MPI.LOR):
                x = self._solve(slope)
                found.append((krylov_block(self._products, self._solve, x, s, size // 2), _DROP))
        return found

    def _solve(self, right: ComplexArray, check: bool = False) -> ComplexArray:
        """Solve with the factorisation at hand; the solution of a line itself is checked."""
        x, b = self._vectors
        b.array[:] = right / self._products.scale
        if check:
            self._factorisation.solve(b, x, self._tolerance)
        else:
            self._factorisation.backsolve(b, x)
        self._solves += 1
        return np.asarray(x.array_r / self._products.scale)

    def check(self) -> None:
        """Judge the lines that had not reached the tolerance; every line before the end."""
        self._judge(self.pending)
        if not len(self.pending) and self._coarse:
            self._coarse = False
            self._checked = np.arange(len(self._lines))
            self._judge(self._checked)
        if not len(self.pending):
            if self._coordinates is None:
                self._judge(self._checked)  # with the whole basis
            self._judge_truly()
            self._sift(1.0)
            self._require_no_resonance()

    def _judge(self, lines: Lines) -> None:
        """Residuals of some lines as the sketch sees them; which of all are pending then."""
        mine = lines[share(len(lines), self._across)]
        with together(self._across):
            y = self._basis.coordinates(mine)
        residuals = self._basis.sketched_residuals(mine, y)
        if self._across.size > 1:
            parts = self._across.allgather((residuals, y))
            residuals = np.concatenate([part for part, _ in parts])
            y = np.concatenate([part for _, part in parts], axis=2)
        self.residuals[lines] = residuals
        if len(lines) == len(self._lines):
            self._coordinates = y
        self._sift()

    def _sift(self, fraction: float = _MARGIN) -> None:
        """Find the pending lines: those above this fraction of the tolerance."""
        above = self.residuals[self._checked].max(axis=1, initial=0.0) > fraction * self._tolerance
        self.pending = self._checked[above]

    def _judge_truly(self) -> None:
        """True residuals of the worst lines."""
        assert self._coordinates is not None
        for line in map(int, np.argsort(self.residuals.max(axis=1))[-_WORST:]):
            self.residuals[line] = self._basis.true_residuals(line, self._coordinates[:, :, line])

    def _require_no_resonance(self) -> None:
        """|s² M x| against |b|, as the direct sweep looks at it."""
        assert self._coordinates is not None
        everything = np.arange(len(self._lines))
        inertia = self._basis.size_of_product(self._mass, everything, self._coordinates)
        growth = np.abs(self._lines) ** 2 * inertia.max(axis=1)
        worst = int(np.argmax(growth))
        if growth[worst] > RESONANCE:
            raise ResonanceError(complex(self._lines[worst]), float(growth[worst]))

    def first_expansions(self, known: Sequence[int], block: int) -> list[tuple[int, int]]:
        """Where to begin: at known lines, or amid the lines, a point a group.

        And where s is real: a response at rest is real, which a projection on complex directions
        is not; the solution itself is. Where directions are known already, there alone.
        """
        count, groups = len(self._lines), self._across.size
        amid = [count * (2 * g + 1) // (2 * groups) for g in range(groups)] if count else []
        if self._basis.size:
            amid = []
        real = [line for line, s in enumerate(self._lines) if s.imag == 0]
        return [(line, block) for line in dict.fromkeys([*(known or amid), *real])]

    def next_expansions(self, block: int) -> list[tuple[int, int]]:
        """Where to expand next, if anywhere, and in how many directions; a point a group.

        The centres, by log residual, of the lines round the worst ones that are not done yet.
        """
        if not len(self.pending):
            return []
        target = _MARGIN * self._tolerance
        excess = np.log10(np.maximum(self.residuals[self._checked].max(axis=1) / target, 1.0))
        chosen: dict[int, int] = {}
        for places in _intervals(excess, self._across.size):
            peak = int(places[np.argmax(excess[places])])
            weights = excess[places]
            centre = round(float(weights @ places / weights.sum()))
            line = self._untried(int(self._checked[centre]), int(self._checked[peak]), chosen)
            if line is not None:
                chosen[line] = int(np.clip(2 * excess[peak] + 1, 4, block))
        return list(chosen.items())

    def _untried(self, centre: int, peak: int, chosen: dict[int, int]) -> int | None:
        """A line where no matrix was factorised; the sketch may be off where one was."""
        for line in (centre, peak, *map(int, self.pending)):
            if line not in self.expansions and line not in chosen:
                return line
        return None if chosen else centre

    def result(self) -> ReducedSweep:
        """The sweep as it stands."""
        for vector in self._vectors:
            vector.destroy()
        y = self._coordinates
        if y is None:  # without a line
            y = np.empty((self._basis.size, self._loads.norms.shape[1], 0), np.complex128)
        self._basis.V.scale(self._products.scale)
        return ReducedSweep(
            s=self._lines,
            residuals=self.residuals,
            factorisations=self._across.allreduce(self._factorisation.factorisations),
            solves=self._across.allreduce(self._solves),
            basis=self._basis.V,
            coordinates=y,
            expansions=tuple(self.expansions),
            precision=np.complex64 if self._tolerance > _SINGLE else np.complex128,
        )


def _intervals(excess: RealArray, count: int) -> list[Lines]:
    """The neighbours above nought round the largest values: so many intervals, cut if need be."""
    above = np.flatnonzero(excess > 0)
    intervals = np.split(above, np.flatnonzero(np.diff(above) > 1) + 1)
    intervals.sort(key=lambda places: -excess[places].max())
    chosen = intervals[:count]
    while len(chosen) < count:
        longest = max(range(len(chosen)), key=lambda i: len(chosen[i]))
        if len(chosen[longest]) < 2:
            break
        chosen[longest : longest + 1] = np.array_split(chosen[longest], 2)
    return chosen


def _stride(lines: ComplexArray) -> int:
    """Lines from one to the next of the first check.

    No resonance is narrower than η, so on a contour whose lines lie closer more may be left out.
    """
    if len(lines) < 2:
        return _STRIDE
    apart = float(np.median(np.abs(np.diff(lines.imag))))
    return _STRIDE * max(1, round(float(lines.real.min()) / apart)) if apart > 0 else _STRIDE
