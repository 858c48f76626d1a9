# SPDX-License-Identifier: MIT
"""Which cells are neighbours, and which nodes some cells have: what partial filling is told from.

Cells are told by their input number and tables hold the whole mesh on every rank, so that every
rank finds the same parts of it.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.fem import Function
from dolfinx.mesh import Mesh

from fenics_hytf.domain.domain import Domain


def facet_cells(mesh: Mesh) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Facets between two cells of this rank, ghosts included.

    Args:
        mesh: The mesh.

    Returns:
        Local facets, shape ``(n,)``, and the local cells on both sides, shape ``(n, 2)``.
    """
    tdim = mesh.topology.dim
    mesh.topology.create_entities(tdim - 1)
    mesh.topology.create_connectivity(tdim - 1, tdim)
    links = mesh.topology.connectivity(tdim - 1, tdim)
    inner = np.flatnonzero(np.diff(links.offsets) == 2).astype(np.int32)
    start = links.offsets[inner]
    return inner, links.array[start[:, None] + np.arange(2)]


def neighbours(domain: Domain) -> npt.NDArray[np.int64]:
    """Pairs of cells that share a facet (collective).

    Args:
        domain: The domain.

    Returns:
        Input numbers, the same on every rank, shape ``(num_inner_facets, 2)``, each pair once.
    """
    _, cells = facet_cells(domain.mesh)
    pairs = np.sort(domain.input_cells[cells], axis=1)
    return np.unique(np.concatenate(domain.comm.allgather(pairs)), axis=0)


def cells_at(domain: Domain, names: Iterable[str]) -> npt.NDArray[np.int64]:
    """Cells with a facet on some boundaries (collective).

    Args:
        domain: The domain.
        names: Names of the boundaries.

    Returns:
        Input numbers, sorted, the same on every rank.
    """
    tdim = domain.mesh.topology.dim
    domain.mesh.topology.create_connectivity(tdim - 1, tdim)
    links = domain.mesh.topology.connectivity(tdim - 1, tdim)
    facets = [facet for name in names for facet in domain.boundaries[name]]
    mine = domain.input_cells[[links.links(facet)[0] for facet in facets]]
    return np.unique(np.concatenate(domain.comm.allgather(mine)))


def bare_nodes(domain: Domain, filled: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Nodes that no filled cell has (collective).

    Args:
        domain: The domain.
        filled: Whether each cell is, in the order of the input, shape ``(num_cells,)``.

    Returns:
        At this rank's owned nodes, shape ``(num_owned_nodes,)``.
    """
    count = Function(domain.V)
    local = np.flatnonzero(filled[domain.input_cells[: domain.num_owned_cells]])
    size = domain.num_components
    count.x.array[domain.V.dofmap.list[local].ravel() * size] = 1.0
    count.x.scatter_reverse(la.InsertMode.add)
    owned = domain.V.dofmap.index_map.size_local
    return np.asarray(count.x.array[: owned * size : size].real == 0)
