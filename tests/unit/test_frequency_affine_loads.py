# SPDX-License-Identifier: MIT
"""Right-hand sides that are sums of a few vectors, and joined sweeps, against dense algebra."""

import numpy as np
import pytest
from mpi4py import MPI
from support.grids import damped, dynamic_stiffness, matrix, split, springs, vector

from fenics_hytf.frequency import AffineLoads, JoinedSweep, direct_sweep, reduced_sweep
from fenics_hytf.frequency.loads import factor_loads

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
SIZE = 15 * 16
PARTS = springs(15, 16, seed=21)
LINES = 0.4 + 1j * np.linspace(0.0, 50.0, 60)  # [rad/s], on a damped contour
TAU = 0.3  # [s]
TOLERANCE = 1e-6
# A unit; a momentum; forces that stay and that fade, as a lapse takes them over.
COEFFICIENTS = np.zeros((4, 2, len(LINES)), complex)
COEFFICIENTS[0, 0] = 1.0
COEFFICIENTS[1:, 1] = [np.ones(len(LINES)), -1 / LINES, -TAU / (1 + LINES * TAU)]


def arrays(seed: int = 1) -> np.ndarray:
    """Four vectors of very different size."""
    lengths = np.array([1.0, 1e-3, 1e4, 1e-7])
    return lengths[:, None] * np.random.default_rng(seed).normal(size=(4, SIZE))


def loads(comm: MPI.Comm = SELF, coefficients=COEFFICIENTS) -> AffineLoads:
    return AffineLoads([vector(values, comm) for values in arrays()], coefficients)


def explicit(coefficients=COEFFICIENTS) -> np.ndarray:
    """Written out, shape (num_lines, SIZE, num_sides)."""
    return np.einsum("vsk,vn->kns", coefficients, arrays())


class Told:
    """The same right-hand sides line by line, as vectors of which nothing is known."""

    def __len__(self) -> int:
        return 2

    def __call__(self, line):
        return [vector(side) for side in explicit()[line].T]


def worst_error(sweep, comm: MPI.Comm = SELF) -> float:
    """Over a line's solution, of each side, against dense algebra."""
    mine, worst = split(SIZE, comm), 0.0
    for k, (s, b) in enumerate(zip(LINES, explicit(), strict=True)):
        expected = np.linalg.solve(dynamic_stiffness(PARTS, s), b)
        error = np.abs(sweep.solution(k) - expected[mine]).max(axis=0, initial=0.0)
        worst = max(worst, (error / np.abs(expected).max(axis=0)).max())
    return comm.allreduce(float(worst), MPI.MAX)


def test_loads_of_a_line():
    made = loads()
    assert len(made) == 2
    for line in (0, 7, 59):
        found = np.stack([b.array_r for b in made(line)], axis=1)
        # A sum of four: rounded thrice.
        scale = np.abs(explicit()[line]).max()
        np.testing.assert_allclose(found, explicit()[line], rtol=0, atol=1e-15 * scale)


@pytest.mark.mpi
def test_factors_hold_the_loads_and_their_norms():
    found = factor_loads(loads(WORLD), len(LINES), split_size(WORLD), WORLD, 1e-9)
    assert found.vectors.shape[1] == 4  # none is dropped, however small
    mine = split(SIZE, WORLD)
    norms = np.linalg.norm(explicit(), axis=1)
    np.testing.assert_allclose(found.norms, norms, rtol=1e-13)
    for line in (0, 30, 59):
        scale = np.abs(explicit()[line]).max(axis=0)
        error = np.abs(found.at(line) - explicit()[line][mine]).max(axis=0, initial=0.0)
        assert np.all(error <= 1e-15 * scale)
    slope = explicit()[31] - explicit()[29]
    np.testing.assert_allclose(found.slope(30), slope[mine], atol=1e-14 * np.abs(slope).max())
    assert not found.slope(30)[:, 0].any()  # a unit is the same at every line


def split_size(comm: MPI.Comm) -> int:
    mine = split(SIZE, comm)
    return mine.stop - mine.start


