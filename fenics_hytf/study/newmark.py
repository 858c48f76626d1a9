# SPDX-License-Identifier: MIT
"""A scene marched in time: Newmark's method and HHT-α on its own K, M and C.

The reference integrator that the sweep over frequencies is compared with: M ü + C u̇ + K u =
−M r ü_b from rest, in fixed steps h,

    u⁺ = u + h u̇ + h² [(½ − β) ü + β ü⁺],    u̇⁺ = u̇ + h [(1 − γ) ü + γ ü⁺]

with the average acceleration, β = 1/4 and γ = 1/2 (Newmark 1959), or with equilibrium at the time
t + (1 + α) h, −1/3 ≤ α ≤ 0, β = (1 − α)²/4 and γ = 1/2 − α (Hilber, Hughes and Taylor 1977):

    M ü⁺ + C [(1 + α) u̇⁺ − α u̇] + K [(1 + α) u⁺ − α u] = (1 + α) f⁺ − α f

Its ü⁺ is therefore the acceleration at t + (1 + α) h, of second order there and of first order at
t + h; the acceleration at t + h is read off the line between two steps.

It is made fast, so that the comparison is fair. Matrices are real; the effective mass is factorised
once, A = LDLᵀ by SuperLU without pivoting; a step is one product with K and C in one pass, one
solve and one pass over the vectors, all compiled. SuperLU is the real sparse direct solver that
Debian 13 has for Python (PETSc is complex here, CHOLMOD has no package). LAPACK's banded solve took
two thirds of its time in sections 20 and 50 cells high with free sides; tied sides double the band,
and it is not used. To call SuperLU's solve costs a small column more than the solve: L that fits
the cache is taken out of it and the whole march is compiled; beyond that its supernodes win. The
output is that of the receivers alone; a run of the scene finds the peaks of all cells as well.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy import sparse
from scipy.signal import resample
from scipy.sparse.linalg import SuperLU, splu

from fenics_hytf.scene import Scene
from fenics_hytf.study.matrices import assemble

RealArray = npt.NDArray[np.float64]

_CACHED = 100_000
"""Entries of L up to which the compiled march is as fast as SuperLU's own solves, or faster."""

_LEAD = 32
"""Samples of rest that are marched before the record.

Between its samples the record is the Fourier series it is, which rings before a sudden start.
"""


@dataclass(frozen=True)
class Scheme:
    """A member of the HHT-α family; α = 0 is the average acceleration method.

    Attributes:
        alpha: α [-]; damps what a step does not resolve.
    """

    alpha: float = 0.0

    @property
    def beta(self) -> float:
        """Newmark's β, that makes the method unconditionally stable [-]."""
        return (1 - self.alpha) ** 2 / 4

    @property
    def gamma(self) -> float:
        """Newmark's γ, that makes the method of second order [-]."""
        return 0.5 - self.alpha

    def at_steps(self, accelerations: RealArray) -> RealArray:
        """Read accelerations off at the ends of steps.

        Args:
            accelerations: As :meth:`Marcher.run` finds them, shape ``(num_rows, num_steps + 1)``.

        Returns:
            At t = 0, h, 2h …, shape ``(num_rows, num_steps)``; the last step has no next one.
        """
        here, after = accelerations[:, :-1], accelerations[:, 1:]
        result = (1 + self.alpha) * here - self.alpha * after
        result[:, 0] = here[:, 0]
        return result


SCHEMES = {"newmark": Scheme(), "hht": Scheme(-0.1)}
"""By name; HHT-α with its authors' usual moderate damping."""


