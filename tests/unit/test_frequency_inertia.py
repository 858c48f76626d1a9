# SPDX-License-Identifier: MIT
"""Counts of negative eigenvalues against matrices that are made with known ones."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.frequency import negative_eigenvalues

WORLD = MPI.COMM_WORLD


def distributed(matrix: sparse.spmatrix) -> PETSc.Mat:
    """Each rank brings its rows; the pattern is that of the matrix."""
    matrix = sparse.csr_matrix(matrix)
    size = matrix.shape[0]
    first, stop = (size * (WORLD.rank + i) // WORLD.size for i in (0, 1))
    mine = matrix[first:stop]
    A = PETSc.Mat().createAIJ(
        ((stop - first, size), (stop - first, size)),
        csr=(
            mine.indptr.astype(PETSc.IntType),
            mine.indices.astype(PETSc.IntType),
            mine.data.astype(PETSc.ScalarType),
        ),
        comm=WORLD,
    )
    A.assemble()
    return A


def with_diagonal(pattern: sparse.csr_matrix) -> sparse.csr_matrix:
    """The identity, on another matrix's pattern."""
    identity = pattern.copy()
    identity.data[:] = 0.0
    identity.setdiag(1.0)
    return identity


def count(*terms: tuple[sparse.spmatrix, float]) -> int:
    matrices = [(distributed(matrix), factor) for matrix, factor in terms]
    found = negative_eigenvalues(matrices)
    for matrix, _ in matrices:
        matrix.destroy()
    return found


@pytest.mark.mpi
@pytest.mark.parametrize("negative", [0, 1, 7, 60])
def test_random_matrices_of_known_inertia(negative):
    """Lᵀ D L has the signs of D for any regular L (Sylvester)."""
    rng = np.random.default_rng(negative)
    size = 60
    L = np.tril(rng.normal(size=(size, size)), -1) * (rng.random((size, size)) < 0.1)
    D = rng.uniform(0.5, 2.0, size)
    D[rng.permutation(size)[:negative]] *= -1
    L += np.eye(size)
    A = L.T @ np.diag(D) @ L
    assert np.count_nonzero(np.linalg.eigvalsh(A) < 0) == negative
    shuffle = rng.permutation(size)
    assert count((sparse.csr_matrix(A[np.ix_(shuffle, shuffle)]), 1.0)) == negative


@pytest.mark.mpi
@pytest.mark.parametrize("shift", [0.0, 0.1, 0.5, 3.0, 8.0])
def test_a_shifted_laplacian_in_closed_form(shift):
    """Eigenvalues of the five-point Laplacian are sums of 2 − 2 cos(πk/(n + 1))."""
    n = 40
    line = sparse.diags_array(
        [-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1]
    )
    one = sparse.identity(n)
    laplacian = sparse.csr_matrix(sparse.kron(line, one) + sparse.kron(one, line))
    wave = 2 - 2 * np.cos(np.pi * np.arange(1, n + 1) / (n + 1))
    expected = np.count_nonzero(wave[:, None] + wave < shift)
    assert count((laplacian, 1.0), (with_diagonal(laplacian), -shift)) == expected


@pytest.mark.mpi
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e12])
def test_pivots_of_nought(scale):
    """A line of springs held nowhere has no negative eigenvalue; a swap of six three, by pairs."""
    line = np.diag(np.r_[1.0, 2 * np.ones(8), 1.0]) - np.eye(10, k=1) - np.eye(10, k=-1)
    assert count((sparse.csr_matrix(scale * line), 1.0)) == 0
    swap = sparse.csr_matrix(np.fliplr(np.eye(6)) + np.eye(6))
    assert count((swap, scale), (with_diagonal(swap), -scale)) == 3
    assert count((sparse.csr_matrix(scale * np.fliplr(np.eye(6))), 1.0)) == 3
