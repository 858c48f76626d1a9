# SPDX-License-Identifier: MIT
"""A run: what lives from lapse to lapse, and the steps of the outer loop one by one."""

from __future__ import annotations

import logging
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any, get_type_hints

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fenics_hytf.lapse import (
    BaseProbe,
    CellProbe,
    CellState,
    Continuity,
    CycleCount,
    Energy,
    Equations,
    FreeField,
    FreeFieldState,
    Ground,
    Histories,
    LapseResult,
    Observer,
    ReceiverProbe,
    Response,
    Solved,
    Spectra,
    cell_stress,
    choose_continuity,
    convect,
    first_strain,
    outcrop_motion,
    seed_points,
    solve,
    survey,
    within_motion,
)
from fenics_hytf.motion import Segment
from fenics_hytf.particles import (
    MassLedger,
    gather_points,
    scatter_points,
    transfer_matrix,
)
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.check import checked_domain
from fenics_hytf.simulation.checkpoint import Checkpoint
from fenics_hytf.simulation.checkpoint_folder import CheckpointFolder
from fenics_hytf.simulation.clock import Clock
from fenics_hytf.simulation.groups import Groups, require_same_parts
from fenics_hytf.simulation.memory import peak_memory
from fenics_hytf.simulation.receivers import Receivers
from fenics_hytf.simulation.records import (
    Progress,
    ProgressCallback,
    Result,
    Snapshot,
    SnapshotCallback,
    Work,
)
from fenics_hytf.simulation.snapshots import take_snapshot
from fenics_hytf.soil import CyclicState

RealArray = npt.NDArray[np.float64]

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class RunState:
    """What a checkpoint holds; see :class:`Run`."""

    lapses: tuple[LapseResult, ...]
    work: Work
    ledger: MassLedger
    points: dict[str, npt.NDArray[Any]]
    carried: RealArray
    base_carried: RealArray
    effective_strain: RealArray | None
    free_fields: tuple[FreeFieldState, ...]
    cycles: CyclicState | None


