# SPDX-License-Identifier: MIT
"""Vertical waves through level layers, against other closed forms, limits and meshes."""

import numpy as np
import pytest
from support.reference import two_layer_transfer

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate
from fenics_hytf.soil import complex_factor
from fenics_hytf.study.closed_form import NoClosedForm, Stratum, closed_form, layered_transfer
from fenics_hytf.study.measures import Yardstick

SOIL = {
    "soft": {"density": 1800.0, "shear_wave_velocity": 180.0, "poisson": 0.3, "damping": 0.05},
    "firm": {"density": 1950.0, "shear_wave_velocity": 320.0, "poisson": 0.35, "damping": 0.03},
}
ROCK = {"density": 2300.0, "shear_wave_velocity": 800.0, "poisson": 0.25, "damping": 0.02}
TIED = {"left": "tied", "right": "tied"}
LAYERS = (
    Stratum(8.0, 1800.0, 1800 * 180**2 * (1 + 0.1j)),
    Stratum(14.0, 1950.0, 1950 * 320**2 * (1 + 0.06j)),
)


def pulse(direction: str, kind: str = "within") -> dict:
    record = {"n": 256, "dt": 0.02}
    return {"direction": direction, "synthetic": record, "input": kind}


def column(motions: list, cells: tuple[int, int] = (8, 14), **sections) -> Scene:
    layers = [
        {"thickness": 8.0, "soil": "soft", "cells": cells[0]},
        {"thickness": 14.0, "soil": "firm", "cells": cells[1]},
    ]
    data = {
        "mesh": {"column": {"width": 1.0, "layers": layers}, "degree": 2},
        "soil": SOIL,
        "motion": motions,
        "boundary": TIED,
        "output": {"receivers": {"top": [0.5, 22.0], "seam": [0.2, 14.0], "deep": [0.5, 5.0]}},
    }
    return Scene.from_dict(data | sections)


def test_two_layers_on_a_rigid_base(figure):
    omega = 2 * np.pi * np.linspace(0, 25, 400)
    modulus = tuple(layer.modulus for layer in LAYERS)
    expected = two_layer_transfer(omega, (8.0, 14.0), (1800.0, 1950.0), modulus)
    found = layered_transfer(list(LAYERS), None, omega, np.array([0.0, 22.0]))
    error = np.max(abs(found[0] - expected) / abs(expected))
    figure("layered transfer against two layers' own closed form", error, 1e-11)
    np.testing.assert_allclose(found[1], 1.0, rtol=1e-12)  # the base moves as it is told to


def test_layers_of_one_soil_are_one_layer():
    omega, depths = 2 * np.pi * np.linspace(0, 40, 100), np.array([0.0, 3.0, 7.5, 9.0, 22.0])
    soil, rock = LAYERS[0], Stratum(0.0, 2300.0, 2300 * 800**2 * (1 + 0.04j))
    whole = [Stratum(22.0, soil.density, soil.modulus)]
    cut = [Stratum(h, soil.density, soil.modulus) for h in (3.0, 4.5, 1.5, 13.0)]
    for base in (None, rock):
        one = layered_transfer(whole, base, omega, depths)
        np.testing.assert_allclose(layered_transfer(cut, base, omega, depths), one, rtol=1e-11)


def test_rock_like_the_soil_sends_nothing_back():
    """The top of a half-space moves as the bare rock does, less what is damped on the way."""
    omega = 2 * np.pi * np.linspace(0, 25, 50)
    soil = Stratum(22.0, 1800.0, 1800 * 180**2 * (1 + 0.1j))
    found = layered_transfer([soil], soil, omega, np.array([0.0]))
    np.testing.assert_allclose(found[0], np.exp(-1j * omega * 22.0 / soil.velocity), rtol=1e-12)


