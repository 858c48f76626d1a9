# SPDX-License-Identifier: MIT
"""What ``hytf check`` foretells: as many lines, and points as heavy, as a run then has."""

from __future__ import annotations

from collections import Counter

import meshio
import numpy as np
import pytest
from mpi4py import MPI

from fenics_hytf.cli.check import describe
from fenics_hytf.lapse import Equations, choose_continuity, scheme_of, seed_points
from fenics_hytf.results.paraview import write_snapshot
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import inspect, simulate
from fenics_hytf.simulation.check import checked_domain

SAND = {"density": 1835.0, "shear_wave_velocity": 225.0, "poisson": 0.3, "damping": 0.05}
CURVES = {"strain": [1e-6, 1e-4, 1e-2], "modulus": [1.0, 0.8, 0.1], "damping": [0.01, 0.1, 0.3]}


def scene(lapses=None, solver=None, soil=None, kinematics=None, **sections):
    layers = [{"thickness": 8.0, "soil": "sand", "cells": 3}]
    mesh = {"column": {"width": 1.0, "layers": layers}}
    direction = "x"
    if kinematics:
        mesh, direction = {"box": {"size": [4.0, 8.0], "cells": [1, 2]}}, "z"
        mesh["kinematics"] = kinematics
    return Scene.from_dict(
        {
            "mesh": mesh,
            "soil": {"sand": soil or SAND},
            "motion": [{"direction": direction, "synthetic": {"n": 90, "dt": 0.02}, "pga": 0.1}],
            "lapses": {"count": 3, **(lapses or {})},
            "solver": {"sweep": "direct", **(solver or {})},
            **sections,
        }
    )


CASES = {
    "steady": scene({"continuity": "steady"}),
    "maxwell": scene(),
    "maxwell, cut": scene(solver={"max_frequency": 18.0}),
    "elastic": scene(soil={**SAND, "damping": 0.0}),
    "elastic, hysteretic": scene(
        soil={**SAND, "damping": 0.0}, solver={"complex_modulus": "hysteretic"}
    ),
    "hysteretic": scene(solver={"complex_modulus": "hysteretic"}),
    "hysteretic, cut": scene(solver={"complex_modulus": "hysteretic", "max_frequency": 18.0}),
    "one transient lapse": scene({"count": 1, "continuity": "transient"}),
    "antiplane": scene(kinematics="antiplane"),
    "loop": scene(
        soil={**SAND, "curves": CURVES},
        effects={"equivalent_linear": True},
        solver={"complex_modulus": "hysteretic"},
    ),
}


@pytest.mark.parametrize("given", CASES.values(), ids=CASES)
def test_what_is_foretold_is_what_a_run_does(given):
    domain = checked_domain(given, MPI.COMM_WORLD)
    equations = Equations(given, domain, Counter(), [])
    continuity = choose_continuity(given, domain, equations)
    scheme, told = scheme_of(given, domain.region_names), inspect(given)
    assert scheme.carried(domain.num_components) == continuity.fields
    points = seed_points(given, domain, continuity.fields)
    assert points.bytes_per_point == seed_points(given, domain, scheme.carried(
        domain.num_components)).bytes_per_point  # fmt: skip
    for segment, lines in zip(given.segments, told.lines, strict=True):
        excitation = continuity.excite(segment)
        assert len(excitation.lines) == lines
        if scheme.contour is not None:
            assert excitation.period == scheme.contour.period
            assert excitation.eta == scheme.contour.eta
    equations.destroy()


@pytest.mark.parametrize(
    ("case", "factorisations"),
    [
        # 30 samples a lapse, 91 lines on a contour six times as long, and one for the start
        ("maxwell", 3 * 92),
        # 181 lines of the record; in the second and third lapse of the free vibration as well, with
        # one for its start
        ("hysteretic", 5 * 181 + 2),
        ("hysteretic, cut", 5 * 130 + 2),
    ],
)
def test_factorisations_of_a_direct_sweep(case, factorisations):
    told, result = inspect(CASES[case]), simulate(CASES[case])
    assert told.factorisations == result.work.factorisations == factorisations
    assert sum(told.lines) == sum(lapse.solved_lines for lapse in result.lapses)


def test_softening_factorises_once_a_lapse():
    soft = {"degradation": {"threshold": 1e-6}, "gravity": True, "softening": True}
    given = scene(effects=soft, lapses={"count": 2})
    told, result = inspect(given), simulate(given)
    without = inspect(scene(effects={**soft, "softening": False}, lapses={"count": 2}))
    assert told.factorisations == without.factorisations + 2
    assert without.factorisations < result.work.factorisations <= told.factorisations


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (scene(), "at most 276"),
        (scene(solver={"sweep": "reduced"}), "about 63"),
        (
            scene(soil={**SAND, "cohesion": 50e3}, effects={"gravity": True, "sliding": True}),
            "about 276 of lines, and about ",
        ),
    ],
    ids=["direct", "reduced", "sliding"],
)
def test_factorisations_that_may_become_more_are_no_bound(given, words):
    """A reduced sweep takes those that it needs, and what slides may add lapses."""
    assert f"  factorisations  {words}" in describe(inspect(given))


