# SPDX-License-Identifier: MIT
"""``hytf accuracy``: what accuracy costs for one scene; table, CSV, JSON and figure."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from mpi4py import MPI

from fenics_hytf.cli.collective import at_root, load_scene
from fenics_hytf.cli.outcome import DONE, STOPPED, InputError, RunRequest, say, tell
from fenics_hytf.cli.progress import duration
from fenics_hytf.results import folder_faults, open_result
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import mesh_faults
from fenics_hytf.study import (
    BudgetSpent,
    Processes,
    Study,
    StudyCallback,
    StudyError,
    StudyProgress,
    conduct,
)

RUNS = "runs"
"""Folder of the outcomes, in the folder of the study."""

_STEADY = 5  # runs after which a time left is worth saying


def study_accuracy(request: RunRequest, comm: MPI.Comm, budget: float | None = None) -> int:
    """Study what accuracy costs.

    Args:
        request: What was asked for; ``force`` starts anew.
        comm: Communicator of one rank.
        budget: Wall time after which no run is started any more [s], or ``None``.

    Returns:
        The exit code.

    Raises:
        InputError: If the input is wrong; nothing is written then.
        WriteError: If results could not be written.
    """
    scene, cell_type = _prepare(request, comm, budget)
    folder = at_root(comm, lambda: open_result(request.folder, request.force))
    assert folder is not None  # this is the only rank
    try:
        with show_progress(request.quiet) as progress:
            study = at_root(comm, lambda: _conduct(request, scene, cell_type, budget, progress))
        assert study is not None
        at_root(comm, lambda: _write(request.folder, study))
    except StudyError as error:
        tell([f"stopped: {error}"])
        return STOPPED
    finally:
        folder.close()
    if not request.quiet:
        say(closing_words(study, request.folder))
    return DONE


def _prepare(request: RunRequest, comm: MPI.Comm, budget: float | None) -> tuple[Scene, str]:
    """The scene and the cell type of its mesh, after a look for all faults."""
    scene, faults = load_scene(request, comm)
    faults += folder_faults(request.folder, request.force)
    if budget is not None and not budget > 0:
        faults.append(f"--budget: found {budget:g}; expected a positive number of seconds")
    domain = None
    if scene is not None:
        domain, found = mesh_faults(scene, comm)
        faults += [str(fault) for fault in found]
        if not scene.output.receivers:
            faults.append(
                "output.receivers: found none; expected at least one: its motion is what settings "
                "are compared by"
            )
        if not scene.base_acceleration.any():
            faults.append("motion: found none but zeros; expected one that moves the receivers")
    if faults or scene is None or domain is None:
        raise InputError(faults)
    return scene, str(domain.mesh.topology.cell_name())


def _conduct(
    request: RunRequest,
    scene: Scene,
    cell_type: str,
    budget: float | None,
    progress: StudyCallback | None,
) -> Study:
    runs = request.folder / RUNS
    if request.force and runs.is_dir():
        shutil.rmtree(runs)
    return conduct(scene, cell_type, Processes(runs, _guard(budget)), progress)


def _guard(budget: float | None) -> Callable[[], None]:
    """What stops a study before a run for which there is no time.

    Args:
        budget: Wall time from now [s], or ``None``.

    Returns:
        To be called before a run; it raises :class:`BudgetSpent` once the time is over.
    """
    start = time.monotonic()

    def check() -> None:
        if budget is not None and time.monotonic() - start >= budget:
            raise BudgetSpent(
                f"the budget of {budget:g} s is spent; the same command goes on from here"
            )

    return check


def _write(folder: Path, study: Study) -> None:
    # matplotlib takes half a second to load; only what draws needs it
    from fenics_hytf.study.figure import draw_study
    from fenics_hytf.study.tables import FIGURE, write_tables

    write_tables(folder, study)
    draw_study(study, folder / FIGURE)


def closing_words(study: Study, folder: Path) -> str:
    """The table, and what follows from it.

    Args:
        study: The study.
        folder: Where it is.

    Returns:
        Lines of text.
    """
    from fenics_hytf.study.tables import FIGURE, RECORD, TABLE, slip_table, table, twin_table

    text = f"errors against the {study.reference.text}"
    if study.reference.uncertainty:
        text += f", itself uncertain by {100 * study.reference.uncertainty:.2g} %"
    elif study.reference.pending:
        text += ", how uncertain itself is not known yet"
    parts = [f"{study.title}\n{text}", table(study), slip_table(study), twin_table(study)]
    parts.append("\n".join(study.sentences))
    failed = [p for p in (*study.points, *study.twin.points) if p.failure]
    notes = [
        *study.notes,
        *(f"failed, and tried again next time: {p.name}: {p.failure}" for p in failed),
    ]
    parts.append("\n".join(f"note: {note}" for note in notes))
    parts.append(f"{folder}: {TABLE}, {RECORD}, {FIGURE}")
    return "\n\n".join(part for part in parts if part)


@contextmanager
def show_progress(quiet: bool, stream: TextIO | None = None) -> Iterator[StudyCallback | None]:
    """What to hand to a study: a bar on a terminal, plain lines elsewhere.

    Args:
        quiet: Nothing at all.
        stream: Where to; standard error if ``None``.
    """
    target = sys.stderr if stream is None else stream
    if quiet or target is None:  # closed before the program began
        yield None
    elif target.isatty():
        with _bar(target) as callback:
            yield callback
    else:
        left = _Left()

        def line(progress: StudyProgress) -> None:
            words = ", ".join(filter(None, (progress.text, left(progress))))
            say(f"{_place(progress)}: {words}", target)

        yield line


@contextmanager
def _bar(stream: TextIO) -> Iterator[StudyCallback]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        BarColumn(bar_width=24),
        TextColumn("{task.fields[place]}"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
        TextColumn("{task.description}", markup=False),
    )
    left = _Left()
    with Progress(*columns, console=Console(file=stream), transient=True) as bar:
        task = bar.add_task("", total=1.0, place="", left="")

        def callback(progress: StudyProgress) -> None:
            bar.update(
                task,
                completed=progress.done / progress.planned,
                description=progress.text,
                place=_place(progress),
                left=left(progress),
            )

        yield callback


class _Left:
    """Time left if the rest goes as what is done."""

    def __init__(self) -> None:
        self._start = time.monotonic()

    def __call__(self, progress: StudyProgress) -> str:
        if progress.done < _STEADY:
            return ""
        passed = time.monotonic() - self._start
        return duration(passed * (progress.planned - progress.done) / progress.done)


def _place(progress: StudyProgress) -> str:
    return f"run {progress.done + 1} of about {progress.planned}"
