# SPDX-License-Identifier: MIT
"""Hard cases 1 to 4: from a place in a cell to its reference coordinates, and from a place outside.

Naively Newton starts at a vertex and takes whole steps: among cells whose vertices are off by up to
0.45 h it lands on the second root of one in some two hundred, and says nothing.
"""

import numpy as np
import pytest
from dolfinx.mesh import CellType, create_rectangle
from mpi4py import MPI
from support.single_cells import (
    determinants_at_own_points,
    disjoint_cells,
    element,
    newton_from_a_vertex,
    push_forward,
    random_cells,
    random_points,
)

from fenics_hytf.particles.mapping import inverse_map, map_points
from fenics_hytf.particles.search import locate

EPS = np.finfo(np.float64).eps
WRONG = 1e-6  # off by more is another point, not round-off
KINDS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]


# ---------------------------------------------------------------- 1


@pytest.mark.parametrize(
    ("kind", "amplitude", "count"),
    [
        ("quadrilateral", 0.45, 20_000),
        ("hexahedron", 0.25, 2_000),
        ("hexahedron", 0.35, 2_000),
        ("hexahedron", 0.40, 2_000),
    ],
)
def test_01_points_of_random_cells_are_found(kind, amplitude, count, figure):
    """Started at a vertex, undamped, 89 quadrilaterals and 35 hexahedra are silently wrong."""
    nodes = random_cells(kind, 1, amplitude, count, seed=1)
    X = random_points(kind, count, np.random.default_rng(2))
    mesh, cells = disjoint_cells(kind, 1, nodes)
    x = push_forward(kind, 1, nodes, X)
    found, status, iterations = map_points(mesh, x, cells)
    error = np.abs(found - X).max(axis=1)
    figure("wrong points", np.sum(error > WRONG), 0)
    figure("unknown points", np.sum(status != 0), 0)
    # the case's own limit, on [-1, 1]; eps over the smallest det J is near 1e-13
    figure("|Δξ|", 2 * error.max(), 1e-11)
    figure("mean iterations", iterations.mean(), 6)
    naive = newton_from_a_vertex(kind, nodes, x)
    if amplitude >= 0.40:  # milder cells have one root in reach
        wrong = np.sum(np.abs(naive - X).max(axis=1) > WRONG)
        figure("naive, from a vertex: wrong points", wrong, 1, at_least=True)


@pytest.mark.parametrize(
    ("kind", "amplitude"),
    [("triangle", 0.12), ("quadrilateral", 0.12), ("tetrahedron", 0.05), ("hexahedron", 0.1)],
)
def test_01_points_of_random_quadratic_cells_are_found(kind, amplitude, figure):
    """As of the straight ones: with more roots there are more to land on."""
    nodes = random_cells(kind, 2, amplitude, 500, seed=3)
    X = random_points(kind, 500, np.random.default_rng(4))
    mesh, cells = disjoint_cells(kind, 2, nodes)
    found, status, iterations = map_points(mesh, push_forward(kind, 2, nodes, X), cells)
    figure("unknown points of quadratic cells", np.sum(status != 0), 0)
    figure("|Δξ| in quadratic cells", 2 * np.abs(found - X).max(), 1e-11)
    figure("mean iterations in quadratic cells", iterations.mean(), 6)


# ---------------------------------------------------------------- 2


def test_02_the_pinned_quadrilateral_gives_the_right_root(figure):
    """A vertex start gives (3.203, −1.468), which is a root, but none in the cell."""
    around = np.array([[-0.246, -0.724], [0.118, -0.083], [0.536, 0.747], [-0.474, 0.600]])
    nodes = around[[0, 1, 3, 2]]  # counter-clockwise to basix's tensor order
    x = np.array([[0.254729, 0.556350]])
    mesh, cells = disjoint_cells("quadrilateral", 1, nodes[None])
    X, status = inverse_map(mesh, x, cells)
    assert status[0] == 0
    # The point is given to six digits, and det J is 0.1 there.
    figure("off (.53, .67) on [−1, 1]²", np.abs(2 * X[0] - 1 - [0.53, 0.67]).max(), 2e-6)
    naive = 2 * newton_from_a_vertex("quadrilateral", nodes[None], x)[0] - 1
    # the wrong root, given to three digits
    figure("naive, from a vertex: off (3.203, −1.468)", np.abs(naive - [3.203, -1.468]).max(), 1e-3)


