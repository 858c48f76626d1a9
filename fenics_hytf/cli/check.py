# SPDX-License-Identifier: MIT
"""``hytf check``: the faults of a scene, or what running it would take."""

from __future__ import annotations

import os
from pathlib import Path

from mpi4py import MPI

from fenics_hytf.cli.collective import at_root, load_scene
from fenics_hytf.cli.outcome import DONE, InputError, RunRequest, say, tell
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import Inspection, factor_of_safety, inspect
from fenics_hytf.simulation.demand import SEARCH


def check_scene(request: RunRequest, comm: MPI.Comm, plot: Path | None = None) -> int:
    """Check a scene and say what it takes (collective).

    Args:
        request: What was asked for.
        comm: Communicator.
        plot: PNG file for the figure of the soils' curves, or ``None``.

    Returns:
        The exit code.

    Raises:
        InputError: With every fault of the scene and of the file; nothing is written then.
        SceneError: A fault that only the mesh shows, or a slope that does not stand at rest.
        SimulationError: The search for its factor of safety stopped.
        WriteError: If the figure could not be written.
    """
    scene, faults = load_scene(request, comm)
    if plot is not None:
        faults += comm.bcast(at_root(comm, lambda: figure_faults(plot)))
    if scene is None or faults:
        raise InputError(faults)
    inspection, safety = inspect(scene, comm), None
    if scene.effects.sliding is not None:
        tell(["looking for the factor of safety at rest: some tens of factorisations"])
        safety = factor_of_safety(scene, comm)
    if comm.rank == 0:
        say(describe(inspection, safety))
    if plot is not None:
        drawn = at_root(comm, lambda: draw(scene, plot))
        if drawn is not None:
            say(f"  {'curves':15s} {drawn}")
    return DONE


def figure_faults(path: Path) -> list[str]:
    """What speaks against writing a figure to a file; touches nothing."""
    folder = path.parent
    if path.suffix.lower() != ".png":
        return [f"--plot: found {path}; expected a file that ends in .png"]
    if not folder.is_dir():
        return [f"--plot: found no folder {folder}; expected one that is there"]
    if not os.access(folder, os.W_OK | os.X_OK):
        return [f"--plot: found that {folder} may not be written; expected write permission"]
    if path.is_dir():
        return [f"--plot: found the folder {path}; expected a file"]
    return []


def draw(scene: Scene, path: Path) -> str:
    """Draw the curves of the scene's soils; say where, or that there are none."""
    count = sum(soil.curve is not None for soil in scene.soil.values())
    if not count:
        return "no soil has any, no figure"
    # matplotlib takes half a second to load; a check without figure does without
    from fenics_hytf.results.figures.curves import draw_curves

    draw_curves(scene.soil, path)
    return f"{path} ({count} soil{'s' if count > 1 else ''})"


def describe(inspection: Inspection, safety: float | None = None) -> str:
    """The answer for a scene without faults.

    Args:
        inspection: What it asks for.
        safety: Its factor of safety at rest, where it may slide.
    """
    lines = inspection.lines
    lapses = f"{inspection.lapses} of {inspection.samples_per_lapse} samples"
    low, high = min(lines), max(lines)
    each = f"{low}" if low == high else f"{low}-{high}"
    solved = f"{sum(lines)}" if len(lines) == 1 else f"{sum(lines)}, {each} each"
    rows = [
        ("effects", ", ".join(inspection.effects) or "none"),
        ("cells", f"{inspection.cells}"),
        ("unknowns", f"{inspection.unknowns}"),
        ("points", f"{inspection.points}"),
        ("lapses", lapses),
        ("continuity", inspection.continuity),
        ("complex modulus", inspection.complex_modulus),
        ("lines to solve", solved),
        ("factorisations", _factorisations(inspection)),
        ("memory", f"about {inspection.memory_bytes / 2**20:.0f} MiB"),
        *([] if safety is None else [("stability", _stability(safety))]),
        *(("note", note) for note in inspection.notes),
    ]
    return "\n".join(["ok", *(f"  {name:15s} {text}" for name, text in rows)])


def _factorisations(inspection: Inspection) -> str:
    text = f"{'at most' if inspection.bounded else 'about'} {inspection.factorisations}"
    if not inspection.searched:
        return text
    return (
        f"{text} of lines, and about {inspection.searched} to find what slips, {SEARCH} more with "
        "each lapse that it adds"
    )


def _stability(safety: float) -> str:
    if safety == float("inf"):
        return "no factor of safety at rest: gravity shears nothing"
    falls = ", and unstable_at_rest lets it go" if safety < 1 else ""
    return f"factor of safety at rest {safety:.3g}{falls}"
