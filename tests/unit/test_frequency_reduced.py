# SPDX-License-Identifier: MIT
"""The reduced sweep against the direct one, on grids of masses and springs."""

import numpy as np
import pytest
from mpi4py import MPI
from support.grids import damped, dynamic_stiffness, matrix, split, springs, vector

from fenics_hytf.frequency import (
    DynamicSystem,
    ReductionError,
    SweepError,
    constant,
    direct_sweep,
    hysteretic,
    radiation,
    reduced_sweep,
)
from fenics_hytf.frequency.krylov import krylov_block, taylor
from fenics_hytf.frequency.products import TermProducts

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
TOLERANCE = 1e-6
LINES = 1j * np.linspace(1.0, 60.0, 120)  # [rad/s], over the lower half of the modes


def worst(reduced, direct) -> float:
    """Largest error of a line over its solution, all sides."""
    errors = [
        np.linalg.norm(reduced.solution(k) - direct.solution(k))
        / np.linalg.norm(direct.solution(k))
        for k in range(len(direct.s))
    ]
    return max(errors)


def agree(system, sides, lines, figure, name, **options):
    found = reduced_sweep(system, sides, lines, TOLERANCE, **options)
    direct = direct_sweep(system, sides, lines, 1e-10)
    figure(f"reduced sweep, {name}: error", worst(found, direct), 10 * TOLERANCE)
    assert found.residuals.max() <= TOLERANCE
    return found, direct


def test_lightly_damped(figure):
    parts = springs(20, 30)
    parts["K2"] *= 0.1
    b = np.random.default_rng(1).normal(size=600)
    found, direct = agree(damped(parts), vector(b), LINES, figure, "600 masses, 120 lines")
    assert found.factorisations < len(LINES) / 4
    basis = np.concatenate(found.basis.blocks, axis=1)
    assert basis.shape == (600, found.coordinates.shape[0])
    # in the scale of the stiffness
    identity = basis.conj().T @ (parts["K"].diagonal()[:, None] * basis)
    assert np.abs(identity - np.eye(len(identity))).max() < 1e-12
    # What a sweep is asked for comes from the coordinates.
    rows = matrix(parts["K"])
    np.testing.assert_allclose(
        found.project(rows), direct.project(rows), atol=1e-5 * np.abs(direct.project(rows)).max()
    )
    weights = np.random.default_rng(2).normal(size=(1, len(LINES))) + 0j
    expected = direct.combine(weights)
    np.testing.assert_allclose(found.combine(weights), expected, atol=1e-5 * abs(expected).max())
    rows.destroy()


def test_true_residuals_are_what_it_says():
    parts = springs(12, 15)
    b = np.random.default_rng(3).normal(size=180)
    found = reduced_sweep(damped(parts), vector(b), LINES, TOLERANCE)
    true = [
        np.linalg.norm(b - dynamic_stiffness(parts, s) @ found.solution(k)[:, 0])
        / np.linalg.norm(b)
        for k, s in enumerate(LINES)
    ]
    assert max(true) <= TOLERANCE
    # A sum of 600 signs is right to 1/√600 in the mean; the worst of 120 lines to four times that.
    np.testing.assert_allclose(found.residuals[:, 0], true, rtol=0.2, atol=1e-13)


def test_undamped_on_the_damped_contour(figure):
    parts = springs(15, 20)
    M, K = matrix(parts["M"]), matrix(parts["K"])
    lines = 0.5 + np.concatenate([[0j], LINES])
    sides = vector(np.random.default_rng(4).normal(size=300))
    agree(DynamicSystem(K, M), sides, lines, figure, "undamped, on the damped contour")


def test_an_undamped_resonance_on_the_damped_contour(figure):
    from scipy.linalg import eigh

    parts = springs(8, 9)
    modes = np.sqrt(eigh(parts["K"].toarray(), parts["M"].toarray(), eigvals_only=True))
    lines = 0.05 + 1j * modes[:20]
    b = vector(np.random.default_rng(5).normal(size=72))
    agree(DynamicSystem(matrix(parts["K"]), matrix(parts["M"])), b, lines, figure, "on resonances")


