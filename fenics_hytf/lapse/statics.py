# SPDX-License-Identifier: MIT
"""Static stress: what the ground carries before it is shaken, in balance with its weight.

    f_int(σ) = ∫ Bᵀσ dV = Sᵀ M_p g = f_g

Gravity is switched on in elastic ground, K u = f_g. Where K0 rules, horizontal stress is then set
to K0 times the vertical one, level or not, and what that leaves out of balance is spread
elastically. The stress lives on the points. As they move it goes with them, and what the ground in
its new shape leaves out of balance acts on it in the next lapse, or, once a mechanism has slid, is
spread again. Stress that has fallen because the ground is softer is borne elastically again, and
gives the ground a displacement. Base and sides hold the ground here as they would for a long time:
a compliant base is fixed, dashpots and free fields are rollers; what they bear is none of the
imbalance.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import DynamicSystem, SymmetricFactorisation, constant
from fenics_hytf.lapse.errors import BalanceError
from fenics_hytf.lapse.filling import Filling, assemble_stiffness
from fenics_hytf.lapse.ground import Ground
from fenics_hytf.lapse.material import ElasticConstants, elastic_constants
from fenics_hytf.lapse.unknowns import Unknowns
from fenics_hytf.operators import (
    ElasticForm,
    GhostForm,
    InternalForce,
    isotropic_stress,
)
from fenics_hytf.particles import Points, transfer_matrix
from fenics_hytf.scene import Scene

RealArray = npt.NDArray[np.float64]

BALANCE = 1e-9
"""Of the weight: what may be out of balance before shaking."""

_LEVEL = 1e-6  # shear over vertical stress, below which ground is level
_STEPS = 40  # of spreading: points on Gauss points take one, others some ten
# a_K here, a millionth of that of sections: it bears what acts on mechanisms, and hardly more.
_LIGHTLY = 5e-8


def static_supports(supports: dict[str, str]) -> dict[str, str]:
    """What holds each boundary in the long run.

    Args:
        supports: What holds it in a lapse.

    Returns:
        The kind of each boundary.
    """
    lasting = {"compliant": "fixed", "dashpot": "roller", "free_field": "roller"}
    return {name: lasting.get(kind, kind) for name, kind in supports.items()}


class Statics:
    """Brings the stress of points into balance with their weight.

    Args:
        scene: The scene; it calls for gravity.
        domain: The domain.
    """

    def __init__(self, scene: Scene, domain: Domain) -> None:
        assert scene.effects.gravity is not None
        self._scene, self._domain = scene, domain
        self._gravity = scene.effects.gravity
        locking = scene.effects.locking
        self._elastic, self._force = ElasticForm(domain, locking), InternalForce(domain, locking)
        self._supports = static_supports(scene.supports)
        self._unknowns: Unknowns | None = None
        self._K: PETSc.Mat | None = None
        self._filling: Filling | None = None
        self._ghost: GhostForm | None = None
        self._K_G: PETSc.Mat | None = None

    def destroy(self) -> None:
        """Destroy all PETSc objects."""
        for owned in (self._unknowns, self._K, self._K_G):
            if owned is not None:
                owned.destroy()

    @property
    def unknowns(self) -> Unknowns:
        """Unknowns of ground that is held for a long time, borrowed until others are filled."""
        if self._unknowns is None:
            self._unknowns = Unknowns(self._domain, self._supports)
        return self._unknowns

    def occupy(self, filling: Filling) -> None:
        """Take note of which cells are filled, and how far (collective).

        Args:
            filling: The filling.
        """
        before, self._filling = self._filling, filling
        if before is not None and filling.same_cells(before):
            if self._ghost is not None:
                filling.loosen(self._ghost, self._domain)
            return
        self.destroy()
        bare = filling.bare_nodes(self._domain)
        self._unknowns = Unknowns(self._domain, self._supports, bare=bare)
        self._ghost = filling.ghost(self._domain, _LIGHTLY)
        self._K, self._K_G = None, None

    def settle(self, points: Points, ground: Ground) -> None:
        """Give points their first stress (collective).

        Args:
            points: Points without stress, changed in place.
            ground: The ground.

        Raises:
            BalanceError: The stress does not come into balance.
        """
        self.spread(points, ground)
        initial = self._gravity.initial_stress
        if initial == "k0" or (initial is None and self._is_level(points)):
            self._rest_on_k0(points)
            self.spread(points, ground)

    def _is_level(self, points: Points) -> bool:
        """Whether the elastic stress has hardly any shear."""
        stress = points["stress"]
        up = points.x.shape[1] - 1
        mine = [np.abs(stress[:, up + 1 :]).max(initial=0), np.abs(stress[:, up]).max(initial=0)]
        shear, vertical = np.max(self._domain.comm.allgather(mine), axis=0)
        return bool(shear <= _LEVEL * vertical)

    def _rest_on_k0(self, points: Points) -> None:
        up = points.x.shape[1] - 1
        names = self._domain.region_names
        k0 = np.array([self._scene.soil[name].at_rest for name in names])[points.region]
        stress = np.zeros_like(points["stress"])
        stress[:, up] = points["stress"][:, up]
        stress[:, :up] = (k0 * stress[:, up])[:, None]
        points["stress"] = stress

    def spread(self, points: Points, ground: Ground, limit: float = BALANCE) -> None:
        """Spread elastically what is out of balance, as far as can be (collective).

        What acts on a mechanism of a loose cell, which no stress of its points can bear, is borne
        by the ghost term that holds it.

        Args:
            points: Points, their stress changed in place.
            ground: The ground, whose small-strain stiffness spreads it.
            limit: What may be left, of the weight [-].

        Raises:
            BalanceError: More is left.
        """
        R = self._resampling(points)
        f_g = self.unknowns.collect(self.weight_of(points))
        constants = elastic_constants(ground, self._scene.solver)
        scale = f_g.norm()
        _, left = self._bear(points, R, f_g, constants, scale)
        f_g.destroy()
        if left > limit * scale:
            raise BalanceError(left / scale, limit)

    def redistribute(
        self, points: Points, fallen: RealArray, constants: ElasticConstants
    ) -> RealArray:
        """Let the ground bear elastically what stress bore before it fell (collective).

        Args:
            points: Points, their stress changed in place.
            fallen: Their stress after the fall [Pa], shaped like the stress.
            constants: Elastic constants of every cell that bear it.

        Returns:
            The displacement that it takes at this rank's nodes, ghosts included [m], shape
            ``(num_local_nodes, num_components)``. What strain cannot bring to the points is left
            out of balance.
        """
        R = self._resampling(points)
        force = self.unknowns.collect(self._internal(points, R))
        points["stress"] = fallen
        lost = self._lacking(points, R, force)
        u, _ = self._bear(points, R, force, constants, lost.norm())
        for vector in (force, lost):
            vector.destroy()
        return u

    def _lacking(self, points: Points, R: sparse.csr_matrix, force: PETSc.Vec) -> PETSc.Vec:
        """What of a force the stress of points does not bear; the caller destroys it."""
        residual = self.unknowns.collect(self._internal(points, R))
        residual.aypx(-1.0, force)
        return residual

    def _bear(
        self,
        points: Points,
        R: sparse.csr_matrix,
        force: PETSc.Vec,
        constants: ElasticConstants,
        scale: float,
    ) -> tuple[RealArray, float]:
        """Strain the ground elastically until stress bears a force, to BALANCE of a scale.

        Returns:
            The displacement [m], and the norm of what is left [N, in 2D N/m].
        """
        domain, unknowns = self._domain, self.unknowns
        lame, shear = constants.at(domain.input_cells)
        rows = self._force.strain_rows(points)
        x, left = force.duplicate(), np.inf
        total = unknowns.expand(0.0 * x.array_r.real)
        with self._factorised(lame, shear) as factorisation:
            for _ in range(_STEPS):
                residual = self._lacking(points, R, force)
                factorisation.backsolve(residual, x)
                if self._K_G is not None:
                    residual.axpy(-1.0, self._K_G @ x)
                before, left = left, residual.norm()
                residual.destroy()
                if left <= BALANCE * scale or left >= before:
                    break
                u = unknowns.expand(x.array_r.real)
                total += u
                strain = (rows @ u.ravel()).reshape(len(points), -1)
                added = isotropic_stress(strain, lame[points.cell], shear[points.cell])
                points["stress"] = points["stress"] + added
        x.destroy()
        return total, left

    def _factorised(self, lame: RealArray, shear: RealArray) -> SymmetricFactorisation:
        T = self.unknowns.T
        nodal = (self._ghost or self._elastic).create_matrix()
        if self._ghost is not None:
            self._ghost.assemble(nodal, ElasticConstants(lame, shear).youngs_modulus)
            self._K_G = nodal.ptap(T, result=self._K_G)
        assemble_stiffness(
            self._domain, nodal, self._elastic, self._force, self._filling, lame, shear
        )
        self._K = nodal.ptap(T, result=self._K)
        nodal.destroy()
        terms = [(K, constant) for K in (self._K, self._K_G) if K is not None]
        factorisation = SymmetricFactorisation(DynamicSystem(terms, self._K))
        factorisation.factorise(0.0)
        return factorisation

    def _resampling(self, points: Points) -> sparse.csr_matrix:
        """From the points to where the force is integrated, which goes with them."""
        if self._filling is not None:
            self._filling.integrate(self._force, self._domain, points)
        return self._force.resampling(points)

    def weight_of(self, points: Points) -> RealArray:
        """Weight of the points at this rank's nodes [N, in 2D N/m].

        Args:
            points: The points.

        Returns:
            Ghosts included, components fastest, shape ``(num_local_nodes·num_components,)``.
        """
        g = np.zeros((len(points), self._domain.num_components))
        g[:, -1] = -self._gravity.acceleration * points.mass
        return np.asarray(transfer_matrix(points, self._domain.V).T @ g).ravel()

    def _internal(self, points: Points, R: sparse.csr_matrix) -> RealArray:
        return self._force(np.asarray(R @ points["stress"]))

    def imbalance(self, points: Points) -> RealArray:
        """What the stress leaves of the weight where the ground may move (collective).

        Args:
            points: The points.

        Returns:
            This rank's share at its nodes, to be summed over ranks, ghosts included, components
            fastest [N, in 2D N/m].
        """
        free = self.unknowns.expand(np.ones(self.unknowns.num_local))
        left = self.weight_of(points) - self._internal(points, self._resampling(points))
        return left * free.ravel()