# ---------------------------------------------------------------- 3


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("aspect", [1e0, 1e2, 1e4, 1e6])
def test_03_thin_cells_that_are_turned(kind, aspect, figure):
    """Naively a step is judged in metres: across the thin side that is a million times too late."""
    rng = np.random.default_rng(5)
    reference = element(kind, 1).points
    nodes = reference + rng.uniform(-0.1, 0.1, (200, *reference.shape))
    nodes[:, :, -1] /= aspect
    turns = np.linalg.qr(rng.normal(size=(200, reference.shape[1], reference.shape[1])))[0]
    nodes = np.einsum("nij,nkj->nki", turns, nodes)
    X = random_points(kind, 200, rng)
    x = push_forward(kind, 1, nodes, X)
    mesh, cells = disjoint_cells(kind, 1, nodes)
    found, status, iterations = map_points(mesh, x, cells)
    figure("unknown points in thin cells", np.sum(status != 0), 0)
    # x itself is rounded to eps·|x|, which the thin side 1/aspect turns into this
    rounding = EPS * np.abs(x).max() * aspect
    figure("error in thin cells over eps·|x|/h", np.abs(found - X).max() / rounding, 40)
    figure("mean iterations in thin cells", iterations.mean(), 6)


@pytest.mark.parametrize("epsilon", [1e-6, 1e-4, 1e-2, 1e-1])
def test_03_triangles_in_disguise(epsilon, figure):
    """Naively det J is compared with a fixed number, and the corner of 1e-6 is called singular."""
    rng = np.random.default_rng(6)
    flat = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5 + epsilon, 0.5 + epsilon]]  # an angle of pi
    merged = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [epsilon, 1.0]]  # two nodes are one
    nodes = np.repeat(np.array([flat, merged]), 500, axis=0)
    X = random_points("quadrilateral", 1000, rng)
    x = push_forward("quadrilateral", 1, nodes, X)
    mesh, cells = disjoint_cells("quadrilateral", 1, nodes)
    found, status = inverse_map(mesh, x, cells)
    det = determinants_at_own_points("quadrilateral", 1, nodes, X)
    figure("unknown points in near triangles", np.sum(status != 0), 0)
    # rounding of x over det J at the point: what the point's own coordinates can tell
    error = (np.abs(found - X).max(axis=1) * det).max()
    figure("error in near triangles over eps/det J", error / EPS, 40)
    back = push_forward("quadrilateral", 1, nodes, found)
    # a few operations on coordinates of size one
    figure("way back from near triangles over eps", np.abs(back - x).max() / EPS, 10)


@pytest.mark.parametrize(("kind", "amplitude"), [("quadrilateral", 0.4), ("hexahedron", 0.3)])
def test_03_cells_of_any_size_take_the_same_iterations(kind, amplitude, figure):
    """Naively a tolerance in metres stops early in cells of 1 mm, and never in those of 10 km."""
    nodes = random_cells(kind, 1, amplitude, 1000, seed=7)
    X = random_points(kind, 1000, np.random.default_rng(8))
    counts = {}
    for size in (1e-3, 1e-1, 1e0, 1e2, 1e4):
        mesh, cells = disjoint_cells(kind, 1, nodes * size)
        x = push_forward(kind, 1, nodes * size, X)
        found, status, counts[size] = map_points(mesh, x, cells)
        figure("unknown points in cells of 1 mm to 10 km", np.sum(status != 0), 0)
        figure("|Δξ| in cells of 1 mm to 10 km", 2 * np.abs(found - X).max(), 1e-11)  # as in case 1
    other = sum(int(np.sum(count != counts[1.0])) for count in counts.values())
    figure("points that take other iterations than in cells of 1 m", other, 0)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize(
    ("kind", "degree"), [("quadrilateral", 1), ("hexahedron", 1), ("triangle", 2)]
)
def test_03_cells_far_from_the_origin(kind, degree, size, figure):
    """Naively x − x(X) is summed at UTM's 4.5e6 m, and its round-off is taken for a step."""
    amplitude = 0.1 if degree == 2 else 0.25
    nodes = size * random_cells(kind, degree, amplitude, 500, seed=9)
    offset = np.array([4.5e5, 4.5e6, 100.0])[: nodes.shape[2]]
    nodes = nodes + offset
    X = random_points(kind, 500, np.random.default_rng(10))
    x = push_forward(kind, degree, nodes - offset, X) + offset  # rounded once
    mesh, cells = disjoint_cells(kind, degree, nodes)
    found, status = inverse_map(mesh, x, cells)
    figure("unknown points at 4.5e6 m", np.sum(status != 0), 0)
    rounding = EPS * np.abs(x).max() / size
    figure("error at 4.5e6 m over eps·|x|/h", np.abs(found - X).max() / rounding, 40)


# ---------------------------------------------------------------- 4


