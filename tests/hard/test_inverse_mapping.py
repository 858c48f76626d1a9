# SPDX-License-Identifier: MIT
"""Hard cases 1 to 7 of the inverse mapping and the search.

Nodes are pushed forward by basix, which the mapping under test does not use, and read back.
"""

import itertools

import basix
import basix.ufl
import numpy as np
import pytest
from dolfinx.mesh import CellType, GhostMode, create_box, create_mesh, create_rectangle
from mpi4py import MPI

from fenics_hytf.domain import refuse_inverted_cells
from fenics_hytf.particles.mapping import inverse_map, map_points
from fenics_hytf.particles.search import CellSearch, locate, resolve_owners

EPS = np.finfo(np.float64).eps


def element(kind, degree):
    variant = basix.LagrangeVariant.gll_warped
    return basix.create_element(basix.ElementFamily.P, basix.CellType[kind], degree, variant)


def push_forward(kind, degree, nodes, X):
    """x of one reference point X a cell; nodes (n, N, d), X (n, d)."""
    return np.einsum("ni,nid->nd", element(kind, degree).tabulate(0, X)[0, :, :, 0], nodes)


def determinants(kind, degree, nodes, X):
    gradients = element(kind, degree).tabulate(1, X)[1:, :, :, 0]
    return np.linalg.det(np.einsum("api,nid->npda", gradients, nodes))


def determinants_at_own_points(kind, degree, nodes, X):
    gradients = element(kind, degree).tabulate(1, X)[1:, :, :, 0]
    return np.linalg.det(np.einsum("ani,nid->nda", gradients, nodes))


def disjoint_cells(kind, degree, nodes):
    """A mesh of cells that share no node, and the local index of each."""
    n, N, d = nodes.shape
    shape = basix.ufl.element("Lagrange", kind, degree, shape=(d,))
    mesh = create_mesh(
        MPI.COMM_SELF, np.arange(n * N).reshape(n, N), nodes.reshape(-1, d).copy(), shape
    )
    return mesh, np.argsort(mesh.topology.original_cell_index)


def random_points(kind, n, rng):
    d = 2 if kind in ("triangle", "quadrilateral") else 3
    if kind in ("triangle", "tetrahedron"):
        return rng.dirichlet(np.ones(d + 1), n)[:, :d]
    return rng.uniform(0, 1, (n, d))


def lattice(kind, n):
    return basix.create_lattice(basix.CellType[kind], n, basix.LatticeType.equispaced, True)


def random_cells(kind, degree, amplitude, count, seed):
    """Cells of size 1 with nodes moved at random, det J > 0 on a lattice that holds the nodes."""
    rng = np.random.default_rng(seed)
    reference = element(kind, degree).points
    found, total = [], 0
    while total < count:
        nodes = reference + rng.uniform(-amplitude, amplitude, (4 * count, *reference.shape))
        det = determinants(
            kind, degree, nodes, lattice(kind, 1 if kind == "quadrilateral" and degree == 1 else 4)
        )
        found.append(nodes[(det > 0).all(axis=1)])
        total += len(found[-1])
    return np.concatenate(found)[:count]


def newton_from_a_vertex(kind, nodes, x):
    """What the paper's scheme does when it starts at a vertex and takes full steps."""
    X = np.zeros(x.shape)
    for _ in range(50):
        table = element(kind, 1).tabulate(1, X)[:, :, :, 0]
        residual = np.einsum("ni,nid->nd", table[0], nodes) - x
        J = np.einsum("ani,nid->nda", table[1:], nodes)
        step = np.linalg.solve(J, -residual[:, :, None])[:, :, 0]
        X += step
    return X


