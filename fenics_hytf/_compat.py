# SPDX-License-Identifier: MIT
"""Names of dolfinx that change between versions, or are not public. Written for dolfinx 0.9."""

from __future__ import annotations

import basix
import dolfinx
import numpy as np
import numpy.typing as npt
from dolfinx.graph import adjacencylist
from dolfinx.io import distribute_entity_data
from dolfinx.mesh import (
    CellType,
    GhostMode,
    Mesh,
    create_cell_partitioner,
    meshtags_from_entities,
)


def vtk_permutation(cell_type: str, num_nodes: int) -> npt.NDArray[np.int64]:
    """Permutation that takes nodes in VTK's order to dolfinx's, shape ``(num_nodes,)``.

    ``cells[:, vtk_permutation(...)]`` are dolfinx cells where ``cells`` are VTK cells.
    """
    return np.asarray(dolfinx.cpp.io.perm_vtk(getattr(CellType, cell_type), num_nodes), np.int64)


def shared_facet_partitioner() -> object:
    """Partitioner that gives every rank the cells across its facets as ghosts."""
    return create_cell_partitioner(GhostMode.shared_facet)


def find_entities(mesh: Mesh, dim: int, nodes: npt.NDArray[np.int64]) -> npt.NDArray[np.int32]:
    """Local entities with the given input nodes.

    Args:
        mesh: The mesh; entities of dimension ``dim`` exist.
        dim: Their dimension.
        nodes: Input nodes of entities in dolfinx's order, shape ``(num_entities, n)``; each rank
            may hand over others.

    Returns:
        Local numbers, sorted.
    """
    values = np.zeros(len(nodes), np.int32)
    entities, values = distribute_entity_data(mesh, dim, nodes, values)
    tags = meshtags_from_entities(mesh, dim, adjacencylist(entities), values)
    return np.unique(tags.indices)


def geometry_dofmap(mesh: Mesh) -> npt.NDArray[np.int32]:
    """Geometry nodes of the local cells, shape ``(num_local_cells, nodes_per_cell)``."""
    return mesh.geometry.dofmap


def coordinate_element(mesh: Mesh) -> basix.finite_element.FiniteElement:
    """The scalar basix element whose shape functions map the cells of the mesh."""
    cmap = mesh.geometry.cmap
    return basix.create_element(
        basix.ElementFamily.P, mesh.basix_cell(), cmap.degree, basix.LagrangeVariant(cmap.variant)
    )


def geometry_degree(mesh: Mesh) -> int:
    """Degree of the cells' geometry."""
    return int(mesh.geometry.cmap.degree)
