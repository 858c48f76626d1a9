# SPDX-License-Identifier: MIT
"""What of a scene decides its results, and the keys in which two scenes differ."""

from __future__ import annotations

import copy
import json

import meshio
import numpy as np
import pytest

from fenics_hytf.scene import Scene, changed_keys, identity

DATA = {
    "title": "A column",
    "mesh": {"column": {"width": 1, "layers": [{"thickness": 8.0, "soil": "sand", "cells": 4}]}},
    "soil": {
        "sand": {
            "density": 1800.0,
            "shear_wave_velocity": 160.0,
            "poisson": 0.3,
            "curves": {
                "strain": [1e-6, 1e-5, 1e-4, 1e-3],
                "modulus": [1.0, 0.9, 0.7, 0.3],
                "damping": [0.01, 0.02, 0.05, 0.1],
            },
        }
    },
    "motion": [{"direction": "x", "synthetic": {"n": 64, "dt": 0.02}, "pga": 0.1}],
    "boundary": {"left": "tied", "right": "tied"},
    "lapses": {"count": 2},
    "effects": {"equivalent_linear": {"tolerance": 1e-3}},
    "output": {"receivers": {"top": [0.5, 8.0]}},
}


def changes(before, after, folder="."):
    scenes = [Scene.from_dict(data, folder) for data in (before, after)]
    now, then = (json.loads(json.dumps(identity(scene))) for scene in reversed(scenes))
    return changed_keys(then, now, "as in the checkpoint")


def altered(**changes):
    """The scene with values at dotted keys changed; a value of None takes the key away."""
    data = copy.deepcopy(DATA)
    for key, value in changes.items():
        *path, last = (int(p) if p.isdecimal() else p for p in key.split("__"))
        place = data
        for part in path:
            place = place.setdefault(part, {}) if isinstance(place, dict) else place[part]
        if value is None:
            del place[last]
        else:
            place[last] = value
    return data


@pytest.mark.parametrize(
    "same",
    [
        {},
        {"title": "Another"},
        {"mesh__column__width": 1.0},
        {"mesh__degree": 1},
        {"mesh__kinematics": "plane_strain"},
        {"motion__0__input": "within"},
        {"solver": {"excited": 1e-8}},
        {"effects__equivalent_linear": True},
        {"effects__equivalent_linear__max_iterations": 80},
        {"effects__convection": False},
        {"effects__rayleigh": {"alpha": 0, "beta": 0}},
        {"points__outside": "error"},
        {"output__every": 3},
        {"output__fields": True},
        {"output__water_table": 4.0},
    ],
    ids=str,
)
def test_what_decides_no_number_may_change(same):
    assert changes(DATA, altered(**same)) == []


@pytest.mark.parametrize(
    ("change", "key", "found", "expected"),
    [
        ({"mesh__column__layers__0__cells": 5}, "mesh.column.layers[0].cells", "5", "4"),
        ({"mesh__degree": 2}, "mesh.degree", "2", "1"),
        ({"mesh__points_per_cell": 9}, "mesh.points_per_cell", "9", "nothing"),
        ({"soil__sand__density": 1900.0}, "soil.sand.density", "1900.0", "1800.0"),
        ({"soil__sand__damping": 0.02}, "soil.sand.damping", "0.02", "nothing"),
        (
            {"soil__sand__curves__damping": [0.01, 0.02, 0.06, 0.11]},
            "soil.sand.curves.damping[2]",
            "0.06",
            "0.05",
        ),
        ({"motion__0__pga": 0.3}, "motion[0].pga", "0.3", "0.1"),
        ({"motion__0__synthetic__n": 65}, "motion[0].synthetic.n", "65", "64"),
        ({"boundary__left": None, "boundary__right": None}, "boundary.left", "nothing", '"tied"'),
        (
            {"boundary__left": "roller", "boundary__right": "roller"},
            "boundary.left",
            '"roller"',
            '"tied"',
        ),
        ({"lapses__count": 4}, "lapses.count", "4", "2"),
        ({"effects__equivalent_linear": False}, "effects.equivalent_linear", "nothing", "{ "),
        (
            {"effects__equivalent_linear__tolerance": 0.01},
            "effects.equivalent_linear.tolerance",
            "0.01",
            "0.001",
        ),
        ({"effects__convection": True}, "effects.convection", "true", "false"),
        ({"points__outside": "park"}, "points.outside", '"park"', '"error"'),
        ({"solver__sweep": "direct"}, "solver.sweep", '"direct"', '"reduced"'),
        ({"solver__tolerance": 1e-5}, "solver.tolerance", "1e-05", "1e-06"),
        (
            {"output__receivers__top": [0.5, 4.0]},
            "output.receivers.top",
            "[0.5, 4.0]",
            "[0.5, 8.0]",
        ),
        (
            {"output__receivers__top": {"point": [0.5, 8.0]}},
            "output.receivers.top",
            "{ point = [0.5, 8.0] }",
            "[0.5, 8.0]",
        ),
        ({"output__receivers__mid": [0.5, 4.0]}, "output.receivers.mid", "[0.5, 4.0]", "nothing"),
    ],
    ids=str,
)
def test_what_decides_is_told_by_its_key(change, key, found, expected):
    fault = next(fault for fault in changes(DATA, altered(**change)) if fault.key == key)
    assert fault.found == found
    assert fault.expected.startswith(expected)
    assert fault.expected.endswith(", as in the checkpoint")


