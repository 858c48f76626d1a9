# SPDX-License-Identifier: MIT
"""Groups of ranks over lines: here every rank is a group, with the whole system to itself."""

import pickle

import numpy as np
import pytest
from mpi4py import MPI
from support.grids import damped, matrix, springs, vector

from fenics_hytf.frequency import (
    DynamicSystem,
    FactorisationError,
    ReductionError,
    ResonanceError,
    SweepError,
    direct_sweep,
    reduced_sweep,
)
from fenics_hytf.frequency.groups import share, together

WORLD = MPI.COMM_WORLD
LINES = 1j * np.linspace(2.0, 60.0, 53)
TOLERANCE = 1e-6

pytestmark = pytest.mark.mpi


def loads(size: int) -> list:
    return [vector(b) for b in np.random.default_rng(3).normal(size=(2, size))]


@pytest.mark.parametrize("count", [0, 1, 2, 7, 53])
def test_shares_are_neighbours_and_make_the_whole(count):
    mine = range(*share(count, WORLD).indices(count))
    everything = [k for part in WORLD.allgather(list(mine)) for k in part]
    assert everything == list(range(count))
    sizes = WORLD.allgather(len(mine))
    assert max(sizes) - min(sizes) <= 1


def test_the_direct_sweep_is_the_same_in_every_group(figure):
    parts = springs(7, 9, seed=3)
    alone = direct_sweep(damped(parts), loads(63), LINES, TOLERANCE)
    seen = []
    report = lambda *counts: seen.append(counts)  # noqa: E731
    shared = direct_sweep(damped(parts), loads(63), LINES, TOLERANCE, report, across=WORLD)
    assert (shared.factorisations, shared.solves) == (53, 106)
    assert seen[-1][0] <= seen[-1][1] == 53 and len(seen) == len(range(53)[share(53, WORLD)])
    np.testing.assert_array_equal(shared.residuals, alone.residuals)
    values = np.stack([shared.solution(k) for k in range(53)])
    expected = np.stack([alone.solution(k) for k in range(53)])
    # a matrix that is refilled is eliminated as the first one was: bit for bit
    np.testing.assert_array_equal(values, expected)
    np.testing.assert_array_equal(values, WORLD.bcast(values))


def test_the_reduced_sweep_is_the_same_in_every_group(figure):
    parts = springs(17, 19, seed=4)
    lines = np.concatenate([[0j], 1j * np.linspace(0.5, 60.0, 300)])
    shared = reduced_sweep(damped(parts), loads(323), lines, TOLERANCE, across=WORLD)
    exact = direct_sweep(damped(parts), loads(323), lines, 1e-10)
    pairs = [(shared.solution(k), exact.solution(k)) for k in range(len(lines))]
    error = max(np.linalg.norm(a - b) / np.linalg.norm(b) for a, b in pairs)
    figure(f"reduced sweep in {WORLD.size} groups: error", error, 10 * TOLERANCE)
    assert shared.residuals.max() <= TOLERANCE
    assert shared.factorisations == len(shared.expansions) < 60
    basis = np.concatenate(shared.basis.blocks, axis=1)
    stiffness = parts["K"].diagonal()[:, None]
    np.testing.assert_allclose(
        basis.conj().T @ (stiffness * basis), np.eye(len(basis.T)), atol=1e-12
    )
    for mine in (basis, shared.coordinates, shared.residuals):
        np.testing.assert_array_equal(mine, WORLD.bcast(mine))
    assert shared.expansions == WORLD.bcast(shared.expansions)


def test_directions_that_are_known_are_known_to_every_group():
    system, lines = damped(springs(17, 19, seed=4)), 1j * np.linspace(0.5, 60.0, 200)
    first = reduced_sweep(system, loads(323), lines[::2], TOLERANCE, across=WORLD)
    options = {"across": WORLD, "directions": first.basis}
    shared = reduced_sweep(system, loads(323), lines[1::2], TOLERANCE, **options)
    assert shared.residuals.max() <= TOLERANCE
    assert shared.factorisations <= WORLD.size
    basis = np.concatenate(shared.basis.blocks, axis=1)
    for mine in (basis, shared.coordinates):
        np.testing.assert_array_equal(mine, WORLD.bcast(mine))


def test_more_groups_than_lines():
    parts = springs(5, 5, seed=5)
    for lines in ([11j], []):
        shared = reduced_sweep(damped(parts), loads(25), lines, TOLERANCE, across=WORLD)
        exact = direct_sweep(damped(parts), loads(25), lines, TOLERANCE, across=WORLD)
        assert exact.factorisations == len(lines)
        for k in range(len(lines)):
            np.testing.assert_allclose(shared.solution(k), exact.solution(k), rtol=1e-10)


@pytest.mark.parametrize("sweep", [direct_sweep, reduced_sweep])
@pytest.mark.parametrize("group", [0, -1])
def test_what_one_group_meets_all_are_told(sweep, group):
    """The line of one group is an undamped resonance, or a matrix of noughts."""
    lines = LINES.copy()
    line = range(len(lines))[share(len(lines), WORLD)][0]
    bad = WORLD.allgather(line)[group]
    springs_alone = matrix(np.diag(np.full(4, -lines[bad].real + lines[bad].imag ** 2)))
    masses = matrix(np.eye(4))
    system = DynamicSystem(springs_alone, masses)
    with pytest.raises((ResonanceError, FactorisationError)) as met:
        sweep(system, vector(np.ones(4)), lines, TOLERANCE, across=WORLD)
    assert met.value.s == WORLD.bcast(met.value.s)


@pytest.mark.parametrize("budget", [1, 2, 3])
def test_the_budget_counts_all_groups(budget):
    parts = springs(17, 19, seed=6)
    with pytest.raises(ReductionError) as met:
        reduced_sweep(damped(parts), loads(323), LINES, 1e-10, budget=budget, block=2, across=WORLD)
    np.testing.assert_array_equal(met.value.lines, WORLD.bcast(met.value.lines))


def test_errors_pass_from_rank_to_rank_with_what_they_hold():
    for error in (FactorisationError(3j), ResonanceError(4j, 1e12)):
        again = pickle.loads(pickle.dumps(error))
        assert type(again) is type(error) and str(again) == str(error) and again.s == error.s
    again = pickle.loads(pickle.dumps(ReductionError(LINES[:3], 0.1, 1e-6)))
    np.testing.assert_array_equal(again.lines, LINES[:3])
    with pytest.raises(SweepError, match="cannot be factorised"), together(WORLD):
        if WORLD.rank == WORLD.size - 1:
            raise FactorisationError(3j)
