# SPDX-License-Identifier: MIT
"""Receivers in regions that no soil fills: refused, or told, as points may get there or not."""

import numpy as np
import pytest
from mpi4py import MPI

from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import inspect, simulate

SAND = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3, "damping": 0.05}
PLACES = {
    "ground": [2.5, 1.5],
    "surface": [2.5, 4.0],
    "rounded": [2.5, 4.0004],
    "rides": {"point": [2.5, 7.0]},
    "between": [2.5, 4.5],
    "air": [2.5, 6.5],
}
NO_SOIL = ["between", "air"]


def block(convection: bool, cell: str = "quadrilateral") -> Scene:
    """Ground of 4 m with 4 m of air above."""
    sine = {"amplitude": 0.1, "frequency": 2.0, "cycles": 1, "samples": 32}
    return Scene.from_dict(
        {
            "mesh": {
                "box": {"size": [5.0, 8.0], "cells": [5, 8], "cell": cell},
                "regions": [{"soil": "sand", "below": 4.0}, {"soil": "air"}],
                "empty": ["air"],
            },
            "soil": {"sand": SAND},
            "motion": [{"direction": "x", "harmonic": sine}],
            "effects": {"convection": convection},
            "output": {"receivers": PLACES},
        }
    )


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_without_convection_they_are_refused(cell):
    """But for those on the surface, which stand in the ground as much as above it."""
    with pytest.raises(SceneError) as error:
        inspect(block(convection=False, cell=cell), MPI.COMM_WORLD)
    expected = "a place in the ground: no point moves there without effects.convection"
    assert [str(fault) for fault in error.value.faults] == [
        f"output.receivers.{name}: found {PLACES[name]} in a region of mesh.empty; "
        f"expected {expected}"
        for name in NO_SOIL
    ]


def test_with_convection_it_is_told_what_is_written_of_them():
    scene = block(convection=True)
    notes = [note for note in inspect(scene).notes if note.startswith("receiver ")]
    assert [note.split(":")[0] for note in notes] == [f"receiver {name}" for name in NO_SOIL]
    assert all("its motion is that of the base" in note for note in notes)

    result = simulate(scene)
    moved = {
        name: history[0]
        for name, history in zip(result.receivers, result.history("displacement"), strict=True)
    }
    assert not moved["air"].any()
    # a bilinear field, halfway between the surface and nodes that no soil moves
    np.testing.assert_allclose(moved["between"], 0.5 * moved["surface"], rtol=1e-12)
