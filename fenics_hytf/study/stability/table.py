# SPDX-License-Identifier: MIT
"""Stability maps as ``stability.csv``, and in words.

A row is a run, whatever its map; an empty field is an axis that the map does not have, or a figure
that does not exist. What has blown up beyond numbers is ``inf``.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from fenics_hytf.motion.files import replace_file
from fenics_hytf.study.stability.records import BLOCK, CONTRAST, FREQUENCY, LAPSES, StabilityRun
from fenics_hytf.study.stability.verdicts import Verdict

TABLE = "stability.csv"

AXES = (
    "path",
    "lapse_times_max_frequency",
    "damping",
    "modulus_left",
    "eta_lapse",
    "max_frequency_over_band",
    "lapse_samples",
    "lapses",
    "ghost",
    "fill",
    "cells_a_wavelength",
    "frequency_hz",
    "place",
    "contrast",
    "continuity",
    "sweep",
)
FIGURES = (
    "error",
    "amplitude_over_true",
    "growth_over_true",
    "energy_of_changes",
    "energy_imbalance",
    "condition",
    "residual",
    "refinement",
    "residual_floor",
)
_TITLES = {
    LAPSES: "length × damping × moduli × ηT",
    FREQUENCY: "length × highest frequency",
    BLOCK: "fill × frequency",
    CONTRAST: "contrast × damping",
}


def write_runs(path: Path, runs: Iterable[StabilityRun], append: bool = False) -> None:
    """Write runs.

    Args:
        path: The CSV file.
        runs: The runs.
        append: Whether the file is begun already, and goes on.
    """
    text = io.StringIO()
    columns = ["map", *AXES, *FIGURES, "verdict", "cpu_s"]
    table = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    if not append:
        table.writeheader()
    for run in runs:
        axes = {name: _field(value) for name, value in run.axes.items()}
        figures = {name: _field(value, 4) for name, value in run.figures.items()}
        ends = {"map": run.map, "verdict": run.verdict.value, "cpu_s": f"{run.cpu_s:.2f}"}
        table.writerow(axes | figures | ends)
    if append:
        with path.open("a", encoding="utf-8") as file:
            file.write(text.getvalue())
    else:
        replace_file(path, text.getvalue())


def summary(runs: Sequence[StabilityRun]) -> str:
    """How many runs of each map ended how, as lines of text."""
    lines = []
    for name, title in _TITLES.items():
        mine = [run for run in runs if run.map == name]
        if mine:
            counts = ", ".join(counted(mine))
            lines.append(f"{title}: {len(mine)} runs: {counts}")
    seconds = sum(run.cpu_s for run in runs)
    return "\n".join([*lines, f"{len(runs)} runs, {seconds:.0f} s of one core, references aside"])


def counted(runs: Sequence[StabilityRun]) -> list[str]:
    """Verdicts that there are, each with its number."""
    number = Counter(run.verdict for run in runs)
    return [f"{number[verdict]} {_PLURAL[verdict]}" for verdict in Verdict if number[verdict]]


_PLURAL = {
    Verdict.CONVERGES: "converge",
    Verdict.DRIFTS: "drift",
    Verdict.PUMPS: "pump",
    Verdict.BLOWS_UP: "blow up",
    Verdict.STOPS: "stop with an error",
}


def _field(value: float | str | None, digits: int = 6) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:.{digits}g}"
