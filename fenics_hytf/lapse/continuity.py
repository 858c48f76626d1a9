# SPDX-License-Identifier: MIT
"""How lapses hang together: what a lapse is given, how it is solved, what it leaves on the points.

Three ways meet one protocol:

- ``steady``, the paper's: each lapse is its own periodic steady state, nothing is carried over;
- a hand-over of displacement, velocity, stress and memory under a causal law
  (:mod:`fenics_hytf.lapse.handover`);
- the response to the whole record and a free vibration about it, where hysteretic damping, which
  cannot be stopped and started again, is insisted on (:mod:`fenics_hytf.lapse.whole_record`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import Loads, Sweep
from fenics_hytf.lapse.cells import CarriedCells
from fenics_hytf.lapse.energy import Energy
from fenics_hytf.lapse.equations import Equations, LapseEquations
from fenics_hytf.lapse.excitation import Excitation
from fenics_hytf.lapse.material import Material
from fenics_hytf.lapse.response import Response
from fenics_hytf.lapse.slipped import Slipped
from fenics_hytf.lapse.starts import largest
from fenics_hytf.motion import Segment, excited_lines, to_frequency
from fenics_hytf.particles import Points, transfer_matrix
from fenics_hytf.scene import Scene

RealArray = npt.NDArray[np.float64]

# Solves the equations at hand for right-hand sides.
Solve = Callable[[Sequence[PETSc.Vec] | Loads], Sweep]


class Continuity(Protocol):
    """What hands over from lapse to lapse.

    Attributes:
        goes_on_from_nought: Whether the response is the increment of the lapse, to be added to the
            displacement at its start.
    """

    goes_on_from_nought: bool

    @property
    def fields(self) -> Mapping[str, tuple[int, ...]]:
        """Arrays that the points carry, and the shape of one point's entry."""

    def excite(self, segment: Segment) -> Excitation:
        """The input of a lapse."""

    def begin(self, points: Points, excitation: Excitation) -> None:
        """Take from the points what they have carried into a lapse (collective)."""

    def respond(self, solve: Solve, equations: LapseEquations, material: Material) -> Response:
        """Solve the lapse with some moduli (collective).

        Args:
            solve: Sweeps the equations over the lines of the lapse.
            equations: The equations.
            material: The law they were assembled with.

        Returns:
            The response.
        """

    def carried(self, material: Material) -> CarriedCells | None:
        """What the cells bring into the lapse, or ``None`` where that is nothing."""

    def jump(self, points: Points, response: Response) -> tuple[float, float] | None:
        """How far the response is off what the points have carried (collective).

        Returns:
            Largest difference of displacement [m] and of velocity [m/s] at the start of the lapse,
            over all points; ``None`` where nothing is carried.
        """

    def energy(
        self,
        response: Response,
        material: Material,
        stored_before: float | None,
        slip: Slipped | None = None,
    ) -> Energy | None:
        """The energy ledger of the lapse (collective).

        Args:
            response: The response, with the equations it was last solved with still at hand.
            material: The law of every cell.
            stored_before: Energy stored at the end of the lapse before [J], ``None`` at the start.
            slip: What slips besides.

        Returns:
            The ledger; ``None`` where the law or the lapse has no energy of its own.
        """

    def finish(self, points: Points, response: Response, material: Material) -> None:
        """Leave on the points what the lapse ends with, before they move (collective)."""

    def destroy(self) -> None:
        """Destroy all PETSc objects."""


def jump_at_start(
    domain: Domain,
    equations: Equations,
    points: Points,
    response: Response,
    displacement: RealArray | float,
) -> tuple[float, float]:
    """How far a response is off what points carry as the lapse starts (collective).

    Args:
        domain: The domain.
        equations: Its equations.
        points: The points, with the velocity that they carry.
        response: The response.
        displacement: What it goes on from at each point [m], shape
            ``(len(points), num_components)``.

    Returns:
        Largest difference of displacement [m] and of velocity [m/s] over all points.
    """
    S = transfer_matrix(points, domain.V)
    u, v = (S @ equations.unknowns.expand(response.unknowns_at(0.0, order)) for order in (0, 1))
    jumps = u - displacement, v - points["dynamic_velocity"]
    return largest(domain.comm, jumps[0]), largest(domain.comm, jumps[1])


class Steady:
    """Each lapse its own periodic steady state.

    Args:
        scene: The scene.
        axes: Component in which each motion acts.
    """

    fields: Mapping[str, tuple[int, ...]] = {}
    goes_on_from_nought = False

    def __init__(self, scene: Scene, axes: tuple[int, ...]) -> None:
        self._scene, self._axes = scene, axes
        self._excitation: Excitation

    def excite(self, segment: Segment) -> Excitation:
        """The lines of the lapse that carry energy."""
        return excite(self._scene, self._scene.base_acceleration[:, segment.samples], self._axes)

    def begin(self, points: Points, excitation: Excitation) -> None:
        """Nothing is carried."""
        self._excitation = excitation

    def respond(self, solve: Solve, equations: LapseEquations, material: Material) -> Response:
        """The response to the motions."""
        return Response(solve(equations.loads), self._excitation)

    def carried(self, material: Material) -> None:
        """Nothing."""
        return None

    def jump(self, points: Points, response: Response) -> None:
        """Lapses do not meet."""
        return None

    def energy(
        self,
        response: Response,
        material: Material,
        stored_before: float | None,
        slip: Slipped | None = None,
    ) -> None:
        """Over a period nothing is stored, and what comes in is lost."""
        return None

    def finish(self, points: Points, response: Response, material: Material) -> None:
        """Nothing is left."""

    def destroy(self) -> None:
        """There are none."""


def excite(scene: Scene, acceleration: RealArray, axes: tuple[int, ...]) -> Excitation:
    """Find the lines of a periodic lapse that carry energy.

    Args:
        scene: The scene: thresholds and time step.
        acceleration: Base acceleration in the lapse [m/s^2], shape ``(num_motions, num_samples)``.
        axes: Component in which each motion acts.

    Returns:
        The input at those lines.
    """
    spectra = to_frequency(acceleration)
    num_samples = acceleration.shape[1]
    limits = (scene.solver.excited, scene.solver.max_frequency)
    lines = excited_lines(spectra, scene.dt, num_samples, *limits)
    everywhere = excited_lines(spectra, scene.dt, num_samples, scene.solver.excited)
    return Excitation(lines, spectra[:, lines], axes, num_samples, scene.dt, len(everywhere))
