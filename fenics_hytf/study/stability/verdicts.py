# SPDX-License-Identifier: MIT
"""What is made of a run of a stability map: its figures, and which of five verdicts they mean.

A run *converges* if nobody who uses it would see its error; it *drifts* if it is wrong by more but
bounded; it *pumps* if, right or wrong, it is bounded but gets more energy from changes of its
moduli than from the shaking; it *blows up* if it grows where nothing acts; and it *stops* if it
ends in an error of its own, which names what is wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from fenics_hytf.lapse import Energy
from fenics_hytf.simulation.margins import PUMPED

RealArray = npt.NDArray[np.float64]

SMALL = 0.01
"""Error of a history over its peak that is small [-].

Records, moduli and damping of ground are known to some 10 %; seams are to add a tenth of that at
most. Twenty times what tests ask of lapses within the rule.
"""
SMALL_ENERGY = 2 * SMALL
"""Likewise of the energy ledger, over the energy that came in: energy goes with the square [-]."""
LARGEST = 2.0
"""Amplitude over the true one that no error of phase or period explains [-]."""
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
    PUMPS = "pumps"
    BLOWS_UP = "blows up"
    STOPS = "stops"


def measure_history(
    found: RealArray,
    true: RealArray,
    still: int,
    ledgers: Sequence[Energy] = (),
) -> dict[str, float]:
    """Measure a motion against the true one.

    Args:
        found: The motion [m], shape ``(num_places, num_samples)``.
        true: What it should be, likewise.
        still: Samples at the end in which nothing acts.
        ledgers: Energy of the lapses.

    Returns:
        Figures [-], infinite where the motion is not finite: ``error``, the largest difference over
        the largest true value; ``amplitude_over_true``, of the largest values;
        ``growth_over_true``, of the growth from the first to the second half of still time, where
        what is smaller than :data:`SMALL` of the peak counts as that; ``energy_of_changes``, the
        largest sum of what changes of the moduli have brought, at seams and as the rest of stress
        that they leave fades, over the energy that came in; ``energy_imbalance``, the largest sum
        of what the energy ledgers lack, likewise.
    """
    figures = ("error", "amplitude_over_true", "growth_over_true")
    energies = ("energy_of_changes", "energy_imbalance")
    if not np.isfinite(found).all():
        return dict.fromkeys((*figures, *energies), np.inf)
    peak = float(np.abs(true).max())
    with np.errstate(over="ignore", invalid="ignore"):
        error, largest = float(np.abs(found - true).max()), float(np.abs(found).max())
        growth = _growth(found, still, SMALL * peak) / _growth(true, still, SMALL * peak)
        brought, lacking = _brought_and_lacking(ledgers)
    values = (error / peak, largest / peak, growth, brought, lacking)
    return dict(zip((*figures, *energies), values, strict=True))


def _growth(motion: RealArray, still: int, least: float) -> float:
    quiet = motion[:, -still:]
    first, second = np.abs(quiet[:, : still // 2]), np.abs(quiet[:, still // 2 :])
    return float(max(second.max(), least) / max(first.max(), least))


def _brought_and_lacking(ledgers: Sequence[Energy]) -> tuple[float, float]:
    if not ledgers:
        return 0.0, 0.0
    come = sum(abs(ledger.input) for ledger in ledgers)
    brought = np.cumsum([ledger.seam - ledger.rest for ledger in ledgers]).max()
    lacking = np.abs(np.cumsum([ledger.imbalance for ledger in ledgers])).max()
    return float(brought / come), float(lacking / come)


def judge_history(figures: Mapping[str, float]) -> Verdict:
    """Judge a motion.

    Args:
        figures: Those of :func:`measure_history`.

    Returns:
        The verdict.
    """
    if not (figures["amplitude_over_true"] <= LARGEST and figures["growth_over_true"] <= GROWTH):
        return Verdict.BLOWS_UP
    if figures["energy_of_changes"] > PUMPED:
        return Verdict.PUMPS
    good = figures["error"] <= SMALL and figures["energy_imbalance"] <= SMALL_ENERGY
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
