# SPDX-License-Identifier: MIT
"""Newton's inverse mapping: the reference coordinates of points in given cells.

The reference coordinates ξ of a point x in a cell with nodes X_i solve (paper, eq. 7)

    g(ξ) = Σ N_i(ξ) X_i - x = 0.

The paper's eq. (8) reads r_{j+1} - r_j = -J g, without the inverse, and its eq. (9) writes the
transpose of the Jacobian. The scheme that works, and that is used here, is

    J δ = -g,   J_ab = ∂g_a/∂ξ_b,   ξ ← ξ + t δ,

started at the cell's centre and damped: from a vertex, or undamped, Newton's method finds roots
outside the cell for points inside it. It runs in coordinates normalised by the Jacobian at the
centre (see :mod:`fenics_hytf.particles.kernels`), in which cells of any size, place, orientation
and aspect ratio are alike: an affine cell takes one iteration, a distorted one four or five.

Triangles, quadrilaterals, tetrahedra and hexahedra of geometry degree 1 and 2, in a space of their
own dimension. Two tolerances decide whether a point is inside:

- 10⁻¹² of the cell's size: a thousand times the rounding of the normalised map, and far less than
  a point moves in any step;
- eight units of rounding of the coordinates themselves, eps·|x| over the cell's size: a point four
  units in the last place outside a face cannot be told from one on it.
"""

from __future__ import annotations

import itertools
import math
import weakref
from dataclasses import dataclass
from functools import cache

import basix
import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh

from fenics_hytf import _compat
from fenics_hytf.particles.kernels import CellMaps
from fenics_hytf.particles.kernels import map_points as _map_points

SIZE_TOLERANCE = 1e-12  # of the cell's size
ULP_TOLERANCE = 8.0 * float(np.finfo(np.float64).eps)  # of the coordinates
MARGIN = 1e-5  # around a cell's boxes: wider than any tolerance, narrow enough to cost nothing
SINGULAR = 1e-12  # sine of the angle between the columns of J_c below which a cell has no map
STARTS = 0.75  # further starts lie this far from the centre towards the nodes


@dataclass(frozen=True)
class ReferenceCell:
    """What all cells of one type and geometry degree share; N nodes, F facets of V vertices.

    Attributes:
        name: basix's name of the cell type.
        degree: Geometry degree, 1 or 2.
        centre: Midpoint of the vertices, shape (tdim,).
        to_monomials: Takes node values to coefficients of the monomials of ξ - centre, shape
            (N, N); the first is the constant one, the next tdim are the linear ones.
        exponents: Exponents of the other monomials, shape (N - 1 - tdim, 3).
        to_bernstein: Takes node values to Bernstein coefficients, shape (N, N), whose box holds
            the cell, as the nodes' box does not where a cell is curved.
        facets: Vertices of each facet, shape (F, V).
        bounds: With η = ξ - centre, the cell is {b_0 η_0 + b_1 η_1 + b_2 η_2 <= b_3 for every row
            b}, the outward normals scaled to entries of size one, shape (F, 4).
        starts: Further starting points of ξ - centre for cells whose map is not one to one on the
            side det J > 0, shape (S, 3).
    """

    name: str
    degree: int
    centre: npt.NDArray[np.float64]
    to_monomials: npt.NDArray[np.float64]
    exponents: npt.NDArray[np.int64]
    to_bernstein: npt.NDArray[np.float64]
    facets: npt.NDArray[np.int64]
    bounds: npt.NDArray[np.float64]
    starts: npt.NDArray[np.float64]