# 1 ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "amplitude", "count"),
    [
        ("quadrilateral", 0.45, 20_000),
        ("hexahedron", 0.25, 2_000),
        ("hexahedron", 0.35, 2_000),
        ("hexahedron", 0.40, 2_000),
    ],
)
def test_case_1_random_cells(kind, amplitude, count, figure):
    nodes = random_cells(kind, 1, amplitude, count, seed=1)
    X = random_points(kind, count, np.random.default_rng(2))
    mesh, cells = disjoint_cells(kind, 1, nodes)
    found, status, iterations = map_points(mesh, push_forward(kind, 1, nodes, X), cells)
    error = np.abs(found - X).max(axis=1)
    name = f"inverse mapping, {count} {kind}s +-{amplitude} h"
    figure(f"{name}: wrong", np.sum(error > 1e-6), 0)
    figure(f"{name}: unknown or outside", np.sum(status != 0), 0)
    # the case's own limit; eps over the smallest det J is near 1e-13
    figure(f"{name}: |dX|", error.max(), 1e-11)
    figure(f"{name}: mean iterations", iterations.mean(), 6)


def test_case_1_is_hard():
    nodes = random_cells("quadrilateral", 1, 0.45, 1_000, seed=1)
    X = random_points("quadrilateral", 1_000, np.random.default_rng(2))
    naive = newton_from_a_vertex("quadrilateral", nodes, push_forward("quadrilateral", 1, nodes, X))
    assert np.sum(np.abs(naive - X).max(axis=1) > 1e-6) > 0


@pytest.mark.parametrize(
    ("kind", "amplitude"),
    [("triangle", 0.12), ("quadrilateral", 0.12), ("tetrahedron", 0.05), ("hexahedron", 0.1)],
)
def test_case_1_quadratic_cells(kind, amplitude):
    nodes = random_cells(kind, 2, amplitude, 500, seed=3)
    X = random_points(kind, 500, np.random.default_rng(4))
    mesh, cells = disjoint_cells(kind, 2, nodes)
    found, status, iterations = map_points(mesh, push_forward(kind, 2, nodes, X), cells)
    assert (status == 0).all()
    assert np.abs(found - X).max() <= 1e-11  # as for the straight cells
    assert iterations.mean() <= 6


# 2 ------------------------------------------------------------------------------------------


def test_case_2_pinned_quadrilateral():
    around = np.array([[-0.246, -0.724], [0.118, -0.083], [0.536, 0.747], [-0.474, 0.600]])
    nodes = around[[0, 1, 3, 2]]  # counter-clockwise to basix's tensor order
    x = np.array([[0.254729, 0.556350]])
    mesh, cells = disjoint_cells("quadrilateral", 1, nodes[None])
    X, status = inverse_map(mesh, x, cells)
    assert status[0] == 0
    # The point is given to six digits, and det J is 0.1 there.
    assert np.abs(2 * X[0] - 1 - [0.53, 0.67]).max() <= 2e-6
    naive = 2 * newton_from_a_vertex("quadrilateral", nodes[None], x)[0] - 1
    assert np.abs(naive - [3.203, -1.468]).max() <= 1e-3  # the wrong root, given to three digits


# 3 ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
@pytest.mark.parametrize("aspect", [1e0, 1e2, 1e4, 1e6])
def test_case_3_aspect_ratio_rotated(kind, aspect):
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
    assert (status == 0).all()
    # x itself is rounded to eps·|x|, which the thin side 1/aspect turns into this
    assert np.abs(found - X).max() <= 40 * EPS * np.abs(x).max() * aspect
    assert iterations.mean() <= 6


@pytest.mark.parametrize("epsilon", [1e-6, 1e-4, 1e-2, 1e-1])
def test_case_3_triangles_in_disguise(epsilon):
    rng = np.random.default_rng(6)
    flat = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5 + epsilon, 0.5 + epsilon]]  # an angle of pi
    merged = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [epsilon, 1.0]]  # two nodes are one
    nodes = np.repeat(np.array([flat, merged]), 500, axis=0)
    X = random_points("quadrilateral", 1000, rng)
    x = push_forward("quadrilateral", 1, nodes, X)
    mesh, cells = disjoint_cells("quadrilateral", 1, nodes)
    found, status = inverse_map(mesh, x, cells)
    det = determinants_at_own_points("quadrilateral", 1, nodes, X)
    assert (status == 0).all()
    # rounding of x over det J at the point: what the point's own coordinates can tell
    assert (np.abs(found - X).max(axis=1) <= 40 * EPS / det).all()
    back = push_forward("quadrilateral", 1, nodes, found)
    assert np.abs(back - x).max() <= 10 * EPS  # a few operations on coordinates of size one


