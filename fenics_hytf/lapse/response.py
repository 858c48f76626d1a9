# SPDX-License-Identifier: MIT
"""From transfer functions to histories: û(ω) = h(ω) ü̂_b(ω) (6), and what is carried over a seam.

Everything comes from projections of the sweep on rows. A line that was not solved counts as zero.
The start of a response that does not begin at rest is held by start functions (see
:mod:`fenics_hytf.motion.contour`), so a projection is its lines and its start:

    u(t) = Σ_k c_k φ_k(t) + L⁻¹[U − Σ_k c_k Φ_k](t)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import Columns, Sweep
from fenics_hytf.lapse.excitation import Excitation
from fenics_hytf.lapse.material import Part, part_functions
from fenics_hytf.lapse.slipped import Slipped
from fenics_hytf.operators import constrained_rows, displacement_rows, evaluate
from fenics_hytf.particles import Sites, transfer_matrix

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Spectra:
    """Some quantities on the lines.

    Attributes:
        coefficients: Without the start, shape ``(..., num_lines)``.
        start: c of the start functions, shape ``(..., 4)``, or ``None`` where there is no start.
    """

    coefficients: ComplexArray
    start: RealArray | None = None

    def __sub__(self, other: Spectra) -> Spectra:
        """The difference, as of a motion and that of the base."""
        start = self.start
        if start is not None and other.start is not None:
            start = start - other.start
        return Spectra(
            self.coefficients - other.coefficients.astype(self.coefficients.dtype), start
        )

    def __getitem__(self, some: slice | list[int]) -> Spectra:
        """Some of the quantities."""
        return Spectra(self.coefficients[some], None if self.start is None else self.start[some])

    def summed(self, comm: MPI.Comm) -> Spectra:
        """The sum over the ranks of a communicator (collective)."""
        start = None if self.start is None else np.asarray(comm.allreduce(self.start))
        return Spectra(np.asarray(comm.allreduce(self.coefficients)), start)

    def reshape(self, *shape: int) -> Spectra:
        """The quantities in another shape."""
        start = None if self.start is None else self.start.reshape(*shape, self.start.shape[-1])
        return Spectra(self.coefficients.reshape(*shape, self.coefficients.shape[-1]), start)


@dataclass(frozen=True)
class Response:
    """The response of one lapse.

    Attributes:
        sweep: Transfer functions h of each motion (5), and those of what is carried over.
        excitation: What they are weighed with.
        start: c of the start functions on this rank's unknowns, or ``None`` without a start.
        start_factorisations: Matrices factorised for them.
    """

    sweep: Sweep
    excitation: Excitation
    start: Columns | None = None
    start_factorisations: int = 0

    def transfer(self, rows: PETSc.Mat) -> ComplexArray:
        """Transfer functions h of the motions, shape ``(n, num_motions, num_lines)``."""
        return self.sweep.project(rows)[:, : len(self.excitation.axes)]

    def spectra(self, rows: PETSc.Mat) -> Spectra:
        """The response to all that acts, times the rows of a matrix.

        Args:
            rows: Matrix with as many columns as there are unknowns.

        Returns:
            This rank's rows.
        """
        projected = self.sweep.project(rows)
        return self._without_start(
            np.einsum("nsk,sk->nk", projected, self.excitation.weights), rows
        )

    def weighed(self) -> Callable[[PETSc.Mat], Spectra]:
        """Likewise for many matrices: as precise as the sweep, and no more."""
        response = self.sweep.response(self.excitation.weights)
        return lambda rows: self._without_start(response(rows), rows)

    def _without_start(self, coefficients: ComplexArray, rows: PETSc.Mat) -> Spectra:
        if self.start is None:
            return Spectra(coefficients)
        c = self.start.seen_by(rows).real
        held = c @ self.excitation.start_transform
        return Spectra(coefficients - held.astype(coefficients.dtype), c)

    def history(self, spectra: Spectra, derivative: int = 0) -> RealArray:
        """Values at every sample of the lapse.

        Args:
            spectra: Of quantities.
            derivative: Order of the time derivative.

        Returns:
            Shape ``(..., num_samples)``, of the precision of the spectra.
        """
        given, values = self.excitation, spectra.coefficients
        # What overflows single precision is told by the peaks of the cells.
        with np.errstate(over="ignore", invalid="ignore"):
            factor = (given.s**derivative).astype(values.dtype)
            history = given.to_time(values * factor if derivative else values)
        if spectra.start is not None and given.start is not None:
            functions = given.start.in_time(given.num_samples, derivative)
            history += spectra.start.astype(history.dtype) @ functions.astype(history.dtype)
        return history

    def between(self, spectra: Spectra, derivative: int, substeps: int) -> RealArray:
        """Values at every sample of the lapse, between samples, and at its end.

        Args:
            spectra: Of quantities, in double precision.
            derivative: Order of the time derivative.
            substeps: Steps from one sample to the next.

        Returns:
            Shape ``(..., num_samples·substeps + 1)``.
        """
        given = self.excitation
        history = given.between(spectra.coefficients * given.s**derivative, substeps)
        if spectra.start is not None and given.start is not None:
            time = given.dt / substeps * np.arange(history.shape[-1], dtype=np.float64)
            history = history + spectra.start @ given.start.at(time, derivative)
        return history

    def start_through(self, parts: tuple[Part, ...]) -> RealArray:
        """What the parts of a law make of the start functions.

        Args:
            parts: The parts.

        Returns:
            L⁻¹[f_j Φ_k], shape ``(len(parts), 4, num_samples)``.
        """
        given = self.excitation
        assert given.start is not None
        time = given.dt * np.arange(given.num_samples, dtype=np.float64)
        found = []
        for part in parts:
            if part.relaxation_time is not None:
                found.append(given.start.remembered(part.relaxation_time, time))
            elif part.instantaneous == 1.0:
                found.append(given.start.in_time(given.num_samples))
            else:
                through = part_functions((part,), given.s) * given.start_transform
                found.append(given.to_time(through))
        return np.stack(found)

    def unknowns_at(
        self, time: float, derivative: int = 0, relaxation_time: float | None = None
    ) -> RealArray:
        """All unknowns at one instant.

        Args:
            time: After the start of the lapse [s].
            derivative: Order of the time derivative.
            relaxation_time: τ of a Maxwell branch, for its memory instead of the motion itself.

        Returns:
            This rank's, shape ``(num_local_unknowns,)``.
        """
        given = self.excitation
        factor = given.sum_at(time) * given.factors(derivative, relaxation_time)
        values = self.sweep.combine(given.weights * factor).real
        if self.start is not None:
            functions = given.start_at(time, derivative, relaxation_time)
            values = values + (self.start @ functions.astype(complex)).real
        return np.asarray(values)


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

    def histories(
        self, response: Response, base: Spectra, slip: Slipped | None = None
    ) -> Histories:
        """Histories and transfer functions of all receivers, on every rank (collective).

        Args:
            response: The response.
            base: Motion of the base, which relative motion is relative to, a spectrum for each
                component.
            slip: What slips besides.

        Returns:
            The histories; the displacement is the increment of the lapse.
        """
        given, components = response.excitation, self._domain.num_components
        h = response.transfer(self._rows)
        count = len(h) // components
        transfer = given.s**2 * h.reshape(count, components, *h.shape[1:])
        for motion, axis in enumerate(given.axes):
            transfer[:, axis, motion] += 1.0
        absolute = response.spectra(self._rows).reshape(count, components)
        relative = absolute - base
        total = response.history(absolute, 2)
        total[:, list(given.axes)] += given.base_acceleration
        moved = [response.history(relative, derivative) for derivative in range(3)]
        if slip is not None:
            for derivative, history in enumerate(moved):
                history += slip.added_to(self._rows, derivative).reshape(history.shape)
            total += slip.added_to(self._rows, 2).reshape(total.shape)
        return Histories(*self._gather(transfer, *moved, total))

    def at(self, unknowns: RealArray) -> RealArray:
        """Displacement of all receivers at one instant (collective).

        Args:
            unknowns: This rank's unknowns, shape ``(num_local_unknowns,)``.

        Returns:
            Shape ``(num_receivers, num_components)``.
        """
        mine = evaluate(self._rows, unknowns).reshape(-1, self._domain.num_components)
        return np.asarray(self._gather(mine)[0])

    def _gather(self, *mine: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
        """Of all receivers, from the ranks that hold them."""
        # A receiver that no rank holds rode a point that has left the mesh: not a number.
        every = [np.full((self._count, *part.shape[1:]), np.nan, part.dtype) for part in mine]
        for numbers, parts in self._domain.comm.allgather((self._numbers, mine)):
            for values, part in zip(every, parts, strict=True):
                values[numbers] = part
        return every
