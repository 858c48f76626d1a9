# SPDX-License-Identifier: MIT
"""What a scene's lapses hand over where it does not say so, and what it may not ask for."""

import pytest
from mpi4py import MPI
from support.sliding import slope

from fenics_hytf.motion import dominant_frequency, energy_band
from fenics_hytf.scene import Scene, check
from fenics_hytf.simulation import mesh_faults

SAND = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3, "damping": 0.05}
RECORD = {"direction": "x", "synthetic": {"n": 400, "dt": 0.02, "f2": 6.0, "t1": 1.0, "t2": 5.0}}
SINE = {
    "direction": "x",
    "harmonic": {"amplitude": 1.0, "frequency": 2.0, "cycles": 16, "samples": 400},
}
SINE_UP = SINE | {"direction": "y"}
SEVERAL = {"count": 4}  # of two seconds each
NYQUIST = 25.0  # [Hz]


def data(*motions, **sections):
    layer = {"thickness": 4.0, "soil": "sand", "cells": 2}
    usual = {
        "mesh": {"column": {"width": 1.0, "layers": [layer]}},
        "soil": {"sand": SAND},
        "motion": list(motions) or [RECORD],
        "boundary": {"left": "tied", "right": "tied"},
    }
    return usual | sections


def scene(*motions, **sections) -> Scene:
    return Scene.from_dict(data(*motions, **sections))


def faults(*motions, **sections):
    return check(data(*motions, **sections), ".")[1]


def settled(case: Scene) -> tuple:
    solver = case.solver
    return case.lapses.continuity, solver.complex_modulus, solver.reference_frequency is not None


@pytest.mark.parametrize(
    ("motions", "lapses", "expected"),
    [
        ([RECORD], {}, ("steady", "hysteretic", False)),
        ([RECORD], {"duration": 8.0}, ("steady", "hysteretic", False)),
        ([RECORD], {"duration": 20.0}, ("steady", "hysteretic", False)),
        ([RECORD], SEVERAL, ("transient", "maxwell", True)),
        ([RECORD], {"duration": 2.0}, ("transient", "maxwell", True)),
        ([SINE], SEVERAL, ("steady", "hysteretic", False)),
        ([SINE, SINE_UP], SEVERAL, ("steady", "hysteretic", False)),
        ([RECORD, SINE_UP], SEVERAL, ("transient", "maxwell", True)),
    ],
)
def test_defaults_hang_on_the_number_of_lapses_and_the_motion(motions, lapses, expected):
    assert settled(scene(*motions, lapses=lapses)) == expected


@pytest.mark.parametrize(
    ("continuity", "law", "count", "expected"),
    [
        ("steady", None, 4, ("steady", "hysteretic", False)),
        ("transient", None, 1, ("transient", "hysteretic", False)),
        ("transient", None, 4, ("transient", "maxwell", True)),
        ("transient", "hysteretic", 4, ("transient", "hysteretic", False)),
        (None, "kramer", 4, ("transient", "kramer", False)),
        (None, "maxwell", 1, ("steady", "maxwell", True)),
        ("steady", "maxwell", 4, ("steady", "maxwell", True)),
    ],
)
def test_what_is_named_stands(continuity, law, count, expected):
    lapses = {"count": count} | ({"continuity": continuity} if continuity else {})
    solver = {"complex_modulus": law} if law else {}
    assert settled(scene(lapses=lapses, solver=solver)) == expected


def test_harmonics_hand_over_where_they_are_told_to():
    lapses = SEVERAL | {"continuity": "transient"}
    assert settled(scene(SINE, lapses=lapses)) == ("transient", "maxwell", True)


def test_the_raw_table_stays_as_it_is():
    raw = data(lapses=SEVERAL)
    case = Scene.from_dict(raw)
    assert case.data == raw and "solver" not in case.data


# ---------------------------------------------------------------- the reference frequency


