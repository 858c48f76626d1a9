# SPDX-License-Identifier: MIT
"""Hard case 6: quadratic cells with curved sides, and cells that are none.

Naively a cell is searched for in the hull of its nodes: a side that bulges beyond them is missed.
Concave and inverted cells map two places to one, and matrices of the wrong sign go into the sum.
"""

import itertools
import re

import basix
import basix.ufl
import numpy as np
import pytest
from dolfinx.mesh import create_mesh
from mpi4py import MPI
from support.single_cells import (
    determinants_at_own_points,
    disjoint_cells,
    element,
    push_forward,
    random_points,
)

from fenics_hytf.domain import refuse_inverted_cells
from fenics_hytf.particles.mapping import inverse_map
from fenics_hytf.particles.search import locate

LOCATED = 1e-10  # in reference coordinates


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
def test_06_points_of_a_quarter_ring_are_found(kind, arcs, figure):
    """Naively the cell is taken for the polygon of its corners, up to 0.2 r off its arc."""
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
        figure("points in another cell of the ring", np.sum(cells != local[number]), 0)
        figure("|ΔX| in the ring", np.abs(found - X).max(), LOCATED)
    # Nothing is found in the bay of the ring, nor beyond it; the arcs deviate from the circles
    # by less than 0.05 where one cell spans a right angle.
    angle = rng.uniform(0, np.pi / 2, 500)
    for radius in (0.9, 2.1):
        y = np.zeros((500, 3))
        y[:, 0], y[:, 1], y[:, 2] = radius * np.cos(angle), radius * np.sin(angle), 0.5
        cells, _ = locate(mesh, y)
        figure("points found in the bay of the ring or beyond it", np.sum(cells != -1), 0)


def test_06_a_side_that_bulges_beyond_its_nodes(figure):
    """The widest place of a slanted parabola lies beyond all nodes, and is still found."""
    nodes = element("quadrilateral", 2).points.copy()
    nodes[3], nodes[6], nodes[7] = [1.15, 1.0], [1.2, 0.5], [0.575, 1.0]  # the right-hand side
    mesh, _ = disjoint_cells("quadrilateral", 2, nodes[None])
    X = np.column_stack([np.ones(101), np.linspace(0, 1, 101)])
    x = push_forward("quadrilateral", 2, np.repeat(nodes[None], 101, axis=0), X)
    assert x[:, 0].max() > nodes[:, 0].max() + 0.01
    cells, found = locate(mesh, x)
    figure("points lost on a bulging side", np.sum(cells != 0), 0)
    figure("|ΔX| on a bulging side", np.abs(found - X).max(), LOCATED)


@pytest.mark.parametrize(
    "corners",
    [
        [[0, 0], [1, 0], [0, 1], [0.2, 0.2]],  # concave
        [[0, 0], [1, 0], [1, 1], [0, 1]],  # crossed: counter-clockwise nodes taken as tensor order
        [[0, 0], [1, 0], [2, 0], [3, 0]],  # no area
        [[1, 1], [1, 1], [1, 1], [1, 1]],  # a point
    ],
)
def test_06_bad_cells_still_answer(corners, figure):
    """Such cells are refused when a mesh is read; the mapping still answers for every point."""
    mesh, _ = disjoint_cells("quadrilateral", 1, np.array(corners, float)[None])
    x = np.random.default_rng(19).uniform(-1, 4, (500, 2))
    X, status = inverse_map(mesh, x, np.zeros(500, np.int32))
    figure("coordinates in bad cells that are no numbers", np.sum(~np.isfinite(X)), 0)
    inside = status == 0
    back = push_forward("quadrilateral", 1, np.repeat(np.array(corners, float)[None], 500, 0), X)
    # a root found in a bad cell is a root: eps over det J, which is small near the fold
    off = np.abs(back - x)[inside].max(initial=0.0)
    figure("roots in bad cells that are none: way back", off, LOCATED)
    locate(mesh, x)


@pytest.mark.parametrize("bad", [[3], [0, 2]])
@pytest.mark.parametrize("corner", [0.2, -1.0])  # concave, inverted
@pytest.mark.parametrize("kind", ["quadrilateral", "hexahedron"])
def test_06_bad_cells_are_refused_by_number(kind, corner, bad, figure):
    """Naively they are found in the middle of a run, by a stiffness that is not definite."""
    nodes = np.repeat(element(kind, 1).points[None], 5, axis=0)
    nodes[bad, -1] = corner
    mesh, _ = disjoint_cells(kind, 1, nodes)
    with pytest.raises(ValueError) as caught:
        refuse_inverted_cells(mesh)
    named = {int(cell) for cell in re.findall(r"(\d+) \(-?\d", str(caught.value))}
    figure("bad cells not named, and good ones that are", len(named ^ set(bad)), 0)
