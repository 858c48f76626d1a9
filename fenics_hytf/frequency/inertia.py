# SPDX-License-Identifier: MIT
"""How many negative eigenvalues a stiffness has: those of D in K = L D Lᵀ.

By Sylvester's law of inertia D has as many of each sign as K. MUMPS does not count them for complex
scalars, but K is real: SuperLU without pivoting has L and U = D Lᵀ. It is serial, so one rank
factorises the whole matrix, once where a sweep does it many times. (PETSc's own LDLᵀ counts as
well, and took 20 times as long on 14 000 unknowns in space.)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse.linalg import splu

from fenics_hytf.frequency.errors import FactorisationError

# Of a matrix with a diagonal of ±1: pivots that are as good as nought, which an indefinite matrix
# may meet at any eigenvalues, and what is then added to the diagonal, here more and there less lest
# pivots cancel again.
_NOUGHT, _SHIFT = 1e-8, 1e-6


def negative_eigenvalues(terms: Sequence[tuple[PETSc.Mat, float]]) -> int:
    """Count the negative eigenvalues of a sum of real symmetric matrices (collective).

    Args:
        terms: Matrices of one sparsity pattern, and the factor of each; at least one.

    Returns:
        Their number, the same on every rank; an eigenvalue of nought is not negative.

    Raises:
        FactorisationError: On every rank: the factorisation failed.
    """
    total = terms[0][0].duplicate(copy=False)
    total.zeroEntries()
    for matrix, factor in terms:
        total.axpy(factor, matrix, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    comm, size = total.comm.tompi4py(), total.getSize()[1]
    rows = comm.gather(total.getValuesCSR())
    total.destroy()
    found = None
    if rows is not None:
        parts = [sparse.csr_matrix((v.real, j, i), shape=(len(i) - 1, size)) for i, j, v in rows]
        found = _negative_pivots(sparse.csr_matrix(sparse.vstack(parts)))
    found = comm.bcast(found)
    if found is None:
        raise FactorisationError(0.0)
    return found


def _negative_pivots(K: sparse.csr_matrix) -> int | None:
    """Negative entries of D, or ``None`` where the matrix cannot be factorised."""
    root = np.sqrt(np.abs(K.diagonal()))
    # A diagonal of ±1; no eigenvalue changes its sign.
    scale = sparse.diags_array(1 / np.where(root > 0, root, 1.0))
    order = _nested_dissection(K)
    scaled = sparse.csc_matrix((scale @ K @ scale)[order][:, order])
    pivots = _pivots(scaled)
    if pivots is None or np.abs(pivots).min(initial=1.0) < _NOUGHT:
        shift = _SHIFT * np.random.default_rng(0).uniform(0.5, 1.0, len(order))
        pivots = _pivots(scaled + sparse.diags_array(shift))
    return None if pivots is None else int(np.count_nonzero(pivots < 0))


def _pivots(K: sparse.csc_matrix) -> npt.NDArray[np.float64] | None:
    """D, or ``None`` where it takes a pivot beside the diagonal."""
    try:
        factors = splu(
            sparse.csc_matrix(K),
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:  # exactly singular
        return None
    symmetric = np.array_equal(factors.perm_r, factors.perm_c)
    return np.asarray(factors.U.diagonal()) if symmetric else None


def _nested_dissection(K: sparse.csr_matrix) -> npt.NDArray[np.int32]:
    """PETSc's ordering; those of SuperLU took twice as long in space."""
    start, columns = K.indptr.astype(PETSc.IntType), K.indices.astype(PETSc.IntType)
    data = K.data.astype(PETSc.ScalarType)
    matrix = PETSc.Mat().createAIJ(K.shape, csr=(start, columns, data), comm=PETSc.COMM_SELF)
    row, column = matrix.getOrdering(PETSc.Mat.OrderingType.ND)
    order = row.getIndices().copy()
    for owned in (row, column, matrix):
        owned.destroy()
    return np.asarray(order)
