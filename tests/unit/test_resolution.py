# SPDX-License-Identifier: MIT
"""Cells too large for the waves of the motion are told, by check and in the summary."""

import numpy as np
import pytest
from support.meshes import scene

from fenics_hytf.results.summary import warnings
from fenics_hytf.simulation import inspect, simulate

SAND = {"density": 1900.0, "shear_wave_velocity": 100.0, "poisson": 0.3, "damping": 0.05}
TIED = {"left": "tied", "right": "tied"}
MOTION = {
    "direction": "x",
    "harmonic": {"amplitude": 1.0, "frequency": 10.0, "cycles": 4, "samples": 128},
}
TOLD = "nodes in a shear wave's length"


def column(cells: int, frequency: float, width: float = 1.0, degree: int = 1, **sections):
    layers = [{"thickness": 20.0, "soil": "sand", "cells": cells}]
    return scene(
        {"column": {"width": width, "layers": layers}, "degree": degree},
        soil={"sand": SAND},
        motion=[MOTION | {"harmonic": MOTION["harmonic"] | {"frequency": frequency}}],
        boundary=TIED,
        **sections,
    )


def notes(case) -> list[str]:
    return [note for note in inspect(case).notes if TOLD in note]


@pytest.mark.parametrize(
    ("cells", "degree", "frequency", "nodes"),
    [(4, 1, 10.0, 2.0), (15, 1, 10.0, 7.5), (5, 2, 10.0, 5.0)],
)
def test_a_column_too_coarse_for_its_motion_is_told(cells, degree, frequency, nodes):
    """λ = 100 m/s over 10 Hz; nodes of vertical edges in it, whatever the width."""
    case = column(cells, frequency, width=50.0, degree=degree)
    (note,) = notes(case)
    assert f"soil sand: found {nodes:.2g} {TOLD} at 10 Hz, the band of the motion" in note
    assert ("degree = 2" in note) == (degree == 1)
    assert f"cells {(8 if degree == 1 else 6) / nodes:.3g} times as small" in note


@pytest.mark.parametrize(("cells", "degree"), [(17, 1), (7, 2)])
def test_a_fine_one_is_not(cells, degree):
    assert notes(column(cells, 10.0, degree=degree)) == []


def test_what_is_not_solved_does_not_count():
    case = column(4, 10.0, solver={"max_frequency": 2.0})
    assert notes(case) == []
    (note,) = notes(column(4, 10.0, solver={"max_frequency": 5.0}))
    assert "at 5 Hz, solver.max_frequency" in note


def test_a_section_counts_its_longest_extent():
    mesh = {"box": {"size": [40.0, 20.0], "cells": [4, 20]}}
    case = scene(mesh, soil={"sand": SAND}, motion=[MOTION])
    (note,) = notes(case)
    assert f"found 1 {TOLD} at 10 Hz" in note


def test_soil_that_softens_is_told_with_its_softened_waves():
    """Fine at first; the secant modulus of the run is not."""
    curve = {"strain": [1e-6, 1e-4, 1e-2], "modulus": [1.0, 0.5, 0.04], "damping": [0.01, 0.1, 0.2]}
    case = scene(
        {"column": {"width": 1.0, "layers": [{"thickness": 20.0, "soil": "sand", "cells": 20}]}},
        soil={"sand": SAND | {"curves": curve}},
        motion=[MOTION | {"harmonic": MOTION["harmonic"] | {"frequency": 5.0, "amplitude": 8.0}}],
        boundary=TIED,
        effects={"equivalent_linear": True},
    )
    assert notes(case) == []
    result = simulate(case)
    least = np.sqrt(result.lapses[0].cells.shear_modulus.min() / SAND["density"]) / 5.0
    assert least < 8
    (said,) = [text for text in warnings(result) if TOLD in text]
    assert f"found {least:.2g} {TOLD}" in said