@dataclass
class MarchCost:
    """What a march costs.

    Attributes:
        cpu_s: CPU seconds by phase: ``assembly``, ``factorise``, ``march``, ``output``.
        factorisations: Factorisations.
        steps: Time steps; each takes one solve.
    """

    cpu_s: dict[str, float] = field(default_factory=dict)
    factorisations: int = 0
    steps: int = 0

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Add the CPU time spent inside to a phase."""
        start = time.process_time()
        try:
            yield
        finally:
            self.cpu_s[name] = self.cpu_s.get(name, 0.0) + time.process_time() - start


@dataclass(frozen=True)
class March:
    """A scene marched in time.

    Attributes:
        total_acceleration: Of the receivers at the samples of the record [m/s^2], shape
            ``(num_receivers, num_components, num_samples)``.
        cost: What it cost.
        unknowns: Unknowns.
        cells: Cells.
    """

    total_acceleration: RealArray
    cost: MarchCost
    unknowns: int
    cells: int


def integrate(scene: Scene, method: str = "newmark", substeps: int = 1) -> March:
    """March a linear scene with viscous damping from rest, in this process alone.

    The base moves as the sweep understands its samples: as a Fourier series, which is evaluated
    between them. The march covers the samples of the record and leaves out the zeros that pad it.

    Args:
        scene: The scene, one lapse.
        method: ``newmark`` or ``hht``.
        substeps: Time steps per sample of the record.

    Returns:
        The response of the receivers.

    Raises:
        ValueError: The scene is not linear, or not of one lapse, or its damping is not viscous.
        SceneError: A fault that only the mesh shows.
    """
    if method not in SCHEMES:
        raise ValueError(f"method: found {method!r}; expected one of {', '.join(SCHEMES)}")
    if substeps < 1:
        raise ValueError(f"substeps: found {substeps}; expected a whole number from 1")
    if scene.effects.equivalent_linear is not None or len(scene.segments) != 1:
        raise ValueError(
            f"found equivalent_linear {'on' if scene.effects.equivalent_linear else 'off'} and "
            f"{len(scene.segments)} lapses; expected a linear scene of one lapse"
        )
    scheme, cost = SCHEMES[method], MarchCost()
    with cost.phase("assembly"):
        matrices = assemble(scene)
        if matrices.hysteresis is not None:
            raise ValueError(
                "found material damping, which is not causal; expected damping = 0 and Rayleigh "
                "damping, as the viscous twin of a scene has"
            )
        num_samples = max(motion.record.num_samples for motion in scene.motion)
        lead, base = _base_motion(scene, num_samples, substeps)
    marcher = Marcher(
        matrices.stiffness, matrices.mass, matrices.damping, scene.dt / substeps, scheme, cost
    )
    relative = marcher.run(matrices.loads, base, matrices.receivers)
    with cost.phase("output"):
        relative = scheme.at_steps(relative)[:, lead * substeps :: substeps]
        total = relative.reshape(-1, matrices.num_components, num_samples)
        for motion, axis in enumerate(matrices.axes):
            total[:, axis] += scene.base_acceleration[motion, :num_samples]
    return March(total, cost, matrices.num_unknowns, matrices.num_cells)


def _base_motion(scene: Scene, num_samples: int, substeps: int) -> tuple[int, RealArray]:
    """Samples of rest before the record, and base accelerations at every step and one more."""
    padded = scene.base_acceleration
    lead = min(_LEAD, padded.shape[1] - num_samples)
    fine = np.array(resample(padded, substeps * padded.shape[1], axis=1))
    fine[:, ::substeps] = padded  # free of round-off: rest is rest
    steps = np.arange(-lead * substeps, (num_samples - 1) * substeps + 2)
    return lead, np.take(fine, steps, axis=1, mode="wrap")


class Marcher:
    """Steps of one length through M ü + C u̇ + K u = f.

    Args:
        K: Stiffness, shape ``(n, n)``.
        M: Mass.
        C: Damping, or ``None``.
        step: h [s].
        scheme: The method.
        cost: Where costs are added.

    K, M and C are symmetric and have one pattern.

    Raises:
        ValueError: The patterns differ.
        RuntimeError: The effective mass is not positive definite.
    """

    def __init__(
        self,
        K: sparse.csr_matrix,
        M: sparse.csr_matrix,
        C: sparse.csr_matrix | None,
        step: float,
        scheme: Scheme = SCHEMES["newmark"],
        cost: MarchCost | None = None,
    ) -> None:
        self._step, self._scheme = step, scheme
        self.cost = MarchCost() if cost is None else cost
        if C is None:
            C = sparse.csr_matrix((np.zeros_like(K.data), K.indices, K.indptr), K.shape)
        self._K, self._M, self._C = K, M, C
        if not all(np.array_equal(K.indices, other.indices) for other in (M, C)):
            raise ValueError("K, M, C: found sparsity patterns that differ; expected one")
        weight = 1 + scheme.alpha
        with self.cost.phase("factorise"):
            effective = M.copy()
            effective.data = (
                M.data
                + weight * scheme.gamma * step * C.data
                + weight * scheme.beta * step**2 * K.data
            )
            self._factor = self._factorise(effective)
            self._small = self._factor.nnz <= 2 * _CACHED  # L and U
            if self._small:
                # Permuted once, the march knows no permutation.
                self._order = np.argsort(self._factor.perm_c)
                lower = sparse.tril(self._factor.L, -1, format="csc")
                pivots = self._factor.U.diagonal()
                self._ldl = (lower.indptr, lower.indices, lower.data, 1 / pivots)
            else:
                self._order = np.arange(K.shape[0])

    def _factorise(self, A: sparse.csr_matrix) -> SuperLU:
        self.cost.factorisations += 1
        factor = splu(
            sparse.csc_matrix(A.T),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        if not np.array_equal(factor.perm_r, factor.perm_c):
            raise RuntimeError(
                "the effective mass: found a factorisation that pivots; expected a positive "
                "definite matrix: is a part of the mesh without mass, or held by nothing?"
            )
        return factor

    def run(
        self,
        loads: RealArray,
        motion: RealArray,
        rows: sparse.csr_matrix,
        displacement: RealArray | None = None,
        velocity: RealArray | None = None,
    ) -> RealArray:
        """March under loads that follow motions, f(t) = Σ loads_m motion_m(t).

        Args:
            loads: Shape ``(num_motions, n)``.
            motion: At every step, the first one at t = 0, shape ``(num_motions, num_steps + 1)``.
            rows: Evaluate what is wanted from the unknowns, shape ``(num_rows, n)``.
            displacement: At t = 0, shape ``(n,)``; at rest if ``None``.
            velocity: Likewise.

        Returns:
            Rows of the acceleration ü of every step [m/s^2], at the time where the scheme has it,
            shape ``(num_rows, num_steps + 1)``; :meth:`Scheme.at_steps` reads it off at t = 0, h ….
        """
        zero = np.zeros(self._K.shape[0])
        u, v = (zero if start is None else start for start in (displacement, velocity))
        acceleration = self._first(loads.T @ motion[:, 0] - self._K @ u - self._C @ v)
        order = self._order
        with self.cost.phase("march"):
            K, C = (m if not self._small else m[order][:, order] for m in (self._K, self._C))
            rows = rows[:, order].tocsr() if self._small else rows
            scheme, h = self._scheme, self._step
            weight = 1 + scheme.alpha
            system = (K.indptr, K.indices, K.data, C.data)
            watched = (rows.indptr, rows.indices, rows.data)
            numbers = (h, weight, scheme.beta, scheme.gamma)
            forces = weight * motion[:, 1:] - scheme.alpha * motion[:, :-1]
            loads = np.ascontiguousarray(loads[:, order].T)
            state = tuple(vector[order] for vector in (u, v, acceleration))
            found = np.empty((motion.shape[1], rows.shape[0]))
            found[0] = rows @ state[2]
            forces = np.ascontiguousarray(forces.T)
            if self._small:
                _march_small(system, self._ldl, watched, numbers, loads, forces, state, found)
            else:
                self._march_large(system, watched, numbers, loads, forces, state, found)
        self.cost.steps += len(forces)
        return found.T

    def _first(self, force: RealArray) -> RealArray:
        """Acceleration at t = 0."""
        if not force.any():
            return force
        with self.cost.phase("factorise"):
            return np.asarray(self._factorise(self._M).solve(force))

    def _march_large(
        self,
        system: tuple[RealArray, ...],
        watched: tuple[RealArray, ...],
        numbers: tuple[float, ...],
        loads: RealArray,
        forces: RealArray,
        state: tuple[RealArray, ...],
        found: RealArray,
    ) -> None:
        """The steps of a system that is too large for the compiled solve."""
        right, work = np.empty_like(state[0]), (np.empty_like(state[0]), np.empty_like(state[0]))
        for number, force in enumerate(forces):
            _set_up(system, numbers, loads, force, state, work, right)
            _take(numbers, watched, self._factor.solve(right), state, found[number + 1])


# What is passed together, each a tuple of arrays:
# system: pattern of K and C, and their values; ldl: pattern and values of L below its diagonal, and
# D⁻¹; watched: rows in compressed form; numbers: h, 1 + α, β, γ; state: u, u̇, ü.


@njit(cache=True)
def _set_up(system, numbers, loads, force, state, work, right):  # type: ignore[no-untyped-def]
    """Right-hand side of a step: what ü⁺ has to balance."""
    indptr, indices, K, C = system
    h, weight, beta, gamma = numbers
    u, v, a = state
    x, y = work
    for i in range(u.size):
        x[i] = u[i] + weight * (h * v[i] + h * h * (0.5 - beta) * a[i])
        y[i] = v[i] + weight * h * (1.0 - gamma) * a[i]
    for i in range(u.size):
        total = 0.0
        for motion in range(force.size):
            total += loads[i, motion] * force[motion]
        for entry in range(indptr[i], indptr[i + 1]):
            j = indices[entry]
            total -= K[entry] * x[j] + C[entry] * y[j]
        right[i] = total


@njit(cache=True)
def _take(numbers, watched, new, state, found):  # type: ignore[no-untyped-def]
    """End a step: take the new acceleration, and note what is watched."""
    h, _, beta, gamma = numbers
    u, v, a = state
    indptr, indices, values = watched
    for i in range(u.size):
        u[i] += h * v[i] + h * h * ((0.5 - beta) * a[i] + beta * new[i])
        v[i] += h * ((1.0 - gamma) * a[i] + gamma * new[i])
        a[i] = new[i]
    for row in range(found.size):
        total = 0.0
        for entry in range(indptr[row], indptr[row + 1]):
            total += values[entry] * a[indices[entry]]
        found[row] = total


@njit(cache=True)
def _solve(ldl, x):  # type: ignore[no-untyped-def]
    """LDLᵀ x = b in place, the columns of L below the diagonal."""
    indptr, indices, values, inverse = ldl
    for j in range(x.size):
        for entry in range(indptr[j], indptr[j + 1]):
            x[indices[entry]] -= values[entry] * x[j]
    for j in range(x.size - 1, -1, -1):
        total = x[j] * inverse[j]
        for entry in range(indptr[j], indptr[j + 1]):
            total -= values[entry] * x[indices[entry]]
        x[j] = total


@njit(cache=True)
def _march_small(system, ldl, watched, numbers, loads, forces, state, found):  # type: ignore[no-untyped-def]
    """All steps of a system whose L fits the cache."""
    right, work = np.empty_like(state[0]), (np.empty_like(state[0]), np.empty_like(state[0]))
    for number in range(len(forces)):
        _set_up(system, numbers, loads, forces[number], state, work, right)
        _solve(ldl, right)
        _take(numbers, watched, right, state, found[number + 1])
