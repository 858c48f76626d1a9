# SPDX-License-Identifier: MIT
"""Memory of this process, and what the system has left."""

from __future__ import annotations

import resource
from pathlib import Path


def peak_memory() -> int:
    """Largest resident memory of this process so far [bytes].

    Linux hands the peak that ``getrusage`` tells on to the programs a process starts; the one in
    ``/proc`` is this program's own.
    """
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return _kilobytes(status, "VmHWM")


def free_memory() -> int:
    """What the system, or the container's limit, leaves to new processes [bytes]."""
    free = _kilobytes(Path("/proc/meminfo").read_text(), "MemAvailable")
    limit, used = (Path(f"/sys/fs/cgroup/memory.{name}") for name in ("max", "current"))
    if limit.exists() and limit.read_text().strip() != "max":
        free = min(free, int(limit.read_text()) - int(used.read_text()))
    return free


def _kilobytes(table: str, name: str) -> int:
    return next(int(row.split()[1]) for row in table.splitlines() if row.startswith(name)) * 1024
