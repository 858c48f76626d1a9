# SPDX-License-Identifier: MIT
"""Stability maps: where the method converges, where it drifts, where it blows up.

Three maps: lapses (length × damping × moduli left × ηT, and length × highest frequency), cut cells
(fill fraction × frequency, with the ghost term and without), and contrast × damping. What a scene
refuses is computed all the same, so that a map shows where the edge lies beyond the rule.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass

from fenics_hytf.lapse import HANDOVER
from fenics_hytf.study.records import StudyCallback, StudyProgress
from fenics_hytf.study.stability_block import CELL, SPEED, cut_block
from fenics_hytf.study.stability_column import ColumnCase
from fenics_hytf.study.stability_contrast import LINES, PLACES, SWEEPS, contrast_section
from fenics_hytf.study.stability_reference import true_motion
from fenics_hytf.study.stability_verdicts import (
    Verdict,
    judge_history,
    judge_response,
    judge_solution,
    measure_history,
)

LAPSES, FREQUENCY, BLOCK, CONTRAST = "lapses", "max_frequency", "cut_cells", "contrast"
"""Names of the maps; that of lapses has a figure of its own for the highest frequency."""

DEFAULT_DECAY = round(HANDOVER[1] / HANDOVER[0], 6)
"""ηT of the contour of a run [-]."""


@dataclass(frozen=True)
class Axes:
    """Values that maps are made at; see :class:`ColumnCase` and the other maps for what they are.

    Attributes:
        periods: Length of a lapse times the highest frequency [-].
        damping: Damping ratio [-].
        fraction: Of the shear modulus that is left [-].
        decay: ηT [-].
        swing_damping: Damping where moduli swing [-].
        swings: Fractions that moduli swing to [-].
        above_band: Highest frequency over the motion's band; ``None``: that of the samples.
        cut_damping: Damping ratio in the map of the highest frequency [-].
        cut_fraction: Of the shear modulus that is left there [-].
        fill: Share of the last cells that is filled [-].
        waves: Cells in the length of a shear wave [-].
        places: Where stiff ground lies.
        contrast: Shear modulus of the stiff over that of the soft ground [-].
        contrast_damping: Damping ratio of both [-].
    """

    periods: tuple[float, ...] = (5.0, 7.0, 10.0, 14.0, 20.0, 40.0)
    damping: tuple[float, ...] = (0.0, 0.01, 0.05, 0.2)
    fraction: tuple[float, ...] = (1.0, 0.3, 0.1, 0.01)
    decay: tuple[float, ...] = (0.6, 1.15, 1.6, DEFAULT_DECAY, 3.2, 4.6, 6.9)
    swing_damping: tuple[float, ...] = (0.05,)
    swings: tuple[float, ...] = (0.6, 0.3, 0.1, 0.01)
    above_band: tuple[float | None, ...] = (1.0, 1.4, 2.0, 2.8, 4.0, None)
    cut_damping: tuple[float, ...] = (0.0, 0.05)
    cut_fraction: tuple[float, ...] = (1.0, 0.1)
    fill: tuple[float, ...] = (1.0, 0.9, 0.75, 0.5, 0.25, 0.1, 0.03, 0.01, 1e-3, 1e-4, 1e-6)
    waves: tuple[float, ...] = (120.0, 80.0, 50.0, 30.0, 20.0, 15.0, 12.0, 10.0, 8.0, 6.0)
    places: tuple[str, ...] = tuple(PLACES)
    contrast: tuple[float, ...] = (1.0, 1e2, 1e4, 1e5, 1e6, 1e7, 1e8, 1e10)
    contrast_damping: tuple[float, ...] = (0.0, 0.01, 0.05, 0.1, 0.2)


@dataclass(frozen=True)
class StabilityRun:
    """A run of a map.

    Attributes:
        map: Name of the map.
        axes: Where in the map it lies, by name.
        figures: What was measured, by name; a figure that does not exist is ``None``.
        verdict: What that means.
        cpu_s: CPU time, references aside [s].
    """

    map: str
    axes: Mapping[str, float | str | None]
    figures: Mapping[str, float | None]
    verdict: Verdict
    cpu_s: float


@dataclass(frozen=True)
class Job:
    """Runs that share a reference.

    Attributes:
        text: What they are.
        count: How many there are.
        runs: Makes them.
    """

    text: str
    count: int
    runs: Callable[[], list[StabilityRun]]


def conduct_stability(
    axes: Axes | None = None, progress: StudyCallback | None = None
) -> list[StabilityRun]:
    """Make the maps.

    Args:
        axes: Where; everywhere if ``None``.
        progress: Called before every few runs.

    Returns:
        The runs of all maps.
    """
    jobs = list(plan(Axes() if axes is None else axes))
    planned = sum(job.count for job in jobs)
    runs: list[StabilityRun] = []
    for job in jobs:
        if progress is not None:
            progress(StudyProgress(len(runs), planned, job.text))
        runs += job.runs()
    return runs


def plan(axes: Axes) -> Iterator[Job]:
    """The runs of all maps, a few at a time."""
    falls = itertools.product(axes.damping, axes.fraction, ("falls",))
    swings = itertools.product(axes.swing_damping, axes.swings, ("swings",))
    for (damping, fraction, path), periods in itertools.product([*falls, *swings], axes.periods):
        case = ColumnCase(periods, damping, fraction, path)
        yield _column_job(LAPSES, case, axes.decay)
    cuts = itertools.product(axes.cut_damping, axes.cut_fraction, axes.above_band, axes.periods)
    for damping, fraction, above, periods in cuts:
        case = ColumnCase(periods, damping, fraction, above_band=above)
        yield _column_job(FREQUENCY, case, (DEFAULT_DECAY,))
    for fill, ghost in itertools.product(axes.fill, (True, False)):
        text = f"cut cells, {100 * fill:g} % filled, {'with' if ghost else 'without'} ghost term"
        yield Job(text, len(axes.waves), _block_runs(fill, ghost, axes.waves))
    sections = itertools.product(axes.places, axes.contrast, axes.contrast_damping)
    for place, contrast, damping in sections:
        text = f"{place}, contrast {contrast:g}, damping {damping:g}"
        count = len(LINES) * len(SWEEPS)
        yield Job(text, count, _contrast_runs(place, contrast, damping))


def _column_job(name: str, case: ColumnCase, decays: Sequence[float]) -> Job:
    text = (
        f"lapses of {case.periods:g} periods, damping {case.damping:g}, moduli "
        f"{'fall' if case.path == 'falls' else 'swing'} to {case.fraction:g}"
    )

    def runs() -> list[StabilityRun]:
        true = true_motion(case)
        found = []
        for decay in decays:
            start = time.process_time()
            motion, ledgers = case.march(decay)
            figures = measure_history(motion, true, case.still, ledgers)
            axes: dict[str, float | str | None] = {
                "path": case.path,
                "periods": case.periods,
                "damping": case.damping,
                "fraction": case.fraction,
                "decay": decay,
                "above_band": case.cut_above_band,
                "lapse_samples": case.length,
                "lapses": len(case.segments),
            }
            verdict, seconds = judge_history(figures), time.process_time() - start
            found.append(StabilityRun(name, axes, asdict(figures), verdict, seconds))
        return found

    return Job(text, len(decays), runs)


def _block_runs(
    fill: float, ghost: bool, waves: tuple[float, ...]
) -> Callable[[], list[StabilityRun]]:
    def runs() -> list[StabilityRun]:
        start = time.process_time()
        found = cut_block(fill, waves, ghost)
        seconds = (time.process_time() - start) / len(waves)
        return [
            StabilityRun(
                BLOCK,
                {
                    "ghost": "yes" if ghost else "no",
                    "fill": fill,
                    "waves": number,
                    "frequency_hz": SPEED / (CELL * number),
                },
                asdict(figures),
                judge_response(figures.error, figures.amplitude, figures.condition),
                seconds,
            )
            for number, figures in zip(waves, found, strict=True)
        ]

    return runs


def _contrast_runs(place: str, contrast: float, damping: float) -> Callable[[], list[StabilityRun]]:
    def runs() -> list[StabilityRun]:
        start = time.process_time()
        found = contrast_section(place, contrast, damping)
        seconds = (time.process_time() - start) / len(found)
        return [
            StabilityRun(
                CONTRAST,
                {
                    "place": place,
                    "contrast": contrast,
                    "damping": damping,
                    "continuity": continuity,
                    "sweep": sweep,
                },
                asdict(figures),
                judge_solution(figures.error),
                seconds,
            )
            for (continuity, sweep), figures in found.items()
        ]

    return runs
