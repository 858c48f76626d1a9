# SPDX-License-Identifier: MIT
"""Locating moved points, against dolfinx: printed side by side, measured in one run."""

import time

import basix
import numpy as np
import pytest
from dolfinx.geometry import bb_tree, compute_colliding_cells, compute_collisions_points
from dolfinx.mesh import CellType, create_box, create_rectangle
from mpi4py import MPI

from fenics_hytf.particles.mapping import inverse_map
from fenics_hytf.particles.search import CellSearch, locate

pytestmark = pytest.mark.benchmark

COLUMNS, ROWS, PER_CELL = 400, 100, 25  # 1 000 000 points
SAMPLE = 100_000  # points that dolfinx is given; its cost a point does not depend on their number


def push_forward(mesh, cells, X):
    table = basix.create_element(
        basix.ElementFamily.P,
        basix.CellType[mesh.topology.cell_name()],
        1,
        basix.LagrangeVariant.gll_warped,
    ).tabulate(0, X)[0, :, :, 0]
    return np.einsum("ni,nid->nd", table, mesh.geometry.x[mesh.geometry.dofmap[cells]])


def distorted_rectangle():
    mesh = create_rectangle(
        MPI.COMM_SELF, [[0, 0], [COLUMNS, ROWS]], [COLUMNS, ROWS], CellType.quadrilateral
    )
    x = mesh.geometry.x
    inner = (x[:, 0] > 0) & (x[:, 0] < COLUMNS) & (x[:, 1] > 0) & (x[:, 1] < ROWS)
    x[inner, :2] += np.random.default_rng(0).uniform(-0.25, 0.25, (inner.sum(), 2))
    return mesh


def moved_points(mesh):
    """Points of every cell, moved by up to 0.7 h inside the rectangle, and their old cells."""
    cells = np.repeat(np.arange(COLUMNS * ROWS), PER_CELL)
    x = push_forward(mesh, cells, np.random.default_rng(1).uniform(0, 1, (len(cells), 2)))
    size = np.array([COLUMNS, ROWS, 1.0])
    wave = np.sin(np.pi * x / size)  # nothing moves through the sides
    x[:, 0] += 0.5 * wave[:, 0] * np.cos(0.13 * x[:, 1])
    x[:, 1] += 0.5 * wave[:, 1] * np.cos(0.11 * x[:, 0])
    return x, cells


def best_of(times, call):
    """The least wall time [s] of several calls, and what the last returned."""
    seconds = []
    for _ in range(times):
        start = time.perf_counter()
        result = call()
        seconds.append(time.perf_counter() - start)
    return min(seconds), result


def dolfinx_locate(mesh, x):
    """Search and inverse mapping with dolfinx, points grouped by the cell they are found in.

    Returns the cell of each point, its reference coordinates, NaN where pull_back raised, and how
    often it raised; a cell whose points it refuses together is tried again point by point.
    """
    candidates = compute_collisions_points(bb_tree(mesh, mesh.topology.dim), x)
    colliding = compute_colliding_cells(mesh, candidates, x)
    cells = np.full(len(x), -1)
    found = np.diff(colliding.offsets) > 0
    cells[found] = colliding.array[colliding.offsets[:-1][found]]
    X = np.full((len(x), mesh.topology.dim), np.nan)
    order = np.argsort(cells, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(cells[order])) + 1)
    nodes, dofmap, cmap = mesh.geometry.x, mesh.geometry.dofmap, mesh.geometry.cmap
    raised = 0
    for group in groups:
        cell = cells[group[0]]
        if cell < 0:
            continue
        try:
            X[group] = cmap.pull_back(x[group], nodes[dofmap[cell]])
        except RuntimeError:
            raised += 1
            for i in group:
                try:
                    X[i] = cmap.pull_back(x[i : i + 1], nodes[dofmap[cell]])
                except RuntimeError:
                    raised += 1
    return cells, X, raised


