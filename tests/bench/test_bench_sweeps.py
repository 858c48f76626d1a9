# SPDX-License-Identifier: MIT
"""The reduced sweep against the direct one, and what ranks and memory they take.

Each run is a process of its own. What is compared is the sweep and its output: histories of
receivers, strains of all cells, and tables. Beside it stand the same with all peaks of the cells
(strain, stress, acceleration, velocity, displacement: twelve histories a cell, which cost as much
after either sweep), and whole runs with mesh and matrices. The direct sweep is the tuned one
of the package. It is timed on every tenth line and its *sweep* is taken ten times; its output is
left as it was measured with a tenth of the lines, which is to its advantage. With
HYTF_BENCH_FULL=1 it solves every line. Ratios of wall time need a machine that does nothing else:
a run that had less than a core says so.
"""

import functools
import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from bench.worker_sweeps import SITES, random_ground, random_scene
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse.linalg import LinearOperator, eigsh

from fenics_hytf.domain import build
from fenics_hytf.frequency import (
    DynamicSystem,
    SymmetricFactorisation,
    direct_sweep,
    reduced_sweep,
)
from fenics_hytf.lapse import Equations, material, seed_points

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(3600)]

WORKER = Path(__file__).with_name("worker_sweeps.py")
FULL = os.environ.get("HYTF_BENCH_FULL") == "1"
APART = 1 if FULL else 10  # lines of the direct sweep
TOLERANCE = 1e-6
MODES = 8


