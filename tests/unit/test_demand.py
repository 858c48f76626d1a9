# SPDX-License-Identifier: MIT
"""What a run takes, said before: sizes without a mesh, memory, and a computer without room for it.

Estimates of memory beside measured peaks, on one rank unless said otherwise; rows with a * are
measured again by ``bench/test_bench_memory.py``:

    run                                      unknowns  points  MiB told  measured  ratio
  * 2D, direct, one lapse                       14400   28800       436       369   1.18
  * 2D, reduced, triangles                      40000  120000       832       640   1.30
    2D, reduced, four lapses with fields        22500   45000       643       786   0.82
    2D, three lapses of hysteretic soil          6400   12800       385       384   1.00
  * 2D, out of the plane                        20000   80000       480       430   1.11
    2D, a record of 40 000 samples                 40      80       397       409   0.97
  * 3D, direct, hexahedra                        5070   11520       431       359   1.20
  * 3D, reduced, hexahedra                      10404   24576       632       545   1.16
  * 3D, reduced, tetrahedra                      6750   47040       556       418   1.33
    3D, two ranks that share the mesh           10404   24576       895       847   1.06
    3D, two ranks with a mesh each              10404   24576      1265      1123   1.13
    a slope that slides, three lapses            1498    2688       295       434   0.68
    a slope that runs out, 14 lapses             1260    5625       290       368   0.79
"""

from __future__ import annotations

import json
import resource
from pathlib import Path

import pytest
from mpi4py import MPI
from support.foretold import told_and_taken
from support.peaks import MIB, at_most_more

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import inspect, memory, room_faults
from fenics_hytf.simulation.demand import SEARCH, Demand, sizes_of

SAND = {"density": 1835.0, "shear_wave_velocity": 225.0, "poisson": 0.3, "damping": 0.05}
MESHES = {
    "quadrilaterals": {"box": {"size": [4.0, 3.0], "cells": [4, 3]}},
    "degree 2": {"box": {"size": [4.0, 3.0], "cells": [4, 3]}, "degree": 2},
    "triangles": {"box": {"size": [4.0, 3.0], "cells": [4, 3], "cell": "triangle"}},
    "hexahedra": {"box": {"size": [4.0, 3.0, 2.0], "cells": [4, 3, 2]}},
    "tetrahedra": {
        "box": {"size": [4.0, 3.0, 2.0], "cells": [4, 3, 2], "cell": "tetrahedron"},
        "degree": 2,
    },
    "antiplane": {"box": {"size": [4.0, 3.0], "cells": [4, 3]}, "kinematics": "antiplane"},
    "column": {"column": {"width": 1.0, "layers": [{"thickness": 3.0, "soil": "s", "cells": 3}]}},
    "many points": {"box": {"size": [4.0, 3.0], "cells": [4, 3]}, "points_per_cell": 9},
    "file": {"file": "../../meshes/slope.msh", "empty": ["air"]},
    "file, refined": {"file": "../../meshes/slope.msh", "empty": ["air"], "refine": 1},
}
HERE = Path(__file__).parent
GIB = 2**30


def scene(mesh=None, **sections) -> Scene:
    mesh = mesh or MESHES["quadrilaterals"]
    soils = {"s": SAND} if "file" not in mesh else {"soil": SAND, "rock": SAND, "seam": SAND}
    direction = "z" if "kinematics" in mesh else "x"
    given = {
        "mesh": mesh,
        "soil": soils,
        "motion": [{"direction": direction, "synthetic": {"n": 64, "dt": 0.02}, "pga": 0.1}],
        **sections,
    }
    return Scene.from_dict(given, HERE)


@pytest.mark.parametrize("mesh", MESHES)
def test_sizes_are_known_without_a_mesh(mesh):
    """Cells and points to the last one, but those of empty cells; unknowns but those held."""
    given = scene(MESHES[mesh])
    foretold, found = sizes_of(given.mesh), inspect(given)
    assert foretold.cells == found.cells
    if given.mesh.empty:
        assert foretold.points > found.points
    else:
        assert foretold.points == found.points
    assert found.unknowns <= foretold.unknowns <= 2.5 * found.unknowns
    assert room_faults(given) == []


CASES = {
    "direct": {
        "mesh": {"box": {"size": [60.0, 40.0], "cells": [60, 40]}},
        "solver": {"sweep": "direct"},
    },
    "lapses with fields": {
        "mesh": {"box": {"size": [60.0, 40.0], "cells": [60, 40]}},
        "lapses": {"count": 2},
        "output": {"fields": True},
    },
    "in space": {"mesh": {"box": {"size": [9.0, 9.0, 9.0], "cells": [9, 9, 9]}}},
}


@pytest.mark.parametrize("case", CASES)
def test_memory_is_foretold_to_a_factor_of_two(case, figure):
    """In processes of their own, with peaks of their own; larger cases are in the table above."""
    _, _, told, taken = told_and_taken(scene(**CASES[case]))
    ratio = told / taken
    figure(f"memory foretold, {case}: off by a factor", max(ratio, 1 / ratio), 2.0)


def patched(monkeypatch, size: int) -> None:
    monkeypatch.setattr(memory, "machine_memory", lambda: size)


def test_a_computer_without_room_is_told_what_takes_most(monkeypatch):
    large = scene({"box": {"size": [1e3, 1e3], "cells": [1000, 1000]}})
    patched(monkeypatch, 8 * GIB)
    (fault,) = room_faults(large)
    assert fault.startswith("memory: found a run that takes about ")
    assert "with 1000000 cells and 2004002 unknowns" in fault
    assert "expected at most the 8 GiB that it has" in fault and "--force" in fault
    patched(monkeypatch, 800 * GIB)
    assert room_faults(large) == []


