# SPDX-License-Identifier: MIT
"""Ground that may slide: its strength and weight, its mechanisms, and whether it stands at rest.

The strength of a cell is the mean of its points', which follows from the stress that they carry
(Mohr and Coulomb), and stays as it is until they are looked at again.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fenics_hytf.domain import Domain
from fenics_hytf.lapse.filling import Filling, cell_integrals
from fenics_hytf.lapse.mechanism import Mechanism, MechanismSearch
from fenics_hytf.lapse.statics import Statics
from fenics_hytf.particles import Points, to_tensor
from fenics_hytf.scene import Fault, Scene, SceneError
from fenics_hytf.soil import shear_strength

RealArray = npt.NDArray[np.float64]

# Of the largest strength: what soil without cohesion and confinement is given. Soil beside rock has
# a thousandth of its strength, and a search found mechanisms between strengths 2e5 apart.
_LEAST_STRENGTH = 1e-6


def mean_pressure(stress: RealArray) -> RealArray:
    """Mean of the major and the minor principal stress, compression positive.

    In a section that of the two in its plane: the third lies between them where soil fails.

    Args:
        stress: Components of a point a row [Pa], shape ``(n, 3)`` or ``(n, 6)``.

    Returns:
        [Pa], shape ``(n,)``.
    """
    if stress.shape[1] == 3:
        return np.asarray(-stress[:, :2].mean(axis=1))
    principal = np.linalg.eigvalsh(to_tensor(stress))
    return np.asarray(-principal[:, [0, -1]].mean(axis=1))


class Slope:
    """Ground that may slide; to be weighed before anything is asked of it.

    Args:
        scene: The scene; it calls for sliding and gravity.
        domain: The domain.
        statics: Its static stress and weight.
    """

    def __init__(self, scene: Scene, domain: Domain, statics: Statics) -> None:
        assert scene.effects.sliding is not None
        self._domain, self._statics, self._settings = domain, statics, scene.effects.sliding
        self._level = scene.level_axes(domain.gdim)
        soils = [scene.soil[name] for name in domain.region_names]
        self._cohesion = np.array([soil.cohesion or 0.0 for soil in soils])
        self._friction_angle = np.array([soil.friction_angle or 0.0 for soil in soils])
        self._search = MechanismSearch(domain)
        self._weight: RealArray
        self._strength: RealArray
        self._gravity: PETSc.Vec | None = None

    def destroy(self) -> None:
        """Destroy all PETSc objects."""
        self._search.destroy()
        self._forget()

    def _forget(self) -> None:
        if self._gravity is not None:
            self._gravity.destroy()
        self._gravity = None

    @property
    def factorisations(self) -> int:
        """Of secant stiffnesses, over all searches."""
        return self._search.factorisations

    def weigh(self, points: Points, filling: Filling | None) -> None:
        """Take strength and weight from the points (collective).

        Args:
            points: The points, with their static stress.
            filling: How far they fill the cells; ``None`` where all are full.
        """
        local = self._domain.input_cells
        self._weight = np.ones(len(local)) if filling is None else filling.weight[local]
        self._strength = self._cell_strength(points, filling)[local]
        self._forget()
        self._gravity = self._statics.unknowns.collect(self._statics.weight_of(points))

    def _cell_strength(self, points: Points, filling: Filling | None) -> RealArray:
        """Mean shear strength of every cell by volume [Pa]; 1 where there is no soil."""
        pressure = mean_pressure(points["stress"])
        cohesion = self._cohesion[points.region]
        strength = shear_strength(cohesion, self._friction_angle[points.region], pressure)
        both = np.column_stack([np.ones(len(points)), strength])
        volume, total = cell_integrals(self._domain, points, both, filling).T
        mean = total / np.where(volume > 0, volume, 1.0)
        return np.where(volume > 0, np.maximum(mean, _LEAST_STRENGTH * mean.max()), 1.0)

    def moves(self, axis: int) -> bool:
        """Whether anything can move for good along an axis, as the ground is held (collective)."""
        T = self._statics.unknowns.T
        unknowns, nodes = T.createVecs()
        nodes.array[axis :: self._domain.gdim] = 1.0
        T.multTranspose(nodes, unknowns)
        free = bool(unknowns.norm() > 0)
        unknowns.destroy()
        nodes.destroy()
        return free

    def ways(self) -> list[tuple[int, int]]:
        """Axes, and both senses of each, along which shaking can move ground for good (collective).

        Raises:
            SceneError: There is none.
        """
        ways = [(axis, sense) for axis in self._level if self.moves(axis) for sense in (1, -1)]
        if ways:
            return ways
        along = " and ".join("xyz"[axis] for axis in self._level)
        found = f"boundaries that hold every node of soil along {along}"
        expected = (
            "ground that can move for good where it is shaken: sides that are free or tied, or "
            "more than a cell apart (dashpot and free_field hold the static stress as rollers do)"
        )
        raise SceneError([Fault("effects.sliding", found, expected)])

    def factor_of_safety(self) -> float:
        """The factor of safety at rest (collective).

        Returns:
            The factor of safety [-]; infinite where gravity shears nothing, as in level ground.

        Raises:
            SceneError: It is below 1, and the scene does not ask for ground that does not stand;
                or nothing can slide.
            MechanismError: No mechanism was found.
        """
        assert self._gravity is not None
        self.ways()  # there are some
        if not self.moves(self._domain.gdim - 1):
            return np.inf
        safety = self._search.factor_of_safety(
            self._statics.unknowns, self._weight, self._strength, self._gravity
        )
        if safety < 1 and not self._settings.unstable_at_rest:
            found = f"a slope with a factor of safety of {safety:.3g} at rest"
            expected = "more than 1 before it is shaken, or unstable_at_rest = true to let it go"
            raise SceneError([Fault("effects.sliding", found, expected)])
        return safety

    def find(self, inertia: PETSc.Vec, scale: float, start: RealArray | None = None) -> Mechanism:
        """Find the mechanism that yields first under a driving force (collective).

        Args:
            inertia: Force of inertia at the nodes under a unit of acceleration [kg, in 2D kg/m].
            scale: Acceleration of gravity, its sign the sense that drives [m/s^2].
            start: An earlier mechanism's field, where the search begins, shape
                ``(num_local_nodes, num_components)``.

        Returns:
            The mechanism.

        Raises:
            MechanismError: None was found.
        """
        unknowns = self._statics.unknowns
        driving = unknowns.T.createVecRight()
        unknowns.T.multTranspose(inertia, driving)
        driving.scale(scale)
        try:
            return self._search.find(
                unknowns, self._weight, self._strength, self._gravity, driving, start
            )
        finally:
            driving.destroy()
