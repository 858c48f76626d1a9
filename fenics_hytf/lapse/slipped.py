# SPDX-License-Identifier: MIT
"""What slipped in a lapse, and what of it goes on: plain records."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fenics_hytf.lapse.mechanism import Mechanism
from fenics_hytf.motion import SlipHistory
from fenics_hytf.operators import evaluate

RealArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class SlipState:
    """What goes on from lapse to lapse.

    Attributes:
        rate: λ̇ [m/s].
        rigid_rate: Of a rigid block [m/s].
        decoupled_rate: Of a rigid block under the linear response [m/s].
        factor_of_safety: At rest, before shaking [-]; infinite where gravity shears nothing.
        axis: Component in which the mechanism is driven.
        sense: Of the motion that drives it along the axis, 1 or -1.
    """

    rate: float
    rigid_rate: float
    decoupled_rate: float
    factor_of_safety: float
    axis: int
    sense: int


@dataclass(frozen=True, eq=False)
class Slipped:
    """What slipped in a lapse, the same on every rank but for φ.

    Attributes:
        mechanism: φ and k_y.
        unknowns: φ on this rank's unknowns [-], shape ``(num_local_unknowns,)``.
        before: What the lapse began with.
        after: What the next one begins with.
        history: λ, λ̇ and λ̈ at the time steps of the march, the first at the start of the lapse.
        time_step: Of the march [s].
        substeps: Steps of the march in one of the record.
        driving: Q_lin over φᵀM r, the acceleration of the linear response that drives the mechanism
            [m/s^2], at the steps of the march up to the end of the lapse.
        num_samples: Samples of the lapse, fewer than planned where a new mechanism is due.
        mass: φᵀM r [kg, in 2D kg/m].
        modal_mass: φᵀMφ [kg, in 2D kg/m].
        rigid: What a rigid block slips in the lapse, times φᵀM r/φᵀMφ to be compared with λ [m].
        decoupled: Likewise of a rigid block under ``driving`` [m].
        yield_force: Q_y [N, in 2D N/m].
    """

    mechanism: Mechanism
    unknowns: RealArray
    before: SlipState
    after: SlipState
    history: SlipHistory
    time_step: float
    substeps: int
    driving: RealArray
    num_samples: int
    mass: float
    modal_mass: float
    rigid: float
    decoupled: float
    yield_force: float

    @property
    def total(self) -> float:
        """λ at the end of the lapse [m]."""
        return float(self.history.slip[-1])

    def at_end(self, derivative: int = 0) -> RealArray:
        """λφ or a derivative at the end of the lapse, shape ``(num_local_nodes, gdim)``."""
        last = (self.history.slip, self.history.rate, self.history.acceleration)[derivative][-1]
        return np.asarray(last * self.mechanism.field)

    def at_samples(self, derivative: int = 0) -> RealArray:
        """λ or a derivative at the samples of the lapse, shape ``(num_samples,)``."""
        if derivative == 2:
            return self._sampled_acceleration()
        history = (self.history.slip, self.history.rate)[derivative]
        return history[: -1 : self.substeps].copy()

    def _sampled_acceleration(self) -> RealArray:
        """Mean of λ̈ about each sample, weighed by 1 − |t|/dt.

        What lasts for a step of the march, as where a mechanism gives way to the next, a record of
        longer steps does not see as if it lasted for a sample.
        """
        steps, alpha = self.substeps, self.history.acceleration
        weights = 1 - np.abs(np.arange(1 - steps, steps)) / steps
        padded = np.concatenate([np.zeros(steps - 1), alpha])
        means = np.convolve(padded, weights, "valid")[: len(alpha) - 1 : steps] / steps
        # Before the first sample there is nothing of the lapse; of that the march takes a half.
        means[:1] *= 2
        return np.asarray(means)

    def seen_by(self, rows: PETSc.Mat) -> RealArray:
        """This rank's rows of a matrix times φ, shape ``(num_local_rows,)``."""
        return evaluate(rows, self.unknowns)

    def added_to(self, rows: PETSc.Mat, derivative: int = 0) -> RealArray:
        """What slip adds to histories of displacement or a derivative.

        Args:
            rows: Rows that evaluate the displacement.
            derivative: Order of the time derivative.

        Returns:
            This rank's rows, shape ``(num_local_rows, num_samples)``.
        """
        return np.asarray(np.outer(self.seen_by(rows), self.at_samples(derivative)))