def test_three_sides_dashpots_and_rest(figure):
    parts = springs(14, 15, seed=6)
    K, K2, M, C = (matrix(parts[name]) for name in ("K", "K2", "M", "C"))
    terms = [(K, constant), (K2, hysteretic), (C, radiation(1 + 0.04j))]
    rng = np.random.default_rng(6)
    sides = [vector(rng.normal(size=210) + 1j * rng.normal(size=210)) for _ in range(3)]
    lines = np.concatenate([[0j], LINES])  # at rest a hysteretic law is another one
    found, _ = agree(DynamicSystem(terms, M, C), sides, lines, figure, "three sides, at rest too")
    assert found.coordinates.shape[1:] == (3, len(lines))


def test_memory_as_of_maxwell_branches(figure):
    parts = springs(14, 15, seed=7)
    K, K2, M = (matrix(parts[name]) for name in ("K", "K2", "M"))
    terms = [(K, constant)]
    terms += [(K2, lambda s, tau=tau: s * tau / (1 + s * tau)) for tau in (0.5, 0.05, 0.01)]
    b = vector(np.random.default_rng(7).normal(size=210))
    agree(DynamicSystem(terms, M), b, 0.2 + LINES, figure, "three branches of memory")


def test_one_line_is_one_factorisation():
    parts = springs(5, 6)
    b = vector(np.ones(30))
    found = reduced_sweep(damped(parts), b, [7j], TOLERANCE)
    assert found.factorisations == 1 and found.residuals.max() <= TOLERANCE
    none = reduced_sweep(damped(parts), b, [])
    assert none.factorisations == 0 and none.coordinates.shape[1:] == (1, 0)
    still = reduced_sweep(damped(parts), vector(np.zeros(30)), [3j], TOLERANCE)
    assert not still.solution(0).any()


class Still:
    """Loads of each line that are nought."""

    def __len__(self) -> int:
        return 1

    def __call__(self, line):
        return [vector(np.zeros(30))]


@pytest.mark.parametrize("lines", [[], [3j, 4j]])
def test_loads_of_nought_that_are_told_line_by_line(lines):
    found = reduced_sweep(damped(springs(5, 6)), Still(), lines, TOLERANCE)
    assert found.coordinates.shape[1:] == (1, len(lines))
    assert not any(found.solution(k).any() for k in range(len(lines)))


def test_expansions_of_a_like_system_are_kept():
    parts = springs(20, 20, seed=8)
    b = vector(np.random.default_rng(8).normal(size=400))
    first = reduced_sweep(damped(parts), b, LINES, TOLERANCE)
    parts["K"] = parts["K"] * 1.03
    again = reduced_sweep(damped(parts), b, LINES, TOLERANCE, expansions=first.expansions)
    assert again.expansions[: len(first.expansions)] == first.expansions
    assert again.factorisations <= first.factorisations + 2
    assert worst(again, direct_sweep(damped(parts), b, LINES, 1e-10)) <= 10 * TOLERANCE


def test_known_directions_are_not_sought_again(figure):
    system, b = damped(springs(12, 15)), vector(np.random.default_rng(3).normal(size=180))
    first = reduced_sweep(system, b, LINES, TOLERANCE)
    between = 0.5 * (LINES[1:] + LINES[:-1])
    assert reduced_sweep(system, b, LINES, TOLERANCE, directions=first.basis).factorisations == 0
    found, _ = agree(system, b, between, figure, "lines between", directions=first.basis)
    assert found.factorisations <= 1
    # the same with another force: what is missing is found
    c = vector(np.random.default_rng(4).normal(size=180))
    agree(system, c, LINES, figure, "another force", directions=first.basis)


def test_a_budget_that_is_too_small_names_the_lines():
    parts = springs(20, 20)
    b = vector(np.random.default_rng(9).normal(size=400))
    with pytest.raises(ReductionError) as caught:
        reduced_sweep(damped(parts), b, LINES, TOLERANCE, budget=2)
    assert len(caught.value.lines) and set(caught.value.lines) <= set(LINES)
    assert "budget" in str(caught.value) and "solver.sweep" in str(caught.value)


