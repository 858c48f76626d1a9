# SPDX-License-Identifier: MIT
"""What ``hytf check`` says of scenes that lie near the edge of the stability maps."""

from __future__ import annotations

import pytest
from mpi4py import MPI

from fenics_hytf.cli.check import describe
from fenics_hytf.scene import PERIODS, Scene
from fenics_hytf.simulation import inspect, margins

SAND = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3, "damping": 0.05}
SOFT = {"strain": [1e-6, 1e-4, 1e-2], "modulus": [1.0, 0.5, 0.01], "damping": [0.01, 0.1, 0.2]}
DT = 0.01


def scene(soil: dict | None = None, pga: float = 0.1, **sections) -> Scene:
    """A box of sand, and of the soils that are given, one above the other."""
    soils = {"sand": SAND} | (soil or {})
    regions = [{"soil": name, "below": 10.0 - 5.0 * i} for i, name in enumerate(reversed(soils))]
    box = {"box": {"size": [4.0, 10.0], "cells": [4, 10]}}
    usual = {
        "mesh": box | ({"regions": regions[::-1]} if len(soils) > 1 else {}),
        "soil": soils,
        "motion": [{"direction": "x", "synthetic": {"n": 800, "dt": DT, "f2": 6.0}, "pga": pga}],
        "lapses": {"count": 4},
    }
    return Scene.from_dict(usual | sections)


def edges(case: Scene) -> list[str]:
    """The notes that name a stability map."""
    return [note for note in inspect(case, MPI.COMM_SELF).notes if "stability map" in note]


def test_a_usual_scene_is_not_warned_of():
    assert edges(scene()) == []


def test_short_lapses_are_near_the_edge():
    """Lapses of 25 samples hold 12.5 periods of Nyquist's frequency, where 10 are refused."""
    case = scene(lapses={"duration": 0.25})
    (note,) = edges(case)
    assert "demos/stability_lapses.png" in note and "12.5 periods" in note
    assert "0.28 s or more" in note  # 14 periods of 50 Hz
    assert f"note            {note}" in describe(inspect(case, MPI.COMM_SELF))
    assert edges(scene(lapses={"duration": 0.4})) == []


def test_lapses_are_measured_by_the_lines_that_are_solved():
    """Lapses of 0.8 s hold 40 periods of 50 Hz, and 12 of 15 Hz."""
    notes = edges(scene(lapses={"duration": 0.8}, solver={"max_frequency": 15.0}))
    assert any("12 periods of the highest line, 15 Hz" in note for note in notes)
    assert edges(scene(lapses={"duration": 0.8})) == []


def test_a_cut_not_far_above_the_band_is_near_the_edge():
    (note,) = edges(scene(solver={"max_frequency": 13.0}))
    assert "demos/stability_max_frequency.png" in note and "13 Hz" in note
    wanted = float(note.split("take ")[1].split(" Hz")[0])
    assert edges(scene(solver={"max_frequency": 1.01 * wanted})) == []


@pytest.mark.parametrize("lapses", [{"count": 1}, {"count": 4, "continuity": "steady"}])
def test_what_hands_nothing_over_has_no_such_edge(lapses):
    assert edges(scene(lapses=lapses, solver={"max_frequency": 7.0})) == []


def test_soil_that_may_soften_and_stiffen_from_lapse_to_lapse_is_near_the_edge():
    soil = {"sand": SAND | {"curves": SOFT}}
    loop = {"effects": {"equivalent_linear": True}}
    (note,) = edges(scene(soil, pga=2.0, **loop))
    assert "demos/stability_lapses.png" in note and "soil sand" in note
    assert edges(scene(soil, pga=0.02, **loop)) == []  # hardly strained
    assert edges(scene(soil, pga=2.0)) == []  # linear
    assert edges(scene(soil, pga=2.0, lapses={"count": 1}, **loop)) == []


@pytest.mark.parametrize(("contrast", "tolerance", "count"), [(1e4, 1e-6, 0), (1e6, 1e-6, 1)])
def test_stiff_ground_beside_soft_is_near_the_edge(contrast, tolerance, count):
    rock = SAND | {"shear_wave_velocity": 200.0 * contrast**0.5}
    notes = edges(scene({"rock": rock}, solver={"tolerance": tolerance}))
    assert len(notes) == count
    for note in notes:
        assert "demos/stability_contrast.png" in note
        assert "rock is 1e+06 times that of sand" in note


def test_the_edge_of_contrast_goes_with_the_tolerance():
    rock = SAND | {"shear_wave_velocity": 200.0 * 1e3}
    assert edges(scene({"rock": rock}, solver={"tolerance": 1e-4})) == []


def empty(size: float) -> Scene:
    """A block of sand with air above, in cells of a size [m]."""
    return scene(
        mesh={
            "box": {"size": [4 * size, 6 * size], "cells": [4, 6]},
            "regions": [{"soil": "sand", "below": 4 * size}, {"soil": "air"}],
            "empty": ["air"],
        },
        lapses={"count": 1},
        effects={"convection": True},
    )


def test_large_cells_that_points_may_leave_are_near_the_edge():
    """6 Hz has waves of 33 m: 17 cells of 2 m, and 33 of 1 m."""
    (note,) = edges(empty(2.0))
    assert "demos/stability_cut_cells.png" in note and "cells in a shear wave's length" in note
    assert edges(empty(1.0)) == []


def test_the_warning_begins_inside_of_what_is_allowed():
    assert margins.NEAR_PERIODS > PERIODS
    near = margins.near_contrast
    assert near(1e-6, True, "reduced") < near(1e-6, False, "reduced")


@pytest.mark.parametrize(("sweep", "count"), [("reduced", 1), ("direct", 0)])
def test_direct_sweeps_of_transient_lapses_are_warned_of_no_earlier_than_steady_ones(sweep, count):
    """A million: a direct sweep reaches what it is asked for, the tolerance itself, to ten."""
    rock = SAND | {"shear_wave_velocity": 200.0 * 1e3}
    assert len(edges(scene({"rock": rock}, solver={"sweep": sweep}))) == count
