# SPDX-License-Identifier: MIT
"""Bases, sides and directions in a scene file: what is read, and what is told of bad input."""

import copy

import pytest
from support.meshes import gmsh_model, gmsh_section

from fenics_hytf.cli import main
from fenics_hytf.scene import Scene, SceneError, check
from fenics_hytf.simulation import mesh_faults

SOIL = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3}
ROCK = {"density": 2300.0, "shear_wave_velocity": 800.0, "poisson": 0.25}
GOOD = {
    "mesh": {
        "box": {"size": [4.0, 2.0], "cells": [4, 2]},
        "regions": [{"soil": "clay", "below": 1.0}, {"soil": "sand"}],
    },
    "soil": {"clay": SOIL, "sand": SOIL},
    "motion": [
        {
            "direction": "x",
            "input": "outcrop",
            "harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 16},
        }
    ],
    "boundary": {"base": {"compliant": ROCK}, "left": "free_field", "right": "dashpot"},
    "output": {"receivers": {"top": [1.0, 2.0]}},
}


def changed(**sections) -> dict:
    return copy.deepcopy(GOOD) | sections


def faults(data: dict) -> dict[str, str]:
    """What was found and expected by key; faults of the mesh too, as the commands tell them."""
    sections, found = check(data, ".")
    found += mesh_faults(sections)[1] if not found else []
    return {fault.key: f"found {fault.found}; expected {fault.expected}" for fault in found}


def test_what_is_read():
    scene = Scene.from_dict(GOOD)
    assert faults(GOOD) == {}
    assert scene.boundary.kinds == {"base": "compliant", "left": "free_field", "right": "dashpot"}
    assert scene.boundary.rock.shear_wave_velocity == 800.0 and scene.boundary.rock.damping == 0.0
    # V_p/V_s = √3 for ν = 1/4
    assert scene.boundary.rock.p_wave_velocity == pytest.approx(800.0 * 3**0.5, rel=1e-14)
    assert scene.input == "outcrop" and scene.supports["base"] == "compliant"


def test_a_within_motion_holds_a_compliant_base():
    motion = [GOOD["motion"][0] | {"input": "within"}]
    scene = Scene.from_dict(changed(motion=motion))
    assert scene.supports["base"] == "rigid" and scene.boundary.kinds["base"] == "compliant"


@pytest.mark.parametrize("base", ["rigid", "fixed", None])
def test_an_outcrop_motion_on_a_base_that_is_held(base):
    boundary = {"left": "tied", "right": "tied"} | ({"base": base} if base else {})
    (text,) = faults(changed(boundary=boundary)).items()
    assert text[0] == "motion[0].input"
    assert f'"outcrop" on a base that is {base or "rigid"}' in text[1] and "compliant" in text[1]


@pytest.mark.parametrize(
    "base", ["compliant", "dashpot", {"compliant": {}}, {"compliant": "rock"}, {"compliant": None}]
)
def test_dashpots_at_the_base_without_rock(base):
    (text,) = faults(changed(boundary={"base": base})).items()
    assert text[0] == "boundary.base"
    assert all(name in text[1] for name in ("density", "shear_wave_velocity", "poisson"))


@pytest.mark.parametrize(
    ("rock", "key"),
    [
        ({"density": 2300.0, "poisson": 0.25}, "shear_wave_velocity"),
        (ROCK | {"density": -1.0}, "density"),
        (ROCK | {"poisson": 0.5}, "poisson"),
        (ROCK | {"damping": 1.0}, "damping"),
        (ROCK | {"vs": 800.0}, "vs"),
    ],
)
def test_bad_rock(rock, key):
    found = faults(changed(boundary={"base": {"compliant": rock}}))
    assert list(found) == [f"boundary.base.compliant.{key}"]


def test_rock_too_damped_for_dormieux():
    data = changed(
        boundary={"base": {"compliant": ROCK | {"damping": 0.5}}},
        solver={"complex_modulus": "dormieux"},
    )
    assert list(faults(data)) == ["boundary.base.compliant.damping"]