def test_every_changed_key_is_told():
    change = {"soil__sand__density": 1900, "solver__tolerance": 1e-5, "motion__0__pga": 0.2}
    keys = [fault.key for fault in changes(DATA, altered(title="x", **change))]
    assert keys == ["soil.sand.density", "motion[0].pga", "solver.tolerance"]


def test_defaults_that_follow_from_a_changed_key_are_not_told():
    """The reference frequency follows from the motion, the continuity from the number of lapses."""
    synthetic = {"n": 64, "dt": 0.02, "f2": 6.0}
    found = changes(DATA, altered(motion__0__synthetic=synthetic, lapses__count=1))
    assert [fault.key for fault in found] == ["motion[0].synthetic.f2", "lapses.count"]
    (fault,) = changes(
        DATA, altered(solver__complex_modulus="kramer", lapses__continuity="steady")
    )[:1]
    assert fault.key in ("lapses.continuity", "solver.complex_modulus")


def test_a_motion_more():
    data = copy.deepcopy(DATA)
    data["motion"].append({**data["motion"][0], "direction": "y"})
    (fault,) = changes(DATA, data)
    assert (fault.key, fault.expected) == ("motion[1]", "nothing, as in the checkpoint")


def test_a_record_counts_by_its_samples(tmp_path):
    def written(name, text):
        (tmp_path / name).write_text(text)
        return altered(motion=[{"direction": "x", "file": name, "dt": 0.1}])

    data = written("a.csv", "0.1\n0.2\n0.3\n0.2\n")
    before = identity(Scene.from_dict(data, tmp_path))
    moved = written("b.csv", "0.10\n0.20\n0.30\n0.2\n")
    assert changed_keys(before, identity(Scene.from_dict(moved, tmp_path)), "since") == []
    written("a.csv", "0.1\n0.2\n0.3\n0.25\n")
    (fault,) = changed_keys(before, identity(Scene.from_dict(data, tmp_path)), "since")
    assert fault.key == "motion[0].file" and "4 samples of 0.1 s with sha256" in fault.found
    assert fault.found != fault.expected.removesuffix(", since")


def test_a_mesh_counts_by_its_bytes(tmp_path):
    def write(width):
        places = [[0.0, 0.0], [width, 0.0], [width, 1.0], [0.0, 1.0]]
        mesh = meshio.Mesh(places, [("quad", [[0, 1, 2, 3]])])
        meshio.write(tmp_path / "box.vtk", mesh)

    write(1.0)
    data = altered(mesh={"file": "box.vtk"}, output={})
    before = identity(Scene.from_dict(data, tmp_path))
    (tmp_path / "else.vtk").write_bytes((tmp_path / "box.vtk").read_bytes())
    moved = Scene.from_dict(altered(mesh={"file": "else.vtk"}, output={}), tmp_path)
    assert changed_keys(before, identity(moved), "since") == []
    write(2.0)
    (fault,) = changed_keys(before, identity(Scene.from_dict(data, tmp_path)), "since")
    assert fault.key == "mesh.file" and "sha256" in fault.found


def test_a_mesh_in_two_files_counts_with_both(tmp_path):
    (tmp_path / "box.xdmf").write_text("<Xdmf/>")
    (tmp_path / "box.h5").write_bytes(b"1")
    data = altered(mesh={"file": "box.xdmf"}, output={})
    before = identity(Scene.from_dict(data, tmp_path))
    (tmp_path / "box.h5").write_bytes(b"2")
    (fault,) = changed_keys(before, identity(Scene.from_dict(data, tmp_path)), "since")
    assert fault.key == "mesh.file"


def test_curves_count_by_their_columns(tmp_path):
    def write(name, damping):
        columns = np.column_stack([[1e-6, 1e-4, 1e-2], [1.0, 0.8, 0.1], damping])
        rows = "\n".join(",".join(map(str, row)) for row in columns)
        (tmp_path / name).write_text(f"strain,modulus,damping\n{rows}\n")
        return Scene.from_dict(altered(soil__sand__curves={"file": name}), tmp_path)

    before = identity(write("a.csv", [0.01, 0.05, 0.2]))
    assert changed_keys(before, identity(write("b.csv", [0.01, 0.05, 0.2])), "since") == []
    (fault,) = changed_keys(before, identity(write("a.csv", [0.01, 0.05, 0.3])), "since")
    assert fault.key == "soil.sand.curves.damping"
