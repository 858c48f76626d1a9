# SPDX-License-Identifier: MIT
"""``hytf export``: motions of a finished result as AT2 or CSV, one file a motion."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fenics_hytf.cli.outcome import DONE, INPUT, InputError, say, tell
from fenics_hytf.motion import Record, write_at2, write_columns, write_csv
from fenics_hytf.results import ResultError, as_written, place_faults, read_summary, read_tables
from fenics_hytf.results.summary import moving_components
from fenics_hytf.results.writers import BASE_KINDS, QUANTITIES

RealArray = npt.NDArray[np.float64]

FORMATS = ("at2", "csv")
TOTAL = "total_acceleration"
_LETTERS = {name: letter for letter, name in QUANTITIES.items()}
_UNITS = {"displacement": "m", "velocity": "m/s"}


@dataclass(frozen=True)
class ExportRequest:
    """What ``hytf export`` was asked for.

    Attributes:
        folder: Folder of the result.
        names: Receivers, ``within`` or ``outcrop``; all if empty.
        format: One of :data:`FORMATS`.
        quantity: One of the quantities of ``receivers.csv``.
        output: Where the files go; ``./<DIR>-motions`` if ``None``.
        force: Whether files there may be replaced.
    """

    folder: Path
    names: tuple[str, ...] = ()
    format: str = "at2"
    quantity: str = TOTAL
    output: Path | None = None
    force: bool = False


@dataclass(frozen=True)
class _Motion:
    """A motion to be written.

    Attributes:
        name: Receiver, or motion of the base.
        component: Along which axis.
        values: [m/s^2], [m/s] or [m], shape ``(num_samples,)``.
        about: What it is, for the file's head.
    """

    name: str
    component: str
    values: RealArray
    about: str


def export_motions(request: ExportRequest) -> int:
    """Write motions of a result.

    Args:
        request: What was asked for.

    Returns:
        The exit code.
    """
    try:
        summary = read_summary(request.folder)
        with as_written(request.folder):
            faults = _request_faults(request, summary)
            motions = [] if faults else list(_motions(request, summary))
        if faults:
            raise InputError(faults)
        folder = request.output or Path(f"{request.folder.resolve().name}-motions")
        ending = (
            "" if request.quantity == TOTAL else f"_{request.quantity}"
        ) + f".{request.format}"
        files = [f"{motion.name}_{motion.component}{ending}" for motion in motions]
        _check_place(folder, files, request.force)
        _check_values(motions)
        _write(folder, files, motions, request, summary)
    except ResultError as error:
        tell([str(error)])
        return INPUT
    except InputError as error:
        tell(error.faults)
        return INPUT
    say(f"{folder}: {', '.join(files)}")
    return DONE


def _request_faults(request: ExportRequest, summary: Mapping[str, Any]) -> list[str]:
    """Everything that is wrong with what was asked for."""
    faults = []
    if request.format not in FORMATS:
        faults.append(f"--format: found {request.format}; expected {' or '.join(FORMATS)}")
    if request.quantity not in _LETTERS:
        faults.append(f"--quantity: found {request.quantity}; expected {', '.join(_LETTERS)}")
    elif request.format == "at2" and request.quantity in _UNITS:
        faults.append(
            f"--format: found at2 for a {request.quantity}; expected csv, as AT2 files hold "
            "accelerations"
        )
    known = [*summary["receivers"], *_base_names(summary)]
    for name in request.names:
        if name not in known:
            faults.append(f"RECEIVER: found {name}; expected one of {', '.join(known)}")
        elif request.quantity != TOTAL and name not in summary["receivers"]:
            faults.append(f"RECEIVER: found {name} with {request.quantity}; expected {TOTAL}")
    return faults


def _base_names(summary: Mapping[str, Any]) -> list[str]:
    """Motions of the base that are known."""
    base = summary["base"].values()
    return [kind for kind in BASE_KINDS if all(b[f"{kind}_pga_g"] is not None for b in base)]


def _motions(request: ExportRequest, summary: Mapping[str, Any]) -> Iterator[_Motion]:
    """The motions asked for: of receivers all components that move, of the base the driven ones."""
    receivers, base = read_tables(request.folder, summary, "receivers", "base")
    letter = _LETTERS[request.quantity]
    what = request.quantity.replace("_", " ")
    what = what if request.quantity == TOTAL else f"{what} relative to the base"
    chosen = request.names or tuple(summary["receivers"])
    for name in chosen:
        if name in summary["receivers"]:
            place = ", ".join(f"{x:g}" for x in summary["receivers"][name]["place_m"])
            for component in moving_components(summary, name):
                values = np.asarray(receivers[f"{name}.{letter}_{component}"], np.float64)
                yield _Motion(
                    name, component, values, f"{name} at ({place}) m, {component}: {what}"
                )
    if request.quantity != TOTAL:
        return
    for kind in _base_names(summary):
        if not request.names or kind in request.names:
            for direction in summary["directions"]:
                about = f"Base, {kind} motion, {direction}: acceleration"
                values = np.asarray(base[f"{kind}.A_{direction}"], np.float64)
                yield _Motion(kind, direction, values, about)


def _check_place(folder: Path, files: Sequence[str], force: bool) -> None:
    """Raise InputError where the files cannot or must not be written."""
    faults = [] if files else ["RECEIVER: found none that moves; expected a motion to write"]
    faults += place_faults(folder)
    there = [file for file in files if os.path.lexists(folder / file)]
    if there and not force:
        faults.append(
            f"{folder}: found {', '.join(there)} there; expected a folder without them. Choose "
            "another with -o, or replace them with --force"
        )
    if faults:
        raise InputError(faults)


def _check_values(motions: Sequence[_Motion]) -> None:
    """Raise InputError for motions that end before the record does."""
    lost = [m.name for m in motions if not np.isfinite(m.values).all()]
    if lost:
        names = ", ".join(dict.fromkeys(lost))
        raise InputError(
            [
                f"RECEIVER: found no motion to the end for {names}, whose point left the mesh; "
                "expected receivers that stay. Name the others"
            ]
        )


def _write(
    folder: Path,
    files: Sequence[str],
    motions: Sequence[_Motion],
    request: ExportRequest,
    summary: Mapping[str, Any],
) -> None:
    """Write all files beside their places, then put them in place: all of them, or none."""
    made = [p for p in (folder, *folder.absolute().parents) if not p.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".export-") as temporary:
            for file, motion in zip(files, motions, strict=True):
                _write_motion(Path(temporary, file), motion, request, summary)
            for file in files:
                Path(temporary, file).replace(folder / file)
    except OSError as error:
        for place in made:  # innermost first; what is not empty stays
            if place.is_dir() and not any(place.iterdir()):
                place.rmdir()
        raise InputError(
            [f"{folder}: found that it cannot be written ({error}); expected write permission"]
        ) from error


def _write_motion(
    path: Path, motion: _Motion, request: ExportRequest, summary: Mapping[str, Any]
) -> None:
    if request.quantity in _UNITS:
        time = summary["dt_s"] * np.arange(motion.values.size)
        about = f"{motion.about} [{_UNITS[request.quantity]}]"
        write_columns(path, ("time_s", request.quantity), (time, motion.values), about)
        return
    record = Record(motion.values, summary["dt_s"], motion.about)
    if request.format == "csv":
        write_csv(path, record)
    else:
        write_at2(path, record, f"fenics_hytf: {summary['title']}", motion.about)
