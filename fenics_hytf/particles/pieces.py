# SPDX-License-Identifier: MIT
"""Pieces: the soil that a point stands for has a size, and lies in more cells than its own.

Counted by the cell that holds the point, the filling of a cell goes in steps of a point's volume,
and where a flow draws rows of points out, four rows may lie in a cell and three in the next, while
the soil is no denser. What fills cells is pieces: parallelograms, or parallelepipeds, with the
point somewhere in them, which ride the flow as it is at the point (the convected domains of
Sadeghirad, Brannon and Burghardt 2011). At the start they tile the cells. A piece is kept as its
edges and the way from the point to its middle, the columns of a matrix P,

    P ← exp(L) P,    L = ∂Δu/∂x
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh

from fenics_hytf.particles.geometry import RealArray, chunks, jacobians
from fenics_hytf.particles.kinematics import exponentials
from fenics_hytf.particles.move import show_to_all
from fenics_hytf.particles.points import IntArray, Points, quadrature_rule
from fenics_hytf.particles.search import cell_search, locate

_PARTS = 64  # of a piece; with them the filling of a cell is off by 1 or 2 % of it
_ALMOST = 1 - 1e-6  # pieces that tile cells share their corners


def first_pieces(mesh: Mesh, points: Points, points_per_cell: int) -> RealArray:
    """Pieces of points where they were seeded.

    Of quadrilaterals and hexahedra they are the boxes whose sides are the weights of the rule, and
    tile the cell where it is a parallelogram; of simplices, squares and cubes about the points.

    Args:
        mesh: The mesh.
        points: The points.
        points_per_cell: How many each cell was seeded with.

    Returns:
        P [m], shape ``(len(points), gdim, gdim + 1)``.
    """
    gdim = mesh.geometry.dim
    pieces = np.zeros((len(points), gdim, gdim + 1))
    if mesh.topology.cell_name() not in ("quadrilateral", "hexahedron"):
        pieces[:, :, :gdim] = np.multiply.outer(points.volume ** (1 / gdim), np.eye(gdim))
        return pieces
    edges, middle = _boxes(*quadrature_rule(mesh.topology.cell_name(), points_per_cell))
    number = points.id % points_per_cell
    for chunk in chunks(len(points)):
        X, which = points.X[chunk], number[chunk]
        J = jacobians(mesh, points.cell[chunk], X)
        pieces[chunk, :, :gdim] = J * edges[which, None]
        pieces[chunk, :, gdim] = np.einsum("pij,pj->pi", J, middle[which] - X)
    return pieces


def _boxes(X: RealArray, w: RealArray) -> tuple[RealArray, RealArray]:
    """Edges and middles of the boxes of a product rule, in the reference cell."""
    apart = X[:, None] - X[None]
    same = np.abs(apart) < 1e-9
    edges = np.einsum("qri,r->qi", same, w)
    below = np.einsum("qri,r->qi", (apart > 0) & ~same, w)
    return edges, below + 0.5 * edges


def carry_pieces(points: Points, gradient: RealArray) -> None:
    """Carry pieces through an increment.

    Args:
        points: Points with pieces, changed in place.
        gradient: L[p, i, j] = d du_i / d x_j [-], shape ``(n, gdim, gdim)``.
    """
    for chunk in chunks(len(points)):
        points["piece"][chunk] = exponentials(gradient[chunk]) @ points["piece"][chunk]


def piece_integrals(mesh: Mesh, points: Points, values: RealArray) -> RealArray:
    """Integrals over cells of what pieces bring into them (collective).

    A piece with all its corners in the cell of its point lies there; others are counted in parts,
    those of them that lie outside the mesh to the cell of the point.

    Args:
        mesh: The mesh.
        points: Points with pieces.
        values: Of each point, shape ``(len(points), k)``; ones for the volume of the soil.

    Returns:
        Over owned cells [m^3 or m^2 times the unit of the values], shape ``(num_owned_cells, k)``.
    """
    cell_search(mesh)
    total = np.zeros((mesh.topology.index_map(mesh.topology.dim).size_local, values.shape[1]))
    strays = []
    whole = _within(mesh, points)
    np.add.at(total, points.cell[whole], points.volume[whole, None] * values[whole])
    for x, amount, home in _parts(points, values, np.flatnonzero(~whole)):
        cells, _ = locate(mesh, x, home)
        found = cells >= 0
        np.add.at(total, cells[found], amount[found])
        strays.append((x[~found], amount[~found], home[~found]))
    x, amount, home = (np.concatenate(parts) for parts in zip(*strays, strict=True))
    owner, cells, _, own = show_to_all(mesh, x)
    shown, mine = np.concatenate(mesh.comm.allgather(amount)), owner == mesh.comm.rank
    np.add.at(total, cells[mine], shown[mine])
    outside = owner[own] < 0
    np.add.at(total, home[outside], amount[outside])
    return total


def _within(mesh: Mesh, points: Points) -> npt.NDArray[np.bool_]:
    """Which pieces have all their corners in the cell of their point."""
    gdim = points.x.shape[1]
    corners = _ALMOST * np.array(list(product((-0.5, 0.5), repeat=gdim)))
    whole = np.zeros(len(points), bool)
    for chunk in chunks(len(points)):
        x, home = _places(points, np.arange(len(points))[chunk], corners)
        cells, _ = locate(mesh, x, home)
        whole[chunk] = (cells == home).reshape(-1, len(corners)).all(axis=1)
    return whole


def _parts(
    points: Points, values: RealArray, some: npt.NDArray[np.intp]
) -> Iterator[tuple[RealArray, RealArray, IntArray]]:
    """Middles of parts of equal volume, value times volume, and the cells of their points."""
    evenly = _evenly(_PARTS, points.x.shape[1]) - 0.5
    for chunk in chunks(max(len(some), 1)):
        which = some[chunk]
        amount = points.volume[which, None] / _PARTS * values[which]
        x, home = _places(points, which, evenly)
        yield x, np.repeat(amount, _PARTS, axis=0), home


def _places(
    points: Points, some: npt.NDArray[np.intp], within: RealArray
) -> tuple[RealArray, IntArray]:
    """Places in the pieces of some points, one piece after the other, and their points' cells."""
    places = np.column_stack([within, np.ones(len(within))])
    x = points.x[some, None] + np.swapaxes(points["piece"][some] @ places.T, 1, 2)
    return x.reshape(-1, within.shape[1]), np.repeat(points.cell[some], len(within))


def _evenly(count: int, dim: int) -> npt.NDArray[np.float64]:
    """Places spread evenly over the unit cube, no two in a row (Roberts 2018), (count, dim).

    A grid would have rows, of which a cell holds one more or less.
    """
    root = 2.0
    for _ in range(50):  # of x^(dim+1) = x + 1
        root = (1 + root) ** (1 / (dim + 1))
    steps = root ** -np.arange(1.0, dim + 1)
    return (0.5 + np.outer(np.arange(1, count + 1), steps)) % 1
