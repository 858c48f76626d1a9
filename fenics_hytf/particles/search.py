# SPDX-License-Identifier: MIT
"""Finding the cell of a point: a walk from where it was, then a tree of boxes.

A point starts in the cell that it was in before. Where its reference coordinates exceed a facet,
the search steps to the cell across the facet they exceed most. After a few cells, at the mesh's
boundary, and for points without a guess, it descends a binary tree of boxes over the cells in
Morton's order (Morton 1966), whose size is that of the mesh whatever its grading.

A point on a vertex, an edge or a facet lies in several cells, within the tolerances of
:mod:`fenics_hytf.particles.mapping`. Of these it belongs to the one with the lowest *input* index,
which does not depend on the guess nor on the number of ranks. Every rank therefore knows, besides
its own cells and ghosts, all cells of others that share a node with its own: exactly one rank
claims a point. (Ghost cells across facets do not suffice: two cells may meet in a vertex only.)
"""

from __future__ import annotations

import weakref

import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh
from mpi4py import MPI

from fenics_hytf import _compat
from fenics_hytf.particles import mapping
from fenics_hytf.particles.kernels import BoxTree, find_points

MORTON_BITS = {2: 31, 3: 20}  # a direction


class CellSearch:
    """Finds cells of points on one mesh. Making one is collective, searching is not.

    It keeps copies of what it needs: a mesh whose nodes have moved needs a new one.

    Attributes:
        input_index: Index in the input of every local cell, ghosts included, shape (n,).
        num_owned: Number of cells this rank owns; they come first.
    """

    def __init__(self, mesh: Mesh):
        """Gather the cells around this rank's, and build the tree.

        Args:
            mesh: Mesh of triangles, quadrilaterals, tetrahedra or hexahedra, geometry degree 1
                or 2.

        Raises:
            ValueError: A mesh without an inverse map; on every rank.
        """
        cell = mapping.mesh_cell(mesh)
        self._nodes = np.array(mesh.geometry.x, np.float64)
        self._dims = mesh.geometry.dim, mesh.topology.dim
        self.num_owned = mesh.topology.index_map(mesh.topology.dim).size_local
        self.input_index = np.asarray(mesh.topology.original_cell_index, np.int64).copy()
        corners = _compat.geometry_dofmap(mesh)[:, : cell.facets.max() + 1]
        self._neighbours = facet_neighbours(corners, cell.facets)

        self._maps, bounds = mapping.cell_maps(mesh)
        around, around_index = _cells_around(mesh, corners, self.num_owned, self.input_index)
        self._order = np.concatenate([self.input_index, around_index])
        if len(around):
            nodes = np.concatenate([mapping.cell_nodes(mesh), around])
            self._maps, bounds = mapping.build_maps(cell, nodes)
        self._tree = build_tree(bounds, self._dims[0])

    def fits(self, mesh: Mesh) -> bool:
        """Whether the mesh's nodes are where they were when the search was made."""
        return np.array_equal(self._nodes, mesh.geometry.x)

    def locate(
        self, x: npt.NDArray[np.float64], guess: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float64]]:
        """Find finite points; see :func:`locate`.

        Args:
            x: Points [m], shape (n, 3).
            guess: Local cells to start at, or -1, shape (n,).

        Raises:
            ValueError: A guess that is no local cell.
        """
        wrong = np.flatnonzero((guess < -1) | (guess >= len(self.input_index)))
        if len(wrong):
            raise ValueError(
                f"Found {guess[wrong[0]]} as the guess of point {wrong[0]}; expected -1 or a local "
                f"cell index below {len(self.input_index)}."
            )
        cells = np.empty(len(x), np.int32)
        X = np.empty((len(x), self._dims[1]))
        find_points(
            self._maps,
            self._tree,
            self._neighbours,
            self._order,
            self.num_owned,
            x,
            guess,
            cells,
            X,
        )
        return cells, X


_searches: weakref.WeakKeyDictionary[Mesh, CellSearch] = weakref.WeakKeyDictionary()


def cell_search(mesh: Mesh) -> CellSearch:
    """The search of a mesh, made on first use (collective) and kept as long as the mesh lives.

    Raises:
        ValueError: A mesh without an inverse map.
        RuntimeError: On several ranks, where the mesh's nodes have moved since.
    """
    search = _searches.get(mesh)
    if search is not None and not search.fits(mesh):
        if mesh.comm.size > 1:
            raise RuntimeError(
                "The mesh's nodes have moved since points were first located on it. Make a new "
                "CellSearch(mesh) on every rank and pass it as search=."
            )
        search = None
    if search is None:
        search = _searches[mesh] = CellSearch(mesh)
    return search


def locate(
    mesh: Mesh,
    x: npt.ArrayLike,
    guess: npt.ArrayLike | None = None,
    search: CellSearch | None = None,
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float64]]:
    """Find the owned cells and reference coordinates of points.

    On several ranks, exactly one rank claims a point of the mesh: called with the same point on all
    of them, one returns a cell and the others -1. The first call on a mesh builds its search and is
    collective; later ones are not.

    Args:
        mesh: Mesh of triangles, quadrilaterals, tetrahedra or hexahedra, geometry degree 1 or 2.
        x: Points [m], shape (n, gdim) or (n, 3).
        guess: Local cells (owned or ghosts) to start at, -1 for none, shape (n,). It changes the
            time taken, never the answer.
        search: Search to use, where the caller keeps one.

    Returns:
        cells: Local index of the owned cell that each point belongs to, -1 where it belongs to no
            cell of this rank, shape (n,).
        X: Coordinates in basix's reference cell, shape (n, tdim), not clipped; its centre where
            the cell is -1.

    Raises:
        ValueError: Points with coordinates that are not finite, with their rows; wrong shapes; a
            guess that is no local cell; a mesh without an inverse map.
        RuntimeError: See :func:`cell_search`.
    """
    if search is None:
        search = cell_search(mesh)  # collective on first use: before anything that one rank raises
    points = mapping.as_points(mesh, x)
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        rows = ", ".join(str(i) for i in bad[:10]) + (", …" if len(bad) > 10 else "")
        raise ValueError(
            f"Found {len(bad)} of {len(points)} points with coordinates that are not finite: point "
            f"{rows}. Expected finite coordinates [m]."
        )
    start = np.full(len(points), -1) if guess is None else mapping.as_cells(guess, len(points))
    return search.locate(points, start)


