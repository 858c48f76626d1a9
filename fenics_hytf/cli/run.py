# SPDX-License-Identifier: MIT
"""``hytf run``: read, check, simulate, write; every way it can end has its exit code."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

from fenics_hytf.cli.closing import closing_words
from fenics_hytf.cli.collective import at_root, load_scene
from fenics_hytf.cli.demos import Copy, copy_demo, plan_demo
from fenics_hytf.cli.interrupt import interruptible
from fenics_hytf.cli.outcome import (
    BUG,
    DONE,
    INPUT,
    INTERRUPTED,
    STOPPED,
    InputError,
    RunRequest,
    WriteError,
    say,
    tell,
)
from fenics_hytf.cli.progress import show_progress
from fenics_hytf.results import (
    CHECKPOINT,
    FINISHED,
    ResultFolder,
    folder_faults,
    is_result_of,
    open_result,
    publish,
    read_summary,
)
from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import (
    CheckpointError,
    CheckpointFolder,
    Progress,
    ProgressCallback,
    Result,
    SimulationError,
    Snapshot,
    group_faults,
    mesh_faults,
    simulate,
)

Command = Callable[[MPI.Comm], int]

_GO_ON = "A run goes on after its last checkpoint with the same command and --resume"
_LESS = (
    'Take a coarser mesh, fewer lines (solver.max_frequency), sweep = "reduced", or more ranks on '
    f"other computers. {_GO_ON}"
)


def guarded(command: Command) -> int:
    """Run a command and turn every way it can end into an exit code (collective).

    Args:
        command: The command, with all but the communicator.

    Returns:
        The exit code.
    """
    comm = MPI.COMM_WORLD
    try:
        with interruptible(comm):
            return command(comm)
    except InputError as error:  # on all ranks alike, as are the next four
        _tell_once(comm, error.faults)
        return INPUT
    except SceneError as error:  # a fault that only the mesh shows
        _tell_once(comm, [str(fault) for fault in error.faults])
        return INPUT
    except SimulationError as error:
        _tell_once(comm, [f"stopped: {error}"])
        return STOPPED
    except CheckpointError as error:
        _tell_once(comm, [f"stopped: {error}"])
        return STOPPED
    except WriteError as error:
        advice = f"Make room, or see to its permissions. {_GO_ON}"
        _tell_once(comm, [f"stopped: results cannot be written ({error}). {advice}"])
        return STOPPED
    except KeyboardInterrupt as error:
        _tell_once(comm, [str(error) or "interrupted"])
        return _leave_alone(comm, INTERRUPTED)
    except MemoryError as error:  # on this rank alone
        say(f"hytf: stopped: {_who(comm)} ran out of memory ({error}). {_LESS}", sys.stderr)
        return _leave_alone(comm, STOPPED)
    except Exception:
        traceback.print_exc()
        say(f"hytf: {_who(comm)} met an error of the program, told above. {_GO_ON}", sys.stderr)
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
        CheckpointError: If a checkpoint could not be written; the one before is kept.
        WriteError: If results could not be written.
    """
    scene, force = _prepare(request, comm)
    if comm.bcast(at_root(comm, lambda: _is_finished(request, scene.hash))):
        _say(request, comm, [f"{request.folder}: finished already ({FINISHED}); nothing to do"])
        return DONE
    folder = at_root(comm, lambda: open_result(request.folder, force, request.resume))
    try:
        checkpoint = _checkpoint(request, scene, folder, comm)
        with (
            interruptible(comm, lambda: _farewell(checkpoint, scene), lambda: _close(folder)),
            show_progress(quiet=request.quiet or comm.rank != 0) as progress,
        ):
            result = _simulate(request, scene, folder, checkpoint, progress, comm)
            summary = at_root(comm, lambda: _finish(request, folder, progress, result))
    finally:
        _close(folder)
    if summary is not None and not request.quiet:
        say(closing_words(summary, request.folder, request.plots))
    return DONE


def _prepare(request: RunRequest, comm: MPI.Comm) -> tuple[Scene, bool]:
    """The scene, and whether a result that is there may be replaced; after a look for all faults.

    The folder's faults do not count where it holds the finished result that is asked for.
    """
    copies: list[Copy] | None = None
    scene: Scene | None = None
    force = request.force
    if request.demo is None:
        scene, faults = load_scene(request, comm)
        scene_hash = scene.hash if scene is not None else ""
    else:
        demo = request.demo
        copies, faults, scene_hash = comm.bcast(at_root(comm, lambda: plan_demo(demo, request)))
        force = force or is_result_of(request.folder, scene_hash)
    faults += comm.bcast(at_root(comm, lambda: _folder_faults(request, scene_hash, force)))
    faults += group_faults(request.group_size, comm.size)
    if faults and scene is not None:
        faults += [str(fault) for fault in mesh_faults(scene, comm)[1]]
    if faults:
        raise InputError(faults)
    if copies is not None:
        at_root(comm, lambda: copy_demo(copies))
        scene, faults = load_scene(request, comm)
    if scene is None:
        raise InputError(faults)
    return scene, force


