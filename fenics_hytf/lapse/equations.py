# SPDX-License-Identifier: MIT
"""The equations of one lapse, M ü + K* u = −M r ü_b (1)–(4), on the unknowns q of u = T q.

Matrices and forms are made once a run and refilled; what the scene does not call for is not made.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx.fem import Function
from petsc4py import PETSc

from fenics_hytf.domain import Domain, constraint_matrix
from fenics_hytf.frequency import DynamicSystem, constant, hysteretic
from fenics_hytf.lapse.ground import ElasticConstants
from fenics_hytf.operators import ElasticForm, GeometricForm, assemble_mass, rayleigh_damping
from fenics_hytf.particles import Points, particle_mass_matrix, transfer_matrix
from fenics_hytf.scene import Scene


@dataclass(frozen=True)
class LapseEquations:
    """A system and its right-hand sides, borrowed from :class:`Equations` until the next call.

    Attributes:
        system: A(s) of the lapse.
        sides: −TᵀM r of each motion [kg].
    """

    system: DynamicSystem
    sides: list[PETSc.Vec]


class Equations:
    """Makes the matrices of each lapse.

    Args:
        scene: The scene: boundaries, effects, directions of the motions.
        domain: The domain.
        assemblies: Counts assemblies by the name of the form.
    """

    def __init__(self, scene: Scene, domain: Domain, assemblies: Counter[str]) -> None:
        self._domain = domain
        self._effects = scene.effects
        self._assemblies = assemblies
        self._elastic = ElasticForm(domain)
        self._geometric = GeometricForm(domain) if scene.effects.geometric_stiffness else None
        self.axes = tuple(domain.components.index(m.direction) for m in scene.motion)
        self.T = constraint_matrix(domain, scene.boundary, self.axes)
        self._K = self._elastic.create_matrix()
        # On the unknowns: mass, real, imaginary and geometric stiffness, made when first needed.
        self._constrained: dict[str, PETSc.Mat] = {}
        self._sides: list[PETSc.Vec] = []

    @property
    def num_unknowns(self) -> int:
        """Unknowns of all ranks."""
        return int(self.T.getSize()[1])

    def destroy(self) -> None:
        """Destroy all PETSc objects."""
        for owned in (self.T, self._K, *self._constrained.values(), *self._sides):
            owned.destroy()

    def weigh(self, points: Points) -> None:
        """Rebuild M = SᵀM_pS (4) and the right-hand sides −TᵀM r from the points.

        Args:
            points: The points where they are now.
        """
        if "real" not in self._constrained:
            self._pattern()
        nodal = particle_mass_matrix(transfer_matrix(points, self._domain.V), points.mass)
        M = assemble_mass(self._domain, nodal, self._K)
        self._assemblies["mass"] += 1
        for side in self._sides:
            side.destroy()
        # M r on all nodes, before constraining: held ones pull on their neighbours too.
        self._sides = [self._influence(M, direction) for direction in self.axes]
        self._constrain("mass", M)
        M.destroy()

    def _pattern(self) -> None:
        """Give K its pattern, before any value is known."""
        cells = len(self._domain.regions)
        self._elastic.assemble(self._K, np.ones(cells), np.ones(cells))
        self._constrain("real", self._K)

    def _influence(self, M: PETSc.Mat, direction: int) -> PETSc.Vec:
        r, Mr = M.createVecs()
        r.array[direction :: self._domain.gdim] = 1.0
        M.mult(r, Mr)
        side = self.T.createVecRight()
        self.T.multTranspose(Mr, side)
        side.scale(-1.0)
        r.destroy()
        Mr.destroy()
        return side

    def _constrain(self, name: str, matrix: PETSc.Mat) -> PETSc.Mat:
        """A_q = TᵀAT, into the matrix kept under a name."""
        kept = self._constrained.get(name)
        self._constrained[name] = matrix.ptap(self.T, result=kept)
        return self._constrained[name]

    def _stiffness(self, name: str, constants: ElasticConstants) -> PETSc.Mat:
        cells = self._domain.input_cells
        self._elastic.assemble(
            self._K, constants.lame_lambda[cells], constants.shear_modulus[cells]
        )
        self._assemblies["elasticity"] += 1
        return self._constrain(name, self._K)

    def stiffen(self, stress: npt.NDArray[np.float64]) -> None:
        """Rebuild K_NL, for a scene that calls for geometric stiffness.

        Args:
            stress: Cauchy stress of each local cell [Pa], shape ``(num_local_cells, gdim, gdim)``.
        """
        if self._geometric is not None:
            self._geometric.assemble(self._K, stress)
            self._assemblies["geometric"] += 1
            self._constrain("geometric", self._K)

    def assemble(
        self, real: ElasticConstants, imaginary: ElasticConstants | None
    ) -> LapseEquations:
        """Assemble A(s) with the moduli of an iteration.

        Args:
            real: Real parts of the elastic constants, cells in the order of the input.
            imaginary: Imaginary parts, or ``None`` without material damping.

        Returns:
            The equations, valid until the next call.
        """
        K = self._stiffness("real", real)
        M = self._constrained["mass"]
        terms = [(K, constant)]
        C = None
        if self._effects.rayleigh is not None:
            factors = self._effects.rayleigh
            old = self._constrained.pop("rayleigh", None)
            if old is not None:
                old.destroy()
            C = rayleigh_damping(M, K, factors.alpha, factors.beta)
            self._constrained["rayleigh"] = C
            self._assemblies["rayleigh"] += 1
        if imaginary is not None:
            terms.append((self._stiffness("imaginary", imaginary), hysteretic))
        if "geometric" in self._constrained:
            terms.append((self._constrained["geometric"], constant))
        return LapseEquations(DynamicSystem(terms, M, C), self._sides)

    def expand(self, q: npt.NDArray[np.complex128]) -> npt.NDArray[np.float64]:
        """Nodal field u = T q of a real response.

        Args:
            q: This rank's unknowns, shape ``(num_local_unknowns,)``.

        Returns:
            Real part at the local nodes, ghosts included, shape ``(num_local_nodes, gdim)``.
        """
        unknowns, nodes = self.T.createVecs()
        unknowns.array[:] = q
        self.T.mult(unknowns, nodes)
        u = Function(self._domain.V)
        u.x.array[: nodes.getLocalSize()] = nodes.array_r
        u.x.scatter_forward()
        unknowns.destroy()
        nodes.destroy()
        return u.x.array.real.reshape(-1, self._domain.gdim).copy()
