# SPDX-License-Identifier: MIT
"""A run that was stopped and gone on with is the run that was not: to the last bit, or nearly."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import CheckpointFolder, Result, simulate

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
ROUND_OFF = 1e-10  # of the largest value of a quantity

SCENE = """
title = "A section"
[mesh]
box = { size = [8.0, 6.0], cells = [4, 3], cell = "quadrilateral" }
regions = [ { soil = "sand", below = 4.0 }, { soil = "fill" } ]
[soil.sand]
density = 1900.0
shear_wave_velocity = 220.0
poisson = 0.3
curves = { model = "darendeli", plasticity_index = 0, mean_stress = 80e3 }
[soil.fill]
density = 1800.0
shear_wave_velocity = 160.0
poisson = 0.3
damping = 0.03
[[motion]]
direction = "x"
synthetic = { n = 128, dt = 0.04 }
pga = 0.2
[boundary]
left = "tied"
right = "tied"
[lapses]
count = 4
[effects]
equivalent_linear = { tolerance = 1e-2 }
convection = true
geometric_stiffness = true
[solver]
sweep = "reduced"
[output]
receivers = { top = [4.0, 6.0], rider = { point = [3.0, 5.0] } }
"""


class Stop(Exception):
    pass


def scene_with(tmp_path: Path, **settings: str) -> Scene:
    file = tmp_path / f"s{WORLD.rank}.toml"
    file.write_text(SCENE)
    return Scene.load(file, [f"{key.replace('__', '.')}={v}" for key, v in settings.items()])


def run(scene: Scene, comm: MPI.Comm, folder: Path, resume=False, stop=None, size=None) -> Result:
    """Run with checkpoints; as if something had gone wrong after lapse ``stop`` was shown."""

    def snapshot(shown):
        if shown.index == stop:
            raise Stop

    checkpoint = CheckpointFolder(folder, scene, comm, resume)
    return simulate(scene, comm, None, snapshot, group_size=size, checkpoint=checkpoint)


def arrays(result: Result) -> dict[str, np.ndarray]:
    """All arrays of all lapses, joined by name."""
    found: dict[str, list] = {}

    def collect(name, record):
        for field in dataclasses.fields(record):
            value = getattr(record, field.name)
            if dataclasses.is_dataclass(value):
                collect(f"{name}.{field.name}", value)
            elif value is not None and field.name not in ("change", "worst_cell", "last"):
                found.setdefault(f"{name}.{field.name}", []).append(np.asarray(value).ravel())

    for lapse in result.lapses:
        collect("lapse", lapse)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def assert_near(expected: dict[str, np.ndarray], found: dict[str, np.ndarray], limit: float):
    energy = [np.abs(v).max(initial=0.0) for n, v in expected.items() if ".energy." in n]
    for name, values in expected.items():
        largest = np.abs(values).max(initial=0.0)
        if ".energy." in name:  # some are differences of others, and nought
            largest = max(energy)
        error = np.abs(found[name] - values).max(initial=0.0)
        assert name == "lapse.worst_residual" or error <= limit * largest, (name, error, largest)


def counts(result: Result) -> dict:
    work = dataclasses.asdict(result.work)
    return {name: value for name, value in work.items() if name != "wall_s"}


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("sweep", "shared"), [("direct", True), ("direct", False), ("reduced", False)]
)
def test_on_the_same_ranks_to_the_last_bit(tmp_path, shared_path, sweep, shared):
    loop = "{ tolerance = 1e-2 }" if not shared or WORLD.size == 1 else "false"  # slow where shared
    scene = scene_with(tmp_path, solver__sweep=f'"{sweep}"', effects__equivalent_linear=loop)
    size = WORLD.size if shared else 1
    whole = run(scene, WORLD, shared_path / "a", size=size)
    for stop in (1, 2):
        with pytest.raises(Stop):
            run(scene, WORLD, shared_path / "b", resume=stop > 1, stop=stop, size=size)
    resumed = run(scene, WORLD, shared_path / "b", resume=True)
    assert resumed.group_size == size  # as before, though it was not asked for
    expected, found = arrays(whole), arrays(resumed)
    assert list(expected) == list(found) and len(expected) > 25
    if size == 1:
        for name in expected:
            assert expected[name].tobytes() == found[name].tobytes(), name
        assert counts(whole) == counts(resumed)
        assert [a.loop.change for a in whole.lapses] == [b.loop.change for b in resumed.lapses]
    else:  # MUMPS adds what ranks send as it comes: no two runs agree to the last bit
        assert_near(expected, found, ROUND_OFF)
    WORLD.Barrier()


ROCK = "{ density = 2200.0, shear_wave_velocity = 700.0, poisson = 0.3, damping = 0.01 }"


@pytest.mark.parametrize(
    "settings",
    [
        {"lapses__continuity": '"steady"'},
        {"lapses__continuity": '"transient"', "solver__complex_modulus": '"hysteretic"'},
        {"effects__convection": "false"},
        {"effects__equivalent_linear": "false", "effects__geometric_stiffness": "false"},
        {"effects__degradation": "{ threshold = 1e-6 }"},
        {
            "boundary__left": '"free_field"',
            "boundary__right": '"free_field"',
            "boundary__base": f"{{ compliant = {ROCK} }}",
            "motion__0__input": '"outcrop"',
            "points__outside": '"park"',
        },
        {"output__every": "2"},
    ],
    ids=lambda settings: ", ".join(f"{k.rsplit('__')[-1]} {v[:12]}" for k, v in settings.items()),
)
def test_whatever_a_scene_calls_for(tmp_path, settings):
    scene = scene_with(tmp_path, **settings)
    whole = run(scene, SELF, tmp_path / "a")
    for stop in (1, 3) if scene.output.every == 2 else (1, 2):
        with pytest.raises(Stop):
            run(scene, SELF, tmp_path / "b", resume=stop > 1, stop=stop)
    resumed = run(scene, SELF, tmp_path / "b", resume=True)
    expected, found = arrays(whole), arrays(resumed)
    assert list(expected) == list(found)
    for name in expected:
        assert expected[name].tobytes() == found[name].tobytes(), name
    for done in (before := counts(whole), after := counts(resumed)):
        del done["assemblies"]  # what lasts for a run is assembled in each
    assert before == after


@pytest.mark.mpi
def test_on_another_number_of_ranks_to_round_off(tmp_path, shared_path):
    """From one rank to all, and from all to one; with one factorisation a line."""
    loop = "false" if WORLD.size > 1 else "true"
    scene = scene_with(tmp_path, solver__sweep='"direct"', effects__equivalent_linear=loop)
    own = tmp_path / "own"
    whole = run(scene, SELF, own / "a")
    with pytest.raises(Stop):
        run(scene, WORLD, shared_path / "all", stop=2, size=WORLD.size)
    with pytest.raises(Stop):
        run(scene, SELF, shared_path / "one" if WORLD.rank == 0 else own / "b", stop=2)
    WORLD.Barrier()
    spread = run(scene, WORLD, shared_path / "one", resume=True, size=WORLD.size)
    joined = None
    if WORLD.rank == 0:
        joined = run(scene, SELF, shared_path / "all", resume=True)
    expected = arrays(whole)
    for result in (spread, joined):
        if result is not None:
            assert_near(expected, arrays(result), ROUND_OFF)
    WORLD.Barrier()


DYING = """
import os, signal, sys
from fenics_hytf.cli import main
from fenics_hytf.simulation import checkpoint
old, saves = os.replace, []
def replace(part, path):
    if str(path).endswith(checkpoint.FILE):
        saves.append(path)
        if len(saves) == int(sys.argv[1]):
            with open(part, "r+b") as file:
                file.truncate(os.path.getsize(part) // 2)
            os.kill(os.getpid(), signal.SIGKILL)
    old(part, path)
os.replace = replace
main(sys.argv[2:])
"""


def test_killed_while_a_checkpoint_is_written(tmp_path, monkeypatch):
    """The one before is gone on with; all tables are those of the run that was not killed."""
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(SCENE)
    hytf = [sys.executable, "-m", "fenics_hytf.cli", "run", "s.toml", "--no-plots", "--quiet"]
    subprocess.run([*hytf, "-o", "whole"], check=True)
    dying = [sys.executable, "-c", DYING, "2", *hytf[3:], "-o", "killed"]
    for resume in ((), ("--resume",)):  # twice: in the second of each run's checkpoints
        assert subprocess.run([*dying, *resume], check=False).returncode == -9
        assert {p.name for p in Path("killed/checkpoint").iterdir()} == {
            "state.npz",
            "state.npz.part",
        }
    subprocess.run([*hytf, "-o", "killed", "--resume"], check=True)
    names = sorted(p.name for p in Path("whole").iterdir())
    assert names == sorted(p.name for p in Path("killed").iterdir())
    assert "checkpoint" not in names
    for name in names:
        if not name.endswith(".json"):
            assert Path("whole", name).read_bytes() == Path("killed", name).read_bytes(), name
    whole, killed = (json.loads(Path(d, "summary.json").read_text()) for d in ("whole", "killed"))
    for summary in (whole, killed):
        for key in ("written", "wall_s", "peak_memory_bytes"):
            del summary[key]
        del summary["work"]["wall_s"]
    assert whole == killed


LIMITED = """
import resource, sys
from fenics_hytf.cli import main
from fenics_hytf.simulation import checkpoint_folder
old = checkpoint_folder.write_checkpoint
def write(folder, meta, arrays):
    if meta["lapse"] == 2:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))
    old(folder, meta, arrays)
checkpoint_folder.write_checkpoint = write
main(sys.argv[1:])
"""


def test_a_limit_of_the_file_size(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(SCENE)
    command = [sys.executable, "-c", LIMITED, "run", "s.toml", "--no-plots", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 3 and len(done.stderr.splitlines()) == 1
    assert "no room for the checkpoint (File too large)" in done.stderr
    hytf = [sys.executable, "-m", "fenics_hytf.cli", "run", "s.toml", "--no-plots", "--resume"]
    done = subprocess.run(hytf, capture_output=True, text=True, check=True)
    assert "going on after lapse 1 (2 of 4)" in done.stderr
    assert Path("s-result/summary.json").exists()
