# SPDX-License-Identifier: MIT
"""How a command ends: exit codes, messages, and what was asked for."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import typer

DONE = 0
BUG = 1
INPUT = 2
STOPPED = 3
INTERRUPTED = 130


@dataclass(frozen=True)
class RunRequest:
    """What a command was asked to do.

    Attributes:
        scene: Scene file.
        folder: Result folder.
        motion: Record in the place of the first motion's, or ``None``.
        overrides: ``key=value`` for the scene.
        force: Whether a finished result, or an unfinished run, may be replaced.
        quiet: No progress, no summary.
        plots: Whether figures and the report are made.
        group_size: Ranks that share a mesh; from memory if ``None``.
        demo: Where the scene is copied from, or ``None``.
        resume: Whether an unfinished run is gone on with.
    """

    scene: Path
    folder: Path
    motion: Path | None = None
    overrides: tuple[str, ...] = ()
    force: bool = False
    quiet: bool = False
    plots: bool = True
    group_size: int | None = None
    demo: Path | None = None
    resume: bool = False


class InputError(ValueError):
    """What was given cannot be used.

    Attributes:
        faults: Each with what was found, what was expected and what to do.
    """

    def __init__(self, faults: Iterable[str]) -> None:
        self.faults = list(faults)
        super().__init__("\n".join(self.faults))


class WriteError(RuntimeError):
    """Results could not be written while a run was under way."""


def launched_rank() -> int:
    """This process's MPI rank as its launcher says, without starting MPI; 0 without a launcher."""
    for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"):
        value = os.environ.get(name, "")
        if value.isdecimal():
            return int(value)
    return 0


def tell(messages: Iterable[str]) -> None:
    """Write messages to standard error, on the first of several ranks."""
    if launched_rank() == 0:
        for message in messages:
            typer.echo(f"hytf: {message}", err=True)
