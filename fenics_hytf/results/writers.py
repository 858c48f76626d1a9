# SPDX-License-Identifier: MIT
"""The tables of a result as CSV: histories, base, transfer functions, spectra, cells, slip.

Numbers are written with the fewest digits that give back the same double. A number that does not
exist (not finite) is an empty field. Rows are written in blocks; no file is ever a string. Names of
soils are written as the scene has them: one that begins with ``=`` is a formula to a spreadsheet.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fenics_hytf.motion import default_periods, response_spectrum
from fenics_hytf.motion.files import replacing
from fenics_hytf.results.overburden import vertical_stress
from fenics_hytf.results.sliding import slip_columns

if TYPE_CHECKING:
    from fenics_hytf.lapse import LapseResult
    from fenics_hytf.simulation import Result

RealArray = npt.NDArray[np.float64]

QUANTITIES = {
    "u": "displacement",
    "v": "velocity",
    "a": "acceleration",
    "A": "total_acceleration",
}
"""Letters in column names and what they stand for; ``A`` is total, the others are relative."""

BASE_KINDS = ("within", "outcrop")
"""Motions of the base; of the second there is none where the rock is not known."""

SPECTRUM_DAMPING = 0.05
SPECTRUM_PERIODS = default_periods()

_BLOCK = 2048  # rows formatted at once


def write_tables(folder: Path, result: Result) -> None:
    """Write the tables: ``receivers``, ``base``, ``transfer``, ``spectra`` and ``cells.csv``.

    Where the scene calls for sliding, ``slip.csv`` too.

    Args:
        folder: Where.
        result: The simulation.
    """
    _write_table(folder / "receivers.csv", *_receivers(result))
    _write_table(folder / "base.csv", *_base(result))
    _write_table(folder / "transfer.csv", *_transfer(result))
    _write_table(folder / "spectra.csv", *_spectra(result))
    _write_table(folder / "cells.csv", *_cells(result))
    if result.scene.effects.sliding is not None:
        slip = slip_columns(result)
        slip["lapse"] = slip["lapse"].astype(int)
        _write_table(folder / "slip.csv", list(slip), _rows(slip.values()))


Rows = Iterator[list[Any]]


def _write_table(path: Path, header: list[str], rows: Rows) -> None:
    with replacing(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def _rows(columns: Iterable[npt.ArrayLike]) -> Rows:
    """Rows of columns of equal length; numbers that are not finite become ``None``."""
    table = [np.asarray(column) for column in columns]
    for start in range(0, len(table[0]), _BLOCK):
        yield from zip(*(_plain(column[start : start + _BLOCK]) for column in table), strict=True)


def _plain(column: npt.NDArray[Any]) -> list[Any]:
    """A column as Python values, which print as the shortest text that reads back the same."""
    values = list(column.tolist())
    if np.issubdtype(column.dtype, np.floating) and not np.all(np.isfinite(column)):
        return [v if np.isfinite(v) else None for v in values]
    return values


def _receivers(result: Result) -> tuple[list[str], Rows]:
    """Time and the histories of every receiver."""
    header = ["time_s"]
    columns: list[RealArray] = []
    histories = {letter: result.history(name) for letter, name in QUANTITIES.items()}
    for r, receiver in enumerate(result.receivers):
        for letter, history in histories.items():
            for c, component in enumerate(result.components):
                header.append(f"{receiver}.{letter}_{component}")
                columns.append(history[r, c])
    time = result.time[: sum(lapse.num_samples for lapse in result.lapses)]
    return header, _rows([time, *columns])


def base_motions(result: Result) -> Iterator[tuple[str, str, RealArray]]:
    """The motions of the base, within and, where the rock is known, outcrop.

    Args:
        result: The simulation.

    Yields:
        ``within`` or ``outcrop``, direction, and acceleration [m/s^2], shape ``(num_samples,)``.
    """
    outcrop = result.outcrop_acceleration
    for m, direction in enumerate(result.directions):
        yield "within", direction, result.within_acceleration[m]
        if outcrop is not None:
            yield "outcrop", direction, outcrop[m]


def _base(result: Result) -> tuple[list[str], Rows]:
    """Time and the motions of the base [m/s^2]."""
    motions = list(base_motions(result))
    header = ["time_s", *(f"{kind}.A_{direction}" for kind, direction, _ in motions)]
    samples = sum(lapse.num_samples for lapse in result.lapses)
    return header, _rows([result.time[:samples], *(values for *_, values in motions)])


def _transfer(result: Result) -> tuple[list[str], Rows]:
    """Total acceleration over the input as given on the solved lines, one block a lapse."""
    header = ["frequency_hz", "lapse"]
    several = len(result.directions) > 1
    for receiver in result.receivers:
        for component in result.components:
            for direction in result.directions:
                name = f"{receiver}.A_{component}" + (f"/{direction}" if several else "")
                header += [f"{name}.re", f"{name}.im"]

    def block(lapse: LapseResult) -> Rows:
        num_lines = lapse.frequency.size
        values = lapse.transfer.reshape(math.prod(lapse.transfer.shape[:-1]), num_lines)
        parts = np.stack([values.real, values.imag], axis=1).reshape(2 * len(values), num_lines)
        return _rows([lapse.frequency, np.full(lapse.frequency.size, lapse.index), *parts])

    return header, (row for lapse in result.lapses for row in block(lapse))


def _spectra(result: Result) -> tuple[list[str], Rows]:
    """5 % damped pseudo-acceleration of the receivers, the input and the base [m/s^2]."""
    header = ["period_s"]
    columns: list[RealArray] = []
    history = result.history("total_acceleration")
    for r, receiver in enumerate(result.receivers):
        for c, component in enumerate(result.components):
            header.append(f"{receiver}.PSA_{component}")
            columns.append(_spectrum(history[r, c], result.dt))
    for m, direction in enumerate(result.directions):
        header.append(f"input.{direction}")
        columns.append(_spectrum(result.base_acceleration[m], result.dt))
    for kind, direction, motion in base_motions(result):
        header.append(f"{kind}.{direction}")
        columns.append(_spectrum(motion, result.dt))
    return header, _rows([SPECTRUM_PERIODS, *columns])


def _spectrum(acceleration: RealArray, dt: float) -> RealArray:
    if not np.any(acceleration):
        return np.zeros_like(SPECTRUM_PERIODS)
    return response_spectrum(acceleration, dt, SPECTRUM_PERIODS, SPECTRUM_DAMPING)


CELL_VALUES = (
    "shear_modulus",
    "g_over_gmax",
    "damping",
    "effective_strain",
    "peak_stress",
    "peak_acceleration",
    "peak_velocity",
    "peak_displacement",
    "peak_strain",
    "vertical_stress",
    "stress_ratio",
    "change",
)
"""Columns of ``cells.csv`` after the place: of a cell's state, and what the overburden adds.

