# SPDX-License-Identifier: MIT
"""What must hold of a result: every number there, mass accounted for, JSON that all can read."""

import csv
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import meshio
import numpy as np

TINY = 1e-300
"""Intensity of a motion that is nothing but rounding: squares of its samples vanish."""

_TABLES = ("receivers", "base", "transfer", "spectra", "cells", "slip")
_NULLS = (
    r"scene\..*",  # what the scene leaves open
    r"base\.[xyz]\.outcrop_(pga_g|intensity)",  # the base is rigid
    r"energy|sliding|softening|worst_seam_error",  # not called for, or one lapse
    r"energy\.worst_imbalance",  # nothing came in
    r"lapses\[\]\.(energy|seam_error|slip|softening|degradation|final_change|worst_cell)",
    r"lapses\[\]\.layers\[\]\.(change|converged|degradation)",  # no loop, or none
    r"(lapses\[\]\.slip|sliding)\.note",
    r"(lapses\[\]\.slip|sliding)\.factor_of_safety",  # gravity shears nothing
    r"(lapses\[\]\.slip|sliding)\.yield_over_peak",  # nothing drives
    r"sliding\.at_rest_s",  # still moving at the end
    r"versions\..*",  # not installed
)
"""Keys of the summary that may be empty, and why."""

_EMPTIES = {"cells": ("vertical_stress", "stress_ratio", "change")}
"""Columns that may be: the overburden is not known of each mesh, nor is there always a loop."""


def complaints_about(folder: Path, finished: bool) -> list[str]:
    """What does not hold of a result.

    Args:
        folder: Of the result.
        finished: Whether the run came to its end.

    Returns:
        Complaints.
    """
    found = []
    name = "summary.json" if finished else "partial-summary.json"
    if not (folder / name).exists():
        return [f"no {name}"] if finished else []
    try:
        summary = json.loads((folder / name).read_text(), parse_constant=_refuse)
    except ValueError as error:
        return [f"{name}: {error}"]
    _fill_durations(summary["base"], summary["intensity"])
    found += [f"{name}: null at {place}" for place in sorted(set(_odd_nulls(summary)))]
    for lapse in summary["lapses"]:
        if lapse["mass_ledger"]["imbalance"] != 0.0:  # of exact sums: no rounding to allow for
            found.append(f"lapse {lapse['index']}: mass off by {lapse['mass_ledger']}")
    lost = any(lapse["points_lost"] or lapse["points_parked"] for lapse in summary["lapses"])
    riding = {n for n, r in summary["receivers"].items() if r["rides"]} if lost else set()
    for table in _TABLES:
        if (folder / f"{table}.csv").exists():
            found += _odd_fields(folder / f"{table}.csv", _EMPTIES.get(table, ()), riding)
    for file in folder.glob("*.vtu"):
        found += _odd_arrays(file)
    return found


def _refuse(constant: str) -> Any:
    raise ValueError(f"{constant} is no JSON")


def _fill_durations(*tables: Any) -> None:
    """A motion without intensity has no significant duration: that is no fault."""
    for table in tables:
        if not isinstance(table, dict):
            continue
        if table.get("arias_m_s", 1.0) <= TINY and table["d5_95_s"] is None:
            table["d5_95_s"] = 0.0
        _fill_durations(*table.values())


def _odd_nulls(value: Any, place: str = "") -> Iterator[str]:
    if value is None and not any(re.fullmatch(pattern, place) for pattern in _NULLS):
        yield place
    elif isinstance(value, dict):
        for name, item in value.items():
            yield from _odd_nulls(item, f"{place}.{name}".lstrip("."))
    elif isinstance(value, list):
        for item in value:
            yield from _odd_nulls(item, f"{place}[]")


def _odd_fields(path: Path, empties: tuple[str, ...], riding: set[str]) -> list[str]:
    odd: dict[str, int] = {}
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.DictReader(file)
        for row in rows:
            for name, text in row.items():
                if name == "region" or (text == "" and name in empties):
                    continue
                if text == "" and name.split(".")[0] in riding:
                    continue
                if not text or not math.isfinite(float(text)):
                    odd[name] = odd.get(name, 0) + 1
    return [f"{path.name}: {count} times no number in {name}" for name, count in odd.items()]


def _odd_arrays(path: Path) -> list[str]:
    mesh = meshio.read(path)
    arrays = {"points": mesh.points} | mesh.point_data
    arrays |= {name: np.concatenate(parts) for name, parts in mesh.cell_data.items()}
    return [
        f"{path.name}: {name} is not finite"
        for name, values in arrays.items()
        if not np.isfinite(values).all()
    ]
