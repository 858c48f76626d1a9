# SPDX-License-Identifier: MIT
"""Points that move, on any number of ranks: found again, counted, weighed, and where they went.

Every test compares with the same points on the same mesh held by a single rank, or with a search of
all cells by their facets' half-spaces, which shares nothing with the search that is tested.
"""

import basix
import numpy as np
import pytest
from dolfinx import fem
from dolfinx.mesh import CellType, GhostMode, Mesh, create_unit_cube, create_unit_square
from mpi4py import MPI

from fenics_hytf.particles import (
    Points,
    PointsNotFinite,
    PointsOutside,
    default_points_per_cell,
    move,
    seed,
    transfer_matrix,
)
from fenics_hytf.particles.ledger import exact_sum, rounded

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
ULP = np.finfo(np.float64).eps


def planar_mesh(cell: str, comm: MPI.Comm) -> Mesh:
    """A graded, sheared unit box (plane facets), in two dimensions distorted as well."""
    ghosts = GhostMode.shared_facet
    if cell in ("triangle", "quadrilateral"):
        mesh = create_unit_square(comm, 12, 10, CellType[cell], ghost_mode=ghosts)
    else:
        mesh = create_unit_cube(comm, 5, 6, 5, CellType[cell], ghost_mode=ghosts)
    x = mesh.geometry.x
    x[:, 0] = 0.8 * x[:, 0] + 0.2 * x[:, 0] ** 2
    if cell != "hexahedron":
        gdim = mesh.geometry.dim
        x[:, 1] += 0.04 * np.prod(np.sin(np.pi * x[:, :gdim]), axis=1)
    x[:, 0] += 0.3 * x[:, 1]
    return mesh


def regions(mesh: Mesh, filled: slice = slice(None)) -> np.ndarray:
    """0 for cells whose input index is in the slice, 1 for others."""
    index_map = mesh.topology.index_map(mesh.topology.dim)
    values = np.ones(index_map.size_global, np.int32)
    values[filled] = 0
    return values[mesh.topology.original_cell_index[: index_map.size_local + index_map.num_ghosts]]


def central_points(mesh: Mesh, size: int, radius: float = 0.25, fields=()) -> Points:
    """Points in the cells whose midpoint is near the box's centre: they have room to move."""
    gdim = mesh.geometry.dim
    midpoints = mesh.geometry.x[mesh.geometry.dofmap].mean(axis=1)[:, :gdim]
    near = np.all(np.abs(midpoints - centre(gdim)) < radius, axis=1)
    return seed(mesh, np.where(near, 0, 1).astype(np.int32), [1900.0, 0.0], size, fields)


def centre(gdim: int) -> np.ndarray:
    return np.array([0.6, 0.5, 0.5])[:gdim]


def gathered(comm: MPI.Comm, mesh: Mesh, points: Points) -> dict[str, np.ndarray]:
    """Arrays of all ranks by id, with the input index of the cell for the local one."""
    mine = points.arrays() | {"cell": mesh.topology.original_cell_index[points.cell]}
    parts = comm.allgather(mine)
    order = np.argsort(np.concatenate([part["id"] for part in parts]))
    return {name: np.concatenate([part[name] for part in parts])[order] for name in mine}


def claims(mesh: Mesh, x: np.ndarray) -> np.ndarray:
    """Largest signed distance of points to the facets of each cell, shape (n, num_cells)."""
    cell = basix.CellType[mesh.topology.cell_name()]
    gdim = mesh.geometry.dim
    nodes = mesh.geometry.x[mesh.geometry.dofmap][:, :, :gdim]
    distance = np.full((len(x), len(nodes)), -np.inf)
    for facet in basix.topology(cell)[gdim - 1]:
        a = nodes[:, facet[0]]
        edges = nodes[:, facet[1:gdim]] - a[:, None]
        normal = (
            np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
            if gdim == 2
            else np.cross(edges[:, 0], edges[:, 1])
        )
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        normal *= -np.sign(np.sum(normal * (nodes.mean(axis=1) - a), axis=1))[:, None]
        distance = np.maximum(distance, x @ normal.T - np.sum(normal * a, axis=1))
    result = np.empty_like(distance)
    result[:, mesh.topology.original_cell_index[: len(nodes)]] = distance
    return result


def translation(x: np.ndarray, step: int) -> np.ndarray:
    return np.tile(0.031 * np.array([1.0, -0.4, 0.7])[: x.shape[1]], (len(x), 1))


