# SPDX-License-Identifier: MIT
"""The folder of a result: who may write there, and when it counts as finished.

A folder is locked (``flock`` on a file in it) while a run writes. It is finished when it holds
``summary.json``, which is written last and put in place by one rename: a reader sees the whole
file or none. A finished result is refused unless forced, and even then nothing of it is touched
before there is something new to write. A run that is under way, or was stopped, has a checkpoint
in the folder; it goes when the run is finished. An unfinished run is refused unless it is resumed,
or forced to start anew.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any

from fenics_hytf.motion.files import fault_of_place, part_of, replace_file
from fenics_hytf.results.paraview import write_snapshot
from fenics_hytf.results.summary import summarise
from fenics_hytf.results.writers import write_tables

if TYPE_CHECKING:
    from fenics_hytf.simulation import Result, Snapshot

FINISHED = "summary.json"
PARTIAL = "partial-summary.json"
LOCK = ".hytf.lock"
CHECKPOINT = "checkpoint"

_CHECKPOINTS = f"{CHECKPOINT}/*.npz"
_SNAPSHOTS = ("mesh.vtu", "points_*.vtu", "fields_*.vtu")
# what a run may leave in its folder, and so what a forced run removes; nothing else is touched
_OURS = (
    FINISHED,
    PARTIAL,
    f"{_CHECKPOINTS}*",
    *_SNAPSHOTS,
    "receivers.csv",
    "base.csv",
    "transfer.csv",
    "spectra.csv",
    "cells.csv",
    "slip.csv",
    "histories_*.png",
    "transfer_*.png",
    "spectra_*.png",
    "fourier_*.png",
    "base_*.png",
    "profiles.png",
    "profiles_peaks.png",
    "section.png",
    "stiffness.png",
    "energy.png",
    "convergence.png",
    "slip.png",
    "mechanism.png",
    "deformed.png",
    "runout.png",
    "points.gif",
    "report.html",
)

Finish = Callable[[Path, dict[str, Any]], object]


class ResultError(ValueError):
    """A result folder cannot be used; ``str()`` says which, why, and what to do."""


def folder_faults(folder: Path, force: bool, resume: bool = False) -> list[str]:
    """What speaks against writing a result to a folder; touches nothing.

    Args:
        folder: Where the result should go.
        force: Whether a finished result or an unfinished run there may be replaced.
        resume: Whether an unfinished run there is gone on with.

    Returns:
        The faults, empty if there are none.
    """
    if os.path.isdir(folder):  # unlike Path.is_dir, false for a name too long to exist
        if (folder / FINISHED).exists() and not force:
            return [
                f"{folder}: found a finished result ({FINISHED}); expected a folder without one. "
                "Choose another with -o, or replace it with --force"
            ]
        fault = fault_of_place(folder / CHECKPOINT)
        if fault:
            return [f"{fault}, or choose another folder with -o"]
        if not (force or resume) and any(folder.glob(_CHECKPOINTS)):
            return [
                f"{folder}: found an unfinished run (it has a {CHECKPOINT}); expected a folder "
                "without one. Go on with --resume, start anew with --force, or choose another "
                "with -o"
            ]
    return place_faults(folder)


def place_faults(folder: Path) -> list[str]:
    """What speaks against writing anything to a folder; touches nothing.

    Args:
        folder: The folder; it may be missing.

    Returns:
        The faults, empty if there are none.
    """
    if os.path.isdir(folder):
        place = folder
    else:
        place = next(p for p in (folder, *folder.absolute().parents) if os.path.lexists(p))
    if not place.is_dir():
        return [f"{folder}: found that {place} is no folder; expected a folder. Choose another -o"]
    if not os.access(place, os.W_OK | os.X_OK):
        return [f"{folder}: found that {place} may not be written; expected write permission"]
    return []


def is_result_of(folder: Path, scene_hash: str) -> bool:
    """Whether a folder holds a finished result of the very same scene.

    Args:
        folder: The folder.
        scene_hash: Hash of the scene.
    """
    try:
        summary = json.loads((folder / FINISHED).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(summary, dict) and summary.get("scene_hash") == scene_hash


def open_result(folder: Path, force: bool = False, resume: bool = False) -> ResultFolder:
    """Take a folder for writing a result: create it if needed, and lock it.

    Args:
        folder: Where the result goes; parents are created as well.
        force: Whether a finished result or an unfinished run there may be replaced.
        resume: Whether an unfinished run there is gone on with.

    Returns:
        The open folder; close it, or use it in a ``with`` statement.

    Raises:
        ResultError: If the folder cannot be created or written, another run writes there, or it
            holds what may not be replaced. Nothing is changed then.
    """
    faults = folder_faults(folder, force=True)
    if faults:
        raise ResultError(faults[0])
    missing = [p for p in (folder, *folder.absolute().parents) if not os.path.exists(p)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = _take_lock(folder)
    except OSError as error:
        _remove_empty(missing)
        raise ResultError(
            f"{folder}: found that it cannot be written ({error.strerror}); expected a folder "
            "that can be. Choose another with -o"
        ) from error
    result = ResultFolder(folder, lock, missing)
    faults = folder_faults(folder, force, resume)  # now that no other run can finish in between
    if faults:
        result.close()
        raise ResultError(faults[0])
    return result


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock the folder of a finished result while its figures are drawn again.

    Args:
        folder: The folder.

    Raises:
        ResultError: If it holds no finished result, or a run is writing there.
        OSError: If the folder cannot be written.
    """
    check_finished(folder)
    lock = _take_lock(folder)
    try:
        yield
    finally:
        (folder / LOCK).unlink(missing_ok=True)
        lock.close()


