# SPDX-License-Identifier: MIT
"""What is seen of a lapse, receivers, base and the middle of every cell, and the record of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fenics_hytf.domain import Domain
from fenics_hytf.lapse import (
    BaseProbe,
    CellProbe,
    CellState,
    Continuity,
    Energy,
    Equations,
    Ground,
    Histories,
    LapseResult,
    ReceiverProbe,
    Slipped,
    SlipResult,
    Solved,
    Spectra,
    outcrop_motion,
    within_motion,
)
from fenics_hytf.particles import MassLedger, Points
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.receivers import Receivers

RealArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Seen:
    """What is seen of a lapse.

    Attributes:
        histories: Of the receivers, their displacement since the start of the record.
        within: Acceleration of the base in the direction of each motion [m/s^2].
        outcrop: Of the bare rock likewise, or ``None``.
        cells: State of the cells.
        slip: What slipped, or ``None``.
    """

    histories: Histories
    within: RealArray
    outcrop: RealArray | None
    cells: CellState
    slip: SlipResult | None


def lapse_result(
    seen: Seen,
    solved: Solved,
    *,
    index: int,
    start_time: float,
    jump: tuple[float, float] | None,
    energy: Energy | None,
    ledger: MassLedger,
) -> LapseResult:
    """What a lapse leaves behind.

    Args:
        seen: What was seen of it.
        solved: Its solution.
        index: Its number, from 0.
        start_time: Time of its first sample [s].
        jump: Of displacement [m] and velocity [m/s] at its start, ``None`` if nothing is carried.
        energy: Its ledger of energy, or ``None``.
        ledger: Points and their mass.

    Returns:
        The record.
    """
    excitation, histories, cells = solved.excitation, seen.histories, seen.cells
    seam_error = None
    if jump is not None:
        peaks = float(cells.peak_displacement.max()), float(cells.peak_velocity.max())
        seam_error = max(off / peak if peak else 0.0 for off, peak in zip(jump, peaks, strict=True))
    return LapseResult(
        index=index,
        start_time=start_time,
        num_samples=excitation.num_samples,
        dt=excitation.dt,
        excited_lines=excitation.excited,
        solved_lines=len(excitation.lines),
        factorisations=solved.tally.factorisations,
        solves=solved.tally.solves,
        worst_residual=float(solved.response.sweep.residuals.max(initial=0.0)),
        loop=solved.loop,
        frequency=excitation.frequency,
        transfer=histories.transfer,
        displacement=histories.displacement,
        velocity=histories.velocity,
        acceleration=histories.acceleration,
        total_acceleration=histories.total_acceleration,
        within=seen.within,
        outcrop=seen.outcrop,
        cells=cells,
        seam_error=seam_error,
        slip=seen.slip,
        energy=energy,
        ledger=ledger,
    )


class Observation:
    """Looks at lapses, and keeps what receivers and base have moved by in those before.

    Args:
        scene: The scene.
        domain: The domain.
        equations: Its equations.
        continuity: How lapses hang together.
        points: The points, which receivers may ride.

    Attributes:
        receivers: The receivers.
        probe: Evaluates the response in the cells.
        carried: Displacement of the receivers relative to the base at the start of a lapse [m],
            shape ``(num_receivers, num_components)``.
        base_carried: That of the base [m], shape ``(num_components,)``.
        base_before: That at the start of the lapse last seen.
    """

    def __init__(
        self,
        scene: Scene,
        domain: Domain,
        equations: Equations,
        continuity: Continuity,
        points: Points,
    ) -> None:
        self._scene, self._domain = scene, domain
        self._equations, self._continuity = equations, continuity
        self.receivers = Receivers(domain, points, scene.output.receivers)
        components = domain.num_components
        self.carried: RealArray = np.zeros((len(self.receivers.names), components))
        self.base_carried: RealArray = np.zeros(components)
        self.base_before: RealArray = self.base_carried
        self.probe: CellProbe
        self._base: BaseProbe | None = None

    def look_at(self, filled: npt.NDArray[np.bool_] | None) -> None:
        """Make what evaluates the unknowns, once they are known or have become others.

        Args:
            filled: Cells with soil in the order of the input, all if ``None``.
        """
        self.destroy()
        loop = self._scene.effects.equivalent_linear
        convention = loop.strain if loop is not None else "plane"
        self.probe = CellProbe(self._domain, self._equations.T, convention, filled)
        self._base = BaseProbe(self._domain, self._equations)

    def destroy(self) -> None:
        """Destroy all PETSc objects."""
        if self._base is not None:
            self._base.destroy()
            self.probe.destroy()

    def base_at(self, unknowns: RealArray) -> RealArray:
        """Mean displacement of the base; see :meth:`~fenics_hytf.lapse.BaseProbe.at`."""
        assert self._base is not None
        return self._base.at(unknowns)

    def see(self, solved: Solved, ground: Ground, points: Points) -> Seen:
        """Look at a lapse, and go on from its end (collective).

        Args:
            solved: The lapse.
            ground: The ground in it.
            points: The points at its start.

        Returns:
            What is seen.
        """
        assert self._base is not None
        excitation, response = solved.excitation, solved.response
        base = self._base.motion(response)
        histories, moved = self._at_receivers(solved, base, points)
        cells = self._cell_state(solved, ground, base)
        outcrop = outcrop_motion(self._scene, self._domain, self._equations, response)
        displacement = histories.displacement + self.carried[:, :, None]
        if self._continuity.goes_on_from_nought:
            at_end = self._base.at(response.unknowns_at(excitation.duration))
            self.carried = self.carried + moved - at_end
            self.base_before = self.base_carried
            self.base_carried = self.base_carried + at_end
        return Seen(
            replace(histories, displacement=displacement),
            within_motion(response, base),
            outcrop,
            cells,
            None if solved.slip is None else self._slip_result(solved.slip),
        )

    def _at_receivers(
        self, solved: Solved, base: Spectra, points: Points
    ) -> tuple[Histories, RealArray]:
        """Their histories, and what the lapse has moved them by at its end."""
        response, slip = solved.response, solved.slip
        sites, numbers = self.receivers.sites(points)
        count = len(self.receivers.names)
        probe = ReceiverProbe(self._domain, self._equations.T, sites, numbers, count)
        try:
            end = response.excitation.duration
            moved = response.unknowns_at(end)
            if slip is not None:
                moved = moved + slip.total * slip.unknowns
            return probe.histories(response, base, slip), probe.at(moved)
        finally:
            probe.destroy()

    def _cell_state(self, solved: Solved, ground: Ground, base: Spectra) -> CellState:
        moduli = solved.moduli
        carried = self._continuity.carried(solved.material)
        if carried is not None:
            relative = carried.displacement - self.base_carried
            carried = replace(carried, displacement=relative)
        peaks = self.probe.peaks(solved.response, solved.material, base, carried, solved.slip)
        change = solved.loop.last
        effective = solved.effective_strain
        return CellState(
            region=ground.region,
            centroid=self._domain.centroids(),
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
            fill=None if ground.filling is None else ground.filling.fill,
        )

    def _slip_result(self, slip: Slipped) -> SlipResult:
        mechanism = slip.mechanism
        return SlipResult(
            yield_coefficient=mechanism.yield_coefficient,
            factor_of_safety=slip.before.factor_of_safety,
            direction=self._domain.components[slip.before.axis],
            sense=slip.before.sense,
            time_step=slip.time_step,
            slip=slip.history.slip,
            rate=slip.history.rate,
            driving=slip.driving,
            rigid=slip.rigid,
            decoupled=slip.decoupled,
            mass=slip.mass,
            modal_mass=slip.modal_mass,
            dissipation=mechanism.dissipation,
            shear_strain=self.probe.shear_strain(slip.unknowns),
            iterations=mechanism.iterations,
        )