LONG = [{"direction": "x", "synthetic": {"n": 40000, "dt": 0.01}}]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {
                "mesh": {"box": {"size": [90.0, 90.0], "cells": [90, 90]}},
                "solver": {"sweep": "direct"},
                "motion": LONG,
            },
            'sweep = "reduced"',
        ),
        ({"mesh": {"box": {"size": [1e3] * 3, "cells": [99] * 3}}}, "a coarser mesh"),
        (
            {"mesh": {"box": {"size": [9.0, 9.0], "cells": [900, 900]}, "points_per_cell": 100}},
            "points_per_cell",
        ),
        (
            {
                "output": {"receivers": {f"r{i}": [1.0, 1.0] for i in range(3000)}},
                "motion": LONG,
                "solver": {"max_frequency": 1.0},
            },
            "shorter records",
        ),
    ],
    ids=["solutions", "factors", "points", "histories"],
)
def test_what_dominates_is_named_with_the_remedy(monkeypatch, changes, words):
    patched(monkeypatch, GIB // 2)
    (fault,) = room_faults(scene(**changes))
    assert words in fault


def test_a_mesh_beyond_its_memory_is_refused_before_it_is_made(tmp_path, monkeypatch, hytf):
    """By check and run alike, with other faults beside it, in seconds and in no memory."""
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(SCENE)
    patched(monkeypatch, 16 * GIB)
    huge = ("--set", "mesh.box.cells=[3000,3000]")
    refused = "hytf: memory: found a run that takes"
    for arguments in (("check", "s.toml", *huge), ("run", "s.toml", "--quiet", *huge)):
        with at_most_more(50 * MIB):  # a byte a cell would be 9 MiB, and a mesh takes hundreds
            code, out, error = hytf(*arguments)
            assert (code, out) == (2, "") and error.startswith(refused)
            code, out, error = hytf(*arguments, "solver.nothing=1")
            assert code == 2 and "solver.nothing" in error and "9000000 cells" in error
    assert [p.name for p in tmp_path.iterdir()] == ["s.toml"]


SCENE = """
mesh = { box = { size = [4.0, 3.0], cells = [4, 3] } }
soil = { s = { density = 1800.0, shear_wave_velocity = 160.0, poisson = 0.3 } }
[[motion]]
direction = "x"
harmonic = { amplitude = 1.0, frequency = 2.0, cycles = 1, samples = 32 }
"""


def test_force_tries_it_all_the_same(tmp_path, monkeypatch, hytf):
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(SCENE)
    patched(monkeypatch, GIB // 8)  # less than the program itself
    code, _, error = hytf("run", "s.toml", "--no-plots")
    assert code == 2 and "for programs; less takes fewer ranks" in error
    assert hytf("check", "s.toml")[0] == 2
    assert hytf("run", "s.toml", "--no-plots", "--quiet", "--force")[0] == 0
    assert json.loads(Path("s-result/summary.json").read_text())["peak_memory_bytes"] > GIB // 8


def test_groups_that_share_no_mesh_take_it_each():
    demand = Demand({"factors": 3 * GIB, "mesh": GIB})
    program = demand.of(1, 1) - 4 * GIB
    assert demand.of(4, 4) == 4 * GIB + 4 * program
    assert demand.of(4, 2) == 8 * GIB + 4 * program
    assert demand.words(4, 1).startswith("12 GiB of it for factors of the matrices; less takes ")


@pytest.mark.mpi
def test_ranks_of_a_computer_share_its_memory(monkeypatch):
    comm = MPI.COMM_WORLD
    given = scene({"box": {"size": [1e3, 1e3], "cells": [1000, 1000]}})  # 36 GiB
    patched(monkeypatch, 50 * GIB)
    assert room_faults(given, comm) == []
    told = comm.allgather(room_faults(given, comm, 1))  # a mesh of its own for each rank
    assert told == [told[0]] * comm.size and len(told[0]) == (comm.size > 1)
    # one rank with a limit of its own stops all
    patched(monkeypatch, 100 * GIB)
    monkeypatch.setattr(memory, "process_limit", lambda: 2**20 if comm.rank == 0 else None)
    assert len(room_faults(given, comm)) == 1


def test_the_limit_of_a_container_counts(tmp_path, monkeypatch):
    whole = memory.machine_memory()
    for name, used, controllers in (
        ("memory.max", "memory.current", ""),
        ("memory.limit_in_bytes", "memory.usage_in_bytes", "memory"),
    ):
        top = tmp_path / controllers / "x"
        top.mkdir(parents=True, exist_ok=True)
        (top / "child").mkdir()
        (top / name).write_text(f"{whole // 4}\n")
        (top / used).write_text(f"{whole // 8}\n")
        (top / "child" / name).write_text("max\n")
        monkeypatch.setattr(memory, "_groups", lambda top=top: iter([top / "child", top]))
        assert memory.machine_memory() == whole // 4
        assert memory.free_memory() <= whole // 8
        (top / name).unlink()
        for path in (top / "child").iterdir():
            path.unlink()
        (top / "child").rmdir()


def test_a_limit_of_the_process_counts():
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    try:
        resource.setrlimit(resource.RLIMIT_AS, (2**40, hard))
        assert memory.process_limit() == 2**40
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    assert memory.process_limit() == (None if soft == resource.RLIM_INFINITY else soft)


def test_searches_for_mechanisms_are_told_apart():
    soil = {**SAND, "cohesion": 50e3}
    given = scene(
        soil={"s": soil},
        effects={"gravity": True, "sliding": True},
        lapses={"count": 2},
    )
    told = inspect(given)
    # a factor of safety, two senses of one motion, and one more in the second lapse
    assert told.searched == 4 * SEARCH and told.factorisations > 0
    assert inspect(scene()).searched == 0