@pytest.mark.parametrize(("kind", "amplitude"), [("quadrilateral", 0.4), ("hexahedron", 0.3)])
def test_case_3_cell_size(kind, amplitude):
    nodes = random_cells(kind, 1, amplitude, 1000, seed=7)
    X = random_points(kind, 1000, np.random.default_rng(8))
    counts = {}
    for size in (1e-3, 1e-1, 1e0, 1e2, 1e4):
        mesh, cells = disjoint_cells(kind, 1, nodes * size)
        x = push_forward(kind, 1, nodes * size, X)
        found, status, counts[size] = map_points(mesh, x, cells)
        assert (status == 0).all()
        assert np.abs(found - X).max() <= 1e-11  # as in case 1
    for size in counts:
        np.testing.assert_array_equal(counts[size], counts[1.0])


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize(
    ("kind", "degree"), [("quadrilateral", 1), ("hexahedron", 1), ("triangle", 2)]
)
def test_case_3_offset(kind, degree, size):
    amplitude = 0.1 if degree == 2 else 0.25
    nodes = size * random_cells(kind, degree, amplitude, 500, seed=9)
    offset = np.array([4.5e5, 4.5e6, 100.0])[: nodes.shape[2]]
    nodes = nodes + offset
    X = random_points(kind, 500, np.random.default_rng(10))
    x = push_forward(kind, degree, nodes - offset, X) + offset  # rounded once
    mesh, cells = disjoint_cells(kind, degree, nodes)
    found, status = inverse_map(mesh, x, cells)
    assert (status == 0).all()
    assert np.abs(found - X).max() <= max(40 * EPS * 4.5e6 / size, 1e-11)


# 4 ------------------------------------------------------------------------------------------


def test_case_4_outside_points_of_quadrilaterals():
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
    assert np.sum(discriminant < 0) > 100  # the case is in the sample
    mesh, cells = disjoint_cells("quadrilateral", 1, nodes)
    X, status = inverse_map(mesh, x, cells)
    np.testing.assert_array_equal(status, np.where(inside, 0, 1))
    assert np.isfinite(X).all()


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
def test_case_4_far_and_near_outside(kind, degree, amplitude):
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
        assert (status == 1).all()
        assert np.isfinite(X).all()


def test_case_4_just_outside_is_outside():
    nodes = random_cells("hexahedron", 1, 0.2, 500, seed=15)
    rng = np.random.default_rng(16)
    X = rng.uniform(0, 1, (500, 3))
    X[np.arange(500), rng.integers(0, 3, 500)] = rng.choice([-1e-9, 1 + 1e-9], 500)
    mesh, cells = disjoint_cells("hexahedron", 1, nodes)
    found, status = inverse_map(mesh, push_forward("hexahedron", 1, nodes, X), cells)
    assert (status == 1).all()  # a thousand times the tolerance
    assert np.abs(found - X).max() < 1e-11  # not clipped


def test_case_4_not_finite():
    mesh = create_rectangle(MPI.COMM_SELF, [[0, 0], [1, 1]], [2, 2], CellType.quadrilateral)
    x = np.array([[0.1, 0.1], [np.nan, 0.2], [0.3, 0.3], [0.4, np.inf], [-np.inf, np.nan]])
    with pytest.raises(ValueError, match=r"3 of 5 points .* not finite: point 1, 3, 4\."):
        locate(mesh, x)
    X, status = inverse_map(mesh, x, np.zeros(5, np.int32))
    assert status.tolist() == [0, 2, 0, 2, 2]
    assert np.isfinite(X).all()


# 5 ------------------------------------------------------------------------------------------


