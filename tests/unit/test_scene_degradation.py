# SPDX-License-Identifier: MIT
"""Degradation in the scene: its keys, its defaults, and what they need beside them."""

import tomllib

import pytest

from fenics_hytf.scene import Scene, check
from fenics_hytf.scene import effects as rules
from fenics_hytf.soil import DegradationLaw

SCENE = """
[mesh]
column = { width = 1.0, layers = [
    { thickness = 1.0, soil = "clay", cells = 1 }, { thickness = 3.0, soil = "sand", cells = 3 } ] }
[soil.clay]
density = 1700
shear_wave_velocity = 150.0
poisson = 0.3
[soil.sand]
density = 1835.0
shear_wave_velocity = 225.0
poisson = 0.3
[[motion]]
direction = "x"
harmonic = { amplitude = 2.0, frequency = 0.5, cycles = 1, samples = 20 }
"""
LAPSES = "[lapses]\ncount = 2\n"


def text(value, lapses=LAPSES):
    return f"{SCENE}{lapses}[effects]\ndegradation = {value}\n"


def effects(value):
    return Scene.from_dict(tomllib.loads(text(value)), ".").effects


def faults(value, lapses=LAPSES):
    return [str(fault) for fault in check(tomllib.loads(text(value, lapses)), ".")[1]]


def test_true_is_the_law_of_its_defaults():
    found = effects("true")
    assert found.named == ("degradation",)
    assert found.degradation.law == DegradationLaw()
    assert found.degradation.soils is None
    assert effects("{}").degradation == found.degradation


def test_false_is_none():
    found = effects("false")
    assert found.degradation is None and found.named == ()
    assert faults("false", "") == []


def test_every_key():
    value = '{ threshold = 1e-4, s = 0.2, r = 0.6, minimum = 0.3, soils = ["clay"] }'
    found = effects(value).degradation
    assert found.law == DegradationLaw(1e-4, 0.2, 0.6, 0.3)
    assert found.soils == ("clay",)


@pytest.mark.parametrize(
    ("value", "key", "found", "expected"),
    [
        ("3", "", "3", "a table, true or false"),
        ("{ treshold = 1e-3 }", ".treshold", "0.001", 'did you mean "threshold"?'),
        ("{ threshold = 0.0 }", ".threshold", "0.0", "a shear strain above 0 and below 0.1"),
        ("{ threshold = 0.1 }", ".threshold", "0.1", "not in percent"),
        ("{ s = 0 }", ".s", "0", "a positive number"),
        ("{ s = nan }", ".s", "nan", "a positive number"),
        ("{ r = -0.5 }", ".r", "-0.5", "a positive number"),
        ("{ r = true }", ".r", "true", "a positive number"),
        ("{ minimum = 1.0 }", ".minimum", "1.0", "a number between 0 and 1"),
        ("{ soils = [] }", ".soils", "[]", "names of soils"),
        ('{ soils = "clay" }', ".soils", '"clay"', "names of soils"),
        ('{ soils = ["clay", "mud"] }', ".soils[1]", '"mud"', "one of the soils clay, sand"),
    ],
)
def test_one_fault_gives_one_message(value, key, found, expected):
    [fault] = faults(value)
    assert fault.startswith(f"effects.degradation{key}: found {found}; expected ")
    assert expected in fault


ONE_LAPSE = (
    "effects.degradation: found one lapse; expected more than one lapse: degradation acts between "
    "lapses"
)


@pytest.mark.parametrize(
    ("lapses", "expected"),
    [
        ("", [ONE_LAPSE]),
        ("[lapses]\ncount = 1\n", [ONE_LAPSE]),
        ("[lapses]\nduration = 2.0\n", [ONE_LAPSE]),  # as long as the motion
        ("[lapses]\nduration = 1e3\n", [ONE_LAPSE]),
        ("[lapses]\nduration = 1.0\n", []),
        (LAPSES, []),
    ],
)
def test_it_acts_between_lapses(lapses, expected):
    assert faults("true", lapses) == expected


def test_lapses_with_a_fault_have_no_other():
    for lapses in ("[lapses]\ncount = 0\n", "[lapses]\nduration = 0.13\n"):
        [fault] = faults("true", lapses)
        assert fault.startswith("lapses.")


def test_a_motion_with_a_fault_has_no_other():
    data = tomllib.loads(text("true", "[lapses]\nduration = 1.0\n"))
    data["motion"][0]["harmonic"]["samples"] = 0
    assert [fault.key for fault in check(data, ".")[1]] == ["motion[0].harmonic.samples"]


def test_without_the_library(monkeypatch):
    monkeypatch.setattr(rules, "find_spec", lambda name: None)
    [fault] = faults("true")
    assert fault.startswith("effects.degradation: found no package rainflow; expected it to be ")
    assert "pip install rainflow" in fault
    assert faults("false") == []