@pytest.mark.parametrize(
    ("boundary", "key", "word"),
    [
        ({"left": "tied"}, "boundary.left", "right"),
        ({"top": "free_field"}, "boundary.top", "sides only"),
        ({"left": {"compliant": ROCK}}, "boundary.left", "base only"),
        ({"left": "compliant"}, "boundary.left", "for the base"),
        ({"left": "spring"}, "boundary.left", "dashpot"),
        ({"left": ["tied"]}, "boundary.left", "one of"),
        ({"base": {"rigid": 1}}, "boundary.base", "compliant"),
    ],
)
def test_kinds_that_do_not_fit(boundary, key, word):
    motion = [GOOD["motion"][0] | {"input": "within"}]
    found = faults(changed(boundary=boundary, motion=motion))
    assert list(found) == [key] and word in found[key]


def test_motions_of_two_kinds():
    motion = [GOOD["motion"][0], GOOD["motion"][0] | {"direction": "y", "input": "within"}]
    found = faults(changed(motion=motion))
    assert (
        list(found) == ["motion[1].input"] and '"outcrop", as the first' in found["motion[1].input"]
    )


@pytest.mark.parametrize(
    ("kinematics", "direction", "expected"),
    [("antiplane", "x", '"z"'), ("antiplane", "y", '"z"'), ("plane_strain", "z", '"x" or "y"')],
)
def test_directions_that_a_section_does_not_move_in(kinematics, direction, expected):
    mesh = GOOD["mesh"] | {"kinematics": kinematics}
    found = faults(changed(mesh=mesh, motion=[GOOD["motion"][0] | {"direction": direction}]))
    assert list(found) == ["motion[0].direction"] and expected in found["motion[0].direction"]


@pytest.mark.parametrize("effect", ["convection", "geometric_stiffness"])
def test_points_do_not_move_across_a_section(effect):
    mesh = GOOD["mesh"] | {"kinematics": "antiplane"}
    motion = [GOOD["motion"][0] | {"direction": "z"}]
    assert faults(changed(mesh=mesh, motion=motion)) == {}
    assert list(faults(changed(mesh=mesh, motion=motion, effects={effect: True}))) == [
        f"effects.{effect}"
    ]


@pytest.mark.parametrize(
    ("kind", "direction", "bad"),
    [
        ("rigid", "x", True),
        ("fixed", "y", True),
        ("roller", "x", True),
        ("roller", "y", False),
        ("dashpot", "x", False),
    ],
)
def test_what_is_held_beside_a_compliant_base(kind, direction, bad):
    boundary = {"base": {"compliant": ROCK}, "left": kind, "right": "free"}
    found = faults(
        changed(boundary=boundary, motion=[GOOD["motion"][0] | {"direction": direction}])
    )
    assert list(found) == (["boundary.left"] if bad else [])


def test_an_absorbing_layer_along_level_ground():
    boundary = {"base": {"compliant": ROCK}, "left": "tied", "right": "tied"}
    calm = {"sides": ["left"], "thickness": 1.0}
    found = faults(changed(boundary=boundary, effects={"calm": calm}))
    assert list(found) == ["effects.calm.sides[0]"] and "tied" in found["effects.calm.sides[0]"]
    found = faults(changed(effects={"calm": {"sides": ["left"], "thickness": 1.0}}))
    assert list(found) == ["effects.calm.sides[0]"]  # free_field
    found = faults(changed(effects={"calm": {"sides": ["right"], "thickness": 9.0}}))
    assert list(found) == ["effects.calm.thickness"]


def test_a_law_that_is_no_name():
    assert list(faults(changed(solver={"complex_modulus": ["shake91"]}))) == [
        "solver.complex_modulus"
    ]


def test_shake91_without_stiffness():
    soil = {"clay": SOIL | {"damping": 0.8}, "sand": SOIL}
    solver = {"complex_modulus": "shake91"}
    assert list(faults(changed(soil=soil, solver=solver))) == ["soil.clay.damping"]


