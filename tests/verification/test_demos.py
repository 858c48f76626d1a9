# SPDX-License-Identifier: MIT
"""The demos are run as tests: each ends in an assertion against theory or a reference."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from support.meshes import mesh_script
from support.reference import SHARED

from fenics_hytf.cli.demos import copy_demo, find_demo, plan_demo
from fenics_hytf.cli.outcome import RunRequest
from fenics_hytf.domain.files import read_mesh
from fenics_hytf.motion import recorded_names
from fenics_hytf.scene import Scene

ROOT = Path(__file__).parents[2]
DEMOS = ROOT / "demos"
SCENES = sorted(path.stem for path in DEMOS.glob("*.toml"))
SCRIPTS = sorted(path.stem for path in DEMOS.glob("demo_*.py"))


# Sliding blocks are compared without a scene; here under one of their records.
BLOCKS = "demo_sliding_blocks"
ARGUMENTS = {BLOCKS: ["Northridge_1994_PAC-175"]}


def require_records(scene):
    """Skip what takes a record by name where the suite of records is not installed."""
    file = DEMOS / f"{scene}.toml"
    if not file.exists() or "\nrecord = " in file.read_text():
        try:
            recorded_names()
        except ValueError:
            pytest.skip("the records extra is not installed")


@pytest.mark.parametrize("script", SCRIPTS)
def test_script(script, tmp_path, monkeypatch):
    require_records(script.removeprefix("demo_"))
    monkeypatch.setattr(sys, "argv", [script, str(tmp_path), *ARGUMENTS.get(script, ())])
    runpy.run_path(str(DEMOS / f"{script}.py"))
    assert (tmp_path / script).with_suffix(".png").stat().st_size > 10_000


def test_every_scene_has_a_script():
    assert SCRIPTS == sorted([BLOCKS, *(f"demo_{scene}" for scene in SCENES)])


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_is_copied_with_its_mesh(name, tmp_path, monkeypatch):
    require_records(name)
    monkeypatch.chdir(tmp_path)
    request = RunRequest(Path(f"{name}.toml"), Path(f"{name}-result"))
    copies, faults, _ = plan_demo(find_demo(name), request)
    assert not faults
    copy_demo(copies)
    scene = Scene.load(f"{name}.toml")
    if scene.mesh.file is not None:
        assert scene.mesh.file.parent == tmp_path
        original = ROOT / "meshes" / scene.mesh.file.name
        assert scene.mesh.file.read_bytes() == original.read_bytes()


# What the scripts of the folder meshes take to draw the files beside them.
DRAWN = {
    "embankment": {},
    "canyon": {"radius": 100, "half_width": 600, "depth": 600, "wavelength": 200, "order": 1},
}


@pytest.mark.parametrize("name", DRAWN)
def test_a_mesh_file_is_what_its_script_draws(name, tmp_path):
    soils = ("fill", "rock")
    drawn = read_mesh(mesh_script(name)(tmp_path / f"{name}.msh", **DRAWN[name]), soils)
    kept = read_mesh(ROOT / "meshes" / f"{name}.msh", soils)
    np.testing.assert_allclose(kept.points, drawn.points, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(kept.cells, drawn.cells)
    assert kept.region_names == drawn.region_names
    assert {k: len(f) for k, f in kept.facets.items()} == {
        k: len(f) for k, f in drawn.facets.items()
    }


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("embankment", {"height": 0.0}),
        ("embankment", {"cells": (0, 4)}),
        ("canyon", {"depth": 1.5}),
        ("canyon", {"wavelength": -2.0}),
        ("canyon", {"order": 3}),
    ],
)
def test_a_mesh_that_cannot_be_drawn_is_refused(name, wrong, tmp_path):
    with pytest.raises(ValueError, match=r"found .*; expected"):
        mesh_script(name)(tmp_path / "mesh.msh", **wrong)
    assert not list(tmp_path.iterdir())


def test_the_column_runs_on_any_at2_record():
    record = SHARED / "motions" / "NIS090.AT2"
    if not record.exists():
        pytest.skip("holds a recorded motion and is not in the repository")
    require_records("column")
    scene = Scene.load(DEMOS / "column.toml", motion_file=record)
    assert scene.motion[0].record.num_samples == 4096