def test_nothing_overflows_however_deep_and_fast():
    omega = 2 * np.pi * np.geomspace(1, 1e6, 50)
    deep = [Stratum(2000.0, 1800.0, 1800 * 100**2 * (1 + 0.5j)), LAYERS[1]]
    found = layered_transfer(deep, None, omega, np.array([0.0, 1000.0, 2000.0, 2014.0]))
    assert np.isfinite(found).all() and abs(found[0, -1]) < 1e-100
    np.testing.assert_allclose(found[3], 1.0)


@pytest.mark.parametrize("kind", ["within", "outcrop"])
@pytest.mark.parametrize("convention", ["hysteretic", "kramer", "shake91", "dormieux"])
@pytest.mark.parametrize("keep", ["poisson", "bulk"])
def test_meshes_converge_to_it(kind, convention, keep, figure):
    """x and y at once: S waves and P waves, on a mesh and on one twice as fine."""
    boundary = TIED | ({"base": {"compliant": ROCK}} if kind == "outcrop" else {})
    motions = [pulse("x", kind), pulse("y", kind)]
    sections = {"boundary": boundary, "solver": {"complex_modulus": convention, "keep": keep}}
    scene = column(motions, **sections)
    yardstick = Yardstick(closed_form(scene), scene.dt, list(scene.output.receivers))
    errors = [
        yardstick.error(
            simulate(column(motions, cells, **sections)).history("total_acceleration")
        ).relative_l2
        for cells in ((4, 7), (8, 14))
    ]
    # degree 2 in one dimension: the motion at the nodes is of the fourth order
    name = f"column against vertical waves, {kind}, {convention}, {keep} kept"
    figure(f"{name}: error falls by", errors[0] / errors[1], 12.0, "times", at_least=True)


def test_a_box_of_level_regions_is_its_column():
    box = {
        "box": {"size": [3.0, 22.0], "cells": [3, 11]},
        "regions": [{"soil": "firm", "below": 14.0}, {"soil": "soft"}],
    }
    one, other = column([pulse("x")]), column([pulse("x")], mesh=box)
    np.testing.assert_allclose(closed_form(other), closed_form(one), rtol=1e-12)


def test_damping_of_curves_where_a_soil_has_no_own():
    curves = {"strain": [1e-6, 1e-2], "modulus": [1.0, 0.1], "damping": [0.05, 0.2]}
    soft = {k: v for k, v in SOIL["soft"].items() if k != "damping"} | {"curves": curves}
    one, other = column([pulse("x")]), column([pulse("x")], soil=SOIL | {"soft": soft})
    np.testing.assert_allclose(closed_form(other), closed_form(one), rtol=1e-12)
    assert complex_factor(0.05) == 1 + 0.1j


@pytest.mark.parametrize(
    "sections, why",
    [
        ({"boundary": {"left": "free"}}, "side 'left' is free"),
        ({"boundary": TIED | {"top": "roller"}}, "top is roller"),
        ({"boundary": {"left": "roller", "right": "roller"}}, "side 'left' is roller"),
        ({"effects": {"rayleigh": {"alpha": 0.1}}}, "rayleigh"),
        ({"lapses": {"continuity": "transient"}}, "transient, not periodic"),
        ({"solver": {"complex_modulus": "maxwell"}}, "maxwell"),
    ],
)
def test_what_it_does_not_describe(sections, why):
    with pytest.raises(NoClosedForm, match=why):
        closed_form(column([pulse("x")], **sections))


def test_rollers_hold_nothing_under_vertical_waves():
    sides = {"left": "roller", "right": "roller"}
    one, other = column([pulse("y")]), column([pulse("y")], boundary=sides)
    np.testing.assert_array_equal(closed_form(other), closed_form(one))


def test_polygons_are_no_level_layers():
    region = {"soil": "soft", "polygon": [[0, 0], [3, 0], [3, 22]]}
    mesh = {
        "box": {"size": [3.0, 22.0], "cells": [3, 11]},
        "regions": [region, {"soil": "firm"}],
    }
    with pytest.raises(NoClosedForm, match="polygons"):
        closed_form(column([pulse("x")], mesh=mesh))