@cache
def reference_cell(name: str, degree: int) -> ReferenceCell:
    """Tables of a cell type.

    Args:
        name: "triangle", "quadrilateral", "tetrahedron" or "hexahedron".
        degree: Geometry degree, 1 or 2.

    Raises:
        ValueError: Another cell type or degree.
    """
    known = ("triangle", "quadrilateral", "tetrahedron", "hexahedron")
    if name not in known or degree not in (1, 2):
        raise ValueError(
            f"Found {name} cells of geometry degree {degree}; points can be located in "
            f"{', '.join(known)} cells of degree 1 or 2. Mesh with one of these."
        )
    cell = basix.CellType[name]
    simplex = name in ("triangle", "tetrahedron")
    vertices = np.asarray(basix.geometry(cell), np.float64)
    tdim = vertices.shape[1]
    centre = vertices.mean(axis=0)
    variant = basix.LagrangeVariant.gll_warped
    element = basix.create_element(basix.ElementFamily.P, cell, degree, variant)
    nodes = np.asarray(element.points, np.float64)

    powers = _powers(tdim, degree, simplex)
    monomials = ((nodes - centre)[:, None] ** powers).prod(axis=2)
    exponents = np.zeros((len(powers) - 1 - tdim, 3), np.int64)
    exponents[:, :tdim] = powers[1 + tdim :]

    facets = np.array(basix.topology(cell)[tdim - 1], np.int64)
    normals = np.asarray(basix.cell.facet_outward_normals(cell), np.float64)
    normals = normals / np.abs(normals).max(axis=1, keepdims=True)
    offsets = np.einsum("fd,fd->f", normals, vertices[facets[:, 0]] - centre)
    starts = np.zeros((0, tdim))
    if len(exponents) > 1:  # neither affine nor bilinear: see kernels
        starts = STARTS * (nodes - centre)
        starts = starts[np.abs(starts).max(axis=1) > 0]
    return ReferenceCell(
        name=name,
        degree=degree,
        centre=centre,
        to_monomials=np.linalg.inv(monomials),
        exponents=exponents,
        to_bernstein=np.linalg.inv(_bernstein(nodes, degree, simplex)).astype(np.float64),
        facets=facets,
        bounds=np.column_stack([_in_space(normals), offsets]),
        starts=_in_space(starts),
    )


def _powers(tdim: int, degree: int, simplex: bool) -> npt.NDArray[np.int64]:
    """Exponents of an element's monomials, shape (N, tdim): constant, linear, the others."""
    every = itertools.product(range(degree + 1), repeat=tdim)
    powers = [p for p in every if not simplex or sum(p) <= degree]
    powers.sort(key=lambda p: (sum(p) > 0, sum(p) > 1, [-q for q in p]))
    return np.array(powers, np.int64)


def _bernstein(x: npt.NDArray[np.float64], degree: int, simplex: bool) -> npt.NDArray[np.float64]:
    """Bernstein polynomials at points x, shape (n, tdim), on a simplex or the unit cube."""
    if not simplex and x.shape[1] > 1:
        first = _bernstein(x[:, :1], degree, True)
        rest = _bernstein(x[:, 1:], degree, x.shape[1] == 2)
        return (first[:, :, None] * rest[:, None, :]).reshape(len(x), -1)
    barycentric = np.column_stack([1.0 - x.sum(axis=1), x])
    columns = []
    for a in itertools.product(range(degree + 1), repeat=barycentric.shape[1]):
        if sum(a) == degree:
            ways = math.factorial(degree) // math.prod(math.factorial(k) for k in a)
            columns.append(ways * np.prod(barycentric**a, axis=1))
    return np.column_stack(columns)


