# SPDX-License-Identifier: MIT
"""Hard cases 5, 7 and 8 on the store of points: owners, long jumps, losses, crowds and empty ranks.

Naively ranks hand points to their neighbours only, what lies on a facet goes twice or not at all,
lost points are dropped without a word, and a rank without points waits for ever. The same points
on a single rank are the reference, and a search of the grid's lines.
"""

import itertools

import basix
import numpy as np
import pytest
from dolfinx import fem
from dolfinx.mesh import CellType, GhostMode, Mesh, create_unit_cube, create_unit_square
from mpi4py import MPI

from fenics_hytf.particles import (
    Points,
    PointsOutside,
    default_points_per_cell,
    move,
    particle_mass_matrix,
    seed,
    transfer_matrix,
)

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
DENSITY = 1835.0
CROWDED = {"triangle": 49, "quadrilateral": 100, "tetrahedron": 214, "hexahedron": 1000}


def box(cell: str, n: int, comm: MPI.Comm, grading: float = 1.0) -> Mesh:
    """The unit box with n cells a side, lines at (i/n)^grading."""
    ghosts = GhostMode.shared_facet
    if cell in ("triangle", "quadrilateral"):
        mesh = create_unit_square(comm, n, n, CellType[cell], ghost_mode=ghosts)
    else:
        mesh = create_unit_cube(comm, n, n, n, CellType[cell], ghost_mode=ghosts)
    mesh.geometry.x[:] = mesh.geometry.x**grading
    return mesh


def fill(mesh: Mesh, size: int) -> Points:
    index_map = mesh.topology.index_map(mesh.topology.dim)
    regions = np.zeros(index_map.size_local + index_map.num_ghosts, np.int32)
    return seed(mesh, regions, [DENSITY], size)


def gathered(comm: MPI.Comm, mesh: Mesh, points: Points) -> dict[str, np.ndarray]:
    """Arrays of all ranks by id, with the input index of the cell and the rank that holds it."""
    mine = points.arrays() | {
        "cell": mesh.topology.original_cell_index[points.cell],
        "rank": np.full(len(points), comm.rank),
    }
    parts = comm.allgather(mine)
    order = np.argsort(np.concatenate([part["id"] for part in parts]))
    return {name: np.concatenate([part[name] for part in parts])[order] for name in mine}


def entities(cell: str, n: int, grading: float) -> np.ndarray:
    """Every vertex of the box's mesh, and the midpoint of every edge and facet [m]."""
    mesh = box(cell, n, SELF, grading)
    gdim = mesh.geometry.dim
    nodes = mesh.geometry.x[mesh.geometry.dofmap][:, :, :gdim]
    topology = basix.topology(basix.CellType[cell])
    return np.concatenate([nodes[:, e].mean(axis=1) for dim in range(gdim) for e in topology[dim]])


# ---------------------------------------------------------------- case 5


@pytest.mark.mpi
@pytest.mark.parametrize("grading", [1.0, 1.3])
@pytest.mark.parametrize(
    ("cell", "n"), [("triangle", 4), ("quadrilateral", 4), ("tetrahedron", 2), ("hexahedron", 2)]
)
def test_05_points_on_entities_keep_all_their_mass(cell, n, grading, figure):
    """Naively a point on a facet is counted by both cells, or its mass is summed in any order."""
    places = np.unique(entities(cell, n, grading), axis=0)
    gdim = places.shape[1]
    targets = [places]
    for axis, ulps in itertools.product(range(gdim), (-4, -1, 1, 4)):
        shifted = places.copy()
        shifted[:, axis] += ulps * np.spacing(shifted[:, axis])
        targets.append(shifted)
    face = places[places[:, 0] == 0.0]
    face[:, 0] = -1.8e-18  # just outside the fixed face
    targets = np.concatenate([*targets, face])

    states = []
    for comm in (WORLD, SELF):
        mesh = box(cell, n, comm, grading)
        points = fill(mesh, CROWDED[cell])
        total = points.ledger(comm).num_points
        assert total >= len(targets)
        mass = points.ledger(comm).mass
        move(mesh, points, -points.x)  # all of them to the corner at 0, exactly: x - x = 0
        assert not points.x.any()
        report = move(mesh, points, targets[points.id % len(targets)])  # and on: 0 + x = x
        figure("points lost on entities", abs(report.ledger.num_points - total), 0)
        # exact, no tolerance
        figure("mass lost on entities", abs(report.ledger.mass - mass), 0, "kg")
        figure("imbalance of the ledger on entities", report.ledger.imbalance, 0)
        states.append((gathered(comm, mesh, points), report.ledger))
    (now, ledger), (alone, ledger_alone) = states
    assert np.array_equal(now["id"], np.arange(total))  # each point once: exactly one owner
    assert np.array_equal(now["x"], targets[now["id"] % len(targets)])
    figure("points in another cell than on one rank", np.sum(now["cell"] != alone["cell"]), 0)
    figure("mass off that on one rank", abs(ledger.mass - ledger_alone.mass), 0, "kg")
    # Of points in one place, all go to one cell.
    _, same = np.unique(now["x"], axis=0, return_inverse=True)
    first = np.full(same.max() + 1, -1)
    first[same] = now["cell"]
    figure("points in one place but in several cells", np.sum(now["cell"] != first[same]), 0)