def grid(comm, kind, offset=0.0, ghosts=GhostMode.shared_facet):
    """A small box with all inner nodes moved, the same on any number of ranks."""
    cell = getattr(CellType, kind)
    if kind in ("triangle", "quadrilateral"):
        mesh = create_rectangle(comm, [[0, 0], [1, 1]], [5, 4], cell, ghost_mode=ghosts)
    else:
        mesh = create_box(comm, [[0, 0, 0], [1, 1, 1]], [3, 3, 2], cell, ghost_mode=ghosts)
    x = mesh.geometry.x
    dim = mesh.geometry.dim
    bump = np.prod(np.sin(np.pi * x[:, :dim]), axis=1)
    for axis in range(dim):  # the box stays a box
        x[:, axis] += 0.05 * bump * np.cos(3 + 5 * x[:, (axis + 1) % dim] + axis)
    x[:, :dim] += offset
    return mesh


def entity_points(mesh):
    """Points on every vertex, edge and facet, and the lowest input cell around each entity."""
    cell = basix.CellType[mesh.topology.cell_name()]
    dim = mesh.topology.dim
    points, owners = {}, {}
    for row, number in zip(mesh.geometry.dofmap, mesh.topology.original_cell_index, strict=True):
        for entity in itertools.chain.from_iterable(basix.topology(cell)[:dim]):
            nodes = tuple(sorted(row[entity]))
            weights = [0.5, 0.5] if len(nodes) == 2 else [1 / len(nodes)] * len(nodes)
            points[nodes] = np.array(weights) @ mesh.geometry.x[list(nodes)]
            owners[nodes] = min(owners.get(nodes, number), number)
    return np.array(list(points.values())), np.array(list(owners.values()), np.int64)


def moved_by_ulps(x, owners, dim):
    """Every point, and its neighbours 1 and 4 floating-point numbers along each axis."""
    all_x = [x]
    for axis, sign, ulps in itertools.product(range(dim), (-np.inf, np.inf), (1, 4)):
        y = x.copy()
        for _ in range(ulps):
            y[:, axis] = np.nextafter(y[:, axis], sign)
        all_x.append(y)
    for axis in range(dim):  # through a fixed face at 0
        y = x.copy()
        y[y[:, axis] == 0.0, axis] = -1.8e-18
        all_x.append(y)
    return np.concatenate(all_x), np.tile(owners, len(all_x))


