# SPDX-License-Identifier: MIT
"""The outer loop, as in the paper's flow chart: lapse by lapse, the points moving in between."""

from __future__ import annotations

import logging
from collections import Counter
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fenics_hytf.frequency import SweepError
from fenics_hytf.lapse import (
    BaseProbe,
    CellProbe,
    CellState,
    Equations,
    FreeField,
    Ground,
    LapseError,
    LapseResult,
    Observer,
    ReceiverProbe,
    Solved,
    cell_stress,
    convect,
    excite,
    first_strain,
    outcrop_motion,
    seed_points,
    solve,
    survey,
    within_motion,
)
from fenics_hytf.particles import PointsNotFinite, PointsOutside
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.check import checked_domain
from fenics_hytf.simulation.clock import Clock
from fenics_hytf.simulation.errors import SimulationError
from fenics_hytf.simulation.groups import Groups, form_groups, require_same_parts
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
from fenics_hytf.soil import complex_factor

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

logger = logging.getLogger(__name__)


def simulate(
    scene: Scene,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: ProgressCallback | None = None,
    snapshot: SnapshotCallback | None = None,
    strain_from: npt.NDArray[np.intp] | None = None,
    group_size: int | None = None,
) -> Result:
    """Run a scene: what ``hytf run`` does, without files (collective).

    Args:
        scene: The scene.
        comm: Communicator; its ranks share out the lines, and the mesh where memory asks for it.
        progress: Called on rank 0 while the simulation runs.
        snapshot: Called on every rank after every ``output.every``-th lapse, with points and
            fields on rank 0.
        strain_from: For every cell of the input the cell whose strain rules its moduli in the
            equivalent-linear loop, shape ``(num_cells,)``; each cell's own if ``None``.
        group_size: Ranks that share a mesh, a divisor of their number; from memory if ``None``.

    Returns:
        The result, the same on every rank.

    Raises:
        SceneError: A fault that only the mesh shows.
        ValueError: The group size does not divide the number of ranks.
        SimulationError: The numerics stopped; it holds the lapses that were solved.
    """
    groups = form_groups(scene, comm, group_size)
    run = _Run(scene, comm, groups, progress, strain_from)
    index = 0
    try:
        run.set_up()
        for segment in scene.segments:
            index = segment.index
            run.weigh()
            solved = run.solve_lapse(index, scene.base_acceleration[:, segment.samples])
            run.observe(solved, index, segment.start)
            run.convect(solved)
            if snapshot is not None and (index + 1) % scene.output.every == 0:
                run.show(solved, index, segment.stop, snapshot)
        result = run.result()
    except (SweepError, LapseError, PointsOutside, PointsNotFinite) as error:
        partial = run.result() if run.lapses else None
        raise SimulationError(index, str(error), partial) from error
    finally:
        run.destroy()
    groups.free()
    return result


class _Run:
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
        self._owned: list[Equations | CellProbe | BaseProbe | FreeField] = []

    def set_up(self) -> None:
        """Mesh, points, receivers, and the operators that last for the whole run."""
        scene = self.scene
        with self.clock.phase("setup"):
            domain = checked_domain(scene, self._groups.within)
            self.domain = replace(domain, across=self._groups.across)
            require_same_parts(self.domain)
            self.points = seed_points(scene, self.domain)
            self.receivers = Receivers(self.domain, self.points, scene.output.receivers)
            self.free_fields = self._level_ground()
            self.equations = Equations(scene, self.domain, self._assemblies, self.free_fields)
            self._owned.append(self.equations)
            loop = scene.effects.equivalent_linear
            self._probe = CellProbe(
                self.domain, self.equations.T, loop.strain if loop is not None else "plane"
            )
            self._base = BaseProbe(self.domain, self.equations)
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

    def solve_lapse(self, index: int, acceleration: RealArray) -> Solved:
        """Transfer functions (5) of the lapse, with moduli that fit its strain."""
        assert self._ground is not None
        excitation = excite(self.scene, acceleration, self.equations.axes)
        observer = self._observer(index)
        for column in self.free_fields:
            self._count(column.solve(excitation, self._observer(index, column.name)))
        start = self._effective_strain  # of the lapse before
        solved = solve(
            self.scene,
            self.equations,
            self._ground,
            excitation,
            self._probe,
            first_strain(self.scene, self._ground) if start is None else start,
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
        excitation = solved.excitation
        with self.clock.phase("response"):
            base = self._base_motion = self._base.mean(solved.sweep, excitation)
            sites, numbers = self.receivers.sites(self.points)
            probe = ReceiverProbe(
                self.domain, self.equations.T, sites, numbers, len(self.receivers.names)
            )
            try:
                histories = probe.histories(solved.sweep, excitation, base)
            finally:
                probe.destroy()
            cells = self._cell_state(solved, base)
            outcrop = outcrop_motion(
                self.scene, self.domain, self.equations, solved.sweep, excitation
            )
            carried = self.receivers.carried(self.points)
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
                worst_residual=float(solved.sweep.residuals.max(initial=0.0)),
                loop=solved.loop,
                frequency=excitation.frequency,
                transfer=histories.transfer,
                displacement=histories.displacement + carried[:, :, None],
                velocity=histories.velocity,
                acceleration=histories.acceleration,
                total_acceleration=histories.total_acceleration,
                within=within_motion(excitation, base),
                outcrop=outcrop,
                cells=cells,
                ledger=self._ledger,
            )
        )
        self._report(index, "lapse", residual=self.lapses[-1].worst_residual)

    def _cell_state(self, solved: Solved, base: ComplexArray) -> CellState:
        assert self._ground is not None
        ground, moduli = self._ground, solved.moduli
        factor = complex_factor(moduli.damping, self.scene.solver.complex_modulus)
        complex_modulus = moduli.shear_modulus * factor
        peaks = self._probe.peaks(solved.sweep, solved.excitation, complex_modulus, base)
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
        )

    def convect(self, solved: Solved) -> None:
        """Points take u(t_end) − u(t_start), move, and are found again by (7)-(9)."""
        if not self.scene.effects.convection:
            return
        with self.clock.phase("convection"):
            end = solved.excitation.num_samples * solved.excitation.dt
            report = convect(
                self.domain,
                self.points,
                self._nodal_motion(solved, end) - self._nodal_motion(solved, 0.0),
                self.scene.points.outside,
                solved.constants,
                self._nodal_motion(solved, end, derivative=1),
                self._nodal_motion(solved, end, derivative=2),
            )
        self._ledger = report.ledger
        self._work.inverse_mappings += report.inverse_mappings
        self.lapses[-1] = replace(self.lapses[-1], ledger=report.ledger)

    def _nodal_motion(self, solved: Solved, time: float, derivative: int = 0) -> RealArray:
        """Displacement of the nodes relative to the base, or a time derivative of it."""
        excitation = solved.excitation
        weights = excitation.weights_at(time) * excitation.s**derivative
        base = np.einsum("cmk,mk->c", self._base_motion, weights).real
        return self.equations.expand(solved.sweep.combine(weights)) - base

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
                    lambda time: self._nodal_motion(solved, time),
                    solved.moduli,
                    self.lapses[-1],
                    time,
                )
            )

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