def _in_space(x: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The rows of x, shape (…, dim), with zeros up to three entries."""
    return np.concatenate([x, np.zeros((*x.shape[:-1], 3 - x.shape[-1]))], axis=-1)


def build_maps(
    cell: ReferenceCell, nodes: npt.NDArray[np.float64]
) -> tuple[CellMaps, npt.NDArray[np.float64]]:
    """Normalised maps of cells, and boxes that hold the cells.

    Args:
        cell: Their type.
        nodes: Node coordinates of n cells [m], shape (n, N, 3).

    Returns:
        The maps, and the lowest and highest coordinates of each cell [m], shape (n, 6), padded by
        more than any tolerance; a cell without a map has a box that nothing is in.
    """
    tdim = cell.centre.size
    origin = nodes[:, 0]
    relative = nodes - origin[:, None]  # no rounding to speak of: neighbouring numbers
    monomials = cell.to_monomials @ relative
    jacobian = np.zeros((len(nodes), 3, 3))
    jacobian[:] = np.eye(3)
    jacobian[:, :tdim, :tdim] = np.swapaxes(monomials[:, 1 : 1 + tdim, :tdim], 1, 2)
    inverse, regular = _invert(jacobian)

    largest = np.abs(nodes).max(axis=1, initial=0.0)
    rounding = np.einsum("nij,nj->ni", np.abs(inverse), largest).max(axis=1, initial=0.0)
    tolerance = SIZE_TOLERANCE + ULP_TOLERANCE * rounding
    shift = np.einsum("nij,nj->ni", inverse, monomials[:, 0])
    control = cell.to_bernstein @ relative
    image = np.einsum("nij,nkj->nki", inverse, control) - shift[:, None]
    pad = (MARGIN + 32.0 * tolerance)[:, None]
    box = np.stack([image.min(axis=1) - pad, image.max(axis=1) + pad], axis=1)
    pad = pad * np.abs(jacobian).sum(axis=2)
    bounds = np.concatenate(
        [origin + control.min(axis=1) - pad, origin + control.max(axis=1) + pad], axis=1
    )
    for boxes in (box.reshape(-1, 6), bounds):
        boxes[~regular] = [np.inf] * 3 + [-np.inf] * 3
    maps = CellMaps(
        frames=np.concatenate([origin[:, None], inverse, shift[:, None]], axis=1),
        coefficients=np.einsum("nij,nkj->nki", inverse, monomials[:, 1 + tdim :], order="C"),
        boxes=box,
        tolerances=np.where(regular, tolerance, 0.0),
        exponents=cell.exponents,
        facets=cell.bounds,
        starts=cell.starts,
        centre=_in_space(cell.centre),
    )
    return maps, bounds


def _invert(
    jacobian: npt.NDArray[np.float64],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.bool_]]:
    """Inverses of matrices, shape (n, 3, 3), and where they exist; 0 where not."""
    c0, c1, c2 = (jacobian[:, :, k] for k in range(3))
    rows = np.stack([np.cross(c1, c2), np.cross(c2, c0), np.cross(c0, c1)], axis=1)
    det = np.einsum("ni,ni->n", c0, rows[:, 0])
    sizes = np.linalg.norm(jacobian, axis=1).prod(axis=1)
    regular = np.abs(det) > SINGULAR * sizes  # False for NaN as well
    det = np.where(regular, det, 1.0)
    return np.where(regular[:, None, None], rows / det[:, None, None], 0.0), regular


def mesh_cell(mesh: Mesh) -> ReferenceCell:
    """Reference cell of a mesh.

    Raises:
        ValueError: A cell type or degree without an inverse map, or a mesh embedded in a space of
            higher dimension.
    """
    tdim, gdim = mesh.topology.dim, mesh.geometry.dim
    if tdim != gdim:
        raise ValueError(
            f"Found a mesh of dimension {tdim} in a space of dimension {gdim}; a point has "
            "coordinates in a cell only where the two are equal."
        )
    return reference_cell(mesh.topology.cell_name(), _compat.geometry_degree(mesh))


def cell_nodes(mesh: Mesh) -> npt.NDArray[np.float64]:
    """Node coordinates of the local cells, ghosts included [m], shape (n, N, 3)."""
    return np.asarray(mesh.geometry.x, np.float64)[_compat.geometry_dofmap(mesh)]


@dataclass(frozen=True)
class _Entry:
    """Maps of a mesh's local cells, with their boxes and the nodes they were made from."""

    nodes: npt.NDArray[np.float64]
    maps: CellMaps
    bounds: npt.NDArray[np.float64]


_entries: weakref.WeakKeyDictionary[Mesh, _Entry] = weakref.WeakKeyDictionary()


def cell_maps(mesh: Mesh) -> tuple[CellMaps, npt.NDArray[np.float64]]:
    """Maps and boxes of a mesh's local cells as :func:`build_maps` gives them, kept with the mesh.

    They are made again where the mesh's nodes have moved since.
    """
    entry = _entries.get(mesh)
    if entry is None or not np.array_equal(entry.nodes, mesh.geometry.x):
        nodes = np.array(mesh.geometry.x, np.float64)
        entry = _Entry(nodes, *build_maps(mesh_cell(mesh), cell_nodes(mesh)))
        _entries[mesh] = entry
    return entry.maps, entry.bounds


def as_points(mesh: Mesh, x: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Points as the kernels take them, shape (n, 3), from shape (n, gdim) or (n, 3).

    Raises:
        ValueError: Another shape.
    """
    gdim = mesh.geometry.dim
    points = np.asarray(x, np.float64)
    if points.ndim != 2 or points.shape[1] not in (gdim, 3):
        raise ValueError(f"Found points of shape {points.shape}; expected (n, {gdim}) or (n, 3).")
    result = np.zeros((len(points), 3))
    result[:, :gdim] = points[:, :gdim]
    return result


def as_cells(cells: npt.ArrayLike, num_points: int) -> npt.NDArray[np.int64]:
    """Cell indices as the kernels take them, shape (n,).

    Raises:
        ValueError: Not one cell a point, or not integers.
    """
    indices = np.asarray(cells)
    if indices.shape != (num_points,) or not (
        num_points == 0 or np.issubdtype(indices.dtype, np.integer)
    ):
        raise ValueError(
            f"Found cells of shape {indices.shape} and type {indices.dtype} for {num_points} "
            f"points; expected integers of shape ({num_points},)."
        )
    return np.ascontiguousarray(indices, np.int64)


def map_points(
    mesh: Mesh, x: npt.ArrayLike, cells: npt.ArrayLike
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int8], npt.NDArray[np.int32]]:
    """Reference coordinates of points in given cells, and what they cost.

    Args:
        mesh: Mesh.
        x: Points [m], shape (n, gdim) or (n, 3).
        cells: Local cell of each point, shape (n,).

    Returns:
        X and status as :func:`inverse_map` returns them, and the number of Newton iterations,
        shape (n,).

    Raises:
        ValueError: Arrays of the wrong shape, or a mesh without an inverse map.
    """
    points = as_points(mesh, x)
    indices = as_cells(cells, len(points))
    maps, _ = cell_maps(mesh)
    X = np.empty((len(points), mesh.topology.dim))
    status = np.empty(len(points), np.int8)
    iterations = np.empty(len(points), np.int32)
    _map_points(maps, points, indices, X, status, iterations)
    return X, status, iterations


def inverse_map(
    mesh: Mesh, x: npt.ArrayLike, cells: npt.ArrayLike
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int8]]:
    """Reference coordinates of points in given cells. Never raises for a point.

    Args:
        mesh: Mesh of triangles, quadrilaterals, tetrahedra or hexahedra, geometry degree 1 or 2.
        x: Points [m], shape (n, gdim) or (n, 3).
        cells: Local cell of each point, shape (n,).

    Returns:
        X: Coordinates in basix's reference cell, shape (n, tdim), never NaN and never clipped. Of
            a point outside: the preimage outside the cell, or some place where there is none.
        status: Shape (n,). 0: inside, within the tolerances of this module. 1: outside. 2: unknown:
            a coordinate that is not finite, no such cell, a cell with a singular map, or Newton's
            method did not converge from any start.

    Raises:
        ValueError: Arrays of the wrong shape, or a mesh without an inverse map.
    """
    X, status, _ = map_points(mesh, x, cells)
    return X, status
