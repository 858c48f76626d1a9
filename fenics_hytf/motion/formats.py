# SPDX-License-Identifier: MIT
"""Records from files: PEER AT2 with either header, and CSV.

AT2 is the format of the PEER ground-motion databases: four header lines, then accelerations in g.
The fourth line reads ``4096    0.0100    NPTS, DT`` in files of the older database and
``NPTS=  4096, DT=   .0100 SEC`` in those of NGA-West2.
"""

from __future__ import annotations

import codecs
import re
from decimal import Decimal
from os import PathLike
from pathlib import Path

import numpy as np

from fenics_hytf.motion.records import GRAVITY, RealArray, Record, RecordError
from fenics_hytf.motion.units import UNITS, UnitError, acceleration_unit, check_time, names_time

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_HEADERS = (
    re.compile(rf"NPTS\s*=\s*(\d+)\b.*?\bDT\s*=\s*({_NUMBER})", re.IGNORECASE),
    re.compile(rf"^\s*(\d+)[\s,]+({_NUMBER})[\s,]+NPTS\b.*\bDT\b", re.IGNORECASE),
)
_UNITS = re.compile(r"UNITS?\s+OF\s+([^\s,]+)", re.IGNORECASE)
_FORTRAN_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[-+]?\d)")
_WITH_COMMA = r"[-+]?\d+(?:,\d+)?(?:[eE][-+]?\d+)?"
_DECIMAL_COMMAS = re.compile(rf"(?=.*,){_WITH_COMMA}(?:\s*;\s*|\s+){_WITH_COMMA}")
_HEADER_LINES = 10
"""Lines searched for the AT2 header: four by the format, a few more for added comments."""

STEP_TOLERANCE = 1e-3
"""Largest departure of a step from the mean time step, relative to it.

Times added up in single precision over a record of minutes scatter by 2e-4 of a 0.01 s step; a
sample lost or a step changed departs by 1e-2 and more.
"""

PRINT_TOLERANCE = 0.1
"""The same where times are printed with few digits, relative to the time step.

Rounding moves a step by up to one unit of the last printed digit. That much is accepted, but not
above a tenth of the step: beyond, a lost sample could no longer be told from rounding.
"""

_SLACK = 1.01
"""Leaves room for round-off where a difference of rounded times is a whole unit."""


def read(path: str | PathLike[str], *, dt: float | None = None, units: str | None = None) -> Record:
    """Read a record, in the format that the file's suffix says.

    Args:
        path: File that ends in ``.at2`` or ``.csv``, in any case.
        dt: Time step [s] of a CSV file of one column.
        units: Unit of a CSV file, see :func:`read_csv`; AT2 is always in g.

    Returns:
        The record, named after the file.

    Raises:
        RecordError: If the suffix is another, or the file cannot be used.
        ValueError: If ``units`` is unknown.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        return read_csv(path, dt=dt, units=units)
    if suffix == ".at2":
        said = [f"dt = {dt}"] * (dt is not None)
        said += [f"units = '{units}'"] * (units not in (None, "g"))
        if said:
            raise RecordError.at(
                path,
                None,
                f"an AT2 file together with {' and '.join(said)}",
                "neither dt nor units: the file states its time step and is in g",
                "leave them out",
            )
        return read_at2(path)
    raise RecordError.at(
        path, None, f"the suffix '{suffix}'", "'.at2' or '.csv'", "convert or rename the file"
    )


def read_at2(path: str | PathLike[str]) -> Record:
    """Read a PEER AT2 file, of the older database or of NGA-West2.

    Args:
        path: The file; accelerations in g.

    Returns:
        The record in m/s^2, named after the file.

    Raises:
        RecordError: If the file cannot be read, the header is missing, it is not in g, a value
            is not a finite number, or the number of values is not NPTS.
    """
    lines = [_FORTRAN_EXPONENT.sub("E", line) for line in _lines(path)]
    start, num_samples, dt = _at2_header(path, lines)
    values: list[float] = []
    for number, line in enumerate(lines[start:], start=start + 1):
        values.extend(_value(path, number, token) for token in line.split())
    if len(values) != num_samples:
        raise RecordError.at(
            path,
            start,
            f"NPTS = {num_samples}, but {len(values)} values in the file",
            f"{num_samples} values",
            "the file is cut off or its header is wrong; fetch it again",
        )
    return Record(GRAVITY * np.array(values), dt, Path(path).stem)


def read_csv(
    path: str | PathLike[str], dt: float | None = None, units: str | None = None
) -> Record:
    """Read comma-separated values: ``time_s,acceleration``, or accelerations alone with ``dt``.

    Lines that are empty or start with ``#`` are skipped; one line may name the columns. The first
    time need not be 0; only the time step is kept.

    A unit that the names state counts, as in ``time_s,acceleration_m_s2`` or
    ``# Time (s),Acceleration (g)``, and so does the ``[m/s2]`` that
    :func:`~fenics_hytf.motion.write_csv` puts at the end of its comment. Velocities, displacements,
    accelerations in other units and times that are not in seconds are refused by their names.

    Args:
        path: The file.
        dt: Time step [s]: needed for one column; with two it must agree with the times.
        units: Unit of the accelerations, ``"g"`` or ``"m/s2"``; ``None`` for the one that the file
            names, g if it names none.

    Returns:
        The record in m/s^2, named after the file.

    Raises:
        RecordError: If the file cannot be read, a line is not made of finite numbers, there are
            fewer than two samples, the time step changes, or the names of the columns state
            something else than ``units`` or than can be read.
        ValueError: If ``units`` is unknown.
    """
    if units is not None and units not in UNITS:
        raise ValueError(f"units: found '{units}'; expected one of {', '.join(UNITS)}")
    numbers, rows, names = _csv_rows(path)
    unit = _csv_unit(path, names, units)
    values = np.array(
        [[_value(path, n, t) for t in row] for n, row in zip(numbers, rows, strict=True)]
    )
    if values.shape[1] == 2:
        digits = (Decimal(row[0]).as_tuple().exponent for row in rows)
        last_digit = 10.0 ** min(exponent for exponent in digits if isinstance(exponent, int))
        if dt is None:
            dt = _mean_step(path, numbers, values[:, 0], last_digit)
        else:
            _check_step(path, numbers, values[:, 0], last_digit, dt)
    elif dt is None:
        raise RecordError.at(
            path, numbers[0], "one column", "time_s,acceleration", "add the times or give dt"
        )
    return Record(UNITS[unit] * values[:, -1], dt, Path(path).stem)


def reads_as_header(line: str) -> bool:
    """Whether a line of text would be taken for an AT2 header's units or number of samples."""
    return any(pattern.search(line) for pattern in (_UNITS, *_HEADERS))


