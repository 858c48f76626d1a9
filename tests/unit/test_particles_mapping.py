# SPDX-License-Identifier: MIT
"""The inverse mapping and the search on dolfinx's own meshes, against dolfinx."""

import gc
import weakref

import basix
import basix.ufl
import numpy as np
import pytest
from dolfinx.geometry import bb_tree, compute_colliding_cells, compute_collisions_points
from dolfinx.mesh import (
    CellType,
    GhostMode,
    create_box,
    create_interval,
    create_mesh,
    create_rectangle,
)
from mpi4py import MPI

from fenics_hytf.particles.mapping import inverse_map, map_points, reference_cell
from fenics_hytf.particles.search import (
    CellSearch,
    build_tree,
    facet_neighbours,
    locate,
    resolve_owners,
)

KINDS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]


def grid(kind, comm=MPI.COMM_SELF, dtype=np.float64):
    """A box of 2 x 1 (x 1) with its nodes moved."""
    cell = getattr(CellType, kind)
    if kind in ("triangle", "quadrilateral"):
        mesh = create_rectangle(
            comm, [[0, 0], [2, 1]], [8, 5], cell, dtype=dtype, ghost_mode=GhostMode.shared_facet
        )
    else:
        mesh = create_box(
            comm,
            [[0, 0, 0], [2, 1, 1]],
            [4, 3, 3],
            cell,
            dtype=dtype,
            ghost_mode=GhostMode.shared_facet,
        )
    x = mesh.geometry.x
    x[:, 0] += 0.05 * np.sin(np.pi * x[:, 0]) * np.cos(4 * x[:, 1])
    x[:, 1] += 0.03 * np.sin(np.pi * x[:, 1]) * np.cos(3 * x[:, 0] + x[:, 2])
    return mesh


def points_in_cells(mesh, per_cell, seed=0):
    """Random points of every local cell: x (n, 3), X (n, tdim), cells (n,)."""
    rng = np.random.default_rng(seed)
    kind, dim = mesh.topology.cell_name(), mesh.topology.dim
    cells = np.repeat(np.arange(len(mesh.geometry.dofmap)), per_cell)
    if kind in ("triangle", "tetrahedron"):
        X = rng.dirichlet(np.ones(dim + 1), len(cells))[:, :dim]
    else:
        X = rng.uniform(0, 1, (len(cells), dim))
    table = basix.create_element(
        basix.ElementFamily.P, basix.CellType[kind], 1, basix.LagrangeVariant.gll_warped
    ).tabulate(0, X)[0, :, :, 0]
    nodes = np.asarray(mesh.geometry.x, np.float64)[mesh.geometry.dofmap[cells]]
    return np.einsum("ni,nid->nd", table, nodes), X, cells


@pytest.mark.parametrize("kind", KINDS)
def test_points_are_found_where_they_were_put(kind):
    mesh = grid(kind)
    x, X, cells = points_in_cells(mesh, 20)
    for guess in (None, cells, np.zeros(len(x), np.int32), np.full(len(x), -1)):
        found, reference = locate(mesh, x, guess)
        np.testing.assert_array_equal(found, cells)
        assert np.abs(reference - X).max() < 1e-13  # rounding of x over cells of size 0.2
    assert found.dtype == np.int32 and reference.shape == (len(x), mesh.geometry.dim)


@pytest.mark.parametrize("kind", KINDS)
def test_agrees_with_dolfinx(kind):
    mesh = grid(kind)
    rng = np.random.default_rng(1)
    x = np.zeros((300, 3))
    x[:, : mesh.geometry.dim] = rng.uniform(-0.2, 1.2, (300, mesh.geometry.dim))
    candidates = compute_collisions_points(bb_tree(mesh, mesh.topology.dim), x)
    colliding = compute_colliding_cells(mesh, candidates, x)
    cells, X = locate(mesh, x)
    assert 0 < np.sum(cells < 0) < 300
    for i, cell in enumerate(cells):
        links = colliding.links(i)
        if cell < 0:
            assert len(links) == 0
        else:
            assert cell in links
            theirs = mesh.geometry.cmap.pull_back(
                x[i : i + 1], mesh.geometry.x[mesh.geometry.dofmap[cell]]
            )
            assert np.abs(theirs - X[i]).max() < 1e-6  # dolfinx stops at about this


