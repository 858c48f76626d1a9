# SPDX-License-Identifier: MIT
"""Records to files: PEER AT2 with the header of NGA-West2, and CSV; both are read back alike."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fenics_hytf.motion.formats import reads_as_header
from fenics_hytf.motion.records import GRAVITY, Record
from fenics_hytf.motion.units import UNITS

_PER_LINE = 5
_LONGEST = 80
"""Characters of a header line; old programs read no more."""


def write_at2(path: str | PathLike[str], record: Record, title: str = "", about: str = "") -> None:
    """Write a PEER AT2 file, in g, with the header of NGA-West2.

    Values have eight significant digits in five columns of 15 characters, as PEER's own files: what
    is read back differs by at most 5e-8 of each value. The time step is exact.

    Args:
        path: The file.
        record: The record.
        title: First line; the record's name if empty.
        about: Second line: where and what.

    Raises:
        OSError: If the file cannot be written.
    """
    head = [
        _header_text(title or record.name),
        _header_text(about),
        "ACCELERATION TIME SERIES IN UNITS OF G",
        f"NPTS= {record.num_samples:6d}, DT= {record.dt!r} SEC",
    ]
    fields = [f"{value:15.7E}" for value in record.acceleration / GRAVITY]
    rows = ["".join(fields[i : i + _PER_LINE]) for i in range(0, len(fields), _PER_LINE)]
    _write(path, [*head, *rows])


def write_csv(path: str | PathLike[str], record: Record, units: str = "g") -> None:
    """Write a record as ``time_s,acceleration``; a comment line states the unit.

    Args:
        path: The file.
        record: The record.
        units: ``"g"``, as files are read unless something else is said, or ``"m/s2"``.

    Raises:
        ValueError: If ``units`` is unknown.
        OSError: If the file cannot be written.
    """
    if units not in UNITS:
        raise ValueError(f"units: found '{units}'; expected one of {', '.join(UNITS)}")
    values = record.acceleration / UNITS[units]
    columns = (record.time, values)
    write_columns(path, ("time_s", "acceleration"), columns, f"{record.name} [{units}]")


def write_columns(
    path: str | PathLike[str],
    names: Sequence[str],
    columns: Sequence[npt.NDArray[np.floating[Any]]],
    about: str,
) -> None:
    """Write a time and what belongs to it as comma-separated values.

    Args:
        path: The file.
        names: Names of the columns.
        columns: Time [s] first, to twelve digits; the others with the fewest digits that give
            back the same number, shape ``(num_samples,)`` each.
        about: A comment above them.

    Raises:
        OSError: If the file cannot be written.
    """
    time, *others = columns
    fields = [[f"{t:.12g}" for t in time], *([repr(float(v)) for v in c] for c in others)]
    rows = [",".join(row) for row in zip(*fields, strict=True)]
    _write(path, [f"# {_one_line(about)}", ",".join(names), *rows])


def _header_text(text: str) -> str:
    """A line of free text that no reader takes for the lines of the header that count."""
    line = _one_line(text)[:_LONGEST]
    return "" if reads_as_header(line) else line


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _write(path: str | PathLike[str], lines: Sequence[str]) -> None:
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
