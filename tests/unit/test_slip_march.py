# SPDX-License-Identifier: MIT
"""A march of slip that fails ends a run as any numerics do, and names the lapse."""

import pytest
from support.sliding import slope

from fenics_hytf.lapse import slip
from fenics_hytf.motion import SlipError
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import SimulationError, simulate


@pytest.mark.parametrize("error", [SlipError, ValueError])
def test_a_march_that_fails_is_told(error, monkeypatch):
    def march(*arguments):
        raise error("weights: found no number")

    monkeypatch.setattr(slip, "march", march)
    with pytest.raises(SimulationError, match=r"march of the slip: weights: found.*time_step"):
        simulate(Scene.from_dict(slope()))
