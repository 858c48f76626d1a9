# SPDX-License-Identifier: MIT
"""From transfer functions to histories: û(ω) = h(ω) ü̂_b(ω) (6), T(ω) = r − ω²h(ω), peaks of cells.

Everything comes from projections of the sweep on rows, a block of cells at a time; a line that was
not solved counts as zero in the response and in the base acceleration that is added to it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import Sweep, share
from fenics_hytf.lapse.peaks import peak_length, peak_shear_strain
from fenics_hytf.motion import to_time
from fenics_hytf.operators import (
    constrained_rows,
    displacement_rows,
    split_rows,
    strain_rows,
)
from fenics_hytf.particles import (
    Sites,
    cell_centres,
    gradient_matrices,
    transfer_matrix,
)

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_BLOCK = 256  # cells whose spectra are held at once
_AT_ONCE = 64  # blocks whose rows are made at once
_FEW = 64  # cells whose histories are held at once: they stay in the cache


@dataclass(frozen=True)
class Excitation:
    """The input of one lapse at the lines that are solved.

    Attributes:
        lines: Numbers of the solved lines, shape ``(num_lines,)``.
        weights: Fourier coefficients of the base acceleration [m/s^2], shape
            ``(num_motions, num_lines)``.
        axes: Component in which each motion acts.
        num_samples: Samples of the lapse.
        dt: Time step [s].
        excited: Lines above the threshold.
    """

    lines: npt.NDArray[np.intp]
    weights: ComplexArray
    axes: tuple[int, ...]
    num_samples: int
    dt: float
    excited: int

    @property
    def frequency(self) -> RealArray:
        """Of the lines [Hz]."""
        return self.lines / (self.num_samples * self.dt)

    @property
    def omega(self) -> RealArray:
        """Circular frequency of the lines [rad/s]."""
        return 2 * np.pi * self.frequency

    @property
    def s(self) -> ComplexArray:
        """Complex frequency iω of the lines [rad/s]."""
        return np.asarray(1j * self.omega, np.complex128)

    @cached_property
    def _places(self) -> slice | npt.NDArray[np.intp]:
        """The lines among all: as a slice where they are neighbours, which is copied faster."""
        first, last = self.lines[[0, -1]] if len(self.lines) else (0, -1)
        return slice(first, last + 1) if last + 1 - first == len(self.lines) else self.lines

    def to_time(self, coefficients: ComplexArray) -> RealArray:
        """Sum the lines at every sample.

        Args:
            coefficients: Shape ``(..., num_lines)``.

        Returns:
            Shape ``(..., num_samples)``, of the same precision.
        """
        shape = (*coefficients.shape[:-1], self.num_samples // 2 + 1)
        spectrum = np.zeros(shape, coefficients.dtype)
        spectrum[..., self._places] = coefficients
        return to_time(spectrum, self.num_samples)

    def respond(self, projected: ComplexArray) -> ComplexArray:
        """Spectra of the response to all motions together (6).

        Args:
            projected: Transfer functions h, shape ``(..., num_motions, num_lines)``.

        Returns:
            Shape ``(..., num_lines)``.
        """
        return np.einsum("...mk,mk->...k", projected, self.weights)

    def weights_at(self, time: float) -> ComplexArray:
        """Weights that sum the solutions h to the response at one instant.

        Real parts of the sum are the response; lines but the first and the last one of an even
        number of samples stand for their negative twins as well.

        Args:
            time: After the start of the lapse [s].

        Returns:
            Shape ``(num_motions, num_lines)``.
        """
        twice = np.where(self.lines == 0, 1.0, 2.0)
        if self.num_samples % 2 == 0:
            twice = np.where(self.lines == self.num_samples // 2, 1.0, twice)
        return self.weights * (twice / self.num_samples * np.exp(1j * self.omega * time))


@dataclass(frozen=True)
class Histories:
    """Motion of the receivers; see :class:`~fenics_hytf.lapse.records.LapseResult`."""

    transfer: ComplexArray
    displacement: RealArray
    velocity: RealArray
    acceleration: RealArray
    total_acceleration: RealArray


class ReceiverProbe:
    """Evaluates the response at the receivers.

    Args:
        domain: The domain.
        T: Constraint matrix.
        sites: Receivers in owned cells of this rank.
        numbers: Their numbers among all receivers, shape ``(len(sites),)``.
        count: Receivers of all ranks.
    """

    def __init__(
        self,
        domain: Domain,
        T: PETSc.Mat,
        sites: Sites,
        numbers: npt.NDArray[np.intp],
        count: int,
    ) -> None:
        local = displacement_rows(transfer_matrix(sites, domain.V), domain.num_components)
        self._rows = constrained_rows(domain, local, T)
        self._domain, self._numbers, self._count = domain, numbers, count

    def destroy(self) -> None:
        """Destroy the rows."""
        self._rows.destroy()

    def histories(self, sweep: Sweep, excitation: Excitation, base: ComplexArray) -> Histories:
        """Histories and transfer functions of all receivers, on every rank (collective).

        Args:
            sweep: Transfer functions h.
            excitation: The input.
            base: Those of the base, which relative motion is relative to, shape
                ``(num_components, num_motions, num_lines)``.

        Returns:
            The histories.
        """
        omega = excitation.omega
        mine = sweep.project(self._rows)
        # A receiver that no rank holds rode a point that has left the mesh: not a number.
        h = np.full((self._count, *base.shape), np.nan, complex)
        for numbers, part in self._domain.comm.allgather((self._numbers, mine)):
            h[numbers] = part.reshape(len(numbers), *base.shape)
        transfer = -(omega**2) * h
        for motion, axis in enumerate(excitation.axes):
            transfer[:, axis, motion] += 1.0
        u, total = excitation.respond(h - base), excitation.respond(transfer)
        return Histories(
            transfer,
            excitation.to_time(u),
            excitation.to_time(1j * omega * u),
            excitation.to_time(-(omega**2) * u),
            excitation.to_time(total),
        )


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

    Groups of ranks with the same cells share out the blocks.
    """

    def __init__(self, domain: Domain, T: PETSc.Mat, convention: str) -> None:
        self._domain, self._convention = domain, convention
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

    def peak_strain(self, sweep: Sweep, excitation: Excitation) -> RealArray:
        """Largest shear strain of every cell (collective).

        Args:
            sweep: Transfer functions h.
            excitation: The input.

        Returns:
            All cells in the order of the input [-], shape ``(num_cells,)``.
        """
        peak = np.zeros((self._domain.num_owned_cells, 1))
        response = sweep.response(excitation.weights)
        for cells, strain, _ in self._blocks:
            for some, spectra in _by_few(cells, response(strain)):
                peak[some, 0] = peak_shear_strain(excitation.to_time(spectra), self._convention)
        return self._gather(peak)[:, 0]

    def peaks(
        self, sweep: Sweep, excitation: Excitation, modulus: ComplexArray, base: ComplexArray
    ) -> CellPeaks:
        """Largest strain, stress and motion of every cell (collective).

        Args:
            sweep: Transfer functions h.
            excitation: The input.
            modulus: Complex shear modulus G* of every cell [Pa], shape ``(num_cells,)``.
            base: Transfer functions of the base, which relative motion is relative to, shape
                ``(num_components, num_motions, num_lines)``.

        Returns:
            The peaks.
        """
        domain = self._domain
        mine = modulus[domain.input_cells[: domain.num_owned_cells]]
        peak = np.zeros((domain.num_owned_cells, 5))
        at_rest = excitation.omega == 0
        still = excitation.respond(base)
        response = sweep.response(excitation.weights)
        for cells, strain, place in self._blocks:
            for some, spectra in _by_few(cells, response(strain)):
                # G* is real at ω = 0.
                factor = np.where(at_rest, mine[some, None].real, mine[some, None])[:, None, :]
                for column, values in enumerate((spectra, factor.astype(spectra.dtype) * spectra)):
                    history = excitation.to_time(values)
                    peak[some, column] = peak_shear_strain(history, self._convention)
            for some, u in _by_few(cells, response(place)):
                for column, values in enumerate(_motions(u, still, excitation), start=2):
                    peak[some, column] = peak_length(excitation.to_time(values))
        return CellPeaks(*self._gather(peak).T)

    def _gather(self, peak: RealArray) -> RealArray:
        """All cells in the order of the input, from the ranks that looked at them."""
        if self._domain.across.size > 1:
            self._domain.across.Allreduce(MPI.IN_PLACE, peak, MPI.MAX)
        return self._domain.gather_cells(peak)


def _by_few(cells: slice, spectra: ComplexArray) -> Iterator[tuple[slice, ComplexArray]]:
    """Rows of a block, a few cells at a time, shape ``(num_cells, num_values, num_lines)``."""
    count = cells.stop - cells.start
    if count:
        by_cell = spectra.reshape(count, len(spectra) // count, spectra.shape[-1])
        for first in range(0, count, _FEW):
            stop = min(first + _FEW, count)
            yield slice(cells.start + first, cells.start + stop), by_cell[first:stop]


def _motions(
    u: ComplexArray, still: ComplexArray, excitation: Excitation
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Spectra of total acceleration, relative velocity and relative displacement."""
    given = np.zeros_like(still)
    for motion, axis in enumerate(excitation.axes):
        given[axis] += excitation.weights[motion]
    s = excitation.s.astype(u.dtype)
    relative = u - still.astype(u.dtype)
    return s * s * u + given.astype(u.dtype), s * relative, relative
