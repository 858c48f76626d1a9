# SPDX-License-Identifier: MIT
"""Vertical stress of level ground against sums by hand."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_hytf.results.overburden import vertical_stress
from fenics_hytf.scene import Scene, SceneError

G0, WATER = 9.80665, 9806.65
SAND, CLAY, FILL = 1900.0, 1700.0, 1600.0


def scene(mesh, water_table=None, folder="."):
    soil = {"shear_wave_velocity": 200.0, "poisson": 0.3, "damping": 0.02}
    densities = {"sand": SAND, "clay": CLAY, "fill": FILL}
    named = [r["soil"] for r in mesh.get("regions", [])] or ["sand"]
    if "column" in mesh:
        named = [layer["soil"] for layer in mesh["column"]["layers"]]
    data = {
        "mesh": mesh,
        "soil": {name: {**soil, "density": densities[name]} for name in dict.fromkeys(named)},
        "motion": [{"direction": "x", "synthetic": {"n": 20, "dt": 0.05}}],
        "output": {} if water_table is None else {"water_table": water_table},
    }
    return Scene.from_dict(data, folder)


COLUMN = {
    "column": {
        "width": 1.0,
        "layers": [
            {"thickness": 2.0, "soil": "fill", "cells": 2},
            {"thickness": 3.0, "soil": "clay", "cells": 1},
            {"thickness": 5.0, "soil": "sand", "cells": 5},
        ],
    }
}


def at(*heights):
    return np.array([[0.5, height] for height in heights])


def test_a_column_of_three_layers():
    # surface at 10 m; centre of the fill's first cell, clay's centre, 1 m above the base
    stress = vertical_stress(scene(COLUMN), at(9.5, 6.5, 1.0, 10.0, 0.0))
    expected = [
        0.5 * FILL,
        2 * FILL + 1.5 * CLAY,
        2 * FILL + 3 * CLAY + 4 * SAND,
        0.0,
        2 * FILL + 3 * CLAY + 5 * SAND,
    ]
    np.testing.assert_allclose(stress, G0 * np.array(expected), rtol=1e-14, atol=1e-9)


@pytest.mark.parametrize(
    ("table", "heads"),
    [
        (8.0, [0.0, 1.5, 7.0]),  # 2 m below the surface
        (10.0, [0.5, 3.5, 9.0]),
        (15.0, [0.5, 3.5, 9.0]),  # water above the surface presses from both sides
        (-3.0, [0.0, 0.0, 0.0]),
    ],
)
def test_effective_below_a_water_table(table, heads):
    places = at(9.5, 6.5, 1.0)
    total = vertical_stress(scene(COLUMN), places)
    effective = vertical_stress(scene(COLUMN, table), places)
    # differences of numbers up to 2e5
    np.testing.assert_allclose(total - effective, WATER * np.array(heads), atol=1e-9)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle", "hexahedron", "tetrahedron"])
def test_a_box_of_one_soil(cell):
    gdim = 3 if cell in ("hexahedron", "tetrahedron") else 2
    box = {"size": [8.0, 6.0, 12.0][-gdim:], "cells": [4, 3, 6][-gdim:], "cell": cell}
    x = np.random.default_rng(3).uniform(size=(50, gdim)) * box["size"]
    expected = G0 * SAND * (12.0 - x[:, -1])
    np.testing.assert_allclose(vertical_stress(scene({"box": box}), x), expected, rtol=1e-13)


def test_regions_below_a_height_first_match_wins():
    regions = [
        {"soil": "sand", "below": 4.0},
        {"soil": "clay", "below": 9.0},
        {"soil": "clay", "below": 2.0},  # never reached
        {"soil": "fill"},
    ]
    mesh = {"box": {"size": [5.0, 12.0], "cells": [5, 12]}, "regions": regions}
    stress = vertical_stress(scene(mesh), at(10.0, 5.0, 1.0))
    expected = [2 * FILL, 3 * FILL + 4 * CLAY, 3 * FILL + 5 * CLAY + 3 * SAND]
    np.testing.assert_allclose(stress, G0 * np.array(expected), rtol=1e-14)


def test_a_lens_drawn_as_a_polygon():
    # a triangle of clay in sand: (2, 4), (8, 4), (5, 7); the surface at 10
    lens = {"soil": "clay", "polygon": [[2.0, 4.0], [8.0, 4.0], [5.0, 7.0]]}
    mesh = {
        "box": {"size": [10.0, 10.0], "cells": [10, 10], "cell": "triangle"},
        "regions": [lens, {"soil": "sand"}],
    }
    x = np.array([[1.0, 2.0], [4.0, 2.0], [4.0, 5.0], [5.0, 5.0], [7.0, 9.5]])
    # at x = 4 the lens reaches from 4 to 6, at x = 5 to 7, at x = 7 to 5
    expected = [
        8.0 * SAND,
        6.0 * SAND + 2.0 * CLAY,
        4.0 * SAND + 1.0 * CLAY,
        3.0 * SAND + 2.0 * CLAY,
        0.5 * SAND,
    ]
    np.testing.assert_allclose(vertical_stress(scene(mesh), x), G0 * np.array(expected), rtol=1e-13)


def test_a_mesh_from_a_file_has_none(tmp_path):
    (tmp_path / "slope.msh").write_text("")  # read when it is run, not before
    stress = vertical_stress(scene({"file": "slope.msh"}, 3.0, tmp_path), at(1.0, 2.0))
    assert np.isnan(stress).all() and stress.shape == (2,)


@pytest.mark.parametrize("table", ["deep", float("nan"), True])
def test_a_water_table_is_an_elevation(table):
    with pytest.raises(SceneError, match=r"output\.water_table.*expected an elevation \[m\]"):
        scene(COLUMN, table)
