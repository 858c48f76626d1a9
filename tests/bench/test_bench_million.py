# SPDX-License-Identifier: MIT
"""A slope of a million points that move: what one lapse takes besides its sweep, on one core.

Each run is a process of its own. Seconds are those of the processor, what the run takes of a core
that it has to itself; wall seconds stand beside them. The search for a mechanism, like the sweep,
is factorisations, however many points there are: where soil slides it is told by itself.
"""

import functools
import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(7200)]

JOB = Path(__file__).with_name("million_job.py")
WALL, PROCESSOR = 0, 1
SEARCH = "mechanism"


@functools.cache
def run(size: float, sliding: bool) -> dict:
    """What a run cost; see ``million_job.measure``."""
    order = json.dumps({"size": size, "sliding": sliding})
    done = subprocess.run([sys.executable, JOB, order], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


def seconds(found: dict, kind: int = PROCESSOR, without: tuple[str, ...] = ("sweep",)) -> float:
    """Of all phases but some."""
    return sum(taken[kind] for name, taken in found["seconds"].items() if name not in without)


def described(found: dict) -> str:
    sizes, work, slid = found["sizes"], found["work"], found["mechanism"]
    phases = sorted(found["seconds"].items(), key=lambda phase: -phase[1][PROCESSOR])
    rows = [f"\n  {name:<12} {s[PROCESSOR]:8.1f} s, {s[WALL]:8.1f} s wall" for name, s in phases]
    search = (
        ""
        if slid is None
        else f", a mechanism at {slid['yield']:.3g} g that slips by {slid['slip']:.3g} m"
    )
    return (
        f"\n{sizes['points']} points in {found['filled']} of {sizes['cells']} cells, "
        f"{sizes['unknowns']} unknowns, {found['lines']} lines, {found['iterations']} iterations, "
        f"{work['factorisations']} factorisations, {work['solves']} solves{search}"
        + "".join(rows)
        + f"\n  apart from the sweep {seconds(found):.1f} s, and without the search "
        f"{seconds(found, without=('sweep', SEARCH)):.1f} s; {found['memory'] / 1e9:.1f} GB"
    )


@pytest.mark.parametrize("sliding", [False, True])
def test_a_million_points(sliding, figure):
    found = run(1.0, sliding)
    print(described(found))
    assert found["sizes"]["points"] > 950_000
    name = "a million points, sliding" if sliding else "a million points"
    figure(f"{name}: memory", found["memory"] / 1e9, 24, "GB")
    if not sliding:  # with it there is the march as well; its phases are told
        figure(f"{name}: apart from the sweep", seconds(found), 60, "s")


def test_cost_grows_with_the_points():
    """Nothing grows faster than the points do: a ninth of them is not quick for being few."""
    few, many = run(3.0, False), run(1.0, False)
    per_point = [seconds(found) / found["sizes"]["points"] for found in (few, many)]
    print(described(few) + f"\n  a point of many takes {per_point[1] / per_point[0]:.2f} of one")
    assert per_point[1] < 1.5 * per_point[0]
