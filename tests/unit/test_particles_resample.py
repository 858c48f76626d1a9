# SPDX-License-Identifier: MIT
"""Values of points read elsewhere in their cells: what is kept exactly, and with how few points."""

from itertools import product

import basix
import numpy as np
import pytest
from dolfinx.mesh import CellType, GhostMode, Mesh, create_unit_cube, create_unit_square
from mpi4py import MPI

from fenics_hytf.particles import Points, Sites, cell_centres, resample_matrix, seed
from fenics_hytf.particles.points import take
from fenics_hytf.scene import default_points_per_cell

WORLD = MPI.COMM_WORLD
CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
SIMPLICES = ("triangle", "tetrahedron")
ROUND_OFF = 1e-13


def distorted(cell: str) -> Mesh:
    """Cells of the unit square or cube, their inner corners moved."""
    ghosts = {"cell_type": CellType[cell], "ghost_mode": GhostMode.shared_facet}
    flat = cell in ("triangle", "quadrilateral")
    mesh = (
        create_unit_square(WORLD, 4, 3, **ghosts)
        if flat
        else create_unit_cube(WORLD, 2, 3, 2, **ghosts)
    )
    x, gdim = mesh.geometry.x, mesh.geometry.dim
    bump = np.prod(np.sin(np.pi * x[:, :gdim]), axis=1)
    x[:, 0] += 0.08 * bump
    x[:, 1] -= 0.05 * bump
    return mesh


def num_owned(mesh: Mesh) -> int:
    return mesh.topology.index_map(mesh.topology.dim).size_local


def seeded(mesh: Mesh, degree: int) -> Points:
    """As many points as a scene has by default: on the Gauss points of the stiffness."""
    cell = mesh.topology.cell_name()
    regions = np.zeros(num_owned(mesh), np.int32)
    return seed(mesh, regions, [1800.0], default_points_per_cell(cell, degree))


def moved(mesh: Mesh, points: Points, together: float, apart: float) -> Points:
    """The points, drawn to a random place of their cell and to one each by a share of the way."""
    rng = np.random.default_rng(mesh.comm.rank)
    common = random_places(mesh, num_owned(mesh), rng)[points.cell]
    points.X = (1 - together) * points.X + together * common
    points.X = (1 - apart) * points.X + apart * random_places(mesh, len(points), rng)
    return points


def random_places(mesh: Mesh, count: int, rng: np.random.Generator) -> np.ndarray:
    tdim = mesh.topology.dim
    if mesh.topology.cell_name() in SIMPLICES:
        return rng.dirichlet(np.ones(tdim + 1), count)[:, 1:]
    return rng.random((count, tdim))


def sites(mesh: Mesh, per_cell: int = 5) -> Sites:
    cells = np.repeat(np.arange(num_owned(mesh), dtype=np.int32), per_cell)
    return Sites(cells, random_places(mesh, len(cells), np.random.default_rng(7)))


def polynomial(mesh: Mesh, degree: int, cell: np.ndarray, X: np.ndarray) -> np.ndarray:
    """One of random coefficients for each cell, of the displacement's kind in its coordinates."""
    powers = [p for p in product(range(degree + 1), repeat=X.shape[1])]
    if mesh.topology.cell_name() in SIMPLICES:
        powers = [p for p in powers if sum(p) <= degree]
    c = np.random.default_rng(3).normal(size=(num_owned(mesh), len(powers)))
    terms = np.stack([np.prod(X**p, axis=1) for p in powers], axis=1)
    return np.sum(c[cell] * terms, axis=1)


