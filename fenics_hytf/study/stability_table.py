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
from fenics_hytf.study.stability import BLOCK, CONTRAST, FREQUENCY, LAPSES, StabilityRun
from fenics_hytf.study.stability_verdicts import Verdict

TABLE = "stability.csv"

_AXES = {  # name in a run: column
    "path": "path",
    "periods": "lapse_times_max_frequency",
    "damping": "damping",
    "fraction": "modulus_left",
    "decay": "eta_lapse",
    "above_band": "max_frequency_over_band",
    "lapse_samples": "lapse_samples",
    "lapses": "lapses",
    "ghost": "ghost",
    "fill": "fill",
    "waves": "cells_a_wavelength",
    "frequency_hz": "frequency_hz",
    "place": "place",
    "contrast": "contrast",
    "continuity": "continuity",
    "sweep": "sweep",
}
_FIGURES = {
    "error": "error",
    "amplitude": "amplitude_over_true",
    "growth": "growth_over_true",
    "pumped": "energy_of_changes",
    "imbalance": "energy_imbalance",
    "condition": "condition",
    "residual": "residual",
    "refinement": "refinement",
    "floor": "residual_floor",
}
_WORDS = {"path", "ghost", "place", "continuity", "sweep"}
_TITLES = {
    LAPSES: "length × damping × moduli × ηT",
    FREQUENCY: "length × highest frequency",
    BLOCK: "fill × frequency",
    CONTRAST: "contrast × damping",
}


def write_runs(path: Path, runs: Iterable[StabilityRun]) -> None:
    """Write the runs of all maps.

    Args:
        path: The CSV file.
        runs: The runs.
    """
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["map", *_AXES.values(), *_FIGURES.values(), "verdict", "cpu_s"])
    for run in runs:
        axes = [_field(run.axes.get(name)) for name in _AXES]
        figures = [_field(run.figures.get(name), 4) for name in _FIGURES]
        table.writerow([run.map, *axes, *figures, run.verdict.value, f"{run.cpu_s:.2f}"])
    replace_file(path, text.getvalue())


def read_runs(path: Path) -> list[StabilityRun]:
    """Read what :func:`write_runs` has written.

    Args:
        path: The CSV file.

    Returns:
        The runs, with the axes and the figures that each has.
    """
    with open(path, encoding="utf-8", newline="") as file:
        return [
            StabilityRun(
                row["map"],
                {
                    name: row[column] if name in _WORDS else float(row[column])
                    for name, column in _AXES.items()
                    if row[column]
                },
                {name: float(row[c]) for name, c in _FIGURES.items() if row[c]},
                Verdict(row["verdict"]),
                float(row["cpu_s"]),
            )
            for row in csv.DictReader(file)
        ]


def summary(runs: Sequence[StabilityRun]) -> str:
    """How many runs of each map ended how, as lines of text."""
    lines = []
    for name, title in _TITLES.items():
        mine = [run for run in runs if run.map == name]
        if mine:
            counts = ", ".join(counted(mine))
            lines.append(f"{title}: {len(mine)} runs: {counts}")
    seconds = sum(run.cpu_s for run in runs)
    return "\n".join(
        [*lines, f"{len(runs)} runs, {seconds:.0f} s of one core and their references"]
    )


def counted(runs: Sequence[StabilityRun]) -> list[str]:
    """Verdicts that there are, each with its number."""
    number = Counter(run.verdict for run in runs)
    return [f"{number[verdict]} {_PLURAL[verdict]}" for verdict in Verdict if number[verdict]]


_PLURAL = {
    Verdict.CONVERGES: "converge",
    Verdict.DRIFTS: "drift",
    Verdict.BLOWS_UP: "blow up",
    Verdict.STOPS: "stop with an error",
}


def _field(value: float | str | None, digits: int = 6) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:.{digits}g}"