@pytest.mark.parametrize("line", [3, 60, 117])
def test_an_undamped_resonance_is_an_error(line):
    """Wherever it lies: where a matrix is factorised, or between."""
    from scipy.linalg import eigh

    parts = springs(7, 8)
    modes = np.sqrt(eigh(parts["K"].toarray(), parts["M"].toarray(), eigvals_only=True))
    lines = LINES.copy()
    lines[line] = 1j * modes[np.argmin(abs(modes - abs(LINES[line])))]
    system = DynamicSystem(matrix(parts["K"]), matrix(parts["M"]))
    b = vector(np.random.default_rng(13).normal(size=56))
    with pytest.raises(SweepError):
        reduced_sweep(system, b, lines, TOLERANCE)


def test_progress_counts_lines():
    seen = []
    parts = springs(12, 12)
    b = vector(np.random.default_rng(10).normal(size=144))
    reduced_sweep(damped(parts), b, LINES, TOLERANCE, lambda *counts: seen.append(counts))
    assert seen[-1] == (len(LINES), len(LINES))
    assert all(0 <= done <= total == len(LINES) for done, total in seen)


@pytest.mark.mpi
def test_ranks_agree_with_one(figure):
    parts = springs(17, 19, seed=11)
    b = np.random.default_rng(11).normal(size=(2, 323))
    lines = np.concatenate([[0j], LINES])
    many = reduced_sweep(damped(parts, WORLD), [vector(x, WORLD) for x in b], lines, TOLERANCE)
    one = direct_sweep(damped(parts), [vector(x) for x in b], lines, 1e-10)
    mine = split(323, WORLD)
    errors = []
    for k in range(len(lines)):
        expected = one.solution(k)
        difference = np.linalg.norm(many.solution(k) - expected[mine]) ** 2
        errors.append(np.sqrt(WORLD.allreduce(float(difference))) / np.linalg.norm(expected))
    figure(f"reduced sweep on {WORLD.size} ranks: error", max(errors), 10 * TOLERANCE)
    rows = matrix(parts["K2"], WORLD)
    found = np.concatenate(WORLD.allgather(many.project(rows)))
    expected = one.project(matrix(parts["K2"]))
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


# ---------------------------------------------------------------- blocks


def test_taylor_coefficients_on_a_circle():
    s, radius = 0.3 + 9j, 2.0
    square = taylor(lambda z: z * z, s, 3, radius)
    np.testing.assert_allclose(square, [s**2, 2 * s * radius, radius**2, 0.0], atol=1e-12)
    np.testing.assert_allclose(taylor(hysteretic, s, 2, radius), [1j, 0, 0], atol=1e-14)
    found = taylor(lambda z: z / (1 + z), s, 2, radius)
    expected = [s / (1 + s), radius / (1 + s) ** 2, -(radius**2) / (1 + s) ** 3]
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_a_block_spans_the_taylor_coefficients():
    parts = springs(6, 7, seed=12)
    system = damped(parts)
    s, b = 21j, np.random.default_rng(12).normal(size=42) + 0j
    A0 = dynamic_stiffness(parts, s)
    A1 = parts["C"].toarray() + 2 * s * parts["M"].toarray()
    A2 = parts["M"].toarray()
    x = [np.linalg.solve(A0, b)]
    for _ in range(5):
        pull = A1 @ x[-1] + (A2 @ x[-2] if len(x) > 1 else 0)
        x.append(-np.linalg.solve(A0, pull))
    products = TermProducts(system)
    scale = products.scale
    np.testing.assert_allclose(scale, parts["K"].diagonal() ** -0.5, rtol=1e-14)

    def solve(v):
        return np.linalg.solve(A0, v / scale) / scale

    Q = krylov_block(products, solve, x[0] / scale, s, 6)
    x = [wanted / scale for wanted in x]
    np.testing.assert_allclose(Q.conj().T @ Q, np.eye(6), atol=1e-12)
    for k, wanted in enumerate(x):
        left = wanted - Q[:, : k + 1] @ (Q[:, : k + 1].conj().T @ wanted)
        assert np.linalg.norm(left) <= 1e-8 * np.linalg.norm(wanted)
