# SPDX-License-Identifier: MIT
"""Whether the tables of a result are those that its summary tells of: columns, rows, numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from fenics_hytf.results.writers import BASE_KINDS, CELL_VALUES, QUANTITIES, SPECTRUM_PERIODS
from fenics_hytf.scene.faults import toml_text

Table = Mapping[str, npt.NDArray[Any]]

TABLES = ("receivers", "base", "transfer", "spectra", "cells")
"""Of every result; ``slip`` besides where the scene calls for sliding."""

_PLACES = ("time_s", "frequency_hz", "period_s", "lapse", "cell", "x", "y", "z")
_WORDS = ("region",)


def require_fit(name: str, table: Table, summary: Mapping[str, Any]) -> None:
    """Refuse a table that is not the one its summary tells of; further columns do not count.

    Args:
        name: Of the table, without ``.csv``.
        table: Columns by name.
        summary: A sound summary, see :mod:`fenics_hytf.results.schema`.

    Raises:
        ValueError: With what was found and what was expected.
    """
    columns = _columns(name, summary)
    missing = [column for column in columns if column not in table]
    if missing:
        raise ValueError(
            f"{name}.csv: found no column {toml_text(missing[0])}; expected the {len(columns)} "
            "columns that summary.json tells of"
        )
    for column in columns:
        if column not in _WORDS:
            _require_numbers(name, column, table[column])
    _require_rows(name, table, summary)


def _columns(name: str, summary: Mapping[str, Any]) -> list[str]:
    """The columns that readers ask for."""
    receivers, components = summary["receivers"], summary["components"]
    directions = summary["directions"]
    base = [
        (kind, direction)
        for direction in directions
        for kind in BASE_KINDS
        if summary["base"][direction][f"{kind}_pga_g"] is not None
    ]
    if name == "receivers":
        return [
            "time_s",
            *(f"{r}.{q}_{c}" for r in receivers for q in QUANTITIES for c in components),
        ]
    if name == "base":
        return ["time_s", *(f"{kind}.A_{direction}" for kind, direction in base)]
    if name == "transfer":
        over = [f"/{direction}" for direction in directions] if len(directions) > 1 else [""]
        pairs = [f"{r}.A_{c}{o}" for r in receivers for c in components for o in over]
        return ["frequency_hz", "lapse", *(f"{p}.{part}" for p in pairs for part in ("re", "im"))]
    if name == "spectra":
        psa = [f"{r}.PSA_{c}" for r in receivers for c in components]
        given = [f"input.{direction}" for direction in directions]
        return ["period_s", *psa, *given, *(f"{kind}.{direction}" for kind, direction in base)]
    if name == "slip":
        return ["time_s", "slip_m", "rate_m_s", "driving_m_s2", "yield_m_s2", "lapse"]
    scene = summary["scene"]
    columns = ["lapse", "cell", "region", "x", "y", *CELL_VALUES]
    columns += ["z"] if any(len(r["place_m"]) > 2 for r in receivers.values()) else []
    columns += ["degradation"] if scene["degradation"] is not None else []
    columns += ["mechanism_strain"] if summary["sliding"] is not None else []
    return columns + (["softest"] if summary["softening"] is not None else [])


def _require_numbers(name: str, column: str, values: npt.NDArray[Any]) -> None:
    """Refuse words and infinite numbers; a value that does not exist is NaN, a place exists."""
    sound = values.dtype != object
    if sound:
        sound = bool(np.isfinite(values).all() if column in _PLACES else not np.isinf(values).any())
    if not sound:
        raise ValueError(
            f"{name}.csv: found a value that is no finite number in the column {column}; expected "
            "numbers"
        )


def _require_rows(name: str, table: Table, summary: Mapping[str, Any]) -> None:
    """Refuse more or fewer rows than there are samples, solved lines, periods, cells or steps."""
    lapses = summary["lapses"]
    found = len(next(iter(table.values())))
    if name == "spectra":
        _require_count(name, "", found, len(SPECTRUM_PERIODS))
    if name in ("receivers", "base"):
        _require_count(name, "", found, sum(lapse["samples"] for lapse in lapses))
    if name not in ("transfer", "cells", "slip"):
        return
    for lapse in lapses:
        there = int(np.count_nonzero(table["lapse"] == lapse["index"]))
        found -= there
        expected = _rows_of(name, lapse, summary)
        if name == "cells" and "fill" in table:  # empty cells are left out
            expected = min(max(there, 1), expected)
        _require_count(name, f" of lapse {lapse['index']}", there, expected)
    _require_count(name, " of other lapses", found, 0)


def _rows_of(name: str, lapse: Mapping[str, Any], summary: Mapping[str, Any]) -> int:
    """Rows of a lapse; a seam is there once, as the start of the later lapse's slip."""
    if name == "transfer":
        return int(lapse["solved_lines"])
    if name == "cells":
        return int(summary["sizes"]["cells"])
    steps = round(lapse["samples"] * summary["dt_s"] / lapse["slip"]["time_step_s"])
    return steps + (lapse["index"] == summary["lapses"][-1]["index"])


def _require_count(name: str, of_what: str, found: int, expected: int) -> None:
    if found != expected:
        raise ValueError(
            f"{name}.csv: found {found} rows{of_what}; expected {expected}, as summary.json says"
        )