def resolve_owners(
    comm: MPI.Comm, candidates: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    """Agree on who owns each point of a list that is the same on every rank. Collective.

    Args:
        comm: Communicator.
        candidates: Input index of the cell in which this rank finds each point, or -1, shape (n,).

    Returns:
        The lowest input index that any rank found, and that rank, both -1 where none did, shape
        (n,).
    """
    nobody = np.iinfo(np.int64).max
    found = np.asarray(candidates, np.int64)
    key = np.where(found >= 0, found * comm.size + comm.rank, nobody)
    comm.Allreduce(MPI.IN_PLACE, key, MPI.MIN)
    lost = key == nobody
    index, rank = np.divmod(key, comm.size)
    return np.where(lost, -1, index), np.where(lost, -1, rank).astype(np.int32)


def facet_neighbours(
    corners: npt.NDArray[np.int32], facets: npt.NDArray[np.int64]
) -> npt.NDArray[np.int32]:
    """Cell across each facet.

    Args:
        corners: Vertex nodes of n cells, shape (n, num_vertices).
        facets: Vertices of each facet, shape (F, V).

    Returns:
        Neighbouring cells, -1 for none, shape (n, F).
    """
    neighbours = np.full((len(corners), len(facets)), -1, np.int32)
    keys = np.sort(corners[:, facets], axis=2).reshape(neighbours.size, facets.shape[1])
    order = np.lexsort(keys.T)
    same = (keys[order[1:]] == keys[order[:-1]]).all(axis=1)
    a, b = order[:-1][same], order[1:][same]
    neighbours.flat[a] = b // len(facets)
    neighbours.flat[b] = a // len(facets)
    return neighbours


def _cells_around(
    mesh: Mesh,
    corners: npt.NDArray[np.int32],
    num_owned: int,
    input_index: npt.NDArray[np.int64],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Other ranks' cells that share a vertex with a local cell and are no ghosts. Collective.

    Every rank sees all cells along all rank boundaries once, and keeps those next to it.

    Returns:
        Node coordinates [m], shape (m, N, 3), and input indices, shape (m,).
    """
    nodes, comm = mapping.cell_nodes(mesh), mesh.comm
    if comm.size == 1:
        return nodes[:0], input_index[:0]
    index_map = mesh.geometry.index_map()
    shared = np.unique(np.concatenate(comm.allgather(index_map.ghosts)))
    numbers = index_map.local_to_global(corners.astype(np.int32).ravel()).reshape(corners.shape)
    border = np.flatnonzero(np.isin(numbers[:num_owned], shared).any(axis=1))
    packets = comm.allgather((nodes[border], input_index[border], numbers[border]))
    all_nodes, all_index, all_numbers = (
        np.concatenate(part) for part in zip(*packets, strict=True)
    )
    keep = np.isin(all_numbers, numbers).any(axis=1) & ~np.isin(all_index, input_index)
    return all_nodes[keep], all_index[keep]


def build_tree(bounds: npt.NDArray[np.float64], gdim: int) -> BoxTree:
    """Tree over boxes, complete and balanced, its leaves in Morton's order of their centres.

    Args:
        bounds: Lowest and highest coordinates of n cells [m], shape (n, 6); a box of infinities
            the wrong way round is empty.
        gdim: Number of coordinates that differ.
    """
    filled = np.flatnonzero(np.isfinite(bounds).all(axis=1))
    centres = 0.5 * (bounds[filled, :gdim] + bounds[filled, 3 : 3 + gdim])
    order = filled[np.argsort(_morton(centres), kind="stable")]
    leaves = 1 << max(len(order) - 1, 0).bit_length()
    cells = np.full(leaves, -1, np.int64)
    cells[: len(order)] = order
    level = np.tile([np.inf] * 3 + [-np.inf] * 3, (leaves, 1))
    level[: len(order)] = bounds[order]
    levels = [level]
    while len(level) > 1:
        low = np.minimum(level[0::2, :3], level[1::2, :3])
        high = np.maximum(level[0::2, 3:], level[1::2, 3:])
        level = np.concatenate([low, high], axis=1)
        levels.append(level)
    return BoxTree(boxes=np.concatenate(levels[::-1]), cells=cells)


def _morton(x: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Place of points, shape (n, dim), on Morton's curve: bits of the coordinates interleaved."""
    dim = x.shape[1]
    bits = MORTON_BITS[dim]
    code = np.zeros(len(x), np.int64)
    if len(x):
        span = np.ptp(x, axis=0).max()
        whole = ((x - x.min(axis=0)) / (span if span > 0 else 1.0) * (2**bits - 1)).astype(np.int64)
        for bit in range(bits):
            for axis in range(dim):
                code |= ((whole[:, axis] >> bit) & 1) << (bit * dim + axis)
    return code
