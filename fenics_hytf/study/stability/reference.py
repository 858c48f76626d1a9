# SPDX-License-Identifier: MIT
"""The true motion of a column of the stability map, in the time domain and without lapses.

On the column's own matrices, K_r and K_m of the relaxed part and the branches of the Maxwell law,
with one ratio ρ of all moduli at a time,

    M ü + ρ (K_r u + Σ K_m z_m) + f = −M r a,    ż_m = u̇ − z_m/τ_m,    ḟ = −f/τ_q

where f is what is left of the stress of earlier ratios: as ρ changes it takes up the difference, so
that no stress jumps. Strain is linear in u and memory is linear in strain, so z_m on the nodes is
all that the branches remember. With the record a spline of degree 5 between its samples this is a
linear system with constant coefficients, and a matrix exponential steps it exactly.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline
from scipy.linalg import expm

from fenics_hytf.lapse.carried import FADING
from fenics_hytf.motion import band_limited
from fenics_hytf.study.stability.column import ColumnCase
from fenics_hytf.study.stability.ground import Site, csr

RealArray = npt.NDArray[np.float64]

_DEGREE = 5  # of the record between two samples


def true_motion(case: ColumnCase) -> RealArray:
    """What a column does.

    Args:
        case: The column.

    Returns:
        Displacement of the nodes relative to the base [m], shape ``(num_nodes, num_samples)``, over
        all lapses.
    """
    column, rows = _Column.of(case)
    record = _taylor(case)
    state: RealArray = np.zeros(column.size)
    states, flow, before = [], None, None
    for segment, ratio in zip(case.segments, case.ratios, strict=True):
        if before != ratio:
            if before is not None:
                state = column.take_over(state, before, ratio)
            flow, before = expm(case.scene.dt * column.rates(ratio)), ratio
        assert flow is not None
        step, pushed = flow[: column.size, : column.size], flow[: column.size, column.size :]
        for sample in range(segment.start, segment.stop):
            states.append(state[column.u])
            state = step @ state + pushed @ record[:, sample]
    return np.asarray(rows @ np.array(states).T)


def _taylor(case: ColumnCase) -> RealArray:
    """The record that lapses see, and its derivatives from the right at every sample."""
    scene = case.scene
    motion = band_limited(scene.base_acceleration, scene.dt, scene.solver.max_frequency)[0]
    motion = np.pad(motion, (0, case.segments[-1].stop + 1 - len(motion)))
    time = scene.dt * np.arange(len(motion))
    spline = make_interp_spline(time, motion, k=_DEGREE)
    return np.stack([spline.derivative(order)(time) if order else motion for order in range(6)])


class _Column:
    """ẋ = A x + b a, x the unknowns that the record reaches: u, v, z of each branch, and f.

    Args:
        mass: M.
        stiffness: K of each part of the law, the relaxed one first.
        times: τ of the others [s].
        load: −M r.
    """

    def __init__(
        self, mass: RealArray, stiffness: list[RealArray], times: list[float], load: RealArray
    ) -> None:
        self._n, self._stiffness, self._times = len(load), stiffness, times
        self._inverse, self._load = np.linalg.inv(mass), load
        self.size = self._n * (2 + len(stiffness))

    @classmethod
    def of(cls, case: ColumnCase) -> tuple[_Column, RealArray]:
        """The column of a case, and the rows that find the nodes' displacement sideways."""
        with Site(case.scene) as site:
            equations, law = site.assemble()
            parts = [csr(matrix).toarray().real for matrix, _ in equations.stiff]
            mass = csr(equations.system.mass).toarray().real
            assert isinstance(equations.loads, list)
            load = equations.loads[0].array_r.real.copy()
            receivers = site.receiver_rows()
            rows = csr(receivers).toarray().real[::2]
            receivers.destroy()
        # A column shaken sideways does not move up and down: tied sides let no strain mix.
        reached = load != 0
        both = np.ix_(reached, reached)
        times = [part.relaxation_time for part in law.parts if part.relaxation_time is not None]
        column = cls(mass[both], [part[both] for part in parts], times, load[reached])
        return column, rows[:, reached]

    @property
    def u(self) -> slice:
        """Where u is."""
        return self._block(0)

    def _block(self, number: int) -> slice:
        return slice(number * self._n, (number + 1) * self._n)

    @property
    def _remembered(self) -> list[slice]:
        """Where what each part of the law is multiplied by is: u, and z of the branches."""
        return [self.u, *(self._block(2 + branch) for branch in range(len(self._times)))]

    @property
    def _rest(self) -> slice:
        return self._block(2 + len(self._times))

    def force(self, state: RealArray, ratio: float) -> RealArray:
        """That of the law, without what is left of earlier ratios."""
        pairs = zip(self._stiffness, self._remembered, strict=True)
        return ratio * np.sum([K @ state[part] for K, part in pairs], axis=0)

    def take_over(self, state: RealArray, before: float, ratio: float) -> RealArray:
        """The state where the ratio changes."""
        state = state.copy()
        state[self._rest] += self.force(state, before) - self.force(state, ratio)
        return state

    def rates(self, ratio: float) -> RealArray:
        """A, joined by b and by the chain of the record's derivatives."""
        n, v = self.size, self._block(1)
        A = np.zeros((n + _DEGREE + 1,) * 2)
        one = np.eye(self._n)
        A[self.u, v] = one
        for K, part in zip(self._stiffness, self._remembered, strict=True):
            A[v, part] = -ratio * self._inverse @ K
        for tau, part in zip(self._times, self._remembered[1:], strict=True):
            A[part, v], A[part, part] = one, -one / tau
        A[v, self._rest] = -self._inverse
        A[self._rest, self._rest] = -one / FADING
        A[v, n] = self._inverse @ self._load
        A[range(n, n + _DEGREE), range(n + 1, n + _DEGREE + 1)] = 1.0
        return A
