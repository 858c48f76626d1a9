# SPDX-License-Identifier: MIT
"""What is made of a run of a stability map: its figures, and which of four verdicts they mean.

Every limit stands here once. A run *converges* if nobody who uses it would see its error; it
*drifts* if it is wrong by more but bounded; it *blows up* if it grows where nothing acts, and
*stops* if it ends in an error of its own, which names what is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from fenics_hytf.lapse import Energy

RealArray = npt.NDArray[np.float64]

SMALL = 0.01
"""Error of a history over its peak that is small [-].

Records, moduli and damping of ground are known to some 10 %; seams are to add a tenth of that at
most. Twenty times what tests ask of lapses within the rule.
"""
SMALL_ENERGY = 2 * SMALL
"""Likewise of the energy ledger, over the energy that came in: energy goes with the square [-]."""
LARGEST = 2.0
"""Amplitude over the true one that no error of phase or period explains [-].
"""
PUMPED = 2.0
"""Energy that changes of the moduli bring over that which comes in at the base [-].

With more it is no longer the shaking that moves the ground, be its motion true or not. Moduli that
fall once bring up to 1.2, as stress that goes on strains softer ground more; moduli that swing to a
hundredth and back bring 8 and more.
"""
GROWTH = 2.0
"""Growth in still time over the true one, likewise: from its first half to its second [-]."""
SMALL_RESPONSE = 0.1
"""Error of a response at one frequency over its largest part that is small [-].

Beside a resonance of ground damped by 5 % a frequency that is 0.5 % off, what hard case 10 grants
a block on its way through a cell, makes up to 10 %.
"""
SINGULAR = 1e12
"""Condition number from which a solution in doubles is left to round-off [-]."""
SMALL_SOLUTION = 1e-3
"""Error of a solution that a sweep calls good, over its length, that is small [-].

A thousand times the default tolerance: a residual that small may hide no more.
"""


class Verdict(StrEnum):
    """How a run ended."""

    CONVERGES = "converges"
    DRIFTS = "drifts"
    BLOWS_UP = "blows up"
    STOPS = "stops"


@dataclass(frozen=True)
class HistoryFigures:
    """A motion against the true one.

    Attributes:
        error: Largest difference over the largest true value [-].
        amplitude: Largest value over the largest true one [-].
        growth: From the first to the second half of still time, over that of the true one; what is
            smaller than :data:`SMALL` of the peak counts as that [-].
        pumped: Largest sum of what changes of the moduli have brought, at seams and as the rest of
            stress that they leave fades, over the energy that came in [-].
        imbalance: Largest sum of what the energy ledgers lack, likewise [-].
    """

    error: float
    amplitude: float
    growth: float
    pumped: float
    imbalance: float


def measure_history(
    found: RealArray,
    true: RealArray,
    still: int,
    ledgers: Sequence[Energy] = (),
) -> HistoryFigures:
    """Measure a motion.

    Args:
        found: The motion [m], shape ``(num_places, num_samples)``.
        true: What it should be, likewise.
        still: Samples at the end in which nothing acts.
        ledgers: Energy of the lapses.

    Returns:
        The figures; infinite where the motion is not finite.
    """
    peak = float(np.abs(true).max())
    with np.errstate(over="ignore", invalid="ignore"):
        if not np.isfinite(found).all():
            return HistoryFigures(*[np.inf] * 5)
        error, largest = float(np.abs(found - true).max()), float(np.abs(found).max())
        growth = _growth(found, still, SMALL * peak) / _growth(true, still, SMALL * peak)
        pumped, lacking = _pumped_and_lacking(ledgers)
    return HistoryFigures(error / peak, largest / peak, growth, pumped, lacking)


def _growth(motion: RealArray, still: int, least: float) -> float:
    quiet = motion[:, -still:]
    first, second = np.abs(quiet[:, : still // 2]), np.abs(quiet[:, still // 2 :])
    return float(max(second.max(), least) / max(first.max(), least))


def _pumped_and_lacking(ledgers: Sequence[Energy]) -> tuple[float, float]:
    if not ledgers:
        return 0.0, 0.0
    come = sum(abs(ledger.input) for ledger in ledgers)
    brought = np.cumsum([ledger.seam - ledger.rest for ledger in ledgers]).max()
    lacking = np.abs(np.cumsum([ledger.imbalance for ledger in ledgers])).max()
    return float(brought / come), float(lacking / come)


def judge_history(figures: HistoryFigures) -> Verdict:
    """Judge a motion.

    Args:
        figures: Its figures.

    Returns:
        The verdict.
    """
    bounded = figures.amplitude <= LARGEST and figures.growth <= GROWTH
    if not bounded or figures.pumped > PUMPED:
        return Verdict.BLOWS_UP
    good = figures.error <= SMALL and figures.imbalance <= SMALL_ENERGY
    return Verdict.CONVERGES if good else Verdict.DRIFTS


def judge_response(error: float, amplitude: float, condition: float) -> Verdict:
    """Judge a response at one frequency.

    Args:
        error: Largest difference from the true one over its largest part [-].
        amplitude: Largest part over the largest true one [-].
        condition: Condition number of the matrix it was solved with [-].

    Returns:
        The verdict; a matrix that is singular to doubles counts as a response out of bounds,
        whatever the luck of its solution.
    """
    if not (condition < SINGULAR and amplitude <= LARGEST):
        return Verdict.BLOWS_UP
    return Verdict.CONVERGES if error <= SMALL_RESPONSE else Verdict.DRIFTS


def judge_solution(error: float | None) -> Verdict:
    """Judge what a sweep makes of equations.

    Args:
        error: Of the worst solution over its length [-], ``None`` where the sweep has refused it.

    Returns:
        The verdict.
    """
    if error is None:
        return Verdict.STOPS
    if not np.isfinite(error):
        return Verdict.BLOWS_UP
    return Verdict.CONVERGES if error <= SMALL_SOLUTION else Verdict.DRIFTS
