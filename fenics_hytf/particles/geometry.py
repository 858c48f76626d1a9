# SPDX-License-Identifier: MIT
"""The map from reference to physical cells, x(X) = sum_i N_i(X) X_i, and its Jacobian.

Its inverse, eq. (7) of the paper, is another module's; here X is known.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh

from fenics_hytf._compat import coordinate_element, geometry_dofmap

RealArray = npt.NDArray[np.float64]

_CHUNK = 16384  # points tabulated at once: the tables stay in the cache


def chunks(num_points: int) -> Iterator[slice]:
    """Consecutive slices that cover ``num_points`` points and keep tables small."""
    return (slice(i, min(i + _CHUNK, num_points)) for i in range(0, num_points, _CHUNK))


def jacobians(mesh: Mesh, cells: npt.NDArray[np.int32], X: RealArray) -> RealArray:
    """Jacobian of the map of a cell at a point of it.

    Args:
        mesh: Mesh.
        cells: Local cell of each point, shape ``(n,)``.
        X: Reference coordinates, shape ``(n, tdim)``.

    Returns:
        ``J[p, i, j] = d x_i / d X_j`` [m], shape ``(n, gdim, tdim)``.
    """
    element = coordinate_element(mesh)
    derivatives = np.asarray(element.tabulate(1, X))[1:, :, :, 0]
    nodes = mesh.geometry.x[geometry_dofmap(mesh)[cells], : mesh.geometry.dim]
    return np.einsum("jpa,pai->pij", derivatives, nodes)


def cell_grid(
    mesh: Mesh, cells: npt.NDArray[np.int32], X: RealArray
) -> tuple[RealArray, RealArray]:
    """Map the same reference points into many cells.

    Args:
        mesh: Mesh.
        cells: Local cells, shape ``(num_cells,)``.
        X: Reference coordinates, shape ``(q, tdim)``.

    Returns:
        Positions [m], shape ``(num_cells, q, gdim)``, and the absolute value of det J there
        [m^tdim], shape ``(num_cells, q)``.
    """
    table = np.asarray(coordinate_element(mesh).tabulate(1, X))[:, :, :, 0]
    nodes = mesh.geometry.x[geometry_dofmap(mesh)[cells], : mesh.geometry.dim]
    x = np.einsum("qa,cai->cqi", table[0], nodes)
    J = np.einsum("jqa,cai->cqij", table[1:], nodes)
    return x, np.abs(np.linalg.det(J))
