# SPDX-License-Identifier: MIT
"""Hard cases 5 and 7 of the search: whose a place is, on any number of ranks.

Naively each rank asks whether a place is within its cells to some tolerance: what lies on a facet
between two ranks is taken by both, or by neither, and mass is made or lost.
"""

import itertools

import basix
import numpy as np
import pytest
from dolfinx.mesh import CellType, GhostMode, create_box, create_rectangle
from mpi4py import MPI

from fenics_hytf.particles.mapping import inverse_map
from fenics_hytf.particles.search import CellSearch, locate, resolve_owners

EPS = np.finfo(np.float64).eps


# ---------------------------------------------------------------- 5


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
def test_05_places_on_entities_have_one_owner(kind, offset, ghosts, figure):
    """On every vertex, edge and facet, and 1 or 4 floating-point numbers beside, on 1 to 3 ranks.

    Naively what lies on a facet between two ranks is claimed twice, or never.
    """
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
        figure("places without one owner", np.sum(claims != 1), 0)
        mine = np.where(cells >= 0, search.input_index[cells], -1)
        index, rank = resolve_owners(comm, mine)
        figure("places whose owner is not the lowest cell", np.sum(index != owners), 0)
        off = comm.allreduce(int(np.sum((cells >= 0) != (rank == comm.rank))))
        figure("places on which ranks disagree", off, 0)
        got = np.flatnonzero(cells >= 0)
        _, status = inverse_map(mesh, x[got], cells[got])
        lost = comm.allreduce(int(np.sum(status != 0)))
        figure("places outside the cell that owns them", lost, 0)
        vertices = basix.geometry(basix.CellType[kind])
        beyond = max(vertices.min() - X.min(initial=0.5), X.max(initial=0.5) - vertices.max(), 0.0)
        # beyond the reference cell by the tolerance at most: 8 ulp of the offset over h = 0.2
        slack = 1e-11 + 1e3 * EPS * offset
        figure("X beyond the reference cell", comm.allreduce(beyond, MPI.MAX), slack)


@pytest.mark.mpi
def test_05_more_ranks_than_cells(figure):
    """Naively a rank without a cell of its own answers for its ghosts."""
    comm = MPI.COMM_WORLD
    mesh = create_rectangle(
        comm, [[0, 0], [2, 1]], [2, 1], CellType.quadrilateral, ghost_mode=GhostMode.shared_facet
    )
    x = np.array([[1.0, 0.5], [0.0, 0.0], [2.0, 1.0], [1.5, 0.5], [1.0, 1.0], [3.0, 0.5]])
    cells, _ = locate(mesh, x)
    claims = comm.allreduce((cells >= 0).astype(int))
    figure("places without one owner", np.sum(claims != [1, 1, 1, 1, 1, 0]), 0)


# ---------------------------------------------------------------- 7


@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["triangle", "quadrilateral"])
def test_07_places_a_long_jump_away_are_found(kind, figure):
    """Naively the search walks to neighbours and stops at those of its rank: 7.3 h is too far."""
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
    figure("places of a jump of 7.3 h without one owner", np.sum(claims != in_box), 0)
    index, _ = resolve_owners(comm, np.where(cells >= 0, search.input_index[cells], -1))
    off = np.sum(index != np.where(in_box, first, -1))
    figure("places of a jump of 7.3 h not found as by brute force", off, 0)
