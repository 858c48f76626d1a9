# SPDX-License-Identifier: MIT
"""Where a run under way keeps its checkpoint, and what it goes on from; the same on every rank."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

from mpi4py import MPI

from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation.checkpoint import (
    FILE,
    Checkpoint,
    read_checkpoint,
    require_place,
    require_same_scene,
    require_sound,
    take_checkpoint,
    versions,
    write_checkpoint,
)
from fenics_hytf.simulation.errors import CheckpointError

T = TypeVar("T")


class CheckpointFolder:
    """The folder of a run's checkpoint (collective).

    Args:
        path: The folder, made with the first checkpoint; rank 0 alone reads and writes there.
        scene: The scene of the run.
        comm: All ranks of the run.
        resume: Whether to go on from the checkpoint that is there; without one a run starts anew.
        first: Called on rank 0 before the first checkpoint is written.

    Attributes:
        path: The folder.
        found: The checkpoint that the run goes on from, let go of once another is kept; ``None``
            where it starts at the first lapse.

    Raises:
        CheckpointError: The checkpoint cannot be read, or its place is no folder.
        SceneError: It is of another scene, with every key that differs. Each on every rank.
    """

    def __init__(
        self,
        path: Path,
        scene: Scene,
        comm: MPI.Comm = MPI.COMM_WORLD,
        resume: bool = False,
        first: Callable[[], object] | None = None,
    ) -> None:
        self.path = path
        self._scene = scene
        self._comm = comm
        self._first = first
        self.found: Checkpoint | None = self._at_root(lambda: self._read(resume))
        self._lapse = None if self.found is None else self.found.lapse
        # a lapse that is being kept, and the file that its own replaces
        self._coming: tuple[int, tuple[int, int] | None] | None = None

    @property
    def lapse(self) -> int | None:
        """Number of the lapse after which the last checkpoint was kept, ``None`` without one.

        By the file that is there: an interrupted run tells this, and may be anywhere in ``save``.
        """
        if self._coming is not None and self._file() not in (None, self._coming[1]):
            return self._coming[0]
        return self._lapse

    def _file(self) -> tuple[int, int] | None:
        """What tells one checkpoint file from the next, which is written beside it."""
        try:
            found = (self.path / FILE).stat()
        except OSError:
            return None
        return found.st_ino, found.st_mtime_ns

    @property
    def group_size(self) -> int | None:
        """Ranks that shared a mesh where the run that is gone on with had as many; else ``None``.

        A run is gone on with to the last bit only if its ranks share the mesh as they did.
        """
        if self.found is None or self.found.meta["ranks"] != self._comm.size:
            return None
        return int(self.found.meta["group_size"])

    @property
    def notes(self) -> list[str]:
        """Why a run that goes on may differ from one that did not stop, by round-off only."""
        if self.found is None:
            return []
        then, now = self.found.meta["versions"], versions()
        notes = [
            f"the checkpoint was taken with {name} {then.get(name)}, this is {now[name]}: the last "
            "digits may differ"
            for name in now
            if then.get(name) != now[name]
        ]
        ranks = self.found.meta["ranks"]
        if ranks != self._comm.size:
            notes.append(
                f"the checkpoint was taken with {ranks} ranks, these are {self._comm.size}: the "
                "last digits may differ"
            )
        return notes

    def save(self, lapse: int, group_size: int, state: Mapping[str, object]) -> None:
        """Keep what a run has after a lapse, in the place of the last checkpoint (collective).

        Args:
            lapse: Number of the lapse that is done, from 0.
            group_size: Ranks that share a mesh.
            state: Records by name, see :mod:`fenics_hytf.simulation.packing`; what stands on rank
                0 counts.

        Raises:
            CheckpointError: It could not be written; on every rank. The last one is kept.
        """
        self._coming = lapse, self._file()
        self._at_root(lambda: self._write(lapse, group_size, state))
        self._lapse = lapse
        self._coming = self.found = None

    def _read(self, resume: bool) -> Checkpoint | None:
        require_place(self.path)
        found = read_checkpoint(self.path) if resume else None
        if found is not None:
            require_sound(found, self.path)
            require_same_scene(found, self._scene)
        return found

    def _write(self, lapse: int, group_size: int, state: Mapping[str, object]) -> None:
        if self._first is not None:
            self._first()
            self._first = None
        taken = take_checkpoint(self._scene, lapse, self._comm.size, group_size, state)
        write_checkpoint(self.path, taken.meta, taken.arrays)

    def _at_root(self, action: Callable[[], T]) -> T:
        """Do something on rank 0; its result, or its error, is every rank's."""
        if self._comm.rank != 0:
            kind, content = self._comm.bcast(None)
            if kind == "scene":
                raise SceneError(content)
            if kind == "checkpoint":
                raise CheckpointError(content)
            if kind == "bug":
                raise RuntimeError(f"the checkpoint failed on rank 0: {content}")
            value: T = content
            return value
        try:
            value = action()
        except SceneError as error:
            self._comm.bcast(("scene", error.faults))
            raise
        except (CheckpointError, OSError) as error:
            message = _message(error)
            self._comm.bcast(("checkpoint", message))
            raise CheckpointError(message) from error
        except Exception as error:  # whatever it is, the other ranks are waiting
            self._comm.bcast(("bug", f"{type(error).__name__}: {error}"))
            raise
        self._comm.bcast(("value", value))
        return value


def _message(error: CheckpointError | OSError) -> str:
    if isinstance(error, CheckpointError) or error.filename is None:
        return str(error)
    return f"{error.filename}: {error.strerror}"