def error(mesh: Mesh, points: Points, degree: int, places: Sites, field) -> float:
    """Of what is read at the places, over the largest value there."""
    R = resample_matrix(mesh, points, degree, places)
    assert R.shape == (len(places), len(points))
    expected = field(places.cell, places.X)
    return float(np.abs(R @ field(points.cell, points.X) - expected).max() / np.abs(expected).max())


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_polynomials_are_reproduced(cell, degree, figure):
    mesh = distorted(cell)

    def field(cells, X):
        return polynomial(mesh, degree, cells, X)

    places = (sites(mesh), cell_centres(mesh, 0, num_owned(mesh)))
    worst = 0.0
    for together, apart in ((0.0, 0.0), (0.1, 0.0), (0.0, 0.1)):
        points = moved(mesh, seeded(mesh, degree), together, apart)
        worst = max(worst, *(error(mesh, points, degree, where, field) for where in places))
    name = f"polynomials from points, {cell}, degree {degree}"
    figure(name, WORLD.allreduce(worst, MPI.MAX), ROUND_OFF)


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_points_at_gauss_points_are_read_back(cell, degree):
    mesh = distorted(cell)
    X, _ = basix.make_quadrature(basix.CellType[cell], 2 * degree)
    cells = np.arange(num_owned(mesh), dtype=np.int32)
    gauss = Sites(np.repeat(cells, len(X)), np.tile(X, (len(cells), 1)))
    points = seeded(mesh, degree)
    np.testing.assert_array_equal(points.X, gauss.X)
    R = resample_matrix(mesh, points, degree, gauss)
    terms = basix.create_element(basix.ElementFamily.P, basix.CellType[cell], degree).dim
    if len(X) == terms:
        order = np.argsort(points.cell, kind="stable")  # points are in the order of the input
        np.testing.assert_allclose(R[:, order].toarray(), np.eye(len(points)), atol=ROUND_OFF)
    else:  # more points than terms, of tetrahedra of degree 2: read back it is the same again
        assert (cell, degree) == ("tetrahedron", 2)
        values = polynomial(mesh, degree, points.cell, points.X)
        at_gauss = polynomial(mesh, degree, gauss.cell, gauss.X)
        np.testing.assert_allclose(R @ values, at_gauss, atol=ROUND_OFF * np.abs(values).max())


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("left", [1, 2, 3])
def test_of_few_points_a_constant_is_kept(cell, degree, left):
    """Cell by cell the constant and no more than what the points tell."""
    mesh = distorted(cell)
    points = moved(mesh, seeded(mesh, degree), 0.0, 0.5)
    in_cell = points.id % default_points_per_cell(cell, degree)
    points.assign(take(points.arrays(), in_cell < left))
    R = resample_matrix(mesh, points, degree, sites(mesh))
    np.testing.assert_allclose(np.asarray(R.sum(axis=1)).ravel(), 1.0, atol=ROUND_OFF)
    if left == 1:
        np.testing.assert_allclose(R.data, 1.0, atol=ROUND_OFF)
    # Nothing is extrapolated from terms that are hardly seen.
    assert abs(R).sum(axis=1).max() < 30


def test_what_points_in_a_line_do_not_tell_is_left_out():
    mesh = create_unit_square(MPI.COMM_SELF, 2, 2, CellType.quadrilateral)
    points = seeded(mesh, 1)
    first = points.id % 4 < 2
    points.assign(take(points.arrays(), first))
    points.X = np.tile([[0.2, 0.5], [0.8, 0.5]], (4, 1))
    places = sites(mesh)
    R = resample_matrix(mesh, points, 1, places)
    np.testing.assert_allclose(R @ points.X[:, 0], places.X[:, 0], atol=ROUND_OFF)
    np.testing.assert_allclose(R @ points.X[:, 1], 0.5, atol=ROUND_OFF)


def test_values_weigh_by_volume_where_they_are_averaged():
    """Two points at one place tell a constant only: the mean by volume."""
    mesh = create_unit_square(MPI.COMM_SELF, 1, 1, CellType.quadrilateral)
    points = seeded(mesh, 1)
    points.assign(take(points.arrays(), points.id < 2))
    points.X = np.full((2, 2), 0.3)
    points.volume = np.array([1.0, 3.0])
    R = resample_matrix(mesh, points, 2, sites(mesh))
    np.testing.assert_allclose(R @ [8.0, 4.0], 5.0, rtol=1e-14)


def test_no_points_and_no_places():
    mesh = create_unit_square(MPI.COMM_SELF, 1, 1, CellType.triangle)
    points = seeded(mesh, 1)
    points.assign(take(points.arrays(), points.id < 0))
    nowhere = Sites(np.zeros(0, np.int32), np.zeros((0, 2)))
    assert resample_matrix(mesh, points, 1, nowhere).shape == (0, 0)


def test_a_rank_without_points_or_places():
    """basix ends the process where it is asked for values at no place."""
    mesh = distorted("quadrilateral")
    points, centres = seeded(mesh, 1), cell_centres(mesh, 0, num_owned(mesh))
    nowhere = cell_centres(mesh, 0, 0)
    assert resample_matrix(mesh, points, 1, nowhere).shape == (0, len(points))
    points.assign(take(points.arrays(), np.zeros(len(points), bool)))
    R = resample_matrix(mesh, points, 1, centres)
    assert R.shape == (num_owned(mesh), 0) and R.nnz == 0
