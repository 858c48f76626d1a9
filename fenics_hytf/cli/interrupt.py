# SPDX-License-Identifier: MIT
"""Ctrl-C and SIGTERM: the run ends, says what is kept, and leaves with exit code 130.

A lone process unwinds by an exception. Among several ranks that would not do: objects that they
share are destroyed together, and a rank that waits for another inside MPI never gets there. There
the handler itself says the words, gives back what is held, and ends all ranks. The first rank does
so; another one that was interrupted alone tells it to, and takes its place where it does not
answer: it may be deep inside a solver. While libraries are loaded an exception may end up in their
start-up code: there the handler leaves at once.

``mpirun`` (Open MPI 5) that is interrupted itself ends its ranks within a quarter of a second,
passes on nothing they say any more, and leaves with exit code 1; the last checkpoint is there.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from fenics_hytf.cli.outcome import INTERRUPTED, say, tell

if TYPE_CHECKING:
    from mpi4py import MPI

_ECHO = 1.0  # seconds in which a further signal is the same one: launchers send several
_PATIENCE = 1.0  # seconds in which the first rank should have spoken
_TURN = 0.25  # seconds from the turn of one rank to that of the next
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interrupted(KeyboardInterrupt):
    """The run was interrupted; ``str()`` says what is kept."""


@contextmanager
def interruptible(
    comm: MPI.Comm | None,
    farewell: Callable[[], str] = lambda: "interrupted",
    release: Callable[[], object] = lambda: None,
) -> Iterator[None]:
    """Let SIGINT and SIGTERM end what is done inside (collective).

    Args:
        comm: All ranks; ``None`` while libraries are loaded: nothing has begun.
        farewell: What to say then.
        release: Gives back what other processes would miss; called where all ranks are ended at
            once. A lone process unwinds.

    Raises:
        Interrupted: Where one process is alone.
    """
    last = -_ECHO
    first = _process_of_first_rank(comm) if comm is not None and comm.size > 1 else None

    def interrupt(_number: int, _frame: object) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last < _ECHO:
            return
        last = now
        if comm is None:
            tell([farewell()])
            os._exit(INTERRUPTED)
        if comm.size == 1:
            raise Interrupted(farewell())
        if comm.rank > 0:
            if first is not None:
                os.kill(first, signal.SIGTERM)
            time.sleep(_PATIENCE + _TURN * comm.rank)
        with suppress(Exception):  # whatever fails here, all ranks have to end
            release()
        with suppress(Exception):
            say(f"hytf: {farewell()}", sys.stderr)
        comm.Abort(INTERRUPTED)

    if comm is not None:  # PETSc takes a reader that has gone for a crash; Python raises OSError
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    # a process in the background may have been told to ignore Ctrl-C
    taken = [n for n in _SIGNALS if signal.getsignal(n) is not signal.SIG_IGN]
    before = [signal.signal(number, interrupt) for number in taken]
    try:
        yield
    finally:
        for number, handler in zip(taken, before, strict=True):
            signal.signal(number, handler)


def _process_of_first_rank(comm: MPI.Comm) -> int | None:
    """The first rank's process, where it runs on this rank's computer (collective)."""
    host, process = comm.bcast((os.uname().nodename, os.getpid()))
    return int(process) if host == os.uname().nodename else None