@pytest.mark.mpi
@pytest.mark.parametrize("ghosts", [GhostMode.shared_facet, GhostMode.none])
@pytest.mark.parametrize("offset", [0.0, 4.5e6])
@pytest.mark.parametrize("kind", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_case_5_one_owner(kind, offset, ghosts):
    comm = MPI.COMM_WORLD
    alone = grid(MPI.COMM_SELF, kind, offset)
    x, owners = moved_by_ulps(*entity_points(alone), alone.geometry.dim)
    mesh = grid(comm, kind, offset, ghosts)
    search = CellSearch(mesh)
    num_local = len(search.input_index)
    rng = np.random.default_rng(17 + comm.rank)
    guesses = [None] + [rng.integers(-1, num_local, len(x)) for _ in range(3)]
    for guess in guesses:
        cells, X = locate(mesh, x, guess)
        claims = comm.allreduce((cells >= 0).astype(int))
        assert (claims == 1).all()
        mine = np.where(cells >= 0, search.input_index[cells], -1)
        index, rank = resolve_owners(comm, mine)
        np.testing.assert_array_equal(index, owners)
        np.testing.assert_array_equal(cells >= 0, rank == comm.rank)
        got = np.flatnonzero(cells >= 0)
        _, status = inverse_map(mesh, x[got], cells[got])
        assert (status == 0).all()
        vertices = basix.geometry(basix.CellType[kind])
        # beyond the reference cell by the tolerance at most: 8 ulp of the offset over h = 0.2
        slack = 1e-11 + 1e3 * EPS * offset
        assert (X >= vertices.min() - slack).all() and (X <= vertices.max() + slack).all()


@pytest.mark.mpi
def test_case_5_more_ranks_than_cells():
    comm = MPI.COMM_WORLD
    mesh = create_rectangle(
        comm, [[0, 0], [2, 1]], [2, 1], CellType.quadrilateral, ghost_mode=GhostMode.shared_facet
    )
    x = np.array([[1.0, 0.5], [0.0, 0.0], [2.0, 1.0], [1.5, 0.5], [1.0, 1.0], [3.0, 0.5]])
    cells, _ = locate(mesh, x)
    claims = comm.allreduce((cells >= 0).astype(int))
    assert claims.tolist() == [1, 1, 1, 1, 1, 0]


# 6 ------------------------------------------------------------------------------------------


def quarter_ring(kind, degree_of_arc):
    """Quadratic cells whose nodes lie on circles: 1 <= r <= 2, 0 <= angle <= pi/2, 0 <= z <= 1."""
    reference = element(kind, 2).points
    dim = reference.shape[1]
    shape = (2, degree_of_arc, 1)[:dim]
    starts = np.stack(np.meshgrid(*[np.arange(s) for s in shape], indexing="ij"), -1)
    if kind == "tetrahedron":  # six of a cube, around its diagonal
        corners = np.array(
            [
                np.cumsum([np.zeros(3), *np.eye(3)[list(p)]], axis=0)
                for p in itertools.permutations(range(3))
            ]
        )
    elif kind == "triangle":
        corners = np.array([[[0, 0], [1, 0], [0, 1]], [[1, 0], [1, 1], [0, 1]]], float)
    else:
        corners = None
    if corners is None:
        cells = starts.reshape(-1, 1, dim) + reference
    else:
        nodes = np.einsum(
            "pi,cid->cpd",
            np.column_stack([1 - reference.sum(axis=1), reference]),
            corners,
        )
        cells = (starts.reshape(-1, 1, 1, dim) + nodes).reshape(-1, len(reference), dim)
    grid_nodes, inverse = np.unique(
        np.round(2 * cells).reshape(-1, dim), axis=0, return_inverse=True
    )
    polar = grid_nodes / 2 / np.array(shape)
    r, angle = 1 + polar[:, 0], np.pi / 2 * polar[:, 1]
    x = np.column_stack([r * np.cos(angle), r * np.sin(angle), *polar[:, 2:].T])
    shape = basix.ufl.element("Lagrange", kind, 2, shape=(dim,))
    topology = inverse.reshape(-1, len(reference))
    return create_mesh(MPI.COMM_SELF, topology, x, shape), x[topology]


@pytest.mark.parametrize("kind", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
@pytest.mark.parametrize("arcs", [1, 2, 4])
def test_case_6_quarter_ring(kind, arcs):
    mesh, nodes = quarter_ring(kind, arcs)
    local = np.argsort(mesh.topology.original_cell_index)
    rng = np.random.default_rng(18)
    per_cell = 400
    X = random_points(kind, per_cell * len(nodes), rng)
    number = np.repeat(np.arange(len(nodes)), per_cell)
    det = determinants_at_own_points(kind, 2, nodes[number], X)
    assert (np.abs(det) > 1e-3).all()  # curved, and still cells
    x = push_forward(kind, 2, nodes[number], X)
    for guess in (None, local[number], np.roll(local[number], per_cell)):
        cells, found = locate(mesh, x, guess)
        assert (cells == local[number]).all()
        assert np.abs(found - X).max() <= 1e-10
    # Nothing is found in the bay of the ring, nor beyond it; the arcs deviate from the circles
    # by less than 0.05 where one cell spans a right angle.
    angle = rng.uniform(0, np.pi / 2, 500)
    for radius in (0.9, 2.1):
        y = np.zeros((500, 3))
        y[:, 0], y[:, 1], y[:, 2] = radius * np.cos(angle), radius * np.sin(angle), 0.5
        cells, _ = locate(mesh, y)
        assert (cells == -1).all()


def test_case_6_quadratic_cell_bulges_beyond_its_nodes():
    # The widest place of a slanted parabola lies beyond all nodes, and is still found.
    nodes = element("quadrilateral", 2).points.copy()
    nodes[3], nodes[6], nodes[7] = [1.15, 1.0], [1.2, 0.5], [0.575, 1.0]  # the right-hand side
    mesh, _ = disjoint_cells("quadrilateral", 2, nodes[None])
    X = np.column_stack([np.ones(101), np.linspace(0, 1, 101)])
    x = push_forward("quadrilateral", 2, np.repeat(nodes[None], 101, axis=0), X)
    assert x[:, 0].max() > nodes[:, 0].max() + 0.01
    cells, found = locate(mesh, x)
    assert (cells == 0).all()
    assert np.abs(found - X).max() <= 1e-10


@pytest.mark.parametrize(
    "corners",
    [
        [[0, 0], [1, 0], [0, 1], [0.2, 0.2]],  # concave
        [[0, 0], [1, 0], [1, 1], [0, 1]],  # crossed: counter-clockwise nodes taken as tensor order
        [[0, 0], [1, 0], [2, 0], [3, 0]],  # no area
        [[1, 1], [1, 1], [1, 1], [1, 1]],  # a point
    ],
)
def test_case_6_bad_cells_do_not_raise(corners):
    # Such cells are refused when a mesh is read; the mapping still answers for every point.
    mesh, _ = disjoint_cells("quadrilateral", 1, np.array(corners, float)[None])
    x = np.random.default_rng(19).uniform(-1, 4, (500, 2))
    X, status = inverse_map(mesh, x, np.zeros(500, np.int32))
    assert np.isfinite(X).all()
    inside = status == 0
    back = push_forward("quadrilateral", 1, np.repeat(np.array(corners, float)[None], 500, 0), X)
    # a root found in a bad cell is a root: eps over det J, which is small near the fold
    assert np.abs(back - x)[inside].max(initial=0.0) <= 1e-10
    locate(mesh, x)


@pytest.mark.parametrize("corner", [[0.2, 0.2], [-1.0, -1.0]])  # concave, inverted
def test_case_6_bad_cells_are_refused_by_number(corner):
    square = element("quadrilateral", 1).points
    nodes = np.repeat(square[None], 5, axis=0)
    nodes[3, 3] = corner
    mesh, _ = disjoint_cells("quadrilateral", 1, nodes)
    with pytest.raises(ValueError, match=r"input cell: 3 \("):
        refuse_inverted_cells(mesh)


# 7, the search ------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["triangle", "quadrilateral"])
def test_case_7_a_long_jump_across_ranks(kind):
    comm = MPI.COMM_WORLD
    h, cell = 1.0 / 20, getattr(CellType, kind)

    def make(comm):
        mesh = create_rectangle(
            comm, [[0, 0], [1, 0.5]], [20, 10], cell, ghost_mode=GhostMode.shared_facet
        )
        x = mesh.geometry.x
        x[:, 0] += 0.3 * h * np.sin(np.pi * x[:, 0]) * np.sin(12 * x[:, 1])
        return mesh

    alone, mesh = make(MPI.COMM_SELF), make(comm)
    rng = np.random.default_rng(20)
    old = rng.uniform([0, 0], [1, 0.5], (300, 2))
    angle = rng.uniform(0, 2 * np.pi, 300)
    new = old + 7.3 * h * np.column_stack([np.cos(angle), np.sin(angle)])
    in_box = ((new > 0) & (new < [1, 0.5])).all(axis=1)
    assert 50 < in_box.sum() < 250

    # brute force: every point in every cell of the whole mesh
    number = len(alone.geometry.dofmap)
    _, status = inverse_map(alone, np.repeat(new, number, 0), np.tile(np.arange(number), 300))
    held = status.reshape(300, number) == 0
    first = np.where(held, alone.topology.original_cell_index, number).min(axis=1)
    np.testing.assert_array_equal(first < number, in_box)

    search = CellSearch(mesh)
    guess, _ = search.locate(np.column_stack([old, np.zeros(300)]), np.full(300, -1))
    cells, _ = locate(mesh, new, guess, search)
    claims = comm.allreduce((cells >= 0).astype(int))
    np.testing.assert_array_equal(claims, in_box)
    index, _ = resolve_owners(comm, np.where(cells >= 0, search.input_index[cells], -1))
    np.testing.assert_array_equal(index, np.where(in_box, first, -1))
