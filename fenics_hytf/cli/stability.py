# SPDX-License-Identifier: MIT
"""``hytf stability``: the stability maps of the method, as figures and as one table."""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

from fenics_hytf.cli.accuracy import show_progress
from fenics_hytf.cli.collective import at_root
from fenics_hytf.cli.outcome import DONE, InputError, say
from fenics_hytf.results import folder_faults, open_result
from fenics_hytf.study import StabilityRun, StudyCallback, conduct_stability
from fenics_hytf.study.stability.table import TABLE, summary, write_runs


def map_stability(folder: Path, force: bool, quiet: bool, comm: MPI.Comm) -> int:
    """Make the stability maps.

    Args:
        folder: Where they go.
        force: Whether maps that are there are replaced.
        quiet: No progress, no summary.
        comm: Communicator of one rank.

    Returns:
        The exit code.

    Raises:
        InputError: If the folder cannot be used; nothing is written then.
        WriteError: If the maps could not be written.
    """
    faults = folder_faults(folder, force)
    if not faults and not force and (folder / TABLE).exists():
        faults = [
            f"{folder}: found stability maps (it has a {TABLE}); expected a folder without them. "
            "Choose another with -o, or replace them with --force"
        ]
    if faults:
        raise InputError(faults)
    opened = at_root(comm, lambda: open_result(folder, force))
    assert opened is not None  # this is the only rank
    try:
        with show_progress(quiet) as progress:
            runs = at_root(comm, lambda: _conduct(folder / TABLE, progress)) or []
        drawn = at_root(comm, lambda: _draw(runs, folder)) or []
    finally:
        opened.close()
    if not quiet:
        say(f"{summary(runs)}\n\n{folder}: {', '.join([TABLE, *drawn])}")
    return DONE


def _conduct(table: Path, progress: StudyCallback | None) -> list[StabilityRun]:
    """All runs, each in the table as soon as it is done."""
    runs: list[StabilityRun] = []
    for found in conduct_stability(progress):
        write_runs(table, found, append=bool(runs))
        runs += found
    return runs


def _draw(runs: list[StabilityRun], folder: Path) -> list[str]:
    # matplotlib takes half a second to load; only what draws needs it
    from fenics_hytf.study.stability.figures import draw_stability

    return draw_stability(runs, folder)
