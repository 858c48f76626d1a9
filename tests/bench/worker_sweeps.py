# SPDX-License-Identifier: MIT
"""Runs one sweep of the benchmark in a process, or ranks, of its own: its seconds and its memory.

    mpirun -n RANKS python3 worker_sweeps.py '{"ground": "section", "cells": [400, 100], ...}'

The last line printed is the answer, as JSON. Stiffness is random in every cell, exp(0.4 N(0, 1))
times the mean, the same whatever the ranks. What is measured is ``hytf run`` without pictures.
"""

import json
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[1]))  # where there is no pytest to do it

from support.meshes import scene
from support.reference import comb

from fenics_hytf.domain import Domain
from fenics_hytf.lapse import CellPeaks, CellProbe, Filling, Ground, Response, survey
from fenics_hytf.particles import Points
from fenics_hytf.results import open_result
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import peak_memory, simulate, weighing

SOIL = {"density": 1900.0, "shear_wave_velocity": 250.0, "poisson": 0.3}


@dataclass(frozen=True)
class Site:
    """A body of ground and the lines it is swept over.

    Attributes:
        size: [m].
        cells: Along each direction, where nothing else is asked for.
        lines: Number of lines.
        top: Frequency of the last one [Hz].
        samples: Of the motion.
    """

    size: tuple[float, ...]
    cells: tuple[int, ...]
    lines: int
    top: float
    samples: int


SITES = {
    "section": Site((200.0, 50.0), (400, 100), 800, 20.0, 4096),
    "block": Site((50.0, 50.0, 40.0), (25, 25, 20), 200, 10.0, 1024),
}


def random_scene(
    ground: str,
    folder: Path,
    *,
    cells: list[int] | None = None,
    damping: float = 0.05,
    sweep: str = "reduced",
    every: int = 1,
    tolerance: float = 1e-6,
) -> Scene:
    """The scene of a site under a motion that excites every so many lines alike.

    Args:
        ground: Name of the site.
        folder: Where the motion is written.
        cells: Along each direction, or those of the site.
        damping: Damping ratio.
        sweep: ``direct`` or ``reduced``.
        every: Lines are this far apart.
        tolerance: Of the residual.
    """
    site = SITES[ground]
    numbers = np.arange(1, site.lines + 1)[every - 1 :: every]
    motion = comb(folder / "comb.csv", numbers, site.samples, site.lines / site.top / site.samples)
    *across, height = site.size
    sides = ("left", "right", "front", "back")[: 2 * len(across)]
    middle = [width / 2 for width in across]
    return scene(
        {
            "box": {
                "size": list(site.size),
                "cells": list(cells or site.cells),
                "cell": "quadrilateral" if len(site.size) == 2 else "hexahedron",
            }
        },
        ("soil",),
        soil={"soil": SOIL | {"damping": damping}},
        motion=[motion | {"direction": "x"}],
        boundary=dict.fromkeys(sides, "dashpot"),
        solver={"sweep": sweep, "tolerance": tolerance, "max_frequency": site.top},
        output={"receivers": {"crest": [*middle, height], "middle": [*middle, height / 2]}},
    )


def random_ground(
    case: Scene, domain: Domain, points: Points, filling: Filling | None = None
) -> Ground:
    """The ground of a scene with a random stiffness in every cell."""
    ground = survey(case, domain, points, filling)
    spread = np.exp(0.4 * np.random.default_rng(7).normal(size=domain.num_cells))
    return replace(ground, shear_modulus=spread * ground.shear_modulus)


def _time_peaks() -> dict[str, float]:
    """Time the strains of all cells alone, and then their five peaks as a run takes them."""
    taken: dict[str, float] = {}
    peaks = CellProbe.peaks

    def timed(probe: CellProbe, response: Response, *more: object) -> CellPeaks:
        start = time.perf_counter()
        probe.peak_strain(response)
        middle = time.perf_counter()
        found = peaks(probe, response, *more)
        taken.update(strain=middle - start, peaks=time.perf_counter() - middle)
        return found

    CellProbe.peaks = timed
    return taken


def measure(order: dict) -> dict | None:
    """Run what was ordered.

    Args:
        order: Arguments of :func:`random_scene`, and ``group_size``.

    Returns:
        On rank 0: seconds by phase and of all, peak memory of every rank [MB], and what was done.
    """
    order = {**order}
    options = {"group_size": order.pop("group_size")} if "group_size" in order else {}
    weighing.survey = random_ground
    taken = _time_peaks()
    comm = MPI.COMM_WORLD
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        few = {"cells": [2] * len(SITES[order["ground"]].size), "every": 100}
        simulate(random_scene(**order | few, folder=folder), comm)  # compiles
        case = random_scene(**order, folder=folder)
        comm.Barrier()
        start, processor = time.perf_counter(), time.process_time()
        result = simulate(case, comm, **options)
        seconds = dict(result.work.wall_s) | taken
        if comm.rank == 0:
            writing = time.perf_counter()
            with open_result(folder / "result") as opened:
                opened.write(result)
            seconds["output"] += time.perf_counter() - writing
        comm.Barrier()
        wall, processor = time.perf_counter() - start, time.process_time() - processor
    memory = comm.gather(peak_memory() / 2**20)
    lapse = result.lapses[0]
    return (
        None
        if comm.rank
        else {
            "seconds": seconds,
            "wall": wall,
            "cpu": processor,
            "memory": memory,
            "unknowns": result.sizes["unknowns"],
            "lines": lapse.solved_lines,
            "factorisations": lapse.factorisations,
            "solves": lapse.solves,
            "residual": lapse.worst_residual,
        }
    )


if __name__ == "__main__":
    answer = measure(json.loads(sys.argv[1]))
    if answer is not None:
        print(json.dumps(answer))
