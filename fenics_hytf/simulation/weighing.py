# SPDX-License-Identifier: MIT
"""What the points say at the start of a lapse: the ground, its mass, and the stress it bears."""

from __future__ import annotations

import numpy as np

from fenics_hytf.domain import Domain
from fenics_hytf.lapse import (
    Equations,
    Filling,
    FillingSurvey,
    Ground,
    Statics,
    cell_stress,
    survey,
)
from fenics_hytf.particles import Points
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.observation import Observation


class Weighing:
    """Rebuilds what hangs on where the points are.

    Args:
        scene: The scene.
        domain: The domain.
        equations: Its equations.
        observation: Looks at the unknowns, which are others where other cells are filled.
        statics: Static stress, where the scene calls for gravity.
    """

    def __init__(
        self,
        scene: Scene,
        domain: Domain,
        equations: Equations,
        observation: Observation,
        statics: Statics | None,
    ) -> None:
        self._scene, self._domain, self._equations = scene, domain, equations
        self._observation, self._statics = observation, statics
        self._filling = FillingSurvey(scene, domain) if scene.mesh.empty else None
        if self._filling is None:
            observation.look_at(None)

    def __call__(self, points: Points, at_first: bool, slid: bool) -> Ground:
        """M = SᵀM_pS (4), K_NL and the soil of each cell (collective).

        Args:
            points: The points where they are now; those that have come off are taken out.
            at_first: Whether nothing has happened to them yet: stress is brought into balance.
            slid: Whether something has slid: what of it is out of balance is spread.

        Returns:
            The ground.

        Raises:
            SceneError: At first, soil that nothing holds.
            DetachedError: Later on.
        """
        filling = None
        if self._filling is not None:
            look = self._filling.at_first if at_first else self._filling
            filling = self._fill(look(points))
        ground = survey(self._scene, self._domain, points, filling)
        self._equations.weigh(points)
        if self._statics is not None and at_first:
            self._statics.settle(points, ground)
        elif self._statics is not None and slid:
            self._statics.spread(points, ground, limit=np.inf)
        if self._scene.effects.geometric_stiffness:
            self._equations.stiffen(cell_stress(self._domain, points))
        return ground

    def _fill(self, filling: Filling) -> Filling:
        """Make it known how far points fill the cells."""
        others = self._equations.occupy(filling)
        if others:
            self._observation.look_at(filling.filled)
        if self._statics is not None:
            self._statics.occupy(filling)
        return filling
