# SPDX-License-Identifier: MIT
"""A study as ``accuracy.csv``, as ``accuracy.json`` and as a table to read.

A row is a run. Errors are in per cent, costs in core-seconds; an empty field is a number that does
not exist, such as the error of a run that failed.
"""

from __future__ import annotations

import csv
import io
import itertools
import json
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fenics_hytf.motion.files import replace_file
from fenics_hytf.results.summary import own_version
from fenics_hytf.study.knobs import LABELS, MESH
from fenics_hytf.study.records import Point, Study, core_s, pareto
from fenics_hytf.study.slip_measures import MEASURES
from fenics_hytf.study.verdict import percent

_MakeRow = Callable[[Point, str, str], tuple[str, ...]]

TABLE, RECORD, FIGURE = "accuracy.csv", "accuracy.json", "accuracy.png"

_MIB = 2**20
_READ = ("error", "ln PSA", "core-s", "factorisations", "MiB")  # columns of what a person reads
_COLUMNS = (
    "problem",
    "setting",
    "why",
    "error_percent",
    "ln_psa",
    "worst_receiver",
    "core_s",
    "wall_s",
    "factorisations",
    "solves",
    "peak_memory_mib",
    "unknowns",
    "cells",
    "pareto",
    "resolved",
    "failure",
)
_KNOB_COLUMNS = {
    "cells": "cells_factor",
    "degree": "degree",
    "points": "points_per_cell",
    "sweep": "sweep_tolerance",
    "band": "max_frequency_hz",
    "lapses": "lapses",
    "loop": "loop_tolerance",
    "step": "slip_time_step_s",
}


def write_tables(folder: Path, study: Study) -> None:
    """Write ``accuracy.csv`` and ``accuracy.json``.

    Args:
        folder: Where.
        study: The study.
    """
    replace_file(folder / TABLE, _csv(study))
    text = json.dumps(_record(study), indent=1, allow_nan=False, ensure_ascii=False)
    replace_file(folder / RECORD, text + "\n")


def table(study: Study) -> str:
    """The runs of the scene as lines of text: the front, what each knob does alone, the scene."""
    return _told(study, ("", *_READ), _row)


def slip_table(study: Study) -> str:
    """The same of what slid; nothing where nothing does."""
    seen = study.of_slip()
    if seen is None:
        return ""
    _, *others = MEASURES.values()
    return _told(seen, ("slip", "m", "error", *others, "core-s"), _slid_row)


def _told(study: Study, heading: tuple[str, ...], row: _MakeRow) -> str:
    front = pareto(study.points)
    rows = [heading, ("Pareto front",)]
    rows += [row(point, point.name, " ") for point in front]
    fine = next((p for p in study.points if "fine" in p.families), study.finest)
    others = "" if fine is None or fine == study.own else f", otherwise {fine.name}"
    for knob, label in LABELS.items():
        mine = sorted((p for p in study.points if knob in p.families), key=core_s)
        if any("fine" not in point.families for point in mine):  # which has all knobs
            rows += [("",), (f"{label} alone{others}",)]
            rows += [row(p, _alone(p, knob), "*" if p in front else " ") for p in mine]
    rows += [("",), row(study.own, "the scene as it is", " ")]
    if study.finest is not None:
        rows.append(row(study.finest, f"reference: {study.finest.name}", " "))
    return _aligned(rows)


def twin_table(study: Study) -> str:
    """The runs of the viscous twin as lines of text; nothing where there are none."""
    if not study.twin.points:
        return ""
    front = pareto(study.twin.points)
    rows = [_row(p, p.name, "*" if p in front else " ") for p in study.twin.points]
    return _aligned([("viscous twin", *_READ), *rows])


def _alone(point: Point, knob: str) -> str:
    """The value of a knob; mesh size and degree belong together."""
    names = MESH if knob in MESH else (knob,)
    return ", ".join(point.words[name] for name in names)


def _row(point: Point, name: str, mark: str) -> tuple[str, ...]:
    name = f"{mark} {name}"
    if point.cost is None:
        return (name, "failed")
    error = point.error
    return (
        name,
        _off(point),
        f"{error.ln_psa:.2g}" if error is not None and error.relative_l2 else "",
        f"{point.cost.core_s:.3g}",
        f"{point.cost.factorisations}",
        f"{point.cost.peak_memory / _MIB:.0f}",
    )


