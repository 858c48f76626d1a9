# SPDX-License-Identifier: MIT
"""The energy ledger of a lapse that hands over: elastic, viscous or Maxwell ground, and what slips.

With a mechanism that slips the ground moves with ẇ + φλ̇. Gravity brings, and the mechanism takes,
what together is Q_y λ; stress is that of w.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fenics_hytf.domain import Domain
from fenics_hytf.lapse.carried import FADING, State
from fenics_hytf.lapse.course import Course
from fenics_hytf.lapse.energy import Energy
from fenics_hytf.lapse.equations import Equations, LapseEquations
from fenics_hytf.lapse.material import Material, Part
from fenics_hytf.lapse.response import Response
from fenics_hytf.lapse.slipped import Slipped
from fenics_hytf.lapse.starts import product
from fenics_hytf.operators import InternalForce, isotropic_stress
from fenics_hytf.soil import RELAXATION_TIMES

RealArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class LapseForces:
    """What acts in a lapse.

    Attributes:
        internal: Integrates stress.
        parts: f of each part of the law, as the lapse begins.
        rest: f_q of the stress that fades.
        imbalance: What static stress leaves of the weight, or ``None``.
        motion: Base acceleration at the samples and the one after them [m/s^2].
    """

    internal: InternalForce
    parts: list[PETSc.Vec]
    rest: PETSc.Vec
    imbalance: PETSc.Vec | None
    motion: RealArray


def handover_energy(
    forces: LapseForces,
    domain: Domain,
    equations: Equations,
    solved: LapseEquations,
    state: State,
    response: Response,
    material: Material,
    stored_before: float | None,
    slip: Slipped | None,
) -> Energy:
    """Draw up the ledger (collective).

    Args:
        forces: What acts.
        domain: The domain.
        equations: Makes the equations.
        solved: Those of the lapse.
        state: What is carried into it, at the Gauss points.
        response: The response w.
        material: The law of every cell.
        stored_before: Energy stored at the end of the lapse before [J], ``None`` at the start.
        slip: What slips, or ``None``.

    Returns:
        The ledger.
    """
    stock = _Stock(forces.internal, domain, state, material)
    course = Course(response, domain.comm)
    v = course.coordinates(1)
    motion = forces.motion[:, : len(course.time)]
    power, lost = np.zeros((2, len(course.time)))
    if forces.imbalance is not None:
        power += course.linear(forces.imbalance, v)
    for acceleration, inertia in zip(motion, equations.inertia.forces, strict=True):
        power += acceleration * course.linear(inertia, v)
    for C in solved.viscous:
        lost += course.quadratic(C, v)
    faded = 0.0  # of memories, which may fade sooner than from one sample to the next
    # Matrices of the parts come first among the stiff ones.
    own, others = solved.stiff[: len(material.parts)], solved.stiff[len(material.parts) :]
    for part, force, (matrix, _) in zip(material.parts, forces.parts, own, strict=True):
        tau = part.relaxation_time
        if tau is not None:  # ζ = ζ₀ e^{−t/τ} + what the lapse adds
            z = course.coordinates(relaxation_time=tau)
            lost += course.quadratic(matrix, z) / tau
            faded += 2 / tau * course.integral(course.linear(force, z), tau)
            left = np.exp(-2 * course.time[-1] / tau)
            faded += stock.elastic(state, only=part) * (1 - left)
    released = np.exp(-course.time / FADING) * course.linear(forces.rest, v)
    kinetic = 0.5 * course.quadratic(solved.system.mass, v)
    if slip is not None:
        power, lost, kinetic = _with_slip(
            slip, course, v, equations, solved, motion, (power, lost, kinetic)
        )
    increment = course.coordinates()[:, -1:]
    strain = [stock.elastic(state), stock.elastic(stock.at_end(response, equations))]
    strain[1] += sum(0.5 * float(course.quadratic(K, increment)[0]) for K, _ in others)
    stored = float(kinetic[0]) + strain[0]
    return Energy(
        input=course.integral(power),
        damping=course.integral(lost) + float(faded),
        rest=course.integral(released),
        kinetic=(float(kinetic[0]), float(kinetic[-1])),
        strain=(strain[0], strain[1]),
        seam=0.0 if stored_before is None else stored - stored_before,
        slip=0.0 if slip is None else slip.yield_force * slip.total,
    )


def _with_slip(
    slip: Slipped,
    course: Course,
    v: RealArray,
    equations: Equations,
    solved: LapseEquations,
    motion: RealArray,
    of_w: tuple[RealArray, RealArray, RealArray],
) -> tuple[RealArray, RealArray, RealArray]:
    """Power, loss and kinetic energy with what slips besides w."""
    power, lost, kinetic = of_w
    rate = slip.history.rate[:: slip.substeps]
    like = equations.inertia.forces[0]
    phi = like.duplicate()
    phi.array[:] = slip.unknowns
    M_phi = product([(equations.mass, 1.0)], slip.unknowns, like=like)
    drag = product(solved.drag, slip.unknowns, like=like)
    for acceleration, inertia in zip(motion, equations.inertia.forces, strict=True):
        power = power + acceleration * rate * float(phi.dot(inertia).real)
    lost = lost + 2 * rate * course.linear(drag, v) + rate**2 * float(phi.dot(drag).real)
    kinetic = kinetic + rate * course.linear(M_phi, v) + 0.5 * rate**2 * slip.modal_mass
    for vector in (phi, M_phi, drag):
        vector.destroy()
    return power, lost, kinetic


@dataclass(frozen=True)
class _Stock:
    """Energy in the springs of a law."""

    force: InternalForce
    domain: Domain
    state: State
    material: Material

    def at_end(self, response: Response, equations: Equations) -> State:
        """Strain and memory at the Gauss points at the end of the lapse."""
        end, state = response.excitation.duration, self.state

        def added(relaxation_time: float | None = None) -> RealArray:
            unknowns = response.unknowns_at(end, relaxation_time=relaxation_time)
            return self.force.strain(equations.unknowns.expand(unknowns))

        memory = state.memory
        if memory is not None:
            memory = np.stack(
                [
                    memory[:, branch] * np.exp(-end / tau) + added(tau)
                    for branch, tau in enumerate(RELAXATION_TIMES)
                ],
                axis=1,
            )
        return State(state.displacement, state.strain + added(), state.stress, memory)

    def elastic(self, state: State, only: Part | None = None) -> float:
        """½ ∫ strain:D:strain of the parts of the law, or of one of them (collective)."""
        cells = self.domain.input_cells[self.force.sites.cell]
        total = 0.0
        for part in self.material.parts if only is None else (only,):
            strain = state.strain_of(part)
            density = np.sum(strain * isotropic_stress(strain, *part.constants.at(cells)), axis=1)
            total += 0.5 * float(self.force.volume @ density)
        return float(self.domain.comm.allreduce(total))