def rotation(x: np.ndarray, step: int) -> np.ndarray:
    r = x - centre(x.shape[1])
    c, s = np.cos(0.3), np.sin(0.3)
    turned = r.copy()
    turned[:, 0], turned[:, 1] = c * r[:, 0] - s * r[:, 1], s * r[:, 0] + c * r[:, 1]
    return turned - r


def shear(x: np.ndarray, step: int) -> np.ndarray:
    """Along one axis after the other, so that however the mesh is cut, points cross."""
    gdim = x.shape[1]
    along, across = step % gdim, (step + 1) % gdim
    d = np.zeros_like(x)
    d[:, along] = 0.15 * (x[:, across] - centre(gdim)[across])
    return d


@pytest.mark.mpi
@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("field", [translation, rotation, shear])
def test_prescribed_motion_over_cells_and_ranks(cell, field, figure):
    size = default_points_per_cell(cell, 1)
    everyone, alone = planar_mesh(cell, WORLD), planar_mesh(cell, SELF)
    gdim = alone.geometry.dim
    points = central_points(everyone, size, fields=("velocity",))
    reference = central_points(alone, size, fields=("velocity",))
    points.add("label", (2,))
    points["label"] = np.column_stack([points.id, points.mass])
    for p in (points, reference):
        p["velocity"] = 1.0 + np.sin(7 * p.x)
    mass, count = points.ledger(WORLD).mass, points.ledger(WORLD).num_points
    momentum = WORLD.allreduce(points.mass @ points["velocity"])
    start = gathered(WORLD, everyone, points)
    V = fem.functionspace(everyone, ("Lagrange", 1, (gdim,)))
    crossings, change = 0, 0.0
    for step in range(6):
        report = move(everyone, points, field(points.x, step))
        again = move(alone, reference, field(reference.x, step))
        ledger = report.ledger
        assert report.inverse_mappings == again.inverse_mappings == count
        assert (ledger.num_points, ledger.mass, ledger.imbalance) == (count, mass, 0.0)
        crossings += ledger.migrated
        # points and nodes carry the momentum they started with: sums of 1e3 terms, 1e-13
        here = WORLD.allreduce(points.mass @ points["velocity"])
        weight = points.mass[:, None] * points["velocity"]
        nodes = WORLD.allreduce((transfer_matrix(points, V).T @ weight).sum(axis=0))
        change = max(change, *(np.abs(p / momentum - 1).max() for p in (here, nodes)))
    figure(f"momentum after six steps of {field.__name__}, {cell}", change, 1e-13)
    now, expected = gathered(WORLD, everyone, points), gathered(SELF, alone, reference)
    assert np.array_equal(now["label"], np.column_stack([now["id"], now["mass"]]))
    for name, values in expected.items():  # the same sets as on a single rank, to the last bit
        if name == "X":  # but for the guess the search started from
            assert np.abs(now["X"] - values).max() < 1e-13
        else:
            assert np.array_equal(now[name], values), name
    assert np.abs(now["x"] - start["x"] - now["displacement"]).max() < 20 * ULP
    distance = claims(alone, now["x"])
    chosen = np.take_along_axis(distance, now["cell"][:, None], axis=1)
    assert chosen.max() < 1e-12  # brute force: it lies in that cell, to 1e-12 of cells of 0.1
    if WORLD.size > 1:
        assert crossings > 0
    if field is translation:
        assert np.all(now["cell"] != start["cell"])
    owned = everyone.topology.index_map(gdim).size_local
    assert np.all((points.cell >= 0) & (points.cell < owned))
    order = np.lexsort((points.id, everyone.topology.original_cell_index[points.cell]))
    assert np.array_equal(order, np.arange(len(points)))


@pytest.mark.mpi
def test_what_does_not_move_is_not_searched():
    mesh = planar_mesh("quadrilateral", WORLD)
    points = seed(mesh, regions(mesh), [1900.0, 0.0], 4)
    before = {name: values.copy() for name, values in points.arrays().items()}
    report = move(mesh, points, np.zeros_like(points.x))
    assert report.inverse_mappings == 0
    assert report.ledger == points.ledger(WORLD)
    for name, values in before.items():
        assert np.array_equal(points.arrays()[name], values)


@pytest.mark.mpi
def test_ranks_without_points_take_part():
    mesh, alone = planar_mesh("triangle", WORLD), planar_mesh("triangle", SELF)
    first = slice(0, 1)  # one cell holds points, so one rank
    points = seed(mesh, regions(mesh, first), [1900.0, 0.0], 3)
    reference = seed(alone, regions(alone, first), [1900.0, 0.0], 3)
    target = centre(2)
    for p, m in ((points, mesh), (reference, alone)):
        move(m, p, 0.9 * (target - p.x))
    now, expected = gathered(WORLD, mesh, points), gathered(SELF, alone, reference)
    assert np.array_equal(now["id"], expected["id"])
    assert np.array_equal(now["cell"], expected["cell"])
    assert points.ledger(WORLD) == reference.ledger(SELF)