@pytest.mark.parametrize(
    ("case", "continuity", "law"),
    [
        ("steady", "steady (named): each lapse is a period of its own", "hysteretic (the default)"),
        (
            "maxwell",
            "transient (the default for several lapses): all lines of a damped contour of 3.6 s, "
            "6 times the lapse",
            "maxwell (the default for several transient lapses), G at ",
        ),
        (
            "hysteretic",
            "transient (the default for several lapses): all lines of a damped contour of 7.2 s, "
            "4 times the whole record, for every lapse",
            "hysteretic (named)",
        ),
        ("one transient lapse", "transient (named): all lines", "hysteretic (the default)"),
    ],
)
def test_continuity_and_law_are_told_with_their_reason(case, continuity, law):
    told = inspect(CASES[case])
    assert told.continuity.startswith(continuity) and told.complex_modulus.startswith(law)
    assert f"  continuity      {told.continuity}\n" in describe(told)
    assert f"  complex modulus {told.complex_modulus}\n" in describe(told)
    beside = any("free vibration" in note for note in told.notes)
    assert beside == (case == "hysteretic")


def test_defaults_of_one_lapse_and_of_harmonics():
    assert "(the default for one lapse)" in inspect(scene({"count": 1})).continuity
    harmonic = {"amplitude": 1.0, "frequency": 2.0, "cycles": 4, "samples": 64}
    told = inspect(scene({"count": 2}, motion=[{"direction": "x", "harmonic": harmonic}]))
    assert "(the default for harmonic motions alone)" in told.continuity
    told = inspect(scene(solver={"complex_modulus": "maxwell", "reference_frequency": 2.5}))
    assert told.complex_modulus == "maxwell (named), G at 2.5 Hz, as named"


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ({"soil": {**SAND, "damping": 0.28}}, ["soil sand: damping is 0.28"]),
        # linear in ln(strain) from 0.1 at 1e-4 to 0.3 at 1e-2: 0.25 at 10^-2.5
        (
            {"soil": {**SAND, "curves": CURVES}, "effects": {"equivalent_linear": True}},
            ["soil sand: damping may reach 0.3, from strains of 0.32 % more than 0.25"],
        ),
        ({"effects": {"calm": {"sides": ["left"], "thickness": 0.4}}}, ["effects.calm:"]),
        ({"effects": {"degradation": True}}, ["degradation acts between lapses"]),
        ({"effects": {"convection": True}}, []),
        (
            {"effects": {"degradation": True, "gravity": True, "softening": True}},
            ["degradation acts between lapses", "softening is an estimate from reduced stiffness"],
        ),
        (
            {"effects": {"convection": True}, "lapses": {"continuity": "steady"}},
            ["under steady continuity the net movement"],
        ),
        (
            {"soil": {**SAND, "poisson": 0.4999999999}},
            ["soil sand: Poisson's ratio is 0.4999999999, at which cells lock"],
        ),
        (
            {"soil": {**SAND, "damping": 0.28}, "solver": {"complex_modulus": "hysteretic"}},
            ["hysteretic damping cannot be stopped"],
        ),
    ],
    ids=str,
)
def test_notes(case, words):
    notes = inspect(scene(**case)).notes
    assert len(notes) == len(words)
    assert all(note.startswith(word) for note, word in zip(notes, words, strict=True))


def test_a_motion_that_rests_is_no_matter():
    """Its band is nought; naively the length of its waves divides by that, in cut cells too."""
    wave = {"amplitude": 0.0, "frequency": 1.0, "cycles": 2, "samples": 32}
    box = {"size": [4.0, 8.0], "cells": [1, 2], "cell": "triangle"}
    regions = [{"soil": "sand", "below": 5.0}, {"soil": "air"}]
    resting = scene(
        {"count": 1},
        mesh={"box": box, "regions": regions, "empty": ["air"]},
        motion=[{"direction": "x", "harmonic": wave}],
        effects={"convection": True},
    )
    notes = inspect(resting).notes
    assert notes[0].startswith("no line is excited")
    assert not any("shear wave" in note for note in notes)


@pytest.mark.parametrize("case", ["maxwell", "antiplane"])
def test_points_of_transient_lapses_are_written_for_paraview(tmp_path, case):
    taken = []
    simulate(CASES[case], snapshot=taken.append)
    assert "memory_strain" not in taken[-1].points
    write_snapshot(tmp_path, taken[-1])
    read = meshio.read(tmp_path / "points_0002.vtu").point_data
    for name in ("velocity", "displacement", "strain", "stress"):
        given = taken[-1].points[f"dynamic_{name}"]
        written = read[f"dynamic_{name}"].reshape(len(given), -1)
        np.testing.assert_array_equal(written[:, : given.shape[1]], given)
        assert given.any() and not written[:, given.shape[1] :].any()