@pytest.mark.parametrize("kind", ["triangle", "tetrahedron"])
def test_affine_cells_take_one_iteration(kind):
    mesh = grid(kind)
    x, _, cells = points_in_cells(mesh, 5)
    _, status, iterations = map_points(mesh, x, cells)
    assert (status == 0).all() and (iterations == 1).all()


def test_two_or_three_columns_and_no_points():
    mesh = grid("quadrilateral")
    x, _, _ = points_in_cells(mesh, 2)
    for a, b in zip(locate(mesh, x), locate(mesh, x[:, :2]), strict=True):
        np.testing.assert_array_equal(a, b)
    cells, X = locate(mesh, np.zeros((0, 2)), [])
    assert cells.shape == (0,) and X.shape == (0, 2)
    X, status = inverse_map(mesh, np.zeros((0, 3)), [])
    assert status.shape == (0,) and X.shape == (0, 2)


def test_wrong_shapes_and_guesses_are_refused():
    mesh = grid("quadrilateral")
    with pytest.raises(ValueError, match=r"shape \(2,\); expected \(n, 2\) or \(n, 3\)"):
        locate(mesh, [0.5, 0.5])
    with pytest.raises(ValueError, match=r"shape \(1, 4\)"):
        inverse_map(mesh, np.zeros((1, 4)), [0])
    with pytest.raises(ValueError, match=r"expected integers of shape \(1,\)"):
        inverse_map(mesh, [[0.5, 0.5]], [0.0])
    with pytest.raises(ValueError, match=r"expected integers of shape \(1,\)"):
        locate(mesh, [[0.5, 0.5]], [0, 1])
    with pytest.raises(ValueError, match="Found 40 as the guess of point 0"):
        locate(mesh, [[0.5, 0.5]], [40])


def test_meshes_without_an_inverse_map_are_refused():
    with pytest.raises(ValueError, match="interval cells of geometry degree 1"):
        locate(create_interval(MPI.COMM_SELF, 3, [0.0, 1.0]), [[0.5]])
    shell = create_mesh(
        MPI.COMM_SELF,
        np.array([[0, 1, 2]]),
        np.eye(3),
        basix.ufl.element("Lagrange", "triangle", 1, shape=(3,)),
    )
    with pytest.raises(ValueError, match="dimension 2 in a space of dimension 3"):
        inverse_map(shell, np.zeros((1, 3)), [0])
    with pytest.raises(ValueError, match="triangle cells of geometry degree 3"):
        reference_cell("triangle", 3)


def test_unknown_cells_and_flat_cells():
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [2.0, 2.0], [3.0, 3.0], [4.0, 4.0]])
    mesh = create_mesh(
        MPI.COMM_SELF,
        np.arange(6).reshape(2, 3),
        nodes,
        basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)),
    )
    good, flat = np.argsort(mesh.topology.original_cell_index)
    x = np.array([[0.2, 0.3], [3.0, 3.0], [0.2, 0.3], [0.2, 0.3], [0.9, 0.9]])
    X, status = inverse_map(mesh, x, np.array([good, flat, -1, 2, good]))
    assert status.tolist() == [0, 2, 2, 2, 1]
    assert np.isfinite(X).all()
    assert np.allclose(X[[0, 4]], x[[0, 4]], rtol=0, atol=1e-15)  # the unit triangle itself
    cells, _ = locate(mesh, x)
    assert cells.tolist() == [good, -1, good, good, -1]


def test_single_precision_mesh():
    mesh = grid("quadrilateral", dtype=np.float32)
    x, X, cells = points_in_cells(mesh, 5)
    found, reference = locate(mesh, x)
    np.testing.assert_array_equal(found, cells)
    assert np.abs(reference - X).max() < 1e-13  # its nodes are read as double precision


def test_kept_with_the_mesh_and_no_longer():
    mesh = grid("quadrilateral")
    locate(mesh, [[0.5, 0.5]])
    inverse_map(mesh, [[0.5, 0.5]], [0])
    gone = weakref.ref(mesh)
    del mesh
    gc.collect()
    assert gone() is None


def test_moved_nodes_are_noticed():
    mesh = grid("quadrilateral")
    before, _ = locate(mesh, [[2.5, 0.5]])
    mesh.geometry.x[:, 0] += 1.0
    after, X = locate(mesh, [[2.5, 0.5]])
    assert before[0] == -1 and after[0] >= 0
    again, status = inverse_map(mesh, [[2.5, 0.5]], after)
    np.testing.assert_array_equal(again, X)
    assert status[0] == 0


