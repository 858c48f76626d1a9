# SPDX-License-Identifier: MIT
"""A column that runs in a second, for tests of what may befall a run."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fenics_hytf.motion import Segment
from fenics_hytf.simulation.run import Run

COLUMN = """
title = "A column"
[mesh]
column = { width = 1.0, layers = [ { thickness = 8.0, soil = "sand", cells = 4 } ] }
[soil.sand]
density = 1800.0
shear_wave_velocity = 160.0
poisson = 0.3
damping = 0.05
[[motion]]
direction = "x"
synthetic = { n = 48, dt = 0.04 }
[boundary]
left = "tied"
right = "tied"
[lapses]
count = 2
[effects]
convection = true
[output]
receivers = { top = [0.5, 8.0] }
fields = true
"""
STATE = Path("s-result/checkpoint/state.npz")
RUN = ("run", "s.toml", "--no-plots")
HYTF = [sys.executable, "-m", "fenics_hytf.cli"]
FOLDER = "s-result"
STRUCK = """
import os, signal, sys
from mpi4py import MPI
from fenics_hytf.cli import main
from fenics_hytf.simulation.run import Run
rank, what = int(sys.argv[1]), sys.argv[2]
solve = Run.solve_lapse
def solve_lapse(self, segment):
    if segment.index == 1 and MPI.COMM_WORLD.rank == rank:
        if what == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        raise {"memory": MemoryError("Unable to allocate 3 TiB"), "bug": KeyError("bug")}[what]
    return solve(self, segment)
Run.solve_lapse = solve_lapse
main(["run", "s.toml", "--no-plots", "-o", sys.argv[3]])
"""


@contextmanager
def out_of_memory() -> Iterator[None]:
    """Let runs of this process find no memory in their second lapse."""
    solve = Run.solve_lapse

    def solve_lapse(self: Run, segment: Segment) -> object:
        if segment.index == 1:
            raise MemoryError("Unable to allocate 3 TiB")
        return solve(self, segment)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Run, "solve_lapse", solve_lapse)
        yield


def told(error: str) -> str:
    """What was said after lines of progress: one line, no traceback."""
    assert "Traceback" not in error
    (line,) = [line for line in error.splitlines() if line.startswith("hytf: ")]
    return line
