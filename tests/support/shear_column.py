# SPDX-License-Identifier: MIT
"""A shear column in the time domain, against which the transient lapses are held.

Two-node linear elements with consistent mass: a column of quadrilaterals of degree 1 with tied
sides, shaken sideways. Nothing of the package is used here. The equation, of the motion u relative
to the input, is

    M ü + C u̇ + ∫ Bᵀ(σ + σ_q) dy = −M r a,   C = αM + βK, with ρV of the rock at a compliant base

with the stress σ = Gγ, or that of four Maxwell branches,

    σ = G_r (γ + Σ a_m ζ_m),   ζ̇_m = γ̇ − ζ_m/τ_m,   G_r = G/(1 + Σ a_m Re κ_m(iω_ref))

whose weights a_m ≥ 0 make the loss factor 2D from 0.2 to 20 Hz. Where the moduli change, the
displacement, the velocity, the memory ζ_m and the stress stay: σ_q takes up the difference of the
stresses and fades with 0.5 s.

Within a lapse this is a linear system with constant coefficients. It is solved exactly, by a matrix
exponential, for an input that between samples is the band-limited one (a polynomial of degree 8
through nine of its values a step). What is left is the error of those polynomials, near round-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import factorial
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import fft
from scipy.interpolate import make_interp_spline
from scipy.linalg import expm
from scipy.optimize import nnls

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

RELAXATION = np.array([0.95747, 0.16630, 0.036013, 0.0063799])
"""Relaxation times τ_m of the four branches [s]."""
FADING = 0.5
"""Time in which the residual stress fades to 1/e [s]."""
LAWS = ("elastic", "viscous", "maxwell")

_DEGREE = 8  # of the input's polynomial over a step


# ---------------------------------------------------------------- the law


@lru_cache
def _weights(damping: float) -> tuple[float, ...]:
    kappa = branch(2j * np.pi * np.geomspace(0.2, 20.0, 80))
    weights, _ = nnls(kappa.imag - 2 * damping * kappa.real, np.full(len(kappa), 2 * damping))
    return tuple(weights)


def branch(s: npt.ArrayLike) -> ComplexArray:
    """κ_m(s) = sτ_m/(1 + sτ_m) of every branch, shape ``(..., 4)``."""
    product = np.asarray(s, complex)[..., None] * RELAXATION
    return product / (1 + product)


def maxwell_weights(damping: npt.ArrayLike) -> RealArray:
    """Weights a_m of the branches for damping ratios, shape ``(..., 4)``."""
    ratios = np.asarray(damping, float)
    rows = [_weights(float(ratio)) for ratio in ratios.ravel()]
    return np.array(rows).reshape(*ratios.shape, len(RELAXATION))


def maxwell_factor(s: npt.ArrayLike, damping: float, reference_frequency: float) -> ComplexArray:
    """G*(s)/G of one damping ratio; its real part is 1 at the reference frequency [Hz]."""
    weights = maxwell_weights(damping)
    at_reference = 1 + branch(2j * np.pi * reference_frequency).real @ weights
    return (1 + branch(s) @ weights) / at_reference


# ---------------------------------------------------------------- the column


@dataclass(frozen=True)
class Stage:
    """Moduli of the elements over some samples.

    Attributes:
        num_samples: For so many samples.
        modulus: Shear modulus G [Pa], shape ``(num_elements,)``.
        damping: Damping ratio D [-], the same shape; the Maxwell law alone looks at it.
    """

    num_samples: int
    modulus: RealArray
    damping: RealArray


@dataclass(frozen=True)
class Energy:
    """Energies of the column per area [J/m²], shape ``(num_samples,)``.

    ``kinetic + strain + dissipated + residual + seams = supplied``, of the motion relative to the
    input.

    Attributes:
        kinetic: ½ vᵀMv.
        strain: Of the springs, those of the branches included.
        dissipated: By C and the dashpots of the branches.
        residual: Work that the residual stress σ_q has taken.
        seams: Strain energy that changes of the moduli have taken.
        supplied: Work of −M r a.
    """

    kinetic: RealArray
    strain: RealArray
    dissipated: RealArray
    residual: RealArray
    seams: RealArray
    supplied: RealArray

    @property
    def imbalance(self) -> RealArray:
        """What does not add up."""
        spent = self.kinetic + self.strain + self.dissipated + self.residual + self.seams
        return spent - self.supplied


@dataclass(frozen=True)
class Motion:
    """Motion of the nodes relative to the input, from the base up.

    Attributes:
        displacement: [m], shape ``(num_nodes, num_samples)``.
        velocity: [m/s].
        acceleration: [m/s²].
        energy: The balance.
    """

    displacement: RealArray
    velocity: RealArray
    acceleration: RealArray
    energy: Energy = field(repr=False)

    def above_base(self, name: str = "displacement") -> RealArray:
        """A motion relative to that of the base, as results give it."""
        motion = getattr(self, name)
        return motion - motion[:1]


@dataclass(frozen=True)
class ShearColumn:
    """A column, its elements from the base up.

    Attributes:
        thickness: Of the elements [m], shape ``(num_elements,)``.
        density: [kg/m³], shape ``(num_elements,)``.
        law: ``elastic``, ``viscous`` (elastic, with Rayleigh damping) or ``maxwell``.
        alpha: [1/s].
        beta: Of the stiffness G [s].
        impedance: ρV of the rock below, for outcrop input; ``None`` on a rigid base, for within
            input.
        reference_frequency: Where the Maxwell law has the modulus G [Hz].
    """

    thickness: RealArray
    density: RealArray
    law: str = "elastic"
    alpha: float = 0.0
    beta: float = 0.0
    impedance: float | None = None
    reference_frequency: float = 2.0

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise ValueError(f"law: found '{self.law}'; expected one of {', '.join(LAWS)}")
        if self.law == "elastic" and (self.alpha or self.beta):
            raise ValueError("law: found 'elastic' with Rayleigh damping; expected 'viscous'")

    @property
    def num_elements(self) -> int:
        return len(self.thickness)

    @property
    def height(self) -> RealArray:
        """Of the nodes [m]."""
        return np.concatenate([[0.0], np.cumsum(self.thickness)])

    @property
    def free(self) -> slice:
        """The nodes that move relative to the input."""
        return slice(1 if self.impedance is None else 0, None)

    def strain_rows(self) -> RealArray:
        """γ = B u on all nodes, shape ``(num_elements, num_nodes)``."""
        B = np.zeros((self.num_elements, self.num_elements + 1))
        rows = np.arange(self.num_elements)
        B[rows, rows], B[rows, rows + 1] = -1 / self.thickness, 1 / self.thickness
        return B

    def mass(self) -> RealArray:
        """Consistent mass on all nodes [kg/m²]."""
        M = np.zeros((self.num_elements + 1,) * 2)
        for number, share in enumerate(self.density * self.thickness / 6):
            M[number : number + 2, number : number + 2] += share * np.array([[2, 1], [1, 2]])
        return M

    def stiffness(self, modulus: npt.NDArray) -> npt.NDArray:
        """∫ Bᵀ G B dy on all nodes, real or complex [N/m³]."""
        B = self.strain_rows()
        return B.T @ ((self.thickness * modulus)[:, None] * B)

    def dashpots(self, modulus: RealArray) -> RealArray:
        """C on all nodes [N s/m³]."""
        C = self.alpha * self.mass() + self.beta * self.stiffness(modulus)
        C[0, 0] += self.impedance or 0.0
        return C

    def weights(self, damping: RealArray) -> RealArray:
        """Of the branches, shape ``(num_elements, 4)``; nought unless the law is Maxwell's."""
        return maxwell_weights(damping) * (self.law == "maxwell")

    def relaxed(self, modulus: RealArray, damping: RealArray) -> RealArray:
        """G_r [Pa]."""
        kappa = branch(2j * np.pi * self.reference_frequency).real
        return modulus / (1 + self.weights(damping) @ kappa)

    def frequencies(self, modulus: RealArray) -> tuple[RealArray, RealArray, RealArray]:
        """Undamped modes: frequencies [rad/s], shapes with unit mass, parts −φᵀM r in the input."""
        M = self.mass()
        L = np.linalg.cholesky(M[self.free, self.free])
        half = np.linalg.solve(L, self.stiffness(modulus)[self.free, self.free])
        squared, vectors = np.linalg.eigh(np.linalg.solve(L, half.T))
        shapes = np.linalg.solve(L.T, vectors)
        return np.sqrt(squared), shapes, -shapes.T @ M.sum(axis=1)[self.free]

    def steady(self, s: complex, modulus: ComplexArray, real: RealArray | None = None):
        """Displacement of all nodes per acceleration of the input, at e^{st}.

        Args:
            s: Complex frequency [rad/s].
            modulus: Complex modulus there [Pa].
            real: What βK is made of; the real part of the modulus where ``None``.
        """
        M, C = self.mass(), self.dashpots(np.real(modulus) if real is None else real)
        A = s**2 * M + s * C + self.stiffness(modulus)
        u = np.zeros(self.num_elements + 1, complex)
        u[self.free] = np.linalg.solve(A[self.free, self.free], -M.sum(axis=1)[self.free])
        return u

    def respond(
        self,
        acceleration: RealArray,
        dt: float,
        stages: Sequence[Stage],
        *,
        start: tuple[RealArray, RealArray] | None = None,
        steps: int = 4,
        jump: str = "fade",
    ) -> Motion:
        """Response from rest, sample by sample.

        Args:
            acceleration: Of the input [m/s²]; quiet at both ends, zero beyond them.
            dt: Time step [s].
            stages: Moduli, one stage after the other.
            start: Displacement and velocity at the start, of all nodes; at rest where ``None``.
            steps: Steps of the integration a sample.
            jump: What happens to a stress that changed moduli would change: ``fade``, as above;
                ``keep`` it for good; ``drop`` it at once.

        Returns:
            The motion at the samples of the stages.
        """
        size = sum(stage.num_samples for stage in stages)
        values = band_limited(np.pad(acceleration, (0, size - len(acceleration))), steps * _DEGREE)
        state = np.zeros(_Linear.size(self))
        if start is not None:
            free = len(range(self.num_elements + 1)[self.free])
            state[:free], state[free : 2 * free] = (motion[self.free] for motion in start)
        found, balance, first, before = [], _Balance(), 0, None
        for stage in stages:
            linear = _Linear(self, stage, {"fade": 1 / FADING}.get(jump, 0.0))
            if before is not None and jump != "drop":
                state = linear.take_over(state, before)
            balance.seam(linear.stored(state), None if before is None else before.stored(state))
            here = values[first * steps * _DEGREE : (first + stage.num_samples) * steps * _DEGREE]
            states, a = linear.march(state, here, values, first * steps * _DEGREE, dt / steps)
            balance.account(linear, states, a, dt / steps)
            motion = linear.motion(states[:, :-1], a[:-1])
            found.append(tuple(part[:, ::steps] for part in motion))
            state, before, first = states[:, -1], linear, first + stage.num_samples
        energy = balance.energy(steps)
        return Motion(*(np.concatenate(part, axis=1) for part in zip(*found, strict=True)), energy)


