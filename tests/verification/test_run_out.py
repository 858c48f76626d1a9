# SPDX-License-Identifier: MIT
"""A slope that fails at rest and runs out past three cells: to rest, and alike on any ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from support.sliding import slope

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import Result, simulate

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF


def run_out(comm: MPI.Comm, group_size: int | None = None) -> Result:
    """The small slope with half the strength that it needs, in lapses of up to a cell's slip."""
    sliding = {
        "unstable_at_rest": True,
        "new_mechanism": 1.0,
        "time_step": 0.02,
        "longest": 10.0,
    }
    data = slope(8e3, convection=True, sliding=sliding)
    data["motion"][0]["harmonic"] |= {"cycles": 1, "samples": 50}
    # Few lines, each solved for itself: what is reduced begins from random numbers.
    data["solver"] |= {"sweep": "direct", "max_frequency": 20.0}
    return simulate(Scene.from_dict(data), comm, group_size=group_size)


def told(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """How far it has slipped by the end of each lapse, and how receivers have moved [m]."""
    slip = np.cumsum([lapse.slip.slip[-1] for lapse in result.lapses])
    return slip, result.history("displacement")


def test_it_comes_to_rest():
    result = run_out(SELF)
    first, last = result.lapses[0].slip, result.lapses[-1].slip
    assert first.factor_of_safety < 0.8 and first.yield_coefficient < -0.1
    assert last.rate[-1] == 0 and last.yield_coefficient > 0.04
    assert told(result)[0][-1] > 3.0  # cells of 1 m
    ledger = result.lapses[-1].ledger
    assert (ledger.imbalance, ledger.parked, ledger.deleted) == (0.0, 0, 0)


@pytest.mark.mpi
@pytest.mark.skipif(WORLD.size == 1, reason="compares several ranks with one")
@pytest.mark.parametrize("shared", [False, True])
def test_on_ranks(shared, figure):
    """With a mesh each, as by default, or one among all: eight mechanisms one after the other."""
    alone = WORLD.bcast(told(run_out(SELF)) if WORLD.rank == 0 else None)
    mine = run_out(WORLD, WORLD.size if shared else 1)
    name = f"run-out past three cells on {WORLD.size} ranks, {'one mesh' if shared else 'each its'}"
    assert mine.lapses[-1].ledger.imbalance == 0.0
    for what, here, there in zip(("slip", "displacement"), told(mine), alone, strict=True):
        assert here.shape == there.shape
        figure(f"{name}: {what}", abs(here - there).max() / abs(there).max(), 1e-8)
