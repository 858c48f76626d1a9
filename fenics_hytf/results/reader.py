# SPDX-License-Identifier: MIT
"""Reading a result folder back: everything that figures and the report need, from CSV and JSON."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fenics_hytf.results.columns import TABLES, Table, require_fit
from fenics_hytf.results.folder import FINISHED, ResultError, check_finished
from fenics_hytf.results.schema import summary_faults
from fenics_hytf.results.summary import FORMAT

RealArray = npt.NDArray[np.float64]

_BLOCK = 20_000  # rows converted at once


@dataclass(frozen=True)
class StoredResult:
    """A result as it stands in a folder.

    Columns of tables have the names of the CSV headers and the units said there.

    Attributes:
        folder: Where it stands.
        summary: ``summary.json``.
        receivers: ``receivers.csv``, columns of shape ``(num_samples,)``.
        base: ``base.csv``, likewise.
        transfer: ``transfer.csv``, all lapses below each other.
        spectra: ``spectra.csv``.
        cells: ``cells.csv``, all lapses below each other; ``region`` holds names.
        slip: ``slip.csv``, or ``None`` where the scene does not call for sliding.
    """

    folder: Path
    summary: dict[str, Any]
    receivers: Table
    base: Table
    transfer: Table
    spectra: Table
    cells: Table
    slip: Table | None = None

    def transfer_function(self, column: str, lapse: int) -> tuple[RealArray, RealArray]:
        """Amplitude of a transfer function on the solved lines of a lapse.

        Args:
            column: ``NAME.A_x`` or, with several motions, ``NAME.A_x/y``.
            lapse: Number of the lapse.

        Returns:
            Frequency [Hz] and amplitude [-], both of shape ``(num_lines,)``.
        """
        here = self.transfer["lapse"] == lapse
        real, imaginary = (self.transfer[f"{column}.{part}"][here] for part in ("re", "im"))
        return self.transfer["frequency_hz"][here], np.hypot(real, imaginary)


def read_result(folder: Path, summary: dict[str, Any] | None = None) -> StoredResult:
    """Read a result folder.

    Args:
        folder: The folder.
        summary: The summary if it is not written yet; else ``summary.json`` is read.

    Returns:
        The result.

    Raises:
        ResultError: If the folder holds no finished result, or files of it are missing or broken.
    """
    if summary is None:
        summary = read_summary(folder)
    tables = TABLES if summary["sliding"] is None else (*TABLES, "slip")
    return StoredResult(folder, summary, *read_tables(folder, summary, *tables))


def read_summary(folder: Path) -> dict[str, Any]:
    """Read ``summary.json``.

    Args:
        folder: The folder of a finished result.

    Returns:
        The summary.

    Raises:
        ResultError: If the folder holds no finished result, or one of another format, or values
            that no run writes; with their keys.
    """
    check_finished(folder)
    with readable(folder):
        summary = json.loads((folder / FINISHED).read_text(encoding="utf-8"))
        found = summary.get("format") if isinstance(summary, dict) else None
        if found != FORMAT:
            raise ValueError(f"{FINISHED} is of format {found}, this version reads {FORMAT}")
        faults = summary_faults(summary)
        if faults:
            more = f", and {len(faults) - 1} more" if faults[1:] else ""
            raise ValueError(f"{FINISHED}, {faults[0]}{more}")
    return dict(summary)


def read_tables(folder: Path, summary: Mapping[str, Any], *names: str) -> list[Table]:
    """Read tables of a result, and see to it that they are what its summary tells of.

    Args:
        folder: The folder.
        summary: Its summary.
        names: Of the tables, without ``.csv``.

    Returns:
        The tables in that order.

    Raises:
        ResultError: If one is missing or broken, or has other columns or rows.
    """
    tables: list[Table] = []
    with readable(folder):
        for name in names:
            table = read_table(folder / f"{name}.csv")
            require_fit(name, table, summary)
            tables.append(table)
    return tables


@contextmanager
def readable(folder: Path) -> Iterator[None]:
    """Turn what can go wrong with a file into a message that says what to do."""
    try:
        yield
    except (OSError, ValueError, RecursionError) as error:
        raise _unreadable(folder, error) from error


@contextmanager
def as_written(folder: Path) -> Iterator[None]:
    """Turn what a result that no run wrote makes of its readers into a message.

    Types, columns and rows are looked at beforehand; that all values belong together is not.
    """
    try:
        yield
    except ResultError:
        raise
    except (LookupError, TypeError, AttributeError, ArithmeticError, ValueError) as error:
        raise _unreadable(folder, "its values do not belong together") from error


def _unreadable(folder: Path, reason: object) -> ResultError:
    return ResultError(
        f"{folder}: found a result that cannot be read ({reason}); expected the files as a run "
        "of this version wrote them. Run the scene again, with --force"
    )


def read_table(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Read a CSV table.

    Args:
        path: The file; its first row holds the names of the columns.

    Returns:
        Columns by name, shape ``(num_rows,)``: numbers where every field is a number or empty
        (empty: NaN), else strings.

    Raises:
        ValueError: If two columns have the same name, or a row has more or fewer fields than the
            header.
    """
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.reader(file)
        header = next(reader, [])
        if len(set(header)) < len(header):
            raise ValueError(f"{path.name} has two columns of the same name")
        blocks: list[list[npt.NDArray[Any]]] = []
        while rows := list(islice(reader, _BLOCK)):
            if any(len(row) != len(header) for row in rows):
                raise ValueError(f"{path.name} has rows that do not fit its header")
            blocks.append([_column(values) for values in zip(*rows, strict=True)])
    if not blocks:
        return {name: np.empty(0) for name in header}
    columns = zip(*blocks, strict=True)
    return {name: np.concatenate(parts) for name, parts in zip(header, columns, strict=True)}


def _column(values: tuple[str, ...]) -> npt.NDArray[Any]:
    try:
        return np.array([float(value) if value else np.nan for value in values])
    except ValueError:
        return np.array(values, dtype=object)