``degradation`` follows where cycles degrade soils, ``fill`` where cells may be empty,
``mechanism_strain``, the shear strain of a metre of slip [1/m], where soil slides, and ``softest``,
the least G over its small-strain value up to the end of the lapse, where it softens for good.
"""


def _cells(result: Result) -> tuple[list[str], Rows]:
    """Values of the cells, one block a lapse; empty cells have none and are left out."""
    first = result.lapses[0]
    centroid = first.cells.centroid
    places = ["x", "y", "z"][: centroid.shape[1]]
    names = np.array(result.region_names, dtype=object)
    overburden = vertical_stress(result.scene, centroid)
    columns: tuple[str, ...] = CELL_VALUES
    columns += tuple(n for n in ("degradation", "fill") if getattr(first.cells, n) is not None)
    if first.slip is not None:
        columns += ("mechanism_strain",)
    if first.softening is not None:
        columns += ("softest",)

    def block(lapse: LapseResult) -> Rows:
        cells = lapse.cells
        filled = np.flatnonzero(np.ones(len(centroid)) if cells.fill is None else cells.fill)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(overburden > 0.0, cells.peak_stress / overburden, np.nan)
        values = vars(cells) | {"vertical_stress": overburden, "stress_ratio": ratio}
        if lapse.slip is not None:
            values["mechanism_strain"] = lapse.slip.shear_strain
        if lapse.softening is not None:
            values["softest"] = lapse.softening.softest
        return _rows(
            [
                np.full(len(filled), lapse.index),
                filled,
                names[cells.region[filled]],
                *centroid[filled].T,
                *(values[name][filled] for name in columns),
            ]
        )

    rows = (row for lapse in result.lapses for row in block(lapse))
    return ["lapse", "cell", "region", *places, *columns], rows
