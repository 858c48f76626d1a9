# SPDX-License-Identifier: MIT
"""The response in the middle of every cell: largest strain, stress and motion over a lapse."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import share
from fenics_hytf.lapse.errors import PeakError
from fenics_hytf.lapse.material import Material
from fenics_hytf.lapse.peaks import peak_length, peak_shear_strain
from fenics_hytf.lapse.response import Response, Spectra
from fenics_hytf.lapse.sight import Sight, sight_of
from fenics_hytf.lapse.slipped import Slipped
from fenics_hytf.operators import (
    constrained_rows,
    displacement_rows,
    evaluate,
    split_rows,
    strain_rows,
)
from fenics_hytf.particles import cell_centres, gradient_matrices, transfer_matrix

RealArray = npt.NDArray[np.float64]

_BLOCK = 256  # cells whose spectra are held at once
_AT_ONCE = 64  # blocks whose rows are made at once
_FEW = 64  # cells whose histories are held at once: they stay in the cache
_BEYOND = 1e18  # of peaks in SI units: single precision has squares up to 3e38


@dataclass(frozen=True)
class CarriedCells:
    """What the cells of this rank bring from the lapse before.

    Attributes:
        strain: Strain at the start [-], shape ``(num_owned_cells, num_strains)``.
        displacement: Relative to the base [m], shape ``(num_owned_cells, num_components)``.
        stress: Shares of the stress, each of which fades in its own way, as half of the normal
            stresses and the shear stresses [Pa], shape
            ``(num_owned_cells, num_strains, num_shares)``.
        fading: How they do, at the samples of the lapse at least, shape
            ``(num_shares, num_samples)``.
    """

    strain: RealArray
    displacement: RealArray
    stress: RealArray
    fading: RealArray


@dataclass(frozen=True)
class CellPeaks:
    """Largest values over the lapse, all cells in the order of the input.

    Attributes:
        strain: Shear strain [-], shape ``(num_cells,)``.
        stress: Shear stress [Pa], shape ``(num_cells,)``.
        acceleration: Norm of the total acceleration [m/s^2], shape ``(num_cells,)``.
        velocity: Norm of the velocity relative to the base [m/s], shape ``(num_cells,)``.
        displacement: Norm of the displacement relative to the base [m], shape ``(num_cells,)``.
    """

    strain: RealArray
    stress: RealArray
    acceleration: RealArray
    velocity: RealArray
    displacement: RealArray


class CellProbe:
    """Evaluates the response at the centres of cells, a block of them at a time.

    Args:
        domain: The domain.
        T: Constraint matrix.
        convention: Strain measure, see :func:`peak_shear_strain`.
        filled: Cells with soil in the order of the input, shape ``(num_cells,)``; in others nothing
            is seen. All are if ``None``.

    Groups of ranks with the same cells share out the blocks.
    """

    def __init__(
        self,
        domain: Domain,
        T: PETSc.Mat,
        convention: str,
        filled: npt.NDArray[np.bool_] | None = None,
    ) -> None:
        self._domain, self._convention = domain, convention
        owned = domain.input_cells[: domain.num_owned_cells]
        self._empty = None if filled is None else ~filled[owned]
        blocks = domain.comm.allreduce(-(-domain.num_owned_cells // _BLOCK), MPI.MAX)
        mine = range(blocks)[share(blocks, domain.across)]
        self._blocks: list[tuple[slice, PETSc.Mat, PETSc.Mat]] = []
        for first in range(mine.start, mine.stop, _AT_ONCE):
            self._blocks += self._rows(T, range(first, min(first + _AT_ONCE, mine.stop)))

    def _rows(self, T: PETSc.Mat, blocks: range) -> list[tuple[slice, PETSc.Mat, PETSc.Mat]]:
        """Cells of some blocks, and the rows that evaluate their strain and displacement."""
        domain, owned = self._domain, self._domain.num_owned_cells
        bounds = [min(b * _BLOCK, owned) for b in range(blocks.start, blocks.stop + 1)]
        centres = cell_centres(domain.mesh, bounds[0], bounds[-1])
        count = domain.num_components
        parts = []
        for local in (
            strain_rows(gradient_matrices(centres, domain.V), count),
            displacement_rows(transfer_matrix(centres, domain.V), count),
        ):
            rows = constrained_rows(domain, local, T)
            a_cell = local.shape[0] // max(len(centres), 1)
            parts.append(split_rows(rows, [a_cell * (bound - bounds[0]) for bound in bounds]))
            rows.destroy()
        cells = [slice(first, stop) for first, stop in pairwise(bounds)]
        return list(zip(cells, *parts, strict=True))

    def destroy(self) -> None:
        """Destroy the rows."""
        for _, *rows in self._blocks:
            for row in rows:
                row.destroy()

    def strains(
        self, response: Response, carried: CarriedCells | None = None
    ) -> Iterator[tuple[slice, RealArray]]:
        """Strain histories, a few cells at a time (collective: every rank goes through them).

        Args:
            response: The response.
            carried: What the lapse began with.

        Yields:
            The cells among this rank's, and their strain [-], shape
            ``(num_cells, num_strains, num_samples)``.
        """
        sight = sight_of(response, self._domain.comm)
        for cells, rows, _ in self._blocks:
            for some, seen in _by_few(cells, sight, rows):
                yield some, self._strain(sight, seen, some, carried)

    def _strain(
        self, sight: Sight, seen: Any, some: slice, carried: CarriedCells | None
    ) -> RealArray:
        history = sight.history(seen)
        if carried is not None:
            history += carried.strain[some, :, None].astype(history.dtype)
        if self._empty is not None:
            history[self._empty[some]] = 0.0
        return history

    def peak_strain(self, response: Response, carried: CarriedCells | None = None) -> RealArray:
        """Largest shear strain of every cell (collective).

        Args:
            response: The response.
            carried: What the lapse began with.

        Returns:
            All cells in the order of the input [-], shape ``(num_cells,)``.
        """
        peak = np.zeros((self._domain.num_owned_cells, 1))
        for some, strain in self.strains(response, carried):
            peak[some, 0] = peak_shear_strain(strain, self._convention)
        return self._gather(peak)[:, 0]

    def shear_strain(self, unknowns: RealArray) -> RealArray:
        """Shear strain of a field at one instant (collective).

        Args:
            unknowns: This rank's, shape ``(num_local_unknowns,)``.

        Returns:
            All cells in the order of the input [-], shape ``(num_cells,)``.
        """
        found = np.zeros((self._domain.num_owned_cells, 1))
        for cells, rows, _ in self._blocks:
            strain = _by_cell(evaluate(rows, unknowns), cells)[:, :, None]
            found[cells, 0] = peak_shear_strain(strain, self._convention)
        return self._gather(found)[:, 0]

    def peaks(
        self,
        response: Response,
        material: Material,
        base: Spectra,
        carried: CarriedCells | None = None,
        slip: Slipped | None = None,
    ) -> CellPeaks:
        """Largest strain, stress and motion of every cell (collective).

        Args:
            response: The response.
            material: The law of every cell.
            base: Motion of the base, which relative motion is relative to.
            carried: What the lapse began with.
            slip: What slips besides; it strains nothing that bears stress.

        Returns:
            The peaks.
        """
        given, owned = response.excitation, self._domain.num_owned_cells
        peak = np.zeros((owned, 5))
        sight = sight_of(response, self._domain.comm, material.parts)
        stress = _StressHistories(sight, material, self._domain.input_cells[:owned], carried)
        of_base = [response.history(base, derivative) for derivative in range(2)]
        slipped = [] if slip is None else [slip.at_samples(derivative) for derivative in range(3)]
        motion = np.zeros((self._domain.num_components, given.num_samples))
        motion[list(given.axes)] = given.base_acceleration
        for cells, strains, places in self._blocks:
            for some, seen in _by_few(cells, sight, strains):
                strain = self._strain(sight, seen, some, carried)
                for column, history in enumerate((strain, stress(seen, some))):
                    peak[some, column] = peak_shear_strain(history, self._convention)
            moved = None if slip is None else _by_cell(slip.seen_by(places), cells)
            for some, seen in _by_few(cells, sight, places):
                histories = [sight.history(seen, derivative) for derivative in range(3)]
                if moved is not None:
                    there = moved[some.start - cells.start : some.stop - cells.start]
                    for history, course in zip(histories, slipped, strict=True):
                        history += there[:, :, None] * course
                displacement, velocity, acceleration = histories
                for history, of in zip(histories, (-of_base[0], -of_base[1], motion), strict=True):
                    history += of.astype(history.dtype)
                if carried is not None:
                    displacement += carried.displacement[some, :, None].astype(displacement.dtype)
                peak[some, 2] = peak_length(acceleration)
                peak[some, 3] = peak_length(velocity)
                peak[some, 4] = peak_length(displacement)
        return CellPeaks(*self._gather(peak).T)

    def _gather(self, peak: RealArray) -> RealArray:
        """All cells in the order of the input, from the ranks that looked at them.

        Raises:
            PeakError: A value beyond what single precision has squares of; on every rank.
        """
        if self._domain.across.size > 1:
            self._domain.across.Allreduce(MPI.IN_PLACE, peak, MPI.MAX)
        if self._empty is not None:
            peak[self._empty] = 0.0
        everywhere = self._domain.gather_cells(peak)
        beyond = np.flatnonzero(~(everywhere < _BEYOND).all(axis=1))
        if len(beyond):
            raise PeakError([int(cell) for cell in beyond])
        return everywhere


class _StressHistories:
    """Shear stress of cells from their strain: G(s) times what comes, and what is there already."""

    def __init__(
        self,
        sight: Sight,
        material: Material,
        cells: npt.NDArray[np.int64],
        carried: CarriedCells | None,
    ) -> None:
        self._sight, self._carried = sight, carried
        parts = material.parts
        self._moduli = np.stack([p.constants.shear_modulus[cells] for p in parts], axis=1)

    def __call__(self, seen: Any, some: slice) -> RealArray:
        history = self._sight.stress(seen, self._moduli[some])
        if self._carried is not None:
            # A lapse that a new mechanism cuts short is shorter than what was reckoned with.
            shares = self._carried.stress[some]
            fading = self._carried.fading[:, : history.shape[-1]]
            history += shares.astype(history.dtype) @ fading.astype(history.dtype)
        return history


def _by_cell(values: RealArray, cells: slice) -> RealArray:
    """Values of the rows of a block, shape ``(num_cells, num_values)``."""
    count = max(cells.stop - cells.start, 1)
    return values.reshape(-1, len(values) // count) if len(values) else np.empty((0, 1))


def _by_few(cells: slice, sight: Sight, rows: PETSc.Mat) -> Iterator[tuple[slice, Any]]:
    """What the rows of a block see, a few cells at a time (collective)."""
    count = cells.stop - cells.start
    seen = sight.see(rows, count)
    for first in range(0, count, _FEW):
        stop = min(first + _FEW, count)
        yield slice(cells.start + first, cells.start + stop), seen[first:stop]
