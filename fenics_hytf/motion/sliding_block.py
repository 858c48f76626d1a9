# SPDX-License-Identifier: MIT
"""Sliding blocks: the slip λ of a mechanism that yields one way under a force in time.

A mechanism slips down whenever the force that drives it would exceed what it can take:

    Q(t) = Q_lin(t) − (P * λ̈)(t) ≤ Q_y,    λ̇ ≥ 0,    λ̇ (Q − Q_y) = 0

Q_lin is the driving force of the linear response without slip, P the inertia that slip sets in
motion: its kernel. Three analyses differ in these two only:

- *coupled*: P of the ground above and below the mechanism, as quadrature weights (``convolution``);
- *decoupled* (Makdisi and Seed 1978): Q_lin the same, P = m, a mass without memory;
- *rigid* (Newmark 1965): P = m as well, and Q_lin = m a.

The march takes the second derivative of λ by the backward differentiation formula of second order,
twice, as the quadrature does (Lubich 1988). In increments d_n = λ_n − λ_{n−1} it is

    α_n = (9/4 d_n − 15/4 d_{n−1} + 7/4 d_{n−2} − 1/4 d_{n−3}) / δt²

and a step finds d_n = max(0, root of p₀ α_n = Q_lin,n − Q_y − Σ_{m<n} p_{n−m} α_m).
Where the march begins, α jumps from nought to its value, and the convolution takes a jump with half
its weight: α₀ is half of what the force asks for. A march that goes on from the rate of another one
is thereby of second order in δt, of first order otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

RealArray = npt.NDArray[np.float64]


class SlipError(RuntimeError):
    """A march that left the finite numbers."""


@dataclass(frozen=True, eq=False)
class SlipHistory:
    """Slip at equal time steps, from the instant where it is counted from.

    Attributes:
        slip: λ [m], shape ``(num_steps,)``.
        rate: λ̇ [m/s], shape ``(num_steps,)``; nought at the step where slip has come to rest.
        acceleration: α, the λ̈ that the convolution takes [m/s^2], shape ``(num_steps,)``.
    """

    slip: RealArray
    rate: RealArray
    acceleration: RealArray

    @property
    def num_steps(self) -> int:
        """Number of steps that were marched."""
        return self.slip.size


def march(
    driving: npt.ArrayLike,
    yield_force: float,
    weights: npt.ArrayLike,
    dt: float,
    start_rate: float = 0.0,
    most_slip: float | None = None,
) -> SlipHistory:
    """Slip of a mechanism that moves the ground which drives it.

    Sample 0 is the instant from which slip is counted. A march that goes on from another one starts
    with the rate that one ends with, at the sample where it ends. P gives the force of slip that
    starts from rest: where damping resists the motion of the mechanism itself (Cφ ≠ 0), the force
    of a steady ``start_rate`` belongs to ``driving``, as does all that is carried in the ground.

    Time steps of 5 ms are short enough for earthquakes, 10 ms are not. The work is num_steps²/2
    products: half a second for 20 000 steps.

    Args:
        driving: Q_lin [N], shape ``(num_steps,)``.
        yield_force: Q_y [N].
        weights: p_n of P [kg], at least ``num_steps``, the first one positive, shape
            ``(num_weights,)``.
        dt: Time step δt [s].
        start_rate: λ̇ at sample 0 [m/s], not negative.
        most_slip: Slip [m] after which to stop: the first step with more of it is the last one.

    Returns:
        The slip, of ``num_steps`` steps or fewer.

    Raises:
        ValueError: If an argument is out of range or not finite.
        SlipError: If the march leaves the finite numbers; its weights are then those of no passive
            ground.
    """
    forces, kernel = _row("driving", driving), _row("weights", weights)
    if kernel.size < forces.size:
        raise ValueError(
            f"weights: found {kernel.size}; expected at least {forces.size}, one for each step"
        )
    return _slip(forces, yield_force, kernel[: forces.size], dt, start_rate, most_slip)


def rigid_slip(
    drive: npt.ArrayLike, yield_acceleration: float, dt: float, start_rate: float = 0.0
) -> SlipHistory:
    """Slip of Newmark's rigid block, P = m.

    The work grows with the number of steps alone: where only the tips of peaks make it slip, refine
    the drive until that no longer matters.

    Args:
        drive: Acceleration of the block's inertia, downslope positive: that of the base with its
            sign turned [m/s^2], shape ``(num_steps,)``.
        yield_acceleration: g k_y [m/s^2].
        dt: Time step δt [s].
        start_rate: λ̇ at sample 0 [m/s], not negative.

    Returns:
        The slip.

    Raises:
        ValueError: If an argument is out of range or not finite.
    """
    return _slip(_row("drive", drive), yield_acceleration, np.ones(1), dt, start_rate, None)


def decoupled_slip(
    driving: npt.ArrayLike, yield_force: float, mass: float, dt: float
) -> SlipHistory:
    """Slip of a rigid block under the average acceleration of the linear response, Q_lin/L.

    Args:
        driving: Q_lin [N], shape ``(num_steps,)``.
        yield_force: Q_y [N].
        mass: L, the mass that the mechanism carries [kg].
        dt: Time step δt [s].

    Returns:
        The slip.

    Raises:
        ValueError: If an argument is out of range or not finite.
    """
    if not (np.isfinite(mass) and mass > 0.0):
        raise ValueError(f"mass: found {mass}; expected a positive mass in kg")
    return rigid_slip(_row("driving", driving) / mass, yield_force / mass, dt)


def straight_lines(samples: npt.ArrayLike, substeps: int) -> RealArray:
    """Samples with others between them, on straight lines.

    Args:
        samples: In any unit, shape ``(..., num_samples)``.
        substeps: Steps from one sample to the next.

    Returns:
        From the first sample to the last, shape ``(..., (num_samples − 1)·substeps + 1)``.

    Raises:
        ValueError: If there is no sample or no step.
    """
    coarse = np.asarray(samples, dtype=np.float64)
    if coarse.ndim == 0 or coarse.shape[-1] == 0:
        raise ValueError(f"samples: found shape {coarse.shape}; expected at least one sample")
    if substeps != int(substeps) or substeps < 1:
        raise ValueError(f"substeps: found {substeps}; expected a whole number from 1")
    index, part = np.divmod(np.arange((coarse.shape[-1] - 1) * int(substeps) + 1), int(substeps))
    after = np.minimum(index + 1, coarse.shape[-1] - 1)
    share = part / substeps
    return np.asarray((1.0 - share) * coarse[..., index] + share * coarse[..., after])


def _row(name: str, values: npt.ArrayLike) -> RealArray:
    """Values as one row of finite numbers, or ValueError."""
    row = np.ascontiguousarray(values, dtype=np.float64)
    if row.ndim != 1 or row.size == 0:
        raise ValueError(f"{name}: found shape {row.shape}; expected one row of numbers")
    if not np.isfinite(row).all():
        raise ValueError(
            f"{name}: found {np.count_nonzero(~np.isfinite(row))} that are not finite; expected "
            "finite numbers"
        )
    return row


def _slip(
    driving: RealArray,
    yield_force: float,
    weights: RealArray,
    dt: float,
    start_rate: float,
    most_slip: float | None,
) -> SlipHistory:
    """The march; weights beyond those given are nought."""
    if not np.isfinite(yield_force):
        raise ValueError(f"yield_force: found {yield_force}; expected a finite number")
    if not (np.isfinite(dt) and dt > 0.0):
        raise ValueError(f"dt: found {dt}; expected a positive time step in seconds")
    if not weights[0] > 0.0:
        raise ValueError(f"weights: found {weights[0]} as the first; expected a positive mass")
    if not (np.isfinite(start_rate) and start_rate >= 0.0):
        raise ValueError(f"start_rate: found {start_rate}; expected a rate >= 0, slip is one way")
    limit = np.inf if most_slip is None else most_slip
    if not limit > 0.0:
        raise ValueError(f"most_slip: found {most_slip}; expected a positive slip, or None")
    # three increments before sample 0, which the steps go on from
    increments = np.full(driving.size + 3, start_rate * dt)
    acceleration = np.zeros(driving.size)
    # the last one first: the convolution then runs forward through both its factors
    backward = np.ascontiguousarray(weights[::-1])
    steps = _march(
        driving - yield_force, backward, dt * dt, start_rate * dt, limit, increments, acceleration
    )
    taken = increments[2 : steps + 3]
    slip = np.cumsum(taken[1:]) - start_rate * dt
    if not np.isfinite(slip[-1]):
        raise SlipError(
            f"the march: found slip of {slip[-1]} m after {steps} steps of {dt} s; expected a "
            "finite one; check that the kernel is causal and passive"
        )
    rate = np.maximum(1.5 * taken[1:] - 0.5 * taken[:-1], 0.0) / dt
    return SlipHistory(slip, rate, acceleration[:steps])


@njit(cache=True, fastmath={"reassoc", "contract"})
def _march(  # type: ignore[no-untyped-def]
    excess, backward, dt2, before, most_slip, increments, acceleration
):
    """Fill increments (three of them are there) and α; returns the number of steps taken."""
    memory, slip = len(backward), -before
    first = backward[memory - 1]
    for n in range(len(excess)):
        oldest = max(0, n - memory + 1)
        shift = memory - 1 - n
        past = 0.0
        for m in range(oldest, n):
            past += backward[shift + m] * acceleration[m]
        force = excess[n] - past if n > 0 else 0.5 * excess[n]
        known = 3.75 * increments[n + 2] - 1.75 * increments[n + 1] + 0.25 * increments[n]
        taken = max(0.0, (force / first * dt2 + known) / 2.25)
        acceleration[n] = (2.25 * taken - known) / dt2
        increments[n + 3] = taken
        slip += taken
        if not slip <= most_slip:
            return n + 1
    return len(excess)
