# SPDX-License-Identifier: MIT
"""A run: what lives from lapse to lapse, and the steps of the outer loop one by one.

They stand here in the order in which :func:`~fenics_hytf.simulation.flow.simulate` takes them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fenics_hytf.lapse import (
    CycleCount,
    Equations,
    FreeField,
    Ground,
    Handover,
    LapseResult,
    Sliding,
    Softening,
    Solved,
    Statics,
    cell_stress,
    choose_continuity,
    convect,
    first_strain,
    seed_points,
    solve,
)
from fenics_hytf.motion import Segment
from fenics_hytf.particles import gather_points, scatter_points
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.check import checked_domain
from fenics_hytf.simulation.checkpoint import Checkpoint
from fenics_hytf.simulation.checkpoint_folder import CheckpointFolder
from fenics_hytf.simulation.clock import Clock
from fenics_hytf.simulation.groups import Groups, require_same_parts
from fenics_hytf.simulation.memory import peak_memory
from fenics_hytf.simulation.observation import Observation, lapse_result
from fenics_hytf.simulation.owner import Owner
from fenics_hytf.simulation.records import (
    ProgressCallback,
    Result,
    Snapshot,
    SnapshotCallback,
    Work,
)
from fenics_hytf.simulation.reporter import Reporter
from fenics_hytf.simulation.resolution import too_coarse
from fenics_hytf.simulation.schedule import lapses_to_go, motion_of, samples
from fenics_hytf.simulation.snapshots import take_snapshot
from fenics_hytf.simulation.state import RunState
from fenics_hytf.simulation.weighing import Weighing

RealArray = npt.NDArray[np.float64]


class Run:
    """State that lives from lapse to lapse: mesh, points, equations, the warm start.

    Args:
        scene: The scene.
        comm: Communicator of all ranks.
        groups: Groups of ranks that share a mesh.
        progress: Called on rank 0 while the run goes on, or ``None``.
        strain_from: See :func:`~fenics_hytf.simulation.flow.simulate`.

    Attributes:
        lapses: Those that were solved.
        points: The points where they are now.
    """

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
        listener = progress if comm.rank == 0 else None
        self._report = Reporter(listener, len(scene.segments), self.clock)
        self._strain_from = strain_from
        self._ground: Ground | None = None
        self._effective_strain: RealArray | None = None
        self._sliding: Sliding | None = None
        self._softening: Softening | None = None
        self._own = Owner()

    def set_up(self) -> None:
        """Mesh, points, receivers, and the operators that last for the whole run."""
        scene = self.scene
        with self.clock.phase("setup"):
            domain = checked_domain(scene, self._groups.within)
            self.domain = replace(domain, across=self._groups.across)
            require_same_parts(self.domain)
            self.free_fields = [  # a column beyond each side that has one
                self._own(FreeField(scene, self.domain, name, self._assemblies))
                for name, kind in scene.boundary.kinds.items()
                if kind == "free_field"
            ]
            equations = self.equations = self._own(
                Equations(scene, self.domain, self._assemblies, self.free_fields)
            )
            weighs = scene.effects.gravity is not None
            statics = self.statics = self._own(Statics(scene, self.domain)) if weighs else None
            continuity = self.continuity = self._own(
                choose_continuity(scene, self.domain, equations, statics)
            )
            if scene.effects.sliding is not None:
                assert isinstance(continuity, Handover) and statics is not None
                self._sliding = self._own(
                    Sliding(scene, self.domain, equations, continuity, statics)
                )
            if scene.effects.softening:
                assert statics is not None
                self._softening = Softening(self.domain, statics)
            self.points = seed_points(scene, self.domain, continuity.fields)
            self.observation = self._own(
                Observation(scene, self.domain, equations, continuity, self.points)
            )
            self._weighing = Weighing(scene, self.domain, equations, self.observation, statics)
            cycles = scene.effects.degradation
            self._cycles = None if cycles is None else CycleCount(cycles, self.domain)
            self._density = np.array([scene.soil[name].density for name in domain.region_names])
        self._ledger = self.points.ledger(self.domain.comm)

    def restore(self, found: Checkpoint) -> None:
        """Go on from a checkpoint."""
        state = RunState.load(found)
        self.lapses = list(state.lapses)
        self.points = scatter_points(state.points, self.domain.mesh)
        self._ledger = state.ledger
        self.observation.carried = state.carried
        self.observation.base_carried = state.base_carried
        self._effective_strain = state.effective_strain
        for column, column_state in zip(self.free_fields, state.free_fields, strict=True):
            column.restore(column_state)
        if self._cycles is not None and state.cycles is not None:
            self._cycles.state = state.cycles
        if self._sliding is not None:
            self._sliding.state = state.sliding
        self.weigh()
        # Matrices that are there again were counted when they were first made.
        self._assemblies.clear()
        self._assemblies.update(state.work.assemblies)
        for phase, seconds in state.work.wall_s.items():
            self.clock.wall_s[phase] = self.clock.wall_s.get(phase, 0.0) + seconds
        self._work = replace(state.work, wall_s=self.clock.wall_s)

    def segments(self) -> Iterator[Segment]:
        """The lapses that are left; see :func:`~fenics_hytf.simulation.schedule.lapses_to_go`."""
        sliding = self._sliding
        moving = None if sliding is None else lambda: sliding.moving
        return lapses_to_go(self.scene, self.lapses, moving)

    def weigh(self) -> None:
        """M = SᵀM_pS (4), K_NL and the soil of each cell, from the points where they are now."""
        if self._ground is not None and not self.scene.effects.convection:
            return
        with self.clock.phase("assembly"):
            before = self.lapses[-1].slip if self.lapses else None
            at_first = self._ground is None and not self.lapses
            slid = before is not None and before.slid
            self._ground = self._weighing(self.points, at_first, slid)
            if self.scene.mesh.empty:  # what came off is out
                ledger = self.points.ledger(self.domain.comm)
                self._ledger = replace(ledger, migrated=self._ledger.migrated)

    def solve_lapse(self, segment: Segment) -> Solved:
        """Transfer functions (5) of the lapse, with moduli that fit its strain."""
        assert self._ground is not None
        index, ground = segment.index, self._ground
        if self._cycles is not None:
            ground = self._ground = replace(ground, degradation=self._cycles.state.index)
        if self._sliding is not None:
            with self.clock.phase("mechanism"):
                before = self._sliding.factorisations
                self._sliding.begin(self.points, ground.filling)
                self._work.factorisations += self._sliding.factorisations - before
        with self.clock.phase("assembly"):
            excitation = self.continuity.excite(segment)
            self.continuity.begin(self.points, excitation)
        for column in self.free_fields:
            self._count(column.solve(segment, self._report.observer(index, column.name)))
        start = self._effective_strain  # of the lapse before
        solved = solve(
            self.scene,
            self.equations,
            ground,
            excitation,
            self.continuity,
            self.observation.probe,
            start=first_strain(self.scene, ground) if start is None else start,
            observer=self._report.observer(index),
            strain_from=self._strain_from,
            sliding=self._sliding,
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
        with self.clock.phase("response"):
            seen = self.observation.see(solved, self._ground, self.points)
            jump = self.continuity.jump(self.points, solved.response)
            before = self.lapses[-1].energy if self.lapses else None
            stored = None if before is None else before.stored[1]
            energy = self.continuity.energy(solved.response, solved.material, stored, solved.slip)
        self.lapses.append(
            lapse_result(
                seen,
                solved,
                index=index,
                start_time=start * self.scene.dt,
                jump=jump,
                energy=energy,
                ledger=self._ledger,
            )
        )
        self._report(index, "lapse", residual=self.lapses[-1].worst_residual)

    def count_cycles(self, solved: Solved) -> None:
        """Cycles of the lapse lower the shear modulus of the next."""
        if self._cycles is None:
            return
        assert self._ground is not None
        with self.clock.phase("response"):
            carried = self.continuity.carried(solved.material)
            self._cycles.count(
                self.observation.probe, solved.response, carried, self._ground.region
            )

    def hand_over(self, solved: Solved) -> RealArray | float:
        """Points take what goes on in the next lapse.

        Returns:
            What fields of this one are added to [m].
        """
        with self.clock.phase("convection"):
            start = self._displacement_at_start()
            self.continuity.finish(self.points, solved.response, solved.material)
            for column in self.free_fields:
                column.finish()
        return start

    def _displacement_at_start(self) -> RealArray | float:
        """Of the nodes, relative to the base [m]; 0 where no field takes it in."""
        if not (self.scene.output.fields and self.continuity.goes_on_from_nought):
            return 0.0
        carried = self.points["dynamic_displacement"] - self.observation.base_before
        return self.equations.field_of(self.points, carried)

    def soften(self, solved: Solved) -> RealArray | float:
        """Static stress falls where G is lower than ever before.

        Returns:
            By what the ground gives way [m].
        """
        if self._softening is None:
            return 0.0
        assert self._ground is not None
        with self.clock.phase("convection"):
            increment = self._softening(self.points, self._ground, solved.moduli)
            before = self.lapses[-2].softening if len(self.lapses) > 1 else None
            shape = len(self.scene.output.receivers), self.domain.num_components
            moved: RealArray = np.zeros(shape) if before is None else before.displacement
            if increment is not None:
                self._work.factorisations += 1
                moved = moved + self.observation.receivers.at(self.points, increment)
                if self.scene.effects.geometric_stiffness and not self.scene.effects.convection:
                    self.equations.stiffen(cell_stress(self.domain, self.points))
            softening = self._softening.result(self.points, moved)
        self.lapses[-1] = replace(self.lapses[-1], softening=softening)
        return 0.0 if increment is None else increment

    def convect(self, solved: Solved, given_way: RealArray | float) -> None:
        """Points take u(t_end) − u(t_start), move, and are found again by (7)-(9)."""
        if not self.scene.effects.convection:
            return
        with self.clock.phase("convection"):
            end, slip = solved.excitation.duration, solved.slip
            u, v, a = (self._nodal_motion(solved, end, derivative) for derivative in range(3))
            report = convect(
                self.domain,
                self.points,
                u - self._nodal_motion(solved, 0.0) + given_way,
                outside=self.scene.points.outside,
                # Softening has strained the static stress itself, and vibration does not.
                constants=solved.material.real if self._softening is None else None,
                velocity=v if slip is None else v + slip.at_end(1),
                acceleration=a if slip is None else a + slip.at_end(2),
                density=self._density,
                slip=None if slip is None else slip.at_end(),
            )
        self._ledger = report.ledger
        self._work.inverse_mappings += report.inverse_mappings
        self.lapses[-1] = replace(self.lapses[-1], ledger=report.ledger)

    def _nodal_motion(self, solved: Solved, time: float, derivative: int = 0) -> RealArray:
        """Displacement of the nodes relative to the base, or a time derivative of it."""
        unknowns = solved.response.unknowns_at(time, derivative)
        return self.equations.unknowns.expand(unknowns) - self.observation.base_at(unknowns)

    def show(
        self, solved: Solved, index: int, start: RealArray | float, snapshot: SnapshotCallback
    ) -> None:
        """Hand points and fields to whoever writes them."""
        time = samples(self.lapses) * self.scene.dt
        with self.clock.phase("output"):
            if self.domain.across.rank > 0:  # the first group has it all
                snapshot(Snapshot(index, time, None))
                return
            snapshot(
                take_snapshot(
                    self.scene,
                    self.domain,
                    self.points,
                    lambda instant: start + self._nodal_motion(solved, instant),
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
                carried=self.observation.carried,
                base_carried=self.observation.base_carried,
                effective_strain=self._effective_strain,
                free_fields=tuple(column.state() for column in self.free_fields),
                cycles=None if self._cycles is None else self._cycles.state,
                sliding=None if self._sliding is None else self._sliding.state,
            )
            checkpoint.save(len(self.lapses) - 1, self.domain.comm.size, state.parts())

    def result(self) -> Result:
        """Everything so far."""
        self._work.assemblies = dict(self._assemblies)
        return Result(
            scene=self.scene,
            num_ranks=self.comm.size,
            group_size=self.domain.comm.size,
            components=self.domain.components,
            directions=self.scene.directions,
            receivers=self.observation.receivers.names,
            places=self.observation.receivers.places,
            region_names=self.domain.region_names,
            dt=self.scene.dt,
            base_acceleration=motion_of(self.scene, self.lapses),
            lapses=tuple(self.lapses),
            sizes={
                "cells": self.domain.num_cells,
                "unknowns": self.equations.num_unknowns,
                "points": self._ledger.num_points,
            },
            work=self._work,
            peak_memory=self.comm.allreduce(peak_memory(), MPI.MAX),
            coarse=too_coarse(
                self.scene,
                self.domain,
                ((lapse.cells.region, lapse.cells.shear_modulus) for lapse in self.lapses),
            ),
        )

    def destroy(self) -> None:
        """Destroy all PETSc objects."""
        self._own.destroy()
