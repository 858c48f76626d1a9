# SPDX-License-Identifier: MIT
"""What a piece of a test takes of memory at its peak, whatever ran in the process before it."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fenics_hytf.simulation import peak_memory

MIB = 2**20


@contextmanager
def at_most_more(size: int) -> Iterator[None]:
    """Fail if the process takes so many bytes more meanwhile, if only for a moment.

    The mark of the process's peak is put back to what it takes now, or anything larger before would
    hide a new peak. So would memory that was freed: libraries under dolfinx make the allocator keep
    it, so that it is given back first.
    """
    ctypes.CDLL(None).malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")  # proc(5): resets VmHWM
    before = peak_memory()
    yield
    more = peak_memory() - before
    assert more < size, f"found {more / MIB:.0f} MiB more; expected less than {size / MIB:.0f} MiB"
