# SPDX-License-Identifier: MIT
"""Permanent displacement over lapses: which mechanism yields, and how one gives way to the next.

At the start of a lapse the mechanism φ that yields first is sought, with its k_y (:mod:`.slope`).
In the lapse it slips (:mod:`.slip`). Points carry φ, which moves with them; as one mechanism gives
way to the next, what it has of the new one's motion goes on as slip, and the rest as vibration:

    λ̇ ← (φᵀMφ_old) λ̇/(φᵀMφ)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from fenics_hytf.domain import Domain
from fenics_hytf.lapse.continuity import Solve
from fenics_hytf.lapse.equations import Equations, LapseEquations
from fenics_hytf.lapse.filling import Filling
from fenics_hytf.lapse.handover import Handover
from fenics_hytf.lapse.mechanism import Mechanism
from fenics_hytf.lapse.response import Response
from fenics_hytf.lapse.slip import Kernel, LapseSlip
from fenics_hytf.lapse.slipped import Slipped, SlipState
from fenics_hytf.lapse.slope import Slope
from fenics_hytf.lapse.starts import product
from fenics_hytf.lapse.statics import Statics
from fenics_hytf.particles import Points, transfer_matrix
from fenics_hytf.scene import Scene

RealArray = npt.NDArray[np.float64]

# Of k_y, by which a mechanism has to yield sooner than another one to be taken before it.
_SOONER = 1e-3


class Sliding:
    """Finds mechanisms and lets them slip.

    Args:
        scene: The scene; it calls for sliding and gravity.
        domain: The domain.
        equations: Its equations.
        handover: Hands vibration from lapse to lapse.
        statics: Static stress and weight.

    Attributes:
        state: What goes on with the next lapse; ``None`` before the first.
    """

    def __init__(
        self,
        scene: Scene,
        domain: Domain,
        equations: Equations,
        handover: Handover,
        statics: Statics,
    ) -> None:
        assert scene.effects.sliding is not None and scene.effects.gravity is not None
        self._domain, self._equations = domain, equations
        self._handover, self._slope = handover, Slope(scene, domain, statics)
        self._settings, self._g = scene.effects.sliding, scene.effects.gravity.acceleration
        moves = scene.effects.convection
        self._most_slip = self._settings.new_mechanism * domain.shortest_edge() if moves else None
        self.state: SlipState | None = None
        self._mechanism: Mechanism
        self._unknowns: RealArray

    def destroy(self) -> None:
        """Destroy all PETSc objects."""
        self._slope.destroy()

    @property
    def factorisations(self) -> int:
        """Of secant stiffnesses, over all lapses."""
        return self._slope.factorisations

    @property
    def moving(self) -> bool:
        """Whether something slips as the next lapse begins."""
        state = self.state
        return state is not None and state.rate > 0

    def begin(self, points: Points, filling: Filling | None) -> None:
        """Find the mechanism of a lapse, and what of the last one's motion is its own (collective).

        Args:
            points: The points, weighed; their dynamic velocity and mechanism are changed in place.
            filling: How far they fill the cells.

        Raises:
            SceneError: The slope does not stand before it is shaken.
            MechanismError: No mechanism was found.
        """
        self._slope.weigh(points, filling)
        if self.state is None:
            self._mechanism, self.state = self._first()
        else:
            self._mechanism = self._next(points, self.state)
        self.state = self._give_way(points, self.state)
        self._handover.slip_on(self._unknowns, self.state.rate)

    def _first(self) -> tuple[Mechanism, SlipState]:
        """The mechanism with the least k_y, over both senses of every horizontal motion."""
        safety = self._slope.factor_of_safety()
        candidates = [(self._find(axis, sense), axis, sense) for axis, sense in self._slope.ways()]
        first = candidates[0]
        for candidate in candidates[1:]:
            lowest = first[0].yield_coefficient
            if candidate[0].yield_coefficient < lowest - _SOONER * abs(lowest):
                first = candidate
        best, axis, sense = first
        return best, SlipState(0.0, 0.0, 0.0, safety, axis, sense)

    def _next(self, points: Points, state: SlipState) -> Mechanism:
        """The mechanism now, sought from where the last one has moved to."""
        start = self._equations.field_of(points, points["mechanism"])
        return self._find(state.axis, state.sense, start)

    def _find(self, axis: int, sense: int, start: RealArray | None = None) -> Mechanism:
        inertia = self._equations.inertia.influence[self._equations.axes.index(axis)]
        return self._slope.find(inertia, sense * self._g, start)

    def _give_way(self, points: Points, state: SlipState) -> SlipState:
        """What the old mechanism has of the motion of the new one slips on, the rest vibrates."""
        self._unknowns = self._equations.unknowns.restrict(self._mechanism.field)
        at_points = transfer_matrix(points, self._domain.V) @ self._mechanism.field
        rate = state.rate
        if rate:
            momentum = self._equations.momentum(points, points["mechanism"])
            phi = momentum.duplicate()
            phi.array[:] = self._unknowns
            M_phi = product([(self._equations.mass, 1.0)], self._unknowns, like=phi)
            rate *= max(float(phi.dot(momentum).real / phi.dot(M_phi).real), 0.0)
            rest = state.rate * points["mechanism"] - rate * at_points
            points["dynamic_velocity"] = points["dynamic_velocity"] + rest
            for vector in (momentum, phi, M_phi):
                vector.destroy()
        points["mechanism"] = at_points
        return replace(state, rate=rate)

    def slip(
        self, response: Response, equations: LapseEquations, solve: Solve, kernel: Kernel
    ) -> tuple[Response, Slipped]:
        """Let the mechanism slip in a lapse that was solved without (collective).

        Args:
            response: The response without slip.
            equations: The equations it was solved with.
            solve: Sweeps them over the lines of the lapse.
            kernel: Sweeps them over other complex frequencies, to a residual.

        Returns:
            The response with slip, of a lapse that ends where a new mechanism is due, and the slip.
        """
        assert self.state is not None
        with LapseSlip(
            mechanism=self._mechanism,
            unknowns=self._unknowns,
            state=self.state,
            response=response,
            equations=equations,
            inertia=self._equations.inertia.forces,
            motion=self._handover.motion_between,
            yield_acceleration=self._g * self._mechanism.yield_coefficient,
            time_step=self._settings.time_step,
        ) as lapse:
            slipped = lapse.march(kernel, self._most_slip)
            self.state = slipped.after
            return lapse.excited(slipped, solve, self._handover.start_from), slipped