def test_norms_of_vectors_that_hang_together_and_of_nought():
    values = np.array([[3.0, 4.0, 0.0], [6.0, 8.0, 0.0], [0.0, 0.0, 0.0]])
    c = np.zeros((3, 2, 2), complex)
    c[:, 0, 0] = [1.0, 2j, 5.0]
    c[:, 0, 1] = [2.0, -1.0, 0.0]  # they cancel
    made = AffineLoads([vector(v) for v in values], c)
    found = factor_loads(made, 2, 3, SELF, 1e-9)
    assert found.norms[0] == pytest.approx([5 * abs(1 + 4j), 1.0], rel=1e-14)
    np.testing.assert_allclose(found.at(1), 0.0, atol=1e-15)


@pytest.mark.mpi
def test_direct_sweep(figure):
    found = direct_sweep(damped(PARTS, WORLD), loads(WORLD), LINES, 1e-9)
    figure("affine loads, direct sweep: error", worst_error(found, WORLD), 1e-11)
    if WORLD.size == 1:
        told = direct_sweep(damped(PARTS), Told(), LINES, 1e-9)
        np.testing.assert_allclose(found.solution(5), told.solution(5), rtol=1e-9)


@pytest.mark.mpi
def test_reduced_sweep(figure):
    found = reduced_sweep(damped(PARTS, WORLD), loads(WORLD), LINES, TOLERANCE)
    assert found.residuals.max() <= TOLERANCE
    assert found.factorisations < len(LINES) / 3
    figure("affine loads, reduced sweep: error", worst_error(found, WORLD), 10 * TOLERANCE)
    mine = split(SIZE, WORLD)
    for k in (0, 13, 59):  # true residuals, each side over its own load
        x = np.concatenate(WORLD.allgather(found.solution(k)))
        left = explicit()[k] - dynamic_stiffness(PARTS, LINES[k]) @ x
        size = np.linalg.norm(explicit()[k], axis=0)
        assert np.all(np.linalg.norm(left, axis=0) <= 1.3 * TOLERANCE * size)
    assert found.solution(0).shape == (mine.stop - mine.start, 2)


@pytest.mark.parametrize("sweep", [direct_sweep, reduced_sweep])
def test_a_side_of_nought(sweep):
    c = COEFFICIENTS.copy()
    c[:, 1] = 0.0
    c[:, 0, 10:] = 0.0
    found = sweep(damped(PARTS), loads(coefficients=c), LINES, TOLERANCE)
    assert found.residuals.max() <= TOLERANCE
    assert not any(found.solution(k)[:, 1].any() for k in range(len(LINES)))
    assert not found.solution(20).any() and found.solution(3)[:, 0].any()


# ---------------------------------------------------------------- joined sweeps


@pytest.mark.parametrize("sweep", [direct_sweep, reduced_sweep])
def test_joined_sweeps_are_one(sweep):
    system = damped(PARTS)
    motions = [vector(values) for values in arrays(seed=2)[:2]]
    carried = loads(coefficients=COEFFICIENTS[:, 1:])
    parts = sweep(system, motions, LINES, 1e-8), sweep(system, carried, LINES, 1e-8)
    joined = JoinedSweep(*parts)
    np.testing.assert_array_equal(joined.s, LINES)
    assert joined.residuals.shape == (len(LINES), 3)
    assert joined.residuals.max() == max(part.residuals.max() for part in parts)
    assert joined.factorisations == sum(part.factorisations for part in parts)
    assert joined.solves == sum(part.solves for part in parts)
    sides = [[part.solution(k) for k in range(len(LINES))] for part in parts]
    x = np.concatenate([np.stack(one, axis=2) for one in sides], axis=1)  # (SIZE, 3, num_lines)
    np.testing.assert_allclose(
        np.stack([joined.solution(k) for k in range(len(LINES))], axis=2), x, rtol=1e-14
    )
    rng = np.random.default_rng(3)
    weights = rng.normal(size=(3, len(LINES))) + 1j * rng.normal(size=(3, len(LINES)))
    whole = np.einsum("nsk,sk->nk", x, weights)
    rows = matrix(PARTS["C"])
    C = PARTS["C"].toarray()
    for found, expected in (
        (joined.project(rows), np.einsum("rn,nsk->rsk", C, x)),
        (joined.response(weights)(rows), C @ whole),
        (joined.combine(weights), whole.sum(axis=1)),
        (_on_unknowns(*joined.on_directions(weights)), whole),
    ):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    rows.destroy()


def _on_unknowns(bases, y) -> np.ndarray:
    if bases is None:
        return y
    return np.concatenate([block for basis in bases for block in basis.blocks], axis=1) @ y
