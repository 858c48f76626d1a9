# SPDX-License-Identifier: MIT
"""Points of all ranks as plain arrays, and back onto as many ranks, or another number."""

from __future__ import annotations

import numpy as np
import pytest
from dolfinx.mesh import CellType, GhostMode, Mesh, create_unit_cube, create_unit_square
from mpi4py import MPI

from fenics_hytf.particles import Points, gather_points, move, scatter_points, seed
from fenics_hytf.simulation.packing import pack, unpack

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
RULE = {"triangle": 3, "quadrilateral": 4, "tetrahedron": 4, "hexahedron": 8}

pytestmark = pytest.mark.mpi


def box(cell: str, comm: MPI.Comm) -> Mesh:
    ghosts = GhostMode.shared_facet
    if cell in ("triangle", "quadrilateral"):
        return create_unit_square(comm, 8, 6, CellType[cell], ghost_mode=ghosts)
    return create_unit_cube(comm, 4, 3, 3, CellType[cell], ghost_mode=ghosts)


def wandered(mesh: Mesh, cell: str, outside="park", steps=2) -> Points:
    """Points with a history that have moved, some of them out of the mesh."""
    local = mesh.topology.index_map(mesh.topology.dim)
    regions = np.zeros(local.size_local + local.num_ghosts, np.int32)
    points = seed(mesh, regions, [1835.7], RULE[cell], ("stress", "velocity"))
    points.add("label", (2, 2))
    points["label"] = np.random.default_rng(5).random((10**4, 2, 2))[points.id]
    for step in range(steps):
        d = 0.09 * np.sin(5 * points.x + step) + 0.12
        points["velocity"] = d
        points["stress"] = np.outer(points.mass, np.arange(1.0, 1 + points["stress"].shape[1]))
        move(mesh, points, d, outside)
    return points


def everything(points: Points) -> dict[str, np.ndarray]:
    return points.arrays() | {f"parked/{n}": a for n, a in points.parked.items()}


def account(points: Points) -> tuple[int, ...]:
    return points.deleted, points.deleted_mass, points.initial_mass


def identical(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> bool:
    return list(a) == list(b) and all(
        x.dtype == y.dtype and x.shape == y.shape and x.tobytes() == y.tobytes()
        for x, y in zip(a.values(), b.values(), strict=True)
    )


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("outside", ["park", "delete"])
def test_on_as_many_ranks_each_has_its_very_points(cell, outside):
    mesh = box(cell, WORLD)
    points = wandered(mesh, cell, outside)
    gathered = gather_points(points, mesh)
    assert (gathered is None) == (WORLD.rank > 0)
    arrays = WORLD.bcast(gathered)
    again = scatter_points(arrays, mesh)
    assert identical(everything(points), everything(again)) and len(points) == len(again)
    assert account(points) == account(again)
    assert again.ledger(WORLD) == points.ledger(WORLD)
    lost = again.ledger(WORLD)
    assert lost.parked + lost.deleted > 0 and lost.imbalance == 0.0
    assert np.array_equal(arrays["id"], np.sort(arrays["id"])) and len(arrays["id"])
    for p in (points, again):  # and they go on alike
        move(mesh, p, 0.02 * np.cos(3 * p.x), outside)
    assert identical(everything(points), everything(again))


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("outside", ["park", "delete"])
def test_from_any_number_of_ranks_to_another(cell, outside):
    """What one rank wrote is taken up by all, and what all wrote by one."""
    mesh, alone = box(cell, WORLD), box(cell, SELF)
    points, reference = wandered(mesh, cell, outside), wandered(alone, cell, outside)
    by_all = WORLD.bcast(gather_points(points, mesh))
    by_one = gather_points(reference, alone)
    ledger = reference.ledger(SELF)
    spread, joined = scatter_points(by_one, mesh), scatter_points(by_all, alone)
    for taken, comm in ((spread, WORLD), (joined, SELF)):
        now = taken.ledger(comm)
        assert now == ledger and now.imbalance == 0.0
    again = WORLD.bcast(gather_points(spread, mesh))
    state = [name for name in by_one if not name.startswith(("parked", "deleted", "initial"))]
    assert identical({n: by_one[n] for n in state}, {n: again[n] for n in state})
    assert sorted(by_one["parked/id"]) == sorted(again["parked/id"])
    # every point is in a cell of its rank, in the order of a rank's points
    index = mesh.topology.original_cell_index
    assert np.all(spread.cell < mesh.topology.index_map(mesh.topology.dim).size_local)
    order = np.lexsort((spread.id, index[spread.cell]))
    assert np.array_equal(order, np.arange(len(spread)))
    # the reference coordinates hold in the other mesh's cell: it has its corners in the same order
    nodes = mesh.geometry.x[mesh.geometry.dofmap[spread.cell]][:, :, : mesh.geometry.dim]
    shape = mesh.geometry.cmap.push_forward
    where = [
        shape(X[None], np.ascontiguousarray(x))[0] for X, x in zip(spread.X, nodes, strict=True)
    ]
    assert np.allclose(np.array(where).reshape(spread.x.shape), spread.x, rtol=0, atol=1e-14)


def test_points_that_never_moved_and_carry_nothing():
    mesh = box("quadrilateral", WORLD)
    local = mesh.topology.index_map(2)
    regions = np.ones(local.size_local + local.num_ghosts, np.int32)
    points = seed(mesh, regions, [1800.0, 0.0], 4)
    arrays = WORLD.bcast(gather_points(points, mesh))
    assert len(scatter_points(arrays, mesh)) == 0
    points = seed(mesh, regions, [0.0, 1800.0], 4)
    arrays = WORLD.bcast(gather_points(points, mesh))
    again = scatter_points(arrays, mesh)
    assert identical(everything(points), everything(again)) and again.history == {}


def test_they_survive_a_checkpoint():
    mesh = box("triangle", WORLD)
    points = wandered(mesh, "triangle")
    arrays = {}
    tree = pack(gather_points(points, mesh), "points", arrays)
    tree, arrays = WORLD.bcast((tree, arrays))
    again = scatter_points(unpack(tree, dict[str, np.ndarray], arrays, "points"), mesh)
    assert identical(everything(points), everything(again)) and account(points) == account(again)


def test_another_mesh_is_refused():
    mesh = box("triangle", WORLD)
    points = wandered(mesh, "triangle")
    arrays = WORLD.bcast(gather_points(points, mesh))
    other = create_unit_square(WORLD, 3, 3, CellType.triangle, ghost_mode=GhostMode.shared_facet)
    with pytest.raises(ValueError, match="cells that the mesh has not"):
        scatter_points(arrays, other)
