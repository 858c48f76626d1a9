# SPDX-License-Identifier: MIT
# # Sliding blocks beside those of pyslammer
#
# This demo shows how to:
#
# - let a column of ground slip where it stands under recorded motions, as a rigid block, a
#   decoupled and a coupled one, by the same march as in a simulation;
# - compare each with the analysis of the same name in pyslammer, and the coupled one with a column
#   on an elastoplastic seam that is marched in time.
#
# It takes a folder, and records of the suite that pyslammer brings, four of them if none is named:
# `python3 demo_sliding_blocks.py . Kobe_1995_TAK-090`.

from __future__ import annotations

import sys
from pathlib import Path

from fenics_hytf.motion import recorded
from fenics_hytf.study.sliding_blocks import RECORDS, STEP, agreement, draw, slips, write

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
names = sys.argv[2:] or RECORDS

# ## One record after the other
#
# Each slips at eight yield coefficients, from a tenth to eight tenths of the largest acceleration
# that drives it. Steps are shorter than those of the records: a block that starts and stops between
# samples slips otherwise than one that waits for them.

rows = []
for name in names:
    print(f"{name}, in steps of {1e3 * STEP:g} ms")
    rows += slips(recorded(name))
    mine = [row for row in rows if row.record == name]
    for found, reference in (
        ("rigid", "rigid_pyslammer"),
        ("decoupled_same_drive", "decoupled_pyslammer"),
        ("decoupled", "decoupled_pyslammer"),
        ("coupled", "coupled_pyslammer"),
        ("coupled", "elastoplastic"),
        ("coupled_pyslammer", "elastoplastic"),
    ):
        least, largest = agreement(mine, found, reference)
        print(f"  {found} over {reference}: {least:.4f} to {largest:.4f}")
write(folder / "demo_sliding_blocks.csv", rows)
draw(folder / "demo_sliding_blocks.png", rows)

# ## What agrees
#
# Blocks under one drive, whoever integrates them; and the coupled slip, of all modes, with the
# march in time. One mode alone, as pyslammer's column has it, is off by up to a quarter.


def off(found: str, reference: str) -> float:
    """Largest relative difference of two slips."""
    return max(abs(ratio - 1) for ratio in agreement(rows, found, reference))


assert off("rigid", "rigid_pyslammer") < 0.01
assert off("decoupled_same_drive", "decoupled_pyslammer") < 0.005
assert off("coupled", "elastoplastic") < 0.005
