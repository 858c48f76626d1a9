# SPDX-License-Identifier: MIT
"""The basis of a reduced sweep, what the system looks like on it, and how well it solves a line.

x(s) ≈ V y(s) with (Σ f_j(s) VᴴK_jV) y = Vᴴb; Vᴴ and not Vᵀ, so that the reduced matrix of a damped
system is regular. The residual of a line is judged from a sketch: a few hundred signed sums of its
entries, of which the norm is right to some per cent (Clarkson and Woodruff 2013; Nelson and Nguyen
2013).

Where several groups of ranks hold the same mesh, each brings directions of its own and all of them
take all: the basis is the same everywhere. What has to be computed for columns of the basis, or for
lines, is shared out among the groups.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy import sparse

from fenics_hytf.frequency.columns import Columns
from fenics_hytf.frequency.errors import FactorisationError
from fenics_hytf.frequency.groups import share
from fenics_hytf.frequency.loads import LoadFactors
from fenics_hytf.frequency.modes import Modes, as_quadratic
from fenics_hytf.frequency.products import TermProducts, inner, times
from fenics_hytf.frequency.system import values

ComplexArray = npt.NDArray[np.complex128]
RealArray = npt.NDArray[np.float64]
Lines = npt.NDArray[np.intp]

_SKETCH = 600  # sums; their norm is off by 1/√600 or so
_ROUND_OFF = 1e-14  # a direction of a unit vector that is smaller is none
_STRAIGHT = 0.5  # one of which more is left is straight to round-off
_LINES = 64  # reduced systems solved at once
# An eigendecomposition costs as much as some 60 eliminations, of the linearised system some 200.
_MANY, _MANY_DAMPED = 100, 400
_MODES = 1e-2  # of the tolerance: what the modes may be off by


class Basis:
    """V, orthonormal, and VᴴK_jV of every term.

    Args:
        products: The system's matrices, in scale.
        loads: Right-hand sides, in scale.
        lines: Complex frequencies [rad/s], shape ``(num_lines,)``.
        tolerance: Relative residual that every line must reach [-].
        across: Communicator of the ranks that hold the same part of the mesh.

    Attributes:
        V: The basis on this rank, in scale.
    """

    def __init__(
        self,
        products: TermProducts,
        loads: LoadFactors,
        lines: ComplexArray,
        tolerance: float,
        across: MPI.Comm,
    ) -> None:
        self._products, self._loads, self._across = products, loads, across
        self._lines, self._tolerance = lines, tolerance
        self._comm = products.comm
        self._factors = np.stack([values(function, lines) for function in products.functions])
        count, num_loads = loads.vectors.shape
        self.V = Columns(count)
        self._load: ComplexArray = np.empty((0, num_loads), np.complex128)
        self._terms = np.empty((len(products), 0, 0), np.complex128)
        # Residuals are those of the forces themselves.
        sketch = _sketch_matrix(count, self._comm.rank)
        self._sketch = sparse.csc_matrix(sketch @ sparse.diags(1 / products.scale))
        self._sketched = np.empty((len(products), _SKETCH, 0), np.complex128)
        self._sketched_load = self._comm.allreduce(times(self._sketch, loads.vectors))
        self._known: dict[int, ComplexArray] = {}  # coordinates of lines that were factorised
        # Where the functions are smooth and all lines can be had from the modes of the system.
        self._smooth = lines.imag > 0
        self._powers: ComplexArray | None = None
        if np.count_nonzero(self._smooth) >= _MANY:
            self._powers = as_quadratic(self._factors[:, self._smooth], lines[self._smooth])
        damped = self._powers is not None and bool(np.any(self._powers[:, 1]))
        self._many = _MANY_DAMPED if damped else _MANY
        self._modes: Modes | None = None

    @property
    def size(self) -> int:
        """Directions of the basis."""
        return self.V.size

    def fresh(self, blocks: Sequence[tuple[ComplexArray, float]]) -> ComplexArray:
        """What blocks of directions have that is new.

        Args:
            blocks: Directions, shape ``(num_local, n)``, and how small one may be [-].

        Returns:
            Orthonormal and at right angles to the basis, shape ``(num_local, m)``.
        """
        if not blocks:
            return np.empty((self.V.num_rows, 0), np.complex128)
        pieces = [block for block, _ in blocks]
        wide = self._beside_basis(np.concatenate(pieces, axis=1))
        found = wide[:, :0]
        splits = np.cumsum([piece.shape[1] for piece in pieces])[:-1]
        for (_, drop), piece in zip(blocks, np.split(wide, splits, axis=1), strict=True):
            piece, _ = self._orthonormalise(self._beside(found, piece), drop)
            found = np.concatenate([found, piece], axis=1)
        return self._straighten(found, found[:, :0])

    def _straighten(self, block: ComplexArray, taken: ComplexArray) -> ComplexArray:
        """Orthonormal columns that were scaled up, again at right angles to the basis.

        Args:
            block: The columns.
            taken: Others that they have to be at right angles to.
        """
        smallest = 0.0
        while block.shape[1] and smallest < _STRAIGHT:
            block = self._beside(taken, self._beside_basis(block))
            block, smallest = self._orthonormalise(block, _ROUND_OFF)
        return block

    def take(self, mine: ComplexArray) -> None:
        """Take what all groups have found (collective over the groups).

        Args:
            mine: Of this group, as :meth:`fresh` gives it.
        """
        taken = mine[:, :0]
        for block in self._exchange(mine):
            taken = np.concatenate([taken, self._beside_taken(taken, block)], axis=1)
        if taken.shape[1]:
            self.V.append(taken)
            self._complete(taken)

    def _exchange(self, mine: ComplexArray) -> list[ComplexArray]:
        if self._across.size == 1:
            return [mine]
        blocks = []
        for group, width in enumerate(self._across.allgather(mine.shape[1])):
            shape = (len(mine), width)
            block = mine if group == self._across.rank else np.empty(shape, np.complex128)
            self._across.Bcast(np.ascontiguousarray(block) if block is mine else block, group)
            blocks.append(block)
        return blocks

    def _beside_taken(self, taken: ComplexArray, block: ComplexArray) -> ComplexArray:
        """At right angles to what the groups before have brought in this round."""
        if not taken.shape[1]:
            return block
        block, smallest = self._orthonormalise(self._beside(taken, block), _ROUND_OFF)
        return block if smallest > _STRAIGHT else self._straighten(block, taken)

    def _beside(self, basis: ComplexArray, block: ComplexArray) -> ComplexArray:
        if not basis.shape[1] or not block.shape[1]:
            return block
        return block - basis @ self._inner(basis, block)

    def _beside_basis(self, block: ComplexArray) -> ComplexArray:
        if not self.size or not block.shape[1]:
            return block
        return block - self.V @ self.V.inner(self._comm, block)

    def _orthonormalise(self, block: ComplexArray, drop: float) -> tuple[ComplexArray, float]:
        """Principal directions of a block that are not too small, and how small they were."""
        power, directions = np.linalg.eigh(self._inner(block, block))
        kept = power > drop**2
        sizes = np.sqrt(power[kept])
        return block @ (directions[:, kept] / sizes), float(sizes.min(initial=1.0))

    def _complete(self, new: ComplexArray) -> None:
        """Project the system on columns that were appended, and sketch it there."""
        old = len(self._load)
        self._load = np.concatenate([self._load, self._inner(new, self._loads.vectors)])
        mine = np.ascontiguousarray(new[:, share(new.shape[1], self._across)])
        terms, width = len(self._products), mine.shape[1]
        # All terms side by side: wide products are the fast ones.
        images = np.concatenate([self._products(j, mine) for j in range(terms)], axis=1)
        border = self._columns(self.V.inner(self._comm, images), terms, width)
        sketched = self._comm.allreduce(times(self._sketch, images))
        sketched = self._columns(sketched, terms, width)
        grown = np.empty((terms, self.size, self.size), np.complex128)
        grown[:, :old, :old] = self._terms
        grown[:, :, old:] = border
        # K_j is real and symmetric
        grown[:, old:, :old] = border[:, :old].conj().transpose(0, 2, 1)
        self._terms = grown
        self._sketched = np.concatenate([self._sketched, sketched], axis=2)
        self._modes = None

    def _columns(self, mine: ComplexArray, terms: int, width: int) -> ComplexArray:
        """Columns of every term, of all groups, shape ``(num_terms, num_rows, num_columns)``."""
        stacked = mine.reshape(len(mine), terms, width).transpose(1, 0, 2)
        if self._across.size == 1:
            return stacked
        return np.concatenate(self._across.allgather(stacked), axis=2)

    def remember(self, solutions: dict[int, ComplexArray]) -> None:
        """Keep solutions that lie in the basis (collective over the groups).

        Where stiff and soft directions are far apart a projected matrix keeps fewer digits than
        the solution that was at hand.

        Args:
            solutions: This group's, by line, shape ``(num_local, num_sides)`` each.
        """
        mine = {line: self.V.inner(self._comm, x) for line, x in solutions.items()}
        for known in self._across.allgather(mine):
            self._known.update(known)

    def coordinates(self, lines: Lines) -> ComplexArray:
        """Reduced coordinates y of some lines.

        Args:
            lines: Their numbers.

        Returns:
            Shape ``(size, num_sides, len(lines))``.

        Raises:
            FactorisationError: The projected matrix of a line is singular.
        """
        y = np.empty((self.size, self._loads.norms.shape[1], len(lines)), np.complex128)
        smooth = self._smooth[lines]
        modes = self._modes_for(int(np.sum(smooth)))
        if modes is None:
            smooth[:] = False
        else:
            some = lines[smooth]
            there = self._loads.coordinates[:, :, some]
            y[:, :, smooth] = modes.solve(self._lines[some], self._load, there)
        left = np.flatnonzero(~smooth)
        for start in range(0, len(left), _LINES):
            places = left[start : start + _LINES]
            y[:, :, places] = self._eliminate(lines[places])
        for place, line in enumerate(map(int, lines)):
            if line in self._known:
                known = self._known[line]
                y[:, :, place] = 0.0
                y[: len(known), :, place] = known
        return y

    def _eliminate(self, lines: Lines) -> ComplexArray:
        """Coordinates of lines one by one.

        Raises:
            FactorisationError: The projected matrix of a line is singular.
        """
        size = self.size
        A = self._factors[:, lines].T @ self._terms.reshape(len(self._terms), size * size)
        right = np.tensordot(self._load, self._loads.coordinates[:, :, lines], axes=1)
        A = A.reshape(len(lines), size, size)
        try:
            y = np.linalg.solve(A, right.transpose(2, 0, 1))
        except np.linalg.LinAlgError:
            singular = lines[np.argmin(np.linalg.matrix_rank(A))]
            raise FactorisationError(complex(self._lines[singular])) from None
        return np.asarray(y.transpose(1, 2, 0))

    def _modes_for(self, count: int) -> Modes | None:
        """The modes of the reduced system, where they are the shorter way to so many lines."""
        if self._powers is None or count < self._many or not self.size:
            return None
        if self._modes is None:
            A = np.tensordot(self._powers.T, self._terms, axes=1)
            try:
                self._modes = Modes(A.astype(np.complex128), float(abs(self._lines).max()))
            except np.linalg.LinAlgError:
                return None
            if not self._agree(self._modes):
                self._powers = self._modes = None  # too far from normal for the tolerance
        return self._modes

    def _agree(self, modes: Modes) -> bool:
        """Whether modes give what elimination does, on a few lines."""
        some = np.flatnonzero(self._smooth)[[0, self._many // 2, -1]]
        expected = self._eliminate(some)
        found = modes.solve(self._lines[some], self._load, self._loads.coordinates[:, :, some])
        error, size = (np.linalg.norm(y, axis=0) for y in (found - expected, expected))
        return bool(np.all(error <= _MODES * self._tolerance * size))

    def sketched_residuals(self, lines: Lines, y: ComplexArray) -> RealArray:
        """Relative residuals of some lines as the sketch sees them.

        Args:
            lines: Their numbers.
            y: Their coordinates.

        Returns:
            Shape ``(len(lines), num_sides)``.
        """
        residuals = np.empty((len(lines), y.shape[1]))
        smooth = self._smooth[lines] & (self._powers is not None)
        for powers, places in ((self._powers, smooth), (None, ~smooth)):
            if np.any(places):
                residuals[places] = self._leftovers(powers, lines[places], y[:, :, places])
        return residuals / self._loads.norms[lines]

    def _leftovers(self, powers: ComplexArray | None, lines: Lines, y: ComplexArray) -> RealArray:
        """Norms of b − A(s)Vy in the sketch, with the functions as they are or as polynomials."""
        terms: ComplexArray = self._sketched
        factors: ComplexArray = self._factors[:, lines]
        if powers is not None:
            used = np.flatnonzero(powers.any(axis=0))
            terms = np.tensordot(powers[:, used].T, terms, axes=1).astype(np.complex128)
            factors = self._lines[lines] ** used[:, None]
        load, terms = self._turn(terms) if len(lines) > _LINES else (self._sketched_load, terms)
        left = np.tensordot(load, self._loads.coordinates[:, :, lines], axes=1)
        for factor, seen in zip(factors, terms, strict=True):
            left -= np.tensordot(seen, y * factor, axes=1)
        return np.asarray(np.linalg.norm(left, axis=0).T)

    def _turn(self, terms: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Sketches of the loads and of the terms, turned where that leaves fewer rows."""
        num_terms, rows, size = terms.shape
        num_loads = self._sketched_load.shape[1]
        if num_loads + num_terms * size >= rows:
            return self._sketched_load, terms
        flat = terms.transpose(1, 0, 2).reshape(rows, num_terms * size)
        upper: ComplexArray = np.asarray(
            np.linalg.qr(np.concatenate([self._sketched_load, flat], axis=1), mode="r")
        )
        turned = upper[:, num_loads:].reshape(len(upper), num_terms, size).transpose(1, 0, 2)
        return upper[:, :num_loads], np.ascontiguousarray(turned)

    def true_residuals(self, line: int, y: ComplexArray) -> RealArray:
        """Relative residuals of a line.

        Args:
            line: Its number.
            y: Its coordinates, shape ``(size, num_sides)``.

        Returns:
            Shape ``(num_sides,)``.
        """
        left = self._loads.at(line)
        x: ComplexArray = self.V @ y
        for term in range(len(self._products)):
            left = left - complex(self._factors[term, line]) * self._products(term, x)
        left = left / self._products.scale[:, None]
        power = self._comm.allreduce(np.sum(np.abs(left) ** 2, axis=0))
        return np.asarray(np.sqrt(power) / self._loads.norms[line])

    def size_of_product(self, term: int, lines: Lines, y: ComplexArray) -> RealArray:
        """|K_j x| over the load, as the sketch sees it, shape ``(len(lines), num_sides)``."""
        seen = np.tensordot(self._sketched[term], y, axes=1)
        return np.asarray(np.linalg.norm(seen, axis=0).T / self._loads.norms[lines])

    def _inner(self, left: ComplexArray, right: ComplexArray) -> ComplexArray:
        return inner(self._comm, left, right)


def _sketch_matrix(count: int, rank: int) -> sparse.csc_matrix:
    """Two signs over √2 a column, in two sums drawn at random (once in 600 the same one)."""
    random = np.random.default_rng([2013, rank])
    sums = random.integers(0, _SKETCH, size=(count, 2))
    signs = random.choice([-1.0, 1.0], size=(count, 2)) / np.sqrt(2.0)
    start = np.arange(0, 2 * count + 1, 2)
    return sparse.csc_matrix((signs.ravel(), sums.ravel(), start), shape=(_SKETCH, count))
