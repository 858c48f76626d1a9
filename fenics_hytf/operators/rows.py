# SPDX-License-Identifier: MIT
"""Evaluation as sparse matrices: displacement and strain at sites, as rows over the nodes.

A site is a cell and a place in it: a receiver, a material point or a cell's centre. The rows come
from the same transfer matrices that weigh the points.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain

RealArray = npt.NDArray[np.float64]

NORMAL_STRAINS = {2: 0, 3: 2, 6: 3}
"""How many of so many Voigt components are normal ones; they come first."""


def displacement_rows(S: sparse.csr_matrix, num_components: int) -> sparse.csr_matrix:
    """Rows that evaluate the displacement.

    Args:
        S: Shape functions at the sites, shape ``(num_sites, num_local_nodes)``.
        num_components: Displacement components of a node.

    Returns:
        Shape ``(num_sites·num_components, num_local_nodes·num_components)``, components fastest.
    """
    return _interleave([[(component, S)] for component in range(num_components)], num_components)


def strain_rows(gradients: Sequence[sparse.csr_matrix], num_components: int) -> sparse.csr_matrix:
    """Rows that evaluate the strain in Voigt order: xx, yy, [zz, yz, xz,] xy, shear as γ = 2ε.

    A section that moves across its plane has the shears xz and yz.

    Args:
        gradients: ∂N/∂x_j at the sites [1/m], one matrix an axis, shape
            ``(num_sites, num_local_nodes)`` each.
        num_components: Displacement components of a node; 1 across a section.

    Returns:
        Shape ``(num_sites·num_strains, num_local_nodes·num_components)``, strain components
        fastest.
    """
    gdim = len(gradients)
    if num_components == 1:
        return _interleave([[(0, gradient)] for gradient in gradients], 1)
    pairs = [(i, i) for i in range(gdim)]
    pairs += [(1, 2), (0, 2), (0, 1)] if gdim == 3 else [(0, 1)]
    rows = [[(i, gradients[j]), (j, gradients[i])][: 1 + (i != j)] for i, j in pairs]
    return _interleave(rows, num_components)


def divergence_rows(gradients: Sequence[sparse.csr_matrix]) -> sparse.csr_matrix:
    """Rows that evaluate the trace of strain, of a displacement with a component an axis.

    Args:
        gradients: ∂N/∂x_j at the sites [1/m], one matrix an axis, shape
            ``(num_sites, num_local_nodes)`` each.

    Returns:
        Shape ``(num_sites, num_local_nodes·gdim)``, components fastest.
    """
    return _interleave([list(enumerate(gradients))], len(gradients))


def _interleave(
    rows: Sequence[Sequence[tuple[int, sparse.csr_matrix]]], num_components: int
) -> sparse.csr_matrix:
    """Rows of all sites, each kind of row a sum of matrices on some components.

    The matrices have the same places, as many in every row: the result's arrays are those of theirs
    side by side, which takes a tenth of the time of Kronecker products.
    """
    first = rows[0][0][1]
    num_sites, num_nodes = first.shape
    width = first.nnz // max(num_sites, 1)
    nodes = first.indices.reshape(num_sites, width)
    parts = [part for row in rows for part in row]
    values = np.stack([matrix.data.reshape(num_sites, width) for _, matrix in parts], axis=1)
    offsets = np.array([component for component, _ in parts], nodes.dtype)
    columns = num_components * nodes[:, None, :] + offsets[:, None]
    ends = width * np.cumsum([len(row) for row in rows])
    start = np.arange(num_sites)[:, None] * ends[-1] + np.concatenate([[0], ends[:-1]])
    return sparse.csr_matrix(
        (values.ravel(), columns.ravel(), np.append(start.ravel(), values.size)),
        shape=(num_sites * len(rows), num_nodes * num_components),
    )


def constrained_rows(domain: Domain, local: sparse.csr_matrix, T: PETSc.Mat) -> PETSc.Mat:
    """Express rows over this rank's nodes as rows over the unknowns, R T.

    Args:
        domain: The domain.
        local: Rows over local nodes, ghosts included, components fastest; each rank brings its own.
        T: Constraint matrix.

    Returns:
        Distributed matrix, this rank's rows first to last; the caller destroys it.
    """
    index_map, count = domain.V.dofmap.index_map, domain.num_components
    nodes = index_map.local_to_global(np.arange(index_map.size_local + index_map.num_ghosts))
    columns = (nodes[:, None] * count + np.arange(count)).ravel()
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
    # The product keeps what computing it again would take, a dense row of all unknowns.
    result = product.duplicate(copy=True)
    rows.destroy()
    product.destroy()
    return result


def evaluate(rows: PETSc.Mat, unknowns: RealArray) -> RealArray:
    """What rows make of a field at one instant (collective).

    Args:
        rows: Distributed matrix, real, a column an unknown.
        unknowns: This rank's, shape ``(num_local_unknowns,)``.

    Returns:
        This rank's rows, shape ``(num_local_rows,)``.
    """
    x, values = rows.createVecs()
    x.array[:] = unknowns
    rows.mult(x, values)
    found = values.array_r.real.copy()
    x.destroy()
    values.destroy()
    return np.asarray(found)


def split_rows(rows: PETSc.Mat, bounds: Sequence[int]) -> list[PETSc.Mat]:
    """Matrices of some rows each (collective).

    Args:
        rows: The rows of all of them.
        bounds: First of this rank's rows of each, and one after the last; as many on every rank.

    Returns:
        The matrices; the caller destroys them.
    """
    start, columns, values = rows.getValuesCSR()
    blocks = []
    for first, stop in pairwise(bounds):
        mine = slice(start[first], start[stop])
        blocks.append(
            PETSc.Mat().createAIJ(
                ((stop - first, None), (rows.getLocalSize()[1], None)),
                csr=(start[first : stop + 1] - start[first], columns[mine], values[mine]),
                comm=rows.comm,
            )
        )
    return blocks
