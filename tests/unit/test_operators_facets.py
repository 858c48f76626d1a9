# SPDX-License-Identifier: MIT
"""Dashpots, tractions and means on boundaries, against integrals in closed form."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from support.meshes import scene

from fenics_hytf.domain import boundary_nodes, build, distance_to_sides, side_column
from fenics_hytf.operators import DashpotForm, TractionForm, boundary_area, mean_rows
from fenics_hytf.scene import SceneError

WORLD = MPI.COMM_WORLD
CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
SIZE = (3.0, 2.0, 2.0)
EXACT = 1e-12  # sums of some hundred products of order one

pytestmark = pytest.mark.mpi


def box(cell, degree=1, kinematics=None):
    gdim = 2 if cell in CELLS[:2] else 3
    mesh = {
        "box": {"size": SIZE[:gdim], "cells": [3, 2, 2][:gdim], "cell": cell},
        "regions": [{"soil": "clay", "below": 1.0}, {"soil": "sand"}],
        "degree": degree,
    }
    direction = {"motion": [MOTION | {"direction": "z"}]} if kinematics else {}
    return build(
        scene(mesh | ({"kinematics": kinematics} if kinematics else {}), **direction), WORLD
    )


MOTION = {"harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 8}}


def field(domain, matrix: PETSc.Mat, function) -> PETSc.Vec:
    """Nodal values of a function of place, owned by this rank."""
    size = domain.V.dofmap.index_map.size_local
    values = function(domain.V.tabulate_dof_coordinates()[:size])
    vector = matrix.createVecRight()
    vector.array[:] = np.asarray(values, complex).reshape(size, -1).ravel()
    return vector


def constant(*components):
    return lambda x: np.tile(components, (len(x), 1))


def power(domain, matrix, u, v) -> complex:
    """vᵀ A u."""
    left, right = field(domain, matrix, v), field(domain, matrix, u)
    result = matrix.createVecLeft()
    matrix.mult(right, result)
    return complex(left.tDot(result))


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_dashpots_resist_across_and_along(cell, degree):
    domain = box(cell, degree)
    gdim = domain.gdim
    form = DashpotForm(domain, ["left", "right"])
    C = form.create_matrix()
    cells = np.ones(len(domain.regions))
    form.assemble(C, 700.0 * cells, 300.0 * cells)
    area = 2 * np.prod(SIZE[1:gdim])
    unit = np.eye(gdim)
    for i in range(gdim):
        for j in range(gdim):
            found = power(domain, C, constant(*unit[i]), constant(*unit[j]))
            expected = (700.0 if i == 0 else 300.0) * area if i == j else 0.0
            assert abs(found - expected) <= EXACT * 700 * area
    # ∫ ρV_s y² dS on both sides
    up = gdim - 1
    found = power(domain, C, lambda x: unit[up] * x[:, [up]], lambda x: unit[up] * x[:, [up]])
    expected = 300.0 * area * SIZE[up] ** 2 / 3
    assert abs(found - expected) <= EXACT * expected
    assert C.isTranspose(C, EXACT * C.norm(PETSc.NormType.INFINITY))
    C.destroy()


def test_dashpots_take_each_cells_own_impedance():
    domain = box("quadrilateral")
    form = DashpotForm(domain, ["left"])
    C = form.create_matrix()
    form.assemble(C, 0.0 * domain.regions, 100.0 * (1 + domain.regions))
    names = domain.region_names
    expected = sum(100.0 * (1 + names.index(soil)) * 1.0 for soil in ("clay", "sand"))
    found = power(domain, C, constant(0.0, 1.0), constant(0.0, 1.0))
    assert abs(found - expected) <= EXACT * expected
    C.destroy()


def test_dashpots_across_a_section():
    domain = box("triangle", 2, "antiplane")
    assert domain.components == ("z",)
    form = DashpotForm(domain, ["base", "right"])
    C = form.create_matrix()
    cells = np.ones(len(domain.regions))
    form.assemble(C, 0 * cells, 50.0 * cells)
    found = power(domain, C, constant(1.0), constant(1.0))
    assert abs(found - 50.0 * 5.0) <= EXACT * 250
    C.destroy()


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("side", ["left", "right"])
def test_the_traction_of_level_ground(cell, side):
    """u = (γ, ..., ε) h: σ_xx = λ ε and τ = G γ pull at the side, outwards."""
    domain = box(cell, 2)
    gdim, up = domain.gdim, domain.gdim - 1
    form = TractionForm(domain, side)
    P = form.create_matrix()
    lame, shear = 30e6, 20e6
    cells = np.ones(len(domain.regions))
    form.assemble(P, lame * cells, shear * cells)
    gamma, epsilon = 2e-3, 1e-3

    def level(x):
        u = np.zeros((len(x), gdim))
        u[:, 0], u[:, up] = gamma * x[:, up], epsilon * x[:, up]
        # what nodes away from the side hold does not matter
        u[np.abs(x[:, 0] - (0.0 if side == "left" else SIZE[0])) > 1e-9] = 7.0
        return u

    area, sign = np.prod(SIZE[1:gdim]), -1 if side == "left" else 1
    across = power(domain, P, level, constant(*np.eye(gdim)[0]))
    upwards = power(domain, P, level, constant(*np.eye(gdim)[up]))
    assert abs(across - sign * lame * epsilon * area) <= 1e-10 * lame * area
    assert abs(upwards - sign * shear * gamma * area) <= 1e-10 * lame * area
    P.destroy()


@pytest.mark.parametrize("cell", CELLS)
def test_the_mean_of_a_boundary(cell):
    domain = box(cell, 2)
    gdim = domain.gdim
    assert boundary_area(domain, "top") == pytest.approx(np.prod(SIZE[: gdim - 1]), rel=1e-13)
    rows = mean_rows(domain, "top")
    x = domain.V.tabulate_dof_coordinates()[:, :gdim]
    values = (x**2).ravel()
    found = domain.comm.allreduce(rows @ values)
    expected = [size**2 / 3 for size in SIZE[: gdim - 1]] + [SIZE[gdim - 1] ** 2]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


# ---------------------------------------------------------------- the column beyond a side


@pytest.mark.parametrize("cell", CELLS)
def test_the_column_of_a_side(cell):
    domain = box(cell, 2)
    up = domain.gdim - 1
    side = side_column(domain, "right")
    column = side.domain
    assert column.comm.size == 1 and column.num_components == domain.gdim
    np.testing.assert_allclose(
        np.unique(column.mesh.geometry.x[:, up]), np.linspace(0, SIZE[up], 3), atol=1e-15
    )
    middle = column.centroids()[:, up]
    names = [column.region_names[r] for r in column.gather_cells(column.regions)]
    assert names == ["clay" if height < 1.0 else "sand" for height in middle]
    # Cells of the section know the layer beyond them.
    beyond = side.cell[: domain.num_owned_cells]
    mine = beyond >= 0
    heights = domain.mesh.geometry.x[domain.mesh.geometry.dofmap[: len(beyond)]][mine][:, :, up]
    assert np.all(np.abs(heights.mean(axis=1) - middle[beyond[mine]]) < SIZE[up] / 4 + 1e-12)
    owned = boundary_nodes(domain, "right")
    owned = owned[owned < domain.V.dofmap.index_map.size_local]
    assert sorted(side.nodes) == sorted(owned)
    np.testing.assert_array_equal(
        side.places[:, up], domain.V.tabulate_dof_coordinates()[side.nodes, up]
    )


def test_layers_that_are_not_level():
    # In a solid: sand on top in front, clay behind.
    mesh = {
        "box": {"size": [2.0, 2.0, 2.0], "cells": [2, 2, 2]},
        "regions": [{"soil": "clay", "below": 1.0}, {"soil": "sand"}],
    }
    domain = build(scene(mesh), WORLD)
    y = domain.centroids()[domain.input_cells, 1]
    domain.regions[y > 1.0] = 0
    with pytest.raises(
        SceneError, match=r"boundary.left: found .* at height 1.5 m; expected level"
    ):
        side_column(domain, "left")
    assert side_column(domain, "front").domain.num_cells == 2


def test_a_level_boundary_is_no_side():
    with pytest.raises(SceneError, match=r"boundary.top: found a level boundary"):
        side_column(box("triangle"), "top")


def test_distance_to_sides():
    domain = box("hexahedron")
    x = np.array([[0.5, 1.0, 0.2], [2.9, 0.1, 1.0], [1.5, 1.9, 0.0]])
    np.testing.assert_allclose(distance_to_sides(domain, ["left", "right"], x), [0.5, 0.1, 1.5])
    np.testing.assert_allclose(distance_to_sides(domain, ["back"], x), [1.0, 1.9, 0.1])