def band_limited(samples: RealArray, factor: int) -> RealArray:
    """Interpolate by FFT, zeros beyond both ends.

    Args:
        samples: Shape ``(n,)``.
        factor: Values a sample.

    Returns:
        From the first sample to where the one after the last would be, that one included, shape
        ``(n * factor + 1,)``.
    """
    n = len(samples)
    padded = np.concatenate([np.zeros(n), samples, np.zeros(n)])
    spectrum = fft.rfft(padded)
    if len(padded) % 2 == 0:
        spectrum[-1] *= 0.5  # the Nyquist line is split between its two signs
    whole = factor * fft.irfft(spectrum, factor * len(padded))
    return whole[factor * n : 2 * factor * n + 1]


class _Linear:
    """ẋ = A x + b a of one stage, x the free nodes' u and v, ζ_m by branch, and σ_q."""

    def __init__(self, column: ShearColumn, stage: Stage, fading: float) -> None:
        self.column, free = column, column.free
        self._weights = column.weights(stage.damping)
        self._relaxed = column.relaxed(stage.modulus, stage.damping)
        n, elements = column.num_elements + 1 - (free.start or 0), column.num_elements
        self._n, h = n, column.thickness
        self.B = column.strain_rows()[:, free]
        self.M = column.mass()[free, free]
        self.C = column.dashpots(stage.modulus)[free, free]
        self.load = -column.mass().sum(axis=1)[free]
        parts = [self._u, self._v, *(self._branch(m) for m in range(4)), self._residual]
        u, v, *branches, residual = parts
        A = np.zeros((self.size(column),) * 2)
        A[u, v] = np.eye(n)
        force = self.B.T * h
        A[v, u] = -(force * self._relaxed) @ self.B
        A[v, v] = -self.C
        A[v, residual] = -force
        A[residual, residual] = -fading * np.eye(elements)
        for m, zeta in enumerate(branches):
            A[v, zeta] = -force * (self._relaxed * self._weights[:, m])
            A[zeta, v] = self.B
            A[zeta, zeta] = -np.eye(elements) / RELAXATION[m]
        A[v] = np.linalg.solve(self.M, A[v])
        self.A, self.b = A, np.zeros(len(A))
        self.b[v] = np.linalg.solve(self.M, self.load)

    @staticmethod
    def size(column: ShearColumn) -> int:
        nodes = column.num_elements + 1 - (column.free.start or 0)
        return 2 * nodes + 5 * column.num_elements

    @property
    def _u(self) -> slice:
        return slice(0, self._n)

    @property
    def _v(self) -> slice:
        return slice(self._n, 2 * self._n)

    def _branch(self, m: int) -> slice:
        first = 2 * self._n + m * self.column.num_elements
        return slice(first, first + self.column.num_elements)

    @property
    def _residual(self) -> slice:
        return self._branch(4)

    def stress(self, x: RealArray) -> RealArray:
        """σ of the elements, without σ_q [Pa]."""
        memory = sum(self._weights[:, m] * x[self._branch(m)] for m in range(4))
        return self._relaxed * (self.B @ x[self._u] + memory)

    def take_over(self, x: RealArray, before: _Linear) -> RealArray:
        """σ_q takes up what the moduli change in the stress."""
        x = x.copy()
        x[self._residual] += before.stress(x) - self.stress(x)
        return x

    def march(
        self, x: RealArray, here: RealArray, values: RealArray, first: int, h: float
    ) -> tuple[RealArray, RealArray]:
        """States and inputs at the ends of all steps, both ends included."""
        count = len(here) // _DEGREE
        E, W = self._step(h)
        windows = np.lib.stride_tricks.sliding_window_view(values[first:], _DEGREE + 1)
        pushed = W @ windows[::_DEGREE][:count].T
        states = np.empty((len(x), count + 1))
        states[:, 0] = x
        for step in range(count):
            states[:, step + 1] = E @ states[:, step] + pushed[:, step]
        return states, values[first : first + count * _DEGREE + 1 : _DEGREE]

    def _step(self, h: float) -> tuple[RealArray, RealArray]:
        """x(h) = E x(0) + W a, of the input's values at equal distances over the step."""
        n, terms = len(self.b), _DEGREE + 1
        chain = np.zeros((n + terms, n + terms))  # the derivatives of the input join the state
        chain[:n, :n], chain[:n, n] = h * self.A, h * self.b
        chain[range(n, n + _DEGREE), range(n + 1, n + terms)] = 1.0
        flow = expm(chain)
        powers = np.vander(np.linspace(0, 1, terms), increasing=True)
        derivatives = np.linalg.inv(powers) * [[factorial(k)] for k in range(terms)]
        return flow[:n, :n], flow[:n, n:] @ derivatives

    def motion(self, x: RealArray, a: RealArray) -> tuple[RealArray, RealArray, RealArray]:
        """Displacement, velocity and acceleration of all nodes."""
        rates = self.A[self._v] @ x + self.b[self._v, None] * a
        full = np.zeros((3, self.column.num_elements + 1, x.shape[1]))
        full[:, self.column.free] = x[self._u], x[self._v], rates
        return full[0], full[1], full[2]

    def stored(self, x: RealArray) -> RealArray:
        """Strain energy of states, shape ``(...)``."""
        square = (self.B @ x[self._u]) ** 2
        for m in range(4):
            square = square + (self._weights[:, m] * (x[self._branch(m)] ** 2).T).T
        return 0.5 * (self.column.thickness * self._relaxed) @ square

    def kinetic(self, x: RealArray) -> RealArray:
        return 0.5 * np.einsum("it,ij,jt->t", x[self._v], self.M, x[self._v])

    def powers(self, x: RealArray, a: RealArray) -> RealArray:
        """Dissipated, taken by σ_q, supplied [W/m²], shape ``(3, num_states)``."""
        v, h = x[self._v], self.column.thickness
        lost = np.einsum("it,ij,jt->t", v, self.C, v)
        for m in range(4):
            viscosity = h * self._relaxed * self._weights[:, m] / RELAXATION[m]
            lost += viscosity @ x[self._branch(m)] ** 2
        taken = np.einsum("e,et,et->t", h, x[self._residual], self.B @ v)
        return np.stack([lost, taken, (self.load @ v) * a])


