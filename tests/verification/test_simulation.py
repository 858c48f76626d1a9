# SPDX-License-Identifier: MIT
"""How a simulation stops, and what it says; scenes at the edge of what can be computed."""

import numpy as np
import pytest
from mpi4py import MPI

from fenics_hytf.particles import PointsOutside
from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import SimulationError, simulate
from fenics_hytf.simulation import run as steps


def scene(**changes):
    soil = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3, "damping": 0.05}
    layer = {"thickness": 4.0, "soil": "sand", "cells": 2}
    base = {
        "mesh": {"column": {"width": 1.0, "layers": [layer]}},
        "soil": {"sand": soil},
        "motion": [{"direction": "x", "synthetic": {"n": 256}, "pga": 0.1}],
        "boundary": {"left": "tied", "right": "tied"},
        "lapses": {"count": 4, "continuity": "steady"},
        "solver": {"max_frequency": 5.0},
        "output": {"receivers": {"top": [0.5, 4.0], "rider": {"point": [0.5, 3.0]}}},
    }
    return Scene.from_dict(base | changes)


@pytest.mark.mpi
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"lapses": {"count": 4}, "solver": {}},
        {"lapses": {"count": 4}, "solver": {"complex_modulus": "hysteretic"}},
    ],
    ids=["steady", "handed over", "whole record"],
)
def test_fewer_cells_than_ranks(changes):
    # Two cells on three ranks: one rank holds nothing, and takes part all the same.
    parallel = simulate(scene(**changes))
    serial = simulate(scene(**changes), MPI.COMM_SELF)
    for name in ("displacement", "total_acceleration"):
        expected = serial.history(name)
        difference = np.abs(parallel.history(name) - expected).max()
        assert difference <= 1e-10 * np.abs(expected).max()


def test_an_error_names_its_lapse_and_keeps_the_lapses_before(monkeypatch):
    calls = []
    original = steps.convect

    def fail_in_the_third(*arguments, **others):
        calls.append(arguments)
        if len(calls) == 3:
            raise PointsOutside("point 7 left")
        return original(*arguments, **others)

    monkeypatch.setattr(steps, "convect", fail_in_the_third)
    with pytest.raises(SimulationError, match="lapse 2: point 7 left") as caught:
        simulate(scene(effects={"convection": True}))
    assert caught.value.lapse == 2
    assert [lapse.index for lapse in caught.value.partial.lapses] == [0, 1, 2]


def test_an_undamped_resonance_is_named():
    # Vs / 4H of the mesh itself: find the first peak, then excite it exactly.
    soil = {"sand": {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3}}
    column = {"width": 1.0, "layers": [{"thickness": 4.0, "soil": "sand", "cells": 1}]}
    # One linear cell, tied: m = ρH/3, k = G/H, so ω² = 3 Vs²/H².
    resonance = np.sqrt(3.0) * 200.0 / 4.0 / (2 * np.pi)
    harmonic = {"amplitude": 1.0, "frequency": resonance, "cycles": 4, "samples": 64}
    with pytest.raises(SimulationError, match=r"lapse 0: at 13\.78"):
        simulate(
            scene(
                soil=soil,
                mesh={"column": column},
                motion=[{"direction": "x", "harmonic": harmonic}],
                lapses={"count": 1},
                solver={},
            )
        )


def test_a_rider_whose_point_has_left_is_not_a_number(monkeypatch):
    original = steps.convect

    def carry_off(domain, points, increment, **others):
        increment = increment.copy()
        increment[:, 1] += 1.5  # what lies in the upper 1.5 m leaves through the top
        return original(domain, points, increment, **others)

    monkeypatch.setattr(steps, "convect", carry_off)
    place = {"receivers": {"rider": {"point": [0.5, 3.5]}}}
    settings = {"effects": {"convection": True}, "points": {"outside": "park"}, "output": place}
    with pytest.raises(SimulationError, match="without material points") as caught:
        simulate(scene(**settings))
    assert np.isfinite(caught.value.partial.lapses[0].displacement).all()


def test_nothing_that_moves_with_the_base():
    with pytest.raises(SceneError, match="boundary"):
        simulate(scene(boundary={"base": "roller", "left": "tied", "right": "tied"}))


def test_a_failing_progress_callback_does_not_stop_the_run():
    def broken(_):
        raise OSError("closed")

    assert len(simulate(scene(), progress=broken).lapses) == 4
