# SPDX-License-Identifier: MIT
"""Systems and the direct sweep against dense algebra, on one rank and several."""

from collections import Counter

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from support.grids import (
    damped,
    dense,
    dynamic_stiffness,
    matrix,
    springs,
    together,
    vector,
)
from support.meshes import scene

from fenics_hytf.domain import build
from fenics_hytf.frequency import (
    DynamicSystem,
    FactorisationError,
    ResidualError,
    SweepError,
    constant,
    direct,
    direct_sweep,
    hysteretic,
)
from fenics_hytf.lapse import ElasticConstants, Equations, Material, Part, survey
from fenics_hytf.particles import default_points_per_cell, seed
from fenics_hytf.scene import Scene

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
CONTOUR = [0.0, 5j, 31.4j, -31.4j, 0.7, 0.7 + 12j, 0.3 - 80j]  # [rad/s]


@pytest.fixture(params=["petsc", "mumps"])
def package(request, monkeypatch):
    """Both packages, whatever the size; on several ranks MUMPS either way."""
    monkeypatch.setattr(direct, "_SMALL", 10**9 if request.param == "petsc" else 0)
    return request.param


# ---------------------------------------------------------------- the system


def test_the_system_is_affine_in_its_matrices():
    parts = springs(4, 5)
    system = damped(parts)
    A = system.create_matrix()
    for s in CONTOUR:  # one matrix filled again and again: nothing is left of the last time
        system.fill(A, s)
        expected = dynamic_stiffness(parts, s)
        # Four products and sums an entry.
        np.testing.assert_allclose(dense(A), expected, rtol=0, atol=1e-15 * np.abs(expected).max())
    assert np.array_equal(dense(system.terms[0][0]).real, parts["K"].toarray())


def test_a_single_matrix_is_an_elastic_stiffness():
    parts = springs(3, 3)
    system = DynamicSystem(matrix(parts["K"]), matrix(parts["M"]))
    A = system.create_matrix()
    system.fill(A, 2j)
    expected = (parts["K"] - 4.0 * parts["M"]).toarray()
    np.testing.assert_allclose(dense(A), expected, rtol=1e-15)


def test_any_law_is_a_function_of_s():
    parts = springs(3, 3)
    maxwell = matrix(parts["K2"])
    K, M = matrix(parts["K"]), matrix(parts["M"])
    system = DynamicSystem([(K, constant), (maxwell, lambda s: 0.3 * s / (s + 20.0))], M)
    A = system.create_matrix()
    s = 0.4 + 9j
    system.fill(A, s)
    expected = parts["K"] + 0.3 * s / (s + 20) * parts["K2"] + s**2 * parts["M"]
    np.testing.assert_allclose(dense(A), expected.toarray(), rtol=1e-14)


def test_hysteretic_damping_takes_the_sign_of_the_frequency():
    assert [hysteretic(s) for s in (3j, 0.5 + 3j, -3j, 0.0, 0.5)] == [1j, 1j, -1j, 0.0, 0.0]


def test_conjugate_frequencies_have_conjugate_matrices():
    # So a real motion has a real response.
    system = damped(springs(3, 4))
    A, B = system.create_matrix(), system.create_matrix()
    system.fill(A, 0.3 + 7j)
    system.fill(B, 0.3 - 7j)
    np.testing.assert_array_equal(dense(A), dense(B).conj())


@pytest.mark.mpi
def test_the_matrix_is_symmetric_not_hermitian():
    system = damped(springs(5, 6), WORLD)
    A = system.create_matrix()
    for s in CONTOUR[1:]:
        system.fill(A, s)
        # Sums are fused or not, depending on where an entry stands: one rounding.
        assert A.isTranspose(A, 1e-15 * A.norm(PETSc.NormType.INFINITY))
        # Symmetric and not real: not Hermitian.
        assert np.any(A.getValuesCSR()[2].imag) or not np.imag(s)


def pattern_of(parts, name, keep) -> sparse.csr_matrix:
    """A matrix with some entries of its pattern dropped."""
    coo = parts[name].tocoo()
    rows, columns, values = coo.row[keep(coo)], coo.col[keep(coo)], coo.data[keep(coo)]
    return sparse.csr_matrix((values, (rows, columns)), coo.shape)