class _Balance:
    """Adds up energies, stage by stage."""

    def __init__(self) -> None:
        self._parts: list[RealArray] = []
        self._spent, self._changed = np.zeros(3), 0.0

    def seam(self, now: RealArray, before: RealArray | None) -> None:
        self._changed += 0.0 if before is None else float(before - now)

    def account(self, linear: _Linear, states: RealArray, a: RealArray, h: float) -> None:
        time = h * np.arange(states.shape[1])
        integral = make_interp_spline(time, linear.powers(states, a), k=5, axis=1)
        work = self._spent[:, None] + integral.antiderivative()(time)
        self._spent = work[:, -1]
        held = linear.kinetic(states), linear.stored(states)
        lost, taken, supplied = work
        rows = [*held, lost, taken, np.full(len(time), self._changed), supplied]
        self._parts.append(np.stack(rows)[:, :-1])

    def energy(self, steps: int) -> Energy:
        return Energy(*np.concatenate(self._parts, axis=1)[:, ::steps])


# ---------------------------------------------------------------- what tests shake


NUM_CELLS, CELL, SPEED, DENSITY = 20, 2.0, 170.0, 1850.0
"""The column of most tests: 40 m, V_s 170 m/s, 1850 kg/m³."""
DT, SAMPLES = 0.01, 1500
REFERENCE_FREQUENCY = 2.0