# ---------------------------------------------------------------- case 7


def grid_cells(mesh: Mesh, x: np.ndarray) -> np.ndarray:
    """Input index of the cell between the grid's lines around each point: brute force."""
    gdim = mesh.geometry.dim
    lines = [np.unique(mesh.geometry.x[:, axis]) for axis in range(gdim)]
    midpoints = mesh.geometry.x[mesh.geometry.dofmap].mean(axis=1)
    size = tuple(len(line) - 1 for line in lines)
    table = np.empty(size, np.int64)

    def box_of(at: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(np.searchsorted(lines[i], at[:, i]) - 1 for i in range(gdim))

    table[box_of(midpoints)] = mesh.topology.original_cell_index[: len(midpoints)]
    return table[box_of(x)]


@pytest.mark.mpi
@pytest.mark.parametrize(("cell", "n"), [("quadrilateral", 16), ("hexahedron", 10)])
def test_07_points_that_jump_far_across_ranks_are_kept(cell, n, figure):
    """Naively only neighbours of a rank are asked: a jump of 7.3 h beyond them is a loss."""
    jump = 7.3 / n
    mesh, alone = box(cell, n, WORLD, 1.1), box(cell, n, SELF, 1.1)
    points = fill(mesh, default_points_per_cell(cell, 1))
    count, mass = points.ledger(WORLD).num_points, points.ledger(WORLD).mass
    migrated = 0
    for axis in range(mesh.geometry.dim):
        d = np.zeros_like(points.x)
        d[points.x[:, axis] < 1 - jump, axis] = jump
        d[points.x[:, axis] > jump, axis] = -jump
        report = move(mesh, points, d)
        migrated += report.ledger.migrated
        figure("points lost in a jump of 7.3 h", abs(report.ledger.num_points - count), 0)
        figure("mass lost in a jump of 7.3 h", abs(report.ledger.mass - mass), 0, "kg")
        figure("imbalance of the ledger after a jump", report.ledger.imbalance, 0)
        now = gathered(WORLD, mesh, points)
        assert np.array_equal(now["id"], np.arange(count))
        off = np.sum(now["cell"] != grid_cells(alone, now["x"]))
        figure("points of a jump of 7.3 h not where brute force has them", off, 0)
    if WORLD.size > 1:
        assert migrated > count // 10


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["quadrilateral", "tetrahedron"])
@pytest.mark.parametrize("outside", ["error", "park", "delete"])
@pytest.mark.parametrize("face", ["surface", "side", "base"])
def test_07_points_that_leave_are_accounted_for(cell, outside, face, figure):
    """Naively they vanish, and mass with them; here they are an error, parked or deleted."""
    states = []
    for comm in (WORLD, SELF):
        mesh = box(cell, 4, comm, 1.1)
        points = fill(mesh, default_points_per_cell(cell, 2))
        up = points.x.shape[1] - 1
        axis, sign = {"surface": (up, 1), "side": (0, 1), "base": (up, -1)}[face]
        first = points.ledger(comm)
        d = np.zeros_like(points.x)
        d[:, axis] = sign * 0.1
        leaving = comm.allreduce(np.sum(np.abs(points.x[:, axis] + d[:, axis] - 0.5) > 0.5))
        if outside == "error":
            before = points.x.copy()
            with pytest.raises(PointsOutside, match=f"Found that {leaving} points left the mesh"):
                move(mesh, points, d, outside)
            moved = comm.allreduce(int(np.sum(points.x != before)))
            figure("coordinates changed by a move that is refused", moved, 0)
            assert points.ledger(comm) == first
            continue
        for _ in range(3):
            d = np.zeros_like(points.x)
            d[:, axis] = sign * 0.1
            ledger = move(mesh, points, d, outside).ledger
            figure("imbalance of the ledger of what leaves", ledger.imbalance, 1e-14)
            lost = ledger.num_points + ledger.parked + ledger.deleted - first.num_points
            figure("points of which the ledger does not know", abs(lost), 0)
            assert ledger.initial_mass == first.mass
        assert (ledger.deleted if outside == "park" else ledger.parked) == 0
        assert ledger.parked + ledger.deleted > leaving > 0
        states.append(ledger.as_dict() | {"migrated": 0})
    assert outside == "error" or states[0] == states[1]  # to the last bit