@functools.cache
def _measured(order: str, ranks: int) -> dict:
    command = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    done = subprocess.run(
        [*command, sys.executable, str(WORKER), order], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


def run(ranks: int = 1, **order) -> dict:
    """What a run cost, measured once; see ``worker_sweeps.measure``."""
    return _measured(json.dumps(order), ranks)


def described(name: str, found: dict) -> str:
    seconds = ", ".join(f"{k} {v:.1f}" for k, v in found["seconds"].items() if v >= 0.05)
    memory = " + ".join(f"{m:.0f}" for m in found["memory"])
    return (
        f"\n  {name:<24} {found['wall']:7.1f} s, {found['cpu'] / found['wall']:.0%} of a core "
        f"({seconds}); {found['lines']} lines, "
        f"{found['factorisations']} factorisations, {found['solves']} solves, "
        f"residual {found['residual']:.1e}, {memory} MB"
    )


def sweep(found: dict, times: int = 1) -> float:
    """Wall seconds of a sweep, so many times."""
    return times * found["seconds"]["sweep"]


def narrow(found: dict, times: int = 1) -> float:
    """Likewise, with receivers, strains of cells and tables."""
    seconds = found["seconds"]
    return sweep(found, times) + seconds["response"] - seconds["peaks"] + seconds["output"]


def wide(found: dict, times: int = 1) -> float:
    """Likewise, with receivers, all peaks of cells and tables: what a run writes."""
    seconds = found["seconds"]
    return sweep(found, times) + seconds["response"] - seconds["strain"] + seconds["output"]


def everything(found: dict, times: int = 1) -> float:
    """Likewise, with mesh and matrices."""
    return found["wall"] - found["seconds"]["strain"] + sweep(found, times - 1)


@pytest.mark.parametrize(
    ("ground", "cells", "damping", "floor"),
    [
        ("section", [200, 50], 0.05, 10),
        ("section", [200, 50], 0.02, 8),
        ("section", [400, 100], 0.05, 15),
        ("section", [400, 100], 0.02, 8),
        ("block", [25, 25, 20], 0.05, 25),
    ],
)
def test_reduced_against_direct(ground, cells, damping, floor, figure):
    order = {"ground": ground, "cells": cells, "damping": damping, "tolerance": TOLERANCE}
    reduced = run(**order, sweep="reduced")
    direct = run(**order, sweep="direct", every=APART)
    ratio, peaks, sweeps, whole = (
        cost(direct, APART) / cost(reduced) for cost in (narrow, wide, sweep, everything)
    )
    shape = " x ".join(map(str, cells))
    name = f"{ground} {shape}, damping {damping:.0%}"
    print(
        f"\n{name}, {reduced['unknowns']} unknowns, {reduced['lines']} lines"
        + described("reduced", reduced)
        + described("direct" if FULL else f"direct, every {APART}th line", direct)
        + f"\n  direct {'measured' if FULL else 'its sweep times ' + str(APART)}: "
        f"{narrow(direct, APART):.1f} s with output"
        f"\n  direct over reduced: {ratio:.1f} with output, {peaks:.1f} with all peaks of cells, "
        f"{sweeps:.1f} the sweeps alone, {whole:.1f} whole runs"
    )
    assert reduced["lines"] >= APART * direct["lines"]
    figure(f"{name}: residual", reduced["residual"], TOLERANCE)
    figure(f"{name}: direct over reduced", ratio, floor, at_least=True)


def natural_frequencies(system: DynamicSystem, omega: float, count: int) -> np.ndarray:
    """Undamped natural frequencies next to a given one [rad/s], by shift and inversion."""
    K, M = system.terms[0][0], system.mass
    x, b = K.createVecs()

    def times(matrix: PETSc.Mat) -> LinearOperator:
        def product(v: np.ndarray) -> np.ndarray:
            x.array[:] = v
            matrix.mult(x, b)
            return b.array_r.real.copy()

        return LinearOperator(matrix.getSize(), product, dtype=float)

    with SymmetricFactorisation(DynamicSystem(K, M)) as shifted:
        shifted.factorise(1j * omega)

        def inverse(v: np.ndarray) -> np.ndarray:
            b.array[:] = v
            shifted.backsolve(b, x)
            return x.array_r.real.copy()

        inverted = LinearOperator(K.getSize(), inverse, dtype=float)
        powers = eigsh(
            times(K), count, times(M), omega**2, OPinv=inverted, return_eigenvectors=False
        )
    x.destroy()
    b.destroy()
    return np.sqrt(powers)


@pytest.mark.parametrize("ground", ["section", "block"])
def test_error_at_every_tenth_line_and_at_resonances(ground, tmp_path, figure):
    case = random_scene(ground, tmp_path)
    domain = build(case, MPI.COMM_SELF)
    equations, points = Equations(case, domain, Counter()), seed_points(case, domain)
    equations.weigh(points)
    soil = random_ground(case, domain, points)
    moduli = soil.secant(np.zeros(domain.num_cells))
    lapse = equations.assemble(soil, material(soil, moduli, case.solver))
    # The lowest, and those about the middle of the band.
    middle = np.pi * case.solver.max_frequency
    found = [natural_frequencies(lapse.system, omega, MODES // 2) for omega in (0.0, middle)]
    modes = np.concatenate(found)
    site = SITES[ground]
    frequencies = site.top * np.arange(1, site.lines + 1) / site.lines
    lines = 1j * np.sort(np.concatenate([2 * np.pi * frequencies, modes]))
    looked_at = np.union1d(np.arange(9, len(lines), 10), np.searchsorted(lines.imag, modes))
    found = reduced_sweep(
        lapse.system, lapse.loads, lines, TOLERANCE, block={"section": 14, "block": 24}[ground]
    )
    direct = direct_sweep(lapse.system, lapse.loads, lines[looked_at], TOLERANCE)
    norm = np.linalg.norm
    errors = np.array(
        [
            norm(found.solution(k) - direct.solution(i)) / norm(direct.solution(i))
            for i, k in enumerate(looked_at)
        ]
    )
    print(
        f"\n{ground}, {equations.num_unknowns} unknowns, {len(lines)} lines: error of the reduced "
        f"sweep at {len(looked_at)} of them, {MODES} on resonances: median "
        f"{np.median(errors):.1e}, worst {errors.max():.1e}"
    )
    figure(f"{ground}: error against direct", errors.max(), 10 * TOLERANCE)
    equations.destroy()


def test_memory_of_a_reduced_run(figure):
    reduced = run(
        ground="section", cells=[400, 100], damping=0.05, tolerance=TOLERANCE, sweep="reduced"
    )
    print(described("section 400 x 100", reduced))
    figure("section 400 x 100, reduced: peak memory", reduced["memory"][0], 1200, "MB")


def test_a_million_unknowns_on_two_ranks(figure):
    order = {"ground": "section", "cells": [1000, 500], "sweep": "direct", "every": 200}
    alone = run(**order)
    shared = run(2, **order, group_size=2)
    rank = max(shared["memory"]) / alone["memory"][0]
    print(
        f"\n{alone['unknowns']} unknowns"
        + described("one rank", alone)
        + described("two ranks share the mesh", shared)
        + f"\n  memory of a rank over that of one alone {rank:.2f}; time "
        f"{alone['wall'] / shared['wall']:.2f} times as fast"
    )
    assert alone["unknowns"] >= 1_000_000
    figure("a million unknowns: memory of a rank over serial", rank, 0.65)
    figure("a million unknowns, two ranks: memory", sum(shared["memory"]) / 1024, 24.0, "GB")


@pytest.mark.parametrize(
    ("ground", "sweep", "every"),
    [("section", "direct", 20), ("section", "reduced", 1), ("block", "reduced", 1)],
)
def test_two_ranks_over_frequencies(ground, sweep, every, figure):
    order = {"ground": ground, "sweep": sweep, "every": every}
    alone = run(**order)
    apart = run(2, **order, group_size=1)
    speed = alone["wall"] / apart["wall"]
    sweeps = alone["seconds"]["sweep"] / apart["seconds"]["sweep"]
    name = f"{ground}, {sweep}, two ranks over frequencies"
    print(
        f"\n{name}"
        + described("one rank", alone)
        + described("two ranks", apart)
        + f"\n  {sweeps:.2f} times as fast in the sweep, {speed:.2f} in all"
    )
    figure(f"{name}: speed of the sweep", sweeps, 1.6, at_least=True)
