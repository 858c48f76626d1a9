# SPDX-License-Identifier: MIT
"""The reduced sweep: Galerkin projection on few directions, grown where the residual is worst.

x(s) ≈ V y(s) with (Σ f_j(s) VᴴK_jV) y = Vᴴb. V comes from Krylov blocks at a few expansion points,
each one factorisation; Vᴴ and not Vᵀ, so that the reduced matrix of a damped system is regular. The
residual of every line is judged from a sketch: a few hundred signed sums of its entries, of which
the norm is right to some per cent (Clarkson and Woodruff 2013); the worst lines are then judged by
their true residuals. Memory is V and some small matrices, whatever the number of lines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.frequency.direct import RESONANCE, SymmetricFactorisation
from fenics_hytf.frequency.errors import ReductionError, ResonanceError
from fenics_hytf.frequency.krylov import TermProducts, krylov_block, real_rows, times
from fenics_hytf.frequency.loads import LoadFactors, Loads, factor_loads, inner
from fenics_hytf.frequency.system import DynamicSystem

ComplexArray = npt.NDArray[np.complex128]
RealArray = npt.NDArray[np.float64]

_SKETCH = 600  # sums; their norm is off by 1/√600 or so
_MARGIN = 0.5  # sketched residuals stay below this fraction of the tolerance
_STRIDE = 4  # lines of the first check: every fourth
_DROP = 1e-8  # directions that a block has in common with the basis but for this are dropped
_ROUND_OFF = 1e-14  # all of a solution is kept: what it holds of stiff directions may be small
_WORST = 5  # lines whose true residual is taken at the end
_LOAD_ERROR = 1e-3  # of the tolerance: what may be left of a load that differs between lines
_LINES = 64  # reduced systems solved at once


@dataclass(frozen=True)
class ReducedSweep:
    """A sweep held as a basis and reduced coordinates; see :class:`Sweep`.

    Attributes:
        s: Complex frequencies [rad/s], shape ``(num_lines,)``.
        residuals: Relative residuals [-], shape ``(num_lines, num_sides)``: true ones of the worst
            lines, sketched ones, right to some per cent, of the others.
        factorisations: Matrices factorised.
        solves: Solves with them.
        basis: V on this rank, orthonormal, shape ``(num_local, size)``.
        coordinates: y, shape ``(size, num_sides, num_lines)``.
        expansions: Lines at which a matrix was factorised.
    """

    s: ComplexArray
    residuals: RealArray
    factorisations: int
    solves: int
    basis: ComplexArray
    coordinates: ComplexArray
    expansions: tuple[int, ...]

    def solution(self, k: int) -> ComplexArray:
        """Return line ``k``'s solutions on this rank, shape ``(num_local, num_sides)``."""
        return self.basis @ self.coordinates[:, :, k]

    def project(self, rows: PETSc.Mat) -> ComplexArray:
        """Multiply every solution by a matrix; see :class:`Sweep`."""
        _, num_sides, num_lines = self.coordinates.shape
        seen = self._seen_by(rows)
        return (seen @ self.coordinates.reshape(len(self.coordinates), -1)).reshape(
            len(seen), num_sides, num_lines
        )

    def _seen_by(self, rows: PETSc.Mat) -> ComplexArray:
        """This rank's rows of a matrix times the basis, shape ``(num_local_rows, size)``."""
        if rows.comm.size == 1:
            return times(real_rows(rows), self.basis)
        columns = self._columns
        dense = PETSc.Mat().createDense(
            ((columns.shape[0], None), (None, columns.shape[1])), array=columns, comm=rows.comm
        )
        product = rows.matMult(dense)
        result = product.getDenseArray().copy()
        product.destroy()
        dense.destroy()
        return np.asarray(result, np.complex128)

    @cached_property
    def _columns(self) -> ComplexArray:
        """The basis as PETSc keeps it, column by column."""
        return np.asfortranarray(self.basis)

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
    with SymmetricFactorisation(system) as factorisation:
        comm = system.comm.tompi4py()
        num_local = system.mass.getLocalSize()[0]
        loads = factor_loads(b, len(lines), num_local, comm, _LOAD_ERROR * tolerance)
        growth = _Growth(system, factorisation, loads, lines, tolerance)
        wanted = list(expansions) or ([len(lines) // 2] if len(lines) else [])
        size = block
        while wanted:
            if len(growth.expansions) >= allowed:
                raise ReductionError(lines[growth.pending], growth.worst, tolerance)
            growth.expand(wanted.pop(0), size)
            if not wanted:
                growth.check()
                if progress is not None:
                    progress(len(lines) - len(growth.pending), len(lines))
                wanted, size = growth.next_expansion(block)
        return growth.result()


class _Growth:
    """The basis, what the system looks like on it, and how well each line is solved."""

    def __init__(
        self,
        system: DynamicSystem,
        factorisation: SymmetricFactorisation,
        loads: LoadFactors,
        lines: ComplexArray,
        tolerance: float,
    ) -> None:
        self._factorisation = factorisation
        self._products = TermProducts(system)
        self._comm = self._products.comm
        self._lines, self._tolerance = lines, tolerance
        self._vectors = system.mass.createVecs()
        self._mass = next(i for i, (m, _) in enumerate(system.terms) if m is system.mass)
        self._loads = loads
        count, num_loads = loads.vectors.shape
        self._storage = np.empty((count, 0), np.complex128)
        self._size = 0
        self._reduced_load: ComplexArray = np.empty((0, num_loads), np.complex128)
        self._sketch = _sketch_matrix(count, self._comm.rank)
        self._factors = np.array(
            [[function(complex(z)) for z in lines] for function in self._products.functions]
        )
        terms = len(self._products)
        self._reduced = [np.empty((0, 0), np.complex128)] * terms
        self._sketched = [np.empty((_SKETCH, 0), np.complex128)] * terms
        self._sketched_load = self._comm.allreduce(times(self._sketch, loads.vectors))
        self.residuals = np.full(loads.norms.shape, np.inf)
        self._solved: dict[int, ComplexArray] = {}  # coordinates of lines that were factorised
        self.expansions: list[int] = []
        self.solves = 0
        self._coarse = True
        self._checked = np.arange(0, len(lines), _STRIDE)
        self.pending = self._checked

    @property
    def worst(self) -> float:
        """Largest residual of the lines that were checked."""
        return float(self.residuals[self._checked].max(initial=0.0))

    def expand(self, line: int, size: int) -> None:
        """Factorise at a line and take the directions found there into the basis."""
        s = complex(self._lines[line])
        self._factorisation.factorise(s)
        self.expansions.append(line)
        loads = self._loads.at(line)
        solved = np.stack([self._solve(b, check=True) for b in loads.T], axis=1)
        for x in solved.T:
            self._take(x[:, None] / (self._length(x) or 1.0), _ROUND_OFF)
            self._take(krylov_block(self._products, self._solve, x, s, size))
        for slope in self._loads.slope(line).T:
            if self._comm.allreduce(bool(np.any(slope)), MPI.LOR):
                x = self._solve(slope)
                self._take(krylov_block(self._products, self._solve, x, s, size // 2))
        self._solved[line] = self._inner(self._V, solved)

    def _solve(self, right: ComplexArray, check: bool = False) -> ComplexArray:
        """Solve with the factorisation at hand; the solution of a line itself is checked."""
        x, b = self._vectors
        b.array[:] = right
        if check:
            self._factorisation.solve(b, x, self._tolerance)
        else:
            self._factorisation.backsolve(b, x)
        self.solves += 1
        return x.array_r.copy()

    def _length(self, x: ComplexArray) -> float:
        return float(np.sqrt(self._comm.allreduce(float(np.vdot(x, x).real))))

    def _take(self, found: ComplexArray, drop: float = _DROP) -> None:
        """Add what is new in a block to the basis."""
        fresh = found
        for _ in range(2):
            fresh = fresh - self._V @ self._inner(self._V, fresh)
            fresh = self._orthonormalise(fresh, drop)
        if not fresh.shape[1]:
            return
        old = self._V.shape[1]
        self._append(fresh)
        mine = self._inner(fresh, self._loads.vectors)
        self._reduced_load = np.concatenate([self._reduced_load, mine])
        for term in range(len(self._products)):
            image = self._products(term, fresh)
            border = self._inner(self._V, image)
            grown = np.empty((len(border), len(border)), np.complex128)
            grown[:old, :old] = self._reduced[term]
            grown[:, old:] = border
            grown[old:, :old] = border[:old].conj().T  # K_j is real and symmetric
            self._reduced[term] = grown
            sketched = self._comm.allreduce(times(self._sketch, image))
            self._sketched[term] = np.concatenate([self._sketched[term], sketched], axis=1)

    @property
    def _V(self) -> ComplexArray:
        """The basis, orthonormal, shape ``(num_local, size)``."""
        return self._storage[:, : self._size]

    def _append(self, fresh: ComplexArray) -> None:
        """Add columns to the basis, whose storage grows by half where it is full."""
        size = self._size + fresh.shape[1]
        if size > self._storage.shape[1]:
            grown = np.empty((len(fresh), size + size // 2), np.complex128)
            grown[:, : self._size] = self._V
            self._storage = grown
        self._storage[:, self._size : size] = fresh
        self._size = size

    def _inner(self, left: ComplexArray, right: ComplexArray) -> ComplexArray:
        return inner(self._comm, left, right)

    def _orthonormalise(self, block: ComplexArray, drop: float) -> ComplexArray:
        """Principal directions of a block that are more than round-off."""
        power, directions = np.linalg.eigh(self._inner(block, block))
        kept = power > drop**2
        return block @ (directions[:, kept] / np.sqrt(power[kept]))

    def check(self) -> None:
        """Judge the lines that had not reached the tolerance; every line before the end."""
        self._judge(self.pending)
        self._sift()
        if not len(self.pending) and self._coarse:
            self._coarse = False
            self._checked = np.arange(len(self._lines))
            self._judge(self._checked)
            self._sift()
        if not len(self.pending):
            self._judge(self._checked)  # with the whole basis
            self._judge_truly()
            self._sift(1.0)
            self._require_no_resonance()

    def _sift(self, fraction: float = _MARGIN) -> None:
        above = self.residuals[self._checked].max(axis=1, initial=0.0) > fraction * self._tolerance
        self.pending = self._checked[above]

    def _judge(self, lines: npt.NDArray[np.intp]) -> None:
        for start in range(0, len(lines), _LINES):
            some = lines[start : start + _LINES]
            y = self._coordinates(some)
            left = np.tensordot(self._sketched_load, self._loads.coordinates[:, :, some], axes=1)
            for factors, seen in zip(self._factors, self._sketched, strict=True):
                left -= np.tensordot(seen, y, axes=1) * factors[some]
            self.residuals[some] = np.linalg.norm(left, axis=0).T / self._loads.norms[some]

    def _coordinates(self, lines: npt.NDArray[np.intp]) -> ComplexArray:
        """Reduced coordinates y of some lines, shape ``(size, num_sides, len(lines))``."""
        A = np.tensordot(self._factors[:, lines], np.stack(self._reduced), axes=(0, 0))
        right = np.tensordot(self._reduced_load, self._loads.coordinates[:, :, lines], axes=1)
        y = np.linalg.solve(A, right.transpose(2, 0, 1))
        # Where stiff and soft directions are far apart a projected matrix keeps fewer digits than
        # the solution that was at hand.
        for number, line in enumerate(map(int, lines)):
            if line in self._solved:
                known = self._solved[line]
                y[number] = 0.0
                y[number, : len(known)] = known
        return np.asarray(y.transpose(1, 2, 0))

    def _judge_truly(self) -> None:
        """True residuals of the worst lines."""
        worst = np.argsort(self.residuals.max(axis=1))[-_WORST:]
        y = self._coordinates(worst)
        for number, line in enumerate(worst):
            left = self._loads.at(int(line))
            x = self._V @ y[:, :, number]
            for term in range(len(self._products)):
                left -= self._factors[term, line] * self._products(term, x)
            power = self._comm.allreduce(np.sum(np.abs(left) ** 2, axis=0))
            self.residuals[line] = np.sqrt(power) / self._loads.norms[line]

    def _require_no_resonance(self) -> None:
        """|s² VᴴMV y| against |b|, as the direct sweep looks at |s² M x|."""
        mass = self._reduced[self._mass]
        for start in range(0, len(self._lines), _LINES):
            some = np.arange(start, min(start + _LINES, len(self._lines)))
            inertia = np.linalg.norm(np.tensordot(mass, self._coordinates(some), axes=1), axis=0)
            growth = np.abs(self._lines[some]) ** 2 * (inertia.T / self._loads.norms[some]).max(
                axis=1
            )
            worst = int(np.argmax(growth))
            if growth[worst] > RESONANCE:
                raise ResonanceError(complex(self._lines[some[worst]]), float(growth[worst]))

    def next_expansion(self, block: int) -> tuple[list[int], int]:
        """Where to expand next, if anywhere, and in how many directions.

        The centre, by log residual, of the lines round the worst one that are not done yet.
        """
        if not len(self.pending):
            return [], 0
        target = _MARGIN * self._tolerance
        excess = np.log10(np.maximum(self.residuals[self._checked].max(axis=1) / target, 1.0))
        peak = int(np.argmax(excess))
        done = np.flatnonzero(excess == 0)
        first = done[done < peak].max(initial=-1) + 1
        last = done[done > peak].min(initial=len(excess))
        weights = excess[first:last]
        centre = round(float(weights @ np.arange(first, last) / weights.sum()))
        line = int(self._checked[centre])
        if line in self.expansions:
            line = int(self._checked[peak])
        if line in self.expansions:  # the sketch may be off there: any other line that is left
            others = [int(k) for k in self.pending if int(k) not in self.expansions]
            line = others[0] if others else line
        return [line], int(np.clip(2 * excess[peak] + 1, 4, block))

    def result(self) -> ReducedSweep:
        """The sweep as it stands."""
        everything = np.arange(len(self._lines))
        shape = (self._V.shape[1], self._loads.norms.shape[1], 0)
        parts = [
            self._coordinates(everything[start : start + _LINES])
            for start in range(0, len(everything), _LINES)
        ]
        y = np.concatenate(parts, axis=2) if parts else np.empty(shape, np.complex128)
        for vector in self._vectors:
            vector.destroy()
        return ReducedSweep(
            self._lines,
            self.residuals,
            self._factorisation.factorisations,
            self.solves,
            self._V,
            y,
            tuple(self.expansions),
        )


def _sketch_matrix(count: int, rank: int) -> sparse.csr_matrix:
    """Two signs a column of this rank's rows, each in a sum of its own."""
    random = np.random.default_rng([2013, rank])
    sums = random.integers(0, _SKETCH, size=(count, 2))
    signs = random.choice([-1.0, 1.0], size=(count, 2)) / np.sqrt(2.0)
    columns = np.repeat(np.arange(count), 2)
    return sparse.csr_matrix((signs.ravel(), (sums.ravel(), columns)), shape=(_SKETCH, count))
