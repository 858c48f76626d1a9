# SPDX-License-Identifier: MIT
"""The ground that stability maps are made of: a scene's equations, and their matrices for scipy.

Everything here is what a run uses, taken one by one: so a map may ask for what a scene may not.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Self

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain, build
from fenics_hytf.lapse import (
    Equations,
    Filling,
    LapseEquations,
    Material,
    first_strain,
    material,
    seed_points,
    survey,
)
from fenics_hytf.operators import constrained_rows, displacement_rows
from fenics_hytf.particles import Points, transfer_matrix
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.receivers import Receivers

ComplexArray = npt.NDArray[np.complex128]


def csr(matrix: PETSc.Mat) -> sparse.csr_matrix:
    """A serial matrix for scipy, zeros and all."""
    start, columns, values = matrix.getValuesCSR()
    return sparse.csr_matrix((values.copy(), columns, start), shape=matrix.getSize())


class Site:
    """A scene's mesh, points and equations in this process; a context manager that owns them.

    Args:
        scene: The scene.
        carried: What points carry, shapes of one point's entry by name.
        fill: Changes the points and says how far they then fill the cells.
    """

    def __init__(
        self,
        scene: Scene,
        carried: dict[str, tuple[int, ...]] | None = None,
        fill: Callable[[Domain, Points], Filling] | None = None,
    ) -> None:
        self.scene = scene
        self.domain = build(scene, MPI.COMM_SELF)
        self.points = seed_points(scene, self.domain, carried or {})
        self.equations = Equations(scene, self.domain, Counter())
        filling = None if fill is None else fill(self.domain, self.points)
        if filling is not None:
            self.equations.occupy(filling)
        self.equations.weigh(self.points)
        self.ground = survey(scene, self.domain, self.points, filling)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.equations.destroy()

    def assemble(self, ratio: float = 1.0) -> tuple[LapseEquations, Material]:
        """The equations with a ratio of the shear moduli, and the law of the cells."""
        ground = replace(self.ground, shear_modulus=ratio * self.ground.shear_modulus)
        law = material(ground, ground.secant(first_strain(self.scene, ground)), self.scene.solver)
        return self.equations.assemble(ground, law), law

    def receiver_rows(self) -> PETSc.Mat:
        """Displacement of the receivers from the unknowns, components fastest; to be destroyed."""
        receivers = Receivers(self.domain, self.points, self.scene.output.receivers)
        sites, numbers = receivers.sites(self.points)
        assert np.array_equal(numbers, np.arange(len(numbers)))
        local = displacement_rows(transfer_matrix(sites, self.domain.V), self.domain.gdim)
        return constrained_rows(self.domain, local, self.equations.T)


class ScipySystem:
    """A site's equations at single frequencies, for scipy in place of the package's sweeps.

    Args:
        site: The site.
    """

    def __init__(self, site: Site) -> None:
        equations, _ = site.assemble()
        self._terms = [(csr(matrix), function) for matrix, function in equations.system.terms]
        assert isinstance(equations.loads, list)
        self.load: ComplexArray = equations.loads[0].array_r.copy()
        rows = site.receiver_rows()
        self._rows = csr(rows)
        rows.destroy()

    def matrix(self, s: complex) -> sparse.csr_matrix:
        """A(s)."""
        return sum(function(s) * matrix for matrix, function in self._terms)

    def at_receivers(self, s: complex) -> ComplexArray:
        """Displacement of the receivers for a unit of base acceleration, shape ``(n,)``."""
        solved = np.linalg.solve(self.matrix(s).toarray(), self.load)
        return np.asarray(self._rows @ solved)