# ---------------------------------------------------------------- case 8


def dense_mass(mesh: Mesh, points: Points) -> np.ndarray:
    """M of all ranks by the input's nodes [kg/m], the same on every rank."""
    V = fem.functionspace(mesh, ("Lagrange", 1, (mesh.geometry.dim,)))
    M = particle_mass_matrix(transfer_matrix(points, V), points.mass).tocoo()
    node = np.empty(M.shape[0], np.int64)
    node[V.dofmap.list.reshape(-1)] = mesh.geometry.input_global_indices[
        mesh.geometry.dofmap.reshape(-1)
    ]
    size = V.dofmap.index_map.size_global
    dense = np.zeros((size, size))
    np.add.at(dense, (node[M.row], node[M.col]), M.data)
    return mesh.comm.allreduce(dense)


@pytest.mark.mpi
@pytest.mark.parametrize(("cell", "size"), [("quadrilateral", 100), ("triangle", 49)])
def test_08_a_crowd_in_one_cell(cell, size, figure):
    """Naively what ranks have of 1e5 points is summed as it comes, and no two runs are alike."""
    n = 32
    matrices = []
    for comm in (WORLD, SELF):
        mesh = box(cell, n, comm)
        points = fill(mesh, size)
        count = points.ledger(comm).num_points
        assert count > 1e5
        corner = np.array([20.0, 9.0]) / n
        # The body scaled down into one square, and there to the right below the diagonal.
        target = corner + ([0.5, 0.1] + [0.4, 0.3] * points.x) / n
        report = move(mesh, points, target - points.x)
        figure("points lost in a crowd", abs(report.ledger.num_points - count), 0)
        assert report.ledger.imbalance == 0.0
        assert comm.allreduce(len(np.unique(points.cell))) == 1  # the others' ranks are empty
        matrices.append(dense_mass(mesh, points))
        now = gathered(comm, mesh, points)
    # The points of a cell are summed in the order of their ids wherever they are. What rounding is
    # left stems from X, known to 1e-13, and sqrt(m): 1e-13 of the largest entry.
    scale = matrices[1].max()
    off = np.abs(matrices[0] - matrices[1]).max() / scale
    figure("M of a crowd off that of one rank", off, 1e-13)
    # By hand: shape functions of that cell written out.
    s, t = (now["x"] * n - corner * n).T
    if cell == "quadrilateral":
        shape = [(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t]
    else:
        shape = [1 - s, s - t, t]
    expected = np.einsum("ip,jp,p->ij", shape, shape, now["mass"])
    filled = np.flatnonzero(matrices[1].any(axis=0))
    assert filled.size == len(shape)
    found = np.sort(np.linalg.eigvalsh(matrices[1][np.ix_(filled, filled)]))
    # independent of the numbering of nodes; sums of 1e5 terms, in another order
    exact = np.linalg.eigvalsh(expected)
    figure(
        "eigenvalues of M of a crowd over the largest", abs(found - exact).max() / exact[-1], 1e-12
    )


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_08_ranks_without_points(cell, figure):
    """Naively a rank that has nothing to send does not answer, or an empty array has no shape."""
    states = []
    for comm in (WORLD, SELF):
        mesh = box(cell, 4, comm)
        index_map = mesh.topology.index_map(mesh.topology.dim)
        local = index_map.size_local + index_map.num_ghosts
        first = mesh.topology.original_cell_index[:local] == 0
        rule = default_points_per_cell(cell, 1)
        points = seed(mesh, first.astype(np.int32), [0.0, DENSITY], rule)
        if comm is WORLD and comm.size > 1:
            assert min(comm.allgather(len(points))) == 0
        empty = dense_mass(mesh, points)
        ledger = move(mesh, points, np.full_like(points.x, 0.51)).ledger
        figure("points lost beside empty ranks", abs(ledger.num_points - rule), 0)
        states.append((empty, dense_mass(mesh, points), ledger.mass))
    for before, after in zip(*states, strict=True):
        # X is known to 1e-13 of a cell after the move, and to the bit before it
        off = np.abs(before - after).max() / np.abs(after).max()
        figure("M beside empty ranks off that of one rank", off, 1e-13)
