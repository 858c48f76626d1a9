# SPDX-License-Identifier: MIT
"""Hard case 31: a run that is stopped after any lapse and gone on with, as if it had not been.

Naively positions go on and velocity, memory or the warm start of the loop are forgotten; and what
is read back in another order, or by other ranks, is another ground.
"""

import numpy as np
import pytest
from mpi4py import MPI
from support.restart import Stop, apart, arrays, counts, different, run, scene_with

import fenics_hytf.simulation.run as steps
from fenics_hytf.particles.points import take

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
ROUND_OFF = 1e-10  # of the largest value of a quantity, with the direct sweep
TOLERANCE = 1e-6  # of a reduced sweep
NEAR = {"direct": ROUND_OFF, "reduced": 10 * TOLERANCE}


def test_31_a_restart_at_any_lapse_is_the_same_to_the_last_bit(tmp_path, figure):
    """Of four lapses with the loop, convection and geometric stiffness."""
    scene = scene_with(tmp_path)
    expected = arrays(run(scene, SELF, tmp_path / "whole"))
    assert len(expected) > 25
    for stop in (1, 2, 3):
        with pytest.raises(Stop):
            run(scene, SELF, tmp_path / f"{stop}", stop=stop)
        found = arrays(run(scene, SELF, tmp_path / f"{stop}", resume=True))
        figure("arrays that differ in a bit, any lapse", different(expected, found), 0)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("sweep", "shared"), [("direct", True), ("direct", False), ("reduced", False)]
)
def test_31_the_same_ranks_go_on(tmp_path, shared_path, sweep, shared, figure):
    """Stopped twice; to the last bit unless ranks share a mesh, whose solver adds as it comes."""
    loop = "{ tolerance = 1e-2 }" if not shared or WORLD.size == 1 else "false"  # slow where shared
    scene = scene_with(tmp_path, solver__sweep=f'"{sweep}"', effects__equivalent_linear=loop)
    size = WORLD.size if shared else 1
    whole = run(scene, WORLD, shared_path / "a", size=size)
    for stop in (1, 2):
        with pytest.raises(Stop):
            run(scene, WORLD, shared_path / "b", resume=stop > 1, stop=stop, size=size)
    resumed = run(scene, WORLD, shared_path / "b", resume=True)
    assert resumed.group_size == size  # as before, though it was not asked for
    expected, found = arrays(whole), arrays(resumed)
    assert list(expected) == list(found) and len(expected) > 25
    if size == 1:
        figure("arrays that differ in a bit, same ranks", different(expected, found), 0)
        assert counts(whole) == counts(resumed)
        assert [a.loop.change for a in whole.lapses] == [b.loop.change for b in resumed.lapses]
    else:  # MUMPS adds what ranks send as it comes: no two runs agree to the last bit
        figure("difference, ranks that share a mesh", apart(expected, found), ROUND_OFF)
    WORLD.Barrier()


SOFTENS = {
    "effects__softening": "true",
    "effects__gravity": "true",
    "effects__degradation": "{ threshold = 1e-6 }",
}


@pytest.mark.mpi
@pytest.mark.parametrize("sweep", ["direct", "reduced"])
@pytest.mark.parametrize("settings", [{}, SOFTENS], ids=["as it is", "softening"])
def test_31_other_ranks_go_on(settings, sweep, tmp_path, shared_path, figure):
    """From one rank to all, and from all to one."""
    loop = "false" if WORLD.size > 1 else "true"
    given = settings | {"solver__sweep": f'"{sweep}"', "effects__equivalent_linear": loop}
    scene = scene_with(tmp_path, **given)
    own = tmp_path / "own"
    whole = run(scene, SELF, own / "a")
    with pytest.raises(Stop):
        run(scene, WORLD, shared_path / "all", stop=2, size=WORLD.size)
    with pytest.raises(Stop):
        run(scene, SELF, shared_path / "one" if WORLD.rank == 0 else own / "b", stop=2)
    WORLD.Barrier()
    spread = run(scene, WORLD, shared_path / "one", resume=True, size=WORLD.size)
    joined = None
    if WORLD.rank == 0:
        joined = run(scene, SELF, shared_path / "all", resume=True)
    expected = arrays(whole)
    off = max(apart(expected, arrays(r)) for r in (spread, joined) if r is not None)
    said = f"difference, other ranks go on, {sweep} sweep"
    figure(said, WORLD.allreduce(off, MPI.MAX), NEAR[sweep])


@pytest.mark.parametrize("sweep", ["direct", "reduced"])
def test_31_points_may_come_back_in_another_order(sweep, tmp_path, monkeypatch, figure):
    """Every sum over points is then another one in its last digits, and nothing more."""
    scene = scene_with(tmp_path, solver__sweep=f'"{sweep}"', effects__equivalent_linear="false")
    whole = run(scene, SELF, tmp_path / "a")
    with pytest.raises(Stop):
        run(scene, SELF, tmp_path / "b", stop=2)
    scatter, shuffled = steps.scatter_points, []

    def in_another_order(kept, mesh):
        points = scatter(kept, mesh)
        order = np.random.default_rng(31).permutation(len(points))
        points.assign(take(points.arrays(), order))
        shuffled.append(np.sum(order != np.arange(len(order))))
        return points

    monkeypatch.setattr(steps, "scatter_points", in_another_order)
    resumed = run(scene, SELF, tmp_path / "b", resume=True)
    assert shuffled[0] > 40  # of 48
    off = apart(arrays(whole), arrays(resumed))
    figure(f"difference, points shuffled, {sweep} sweep", off, NEAR[sweep])
