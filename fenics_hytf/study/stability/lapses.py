# SPDX-License-Identifier: MIT
"""The stability maps of lapses: how long, how damped, and cut how high above the motion's band."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product

import numpy as np
import numpy.typing as npt

from fenics_hytf.lapse import HANDOVER
from fenics_hytf.study.stability.column import ColumnCase
from fenics_hytf.study.stability.records import FREQUENCY, LAPSES, Job, MapValues, Row
from fenics_hytf.study.stability.reference import true_motion
from fenics_hytf.study.stability.verdicts import judge_history, measure_history

RealArray = npt.NDArray[np.float64]

DEFAULT_DECAY = round(HANDOVER[1] / HANDOVER[0], 6)
"""ηT of the contour of a run [-], with the digits of the table: so it is found there again."""

_PERIODS = (5.0, 7.0, 10.0, 14.0, 20.0, 40.0)
_SWING_DAMPING = 0.05


def lapse_jobs(
    periods: Sequence[float] = _PERIODS,
    damping: Sequence[float] = (0.0, 0.01, 0.05, 0.2),
    falls: Sequence[float] = (1.0, 0.3, 0.1, 0.01),
    swings: Sequence[float] = (0.6, 0.3, 0.1, 0.01),
    decay: Sequence[float] = (0.6, 1.15, 1.6, DEFAULT_DECAY, 3.2, 4.6, 6.9),
) -> Iterator[Job]:
    """Length of a lapse × damping × moduli left × ηT.

    Args:
        periods: Length of a lapse times the highest frequency [-].
        damping: Damping ratio where moduli fall [-].
        falls: Fractions that moduli fall to [-].
        swings: Fractions that moduli swing to [-].
        decay: ηT [-].

    Yields:
        The runs that differ in ηT alone.
    """
    falling = product(damping, falls, ("falls",))
    swinging = product((_SWING_DAMPING,), swings, ("swings",))
    for (ratio, fraction, path), length in product([*falling, *swinging], periods):
        yield _job(LAPSES, ColumnCase(length, ratio, fraction, path), decay)


def frequency_jobs(
    periods: Sequence[float] = _PERIODS,
    damping: Sequence[float] = (0.0, 0.05),
    falls: Sequence[float] = (1.0, 0.1),
    above_band: Sequence[float | None] = (1.0, 1.4, 2.0, 2.8, 4.0, None),
) -> Iterator[Job]:
    """Length of a lapse × highest frequency, at the ηT of a run.

    Args:
        periods: Length of a lapse times the highest frequency [-].
        damping: Damping ratio [-].
        falls: Fractions that moduli fall to [-].
        above_band: Highest frequency over the motion's band [-]; ``None``: that of the samples.

    Yields:
        A run at a time.
    """
    for ratio, fraction, above, length in product(damping, falls, above_band, periods):
        case = ColumnCase(length, ratio, fraction, above_band=above)
        yield _job(FREQUENCY, case, (DEFAULT_DECAY,))


def _job(name: str, case: ColumnCase, decay: Sequence[float]) -> Job:
    text = (
        f"lapses of {case.periods:g} periods, damping {case.damping:g}, moduli "
        f"{'fall' if case.path == 'falls' else 'swing'} to {case.fraction:g}"
    )
    return Job(name, text, len(decay), partial(_runs, case, decay))


def _runs(case: ColumnCase, decay: Sequence[float]) -> Iterator[Row]:
    true = true_motion(case)
    return (_run(case, eta, true) for eta in decay)


def _run(case: ColumnCase, decay: float, true: RealArray) -> Row:
    motion, ledgers = case.march(decay)
    figures = measure_history(motion, true, case.still, ledgers)
    axes: MapValues = {
        "path": case.path,
        "lapse_times_max_frequency": case.periods,
        "damping": case.damping,
        "modulus_left": case.fraction,
        "eta_lapse": decay,
        "max_frequency_over_band": case.cut_above_band,
        "lapse_samples": case.length,
        "lapses": len(case.segments),
    }
    return axes, figures, judge_history(figures)