@pytest.mark.mpi
def test_matrices_of_another_pattern_are_refused():
    parts = springs(4, 4)
    K, M = matrix(parts["K"], WORLD), matrix(parts["M"], WORLD)
    fewer = matrix(sparse.eye(16), WORLD)
    # As many entries as K in every row, but one of them elsewhere.
    shifted = parts["K"].copy().tolil()
    shifted[7, 6], shifted[7, 14] = 0.0, 1.0
    shifted[6, 7], shifted[14, 7] = 0.0, 0.0
    shifted = sparse.csr_matrix(shifted)
    shifted = matrix(shifted, WORLD)
    smaller = matrix(springs(3, 4)["M"], WORLD)
    for wrong in (fewer, shifted, smaller):
        with pytest.raises(ValueError, match="different sizes or sparsity patterns"):
            DynamicSystem(K, wrong)
        with pytest.raises(ValueError, match="different sizes or sparsity patterns"):
            DynamicSystem(K, M, wrong)
        with pytest.raises(ValueError, match="different sizes or sparsity patterns"):
            DynamicSystem([(K, constant), (wrong, hysteretic)], M)


def test_one_entry_elsewhere_is_another_pattern():
    # As many entries in all, so that PETSc's flat sum would take them for alike.
    one = sparse.csr_matrix((np.ones(4), ([0, 1, 2, 0], [0, 1, 2, 1])), (3, 3))
    two = sparse.csr_matrix((np.ones(4), ([0, 1, 2, 0], [0, 1, 2, 2])), (3, 3))
    with pytest.raises(ValueError, match="sparsity patterns"):
        DynamicSystem(matrix(one), matrix(two))


def test_no_stiffness_is_refused():
    with pytest.raises(ValueError, match="no matrix"):
        DynamicSystem([], matrix(sparse.eye(3)))


# ---------------------------------------------------------------- the direct sweep


def test_direct_sweep_equals_dense_algebra(package):
    parts = springs(6, 8)
    rng = np.random.default_rng(1)
    sides = rng.normal(size=(48, 3)) + 1j * rng.normal(size=(48, 3))
    sweep = direct_sweep(damped(parts), [vector(side) for side in sides.T], CONTOUR)
    assert sweep.s.tolist() == CONTOUR
    for k, s in enumerate(CONTOUR):
        expected = np.linalg.solve(dynamic_stiffness(parts, s), sides)
        # Condition numbers of up to 1e3.
        np.testing.assert_allclose(sweep.solution(k), expected, atol=1e-13 * np.abs(expected).max())


def test_counts_and_residuals_are_true(package):
    parts = springs(6, 8)
    sides = np.random.default_rng(2).normal(size=(48, 2))
    seen = []
    sweep = direct_sweep(
        damped(parts),
        [vector(side) for side in sides.T],
        CONTOUR,
        progress=lambda done, total: seen.append((done, total)),
    )
    assert (sweep.factorisations, sweep.solves) == (len(CONTOUR), 2 * len(CONTOUR))
    assert seen == [(k + 1, len(CONTOUR)) for k in range(len(CONTOUR))]
    assert sweep.residuals.shape == (len(CONTOUR), 2)
    for k, s in enumerate(CONTOUR):
        left = sides - dynamic_stiffness(parts, s) @ sweep.solution(k)
        relative = np.linalg.norm(left, axis=0) / np.linalg.norm(sides, axis=0)
        assert np.all(relative < 1e-13)
        assert np.all(sweep.residuals[k] < 1e-13)
        # Both are round-off, summed in another order.
        np.testing.assert_allclose(sweep.residuals[k], relative, rtol=0.5, atol=1e-15)