@pytest.mark.parametrize("kind", KINDS)
def test_facet_neighbours_are_dolfinx_s(kind):
    mesh = grid(kind)
    dim = mesh.topology.dim
    cell = reference_cell(kind, 1)
    neighbours = facet_neighbours(mesh.geometry.dofmap, cell.facets)
    mesh.topology.create_connectivity(dim, dim - 1)
    mesh.topology.create_connectivity(dim - 1, dim)
    to_facets = mesh.topology.connectivity(dim, dim - 1)
    to_cells = mesh.topology.connectivity(dim - 1, dim)
    for c, row in enumerate(neighbours):
        theirs = []
        for facet in to_facets.links(c):
            others = [k for k in to_cells.links(facet) if k != c]
            theirs.append(others[0] if others else -1)
        assert row.tolist() == theirs


@pytest.mark.parametrize("kind", ["quadrilateral", "hexahedron"])
def test_graded_mesh(kind):
    # Cells from 1e-7 to 700 wide: the tree does not mind.
    mesh = grid(kind)
    mesh.geometry.x[:] = np.sign(mesh.geometry.x) * np.abs(mesh.geometry.x) ** 10
    x, X, cells = points_in_cells(mesh, 20)
    for guess in (None, cells[::-1].copy()):
        found, reference = locate(mesh, x, guess)
        np.testing.assert_array_equal(found, cells)
        # each coordinate is rounded to eps of itself, at most a few times its cell's width
        assert np.abs(reference - X).max() < 1e-12


def test_tree_of_boxes():
    rng = np.random.default_rng(2)
    low = rng.uniform(0, 1, (37, 3))
    bounds = np.concatenate([low, low + rng.uniform(0, 0.2, (37, 3))], axis=1)
    bounds[5] = [np.inf] * 3 + [-np.inf] * 3
    tree = build_tree(bounds, 3)
    leaves = len(tree.cells)
    assert leaves == 64
    assert sorted(tree.cells[tree.cells >= 0]) == [i for i in range(37) if i != 5]
    for leaf, cell in enumerate(tree.cells):
        node = leaves - 1 + leaf
        while cell >= 0:  # every box holds those below it
            assert (tree.boxes[node, :3] <= bounds[cell, :3]).all()
            assert (tree.boxes[node, 3:] >= bounds[cell, 3:]).all()
            if node == 0:
                break
            node = (node - 1) // 2
    assert len(build_tree(bounds[:0], 2).cells) == 1


@pytest.mark.mpi
@pytest.mark.parametrize("kind", KINDS)
def test_each_rank_finds_its_own(kind):
    comm = MPI.COMM_WORLD
    mesh = grid(kind, comm)
    search = CellSearch(mesh)
    x, X, cells = points_in_cells(mesh, 5, seed=3)
    # Points in ghosts are their owners', also when the guess is the ghost.
    for guess in (None, cells):
        found, reference = locate(mesh, x, guess, search)
        mine = cells < search.num_owned
        np.testing.assert_array_equal(found, np.where(mine, cells, -1))
        assert np.abs(reference - X)[mine].max() < 1e-13  # rounding of x over cells of size 0.2
    total = comm.allreduce(search.num_owned)
    assert total == mesh.topology.index_map(mesh.topology.dim).size_global


@pytest.mark.mpi
def test_moved_nodes_on_several_ranks():
    comm = MPI.COMM_WORLD
    mesh = grid("quadrilateral", comm)
    x = [[2.5, 0.5]]
    locate(mesh, x)
    mesh.geometry.x[:, 0] += 1.0
    if comm.size > 1:
        with pytest.raises(RuntimeError, match=r"Make a new CellSearch\(mesh\)"):
            locate(mesh, x)
    cells, _ = locate(mesh, x, search=CellSearch(mesh))
    assert comm.allreduce(int(cells[0] >= 0)) == 1


@pytest.mark.mpi
def test_resolve_owners():
    comm = MPI.COMM_WORLD
    last = comm.size - 1
    # point 0: every rank has a cell; 1: only the last; 2: nobody
    mine = np.array([10 * (last - comm.rank) + 3, 7 if comm.rank == last else -1, -1])
    index, rank = resolve_owners(comm, mine)
    assert index.tolist() == [3, 7, -1]
    assert rank.tolist() == [last, last, -1]