def _lines(path: str | PathLike[str]) -> list[str]:
    """Lines of a text file."""
    try:
        if Path(path).exists() and not Path(path).is_file():  # a pipe may wait for ever
            raise OSError(0, "no regular file")
        content = Path(path).read_bytes()
    except OSError as error:
        raise RecordError.at(
            path, None, f"{error.strerror}", "a readable file", "check the path"
        ) from error
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise RecordError.at(path, None, "text in UTF-16", "text in UTF-8", "save it as UTF-8")
    return content.decode("utf-8-sig", errors="replace").splitlines()


def _value(path: str | PathLike[str], line: int, token: str) -> float:
    """A finite number."""
    try:
        value = float(token)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise RecordError.at(
            path, line, f"'{token}'", "a finite number", "repair or remove the line"
        )
    return value


def _at2_header(path: str | PathLike[str], lines: list[str]) -> tuple[int, int, float]:
    """Index of the first line of values, number of samples, time step [s]."""
    for index, line in enumerate(lines[:_HEADER_LINES]):
        unit = _UNITS.search(line)
        if unit and unit[1].strip("().").upper() not in ("G", "G'S", "GS"):
            raise RecordError.at(
                path,
                index + 1,
                f"units of {unit[1]}",
                "units of g, as AT2 files have",
                "convert it to a .csv file",
            )
        for header in _HEADERS:
            match = header.search(line)
            if match:
                num_samples, dt = int(match[1]), float(match[2])
                if num_samples < 2 or dt <= 0.0:
                    raise RecordError.at(
                        path,
                        index + 1,
                        f"NPTS = {num_samples}, DT = {dt}",
                        "at least 2 samples and a positive time step",
                        "repair the header",
                    )
                return index + 1, num_samples, dt
    raise RecordError.at(
        path,
        None,
        "no header with NPTS and DT",
        "'4096 0.0100 NPTS, DT' or 'NPTS= 4096, DT= .0100 SEC' on the fourth line",
        "check that this is an AT2 file",
    )


def _csv_rows(
    path: str | PathLike[str],
) -> tuple[list[int], list[list[str]], dict[int, list[str]]]:
    """Line numbers and fields of the lines of values, one or two each; names by line number."""
    numbers: list[int] = []
    rows: list[list[str]] = []
    names: dict[int, list[str]] = {}
    header_seen = False
    for number, line in enumerate(_lines(path), start=1):
        text = line.strip()
        if not text:
            continue
        if text.startswith("#"):
            found = [] if rows else _names_in_comment(text)
            if found:
                names[number] = found
            continue
        if _DECIMAL_COMMAS.fullmatch(text):
            advice = "write 0.5 for 0,5 throughout"
            raise RecordError.at(path, number, f"decimal commas in '{text}'", "points", advice)
        separator = next((s for s in ",;" if s in text), None)
        fields = [field.strip() for field in text.split(separator)]
        if not rows and not header_seen and not any(_is_number(field) for field in fields):
            header_seen = True
            names[number] = _column_names(text)
            if len(fields) > 1 and fields[1].lower().startswith("time"):
                raise RecordError.at(
                    path, number, f"'{text}'", "time_s,acceleration", "swap the columns"
                )
            continue
        expected = len(rows[0]) if rows else None
        if len(fields) > 2 or (expected and len(fields) != expected):
            raise RecordError.at(
                path,
                number,
                f"{len(fields)} columns",
                f"{expected}" if expected else "time_s,acceleration or acceleration alone",
                "repair the line",
            )
        numbers.append(number)
        rows.append(fields)
    if len(rows) < 2:
        raise RecordError.at(
            path, None, f"{len(rows)} samples", "at least 2", "give a longer record"
        )
    return numbers, rows, names