def test_projections_and_sums_of_the_solutions():
    parts = springs(5, 5)
    rng = np.random.default_rng(3)
    sides = rng.normal(size=(25, 2))
    sweep = direct_sweep(damped(parts), [vector(side) for side in sides.T], CONTOUR)
    rows = sparse.random_array((4, 25), density=0.3, rng=rng, format="csr")
    local = PETSc.Mat().createAIJ(
        rows.shape,
        csr=(rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data + 0j),
        comm=SELF,
    )
    solutions = np.stack([sweep.solution(k) for k in range(len(CONTOUR))], axis=2)
    projected = sweep.project(local)
    assert projected.shape == (4, 2, len(CONTOUR))
    expected = np.einsum("ru,usk->rsk", rows.toarray(), solutions)
    np.testing.assert_allclose(projected, expected, atol=1e-15 * np.abs(expected).max())
    weights = rng.normal(size=(2, len(CONTOUR))) + 1j * rng.normal(size=(2, len(CONTOUR)))
    expected = np.einsum("usk,sk->u", solutions, weights)
    np.testing.assert_allclose(
        sweep.combine(weights), expected, atol=1e-14 * np.abs(expected).max()
    )


def test_one_line_may_be_a_number():
    parts = springs(3, 3)
    b = np.ones(9)
    sweep = direct_sweep(damped(parts), vector(b), 3j)
    expected = np.linalg.solve(dynamic_stiffness(parts, 3j), b)
    np.testing.assert_allclose(sweep.solution(0)[:, 0], expected, rtol=1e-12)


@pytest.mark.mpi
def test_no_line_and_no_load():
    system = damped(springs(3, 3), WORLD)
    none = direct_sweep(system, vector(np.ones(9), WORLD), [])
    assert (none.factorisations, none.solves, none.residuals.shape) == (0, 0, (0, 1))
    rows = system.terms[0][0]
    assert none.project(rows).shape == (rows.getLocalSize()[0], 1, 0)
    assert not none.combine(np.empty((1, 0))).any()
    still = direct_sweep(system, vector(np.zeros(9), WORLD), [3j])
    assert not still.solution(0).any()
    assert still.residuals.tolist() == [[0.0]]


@pytest.mark.mpi
@pytest.mark.parametrize("size", [(1, 1), (1, 2), (2, 2), (7, 9), (20, 30)])
def test_ranks_agree_with_one(size):
    parts = springs(*size)
    count = size[0] * size[1]
    sides = np.random.default_rng(4).normal(size=(2, count))
    lines = CONTOUR[:4]
    many = direct_sweep(damped(parts, WORLD), [vector(b, WORLD) for b in sides], lines)
    one = direct_sweep(damped(parts), [vector(b) for b in sides], lines)
    for k in range(len(lines)):
        expected = one.solution(k)
        found = together(many.solution(k), WORLD)
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
    weights = np.random.default_rng(5).normal(size=(2, len(lines))) + 0j
    expected = one.combine(weights)
    found = together(many.combine(weights), WORLD)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())
    projected = together(many.project(matrix(parts["C"], WORLD)), WORLD)
    expected = one.project(matrix(parts["C"]))
    np.testing.assert_allclose(projected, expected, atol=1e-12 * np.abs(expected).max())
    assert many.residuals.max() < 1e-13


# ---------------------------------------------------------------- where it fails, it says so


def two_masses(K) -> DynamicSystem:
    """Two unit masses on given springs; entries are small integers, so A(1j) = K - 1 is exact."""
    return DynamicSystem(matrix(np.array(K, float) + 0.0), matrix(full_identity(2)))


def full_identity(n) -> sparse.csr_matrix:
    rows, columns = np.divmod(np.arange(n * n), n)
    return sparse.csr_matrix(((rows == columns).astype(float), (rows, columns)), (n, n))


