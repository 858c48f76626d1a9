# SPDX-License-Identifier: MIT
"""``hytf stability``: the stability maps of the method, as figures and as one table."""

from __future__ import annotations

import typer
from mpi4py import MPI

from fenics_hytf.cli.accuracy import show_progress
from fenics_hytf.cli.collective import at_root
from fenics_hytf.cli.outcome import DONE, InputError, RunRequest
from fenics_hytf.results import folder_faults, open_result
from fenics_hytf.study import Axes, StabilityRun, conduct_stability
from fenics_hytf.study.stability_table import TABLE, summary, write_runs


def map_stability(request: RunRequest, comm: MPI.Comm, axes: Axes | None = None) -> int:
    """Make the stability maps.

    Args:
        request: The folder; ``force`` replaces maps that are there.
        comm: Communicator of one rank.
        axes: Where the maps are made; everywhere if ``None``.

    Returns:
        The exit code.

    Raises:
        InputError: If the folder cannot be used; nothing is written then.
        WriteError: If the maps could not be written.
    """
    faults = folder_faults(request.folder, request.force)
    table = request.folder / TABLE
    if not faults and not request.force and table.exists():
        faults = [
            f"{request.folder}: found stability maps (it has a {TABLE}); expected a folder without "
            "them. Choose another with -o, or replace them with --force"
        ]
    if faults:
        raise InputError(faults)
    folder = at_root(comm, lambda: open_result(request.folder, request.force))
    assert folder is not None  # this is the only rank
    try:
        with show_progress(request.quiet) as progress:
            runs = conduct_stability(axes, progress)
        drawn = at_root(comm, lambda: _write(request, runs))
    finally:
        folder.close()
    if not request.quiet:
        typer.echo(f"{summary(runs)}\n\n{request.folder}: {', '.join([TABLE, *(drawn or [])])}")
    return DONE


def _write(request: RunRequest, runs: list[StabilityRun]) -> list[str]:
    # matplotlib takes half a second to load; only what draws needs it
    from fenics_hytf.study.stability_figures import draw_stability

    write_runs(request.folder / TABLE, runs)
    return draw_stability(runs, request.folder)
