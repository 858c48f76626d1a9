# SPDX-License-Identifier: MIT
"""The equations of one lapse, M ü + K* u = −M r ü_b (1)–(4), on the unknowns q of u = T q.

u is relative to the motion that is given: that of a rigid base, or the outcrop motion of the rock
below a compliant one. Seen from there the rock brings no force but that of its dashpots ρV* at the
base, and the right-hand side is the same in both cases: with u_o = r a_o/s² subtracted from the
total motion, s C r u_o of the incoming wave leaves with s C u of the dashpots (Lysmer and
Kuhlemeyer 1969; Joyner and Chen 1975), and K r = 0. Dashpots of sides and the mass term of Rayleigh
damping act on u, the motion relative to the input, as well.

Matrices and forms are made once a run and refilled; what the scene does not call for is not made.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import (
    DynamicSystem,
    Loads,
    ScalarFunction,
    constant,
    radiation,
)
from fenics_hytf.lapse.filling import Filling, assemble_stiffness
from fenics_hytf.lapse.ground import Ground
from fenics_hytf.lapse.inertia import Inertia
from fenics_hytf.lapse.material import ElasticConstants, Material, Part, rock_factors
from fenics_hytf.lapse.sides import SideForce, Sides
from fenics_hytf.lapse.unknowns import Unknowns
from fenics_hytf.operators import (
    DashpotForm,
    ElasticForm,
    GeometricForm,
    GhostForm,
    InternalForce,
    assemble_mass,
    rayleigh_damping,
)
from fenics_hytf.particles import Points, particle_mass_matrix, transfer_matrix
from fenics_hytf.scene import Scene

RealArray = npt.NDArray[np.float64]

_PRODUCT = "matptap_via"  # how PETSc multiplies TᵀAT


@dataclass(frozen=True)
class LapseEquations:
    """A system and its right-hand sides, borrowed from :class:`Equations` until the next call.

    Attributes:
        system: A(s) of the lapse.
        loads: −TᵀM r of each motion [kg, in 2D kg/m], with what comes from beyond the sides.
        viscous: What is multiplied by the velocity: C and the dashpots of a base.
        drag: Matrices and factors of that which resists a mechanism as well, dashpots and αM: where
            it slips βK, like K, feels the elastic strain alone.
        stiff: What is multiplied by the displacement, parts of the law first and in their order,
            and the share of each that a sudden displacement meets.
        lasting: The same with the shares that hold in the long run, where the modulus is G; and the
            springs that the rock below a compliant base is at rest.
    """

    system: DynamicSystem
    loads: Sequence[PETSc.Vec] | Loads
    viscous: list[PETSc.Mat]
    drag: list[tuple[PETSc.Mat, float]]
    stiff: list[tuple[PETSc.Mat, float]]
    lasting: list[tuple[PETSc.Mat, float]]


class Equations:
    """Makes the matrices of each lapse.

    Args:
        scene: The scene: boundaries, effects, directions of the motions.
        domain: The domain.
        assemblies: Counts assemblies by the name of the form.
        side_forces: Of the sides with free field.

    Attributes:
        axes: Component in which each motion acts.
        unknowns: The unknowns; others once other cells are filled.
        inertia: M r of the motions, and M⁻¹.
        sides: What comes from beyond the sides.
        base_is_held: Whether the base is not compliant.
        filling: How far cells are filled, or ``None`` where every one is.
    """

    def __init__(
        self,
        scene: Scene,
        domain: Domain,
        assemblies: Counter[str],
        side_forces: Sequence[SideForce] = (),
    ) -> None:
        self._domain = domain
        self._scene = scene
        self._assemblies = assemblies
        self._elastic = ElasticForm(domain, scene.effects.locking)
        self._geometric = GeometricForm(domain) if scene.effects.geometric_stiffness else None
        self.axes = tuple(map(domain.components.index, scene.directions))
        supports = scene.supports
        self.unknowns = Unknowns(domain, supports, self.axes)
        sides = [name for name, kind in supports.items() if kind in ("dashpot", "free_field")]
        self._dashpots = DashpotForm(domain, sides) if sides else None
        self.sides = Sides(side_forces)
        self.base_is_held = supports.get("base") != "compliant"
        self._K = self._elastic.create_matrix()
        self.filling: Filling | None = None
        self._at_points: InternalForce | None = None  # cells that are filled in part
        self._ghost: GhostForm | None = None
        # On the unknowns: mass, stiffness and damping by name, made when first needed.
        self._constrained: dict[str, PETSc.Mat] = {}
        self._radiating: list[tuple[PETSc.Mat, ScalarFunction]] = []
        self.inertia = Inertia(self.axes, domain.num_components)

    @property
    def across(self) -> MPI.Comm:
        """Communicator of the ranks that hold the same part of the equations."""
        return self._domain.across

    @property
    def gdim(self) -> int:
        """Space dimension."""
        return self._domain.gdim

    @property
    def T(self) -> PETSc.Mat:
        """Constraint matrix, borrowed until other cells are filled."""
        return self.unknowns.T

    @property
    def mass(self) -> PETSc.Mat:
        """TᵀMT [kg], borrowed until the points are weighed again."""
        return self._constrained["mass"]

    @property
    def num_unknowns(self) -> int:
        """Unknowns of all ranks."""
        return len(self.unknowns)

    def destroy(self) -> None:
        """Destroy all PETSc objects."""
        self._clear()
        self.unknowns.destroy()
        self._K.destroy()

    def _clear(self) -> None:
        """Destroy what is on the unknowns as they are."""
        for owned in (*self._constrained.values(), self.inertia):
            owned.destroy()
        self._constrained, self._radiating = {}, []

    def occupy(self, filling: Filling) -> bool:
        """Take note of which cells are filled, and how far (collective).

        Args:
            filling: The filling; the points are to be weighed after it.

        Returns:
            Whether the unknowns are others than before.
        """
        before, self.filling = self.filling, filling
        if before is not None and filling.same_cells(before):
            if self._ghost is not None:
                filling.loosen(self._ghost, self._domain)
            return False
        self._clear()
        self.unknowns.destroy()
        self._K.destroy()
        domain = self._domain
        bare = filling.bare_nodes(domain)
        self.unknowns = Unknowns(domain, self._scene.supports, self.axes, bare)
        self._ghost = filling.ghost(domain)
        self._K = (self._ghost or self._elastic).create_matrix()
        return True

    def _weighted(self, *values: RealArray) -> tuple[RealArray, ...]:
        """Values of this rank's cells, ghosts included, by the weight of each cell."""
        if self.filling is None:
            return values
        weight = self.filling.weight[self._domain.input_cells]
        return tuple(weight.reshape(-1, *[1] * (v.ndim - 1)) * v for v in values)

    def weigh(self, points: Points) -> None:
        """Rebuild M = SᵀM_pS (4) and the right-hand sides −TᵀM r from the points.

        Args:
            points: The points where they are now.
        """
        if self.filling is not None:
            if self._at_points is None:
                self._at_points = InternalForce(self._domain, self._scene.effects.locking)
            self.filling.integrate(self._at_points, self._domain, points)
        if "real" not in self._constrained:
            self._pattern()
        nodal = particle_mass_matrix(transfer_matrix(points, self._domain.V), points.mass)
        M = assemble_mass(self._domain, nodal, self._K)
        self._assemblies["mass"] += 1
        held = self._constrain("mass", M)
        if self._ghost is not None:
            held = self._hold_loose(self._ghost, points)
        self.inertia.weigh(M, self.T, held)
        M.destroy()

    def momentum(self, points: Points, motion: RealArray) -> PETSc.Vec:
        """Momentum SᵀM_p v of what points carry, on the unknowns (collective).

        Args:
            points: The points, as they were weighed.
            motion: v of each, or a displacement or mechanism, shape
                ``(len(points), num_components)``.

        Returns:
            Tᵀ SᵀM_p v; the caller destroys it.
        """
        S = transfer_matrix(points, self._domain.V)
        return self.unknowns.collect((S.T @ (points.mass[:, None] * motion)).ravel())

    def field_of(self, points: Points, motion: RealArray) -> RealArray:
        """The nodal field of the same momentum as what points carry (collective).

        Args:
            points: As for :meth:`momentum`.
            motion: As for :meth:`momentum`.

        Returns:
            At this rank's nodes, ghosts included, shape ``(num_local_nodes, num_components)``.
        """
        momentum = self.momentum(points, motion)
        field = self.unknowns.expand(self.inertia.accelerate(momentum))
        momentum.destroy()
        return field

    def _hold_loose(self, ghost: GhostForm, points: Points) -> PETSc.Mat:
        """M and a ghost of its size, for nodes that hardly any point weighs on.

        What points carry is brought to the nodes with it: a point that has just come into a cell
        tells next to nothing of the far nodes, and M alone made a hundred metres a second of that.
        """
        totals = [points.mass.sum(), points.volume.sum()]
        mass, volume = np.sum(self._domain.comm.allgather(totals), axis=0)
        modulus = mass / volume * self._domain.cell_sizes() ** 2
        ghost.assemble(self._K, modulus)
        held = self._constrain("held mass", self._K)
        held.axpy(1.0, self.mass, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        return held

    def _pattern(self) -> None:
        """Give K its pattern, before any value is known, and the base its dashpots."""
        cells = len(self._domain.regions)
        if self._ghost is not None:
            self._ghost.assemble(self._K, np.ones(cells))
        else:
            self._elastic.assemble(self._K, np.ones(cells), np.ones(cells))
        self._constrain("real", self._K)
        if not self.base_is_held:
            self._stand_on_rock(cells)

    def _stand_on_rock(self, cells: int) -> None:
        """Dashpots ρV of the rock, those of P and of S waves apart where they damp otherwise."""
        rock = self._scene.boundary.rock
        assert rock is not None
        across = np.full(cells, rock.density * rock.p_wave_velocity)
        along = np.full(cells, rock.density * rock.shear_wave_velocity)
        pressure, shear = rock_factors(self._scene)
        parts = [(across, along, shear)]
        if pressure != shear:
            parts = [(across, 0 * along, pressure), (0 * across, along, shear)]
        form = DashpotForm(self._domain, ["base"])
        for number, (normal, tangential, factor) in enumerate(parts):
            form.assemble(self._K, *self._weighted(normal, tangential))
            self._assemblies["dashpot"] += 1
            matrix = self._constrain(f"base {number}", self._K)
            self._radiating.append((matrix, radiation(factor)))

    def _constrain(self, name: str, matrix: PETSc.Mat) -> PETSc.Mat:
        """A_q = TᵀAT, into the matrix kept under a name."""
        kept = self._constrained.get(name)
        options = PETSc.Options()
        if kept is None and matrix.comm.size > 1:
            options[_PRODUCT] = "allatonce"  # without the product AT, half of all memory
        self._constrained[name] = matrix.ptap(self.T, result=kept)
        if options.hasName(_PRODUCT):
            options.delValue(_PRODUCT)
        return self._constrained[name]

    def _stiffness(self, part: Part, real: ElasticConstants) -> PETSc.Mat:
        """K of a part of the law, and K_G of loose cells, which so is damped as the ground is."""
        cells = self._domain.input_cells
        lame, shear = part.constants.at(cells)
        assemble_stiffness(
            self._domain, self._K, self._elastic, self._at_points, self.filling, lame, shear
        )
        self._assemblies["elasticity"] += 1
        if self._ghost is not None:
            across = self._domain.num_components == 1
            modulus = real.shear_modulus if across else real.youngs_modulus
            self._ghost.add(self._K, shear * (modulus / real.shear_modulus)[cells])
            self._assemblies["ghost"] += 1
        return self._constrain(part.name, self._K)

    def stiffen(self, stress: RealArray) -> None:
        """Rebuild K_NL, for a scene that calls for geometric stiffness.

        Args:
            stress: Cauchy stress of each local cell [Pa], shape ``(num_local_cells, gdim, gdim)``.
        """
        if self._geometric is not None:
            self._geometric.assemble(self._K, *self._weighted(stress))
            self._assemblies["geometric"] += 1
            self._constrain("geometric", self._K)

    def assemble(self, ground: Ground, material: Material) -> LapseEquations:
        """Assemble A(s) with the moduli of an iteration.

        Args:
            ground: The ground, for its density.
            material: The law of every cell.

        Returns:
            The equations, valid until the next call.
        """
        parts = [(self._stiffness(part, material.real), part) for part in material.parts]
        terms = [(matrix, part.function) for matrix, part in parts]
        stiff = [(matrix, part.instantaneous) for matrix, part in parts]
        lasting = [(matrix, self.share_at_reference(part)) for matrix, part in parts]
        elastic = [self._constrained["geometric"]] if "geometric" in self._constrained else []
        terms += [(matrix, constant) for matrix in elastic]
        stiff += [(matrix, 1.0) for matrix in elastic]
        lasting += [(matrix, 1.0) for matrix in elastic]
        lasting += [(matrix, float(np.real(function(0.0)))) for matrix, function in self._radiating]
        terms += self._radiating
        damping = self._damping(parts, ground, material.real)
        system = DynamicSystem(terms, self._constrained["mass"], damping)
        return LapseEquations(
            system=system,
            loads=self.sides.loads(self.inertia.forces, self.T),
            viscous=[matrix for matrix, _ in self._radiating] + ([damping] if damping else []),
            drag=self._drag(),
            stiff=stiff,
            lasting=lasting,
        )

    def _drag(self) -> list[tuple[PETSc.Mat, float]]:
        drag = [(matrix, 1.0) for matrix, _ in self._radiating]
        if self._dashpots is not None:
            drag.append((self._constrained["dashpot"], 1.0))
        rayleigh = self._scene.effects.rayleigh
        if rayleigh is not None and rayleigh.alpha:
            drag.append((self._constrained["mass"], rayleigh.alpha))
        return drag

    def _damping(
        self, parts: list[tuple[PETSc.Mat, Part]], ground: Ground, constants: ElasticConstants
    ) -> PETSc.Mat | None:
        """C: Rayleigh damping, and the dashpots of the sides with the cells' own moduli."""
        C, rayleigh = None, self._scene.effects.rayleigh
        same = PETSc.Mat.Structure.SAME_NONZERO_PATTERN
        if rayleigh is not None:
            if "rayleigh" in self._constrained:
                self._constrained.pop("rayleigh").destroy()
            C = rayleigh_damping(
                self._constrained["mass"], parts[0][0], rayleigh.alpha, rayleigh.beta
            )
            for matrix, part in parts[1:]:  # βK of K at the frequency at which the modulus is G
                share = self.share_at_reference(part)
                if share:
                    C.axpy(rayleigh.beta * share, matrix, structure=same)
            self._constrained["rayleigh"] = C
            self._assemblies["rayleigh"] += 1
        if self._dashpots is None:
            return C
        lame, shear = constants.at(self._domain.input_cells)
        density = ground.density[self._domain.input_cells]
        impedance = self._weighted(np.sqrt(density * (lame + 2 * shear)), np.sqrt(density * shear))
        self._dashpots.assemble(self._K, *impedance)
        self._assemblies["dashpot"] += 1
        self.sides.fasten(*impedance)
        dashpots = self._constrain("dashpot", self._K)
        if C is None:
            return dashpots
        C.axpy(1.0, dashpots, structure=same)
        return C

    def share_at_reference(self, part: Part) -> float:
        """Real part of a function of s where the modulus is G; nought for hysteretic damping."""
        # Hysteretic laws name no frequency: theirs are the same at all.
        frequency = self._scene.solver.reference_frequency or 1.0
        return float(np.real(part.function(2j * np.pi * frequency)))