@pytest.mark.parametrize(
    ("calm", "key"),
    [
        ({"sides": ["top"], "thickness": 1.0}, "effects.calm.sides[0]"),
        ({"sides": ["left", "west"], "thickness": 1.0}, "effects.calm.sides[1]"),
        ({"sides": [], "thickness": 1.0}, "effects.calm.sides"),
        ({"sides": ["left"]}, "effects.calm.thickness"),
        ({"sides": ["left"], "thickness": 1.0, "damping": 0.0}, "effects.calm.damping"),
        (True, "effects.calm"),
    ],
)
def test_bad_absorbing_layers(calm, key):
    assert list(faults(changed(effects={"calm": calm}))) == [key]
    assert faults(changed(effects={"calm": False})) == {}


def test_a_free_field_needs_level_layers():
    mesh = {
        "box": {"size": [4.0, 3.0, 2.0], "cells": [4, 3, 2]},
        "regions": [{"soil": "clay", "below": 1.0}, {"soil": "sand"}],
    }
    data = changed(mesh=mesh, output={"receivers": {}})
    data["boundary"] = {"base": {"compliant": ROCK}, "left": "free_field"}
    assert faults(data) == {}


def test_sides_of_a_mesh_file(tmp_path):
    file = tmp_path / "section.msh"
    gmsh_section(file)
    data = changed(mesh={"file": str(file)}, output={"receivers": {}})
    data["boundary"] = {"base": {"compliant": ROCK}, "left": "free_field", "right": "free_field"}
    assert faults(data) == {}
    data["boundary"] = {"base": {"compliant": ROCK}, "left": "free_field", "west": "dashpot"}
    assert list(faults(data)) == ["boundary.west"]
    data["boundary"] = {"base": {"compliant": ROCK}}
    data["effects"] = {"calm": {"sides": ["north"], "thickness": 0.1}}
    assert list(faults(data)) == ["effects.calm.sides[0]"]


def test_a_part_of_a_side_is_no_free_field(tmp_path):
    """Its column would stand on the side's own foot, not on the base."""
    file = tmp_path / "parts.msh"
    with gmsh_model(file, MeshSizeMax=1.0) as gmsh:
        geo = gmsh.model.geo
        places = [(0, 0), (4, 0), (4, 2), (0, 2), (0, 1)]
        p = [geo.addPoint(x, y, 0) for x, y in places]
        lines = [geo.addLine(p[i], p[(i + 1) % 5]) for i in range(5)]
        surface = geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()
        gmsh.model.addPhysicalGroup(2, [surface], name="clay")
        for name, tag in (("base", 0), ("right", 1), ("up", 3), ("low", 4)):
            gmsh.model.addPhysicalGroup(1, [lines[tag]], name=name)
    data = changed(mesh={"file": str(file)}, output={"receivers": {}})
    for name in ("up", "low"):
        data["boundary"] = {"base": {"compliant": ROCK}, "right": "free_field", name: "free_field"}
        found = faults(data)
        assert list(found) == [f"boundary.{name}"]
        assert "only a part" in found[f"boundary.{name}"]
        assert "under one name" in found[f"boundary.{name}"]


def test_bad_input_is_2_and_writes_nothing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = """
[mesh]
box = { size = [4.0, 2.0], cells = [4, 2] }
[soil.sand]
density = 1800.0
shear_wave_velocity = 200.0
poisson = 0.3
[[motion]]
direction = "x"
input = "outcrop"
harmonic = { amplitude = 1.0, frequency = 1.0, cycles = 1, samples = 16 }
[boundary]
left = "tied"
"""
    for name, base in (("rigid", '"rigid"'), ("bare", '"dashpot"')):
        (tmp_path / f"{name}.toml").write_text(text + f"base = {base}\n")
        with pytest.raises(SystemExit) as caught:
            main(["run", f"{name}.toml"])
        assert caught.value.code == 2
        assert not (tmp_path / f"{name}-result").exists()
    told = capsys.readouterr().err
    for key in ("motion[0].input", "boundary.base", "boundary.left"):
        assert key in told
    assert "Traceback" not in told


def test_sections_with_faults_do_not_stop_the_others():
    with pytest.raises(SceneError) as caught:
        Scene.from_dict(changed(boundary={"base": "dashpot"}, effects={"calm": {"sides": ["up"]}}))
    assert {fault.key for fault in caught.value.faults} == {
        "boundary.base",
        "effects.calm.thickness",
    }