def _column_names(text: str) -> list[str]:
    """Names of columns, apart by a comma or the like, else by white space before a letter."""
    separator = next((s for s in ",;\t" if s in text), None)
    if separator:
        return text.split(separator)
    return re.split(r" (?=[^\W\d_])", " ".join(text.split()), maxsplit=1)


def _names_in_comment(text: str) -> list[str]:
    """Names of columns in a comment: times first, or a unit at its end; else nothing."""
    names = _column_names(text.lstrip("# "))
    if len(names) == 2 and names_time(names[0]):
        return names
    at_end = re.search(r"\[([^\[\]]+)\]$", text)
    return [at_end[0]] if at_end and at_end[1] in UNITS else []


def _csv_unit(path: str | PathLike[str], names: dict[int, list[str]], given: str | None) -> str:
    """The unit of the accelerations, on which all agree who name one.

    Args:
        path: The file, for messages.
        names: Names of the columns, by line number.
        given: What the caller says.
    """
    unit, said_by = given, f'units = "{given}"'
    for number, columns in names.items():
        where = path, number, f"'{','.join(columns)}'"
        try:
            if len(columns) > 1:
                check_time(columns[0])
            found = acceleration_unit(columns[-1])
        except UnitError as error:
            expected = "times in s, accelerations in g or m/s2"
            raise RecordError.at(*where, expected, str(error)) from None
        if unit is not None and found is not None and found != unit:
            expected = f"accelerations in {unit}, as {said_by} says"
            advice = f'give units = "{found}" or correct the line'
            raise RecordError.at(*where, expected, advice)
        if unit is None and found is not None:
            unit, said_by = found, f"line {number}"
    return unit or "g"


def _is_number(token: str) -> bool:
    """Whether Python reads the token as a number, NaN and infinity included."""
    try:
        float(token)
    except ValueError:
        return False
    return True


def _mean_step(
    path: str | PathLike[str], numbers: list[int], time: RealArray, last_digit: float
) -> float:
    """Time step [s] of equally spaced times, to 12 digits: 39.99/3999 turns into 0.01 exactly.

    Args:
        path: The file, for messages.
        numbers: Line of each time.
        time: The times [s], shape ``(num_samples,)``.
        last_digit: One unit of their last printed digit [s].
    """
    steps = np.diff(time)
    mean = float(f"{(time[-1] - time[0]) / steps.size:.12g}")
    tolerance = max(STEP_TOLERANCE * mean, min(_SLACK * last_digit, PRINT_TOLERANCE * mean))
    if (steps <= 0.0).any() or (np.abs(steps - mean) > tolerance).any():
        departure = np.where(steps <= 0.0, np.inf, np.abs(steps - np.median(steps)))
        at = int(np.argmax(departure))
        raise RecordError.at(
            path,
            numbers[at + 1],
            f"a time step of {steps[at]:.6g} s",
            f"increasing times in equal steps (the mean is {mean:.6g} s)",
            "resample the record, print its times with more digits, or give dt",
        )
    return mean


def _check_step(
    path: str | PathLike[str], numbers: list[int], time: RealArray, last_digit: float, dt: float
) -> None:
    """Raise RecordError unless the times follow the stated time step up to their rounding.

    Args:
        path: The file, for messages.
        numbers: Line of each time.
        time: The times [s], shape ``(num_samples,)``.
        last_digit: One unit of their last printed digit [s].
        dt: Stated time step [s].
    """
    if not (np.isfinite(dt) and dt > 0.0):
        return  # the record says so
    drift = time - time[0] - dt * np.arange(time.size)
    digits = dt / last_digit
    exact = abs(digits - round(digits)) < STEP_TOLERANCE  # multiples are printed without rounding
    tolerance = max(STEP_TOLERANCE * dt, 0.0 if exact else _SLACK * last_digit)
    if np.ptp(drift) > tolerance:
        at = int(np.argmax(np.abs(drift) > 0.5 * tolerance))
        raise RecordError.at(
            path,
            numbers[at],
            f"the time {time[at]:.9g} s",
            f"{time[0] + dt * at:.9g} s, as dt = {dt:.6g} s gives",
            "correct dt or leave it out",
        )
