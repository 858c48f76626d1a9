# SPDX-License-Identifier: MIT
"""Cells that cannot be computed with are refused, by their input number."""

from __future__ import annotations

from collections.abc import Sequence

import basix
import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh
from scipy import sparse

from fenics_hytf import _compat
from fenics_hytf.domain.grids import MeshData
from fenics_hytf.scene import Fault, SceneError


def refuse_tangled_cells(data: MeshData) -> None:
    """Raise where cells do not make a mesh: dolfinx would crash on them.

    Args:
        data: The mesh.

    Raises:
        SceneError: A cell that repeats a node, two cells of the same nodes, or more than two at one
            facet; names the first.
    """
    found = _tangle(data)
    if found:
        expected = "a mesh in which at most two cells meet at a facet; repair it in its generator"
        raise SceneError([Fault("mesh.file", found, expected)])


def _tangle(data: MeshData) -> str:
    """What is wrong with the way the cells hang together; empty if nothing is."""
    cell_type = getattr(basix.CellType, data.cell_type)
    corners = data.cells[:, : len(basix.geometry(cell_type))]
    ordered = np.sort(corners, axis=1)
    repeated = np.flatnonzero((np.diff(ordered, axis=1) == 0).any(axis=1))
    if len(repeated):
        return f"cell {repeated[0]} with a node twice"
    twins = _equal_rows(ordered, 2)
    if len(twins):
        return f"cells {' and '.join(map(str, twins))} of the same nodes"
    facets = np.array(basix.topology(cell_type)[-2])
    meeting = _equal_rows(np.sort(corners[:, facets].reshape(-1, facets.shape[1]), axis=1), 3)
    if len(meeting):
        return f"cells {', '.join(str(f // len(facets)) for f in meeting)} at one facet"
    return ""


def _equal_rows(rows: npt.NDArray[np.int64], count: int) -> npt.NDArray[np.int64]:
    """The first rows found of which ``count`` or more are alike, sorted; empty if none are."""
    order = np.lexsort(rows.T)
    starts = np.flatnonzero((rows[order[count - 1 :]] == rows[order[: 1 - count]]).all(axis=1))
    return np.sort(order[starts[0] : starts[0] + count]) if len(starts) else order[:0]


def loose_cells(data: MeshData, held: Sequence[str]) -> npt.NDArray[np.intp]:
    """Cells in parts of the mesh that no chain of shared nodes joins to a boundary.

    Args:
        data: The mesh.
        held: Names of the boundaries.

    Returns:
        Their input numbers, sorted.
    """
    num_nodes, width = len(data.points), data.cells.shape[1]
    ends = np.repeat(data.cells[:, 0], width - 1), data.cells[:, 1:].ravel()
    links = sparse.coo_array((np.ones(len(ends[0]), bool), ends), shape=(num_nodes, num_nodes))
    _, part = sparse.csgraph.connected_components(links, directed=False)
    joined = np.zeros(num_nodes, bool)
    for name in held:
        if name in data.facets:
            joined[data.facets[name].ravel()] = True
        else:
            axis, place = data.planes[name]
            off = np.abs(data.points[:, axis] - place)
            joined |= off <= 1e-12 * np.abs(data.points).max()
    return np.flatnonzero(~np.isin(part[data.cells[:, 0]], part[joined]))


def jacobian_determinants(mesh: Mesh, X: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Determinant of the Jacobian of every local cell.

    Args:
        mesh: The mesh.
        X: Reference coordinates, shape ``(num_points, tdim)``.

    Returns:
        [m^dim], shape ``(num_local_cells, num_points)``, ghosts included.
    """
    gradient = _compat.coordinate_element(mesh).tabulate(1, X)[1:, :, :, 0]
    nodes = mesh.geometry.x[_compat.geometry_dofmap(mesh)][:, :, : mesh.geometry.dim]
    return np.linalg.det(np.einsum("jpn,cni->cpij", gradient, nodes))


def refuse_inverted_cells(mesh: Mesh) -> None:
    """Raise where the Jacobian is not positive somewhere on a lattice over the cell.

    The lattice holds the vertices, which decide for linear simplices and bilinear quadrilaterals;
    elsewhere its spacing of a quarter cell is a practical test, not a proof.

    Args:
        mesh: The mesh.

    Raises:
        SceneError: On every rank, naming the first few cells of the input.
    """
    cell_type = getattr(basix.CellType, mesh.topology.cell_name())
    lattice = basix.create_lattice(cell_type, 4, basix.LatticeType.equispaced, True)
    num_owned = mesh.topology.index_map(mesh.topology.dim).size_local
    det = jacobian_determinants(mesh, lattice)[:num_owned]
    # A determinant below round-off of its own cell is no area at all.
    bad = np.flatnonzero(det.min(axis=1) <= 1e-14 * np.abs(det).max(axis=1, initial=0.0))
    found = [(int(mesh.topology.original_cell_index[c]), float(det[c].min())) for c in bad]
    everyone = sorted(item for part in mesh.comm.allgather(found) for item in part)
    if everyone:
        listed = ", ".join(f"{cell} ({value:.3g})" for cell, value in everyone[:5])
        text = f"{len(everyone)} cells with a non-positive Jacobian, by input cell: {listed}"
        expected = (
            "convex cells with counter-clockwise (3D: right-handed) nodes; repair them, or reverse "
            "the surface in the mesh generator"
        )
        raise SceneError([Fault("mesh", text, expected)])
