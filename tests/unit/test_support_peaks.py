# SPDX-License-Identifier: MIT
"""That a peak of memory is seen behind a larger one before it."""

import pytest
from support.peaks import MIB, at_most_more


def take(size: int) -> None:
    held = bytearray(size)
    held[::4096] = bytes([1]) * len(held[::4096])  # pages count once they are written to


def test_a_peak_is_seen_behind_a_larger_one():
    """Naively the mark of the whole process: it does not move again below the largest so far."""
    take(400 * MIB)
    with pytest.raises(AssertionError, match="MiB more; expected less than 100 MiB"):
        with at_most_more(100 * MIB):
            take(200 * MIB)
    with at_most_more(100 * MIB):
        take(50 * MIB)
