# SPDX-License-Identifier: MIT
"""Whole scenes with the reduced sweep against the same scenes with the direct one."""

import numpy as np
import pytest
from support.meshes import SOIL

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate

pytestmark = pytest.mark.mpi

TOLERANCE = 1e-6
ROCK = {"density": 2300.0, "shear_wave_velocity": 700.0, "poisson": 0.25, "damping": 0.01}
CURVES = {"model": "darendeli", "plasticity_index": 15, "mean_stress": 60e3}
DAMPED = SOIL | {"damping": 0.04}


def scene(mesh: dict, directions: str, sides: str, rock: bool = False, **sections) -> Scene:
    record = {"synthetic": {"n": 300, "dt": 0.02, "t1": 1.0, "t2": 2.5}, "pga": 0.15}
    kind = {"input": "outcrop" if rock else "within"}
    base = {"base": {"compliant": ROCK}} if rock else {}
    return Scene.from_dict(
        {
            "mesh": mesh,
            "soil": {"clay": DAMPED, "soft": DAMPED | {"shear_wave_velocity": 120.0}},
            "motion": [record | kind | {"direction": d} for d in directions],
            "boundary": {"left": sides, "right": sides} | base,
            "output": {"receivers": {"top": mesh["top"], "mid": mesh["mid"]}},
        }
        | {"mesh": {k: v for k, v in mesh.items() if k not in ("top", "mid")}}
        | sections
    )


def column(cells: int) -> dict:
    layers = [
        {"thickness": 8.0, "soil": "soft", "cells": cells},
        {"thickness": 16.0, "soil": "clay", "cells": cells},
    ]
    mesh = {"column": {"width": 1.0, "layers": layers}, "degree": 2}
    return mesh | {"top": [0.5, 24.0], "mid": [0.5, 12.0]}


def section(**more) -> dict:
    regions = [
        {"soil": "soft", "polygon": [[6, 4], [14, 4], [14, 10], [6, 10]]},
        {"soil": "clay"},
    ]
    mesh = {"box": {"size": [20.0, 10.0], "cells": [20, 10]}, "regions": regions}
    return mesh | {"top": [9.0, 10.0], "mid": [3.0, 6.0]} | more


CASES = {
    "column on rock": scene(column(12), "xy", "tied", rock=True),
    "section, dashpots": scene(section(), "xy", "dashpot"),
    "section on rock, free field": scene(section(), "xy", "free_field", rock=True),
    "antiplane on rock, free field": scene(
        section(kinematics="antiplane"), "z", "free_field", rock=True
    ),
    "section, Rayleigh damping": scene(
        section(), "x", "tied", effects={"rayleigh": {"alpha": 0.3, "beta": 2e-3}}
    ),
}


def both(case: Scene) -> tuple:
    data = [case.data | {"solver": {"sweep": sweep}} for sweep in ("reduced", "direct")]
    return tuple(simulate(Scene.from_dict(d)) for d in data)


@pytest.mark.parametrize("name", CASES)
def test_histories_and_peaks(name, figure):
    reduced, direct = both(CASES[name])
    assert reduced.work.factorisations < direct.work.factorisations / 4
    assert reduced.lapses[0].worst_residual <= TOLERANCE
    for history in ("total_acceleration", "displacement"):
        found, expected = reduced.history(history), direct.history(history)
        error = abs(found - expected).max() / abs(expected).max()
        figure(f"reduced sweep, {name}: {history}", error, 10 * TOLERANCE)
    found, expected = reduced.lapses[0].cells.peak_strain, direct.lapses[0].cells.peak_strain
    error = abs(found - expected).max() / expected.max()
    figure(f"reduced sweep, {name}: peak strain", error, 10 * TOLERANCE)


@pytest.mark.parametrize("sides", ["tied", "free_field"])
def test_in_the_equivalent_linear_loop(sides, figure):
    """Early iterations are loose, the last is not; expansions are kept from one to the next."""
    soil = {
        "clay": DAMPED | {"curves": CURVES},
        "soft": DAMPED | {"shear_wave_velocity": 120.0, "curves": CURVES},
    }
    case = scene(
        section(), "x", sides, True, soil=soil, effects={"equivalent_linear": {"tolerance": 1e-4}}
    )
    reduced, direct = both(case)
    iterations = len(direct.lapses[0].loop.change)
    assert len(reduced.lapses[0].loop.change) <= iterations + 1
    assert reduced.lapses[0].worst_residual <= TOLERANCE
    assert reduced.work.factorisations < direct.work.factorisations / 4
    found, expected = (r.lapses[0].cells.g_over_gmax for r in (reduced, direct))
    # Both loops stop within the loop's tolerance of the fixed point.
    figure(f"reduced sweep in the loop, {sides}: G/Gmax", np.abs(found - expected).max(), 2e-4)
    found, expected = (r.history("total_acceleration") for r in (reduced, direct))
    error = abs(found - expected).max() / abs(expected).max()
    figure(f"reduced sweep in the loop, {sides}: acceleration", error, 2e-4)
