# SPDX-License-Identifier: MIT
"""A mechanism that slips within a lapse, coupled with the vibration.

The motion is u = w + λ(t) φ, with φ the mechanism and λφ plastic, so that all stress is in w:

    M ẅ + C ẇ + K* w = M (r a − φ λ̈) − C φ λ̇

The force that drives the mechanism is Q(t) = Q_lin(t) − (P * λ̈)(t),

    Q_lin = φᵀ(M r a − M ẅ₀ − C ẇ₀) − φᵀCφ λ̇₀,    P(s) = (φᵀb − bᵀA⁻¹b)/s²,   b = (s²M + sC)φ

with w₀ the response without slip in this lapse, and λ̇₀ the rate that it begins with, whose constant
load −Cφ λ̇₀ is among what w₀ answers to. The mechanism slips whenever Q would exceed
Q_y = φᵀM r g k_y. The kernel P comes by convolution quadrature from a sweep over few of its lines,
and the part of w that slip excites, −A⁻¹(M φ + C φ/s) λ̈(s), from one over the lines of the lapse,
which begins with the directions of the other. Of C only dashpots and the part that goes with the
mass are felt by slip; what goes with the stiffness is stress, and that is w's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy import fft

from fenics_hytf.frequency import AffineLoads, Columns, JoinedSweep, Sweep
from fenics_hytf.lapse.continuity import Solve
from fenics_hytf.lapse.equations import LapseEquations
from fenics_hytf.lapse.errors import SlipMarchError
from fenics_hytf.lapse.excitation import Excitation
from fenics_hytf.lapse.mechanism import Mechanism
from fenics_hytf.lapse.response import Response
from fenics_hytf.lapse.slipped import Slipped, SlipState
from fenics_hytf.lapse.starts import product
from fenics_hytf.motion import (
    ConvolutionQuadrature,
    SlipError,
    SlipHistory,
    from_few,
    march,
    rigid_slip,
)

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

# Sweeps equations for right-hand sides at other complex frequencies, to a relative residual.
Kernel = Callable[[AffineLoads, ComplexArray, float], Sweep]

# Residual of the kernel's sweep. The error of P is of the second order in it, 1e-11, and between
# samples P is right to some 1e-11 as well; the quadrature makes up to ten thousand times as much of
# them at its last weights, which next to no slip meets. Slip was off by 4e-10 in all, and 1e-9
# between numbers of groups that share out the sweep (with 1e-5 it was 5e-9).
_KERNEL = 3e-6
_ROLL_OFF = 0.5  # of the highest line, from where on less and less of λ̈ excites vibration
_LEAST = 4  # samples of a lapse, however fast it slips


class LapseSlip:
    """A lapse without slip, and the mechanism in it.

    Args:
        mechanism: φ and k_y.
        unknowns: φ on this rank's unknowns.
        state: What the lapse begins with.
        response: The response without slip.
        equations: The equations it was solved with.
        inertia: −TᵀM r of each motion.
        motion: Base acceleration of each motion from the start of the lapse to its end [m/s^2],
            shape ``(num_motions, num_samples·substeps + 1)``, of the number of substeps.
        yield_acceleration: g k_y [m/s^2].
        time_step: The longest step of the march [s].

    A context manager: it owns some vectors.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        unknowns: RealArray,
        state: SlipState,
        response: Response,
        equations: LapseEquations,
        inertia: Sequence[PETSc.Vec],
        motion: Callable[[int], RealArray],
        yield_acceleration: float,
        time_step: float,
    ) -> None:
        self._mechanism, self._unknowns, self._state = mechanism, unknowns, state
        self._response, self._equations = response, equations
        self._yield_acceleration = yield_acceleration
        given = response.excitation
        self._substeps = max(1, int(np.ceil(given.dt / time_step - 1e-9)))
        self._time_step = given.dt / self._substeps
        like = inertia[0]
        self._M_phi = product([(equations.system.mass, 1.0)], unknowns, like=like)
        self._C_phi = product(equations.drag, unknowns, like=like)
        self._phi = like.duplicate()
        self._phi.array[:] = unknowns
        self._masses = [-float(self._phi.dot(force).real) for force in inertia]
        self._modal_mass = float(self._phi.dot(self._M_phi).real)
        self._modal_damping = float(self._phi.dot(self._C_phi).real)
        number = given.axes.index(state.axis)
        self._mass = state.sense * self._masses[number]
        self._motion = motion(self._substeps)
        self._drive = -state.sense * self._motion[number]
        self._driving = self._linear_force()

    def __enter__(self) -> LapseSlip:
        return self

    def __exit__(self, *error: object) -> None:
        for vector in (self._phi, self._M_phi, self._C_phi):
            vector.destroy()

    @property
    def _yield_force(self) -> float:
        return self._mass * self._yield_acceleration

    def _linear_force(self) -> RealArray:
        """Q_lin at the steps of the march, the end of the lapse included."""
        response = self._response
        rows = _functionals(self._M_phi, self._C_phi)
        comm = self._phi.comm.tompi4py()
        seen = response.spectra(rows).summed(comm)
        rows.destroy()
        acceleration = response.between(seen[:1], 2, self._substeps)[0]
        velocity = response.between(seen[1:], 1, self._substeps)[0]
        force = -acceleration - velocity - self._modal_damping * self._state.rate
        for mass, motion in zip(self._masses, self._motion, strict=True):
            force -= mass * motion
        return np.asarray(force)

    def march(self, kernel: Kernel, most_slip: float | None) -> Slipped:
        """Let it slip.

        Args:
            kernel: Sweeps the equations at other complex frequencies.
            most_slip: Slip after which a new mechanism is due [m], or ``None``.

        Returns:
            What slipped, of a lapse that ends where a new mechanism is due.

        Raises:
            SlipMarchError: The march has failed; on every rank.
        """
        state, steps = self._state, len(self._driving)
        if state.rate == 0 and self._driving.max() <= self._yield_force:
            nought = np.zeros(steps)
            history = SlipHistory(nought, nought, nought)
        else:
            quadrature = ConvolutionQuadrature(steps, self._time_step)
            weights = quadrature.weights(self._kernel(kernel, quadrature.s))
            arguments = self._driving, self._yield_force, weights, self._time_step, state.rate
            try:
                history = march(*arguments, most_slip)
                if history.num_steps <= _LEAST * self._substeps:
                    history = march(*arguments, None)
                    history = _first(history, _LEAST * self._substeps + 1)
            except (SlipError, ValueError) as error:  # such as weights of no passive ground
                raise SlipMarchError(str(error)) from error
            # A difference of λ there has half of the first α in it, and is no rate of the lapse.
            history.rate[0] = state.rate
        count = (history.num_steps - 1) // self._substeps
        last = count * self._substeps + 1
        return self._slipped(_first(history, last), count)

    def _kernel(self, kernel: Kernel, s: ComplexArray) -> ComplexArray:
        """P at complex frequencies."""
        rows = _functionals(self._M_phi, self._C_phi)

        def at(lines: npt.NDArray[np.intp]) -> ComplexArray:
            some = s[lines]
            sweep = kernel(self._loads(some**2, some), some, _KERNEL)
            seen = self._phi.comm.tompi4py().allreduce(sweep.project(rows)[:, 0])
            own = some**2 * self._modal_mass + some * self._modal_damping
            return np.asarray((own - some**2 * seen[0] - some * seen[1]) / some**2)

        found = from_few(at, s)
        rows.destroy()
        return found

    def _loads(self, mass: ComplexArray, damping: ComplexArray) -> AffineLoads:
        """M φ and C φ with factors of each line."""
        return AffineLoads([self._M_phi, self._C_phi], np.stack([mass, damping])[:, None])

    def _slipped(self, history: SlipHistory, count: int) -> Slipped:
        state, steps = self._state, history.num_steps
        driving = np.asarray(self._driving[:steps] / self._mass)
        blocks = [
            rigid_slip(drive, self._yield_acceleration, self._time_step, rate)
            for drive, rate in (
                (self._drive[:steps], state.rigid_rate),
                (driving, state.decoupled_rate),
            )
        ]
        # Blocks move along the shaking, λ along the mechanism: m_φ λ̈ = L (a − g k_y).
        share = self._mass / self._modal_mass
        after = replace(
            state,
            rate=float(history.rate[-1]),
            rigid_rate=float(blocks[0].rate[-1]),
            decoupled_rate=float(blocks[1].rate[-1]),
        )
        return Slipped(
            mechanism=self._mechanism,
            unknowns=self._unknowns,
            before=state,
            after=after,
            history=history,
            time_step=self._time_step,
            substeps=self._substeps,
            driving=driving,
            num_samples=count,
            mass=self._mass,
            modal_mass=self._modal_mass,
            rigid=float(share * blocks[0].slip[-1]),
            decoupled=float(share * blocks[1].slip[-1]),
            yield_force=self._yield_force,
        )

    def excited(
        self,
        slipped: Slipped,
        solve: Solve,
        start: Callable[[PETSc.Vec, PETSc.Vec], Columns],
    ) -> Response:
        """The response with the part of it that slip excites, up to the end of the lapse.

        Args:
            slipped: What slipped.
            solve: Sweeps the equations over the lines of the lapse.
            start: Makes coefficients of the start functions from a force at the start of the lapse
                and its rate.

        Returns:
            The response.
        """
        given = self._response.excitation.shortened(slipped.num_samples)
        if not np.any(slipped.history.acceleration):
            return replace(self._response, excitation=given)
        s = given.s
        sweep = solve(self._loads(np.ones_like(s), 1 / s))
        weights = -_transformed(slipped, given)
        columns = self._response.start
        jump = 2 * slipped.history.acceleration[0]
        if jump:
            force, rate = self._M_phi.copy(), self._C_phi.copy()
            force.scale(-jump)
            rate.scale(-jump)
            columns = _sum(columns, start(force, rate))
            force.destroy()
            rate.destroy()
        return replace(
            self._response,
            sweep=JoinedSweep(self._response.sweep, sweep),
            excitation=replace(given, weights=np.concatenate([given.weights, weights[None]])),
            start=columns,
        )


