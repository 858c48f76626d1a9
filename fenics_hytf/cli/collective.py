# SPDX-License-Identifier: MIT
"""Steps that may fail on one rank only: all ranks agree, then all go on or all stop."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from mpi4py import MPI

from fenics_hytf.cli.outcome import InputError, RunRequest, WriteError
from fenics_hytf.results import ResultError
from fenics_hytf.scene import Fault, Scene, SceneError, examine
from fenics_hytf.simulation import mesh_faults, room_faults

T = TypeVar("T")


def agree(comm: MPI.Comm, action: Callable[[], T]) -> T:
    """Do something on every rank; if one cannot, none goes on (collective).

    Args:
        comm: Communicator.
        action: What to do; not collective itself.

    Returns:
        What the action returned on this rank.

    Raises:
        InputError: If the input was refused on any rank.
        WriteError: If a file could not be written on any rank.
    """
    value: T | None = None
    faults: list[str] = []
    trouble = ""
    try:
        value = action()
    except SceneError as error:
        faults = [str(fault) for fault in error.faults]
    except InputError as error:
        faults = error.faults
    except ResultError as error:
        faults = [str(error)]
    except OSError as error:
        trouble = f"{error.strerror}: {error.filename}" if error.filename else str(error)
    ranks = comm.allgather((faults, trouble))
    for refused, _ in ranks:
        if refused:
            raise InputError(refused)
    for _, stopped in ranks:
        if stopped:
            raise WriteError(stopped)
    return value  # type: ignore[return-value]  # it is the action's


def at_root(comm: MPI.Comm, action: Callable[[], T]) -> T | None:
    """Do something on rank 0; if it cannot, no rank goes on (collective).

    Returns:
        What the action returned on rank 0, ``None`` on the others.

    Raises:
        InputError: If the input was refused.
        WriteError: If a file could not be written.
    """
    return agree(comm, lambda: action() if comm.rank == 0 else None)


def load_scene(request: RunRequest, comm: MPI.Comm) -> tuple[Scene | None, list[str]]:
    """Read a scene on every rank; no mesh is made that there is no memory for (collective).

    Args:
        request: Names the scene file, overrides, a record, and whether memory is to be looked at.
        comm: Communicator.

    Returns:
        The scene, ``None`` on every rank if any refused it; and the faults.
    """
    sections, faults = agree(
        comm, lambda: examine(request.scene, request.overrides, request.motion)
    )
    refused: list[Fault] = next((found for found in comm.allgather(faults) if found), [])
    meshed = comm.allreduce(sections.mesh is not None, MPI.LAND)
    scene = None if refused else Scene.from_sections(sections)
    if meshed and not request.force:
        no_room = room_faults(scene or sections, comm, request.group_size)
        if no_room:
            return None, [*map(str, refused), *no_room]
    if scene is not None:
        return scene, []
    if meshed:
        refused = refused + mesh_faults(sections, comm)[1]
    return None, list(dict.fromkeys(str(fault) for fault in refused))