def _folder_faults(request: RunRequest, scene_hash: str, force: bool) -> list[str]:
    if _is_finished(request, scene_hash):
        return []
    return folder_faults(request.folder, force, request.resume)


def _is_finished(request: RunRequest, scene_hash: str) -> bool:
    """Whether a run that is to be gone on with has come to its end; ResultError if it is broken."""
    finished = request.resume and not request.force and is_result_of(request.folder, scene_hash)
    return finished and bool(read_summary(request.folder))


def _checkpoint(
    request: RunRequest, scene: Scene, folder: ResultFolder | None, comm: MPI.Comm
) -> CheckpointFolder:
    """Where the run keeps its checkpoint, and the one that it goes on from."""
    path = request.folder / CHECKPOINT
    first = folder.clear if folder is not None else None
    try:
        checkpoint = CheckpointFolder(path, scene, comm, request.resume, first)
    except SceneError as error:
        advice = (
            f"{path}: found the checkpoint of another scene; expected that of this one. Put the "
            "keys above back, or start anew: --force instead of --resume"
        )
        raise InputError([*map(str, error.faults), advice]) from error
    except CheckpointError as error:
        raise InputError([str(error)]) from error
    if checkpoint.found is not None:
        if folder is not None:
            folder.go_on()
        _say(request, comm, [f"going on after {_lapse(checkpoint, scene)}", *checkpoint.notes])
    elif request.resume:
        _say(request, comm, [f"{path}: found no checkpoint; starting at the first lapse"])
    if comm.size > 1:  # mpirun says which rank was lost, and passes on nothing that others say then
        _say(request, comm, [f"should a rank be lost: {path} is kept. {_GO_ON}"])
    return checkpoint


def _farewell(checkpoint: CheckpointFolder, scene: Scene) -> str:
    """What to say when the run is interrupted."""
    if checkpoint.lapse is None:
        return "interrupted: no lapse was done, there is no checkpoint"
    return (
        f"interrupted: the checkpoint after {_lapse(checkpoint, scene)} is kept in "
        f"{checkpoint.path}. Go on with the same command and --resume"
    )


def _lapse(checkpoint: CheckpointFolder, scene: Scene) -> str:
    assert checkpoint.lapse is not None
    done, planned = checkpoint.lapse + 1, len(scene.segments)
    if done > planned:
        place = f"{planned} of the scene, {done - planned} that sliding added"
    else:
        place = f"{done} of {planned}"
    return f"lapse {checkpoint.lapse} ({place})"


def _simulate(
    request: RunRequest,
    scene: Scene,
    folder: ResultFolder | None,
    checkpoint: CheckpointFolder,
    progress: ProgressCallback | None,
    comm: MPI.Comm,
) -> Result:
    def snapshot(snapshot: Snapshot) -> None:
        at_root(comm, lambda: folder.snapshot(snapshot) if folder is not None else None)

    try:
        return simulate(
            scene,
            comm,
            progress,
            snapshot,
            group_size=request.group_size,
            checkpoint=checkpoint,
        )
    except SimulationError as error:
        partial = error.partial
        if partial is not None:
            at_root(comm, lambda: folder and folder.write_partial(partial))
        raise


def _finish(
    request: RunRequest,
    folder: ResultFolder | None,
    progress: ProgressCallback | None,
    result: Result,
) -> dict[str, Any]:
    """Write the result; of a long record, or for many receivers, that takes minutes."""
    assert folder is not None  # rank 0 holds it
    lapses = len(result.lapses)

    def tell_phase(phase: str) -> None:
        if progress is not None:
            progress(Progress(lapses - 1, lapses, phase))

    def draw(path: Path, summary: dict[str, Any]) -> None:
        tell_phase("figures")
        publish(path, summary)

    tell_phase("tables")
    return folder.write(result, draw if request.plots else None)


def _close(folder: ResultFolder | None) -> None:
    if folder is not None:
        folder.close()


def _say(request: RunRequest, comm: MPI.Comm, messages: list[str]) -> None:
    if not request.quiet:
        _tell_once(comm, messages)


def _tell_once(comm: MPI.Comm, messages: list[str]) -> None:
    if comm.rank == 0:
        tell(messages)


def _who(comm: MPI.Comm) -> str:
    return f"rank {comm.rank} of {comm.size}" if comm.size > 1 else "the run"


def _leave_alone(comm: MPI.Comm, code: int) -> int:
    """Leave although other ranks may be waiting for this one: they are ended."""
    if comm.size > 1:
        if sys.stderr is not None:
            sys.stderr.flush()
        comm.Abort(code)
    return code