def test_the_reference_frequency_is_the_dominant_one_of_the_motion():
    case = scene(lapses=SEVERAL)
    record = case.motion[0].record
    expected = dominant_frequency(record.acceleration[None], record.dt)
    assert case.solver.reference_frequency == expected
    found = scene(SINE, solver={"complex_modulus": "maxwell"}).solver.reference_frequency
    assert found == pytest.approx(2.0, rel=0.02)


def test_of_motions_of_different_length_the_strongest_rules():
    short = {"amplitude": 0.1, "frequency": 5.0, "cycles": 10, "samples": 100}
    for amplitude, expected in ((0.1, 2.0), (50.0, 5.0)):
        up = {"direction": "y", "harmonic": short | {"amplitude": amplitude}}
        case = scene(SINE, up, solver={"complex_modulus": "maxwell"})
        assert case.solver.reference_frequency == pytest.approx(expected, rel=0.02)


def test_a_reference_frequency_that_is_given_stands():
    case = scene(lapses=SEVERAL, solver={"reference_frequency": 1.25})
    assert case.solver.reference_frequency == 1.25


def test_a_motion_of_nothing_has_a_reference_frequency_too():
    nothing = SINE | {"harmonic": SINE["harmonic"] | {"amplitude": 0.0}}
    case = scene(nothing, solver={"complex_modulus": "maxwell"})
    assert case.solver.reference_frequency > 0


@pytest.mark.parametrize(
    ("lapses", "solver"),
    [
        ({}, {}),
        ({"continuity": "transient"}, {}),
        (SEVERAL | {"continuity": "steady"}, {}),
        (SEVERAL, {"complex_modulus": "hysteretic"}),
        ({}, {"complex_modulus": "shake91"}),
    ],
)
def test_a_reference_frequency_without_maxwell(lapses, solver):
    (fault,) = faults(lapses=lapses, solver=solver | {"reference_frequency": 2.0})
    assert (fault.key, fault.found) == ("solver.reference_frequency", "2.0")
    assert fault.expected == 'nothing without complex_modulus = "maxwell"'


# ---------------------------------------------------------------- the maximum frequency


def band() -> float:
    """Twice the frequency below which the record has 99 % of its energy [Hz]."""
    record = scene().motion[0].record
    return 2 * energy_band(record.acceleration[None], record.dt)


def test_a_maximum_frequency_that_is_too_low_for_the_motion():
    assert 5.0 < band() < NYQUIST
    (fault,) = faults(lapses=SEVERAL, solver={"max_frequency": 0.99 * band()})
    assert fault.key == "solver.max_frequency"
    assert f"at least {band():.3g} Hz" in fault.expected and "99 %" in fault.expected
    assert faults(lapses=SEVERAL, solver={"max_frequency": 1.01 * band()}) == []


def test_lapses_that_are_too_short_for_the_maximum_frequency():
    short, limit = {"duration": 0.5}, 10 / 0.5
    (fault,) = faults(lapses=short, solver={"max_frequency": 0.99 * limit})
    assert fault.key == "solver.max_frequency"
    assert "at least 20 Hz with lapses of 0.5 s" in fault.expected
    assert faults(lapses=short, solver={"max_frequency": 1.01 * limit}) == []


def test_both_are_said_at_once():
    got = faults(lapses={"duration": 0.5}, solver={"max_frequency": 4.0})
    assert [fault.key for fault in got] == 2 * ["solver.max_frequency"]
    assert all(fault.found == "4.0" for fault in got)


@pytest.mark.parametrize(
    ("lapses", "solver"),
    [
        ({}, {"max_frequency": 1.0}),
        (SEVERAL | {"continuity": "steady"}, {"max_frequency": 1.0}),
        ({"count": 1, "continuity": "transient"}, {"max_frequency": 1.0}),
        ({"duration": 0.5}, {"max_frequency": NYQUIST}),
        ({"duration": 0.5}, {"max_frequency": NYQUIST * (1 - 1e-12)}),
        ({"duration": 0.5}, {}),
    ],
)
def test_no_rule_for_one_lapse_steady_ones_or_the_whole_band(lapses, solver):
    assert faults(lapses=lapses, solver=solver) == []