def _first(history: SlipHistory, steps: int) -> SlipHistory:
    """The first steps of a march."""
    return SlipHistory(history.slip[:steps], history.rate[:steps], history.acceleration[:steps])


def _transformed(slipped: Slipped, given: Excitation) -> ComplexArray:
    """λ̈(s)/dt on the lines of a lapse; beyond its end λ̈ fades, not to be felt as an end."""
    acceleration, substeps = slipped.history.acceleration, slipped.substeps
    over = len(acceleration) // 2
    fade = np.cos(0.5 * np.pi * (np.arange(over) + 0.5) / max(over, 1)) ** 2
    samples = np.concatenate([acceleration, acceleration[-1] * fade])
    samples *= np.exp(-given.eta * slipped.time_step * np.arange(len(samples)))
    found = fft.rfft(samples, given.period * substeps)[given.lines] / substeps
    # What begins and ends at once would ring at the highest line, over the seam.
    above = given.omega / given.omega.max() - _ROLL_OFF
    roll = np.cos(0.5 * np.pi * np.maximum(above, 0.0) / (1 - _ROLL_OFF)) ** 2
    return np.asarray(found * roll)


def _functionals(*vectors: PETSc.Vec) -> PETSc.Mat:
    """Products with vectors as rows of a matrix, each rank's share; the caller destroys it."""
    count, local = len(vectors), vectors[0].getLocalSize()
    first, _ = vectors[0].getOwnershipRange()
    columns = np.tile(np.arange(first, first + local, dtype=PETSc.IntType), count)
    start = local * np.arange(count + 1, dtype=PETSc.IntType)
    rows = PETSc.Mat().createAIJ(
        ((count, None), (local, None)),
        csr=(start, columns, np.concatenate([v.array_r for v in vectors])),
        comm=vectors[0].comm,
    )
    rows.assemble()
    return rows


def _sum(columns: Columns | None, more: Columns) -> Columns:
    """Coefficients of start functions, together."""
    if columns is None:
        return more
    total = Columns(columns.num_rows, width=columns.size)
    total.append(columns.blocks[0] + more.blocks[0])
    return total