def test_a_resonance_hit_exactly_is_refused(package):
    # ω² = 1 and 3; at ω = 1, A = [[1, -1], [-1, 1]] to the last bit.
    system = two_masses([[2, -1], [-1, 2]])
    for b in ([1.0, 0.0], [1.0, -1.0]):  # the second would have a solution
        with pytest.raises((FactorisationError, ResidualError)) as caught:
            direct_sweep(system, vector(b), [0.5j, 1j, 2j])
        assert caught.value.s == 1j
        assert "at 0.159155 Hz" in str(caught.value)
        assert "damping" in str(caught.value)
    beside = direct_sweep(system, vector([1.0, 0.0]), [0.5j, 2j])
    np.testing.assert_allclose(beside.solution(0)[:, 0], [28 / 33, 16 / 33], rtol=1e-14)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("size", "omega"),
    [(5, 1.0), (599, 1.0), (599, np.sqrt(3.0)), (1199, 1.0), (1199, np.sqrt(3.0))],
)
def test_a_resonance_of_a_chain(size, omega):
    # Unit springs and masses between two walls: ω² = 2 - 2 cos(π k/(size + 1)), 1 and 3 at a third
    # and two thirds. At ω = 1 the matrix is singular exactly; √3² misses 3 by one rounding.
    bands = [-np.ones(size - 1), 2 * np.ones(size), -np.ones(size - 1)]
    K = sparse.csr_matrix(sparse.diags_array(bands, offsets=[-1, 0, 1]))
    M = K.copy()
    M.data = np.where(K.data == 2, 1.0, 0.0)
    system = DynamicSystem(matrix(K, WORLD), matrix(M, WORLD))
    b = vector(np.arange(size) == 0, WORLD)
    with pytest.raises(SweepError) as caught:
        direct_sweep(system, b, [0.5j, 1j * omega], tolerance=1e-9)
    assert caught.value.s == 1j * omega
    contour = direct_sweep(system, b, [0.05 + 1j * omega], tolerance=1e-9)
    assert contour.residuals.max() < 1e-9


def test_a_resonance_missed_by_round_off_is_refused(package):
    # Small systems have small residuals even there: what counts is how much the load is amplified.
    system = two_masses([[2, -1], [-1, 2]])
    for omega in (np.sqrt(3.0), 1.0 + 1e-12, np.sqrt(3.0) * (1 - 1e-13)):
        with pytest.raises(SweepError, match="resonance"):
            direct_sweep(system, vector([1.0, 0.0]), [1j * omega])
    # At a relative distance δ the amplification is 1/(4 δ): true, and no error.
    near = direct_sweep(system, vector([1.0, 1.0]), [1j * (1 + 1e-6)])
    np.testing.assert_allclose(near.solution(0)[:, 0], 1 / (1 - (1 + 1e-6) ** 2), rtol=1e-9)


def test_a_body_without_support_is_refused_at_rest(package):
    system = two_masses([[1, -1], [-1, 1]])
    with pytest.raises(SweepError, match="at 0 Hz"):
        direct_sweep(system, vector([1.0, 2.0]), [0.0])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_none_never_pass(package, bad):
    with pytest.raises(SweepError):
        direct_sweep(two_masses([[bad, -1], [-1, 2]]), vector([1.0, 0.0]), [0.5j])
    with pytest.raises(SweepError):
        direct_sweep(two_masses([[2, -1], [-1, 2]]), vector([bad, 0.0]), [0.5j])


def test_a_zero_pivot_falls_back_to_pivoting(package):
    # A(1j) = [[0, 2], [2, 0]]: regular, but LDLᵀ without pivoting divides by zero.
    sweep = direct_sweep(two_masses([[1, 2], [2, 1]]), vector([1.0, 3.0]), [1j, 2j])
    np.testing.assert_allclose(sweep.solution(0)[:, 0], [1.5, 0.5], rtol=1e-14)
    expected = np.linalg.solve([[-3, 2], [2, -3]], [1, 3])
    np.testing.assert_allclose(sweep.solution(1)[:, 0], expected, rtol=1e-14)
    assert sweep.factorisations == 3  # the first line twice; then it stays with pivoting


def test_a_small_pivot_is_seen_in_the_residual(package):
    # A(1j) = [[δ, 2], [2, 0]] with δ = 2^-52: LDLᵀ without pivoting loses every digit.
    delta = np.finfo(float).eps
    sweep = direct_sweep(two_masses([[1 + delta, 2], [2, 1]]), vector([1.0, 1.0]), [1j])
    np.testing.assert_allclose(sweep.solution(0)[:, 0], [0.5, 0.5], rtol=1e-14)
    assert sweep.residuals.max() < 1e-14