def usual_column(**options) -> ShearColumn:
    """The column of most tests."""
    options = {"reference_frequency": REFERENCE_FREQUENCY} | options
    return ShearColumn(np.full(NUM_CELLS, CELL), np.full(NUM_CELLS, DENSITY), **options)


def usual_stages(
    ratios: Sequence[float], damping: float = 0.0, num_samples: int = SAMPLES
) -> list[Stage]:
    """Stages of equal length over which G is a multiple of the usual one."""
    ones = np.ones(NUM_CELLS)
    modulus, count = DENSITY * SPEED**2, -(-num_samples // len(ratios))
    return [Stage(count, ratio * modulus * ones, damping * ones) for ratio in ratios]


def smooth_step(x: npt.ArrayLike) -> RealArray:
    """From 0 at 0 to 1 at 1, with all its derivatives zero there."""
    x = np.clip(np.asarray(x, float), 0.0, 1.0)
    with np.errstate(divide="ignore", over="ignore"):
        return 1 / (1 + np.exp(1 / x - 1 / (1 - x)))


def window(time: RealArray, begin: float, end: float, edge: float) -> RealArray:
    """1 between two times, 0 before and after, with smooth edges within."""
    return smooth_step((time - begin) / edge) * smooth_step((end - time) / edge)


def quiet_record(num_samples: int = SAMPLES, dt: float = DT, seed: int = 11) -> RealArray:
    """Noise from 0.5 to 8 Hz, 1 m/s² at its peak, still for a while at both ends."""
    rng = np.random.default_rng(seed)
    time, length = dt * np.arange(num_samples), dt * num_samples
    frequency = np.arange(0.75, 7.75, 0.07)
    phase = rng.uniform(0, 2 * np.pi, len(frequency))
    strength = rng.uniform(0.5, 1.5, len(frequency))
    noise = strength @ np.sin(2 * np.pi * np.outer(frequency, time) + phase[:, None])
    noise *= window(time, 0.02 * length, 0.8 * length, 0.2 * length)
    return noise / np.abs(noise).max()


def table(
    folder: Path,
    acceleration: RealArray,
    *,
    lapses: dict,
    dt: float = DT,
    damping: float = 0.0,
    rock: dict | None = None,
    **sections: dict,
) -> dict:
    """The scene of the usual column as a raw table, with a receiver at every node.

    Args:
        folder: Where the motion is written.
        acceleration: Of the base [m/s²], or of the outcrop where there is a rock.
        lapses: The section.
        dt: Time step [s].
        damping: Damping ratio of the soil.
        rock: Of a compliant base.
        sections: More sections.
    """
    path = folder / "motion.csv"
    np.savetxt(path, acceleration)
    soil = {"density": DENSITY, "shear_wave_velocity": SPEED, "poisson": 0.3, "damping": damping}
    layer = {"thickness": NUM_CELLS * CELL, "soil": "soil", "cells": NUM_CELLS}
    base = {} if rock is None else {"base": {"compliant": rock}}
    motion = {"direction": "x", "file": str(path), "dt": dt, "units": "m/s2"}
    return {
        "mesh": {"column": {"width": CELL, "layers": [layer]}},
        "soil": {"soil": soil},
        "motion": [motion | {"input": "outcrop" if base else "within"}],
        "boundary": {"left": "tied", "right": "tied"} | base,
        "lapses": lapses,
        "output": {"receivers": node_receivers()},
    } | sections


def node_receivers() -> dict[str, list[float]]:
    """A receiver at every node of the usual column, from the base up."""
    return {f"n{i:02d}": [CELL / 2, CELL * i] for i in range(NUM_CELLS + 1)}