class Run:
    """State that lives from lapse to lapse: mesh, points, equations, the warm start."""

    def __init__(
        self,
        scene: Scene,
        comm: MPI.Comm,
        groups: Groups,
        progress: ProgressCallback | None,
        strain_from: npt.NDArray[np.intp] | None,
    ) -> None:
        self.scene = scene
        self.comm, self._groups = comm, groups
        self.clock = Clock()
        self.lapses: list[LapseResult] = []
        self._work = Work(wall_s=self.clock.wall_s)
        self._assemblies: Counter[str] = Counter()
        self._progress = progress if comm.rank == 0 else None
        self._strain_from = strain_from
        self._ground: Ground | None = None
        self._effective_strain: RealArray | None = None
        # Displacement at the start of a lapse: of the receivers relative to the base, of the base.
        self._carried: RealArray
        self._base_carried: RealArray
        self._base_before: RealArray
        self._start_field: RealArray | float = 0.0
        self._owned: list[Equations | Continuity | CellProbe | BaseProbe | FreeField] = []

    def set_up(self) -> None:
        """Mesh, points, receivers, and the operators that last for the whole run."""
        scene = self.scene
        with self.clock.phase("setup"):
            domain = checked_domain(scene, self._groups.within)
            self.domain = replace(domain, across=self._groups.across)
            require_same_parts(self.domain)
            self.free_fields = self._level_ground()
            self.equations = Equations(scene, self.domain, self._assemblies, self.free_fields)
            self._owned.append(self.equations)
            self.continuity: Continuity = choose_continuity(scene, self.domain, self.equations)
            self._owned.append(self.continuity)
            self.points = seed_points(scene, self.domain, self.continuity.fields)
            self.receivers = Receivers(self.domain, self.points, scene.output.receivers)
            loop = scene.effects.equivalent_linear
            self._probe = CellProbe(
                self.domain, self.equations.T, loop.strain if loop is not None else "plane"
            )
            self._base = BaseProbe(self.domain, self.equations)
            cycles = scene.effects.degradation
            self._cycles = None if cycles is None else CycleCount(cycles, self.domain)
            names = self.domain.region_names
            self._density = np.array([scene.soil[name].density for name in names])
            components = self.domain.num_components
            self._carried = np.zeros((len(self.receivers.names), components))
            self._base_carried = np.zeros(components)
            self._owned += [self._probe, self._base]
        self._ledger = self.points.ledger(self.domain.comm)

    def _level_ground(self) -> list[FreeField]:
        """A column beyond each side with free field."""
        columns = []
        for name, kind in self.scene.boundary.kinds.items():
            if kind == "free_field":
                columns.append(FreeField(self.scene, self.domain, name, self._assemblies))
                self._owned.append(columns[-1])
        return columns

    def destroy(self) -> None:
        """Destroy all PETSc objects."""
        for owned in self._owned:
            owned.destroy()

    def weigh(self) -> None:
        """M = SᵀM_pS (4), K_NL and the soil of each cell, from the points where they are now."""
        if self._ground is not None and not self.scene.effects.convection:
            return
        with self.clock.phase("assembly"):
            self._ground = survey(self.scene, self.domain, self.points)
            self.equations.weigh(self.points)
            if self.scene.effects.geometric_stiffness:
                self.equations.stiffen(cell_stress(self.domain, self.points))

    def solve_lapse(self, segment: Segment) -> Solved:
        """Transfer functions (5) of the lapse, with moduli that fit its strain."""
        assert self._ground is not None
        index, ground = segment.index, self._ground
        if self._cycles is not None:
            ground = self._ground = replace(ground, degradation=self._cycles.state.index)
        excitation = self.continuity.excite(segment)
        self.continuity.begin(self.points, excitation)
        observer = self._observer(index)
        for column in self.free_fields:
            self._count(column.solve(segment, self._observer(index, column.name)))
        start = self._effective_strain  # of the lapse before
        solved = solve(
            self.scene,
            self.equations,
            ground,
            excitation,
            self.continuity,
            self._probe,
            first_strain(self.scene, ground) if start is None else start,
            observer,
            self._strain_from,
        )
        self._effective_strain = solved.effective_strain
        self._count(solved)
        self._work.excited_lines += excitation.excited
        return solved

    def _count(self, solved: Solved) -> None:
        self._work.factorisations += solved.tally.factorisations
        self._work.solves += solved.tally.solves

    def observe(self, solved: Solved, index: int, start: int) -> None:
        """Response of receivers and cells: û(ω) = h(ω) ü̂_b(ω) (6)."""
        assert self._ground is not None
        excitation, response = solved.excitation, solved.response
        with self.clock.phase("response"):
            base = self._base.motion(response)
            histories, moved = self._at_receivers(response, base)
            cells = self._cell_state(solved, base)
            outcrop = outcrop_motion(self.scene, self.domain, self.equations, response)
            carried = self._carried.copy()
            if self.continuity.goes_on_from_nought:
                at_end = self._base.at(response.unknowns_at(excitation.duration))
                self._carried += moved - at_end
                self._base_before = self._base_carried.copy()
                self._base_carried += at_end
        self.lapses.append(
            LapseResult(
                index=index,
                start_time=start * self.scene.dt,
                num_samples=excitation.num_samples,
                dt=self.scene.dt,
                excited_lines=excitation.excited,
                solved_lines=len(excitation.lines),
                factorisations=solved.tally.factorisations,
                solves=solved.tally.solves,
                worst_residual=float(response.sweep.residuals.max(initial=0.0)),
                loop=solved.loop,
                frequency=excitation.frequency,
                transfer=histories.transfer,
                displacement=histories.displacement + carried[:, :, None],
                velocity=histories.velocity,
                acceleration=histories.acceleration,
                total_acceleration=histories.total_acceleration,
                within=within_motion(response, base),
                outcrop=outcrop,
                cells=cells,
                seam_error=self._seam_error(solved, cells),
                energy=self._energy(solved),
                ledger=self._ledger,
            )
        )
        self._report(index, "lapse", residual=self.lapses[-1].worst_residual)

    def _at_receivers(self, response: Response, base: Spectra) -> tuple[Histories, RealArray]:
        """Their histories, and what the lapse has moved them by at its end."""
        sites, numbers = self.receivers.sites(self.points)
        count = len(self.receivers.names)
        probe = ReceiverProbe(self.domain, self.equations.T, sites, numbers, count)
        try:
            end = response.excitation.duration
            return probe.histories(response, base), probe.at(response.unknowns_at(end))
        finally:
            probe.destroy()

    def _seam_error(self, solved: Solved, cells: CellState) -> float | None:
        """Jumps at the start of the lapse over the peaks in it."""
        jump = self.continuity.jump(self.points, solved.response)
        if jump is None:
            return None
        peaks = float(cells.peak_displacement.max()), float(cells.peak_velocity.max())
        return max(off / peak if peak else 0.0 for off, peak in zip(jump, peaks, strict=True))

    def _energy(self, solved: Solved) -> Energy | None:
        before = self.lapses[-1].energy if self.lapses else None
        stored = None if before is None else before.stored[1]
        return self.continuity.energy(solved.response, solved.material, stored)

    def _cell_state(self, solved: Solved, base: Spectra) -> CellState:
        assert self._ground is not None
        ground, moduli = self._ground, solved.moduli
        carried = self.continuity.carried(solved.material)
        if carried is not None:
            relative = carried.displacement - self._base_carried
            carried = replace(carried, displacement=relative)
        peaks = self._probe.peaks(solved.response, solved.material, base, carried)
        change = solved.loop.last
        effective = solved.effective_strain
        return CellState(
            region=ground.region,
            centroid=self.domain.centroids(),
            shear_modulus=moduli.shear_modulus,
            g_over_gmax=moduli.shear_modulus / ground.shear_modulus,
            damping=moduli.damping,
            effective_strain=peaks.strain if effective is None else effective,
            peak_strain=peaks.strain,
            peak_stress=peaks.stress,
            peak_acceleration=peaks.acceleration,
            peak_velocity=peaks.velocity,
            peak_displacement=peaks.displacement,
            change=np.zeros(len(ground.region)) if change is None else change,
            degradation=ground.degradation,
        )

    def count_cycles(self, solved: Solved) -> None:
        """Cycles of the lapse lower the shear modulus of the next."""
        if self._cycles is None:
            return
        assert self._ground is not None
        with self.clock.phase("response"):
            carried = self.continuity.carried(solved.material)
            self._cycles.count(self._probe, solved.response, carried, self._ground.region)

    def hand_over(self, solved: Solved) -> None:
        """Points take what goes on in the next lapse."""
        with self.clock.phase("convection"):
            if self.scene.output.fields:
                self._start_field = self._displacement_at_start()
            self.continuity.finish(self.points, solved.response, solved.material)
            for column in self.free_fields:
                column.finish()

    def _displacement_at_start(self) -> RealArray | float:
        """What a field of the lapse is added to [m]: of the nodes, relative to the base."""
        if not self.continuity.goes_on_from_nought:
            return 0.0
        S = transfer_matrix(self.points, self.domain.V)
        carried = self.points["dynamic_displacement"] - self._base_before
        momentum = self.equations.collect((S.T @ (self.points.mass[:, None] * carried)).ravel())
        field = self.equations.expand(self.equations.accelerate(momentum))
        momentum.destroy()
        return field

    def convect(self, solved: Solved) -> None:
        """Points take u(t_end) − u(t_start), move, and are found again by (7)-(9)."""
        if not self.scene.effects.convection:
            return
        with self.clock.phase("convection"):
            end = solved.excitation.duration
            report = convect(
                self.domain,
                self.points,
                self._nodal_motion(solved, end) - self._nodal_motion(solved, 0.0),
                self.scene.points.outside,
                solved.material.real,
                self._nodal_motion(solved, end, derivative=1),
                self._nodal_motion(solved, end, derivative=2),
                self._density,
            )
        self._ledger = report.ledger
        self._work.inverse_mappings += report.inverse_mappings
        self.lapses[-1] = replace(self.lapses[-1], ledger=report.ledger)

    def _nodal_motion(self, solved: Solved, time: float, derivative: int = 0) -> RealArray:
        """Displacement of the nodes relative to the base, or a time derivative of it."""
        unknowns = solved.response.unknowns_at(time, derivative)
        return self.equations.expand(unknowns) - self._base.at(unknowns)

    def show(self, solved: Solved, index: int, stop: int, snapshot: SnapshotCallback) -> None:
        """Hand points and fields to whoever writes them."""
        time = stop * self.scene.dt
        with self.clock.phase("output"):
            if self.domain.across.rank > 0:  # the first group has it all
                snapshot(Snapshot(index, time, None))
                return
            snapshot(
                take_snapshot(
                    self.scene,
                    self.domain,
                    self.points,
                    lambda instant: self._start_field + self._nodal_motion(solved, instant),
                    solved.moduli,
                    self.lapses[-1],
                    time,
                )
            )

    def keep(self, checkpoint: CheckpointFolder) -> None:
        """Keep all that the next lapse needs, and what those before have left."""
        with self.clock.phase("output"):
            points = gather_points(self.points, self.domain.mesh)
            self._work.assemblies = dict(self._assemblies)
            state = RunState(
                lapses=tuple(self.lapses),
                work=self._work,
                ledger=self._ledger,
                points=points or {},
                carried=self._carried,
                base_carried=self._base_carried,
                effective_strain=self._effective_strain,
                free_fields=tuple(column.state() for column in self.free_fields),
                cycles=None if self._cycles is None else self._cycles.state,
            )
            parts = {name: getattr(state, name) for name in RunState.__dataclass_fields__}
            checkpoint.save(len(self.lapses) - 1, self.domain.comm.size, parts)

    def restore(self, found: Checkpoint) -> None:
        """Go on from a checkpoint."""
        kinds = get_type_hints(RunState)
        state = RunState(**{name: found.load(name, kind) for name, kind in kinds.items()})
        self.lapses = list(state.lapses)
        self.points = scatter_points(state.points, self.domain.mesh)
        self._ledger = state.ledger
        self._carried, self._base_carried = state.carried, state.base_carried
        self._effective_strain = state.effective_strain
        for column, column_state in zip(self.free_fields, state.free_fields, strict=True):
            column.restore(column_state)
        if self._cycles is not None and state.cycles is not None:
            self._cycles.state = state.cycles
        self.weigh()
        # Matrices that are there again were counted when they were first made.
        self._assemblies.clear()
        self._assemblies.update(state.work.assemblies)
        for phase, seconds in state.work.wall_s.items():
            self.clock.wall_s[phase] += seconds
        self._work = replace(state.work, wall_s=self.clock.wall_s)

    def _observer(self, index: int, side: str = "") -> Observer:
        return Observer(
            lambda iteration, done, total: self._report(
                index, "sweep", iteration=iteration, done=done, total=total, side=side
            ),
            lambda iteration, change: self._report(
                index, "iteration", iteration=iteration, change=change, side=side
            ),
            self.clock.phase,
        )

    def _report(self, index: int, phase: str, **values: float | str) -> None:
        if self._progress is None:
            return
        report = Progress(index, len(self.scene.segments), phase, **values)  # type: ignore[arg-type]
        try:
            self._progress(report)
        except Exception:  # rank 0 alone must not leave a run that others wait in
            logger.warning("the progress callback failed and is not called again", exc_info=True)
            self._progress = None

    def result(self) -> Result:
        """Everything so far."""
        self._work.assemblies = dict(self._assemblies)
        return Result(
            scene=self.scene,
            num_ranks=self.comm.size,
            group_size=self.domain.comm.size,
            components=self.domain.components,
            directions=tuple(m.direction for m in self.scene.motion),
            receivers=self.receivers.names,
            places=self.receivers.places,
            region_names=self.domain.region_names,
            dt=self.scene.dt,
            base_acceleration=self.scene.base_acceleration,
            lapses=tuple(self.lapses),
            sizes={
                "cells": self.domain.num_cells,
                "unknowns": self.equations.num_unknowns,
                "points": self._ledger.num_points,
            },
            work=self._work,
            peak_memory=self.comm.allreduce(peak_memory(), MPI.MAX),
        )