@pytest.mark.parametrize(
    ("sections", "keys"),
    [
        ({"motion": [RECORD | {"pga": -1}]}, ["motion[0].pga"]),
        ({"lapses": {"count": 0}}, ["lapses.count"]),
        ({"lapses": {"count": 400}}, ["lapses.count"]),
        ({"solver": {"tolerance": 0}}, ["solver.tolerance"]),
        ({"motion": [RECORD, SINE_UP | {"harmonic": SINE["harmonic"] | {"samples": 399}}]},
         ["motion[1]"]),
    ],
)  # fmt: skip
def test_nothing_is_said_after_another_fault(sections, keys):
    """What cannot be known is not complained about."""
    solver = {"max_frequency": 1.0} | sections.pop("solver", {})
    got = faults(**({"lapses": SEVERAL, "solver": solver} | sections))
    assert [fault.key for fault in got] == keys


# ---------------------------------------------------------------- free field

FREE_FIELD = {"left": "free_field", "right": "free_field"}


@pytest.mark.parametrize(
    ("lapses", "law", "bad"),
    [
        (SEVERAL, None, False),
        (SEVERAL, "hysteretic", True),
        (SEVERAL, "dormieux", True),
        (SEVERAL | {"continuity": "steady"}, "hysteretic", False),
        ({"continuity": "transient"}, "hysteretic", False),
    ],
)
def test_free_field_hands_over_under_a_causal_law_only(lapses, law, bad):
    solver = {"complex_modulus": law} if law else {}
    got = faults(lapses=lapses, solver=solver, boundary=FREE_FIELD)
    assert [fault.key for fault in got] == ["boundary.left", "boundary.right"] * bad
    assert all(fault.expected.startswith("not in this version") for fault in got)


@pytest.mark.parametrize(
    ("lapses", "law", "moves", "bad"),
    [
        (SEVERAL, None, True, False),
        (SEVERAL, "hysteretic", True, True),
        (SEVERAL, "hysteretic", False, False),
        (SEVERAL | {"continuity": "steady"}, "hysteretic", True, False),
        ({"continuity": "transient"}, "hysteretic", True, False),
    ],
)
def test_softening_and_vibration_keep_their_stress_apart(lapses, law, moves, bad):
    soil = {"sand": SAND | {"curves": {"model": "seed_idriss_1970_mean"}}}
    effects = {"gravity": True, "softening": True, "equivalent_linear": True, "convection": moves}
    solver = {"complex_modulus": law} if law else {}
    got = faults(lapses=lapses, solver=solver, soil=soil, effects=effects)
    assert [fault.key for fault in got] == ["solver.complex_modulus"] * bad


@pytest.mark.parametrize(
    ("lapses", "key"), [({"count": 25}, "count"), ({"duration": 0.3}, "duration")]
)
def test_transient_lapses_have_twenty_samples(lapses, key):
    def found(**table):
        return mesh_faults(scene(lapses=table), MPI.COMM_SELF)[1]

    (fault,) = found(**lapses)
    assert fault.key == f"lapses.{key}"
    assert "at least 20 samples" in fault.expected
    assert not found(**lapses, continuity="steady")
    assert not found(count=20)


def test_a_march_of_too_many_steps_is_refused():
    data = slope(sliding={"time_step": 1e-9})
    [fault] = check(data, ".")[1]
    assert fault.key == "effects.sliding.time_step"
    assert "100000 steps a lapse" in str(fault)
    assert not check(slope(sliding={"time_step": 1e-4}), ".")[1]


def test_a_rest_of_too_many_samples_is_a_fault():
    (fault,) = check(slope(sliding={"longest": 1e12}), ".")[1]
    assert fault.key == "effects.sliding.longest"
    assert "10000000 samples" in fault.expected
