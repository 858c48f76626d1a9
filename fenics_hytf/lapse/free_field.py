# SPDX-License-Identifier: MIT
"""The free field beyond a side: level ground, solved as a column by the same code, line by line.

On the side acts what the column's soil would exert on soil that moves as it does, and dashpots on
the difference (Zienkiewicz, Bicanic and Shen 1989):

    f(s) = ∫ N σ*(w_ff) n dS + s C (w_ff − w)

with w_ff the column's motion; −s C w stands on the left-hand side. A section of level ground so
moves as the column does. Sections do not act back on the columns.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fenics_hytf.domain import Domain, side_column
from fenics_hytf.frequency import hysteretic
from fenics_hytf.lapse.equations import Equations
from fenics_hytf.lapse.equivalent_linear import first_strain
from fenics_hytf.lapse.ground import complex_constants, seed_points, survey
from fenics_hytf.lapse.response import CellProbe, Excitation
from fenics_hytf.lapse.run import Observer, Solved, solve
from fenics_hytf.operators import (
    DashpotForm,
    TractionForm,
    constrained_rows,
    displacement_rows,
)
from fenics_hytf.particles import Sites, locate, transfer_matrix
from fenics_hytf.scene import Boundary, Scene, default_kind

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_SIDES = ("left", "right", "front", "back")


class FreeField:
    """The column beyond a side, and its forces on it (collective).

    Args:
        scene: The scene.
        domain: The domain.
        name: Name of the side.
        assemblies: Counts assemblies by the name of the form.

    Raises:
        SceneError: The side is not vertical, or its soils do not lie in level layers.
    """

    def __init__(self, scene: Scene, domain: Domain, name: str, assemblies: Counter[str]) -> None:
        self.name = name
        self._section = domain
        self._side = side_column(domain, name)
        column = self._side.domain
        self._scene = _level_ground(scene, domain.gdim)
        self._equations = Equations(self._scene, column, assemblies)
        points = seed_points(self._scene, column)
        self._ground = survey(self._scene, column, points)
        self._equations.weigh(points)
        loop = scene.effects.equivalent_linear
        self._probe = CellProbe(column, self._equations.T, loop.strain if loop else "plane")
        self._strain: RealArray | None = None
        self._rows = self._make_rows()
        self._dashpot, self._traction = DashpotForm(domain, [name]), TractionForm(domain, name)
        self._C = self._dashpot.create_matrix()
        self._P = [self._traction.create_matrix() for _ in ("real", "imaginary")]
        self._s: ComplexArray
        self._motion: ComplexArray

    def destroy(self) -> None:
        """Destroy all PETSc objects."""
        for owned in (self._equations, self._probe, self._rows, self._C, *self._P):
            owned.destroy()

    def _make_rows(self) -> PETSc.Mat:
        """Rows that evaluate the column at this rank's nodes on the side."""
        side, column = self._side, self._side.domain
        sites = Sites(*locate(column.mesh, side.places))
        local = displacement_rows(transfer_matrix(sites, column.V), column.num_components)
        return constrained_rows(column, local, self._equations.T)

    def solve(self, excitation: Excitation, observer: Observer) -> Solved:
        """Solve the column for a lapse, with moduli that fit its own strain.

        Args:
            excitation: The input of the lapse.
            observer: Where to report.

        Returns:
            The column's solution.

        Raises:
            SweepError: A line cannot be solved.
            EquivalentLinearError: The loop reaches its limit.
        """
        start = self._strain
        if start is None:
            start = first_strain(self._scene, self._ground)
        solved = solve(
            self._scene, self._equations, self._ground, excitation, self._probe, start, observer
        )
        self._strain = solved.effective_strain
        self._s = excitation.s
        self._motion = self._side_motion(solved)
        self._assemble_traction(solved)
        return solved

    def _side_motion(self, solved: Solved) -> ComplexArray:
        """The column's motion at this rank's nodes on the side.

        Shape ``(num_nodes, num_components, num_motions, num_lines)``.
        """
        num_motions, num_lines = len(solved.excitation.axes), len(solved.excitation.lines)
        shape = (len(self._side.nodes), self._section.num_components, num_motions, num_lines)
        return solved.sweep.project(self._rows).reshape(shape)

    def _assemble_traction(self, solved: Solved) -> None:
        solver = self._scene.solver
        parts = complex_constants(self._ground, solved.moduli, solver.complex_modulus, solver.keep)
        beyond = self._side.cell
        there = beyond >= 0
        for matrix, constants in zip(self._P, parts, strict=True):
            moduli = np.zeros((2, len(beyond)))
            if constants is not None:
                moduli[:, there] = constants.at(beyond[there])
            self._traction.assemble(matrix, *moduli)

    def fasten(self, normal: RealArray, tangential: RealArray) -> None:
        """Give the dashpots the impedances of the section's cells; see :class:`SideForce`."""
        self._dashpot.assemble(self._C, normal, tangential)

    def add_force(self, line: int, motion: int, nodal: PETSc.Vec) -> None:
        """Add the nodal forces f + s C w for a unit of a motion at a line."""
        s = complex(self._s[line])
        rayleigh = self._scene.effects.rayleigh
        viscous = 1.0 if rayleigh is None else 1.0 + s * rayleigh.beta
        moved, force = self._C.createVecs()
        count = self._section.num_components
        places = self._side.nodes[:, None] * count + np.arange(count)
        moved.array[places] = self._motion[:, :, motion, line]
        factors = (s, viscous, hysteretic(s))
        for matrix, factor in zip((self._C, *self._P), factors, strict=True):
            matrix.mult(moved, force)
            nodal.axpy(factor, force)
        moved.destroy()
        force.destroy()


def column_supports(supports: Mapping[str, str], gdim: int) -> dict[str, str]:
    """What holds a column of level ground: the base of the section, and tied sides.

    Args:
        supports: What holds the boundaries of the section.
        gdim: Space dimension.

    Returns:
        Kind by name.
    """
    base = supports.get("base", default_kind("base"))
    return {"base": base} | dict.fromkeys(_SIDES[: 2 * (gdim - 1)], "tied")


def _level_ground(scene: Scene, gdim: int) -> Scene:
    """The scene of a column of level ground."""
    kinds = MappingProxyType(column_supports(scene.boundary.kinds, gdim))
    still = {"convection": False, "geometric_stiffness": False, "calm": None}
    return replace(
        scene,
        boundary=Boundary(kinds, scene.boundary.rock),
        effects=scene.effects.model_copy(update=still),
        mesh=scene.mesh.model_copy(update={"points_per_cell": None}),
    )
