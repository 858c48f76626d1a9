# SPDX-License-Identifier: MIT
"""Evaluation as sparse matrices: displacement and strain at sites, as rows over the nodes.

A site is a cell and a place in it: a receiver, a material point or a cell's centre. The rows come
from the same transfer matrices that weigh the points.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain


def displacement_rows(S: sparse.csr_matrix, gdim: int) -> sparse.csr_matrix:
    """Rows that evaluate the displacement.

    Args:
        S: Shape functions at the sites, shape ``(num_sites, num_local_nodes)``.
        gdim: Space dimension.

    Returns:
        Shape ``(num_sites·gdim, num_local_nodes·gdim)``, components fastest.
    """
    return sparse.csr_matrix(sparse.kron(S, sparse.identity(gdim)))


def strain_rows(gradients: Sequence[sparse.csr_matrix]) -> sparse.csr_matrix:
    """Rows that evaluate the strain in Voigt order: xx, yy, [zz, yz, xz,] xy, shear as γ = 2ε.

    Args:
        gradients: ∂N/∂x_j at the sites [1/m], one matrix an axis, shape
            ``(num_sites, num_local_nodes)`` each.

    Returns:
        Shape ``(num_sites·num_strains, num_local_nodes·gdim)``, strain components fastest.
    """
    gdim = len(gradients)
    num_sites = gradients[0].shape[0]
    pairs = [(i, i) for i in range(gdim)]
    pairs += [(1, 2), (0, 2), (0, 1)] if gdim == 3 else [(0, 1)]
    parts = []
    for i, j in pairs:
        part = sparse.kron(gradients[j], _unit(i, gdim))
        if i != j:
            part = part + sparse.kron(gradients[i], _unit(j, gdim))
        parts.append(part)
    stacked = sparse.csr_matrix(sparse.vstack(parts))
    order = np.arange(len(pairs) * num_sites).reshape(len(pairs), num_sites).T.ravel()
    return stacked[order]


def _unit(component: int, gdim: int) -> sparse.csr_matrix:
    return sparse.csr_matrix(([1.0], ([0], [component])), shape=(1, gdim))


def constrained_rows(domain: Domain, local: sparse.csr_matrix, T: PETSc.Mat) -> PETSc.Mat:
    """Express rows over this rank's nodes as rows over the unknowns, R T.

    Args:
        domain: The domain.
        local: Rows over local nodes, ghosts included, components fastest; each rank brings its own.
        T: Constraint matrix.

    Returns:
        Distributed matrix, this rank's rows first to last; the caller destroys it.
    """
    index_map, gdim = domain.V.dofmap.index_map, domain.gdim
    nodes = index_map.local_to_global(np.arange(index_map.size_local + index_map.num_ghosts))
    columns = (nodes[:, None] * gdim + np.arange(gdim)).ravel()
    rows = PETSc.Mat().createAIJ(
        ((local.shape[0], None), (T.getLocalSize()[0], None)),
        csr=(
            local.indptr.astype(PETSc.IntType),
            columns[local.indices].astype(PETSc.IntType),
            local.data.astype(PETSc.ScalarType),
        ),
        comm=domain.comm,
    )
    rows.assemble()
    product = rows.matMult(T)
    rows.destroy()
    return product