def _slid_row(point: Point, name: str, mark: str) -> tuple[str, ...]:
    name = f"{mark} {name}"
    if point.cost is None:
        return (name, "failed")
    slip, *others = MEASURES
    errors = {} if point.error is None else point.error.slides
    return (
        name,
        f"{point.slid[slip]:.4g}",
        _off(point),
        *(percent(errors[other]) if other in errors else "" for other in others),
        f"{point.cost.core_s:.3g}",
    )


def _off(point: Point) -> str:
    """An error as it is read."""
    if point.error is None or point.error.relative_l2 == 0:
        return "0 %"
    return percent(point.error.relative_l2) if point.resolved else f"<{percent(point.at_most)}"


def _aligned(rows: list[tuple[str, ...]]) -> str:
    full = [row for row in rows if row[1:]]  # a heading may be longer than its column
    columns = itertools.zip_longest(*full, fillvalue="")
    width = [max(map(len, column)) for column in columns]
    lines = [[row[0].ljust(width[0]), *(map(str.rjust, row[1:], width[1:]))] for row in rows]
    return "\n".join("  ".join(line).rstrip() for line in lines)


def _csv(study: Study) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    knobs = list(_KNOB_COLUMNS)
    columns = [*_COLUMNS, *(_slid_fields(study.own) if study.slip_reference else ())]
    writer.writerow([*columns, *(_KNOB_COLUMNS[k] for k in knobs), "substeps", "set"])
    for problem, points in _problems(study):
        front = pareto(points)
        for point in points:
            row = _fields(problem, point, point in front) | _slid_fields(point)
            values = [point.values.get(knob) for knob in knobs]
            row_end = [point.substeps or None, " ".join(point.overrides)]
            writer.writerow([*(row.get(name) for name in columns), *values, *row_end])
    return text.getvalue()


def _problems(study: Study) -> Iterable[tuple[str, tuple[Point, ...]]]:
    return ("scene", study.points), ("viscous twin", study.twin.points)


def _fields(problem: str, point: Point, on_front: bool) -> dict[str, Any]:
    cost, error = point.cost, point.error
    return {
        "problem": problem,
        "setting": point.name,
        "why": " ".join(name.replace(" ", "_") for name in point.families),
        "error_percent": None if error is None else 100 * error.relative_l2,
        "ln_psa": None if error is None else _finite(error.ln_psa),
        "worst_receiver": None if error is None else error.receiver,
        "core_s": cost and cost.core_s,
        "wall_s": cost and cost.wall_s,
        "factorisations": cost and cost.factorisations,
        "solves": cost and cost.solves,
        "peak_memory_mib": cost and cost.peak_memory / _MIB,
        "unknowns": cost and cost.unknowns,
        "cells": cost and cost.cells,
        "pareto": on_front,
        "resolved": point.resolved,
        "failure": point.failure,
    }


def _slid_fields(point: Point) -> dict[str, float | None]:
    """What slid, and how far it is from that of the reference."""
    errors = {} if point.error is None else point.error.slides
    off = {name: _finite(100 * errors[name]) if name in errors else None for name in point.slid}
    return {**point.slid, **{f"{name}_error_percent": value for name, value in off.items()}}


def _record(study: Study) -> dict[str, Any]:
    """Everything, for programs."""
    twin = study.twin.reference
    return {
        "title": study.title,
        "version": own_version(),
        "complete": study.complete,
        "reference": asdict(study.reference),
        "slip_reference": study.slip_reference and asdict(study.slip_reference),
        "twin_reference": None if twin is None else asdict(twin),
        "sentences": list(study.sentences),
        "notes": list(study.notes),
        "runs": [
            _fields(problem, point, point in front)
            | _slid_fields(point)
            | {"values": dict(point.values), "set": list(point.overrides)}
            | {"substeps": point.substeps or None}
            for problem, points in _problems(study)
            for front in [pareto(points)]
            for point in points
        ],
    }


def _finite(value: float) -> float | None:
    return value if value < float("inf") else None
