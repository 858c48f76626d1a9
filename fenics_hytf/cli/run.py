# SPDX-License-Identifier: MIT
"""``hytf run``: read, check, simulate, write; every way it can end has its exit code."""

from __future__ import annotations

import signal
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import typer
from mpi4py import MPI

from fenics_hytf.cli.closing import closing_words
from fenics_hytf.cli.collective import at_root, load_scene
from fenics_hytf.cli.demos import Copy, copy_demo, is_same_demo, plan_demo
from fenics_hytf.cli.outcome import (
    BUG,
    DONE,
    INPUT,
    INTERRUPTED,
    STOPPED,
    InputError,
    RunRequest,
    WriteError,
    tell,
)
from fenics_hytf.cli.progress import show_progress
from fenics_hytf.results import ResultFolder, folder_faults, open_result, publish
from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import (
    Result,
    SimulationError,
    Snapshot,
    group_faults,
    mesh_faults,
    simulate,
)

Command = Callable[[RunRequest, MPI.Comm], int]


def guarded(command: Command, request: RunRequest, comm: MPI.Comm = MPI.COMM_WORLD) -> int:
    """Run a command and turn every way it can end into an exit code.

    Args:
        command: The command.
        request: What was asked for.
        comm: Communicator.

    Returns:
        The exit code.
    """
    try:
        with _terminate_as_interrupt():
            return command(request, comm)
    except InputError as error:  # on all ranks alike, as are the next three
        _tell_once(comm, error.faults)
        return INPUT
    except SceneError as error:  # a fault that only the mesh shows
        _tell_once(comm, [str(fault) for fault in error.faults])
        return INPUT
    except SimulationError as error:
        _tell_once(comm, [f"stopped: {error}"])
        return STOPPED
    except WriteError as error:
        _tell_once(comm, [f"stopped: results cannot be written ({error})"])
        return STOPPED
    except KeyboardInterrupt:
        _tell_once(comm, ["interrupted"])
        return _leave_alone(comm, INTERRUPTED)
    except Exception:
        traceback.print_exc()
        return _leave_alone(comm, BUG)


def run_scene(request: RunRequest, comm: MPI.Comm) -> int:
    """Run a scene and write its result (collective).

    Args:
        request: What was asked for.
        comm: Communicator.

    Returns:
        The exit code.

    Raises:
        InputError: If the input is wrong; nothing is written then.
        SimulationError: If the numerics stopped; the lapses before are written.
        WriteError: If results could not be written.
    """
    scene, force = _prepare(request, comm)
    folder = at_root(comm, lambda: open_result(request.folder, force))
    try:
        result = _simulate(request, scene, folder, comm)
        summary = at_root(comm, lambda: _finish(request, folder, result))
    finally:
        if folder is not None:
            folder.close()
    if summary is not None and not request.quiet:
        typer.echo(closing_words(summary, request.folder, request.plots))
    return DONE


def _prepare(request: RunRequest, comm: MPI.Comm) -> tuple[Scene, bool]:
    """The scene, and whether a finished result may be replaced; after a look for all faults."""
    copies: list[Copy] | None = None
    scene: Scene | None = None
    if request.demo is None:
        scene, faults = load_scene(request.scene, request.overrides, request.motion, comm)
        force = request.force
    else:
        demo = request.demo
        plan = comm.bcast(at_root(comm, lambda: plan_demo(demo, request)))
        copies, faults, scene_hash = plan
        force = request.force or is_same_demo(request.folder, scene_hash)
    faults += comm.bcast(at_root(comm, lambda: folder_faults(request.folder, force)))
    faults += group_faults(request.group_size, comm.size)
    if faults and scene is not None:
        faults += [str(fault) for fault in mesh_faults(scene, comm)[1]]
    if faults:
        raise InputError(faults)
    if copies is not None:
        at_root(comm, lambda: copy_demo(copies))
        scene, faults = load_scene(request.scene, request.overrides, request.motion, comm)
    if scene is None:
        raise InputError(faults)
    return scene, force


def _simulate(
    request: RunRequest, scene: Scene, folder: ResultFolder | None, comm: MPI.Comm
) -> Result:
    def snapshot(snapshot: Snapshot) -> None:
        at_root(comm, lambda: folder.snapshot(snapshot) if folder is not None else None)

    with show_progress(quiet=request.quiet or comm.rank != 0) as progress:
        try:
            return simulate(scene, comm, progress, snapshot, group_size=request.group_size)
        except SimulationError as error:
            partial = error.partial
            if partial is not None:
                at_root(comm, lambda: folder and folder.write_partial(partial))
            raise


def _finish(request: RunRequest, folder: ResultFolder | None, result: Result) -> dict[str, Any]:
    assert folder is not None  # rank 0 holds it
    return folder.write(result, publish if request.plots else None)


@contextmanager
def _terminate_as_interrupt() -> Iterator[None]:
    """SIGTERM ends a run as Ctrl-C does."""

    def interrupt(_number: int, _frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _tell_once(comm: MPI.Comm, messages: list[str]) -> None:
    if comm.rank == 0:
        tell(messages)


def _leave_alone(comm: MPI.Comm, code: int) -> int:
    """Leave although other ranks may be waiting for this one: they are ended."""
    if comm.size > 1:
        sys.stderr.flush()
        comm.Abort(code)
    return code
