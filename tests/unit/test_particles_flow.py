# SPDX-License-Identifier: MIT
"""Points that ride a flow: it converges nowhere within a cell."""

import dolfinx.fem
import dolfinx.mesh
import numpy as np
import pytest
from dolfinx.mesh import CellType
from mpi4py import MPI

from fenics_hytf.particles import Points, even_shift, seed, transfer_matrix
from fenics_hytf.particles.geometry import jacobians


def box(cell_type, cells):
    comm = MPI.COMM_SELF
    if len(cells) == 2:
        return dolfinx.mesh.create_rectangle(comm, [[0, 0], [3, 2]], cells, cell_type)
    return dolfinx.mesh.create_box(comm, [[0, 0, 0], [3, 2, 1]], cells, cell_type)


def filled(mesh, count):
    cells = mesh.topology.index_map(mesh.topology.dim).size_local
    return seed(mesh, np.zeros(cells, np.int32), [1.0], count)


def moved_within(points, X):
    """Points at other places in their cells."""
    names = ("id", "cell", "x", "mass", "volume", "region", "displacement")
    return Points(X=X, **{name: getattr(points, name) for name in names})


def ridden(V, flow, points, X):
    """What points at other places in their cells take from a flow."""
    there = moved_within(points, X)
    return transfer_matrix(there, V) @ flow + even_shift(V, flow, there)[0]


@pytest.mark.parametrize(
    ("cell_type", "cells"), [(CellType.quadrilateral, (3, 4)), (CellType.hexahedron, (2, 2, 3))]
)
def test_the_divergence_is_that_of_the_cell_everywhere(cell_type, cells):
    """In boxes: by central differences, exact for the quadratic shift."""
    mesh = box(cell_type, cells)
    gdim = len(cells)
    V = dolfinx.fem.functionspace(mesh, ("Lagrange", 1, (gdim,)))
    flow = np.random.default_rng(0).normal(size=(V.dofmap.index_map.size_local, gdim))
    points = filled(mesh, 2**gdim)
    J = jacobians(mesh, points.cell, points.X)
    divergence = np.zeros(len(points))
    for axis in range(gdim):
        step = np.zeros(gdim)
        step[axis] = 0.01
        ahead, behind = (ridden(V, flow, points, points.X + sign * step) for sign in (1, -1))
        # ∇X_axis · ∂u/∂X_axis
        divergence += np.einsum("pi,pi->p", np.linalg.inv(J)[:, axis], ahead - behind) / 0.02
    by_cell = divergence.reshape(-1, 2**gdim)
    spread = np.ptp(by_cell, axis=1).max() / np.abs(by_cell).max()
    # Trilinear flow has products of two coordinates in its divergence, which are left.
    assert spread < (1e-11 if gdim == 2 else 1.2)


@pytest.mark.parametrize(
    ("cell_type", "cells"), [(CellType.quadrilateral, (3, 4)), (CellType.hexahedron, (2, 2, 3))]
)
def test_the_gradient_of_the_shift(cell_type, cells):
    """By central differences, exact for the quadratic shift."""
    mesh = box(cell_type, cells)
    gdim = len(cells)
    V = dolfinx.fem.functionspace(mesh, ("Lagrange", 1, (gdim,)))
    flow = np.random.default_rng(2).normal(size=(V.dofmap.index_map.size_local, gdim))
    points = filled(mesh, 2**gdim)
    inverse = np.linalg.inv(jacobians(mesh, points.cell, points.X))
    by_X = np.empty((len(points), gdim, gdim))
    for axis in range(gdim):
        step = np.zeros(gdim)
        step[axis] = 0.01
        ahead, behind = (
            even_shift(V, flow, moved_within(points, points.X + sign * step))[0] for sign in (1, -1)
        )
        by_X[:, :, axis] = (ahead - behind) / 0.02
    gradient = even_shift(V, flow, points)[1]
    np.testing.assert_allclose(gradient, by_X @ inverse, atol=1e-12 * np.abs(by_X).max())
    assert np.abs(gradient).max() > 0.1


def test_nothing_crosses_the_sides_of_a_cell_beside_the_flow():
    mesh = box(CellType.quadrilateral, (3, 4))
    V = dolfinx.fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    flow = np.random.default_rng(1).normal(size=(V.dofmap.index_map.size_local, 2))
    points = filled(mesh, 4)
    for axis, place in ((0, 0.0), (0, 1.0), (1, 0.0), (1, 1.0)):
        X = points.X.copy()
        X[:, axis] = place
        there = ridden(V, flow, points, X)
        shift = there - transfer_matrix(moved_within(points, X), V) @ flow
        normal = np.linalg.inv(jacobians(mesh, points.cell, X))[:, axis]
        assert np.abs(shift).max() > 0.1
        assert np.abs(np.einsum("pi,pi->p", normal, shift)).max() < 1e-12


def test_simplices_are_left_alone():
    mesh = box(CellType.triangle, (3, 4))
    V = dolfinx.fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    flow = np.ones((V.dofmap.index_map.size_local, 2))
    assert not any(part.any() for part in even_shift(V, flow, filled(mesh, 3)))
