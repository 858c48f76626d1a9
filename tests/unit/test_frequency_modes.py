# SPDX-License-Identifier: MIT
"""Small systems at many lines, and the columns of a basis that grows."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.stats import ortho_group
from support.grids import matrix, split

from fenics_hytf.frequency import hysteretic, radiation
from fenics_hytf.frequency.columns import Columns
from fenics_hytf.frequency.modes import Modes, as_quadratic
from fenics_hytf.frequency.system import values

WORLD = MPI.COMM_WORLD
S = 0.2 + 1j * np.linspace(0.5, 80.0, 40)


def quadratic(size: int, damped: bool) -> np.ndarray:
    """Stiffness with hysteretic damping, dashpots and mass in a basis that is not the modes'."""
    rng = np.random.default_rng(9)
    turn = ortho_group.rvs(size, random_state=9)
    stiffness = turn.T @ np.diag(rng.uniform(1, 5000, size)) @ turn
    loss = rng.normal(size=(size, size)) / 4
    mass = np.eye(size) + 0.3 * (lambda x: x @ x.T / size)(rng.normal(size=(size, size)))
    dashpots = damped * (lambda x: x @ x.T)(rng.normal(size=(size, 3)))
    return np.stack([stiffness + 0.1j * stiffness + loss + loss.T, dashpots, mass])


@pytest.mark.parametrize("damped", [False, True])
def test_modes_give_what_elimination_gives(damped, figure):
    A, b = quadratic(12, damped), np.random.default_rng(1).normal(size=(12, 5)) + 0j
    c = np.random.default_rng(2).normal(size=(5, 3, len(S))) + 0j
    found = Modes(A, abs(S).max()).solve(S, b, c)
    for k, s in enumerate(S):
        expected = np.linalg.solve(A[0] + s * A[1] + s * s * A[2], b @ c[:, :, k])
        error = abs(found[:, :, k] - expected).max() / abs(expected).max()
        assert error <= 1e-11  # the condition of the eigenvectors, some 1e3, times round-off


def test_a_mass_that_is_not_positive_is_refused():
    A = quadratic(5, False)
    with pytest.raises(np.linalg.LinAlgError):
        Modes(np.stack([A[0], A[1], -A[2]]), 80.0)


def test_functions_that_are_quadratic_are_found_out():
    coefficients = np.array([[1.0, 0, 0], [1j, 0, 0], [0, 2 - 1j, 0], [0, 0, 1], [3, 1e-4, 0]])
    factors = coefficients @ S ** np.arange(3)[:, None]
    np.testing.assert_allclose(as_quadratic(factors, S), coefficients, rtol=1e-11, atol=1e-15)
    branch = (S * 0.1 / (1 + 0.1 * S))[None]
    assert as_quadratic(np.concatenate([factors, branch]), S) is None


@pytest.mark.parametrize(
    "function",
    [
        lambda s: 1.0,
        lambda s: s * s,
        hysteretic,
        radiation(1 + 0.1j),
        lambda s: complex(s) ** 2,  # takes no array
        lambda s: 1.0 if abs(s) > 40 else 2.0,
        lambda s: s / (1 + 0.3 * s),
    ],
)
def test_functions_are_evaluated_at_all_lines(function):
    lines = np.concatenate([[0j], S, [-3j]])
    expected = [function(complex(s)) for s in lines]
    # an ulp: arrays are divided by other instructions
    np.testing.assert_allclose(values(function, lines), expected, rtol=1e-15)
    assert values(function, lines[:0]).shape == (0,)


@pytest.mark.mpi
def test_columns_grow_block_by_block():
    rng = np.random.default_rng(5)
    whole = rng.normal(size=(40, 75)) + 1j * rng.normal(size=(40, 75))
    x = rng.normal(size=(75, 3)) + 0j
    y = rng.normal(size=(40, 2)) + 1j
    mine = split(40, WORLD)
    columns = Columns(len(range(40)[mine]))
    rows = matrix(rng.normal(size=(40, 40)), WORLD)
    dense = np.concatenate(WORLD.allgather(rows.convert("dense").getDenseArray().copy()))
    done = 0
    for width in (0, 1, 31, 32, 11):
        columns.append(whole[mine, done : done + width])
        done += width
        V = whole[:, :done]
        assert columns.size == done
        np.testing.assert_allclose(columns @ x[:done], V[mine] @ x[:done], atol=1e-13)
        np.testing.assert_allclose(columns @ x[:done, 0], V[mine] @ x[:done, 0], atol=1e-13)
        np.testing.assert_allclose(columns.inner(WORLD, y[mine]), V.conj().T @ y, atol=1e-13)
        np.testing.assert_allclose(columns.seen_by(rows), (dense @ V)[mine], atol=1e-12)
    np.testing.assert_array_equal(np.concatenate(columns.blocks, axis=1), whole[mine])
