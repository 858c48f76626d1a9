# SPDX-License-Identifier: MIT
"""How a command ends: exit codes, messages, and what was asked for."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

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
            say(f"hytf: {message}", sys.stderr)


def say(text: str, stream: TextIO | None = None) -> None:
    """Write a text and a line's end, to standard output unless told otherwise.

    What a command does is done whether or not anybody listens: a reader that has gone (``| head``)
    is no fault, and a stream that cannot be written otherwise is told on standard error.
    """
    stream = sys.stdout if stream is None else stream
    if stream is None:  # closed before the program began
        return
    try:
        typer.echo(text, file=stream)
    except OSError as error:
        _leave_unread(stream)
        if stream is sys.stdout and not isinstance(error, BrokenPipeError):
            say(f"hytf: standard output cannot be written ({error.strerror})", sys.stderr)


def tolerant_streams() -> None:
    """Let no text fail for a character that the terminal's encoding does not have."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _leave_unread(stream: TextIO) -> None:
    """Send what is still to come, at the interpreter's end at the latest, to nowhere."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
