# SPDX-License-Identifier: MIT
"""Stability maps as they are kept, read back from their table."""

from __future__ import annotations

import csv
from pathlib import Path

from fenics_hytf.study.stability.records import StabilityRun
from fenics_hytf.study.stability.table import AXES, FIGURES
from fenics_hytf.study.stability.verdicts import Verdict

WORDS = {"path", "ghost", "place", "continuity", "sweep"}


def read_runs(path: Path) -> list[StabilityRun]:
    """The runs of a table, with the axes and the figures that each has."""
    with open(path, encoding="utf-8", newline="") as file:
        return [
            StabilityRun(
                row["map"],
                {
                    name: row[name] if name in WORDS else float(row[name])
                    for name in AXES
                    if row[name]
                },
                {name: float(row[name]) for name in FIGURES if row[name]},
                Verdict(row["verdict"]),
                float(row["cpu_s"]),
            )
            for row in csv.DictReader(file)
        ]
