# SPDX-License-Identifier: MIT
"""``hytf check``: the faults of a scene, or what running it would take."""

from __future__ import annotations

import typer
from mpi4py import MPI

from fenics_hytf.cli.collective import load_scene
from fenics_hytf.cli.outcome import DONE, InputError, RunRequest
from fenics_hytf.simulation import Inspection, inspect


def check_scene(request: RunRequest, comm: MPI.Comm) -> int:
    """Check a scene and say what it takes (collective).

    Args:
        request: What was asked for.
        comm: Communicator.

    Returns:
        The exit code.

    Raises:
        InputError: With every fault of the scene.
        SceneError: A fault that only the mesh shows.
    """
    scene, faults = load_scene(request.scene, request.overrides, request.motion, comm)
    if scene is None:
        raise InputError(faults)
    inspection = inspect(scene, comm)
    if comm.rank == 0:
        typer.echo(describe(inspection))
    return DONE


def describe(inspection: Inspection) -> str:
    """The answer for a scene without faults."""
    lines = inspection.lines
    lapses = f"{inspection.lapses} of {inspection.samples_per_lapse} samples"
    solved = f"{sum(lines)}" if len(lines) == 1 else f"{sum(lines)}, {min(lines)}-{max(lines)} each"
    rows = [
        ("effects", ", ".join(inspection.effects) or "none"),
        ("cells", f"{inspection.cells}"),
        ("unknowns", f"{inspection.unknowns}"),
        ("points", f"{inspection.points}"),
        ("lapses", lapses),
        ("lines to solve", solved),
        ("factorisations", f"at most {inspection.factorisations}"),
        ("memory", f"about {inspection.memory_bytes / 2**20:.0f} MiB"),
        *(("note", note) for note in inspection.notes),
    ]
    return "\n".join(["ok", *(f"  {name:15s} {text}" for name, text in rows)])