# ---------------------------------------------------------------- leaving the mesh


def leave(points: Points) -> np.ndarray:
    """Displacements that take the points right of x = 1 + 0.3 y - 0.25 out of the mesh."""
    d = np.zeros_like(points.x)
    d[points.x[:, 0] > 0.75 + 0.3 * points.x[:, 1], 0] = 0.5
    return d


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["quadrilateral", "tetrahedron"])
def test_error_names_points_and_leaves_them_as_they_were(cell):
    mesh = planar_mesh(cell, WORLD)
    points = seed(mesh, regions(mesh), [1900.0, 0.0], 4)
    before = {name: values.copy() for name, values in points.arrays().items()}
    d = leave(points)
    lost = np.concatenate(WORLD.allgather(points.id[d[:, 0] > 0]))
    with pytest.raises(PointsOutside) as caught:
        move(mesh, points, d)
    message = str(caught.value)
    assert len(set(WORLD.allgather(message))) == 1  # the same on every rank
    assert f"Found that {lost.size} points left the mesh" in message
    for identity in np.sort(lost)[:5]:
        assert f"point {identity} (" in message
    for name, values in before.items():
        assert np.array_equal(points.arrays()[name], values)
    move(mesh, points, np.zeros_like(points.x))  # and the points go on


@pytest.mark.mpi
@pytest.mark.parametrize("outside", ["park", "delete"])
def test_mass_that_left_is_in_the_ledger(outside):
    mesh, alone = planar_mesh("quadrilateral", WORLD), planar_mesh("quadrilateral", SELF)
    points = seed(mesh, regions(mesh), [1900.0, 0.0], 9, ("stress",))
    reference = seed(alone, regions(alone), [1900.0, 0.0], 9, ("stress",))
    total, count = points.ledger(WORLD).mass, points.ledger(WORLD).num_points
    ledgers = []
    for _ in range(3):  # out, in twice more, without getting lost again
        report = move(mesh, points, leave(points), outside)
        again = move(alone, reference, leave(reference), outside)
        ledgers.append(report.ledger.as_dict() | {"migrated": 0})
        assert ledgers[-1] == again.ledger.as_dict()
    last = report.ledger
    gone, gone_mass = (
        (last.parked, last.parked_mass) if outside == "park" else (last.deleted, last.deleted_mass)
    )
    assert 0 < gone < count and last.num_points == count - gone
    assert last.parked + last.deleted == gone
    assert last.imbalance <= 1e-14 and last.initial_mass == total
    assert abs(last.mass + gone_mass - total) <= 2 * ULP * total  # three numbers, rounded once each
    if outside == "park":
        mass = sum(WORLD.allgather(exact_sum(points.parked["mass"])))
        assert rounded(mass) == gone_mass
        assert points.parked["stress"].shape == (len(points.parked["id"]), 3)
        assert np.all(points.parked["cell"] == -1)
        ids = [np.concatenate(WORLD.allgather(p["id"])) for p in (points.parked, points.arrays())]
        assert np.array_equal(np.sort(np.concatenate(ids)), np.arange(count))


@pytest.mark.mpi
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_displacements_that_are_no_numbers_stop_every_rank(bad):
    mesh = planar_mesh("hexahedron", WORLD)
    points = seed(mesh, regions(mesh), [1900.0, 0.0], 8)
    d = np.full_like(points.x, 1e-3)
    d[np.isin(points.id, [37, 1100])] = bad
    before = points.x.copy()
    with pytest.raises(PointsNotFinite, match=r"2 points.*first point 37 .*; point 1100 "):
        move(mesh, points, d)
    assert np.array_equal(points.x, before)


@pytest.mark.mpi
def test_move_refuses():
    mesh = planar_mesh("quadrilateral", WORLD)
    points = seed(mesh, regions(mesh), [1900.0, 0.0], 4)
    with pytest.raises(ValueError, match="expected one of error, park, delete"):
        move(mesh, points, np.zeros_like(points.x), "ignore")
    last = WORLD.rank == WORLD.size - 1  # one rank's fault stops all of them
    with pytest.raises(ValueError, match="Found displacements of shape"):
        move(mesh, points, np.zeros((1, 3)) if last else np.zeros_like(points.x))
