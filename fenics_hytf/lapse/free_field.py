# SPDX-License-Identifier: MIT
"""The free field beyond a side: level ground, solved as a column by the same code, line by line.

On the side acts what the column's soil would exert on soil that moves as it does, and dashpots on
the difference (Zienkiewicz, Bicanic and Shen 1989):

    f(s) = ∫ N σ*(w_ff) n dS + s C (w_ff − w)

with w_ff the column's motion; −s C w stands on the left-hand side. A section of level ground so
moves as the column does. Sections do not act back on the columns.

Where lapses hand over, the column does as the section does
(:mod:`fenics_hytf.lapse.handover`): w_ff is its increment, and the traction that it has carried
into a lapse fades as the stress in the section does.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy.spatial import KDTree

from fenics_hytf.domain import Domain, side_column
from fenics_hytf.lapse.carried import FADING, fading
from fenics_hytf.lapse.cells import CellProbe
from fenics_hytf.lapse.choice import choose_continuity
from fenics_hytf.lapse.equations import Equations
from fenics_hytf.lapse.equivalent_linear import first_strain
from fenics_hytf.lapse.excitation import Excitation
from fenics_hytf.lapse.ground import seed_points, survey
from fenics_hytf.lapse.material import Material, Part
from fenics_hytf.lapse.response import Response
from fenics_hytf.lapse.run import Observer, Solved, solve
from fenics_hytf.motion import Segment
from fenics_hytf.operators import (
    DashpotForm,
    TractionForm,
    constrained_rows,
    displacement_rows,
    evaluate,
)
from fenics_hytf.particles import (
    Sites,
    gather_points,
    locate,
    scatter_points,
    transfer_matrix,
)
from fenics_hytf.scene import Boundary, Scene, default_kind
from fenics_hytf.soil import RELAXATION_TIMES

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_SIDES = ("left", "right", "front", "back")


@dataclass(frozen=True)
class FreeFieldState:
    """What a column goes on with in the next lapse, whatever the ranks.

    Attributes:
        strain: Effective strain of its cells, or ``None``.
        points: Its points, as :func:`~fenics_hytf.particles.gather_points` gives them.
        moved: Displacement of its unknowns [m], shape ``(num_unknowns,)``.
        memory: Their memory of each branch, shape ``(4, num_unknowns)``.
        places: Nodes of the section on the side [m], shape ``(n, gdim)``.
        traction: Forces on them [N, in 2D N/m], shape ``(n, num_components)``.
    """

    strain: RealArray | None
    points: dict[str, npt.NDArray[Any]]
    moved: RealArray
    memory: RealArray
    places: RealArray
    traction: RealArray


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
        # What slides in the section may go on after the motion, and the column with it.
        after = scene.samples_after
        self._continuity = choose_continuity(self._scene, column, self._equations, after=after)
        points = seed_points(self._scene, column, self._continuity.fields)
        self._ground = survey(self._scene, column, points)
        self._equations.weigh(points)
        loop = scene.effects.equivalent_linear
        self._probe = CellProbe(column, self._equations.T, loop.strain if loop else "plane")
        self._rows = self._make_rows()
        self._dashpot, self._traction = DashpotForm(domain, [name]), TractionForm(domain, name)
        self._C = self._dashpot.create_matrix()
        self._P: dict[str, PETSc.Mat] = {}
        # What goes on in the next lapse: the warm start of the loop, the points, and on the
        # column's unknowns displacement and memory; and the traction on this rank's nodes.
        self._strain: RealArray | None = None
        self._points = points
        size = self._equations.T.getLocalSize()[1]
        self._moved, self._memory = np.zeros(size), np.zeros((len(RELAXATION_TIMES), size))
        self._force = np.zeros(self._C.getLocalSize()[0])
        # Of the lapse at hand.
        self._excitation: Excitation
        self._solved: Solved
        self._motion: ComplexArray
        self._carried: list[tuple[float | None, PETSc.Vec]] = []

    def destroy(self) -> None:
        """Destroy all PETSc objects."""
        held = (self._equations, self._continuity, self._probe, self._rows, self._C)
        for owned in (*held, *self._P.values()):
            owned.destroy()
        self._forget()

    def _forget(self) -> None:
        for _, force in self._carried:
            force.destroy()
        self._carried = []

    def _make_rows(self) -> PETSc.Mat:
        """Rows that evaluate the column at this rank's nodes on the side."""
        side, column = self._side, self._side.domain
        sites = Sites(*locate(column.mesh, side.places))
        local = displacement_rows(transfer_matrix(sites, column.V), column.num_components)
        return constrained_rows(column, local, self._equations.T)

    def solve(self, segment: Segment, observer: Observer) -> Solved:
        """Solve the column for a lapse, with moduli that fit its own strain.

        Args:
            segment: The lapse.
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
        self._excitation = self._continuity.excite(segment)
        self._continuity.begin(self._points, self._excitation)
        solved = solve(
            self._scene,
            self._equations,
            self._ground,
            self._excitation,
            self._continuity,
            self._probe,
            start=start,
            observer=observer,
        )
        self._strain = solved.effective_strain
        self._solved = solved
        self._motion = self._side_motion(solved.response)
        self._assemble_traction(solved.material)
        self._forget()
        if segment.index and self._continuity.goes_on_from_nought:
            self._carried = self._carried_tractions()
        return solved

    def _side_motion(self, response: Response) -> ComplexArray:
        """The column's motion at this rank's nodes on the side.

        Shape ``(num_nodes, num_components, num_sides, num_lines)``.
        """
        projected = response.sweep.project(self._rows)
        shape = (len(self._side.nodes), self._section.num_components, *projected.shape[1:])
        return projected.reshape(shape)

    def _assemble_traction(self, material: Material) -> None:
        beyond = self._side.cell
        there = beyond >= 0
        for part in material.parts:
            if part.name not in self._P:
                self._P[part.name] = self._traction.create_matrix()
            moduli = np.zeros((2, len(beyond)))
            moduli[:, there] = part.constants.at(beyond[there])
            self._traction.assemble(self._P[part.name], *moduli)

    def _carried_tractions(self) -> list[tuple[float | None, PETSc.Vec]]:
        """Traction of what the parts of the law have carried, and the rest, with how they fade."""
        rest = self._C.createVecLeft()
        rest.array[:] = self._force
        found: list[tuple[float | None, PETSc.Vec]] = []
        for part in self._solved.material.parts:
            force = self._force_of([(self._P[part.name], 1.0)], self._field_of(part))
            found.append((part.relaxation_time, force))
            rest.axpy(-1.0, found[-1][1])
        return [*found, (FADING, rest)]

    def _field_of(self, part: Part) -> RealArray:
        """What a part of the law acts on: displacement, or a branch's memory."""
        if part.relaxation_time is None:
            return self._moved
        return self._memory[RELAXATION_TIMES.index(part.relaxation_time)]

    def _force_of(self, matrices: list[tuple[PETSc.Mat, complex]], field: RealArray) -> PETSc.Vec:
        """Nodal forces of matrices and a field on the column's unknowns."""
        total = self._C.createVecLeft()
        there = evaluate(self._rows, field).reshape(len(self._side.nodes), -1)
        self._add_products(matrices, there, total)
        return total

    def _add_products(
        self,
        matrices: list[tuple[PETSc.Mat, complex]],
        motion: RealArray | ComplexArray,
        nodal: PETSc.Vec,
    ) -> None:
        """Add Σ factor · matrix · motion of the nodes on the side to nodal forces."""
        moved, force = self._C.createVecs()
        moved.array[self._unknowns_on_side()] = motion
        for matrix, factor in matrices:
            if factor:
                matrix.mult(moved, force)
                nodal.axpy(factor, force)
        moved.destroy()
        force.destroy()

    def finish(self) -> None:
        """Take what the column goes on with in the next lapse (collective)."""
        response, law = self._solved.response, self._solved.material
        self._continuity.finish(self._points, response, law)
        if not self._continuity.goes_on_from_nought:
            return
        end = response.excitation.duration
        # Of what was carried the rest alone, which is last, is not made of strain.
        left = [force.array_r.real * np.exp(-end / FADING) for _, force in self._carried[-1:]]
        self._moved = self._moved + response.unknowns_at(end)
        for branch, tau in enumerate(RELAXATION_TIMES):
            if any(part.relaxation_time == tau for part in law.parts):
                added = response.unknowns_at(end, relaxation_time=tau)
                self._memory[branch] = self._memory[branch] * np.exp(-end / tau) + added
        self._force = sum(left, np.zeros(len(self._force)))
        for part in law.parts:
            force = self._force_of([(self._P[part.name], 1.0)], self._field_of(part))
            self._force += force.array_r.real
            force.destroy()

    def state(self) -> FreeFieldState:
        """What the column goes on with (collective); the same on every rank."""
        here = self._on_side()
        shares = self._section.comm.allgather((self._places(), here))
        places, forces = (np.concatenate(part) for part in zip(*shares, strict=True))
        arrays = gather_points(self._points, self._side.domain.mesh)
        assert arrays is not None  # the column is whole on every rank
        return FreeFieldState(self._strain, arrays, self._moved, self._memory, places, forces)

    def restore(self, state: FreeFieldState) -> None:
        """Go on from a state, on any number of ranks."""
        self._strain, self._moved, self._memory = state.strain, state.moved, state.memory
        self._points = scatter_points(state.points, self._side.domain.mesh)
        if len(self._side.nodes):
            _, nearest = KDTree(state.places).query(self._places())
            self._force[self._unknowns_on_side()] = state.traction[nearest]

    def _places(self) -> RealArray:
        """Where this rank's nodes on the side are [m], shape ``(n, gdim)``."""
        x = self._section.V.tabulate_dof_coordinates()[self._side.nodes]
        return np.asarray(x[:, : self._section.gdim])

    def _unknowns_on_side(self) -> npt.NDArray[np.int64]:
        """Numbers of their components, shape ``(n, num_components)``."""
        count = self._section.num_components
        return np.asarray(self._side.nodes[:, None] * count + np.arange(count), np.int64)

    def _on_side(self) -> RealArray:
        return self._force[self._unknowns_on_side()]

    def fasten(self, normal: RealArray, tangential: RealArray) -> None:
        """Give the dashpots the impedances of the section's cells; see :class:`SideForce`."""
        self._dashpot.assemble(self._C, normal, tangential)

    def add_force(self, line: int, side: int, nodal: PETSc.Vec) -> None:
        """Add the nodal forces f + s C w of a right-hand side at a line; see :class:`SideForce`."""
        s = complex(self._excitation.s[line])
        terms = [(self._C, s)]
        for part in self._solved.material.parts:
            factor = part.function(s) + s * self._viscous(part)
            terms.append((self._P[part.name], factor))
        self._add_products(terms, self._motion[:, :, side, line], nodal)
        if side == len(self._excitation.axes):
            for tau, force in self._carried:
                nodal.axpy(complex(fading(tau, np.array(s))), force)

    def add_start(self, derivative: int, nodal: PETSc.Vec) -> None:
        """Add the nodal forces at the start of the lapse, or their rate; see :class:`SideForce`."""
        law = self._solved.material
        matrices = [(self._C, 1.0 + 0j)]
        matrices += [(self._P[part.name], self._viscous(part) + 0j) for part in law.parts]
        for tau, force in self._carried:
            nodal.axpy(1.0 if derivative == 0 else (-1 / tau if tau else 0.0), force)
        response = self._solved.response
        moving = self._force_of(matrices, response.unknowns_at(0.0, derivative + 1))
        nodal.axpy(1.0, moving)
        moving.destroy()
        if derivative:
            stiff = [(self._P[part.name], part.instantaneous + 0j) for part in law.parts]
            pulled = self._force_of(stiff, response.unknowns_at(0.0, 1))
            nodal.axpy(1.0, pulled)
            pulled.destroy()

    def _viscous(self, part: Part) -> float:
        """β of a part of K, at the frequency at which the modulus is G."""
        rayleigh = self._scene.effects.rayleigh
        return 0.0 if rayleigh is None else rayleigh.beta * self._equations.share_at_reference(part)


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
    still = {
        "convection": False,
        "geometric_stiffness": False,
        "gravity": None,
        "sliding": None,
        "softening": False,
        "calm": None,
        "degradation": None,
    }
    return replace(
        scene,
        boundary=Boundary(kinds, scene.boundary.rock),
        effects=scene.effects.model_copy(update=still),
        mesh=scene.mesh.model_copy(update={"points_per_cell": None}),
    )
