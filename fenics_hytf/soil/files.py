# SPDX-License-Identifier: MIT
"""Curves from a CSV file: columns of strain, G/G_max and damping ratio, named by a header.

    strain_percent, modulus, damping_percent
    0.0001,         1.000,   0.8
    0.01,           0.760,   3.9
    1,              0.050,   20.5

``strain`` and ``damping`` are ratios, ``strain_percent`` and ``damping_percent`` are in percent.
The columns may stand in any order, separated by commas or by semicolons. Empty lines and lines
that start with ``#`` are skipped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

HEADER = "strain or strain_percent, modulus, damping or damping_percent"
"""The columns of a file."""

_COLUMNS = {
    "strain": ("strain", 1.0),
    "strain_percent": ("strain", 100.0),
    "modulus": ("modulus", 1.0),
    "damping": ("damping", 1.0),
    "damping_percent": ("damping", 100.0),
}


class CurveFileError(ValueError):
    """A file of curves that cannot be used.

    Attributes:
        problems: All that is wrong with it, each ``PLACE: found ...; expected ...``.
    """

    def __init__(self, problems: list[str]) -> None:
        self.problems = problems
        super().__init__("\n".join(problems))


def read_curve_file(path: Path) -> dict[str, list[float]]:
    """Read the columns of a file; whether they are a curve is not checked.

    Args:
        path: The file.

    Returns:
        ``strain`` [-], ``modulus`` [-] and ``damping`` [-], equally long.

    Raises:
        CurveFileError: If the file cannot be read, its header does not name the three columns, or
            a line is not made of as many finite numbers.
    """
    try:
        text = path.read_text(encoding="utf-8-sig", errors="replace")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise CurveFileError([f"{path.name}: found {reason}; expected a readable file"]) from error
    lines = _lines(text)
    number, header = next(lines, (1, [""]))
    names = [name.lower() for name in header]
    if sorted(_COLUMNS.get(name, (name,))[0] for name in names) != ["damping", "modulus", "strain"]:
        found = ", ".join(f"'{name}'" for name in header)
        raise CurveFileError(
            [f"{path.name}, line {number}: found {found}; expected the column names {HEADER}"]
        )
    problems: list[str] = []
    columns: dict[str, list[float]] = {"strain": [], "modulus": [], "damping": []}
    for number, fields in lines:
        if len(fields) != len(names):
            found = f"{len(fields)} columns"
            problems.append(f"{path.name}, line {number}: found {found}; expected {len(names)}")
            continue
        for name, field in zip(names, fields, strict=True):
            value = _finite(field)
            if value is None:
                expected = f"a finite number in the column {name}"
                problems.append(f"{path.name}, line {number}: found '{field}'; expected {expected}")
            else:
                column, divisor = _COLUMNS[name]
                columns[column].append(value / divisor)
    if problems:
        raise CurveFileError(problems)
    return columns


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """Numbers of the lines that say something, and their fields."""
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, [field.strip() for field in line.replace(";", ",").split(",")]


def _finite(field: str) -> float | None:
    try:
        value = float(field)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