def test_04_places_without_a_real_preimage_are_outside(figure):
    """Naively the closed form takes the root of a negative discriminant: NaN, or an exception."""
    nodes = random_cells("quadrilateral", 1, 0.45, 5_000, seed=11)
    x = np.random.default_rng(12).uniform(-1.5, 2.5, (5_000, 2))
    corners = nodes[:, [0, 1, 3, 2]]
    sides = np.roll(corners, -1, axis=1) - corners
    to_x = x[:, None] - corners
    cross = sides[..., 0] * to_x[..., 1] - sides[..., 1] * to_x[..., 0]
    inside = (cross > 0).all(axis=1)  # exact for convex cells
    # x = a + b X0 + c X1 + d X0 X1 gives a quadratic for X1; without real roots, no preimage
    a, b = nodes[:, 0], nodes[:, 1] - nodes[:, 0]
    c, d = nodes[:, 2] - nodes[:, 0], nodes[:, 3] - nodes[:, 2] - nodes[:, 1] + nodes[:, 0]
    wedge = lambda p, q: p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]  # noqa: E731
    middle = wedge(b, c) + wedge(a - x, d)
    discriminant = middle**2 - 4 * wedge(c, d) * wedge(a - x, b)
    # the case is in the sample
    figure("naive, closed form: no number", np.sum(discriminant < 0), 100, at_least=True)
    mesh, cells = disjoint_cells("quadrilateral", 1, nodes)
    X, status = inverse_map(mesh, x, cells)
    figure("wrong verdicts, quadrilaterals", np.sum(status != np.where(inside, 0, 1)), 0)
    figure("coordinates that are no numbers", np.sum(~np.isfinite(X)), 0)


@pytest.mark.parametrize(
    ("kind", "degree", "amplitude"),
    [
        ("triangle", 1, 0.2),
        ("tetrahedron", 1, 0.1),
        ("hexahedron", 1, 0.25),
        ("triangle", 2, 0.05),
        ("quadrilateral", 2, 0.05),
        ("tetrahedron", 2, 0.03),
        ("hexahedron", 2, 0.05),
    ],
)
def test_04_places_near_and_very_far_are_outside(kind, degree, amplitude, figure):
    """Naively Newton overflows on its way from 1e300 m, or comes back with some root."""
    nodes = random_cells(kind, degree, amplitude, 200, seed=13)
    mesh, cells = disjoint_cells(kind, degree, nodes)
    rng = np.random.default_rng(14)
    direction = rng.normal(size=(200, nodes.shape[2]))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    # The cell lies within twice its nodes' distance from their mean: Lagrange polynomials of
    # degree 2 are below 1.25 a direction, and the nodes are moved by less than a fifth.
    radius = 2 * np.linalg.norm(nodes - nodes.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    for factor in (1.0, 2.0, 1e3, 1e10, 1e150, 1e300):
        x = nodes.mean(axis=1) + factor * radius[:, None] * direction
        X, status = inverse_map(mesh, x, cells)
        figure("wrong verdicts, up to 1e300 cells away", np.sum(status != 1), 0)
        figure("coordinates that are no numbers", np.sum(~np.isfinite(X)), 0)


def test_04_places_just_outside_are_outside(figure):
    """Naively they are clipped onto the cell, and their mass moves with them."""
    nodes = random_cells("hexahedron", 1, 0.2, 500, seed=15)
    rng = np.random.default_rng(16)
    X = rng.uniform(0, 1, (500, 3))
    X[np.arange(500), rng.integers(0, 3, 500)] = rng.choice([-1e-9, 1 + 1e-9], 500)
    mesh, cells = disjoint_cells("hexahedron", 1, nodes)
    found, status = inverse_map(mesh, push_forward("hexahedron", 1, nodes, X), cells)
    # a thousand times the tolerance
    figure("wrong verdicts, 1e-9 of a cell outside", np.sum(status != 1), 0)
    figure("|Δξ| there: not clipped", 2 * np.abs(found - X).max(), 1e-11)


def test_04_coordinates_that_are_no_numbers_are_told(figure):
    """Naively NaN is in no cell, and a point is lost without a word."""
    mesh = create_rectangle(MPI.COMM_SELF, [[0, 0], [1, 1]], [2, 2], CellType.quadrilateral)
    x = np.array([[0.1, 0.1], [np.nan, 0.2], [0.3, 0.3], [0.4, np.inf], [-np.inf, np.nan]])
    with pytest.raises(ValueError, match=r"3 of 5 points .* not finite: point 1, 3, 4\."):
        locate(mesh, x)
    X, status = inverse_map(mesh, x, np.zeros(5, np.int32))
    figure("wrong verdicts, NaN and inf", np.sum(status != [0, 2, 0, 2, 2]), 0)
    figure("coordinates that are no numbers", np.sum(~np.isfinite(X)), 0)
