# SPDX-License-Identifier: MIT
"""A run that was stopped and gone on with is the run that was not: to the last bit, or nearly."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from support.restart import SCENE

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import CheckpointFolder, Result, simulate

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
ROUND_OFF = 1e-10  # of the largest value of a quantity


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
        {"effects__softening": "true", "effects__gravity": "true"},
        {"effects__softening": "true", "effects__gravity": "true", "effects__convection": "false"},
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


SOFTENS = {
    "effects__softening": "true",
    "effects__gravity": "true",
    "effects__degradation": "{ threshold = 1e-6 }",
}


@pytest.mark.mpi
@pytest.mark.parametrize("settings", [{}, SOFTENS], ids=["as it is", "softening"])
def test_on_another_number_of_ranks_to_round_off(settings, tmp_path, shared_path):
    """From one rank to all, and from all to one; with one factorisation a line."""
    loop = "false" if WORLD.size > 1 else "true"
    given = settings | {"solver__sweep": '"direct"', "effects__equivalent_linear": loop}
    scene = scene_with(tmp_path, **given)
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