def test_locate_a_million_moved_points():
    mesh = distorted_rectangle()
    x, old = moved_points(mesh)
    start = time.perf_counter()
    search = CellSearch(mesh)
    build = time.perf_counter() - start
    locate(mesh, x[:10], old[:10], search)  # compiles

    guided, (cells, X) = best_of(3, lambda: locate(mesh, x, old, search))
    alone, (cells_alone, _) = best_of(3, lambda: locate(mesh, x, None, search))
    mapping, (_, status) = best_of(3, lambda: inverse_map(mesh, x, cells))

    cell_order = np.random.default_rng(2).choice(COLUMNS * ROWS, SAMPLE // PER_CELL, replace=False)
    sample = (np.sort(cell_order)[:, None] * PER_CELL + np.arange(PER_CELL)).ravel()
    theirs, (their_cells, their_X, raised) = best_of(2, lambda: dolfinx_locate(mesh, x[sample]))

    n, m = len(x), len(sample)
    ratio = (theirs / m) / (guided / n)
    wrong = np.abs(push_forward(mesh, cells, X) - x).max(axis=1) > 1e-11  # eps·400 a hundred times
    their_back = push_forward(mesh, their_cells, np.nan_to_num(their_X, nan=-1.0))
    their_wrong = np.abs(their_back - x[sample]).max(axis=1) > 1e-6
    print(
        f"\n{n} points, {COLUMNS} x {ROWS} distorted quadrilaterals, "
        f"{np.mean(cells != old):.0%} have changed cells"
        f"\n  locate, from their old cells   {guided / n * 1e6:8.2f} µs a point      1"
        f"\n  locate, from nowhere           {alone / n * 1e6:8.2f} µs a point  "
        f"{alone / guided:5.1f}"
        f"\n  inverse_map alone              {mapping / n * 1e6:8.2f} µs a point  "
        f"{mapping / guided:5.1f}"
        f"\n  dolfinx, {m} of them       {theirs / m * 1e6:8.2f} µs a point  {ratio:5.1f}"
        f"\n  lost or wrong: {np.sum(cells < 0)}, {np.sum(wrong)}; dolfinx: "
        f"{np.sum(their_cells < 0)}, {np.sum(their_wrong)}, pull_back raised {raised} times"
        f"\n  building the search once: {build:.2f} s"
    )
    assert (cells >= 0).all() and (status == 0).all() and not wrong.any()
    np.testing.assert_array_equal(cells, cells_alone)


@pytest.mark.parametrize(
    ("kind", "grading"),
    [
        ("quadrilateral", 1),
        ("quadrilateral", 6),
        ("triangle", 1),
        ("hexahedron", 1),
        ("hexahedron", 4),
    ],
)
def test_cost_by_cell_type_and_grading(kind, grading):
    cell = getattr(CellType, kind)
    if kind == "hexahedron":
        mesh = create_box(MPI.COMM_SELF, [[0, 0, 0], [1, 1, 1]], [32, 32, 32], cell)
    else:
        mesh = create_rectangle(MPI.COMM_SELF, [[0, 0], [1, 1]], [180, 180], cell)
    x = mesh.geometry.x
    x[:] = x**grading
    dim = mesh.topology.dim
    rng = np.random.default_rng(3)
    cells = np.repeat(np.arange(len(mesh.geometry.dofmap)), 10)
    X = rng.dirichlet(np.ones(dim + 1), len(cells))[:, :dim]
    points = push_forward(mesh, cells, X)
    widths = np.diff(np.unique(x[:, 0]))
    search = CellSearch(mesh)
    locate(mesh, points[:10], cells[:10], search)
    guided, (found, _) = best_of(3, lambda: locate(mesh, points, cells, search))
    alone, (found_alone, _) = best_of(3, lambda: locate(mesh, points, None, search))
    print(
        f"\n{kind}, widest over narrowest cell {widths.max() / widths.min():.1e}: "
        f"{guided / len(points) * 1e6:.2f} µs a point from its cell, "
        f"{alone / len(points) * 1e6:.2f} from nowhere ({alone / guided:.1f})"
    )
    np.testing.assert_array_equal(found, cells)
    np.testing.assert_array_equal(found_alone, cells)