@pytest.mark.mpi
def test_ranks_fall_back_together():
    # Chains of pairs with a zero diagonal at s = 1j.
    n = 40
    K = sparse.block_diag([np.array([[1.0, 2.0], [2.0, 1.0]])] * (n // 2))
    M = sparse.block_diag([np.array([[1.0, 0.0], [0.0, 1.0]])] * (n // 2))
    K, M = sparse.csr_matrix(K), sparse.csr_matrix(M)
    M = sparse.csr_matrix((np.where(K.data == 1.0, 1.0, 0.0), K.indices, K.indptr), K.shape)
    system = DynamicSystem(matrix(K, WORLD), matrix(M, WORLD))
    b = np.arange(1.0, n + 1)
    sweep = direct_sweep(system, vector(b, WORLD), [1j])
    expected = b.reshape(-1, 2)[:, ::-1].ravel() / 2
    np.testing.assert_allclose(together(sweep.solution(0)[:, 0], WORLD), expected, rtol=1e-14)


@pytest.mark.mpi
@pytest.mark.parametrize("n", [1, 2, 3, 12, 60])
def test_unknowns_that_all_hang_together(n, monkeypatch):
    # One of MUMPS' orderings, PORD, ends the process on such a matrix: one or two cells' unknowns.
    monkeypatch.setattr(direct, "_SMALL", 0)
    K = sparse.csr_matrix(np.ones((n, n)) + 2 * np.eye(n))
    system = DynamicSystem(matrix(K, WORLD), matrix(full_identity(n), WORLD))
    b = np.arange(1.0, n + 1)
    sweep = direct_sweep(system, vector(b, WORLD), [1j])
    expected = np.linalg.solve(np.ones((n, n)) + np.eye(n), b)
    np.testing.assert_allclose(together(sweep.solution(0)[:, 0], WORLD), expected, atol=1e-13 * n)


# ---------------------------------------------------------------- stiffness contrast


def lens(cell: str) -> Scene:
    """A section of 20 m x 10 m with a lens a million times softer than the ground round it."""
    polygon = [[4, 5], [16, 5], [16, 8], [4, 8]]
    soft = {"density": 1500.0, "shear_wave_velocity": 30.0, "poisson": 0.45}
    return scene(
        {
            "box": {"size": [20.0, 10.0], "cells": [20, 10], "cell": cell},
            "regions": [{"soil": "soft", "polygon": polygon}, {"soil": "stiff"}],
        },
        soil={"soft": soft, "stiff": soft | {"shear_wave_velocity": 30e3}},
    )


@pytest.mark.mpi
@pytest.mark.parametrize("damping", [0.0, 0.001, 0.05, 0.2])
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_stiffness_contrast_of_a_million(cell, damping, package, figure):
    """Hard case 19: residual below 1e-9 up to 50 Hz, without damping and with."""
    case = lens(cell)
    domain = build(case, WORLD)
    equations = Equations(case, domain, Counter())
    soils = [case.soil[name] for name in domain.region_names]
    density = [soil.density for soil in soils]
    points = seed(domain.mesh, domain.regions, density, default_points_per_cell(cell, 1))
    equations.weigh(points)
    region = domain.gather_cells(domain.regions)
    shear = np.array([soil.elastic.shear_modulus for soil in soils])[region]
    lame = np.array([soil.elastic.lame_lambda for soil in soils])[region]
    real = ElasticConstants(lame, shear)
    parts = [Part("real", real, constant)]
    if damping:
        imaginary = ElasticConstants(2 * damping * lame, 2 * damping * shear)
        parts.append(Part("imaginary", imaginary, hysteretic))
    soil = survey(case, domain, points)
    lapse = equations.assemble(soil, Material(real, tuple(parts)))
    lines = 2j * np.pi * np.array([0.0, 0.1, 0.7, 2.3, 9.1, 27.0, 50.0])
    sweep = direct_sweep(lapse.system, lapse.loads, lines, tolerance=1e-9)
    (b,) = lapse.loads
    A, x, left = lapse.system.create_matrix(), b.duplicate(), b.duplicate()
    worst = 0.0
    for k, s in enumerate(lines):
        lapse.system.fill(A, s)
        assert A.isTranspose(A, 1e-15 * A.norm(PETSc.NormType.INFINITY))
        x.array[:] = sweep.solution(k)[:, 0]
        A.mult(x, left)
        left.aypx(-1.0, b)
        worst = max(worst, left.norm() / b.norm())
    figure(f"residual, contrast 1e6, damping {damping:g}, {cell}, {package}", worst, 1e-9)
