# SPDX-License-Identifier: MIT
"""Pieces of soil: they tile cells, ride a flow, and fill cells as the soil does.

What the soil does is known from many more points that ride the same flow, in closed form.
"""

import dolfinx.mesh
import numpy as np
import pytest
from dolfinx.mesh import CellType
from mpi4py import MPI

from fenics_hytf.particles import Points, carry_pieces, first_pieces, move, piece_integrals, seed

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
SIDE = 12  # cells of 1 m along a side of the mesh
LOW, HIGH = 3, 9  # where soil is, along both axes
FINE = 24  # tracers along a side of a cell
TURN = 3.0  # of the middle [rad]


def square(comm, lean=0.0):
    mesh = dolfinx.mesh.create_rectangle(
        comm, [[0.0, 0.0], [SIDE, SIDE]], (SIDE, SIDE), CellType.quadrilateral
    )
    mesh.geometry.x[:, 0] += lean * mesh.geometry.x[:, 1]
    return mesh


def places(mesh):
    """Row by row, the number of each owned cell."""
    owned = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    middle = dolfinx.mesh.compute_midpoints(mesh, 2, owned)
    top = mesh.comm.allreduce(mesh.geometry.x[:, 0].max(), MPI.MAX)
    column = np.floor(middle[:, 0] - (top / SIDE - 1) * middle[:, 1]).astype(int)
    return np.floor(middle[:, 1]).astype(int) * SIDE + column


def soil(mesh, count) -> Points:
    """Points with pieces in a block of cells."""
    row, column = np.divmod(places(mesh), SIDE)
    inside = (row >= LOW) & (row < HIGH) & (column >= LOW) & (column < HIGH)
    points = seed(mesh, np.where(inside, 0, 1).astype(np.int32), [1.0, 0.0], count)
    points.add("piece", (2, 3))
    points["piece"] = first_pieces(mesh, points, count)
    return points


def share(mesh, volume):
    """Volume over that of the cell of 1 m2, all cells row by row."""
    whole = np.zeros(SIDE * SIDE)
    whole[places(mesh)] = volume
    return WORLD.allreduce(whole) if mesh.comm.size > 1 else whole


def filled(mesh, points):
    return share(mesh, piece_integrals(mesh, points, np.ones((len(points), 1)))[:, 0])


def turned(x, part):
    """Where a vortex takes places in a part of its time, and the gradient of the way there."""
    away = x - SIDE / 2
    rate = part * TURN * np.exp(-np.sum(away**2, axis=1) / 8)
    c, s = np.cos(rate), np.sin(rate)
    R = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    way = np.einsum("pij,pj->pi", R, away) - away
    of_velocity = rate[:, None, None] * quarter - np.einsum(
        "p,ij,pj,pk->pik", rate / 4, quarter, away, away
    )
    return way, of_velocity


@pytest.mark.mpi
@pytest.mark.parametrize("lean", [0.0, 0.3])
@pytest.mark.parametrize("count", [4, 9, 16])
def test_pieces_tile_cells(count, lean):
    mesh = square(WORLD, lean)
    points = soil(mesh, count)
    area = np.abs(np.linalg.det(points["piece"][:, :, :2]))
    np.testing.assert_allclose(area, points.volume, rtol=1e-13)
    found = filled(mesh, points)
    np.testing.assert_allclose(found, np.round(found), atol=1e-13)
    assert np.count_nonzero(found) == (HIGH - LOW) ** 2


@pytest.mark.mpi
def test_pieces_fill_cells_as_many_more_points_do(figure):
    """A vortex draws a block out by strains up to two; its soil is nowhere denser."""
    mesh = square(WORLD)
    points = soil(mesh, 9)
    steps = 40
    for _ in range(steps):
        way, gradient = turned(points.x, 1 / steps)
        carry_pieces(points, gradient)
        move(mesh, points, way)
    fine = LOW + (np.arange(FINE * (HIGH - LOW)) + 0.5) / FINE
    tracers = np.stack(np.meshgrid(fine, fine), axis=-1).reshape(-1, 2)
    column, row = np.floor(tracers + turned(tracers, 1.0)[0]).astype(int).T
    true = np.bincount(row * SIDE + column, minlength=SIDE * SIDE) / FINE**2
    counted = np.bincount(points.cell, points.volume, mesh.topology.index_map(2).size_local)
    found = filled(mesh, points)
    figure("pieces in a vortex: fill off that of tracers", np.abs(found - true).max(), 0.05)
    figure("pieces in a vortex: largest fill", found.max(), 1.05)
    assert np.abs(share(mesh, counted) - true).max() > 0.1  # what points alone say
    assert found.sum() == pytest.approx((HIGH - LOW) ** 2, rel=1e-13)


@pytest.mark.mpi
def test_what_sticks_out_of_the_mesh_counts_to_the_cell_of_its_point():
    mesh = square(WORLD)
    points = soil(mesh, 4)
    move(mesh, points, np.tile([2.9, 0.0], (len(points), 1)))  # middles of pieces come to 11.65
    points["piece"][:, 0, 0] *= 4
    found = filled(mesh, points)
    assert found.sum() == pytest.approx((HIGH - LOW) ** 2, rel=1e-13)
    assert found.reshape(SIDE, SIDE)[LOW:HIGH, -1].min() > 0.8  # 0.7 lies inside


@pytest.mark.mpi
def test_values_are_spread_with_the_soil():
    mesh = square(WORLD)
    points = soil(mesh, 9)
    height = points.x[:, 1:]
    ones, heights = piece_integrals(mesh, points, np.column_stack([np.ones(len(points)), height])).T
    mean = share(mesh, heights) / np.where(share(mesh, ones) > 0, share(mesh, ones), 1.0)
    rows = np.arange(SIDE * SIDE) // SIDE
    block = share(mesh, ones) > 0
    np.testing.assert_allclose(mean[block], rows[block] + 0.5, rtol=1e-13)


def test_pieces_of_simplices_are_squares():
    mesh = dolfinx.mesh.create_unit_square(SELF, 2, 2, CellType.triangle)
    points = seed(mesh, np.zeros(8, np.int32), [1.0], 3)
    pieces = first_pieces(mesh, points, 3)
    expected = np.multiply.outer(np.sqrt(points.volume), np.eye(2))
    np.testing.assert_allclose(pieces[:, :, :2], expected)
    assert not pieces[:, :, 2].any()