def check_finished(folder: Path) -> None:
    """Raise unless a folder holds a finished result.

    Raises:
        ResultError: If it does not.
    """
    if not (folder / FINISHED).is_file():
        raise ResultError(
            f"{folder}: found no {FINISHED}; expected the folder of a finished result. "
            "Run the scene first: hytf run SCENE"
        )


class ResultFolder:
    """A locked folder that a run writes to.

    Attributes:
        path: The folder.
        checkpoint: Folder of the run's checkpoint in it.
    """

    def __init__(self, path: Path, lock: IO[str], created: list[Path]) -> None:
        self.path = path
        self.checkpoint = path / CHECKPOINT
        self._lock: IO[str] | None = lock
        self._created = created
        self._cleared = False
        self._kept: tuple[str, ...] = ()

    def __enter__(self) -> ResultFolder:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def go_on(self) -> None:
        """Keep the checkpoint and the snapshots that are there: they are this run's."""
        self._kept = (f"{_CHECKPOINTS}*", *_SNAPSHOTS)

    def clear(self) -> None:
        """Remove what there is of an earlier result, ``summary.json`` first; once.

        To be called before anything is written from elsewhere; the methods here do so themselves.
        """
        if not self._cleared:
            self._remove(pattern for pattern in _OURS if pattern not in self._kept)
            self._cleared = True

    def snapshot(self, snapshot: Snapshot) -> None:
        """Write the points and fields of a lapse for ParaView.

        Args:
            snapshot: As gathered on one rank.
        """
        self.clear()
        write_snapshot(self.path, snapshot)

    def write(self, result: Result, finish: Finish | None = None) -> dict[str, Any]:
        """Write a finished simulation: tables first, ``summary.json`` last.

        The run's checkpoint goes then: there is nothing left to go on with.

        Args:
            result: The simulation.
            finish: Called with the folder and the summary before ``summary.json`` is put in
                place; draws figures. Where it cannot write them the result is not finished, and
                can be gone on with; it is in spite of any other exception.

        Returns:
            The summary as written.
        """
        try:
            return self._write(result, FINISHED, finish)
        finally:
            if (self.path / FINISHED).exists():
                self._remove([f"{_CHECKPOINTS}*"])

    def write_partial(self, result: Result) -> dict[str, Any]:
        """Write what a simulation that stopped has reached, with ``partial-summary.json``.

        Args:
            result: The lapses that were finished.

        Returns:
            The summary as written.
        """
        return self._write(result, PARTIAL, None)

    def close(self) -> None:
        """Give the lock back; a folder made for this run in which nothing was written goes too."""
        if self._lock is not None:
            (self.path / LOCK).unlink(missing_ok=True)
            self._lock.close()
            self._lock = None
            _remove_empty([self.checkpoint])
            _remove_empty(self._created)

    def _write(self, result: Result, name: str, finish: Finish | None) -> dict[str, Any]:
        start = time.perf_counter()
        self.clear()
        write_tables(self.path, result)
        summary = summarise(result)
        before = summary["wall_s"].get("output", 0.0)

        def clock() -> None:
            seconds = before + time.perf_counter() - start
            summary["wall_s"]["output"] = summary["work"]["wall_s"]["output"] = seconds

        clock()
        trouble: Exception | None = None
        try:
            if finish is not None:
                finish(self.path, summary)
        except OSError:
            raise
        except Exception as error:  # a picture that cannot be drawn takes no result away
            trouble = error
        clock()
        text = json.dumps(summary, indent=1, allow_nan=False, ensure_ascii=False)
        replace_file(self.path / name, text + "\n")
        if trouble is not None:
            raise trouble
        return summary

    def _remove(self, patterns: Iterable[str]) -> None:
        for pattern in patterns:
            for file in (*self.path.glob(pattern), *self.path.glob(part_of(Path(pattern)).name)):
                file.unlink()
        _remove_empty([self.checkpoint])


def _take_lock(folder: Path) -> IO[str]:
    path = folder / LOCK
    while True:
        file = path.open("a", encoding="utf-8")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.close()
            if error.errno not in (errno.EAGAIN, errno.EACCES):
                raise
            raise ResultError(
                f"{folder}: found that another run is writing there ({LOCK} is locked); expected "
                "a folder of its own for each run. Wait until it ends, or choose another"
            ) from error
        # the run that held the lock may have removed the file between our open and our lock
        if path.exists() and os.path.samestat(os.fstat(file.fileno()), path.stat()):
            return file
        file.close()


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:  # innermost first
        try:
            folder.rmdir()
        except OSError:  # it holds something, or is gone
            return
