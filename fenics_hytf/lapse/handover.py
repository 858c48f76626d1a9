# SPDX-License-Identifier: MIT
"""Transient continuity under a causal law: what ends one lapse begins the next, exactly.

Points carry over a seam their displacement and velocity, the strain γ, a memory strain ζ_m for each
Maxwell branch and the dynamic stress σ. On the damped contour the increment ΔU of a lapse obeys

    A(s) ΔU = −M r â_g + M v₀ − f_r/s − Σ_m f_m τ_m/(1 + sτ_m) − f_q τ_q/(1 + sτ_q)

with f_r = ∫Bᵀ D_r γ, f_m = ∫Bᵀ D_m ζ_m, M v₀ = SᵀM_p v_p. Where the moduli change at a seam the
stress goes on and does not jump: what the new moduli make of strain and memory leaves a rest,

    σ_q = σ − D_r γ − Σ_m D_m ζ_m,    f_q = ∫Bᵀ σ_q,

which fades with τ_q. At the end of the lapse

    γ += Δγ,   ζ_m ← ζ_m e^{−T/τ_m} + L⁻¹[κ_m ΔΓ](T),   σ = D_r γ + Σ_m D_m ζ_m + σ_q e^{−T/τ_q}

Elastic and viscous ground is the case without branches.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import AffineLoads, Columns
from fenics_hytf.lapse.carried import FADING, State, fading, half_of_normal, stress_of
from fenics_hytf.lapse.cells import CarriedCells
from fenics_hytf.lapse.continuity import Solve, jump_at_start
from fenics_hytf.lapse.energy import Energy
from fenics_hytf.lapse.equations import Equations, LapseEquations
from fenics_hytf.lapse.excitation import Excitation
from fenics_hytf.lapse.handover_energy import LapseForces, handover_energy
from fenics_hytf.lapse.material import Material
from fenics_hytf.lapse.response import Response
from fenics_hytf.lapse.scheme import Scheme
from fenics_hytf.lapse.slipped import Slipped
from fenics_hytf.lapse.starts import product, start_accelerations, start_columns
from fenics_hytf.lapse.statics import Statics
from fenics_hytf.motion import (
    LapseRecord,
    Segment,
    StartFunctions,
    band_limited,
)
from fenics_hytf.operators import InternalForce, isotropic_stress
from fenics_hytf.particles import (
    Points,
    cell_centres,
    resample_matrix,
    transfer_matrix,
)
from fenics_hytf.scene import Scene
from fenics_hytf.soil import RELAXATION_TIMES

RealArray = npt.NDArray[np.float64]


class Handover:
    """Hands displacement, velocity, stress and memory from lapse to lapse.

    Args:
        scene: The scene.
        domain: The domain.
        equations: Its equations.
        scheme: Its contour, and what points carry.
        statics: Static stress and weight: once points have moved, what is out of balance acts on
            the ground, (f_g − ∫Bᵀσ_static)/s on the right-hand side. ``None`` without gravity.
        after: Samples after the motion that lapses may reach.
    """

    goes_on_from_nought = True

    def __init__(
        self,
        scene: Scene,
        domain: Domain,
        equations: Equations,
        scheme: Scheme,
        statics: Statics | None,
        after: int,
    ) -> None:
        self._scene, self._domain, self._equations = scene, domain, equations
        motion = band_limited(scene.base_acceleration, scene.dt, scene.solver.max_frequency)
        self._record = LapseRecord(np.pad(motion, ((0, 0), (0, after))), scene.dt)
        assert scheme.contour is not None
        self._contour = scheme.contour
        rates = (*(1 / tau for tau in RELAXATION_TIMES), 1 / FADING)
        limit = scene.solver.max_frequency
        self._start = StartFunctions.fading_in(self._contour, limit, rates)
        self.fields = scheme.carried(domain.num_components)
        self._force = InternalForce(domain, scene.effects.locking)
        self._centres = cell_centres(domain.mesh, 0, domain.num_owned_cells)
        self._resampling: list[sparse.csr_matrix] = []
        self._excitation: Excitation
        self._segment: Segment
        self._at_gauss: State
        self._at_centres: State
        self._momentum: PETSc.Vec | None = None
        self._velocity: RealArray
        self._statics = statics if scene.effects.convection else None
        self._imbalance: PETSc.Vec | None = None
        self._slipping: tuple[RealArray, float] | None = None  # φ on the unknowns, and λ̇₀
        self._solved: LapseEquations

    def excite(self, segment: Segment) -> Excitation:
        """Every line of the contour up to the maximum frequency."""
        self._segment = segment
        return Excitation.on_contour(
            self._contour,
            self._scene.solver.max_frequency,
            weights=self._record.weights(self._contour, segment.start, segment.num_samples),
            axes=self._equations.axes,
            segment=segment,
            motion=self._record.samples,
            start=self._start,
        )

    def slip_on(self, mechanism: RealArray, rate: float) -> None:
        """Take note of what slips as the lapse begins: its dashpots pull at the ground, −Cφ λ̇₀/s.

        Args:
            mechanism: φ on this rank's unknowns, shape ``(num_local_unknowns,)``.
            rate: λ̇₀ [m/s].
        """
        self._slipping = mechanism, rate

    def begin(self, points: Points, excitation: Excitation) -> None:
        """Read what the points carry, at the Gauss points and in the middle of cells."""
        self._excitation = excitation
        if not self._resampling or self._scene.effects.convection:  # else points stay in place
            mesh, degree = self._domain.mesh, self._domain.V.ufl_element().degree
            if self._equations.filling is not None:
                self._equations.filling.integrate(self._force, self._domain, points)
            centres = resample_matrix(mesh, points, degree, self._centres)
            self._resampling = [self._force.resampling(points), centres]
        self._at_gauss, self._at_centres = (State.of(points, R) for R in self._resampling)
        self.destroy()
        found = self._equations.momentum(points, points["dynamic_velocity"])
        # The momentum of the nodes' velocity: that of the points but for what no node can have.
        self._velocity = self._equations.inertia.accelerate(found)
        self._momentum = product([(self._equations.mass, 1.0)], self._velocity, like=found)
        found.destroy()
        if self._statics is not None and self._segment.index:
            left = self._statics.imbalance(points)
            self._imbalance = self._equations.unknowns.collect(left)

    def respond(self, solve: Solve, equations: LapseEquations, material: Material) -> Response:
        """The increment of the lapse, and its start."""
        self._solved = equations
        self._constant = self._constant_force(equations)
        forces = self._forces(material)
        # Weight and the springs that bear it cancel as the ground comes to rest: they act as one.
        lasting = forces[0].copy()
        if self._constant is not None:
            lasting.axpy(-1.0, self._constant)
        if self._excitation.carries:
            loads = self._loads(material, [lasting, *forces[1:]])
            sweep = solve(self._equations.sides.loads(loads, self._equations.T))
        else:
            sweep = solve(equations.loads)
        start = self._starts(equations, material, forces)
        for force in [lasting, *forces, *([] if self._constant is None else [self._constant])]:
            force.destroy()
        return Response(sweep, self._excitation, start, start_factorisations=1)

    def _constant_force(self, equations: LapseEquations) -> PETSc.Vec | None:
        """What acts throughout the lapse, or ``None`` if nothing does."""
        force = None if self._imbalance is None else self._imbalance.copy()
        if self._slipping is not None and self._slipping[1] and equations.drag:
            phi, rate = self._slipping
            assert self._momentum is not None
            factors = [(C, -rate * factor) for C, factor in equations.drag]
            drag = product(factors, phi, like=self._momentum)
            if force is None:
                return drag
            force.axpy(1.0, drag)
            drag.destroy()
        return force

    def _forces(self, material: Material) -> list[PETSc.Vec]:
        """Forces of what is carried: f of each part of the law, and f_q."""
        state, cells = self._at_gauss, self._domain.input_cells[self._force.sites.cell]
        rest = self._equations.unknowns.collect(self._force(state.stress))
        forces = []
        for part in material.parts:
            stress = isotropic_stress(state.strain_of(part), *part.constants.at(cells))
            forces.append(self._equations.unknowns.collect(self._force(stress)))
            rest.axpy(-1.0, forces[-1])
        return [*forces, rest]

    def _loads(self, material: Material, forces: list[PETSc.Vec]) -> AffineLoads:
        """Right-hand sides: a unit of each motion, and what is carried over or acts all along."""
        s, inertia = self._excitation.s, self._equations.inertia.forces
        assert self._momentum is not None
        fades = [-fading(part.relaxation_time, s) for part in material.parts]
        carried = [np.ones_like(s), *fades, -fading(FADING, s)]
        vectors = [self._momentum, *forces]
        num_motions = len(inertia)
        shape = (num_motions + len(carried), num_motions + 1, len(s))
        coefficients = np.zeros(shape, np.complex128)
        coefficients[range(num_motions), range(num_motions)] = 1.0
        coefficients[num_motions:, -1] = carried
        return AffineLoads([*inertia, *vectors], coefficients)

    def _starts(
        self, equations: LapseEquations, material: Material, forces: list[PETSc.Vec]
    ) -> Columns:
        """Coefficients of the start functions, from velocity, acceleration and its rate."""
        motion = self._record.derivatives[:, :, self._segment.start]
        viscous = [(C, 1.0) for C in equations.viscous]
        taus = [*(part.relaxation_time for part in material.parts), FADING]
        rates = [-1 / tau if tau else 0.0 for tau in taus]
        v = self._velocity
        ones, stiff = [1.0] * len(forces), equations.stiff
        force = self._start_force(0, motion[0], forces, ones, [(viscous, v)])
        rate = self._start_force(1, motion[1], forces, rates, [(stiff, v)])
        columns = self._columns(equations, v, force, rate)
        for vector in (force, rate):
            vector.destroy()
        return columns

    def start_from(self, force: PETSc.Vec, rate: PETSc.Vec) -> Columns:
        """Coefficients of the start functions under a force that is there at once (collective).

        Args:
            force: The force.
            rate: Its rate but for the viscous forces that the acceleration brings.

        Returns:
            The coefficients, from rest.
        """
        return self._columns(self._solved, 0 * force.array_r.real, force, rate)

    def _columns(
        self, equations: LapseEquations, velocity: RealArray, force: PETSc.Vec, rate: PETSc.Vec
    ) -> Columns:
        highest = float(self._excitation.omega.max())
        accelerations = start_accelerations(equations, highest, force, rate)
        return start_columns(self._start, [0 * velocity, velocity, *accelerations])

    @property
    def motion_to_end(self) -> RealArray:
        """Base acceleration at the samples of the lapse and the one after them [m/s^2].

        Shape ``(num_motions, num_samples + 1)``.
        """
        given = self._record.samples[:, self._segment.start : self._segment.stop + 1]
        return np.pad(given, ((0, 0), (0, self._segment.num_samples + 1 - given.shape[1])))

    def motion_between(self, substeps: int) -> RealArray:
        """Base acceleration from the start of the lapse to its end, between samples too [m/s^2].

        Args:
            substeps: Steps from one sample to the next.

        Returns:
            Shape ``(num_motions, num_samples·substeps + 1)``.
        """
        return self._record.between(self._segment.start, self._segment.stop, substeps)

    def _start_force(
        self,
        derivative: int,
        motion: RealArray,
        forces: list[PETSc.Vec],
        factors: list[float],
        products: list[tuple[list[tuple[PETSc.Mat, float]], RealArray]],
    ) -> PETSc.Vec:
        """What acts at the start, or its rate, less the carried forces and products of matrices."""
        total = forces[0].duplicate()
        total.zeroEntries()
        self._equations.sides.add_start(derivative, total, self._equations.T)
        if self._constant is not None and derivative == 0:
            total.axpy(1.0, self._constant)
        for inertia, value in zip(self._equations.inertia.forces, motion, strict=True):
            total.axpy(float(value), inertia)
        for force, factor in zip(forces, factors, strict=True):
            total.axpy(-factor, force)
        for matrices, x in products:
            taken = product(matrices, x, like=total)
            total.axpy(-1.0, taken)
            taken.destroy()
        return total

    def carried(self, material: Material) -> CarriedCells | None:
        """Strain and stress in the middle of cells, and how the stress fades."""
        if self._segment.index == 0:
            return None
        state, cells = self._at_centres, self._domain.input_cells[self._centres.cell]
        rest, shares = state.stress.copy(), []
        for part in material.parts:
            strain, constants = state.strain_of(part), part.constants.at(cells)
            shares.append(constants[1][:, None] * strain)
            rest -= isotropic_stress(strain, *constants)
        shares.append(half_of_normal(rest))
        time = self._excitation.dt * np.arange(self._excitation.num_samples)
        taus = [*(part.relaxation_time for part in material.parts), FADING]
        courses = [np.exp(-time / tau) if tau else np.ones_like(time) for tau in taus]
        return CarriedCells(
            state.strain, state.displacement, np.stack(shares, axis=2), np.stack(courses)
        )

    def jump(self, points: Points, response: Response) -> tuple[float, float] | None:
        """Increment and velocity at the start of the lapse, against nought and what was carried."""
        if self._segment.index == 0:
            return None
        return jump_at_start(self._domain, self._equations, points, response, 0.0)

    def energy(
        self,
        response: Response,
        material: Material,
        stored_before: float | None,
        slip: Slipped | None = None,
    ) -> Energy | None:
        """What came in, was lost and is stored; not known beside a free field, which does work."""
        law, sides = self._scene.solver.complex_modulus, self._scene.supports.values()
        causal = law == "maxwell" or len(material.parts) == 1
        if not causal or "free_field" in sides:
            return None
        *forces, rest = self._forces(material)
        try:
            return handover_energy(
                LapseForces(self._force, forces, rest, self._imbalance, self.motion_to_end),
                self._domain,
                self._equations,
                solved=self._solved,
                state=self._at_gauss,
                response=response,
                material=material,
                stored_before=stored_before,
                slip=slip,
            )
        finally:
            for force in (*forces, rest):
                force.destroy()

    def finish(self, points: Points, response: Response, material: Material) -> None:
        """Displacement, velocity, strain, memory and stress at the end of the lapse."""
        V, end = self._domain.V, response.excitation.duration

        def at_end(derivative: int = 0, relaxation_time: float | None = None) -> RealArray:
            unknowns = response.unknowns_at(end, derivative, relaxation_time)
            return self._equations.unknowns.expand(unknowns)

        S = transfer_matrix(points, V)
        B = self._force.strain_rows(points)
        cells = self._domain.input_cells[points.cell]
        # What is left of the rest of stress that the lapse began with.
        stress = points["dynamic_stress"] - stress_of(State.of(points), material, cells)
        stress *= np.exp(-end / FADING)
        increment = at_end()
        points["dynamic_displacement"] = points["dynamic_displacement"] + S @ increment
        points["dynamic_velocity"] = S @ at_end(derivative=1)
        strain = points["dynamic_strain"]
        points["dynamic_strain"] = strain + (B @ increment.ravel()).reshape(strain.shape)
        if "memory_strain" in self.fields:
            memory = points["memory_strain"]
            for branch, tau in enumerate(RELAXATION_TIMES):
                remembered = (B @ at_end(relaxation_time=tau).ravel()).reshape(strain.shape)
                memory[:, branch] = memory[:, branch] * np.exp(-end / tau) + remembered
        points["dynamic_stress"] = stress + stress_of(State.of(points), material, cells)

    def destroy(self) -> None:
        """Destroy what the lapse began with."""
        for vector in (self._momentum, self._imbalance):
            if vector is not None:
                vector.destroy()
        self._momentum = self._imbalance = None
