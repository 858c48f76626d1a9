# SPDX-License-Identifier: MIT
"""Memory of this process, what the computer has, and what it has left."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from pathlib import Path

_CGROUPS = Path("/sys/fs/cgroup")
# Of a group's folder: the limit and what is used, in the second and in the first version of Linux'
# control groups.
_FILES = (("memory.max", "memory.current"), ("memory.limit_in_bytes", "memory.usage_in_bytes"))


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
    return min([free, *(limit - used for limit, used in _limits())])


def machine_memory() -> int:
    """What this computer, or the container's limit, has for all its processes [bytes]."""
    whole = _kilobytes(Path("/proc/meminfo").read_text(), "MemTotal")
    return min([whole, *(limit for limit, _ in _limits())])


def process_limit() -> int | None:
    """Memory that this process may take at most (``ulimit -v``) [bytes]; ``None``: no limit."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def _limits() -> Iterator[tuple[int, int]]:
    """Limits of the control groups that this process is in, and what they use [bytes]."""
    for folder in _groups():
        for limit, used in _FILES:
            try:
                yield int((folder / limit).read_text()), int((folder / used).read_text())
            except (OSError, ValueError):  # none of that version, or "max"
                continue


def _groups() -> Iterator[Path]:
    """Folders of this process's control groups and of those above; what is not there is no harm."""
    try:
        rows = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:
        rows = []
    for row in rows:
        _, controllers, path = row.split(":", 2)
        if controllers in ("", "memory"):
            top = _CGROUPS / controllers
            place = top / path.lstrip("/")
            yield place
            yield from (above for above in place.parents if above.is_relative_to(top))


def _kilobytes(table: str, name: str) -> int:
    return next(int(row.split()[1]) for row in table.splitlines() if row.startswith(name)) * 1024
