# SPDX-License-Identifier: MIT
"""The convective phase on prescribed fields, over several cells and ranks.

Under steady continuity a lapse moves no point for good: what moves them later is proved here on
translations, rotations, shears and dilatations. Such fields are linear, so every element holds them
exactly, and every figure has a closed form.
"""

import basix
import numpy as np
import pytest
from mpi4py import MPI
from scipy.linalg import expm
from support.meshes import scene

from fenics_hytf import _compat
from fenics_hytf.domain import Domain, build
from fenics_hytf.lapse import ElasticConstants, cell_stress, convect
from fenics_hytf.operators import ElasticForm, assemble_mass
from fenics_hytf.particles import (
    Points,
    PointsNotFinite,
    PointsOutside,
    default_points_per_cell,
    first_pieces,
    particle_mass_matrix,
    seed,
    to_tensor,
    transfer_matrix,
)

pytestmark = pytest.mark.mpi

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
CELLS = ["quadrilateral", "triangle", "hexahedron", "tetrahedron"]
# Positions of some 10 m add up over 20 steps: some hundred roundings.
PLACE = 1e-12


def grid(cell) -> tuple[list[float], list[int]]:
    """Size and number of the cells: 1 m each, in space too."""
    counts = [12, 10] if cell in ("quadrilateral", "triangle") else [7, 6, 6]
    return [float(n) for n in counts], counts


def domain_of(cell, degree=1, comm=WORLD, distorted=False) -> Domain:
    size, counts = grid(cell)
    mesh = {"box": {"size": size, "cells": counts, "cell": cell}, "degree": degree}
    domain = build(scene(mesh, ("clay",)), comm)
    if distorted:
        x = domain.mesh.geometry.x
        bump = np.prod(np.sin(np.pi * x[:, : len(size)] / size), axis=1)
        x[:, 0] += 0.9 * bump
        x[:, 1] -= 0.6 * bump
    return domain


def block(domain, low, high, *more: str) -> Points:
    """Points in the cells whose centroid is in a box."""
    mesh = domain.mesh
    nodes = mesh.geometry.x[_compat.geometry_dofmap(mesh)]
    centroid = nodes.mean(axis=1)[:, : domain.gdim]
    inside = np.all((centroid > low) & (centroid < high), axis=1)
    cell = mesh.topology.cell_name()
    count = default_points_per_cell(cell, 1)
    regions = np.where(inside, 0, 1).astype(np.int32)
    fields = ["velocity", "acceleration", "strain", *more]
    points = seed(mesh, regions, [1900.0, 0.0], count, fields)
    points["velocity"] = np.sin(points.x + np.arange(domain.gdim))
    return points


def nodal(domain, gradient, shift, centre) -> np.ndarray:
    """A linear field at the local nodes: shift + gradient (x - centre)."""
    x = domain.V.tabulate_dof_coordinates()[:, : domain.gdim]
    return np.asarray(shift) + (x - centre) @ np.asarray(gradient).T


def gathered(domain, points) -> dict[str, np.ndarray]:
    """Arrays of all ranks by id, cells by their input number."""
    arrays = points.arrays() | {"cell": domain.input_cells[points.cell]}
    parts = domain.comm.allgather(arrays)
    order = np.argsort(np.concatenate([part["id"] for part in parts]))
    return {name: np.concatenate([part[name] for part in parts])[order] for name in arrays}


def mapped(domain, points) -> np.ndarray:
    """Where the cell and the reference coordinates of each point put it."""
    if not len(points):  # basix ends the process where there is nothing to tabulate
        return points.x
    element = _compat.coordinate_element(domain.mesh)
    shape = element.tabulate(0, points.X)[0, :, :, 0]
    nodes = domain.mesh.geometry.x[_compat.geometry_dofmap(domain.mesh)[points.cell]]
    return np.einsum("pn,pni->pi", shape, nodes)[:, : domain.gdim]


def inside(domain, X) -> np.ndarray:
    """Whether reference coordinates are in the cell, but for round-off."""
    simplex = domain.mesh.topology.cell_name() in ("triangle", "tetrahedron")
    top = X.sum(axis=1, keepdims=True) if simplex else X
    return np.all(X > -1e-9, axis=1) & np.all(top < 1 + 1e-9, axis=1)


def brute_force(domain, x) -> np.ndarray:
    """Input number of the cell of each place of a straight box: every cell is tried."""
    cell = getattr(basix.CellType, domain.mesh.topology.cell_name())
    corners = domain.gather_cells(
        domain.mesh.geometry.x[_compat.geometry_dofmap(domain.mesh)][:, :, : domain.gdim]
    )
    reference = basix.geometry(cell)
    axes = [int(np.flatnonzero((reference == e).all(axis=1))[0]) for e in np.eye(domain.gdim)]
    found = np.full(len(x), -1)
    for number in reversed(range(len(corners))):  # the lowest number wins
        J = (corners[number, axes] - corners[number, 0]).T
        X = np.linalg.solve(J, (x - corners[number, 0]).T).T
        found[inside(domain, X)] = number
    return found


def total(domain, values) -> np.ndarray:
    return domain.comm.allreduce(values.sum(axis=0))


def momentum(domain, points) -> np.ndarray:
    return total(domain, points.mass[:, None] * points["velocity"])


def same_as_alone(cell, degree, low, high, steps, outside="error"):
    """Run the same steps on all ranks and on one, compare, and return the former."""
    results = []
    for comm in (WORLD, SELF):
        domain = domain_of(cell, degree, comm)
        points = block(domain, low, high)
        for step in steps:
            report = convect(domain, points, nodal(domain, *step), outside)
        results.append((domain, points, report))
    (domain, points, report), (alone, reference, expected) = results
    mine, other = gathered(domain, points), gathered(alone, reference)
    np.testing.assert_array_equal(mine["id"], other["id"])
    for name in other:
        np.testing.assert_allclose(mine[name], other[name], rtol=0, atol=PLACE * scale(other[name]))
    ledger, single = report.ledger.as_dict(), expected.ledger.as_dict()
    del ledger["migrated"], single["migrated"]
    assert ledger == single
    assert report.inverse_mappings == expected.inverse_mappings
    return domain, points, report


def scale(values) -> float:
    return max(float(np.abs(values).max(initial=0.0)), 1.0)


# ---------------------------------------------------------------- motions


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_translation(cell, degree):
    """Several cells in a step: found as brute force finds them, mass and momentum kept."""
    gdim = len(grid(cell)[0])
    shift = np.array([2.37, 1.71, -1.43])[:gdim]
    steps = [(np.zeros((gdim, gdim)), sign * shift, 0.0) for sign in (1, -1, 1)]
    low, high = np.array([1.0, 1.0, 2.0])[:gdim], np.array([4.0, 4.0, 4.0])[:gdim]
    start = domain_of(cell, degree)
    before = block(start, low, high)
    first = gathered(start, before)
    mass, pushed = total(start, before.mass), momentum(start, before)
    domain, points, report = same_as_alone(cell, degree, low, high, steps)
    now = gathered(domain, points)
    np.testing.assert_allclose(now["x"], first["x"] + shift, atol=PLACE)
    np.testing.assert_allclose(now["displacement"], np.tile(shift, (len(now["x"]), 1)), atol=PLACE)
    np.testing.assert_array_equal(now["cell"], brute_force(domain, now["x"]))
    assert np.all(np.abs(now["cell"] - first["cell"]) > 1)
    assert np.all(inside(domain, points.X))
    np.testing.assert_allclose(mapped(domain, points), points.x, atol=PLACE)
    np.testing.assert_allclose(now["volume"], first["volume"], rtol=1e-13)
    assert total(domain, points.mass) == pytest.approx(mass, rel=1e-13)
    np.testing.assert_allclose(momentum(domain, points), pushed, rtol=1e-13)
    assert report.ledger.imbalance == 0.0
    assert report.inverse_mappings == len(now["id"])


@pytest.mark.parametrize("cell", CELLS)
def test_rotation(cell):
    """0.1 rad a step: volume stays to round-off, where I + ∇u would gain 1 % a step."""
    size, _ = grid(cell)
    gdim = len(size)
    spin = np.zeros((gdim, gdim))
    spin[0, 1], spin[1, 0] = -0.1, 0.1
    if gdim == 3:
        spin[0, 2], spin[2, 0] = 0.05, -0.05
    centre = np.array(size) / 2
    steps = [(spin, 0.0, centre)] * 12
    low, high = centre - (2.1 if gdim == 2 else 1.1), centre + (2.1 if gdim == 2 else 1.1)
    domain, points, _ = same_as_alone(cell, 1, low, high, steps)
    start = domain_of(cell)
    first = gathered(start, block(start, low, high))
    now = gathered(domain, points)
    np.testing.assert_allclose(now["volume"], first["volume"], rtol=1e-12)
    # The places follow the field, step by step: x - c grows by I + spin.
    path = np.linalg.matrix_power(np.eye(gdim) + spin, 12)
    expected = centre + (first["x"] - centre) @ path.T
    np.testing.assert_allclose(now["x"], expected, atol=PLACE)
    np.testing.assert_array_equal(now["cell"], brute_force(domain, now["x"]))
    assert np.count_nonzero(now["cell"] != first["cell"]) > 0.8 * len(now["cell"])
    assert not np.abs(now["strain"]).max() > 1e-14


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_simple_shear(cell, degree):
    size, _ = grid(cell)
    gdim = len(size)
    shear = np.zeros((gdim, gdim))
    shear[0, -1] = 0.35
    centre = np.array(size) / 2
    low, high = centre - 1.6, centre + 1.6
    domain, points, _ = same_as_alone(cell, degree, low, high, [(shear, 0.0, centre)] * 3)
    start = domain_of(cell, degree)
    first = gathered(start, block(start, low, high))
    now = gathered(domain, points)
    expected = first["x"] + 3 * (first["x"] - centre) @ shear.T
    np.testing.assert_allclose(now["x"], expected, atol=PLACE)
    np.testing.assert_array_equal(now["cell"], brute_force(domain, now["x"]))
    np.testing.assert_allclose(now["volume"], first["volume"], rtol=1e-13)
    strain = to_tensor(now["strain"])
    np.testing.assert_allclose(strain[:, 0, -1], 3 * 0.35 / 2, rtol=1e-12)
    np.testing.assert_allclose(np.trace(strain, axis1=1, axis2=2), 0.0, atol=1e-13)


@pytest.mark.parametrize("cell", CELLS)
def test_dilatation(cell):
    size, _ = grid(cell)
    gdim = len(size)
    stretch = np.diag([0.12, -0.05, 0.04][:gdim])
    centre = np.array(size) / 2
    low, high = centre - 1.6, centre + 1.6
    domain, points, _ = same_as_alone(cell, 1, low, high, [(stretch, 0.0, centre)] * 4)
    start = domain_of(cell)
    first = gathered(start, block(start, low, high))
    now = gathered(domain, points)
    np.testing.assert_allclose(now["volume"], first["volume"] * np.exp(4 * np.trace(stretch)))
    np.testing.assert_array_equal(now["mass"], first["mass"])
    np.testing.assert_allclose(
        to_tensor(now["strain"]), np.tile(4 * stretch, (len(first["x"]), 1, 1)), atol=1e-13
    )


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle", "tetrahedron"])
def test_a_distorted_mesh(cell):
    # No closed form for the cell here; but a place that its own cell maps to is found right.
    size, _ = grid(cell)
    gdim = len(size)
    domain = domain_of(cell, distorted=True)
    centre = np.array(size) / 2
    points = block(domain, centre - 1.1, centre + 1.1)
    count = domain.comm.allreduce(len(points))
    spin = np.zeros((gdim, gdim))
    spin[0, 1], spin[1, 0] = -0.3, 0.3
    for shift in (0.9, -1.3, 0.7):
        convect(domain, points, nodal(domain, spin, shift, centre))
        assert np.all(inside(domain, points.X))
        np.testing.assert_allclose(mapped(domain, points), points.x, atol=PLACE)
        assert domain.comm.allreduce(len(points)) == count
        owned = domain.num_owned_cells
        assert np.all((points.cell >= 0) & (points.cell < owned))


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle", "hexahedron"])
def test_what_slips_is_ridden_in_steps(cell):
    """A flow that turns, by angle a: straight ways thin the ground out by a² in area, n steps a²/n.

    The pieces of the points turn with it.
    """
    size, _ = grid(cell)
    gdim = len(size)
    domain = domain_of(cell)
    centre = np.array(size) / 2
    points = block(domain, centre - 1.1, centre + 1.1)
    points.add("piece", (gdim, gdim + 1))
    points["piece"] = first_pieces(domain.mesh, points, default_points_per_cell(cell, 1))
    first = gathered(domain, points)
    angle = 0.2
    spin = np.zeros((gdim, gdim))
    spin[0, 1], spin[1, 0] = -angle, angle
    slip = nodal(domain, spin, 0.0, centre)
    way = domain.comm.allreduce(np.linalg.norm(slip, axis=1).max(initial=0.0), MPI.MAX)
    side = domain.comm.allreduce(domain.cell_sizes().min(initial=np.inf), MPI.MIN)
    steps = np.ceil(way / (0.1 * side))
    assert steps > 4
    convect(domain, points, 0 * slip, slip=slip)
    now = gathered(domain, points)
    plane = [(found["x"] - centre)[:, :2] for found in (first, now)]
    grown = np.sum(plane[1] ** 2, axis=1) / np.sum(plane[0] ** 2, axis=1)
    np.testing.assert_allclose(grown, (1 + (angle / steps) ** 2) ** steps, rtol=1e-12)
    np.testing.assert_array_equal(now["volume"], first["volume"])
    turn = expm(spin)
    np.testing.assert_allclose(now["piece"], turn @ first["piece"], atol=1e-12)


# ---------------------------------------------------------------- what moves with them


@pytest.mark.parametrize("cell", CELLS)
def test_mass_matrix_after_a_move(cell):
    """M is built again from the points: rᵀMr and the momentum rᵀSᵀM_p v are the points' own."""
    size, _ = grid(cell)
    gdim = len(size)
    domain = domain_of(cell)
    centre = np.array(size) / 2
    points = block(domain, centre - 1.6, centre + 1.6)
    mass, pushed = total(domain, points.mass), momentum(domain, points)
    elastic = ElasticForm(domain)
    K = elastic.create_matrix()
    ones = np.ones(len(domain.regions))
    elastic.assemble(K, ones, ones)
    rotation = np.zeros((gdim, gdim))
    rotation[0, 1], rotation[1, 0] = -0.2, 0.2
    for step in range(3):
        convect(domain, points, nodal(domain, rotation, 0.3 - 0.3 * step, centre))
        S = transfer_matrix(points, domain.V)
        M = assemble_mass(domain, particle_mass_matrix(S, points.mass), K)
        for axis in range(gdim):
            r, Mr = M.createVecs()
            r.array[axis::gdim] = 1.0
            M.mult(r, Mr)
            assert r.dot(Mr).real == pytest.approx(mass, rel=1e-13)
            for vec in (r, Mr):
                vec.destroy()
        nodal_momentum = total(domain, S.T @ (points.mass[:, None] * points["velocity"]))
        np.testing.assert_allclose(nodal_momentum, pushed, rtol=1e-13)
        M.destroy()
    K.destroy()


@pytest.mark.parametrize("cell", CELLS)
def test_points_take_velocity_and_acceleration_of_the_nodes(cell):
    size, _ = grid(cell)
    gdim = len(size)
    domain = domain_of(cell)
    centre = np.array(size) / 2
    points = block(domain, centre - 1.6, centre + 1.6)
    rng = np.random.default_rng(7)
    A, B = rng.normal(size=(2, gdim, gdim))
    shift = np.full(gdim, 0.8)
    convect(
        domain,
        points,
        nodal(domain, np.zeros((gdim, gdim)), shift, 0.0),
        velocity=nodal(domain, A, 1.0, centre),
        acceleration=nodal(domain, B, -2.0, centre),
    )
    # Those of the end of the lapse, at the place that the lapse calls the point's: where it was.
    x = points.x - shift
    np.testing.assert_allclose(points["velocity"], 1.0 + (x - centre) @ A.T, atol=1e-12)
    np.testing.assert_allclose(points["acceleration"], -2.0 + (x - centre) @ B.T, atol=1e-12)


@pytest.mark.parametrize("cell", CELLS)
def test_a_stressed_block_turned_by_a_right_angle(cell, figure):
    """Hard case 28: 20 steps of skew ∇u; the stress turns with them and keeps its invariants."""
    size, _ = grid(cell)
    gdim = len(size)
    domain = domain_of(cell)
    centre = np.array(size) / 2
    points = block(domain, centre - 1.1, centre + 1.1, "stress")
    stress = np.array([-80e3, -160e3, 25e3])
    if gdim == 3:
        stress = np.array([-80e3, -120e3, -160e3, 9e3, -7e3, 25e3])
    points["stress"] = np.tile(stress, (len(points), 1))
    constants = ElasticConstants(*(np.full(domain.num_cells, m) for m in (60e6, 40e6)))
    spin = np.zeros((gdim, gdim))
    spin[0, 1], spin[1, 0] = -np.pi / 40, np.pi / 40
    for _ in range(20):
        convect(domain, points, nodal(domain, spin, 0.0, centre), constants=constants)
    start = to_tensor(stress[None])[0]
    R = np.eye(gdim)
    R[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    turned = to_tensor(points["stress"])
    error = np.abs(turned - R @ start @ R.T).max(initial=0.0) / np.abs(start).max()
    # Against the principal stresses, which hold all invariants.
    drift = np.abs(np.linalg.eigvalsh(turned) - np.linalg.eigvalsh(start)).max(initial=0.0)
    drift /= np.abs(start).max()
    figure(f"stress turned by 90 degrees, {cell}", domain.comm.allreduce(error, MPI.MAX), 1e-10)
    figure(f"its principal values, {cell}", domain.comm.allreduce(drift, MPI.MAX), 1e-10)


def test_stress_of_a_cell_is_the_mean_of_its_points_by_volume():
    domain = domain_of("triangle")
    points = block(domain, -1.0, 100.0, "stress")
    points["stress"] = np.column_stack([points.x, points.x[:, :1] * 0 + 5.0])
    swollen = points.X[:, 0] > 0.5
    points.volume[swollen] *= 3
    found = domain.gather_cells(cell_stress(domain, points))
    now = gathered(domain, points)
    for number in (0, 17, 101):
        mine = now["cell"] == number
        mean = np.average(now["stress"][mine], axis=0, weights=now["volume"][mine])
        np.testing.assert_allclose(found[number], to_tensor(mean[None])[0], rtol=1e-13)


# ---------------------------------------------------------------- points that leave


def leaving():
    """A block of 3 by 3 cells, and a field that pushes it half across the right side."""
    domain = domain_of("quadrilateral")
    points = block(domain, [8.0, 3.0], [11.0, 6.0], "stress")
    increment = nodal(domain, np.zeros((2, 2)), [2.5, 0.2], 0.0)
    constants = ElasticConstants(*(np.full(domain.num_cells, m) for m in (60e6, 40e6)))
    return domain, points, increment, constants


def test_leaving_is_an_error_that_changes_nothing():
    domain, points, increment, constants = leaving()
    increment += nodal(domain, [[0.0, 0.0], [0.0, 0.02]], 0.0, 0.0)  # volumes would change
    before = {name: values.copy() for name, values in points.arrays().items()}
    velocity = nodal(domain, np.eye(2), 0.0, 0.0)
    with pytest.raises(PointsOutside, match="18 points left the mesh"):
        convect(domain, points, increment, "error", constants, velocity)
    for name, values in points.arrays().items():
        np.testing.assert_array_equal(values, before[name])


def test_what_is_not_finite_is_an_error_that_changes_nothing():
    domain, points, increment, constants = leaving()
    before = {name: values.copy() for name, values in points.arrays().items()}
    holder = domain.comm.allreduce(domain.comm.rank if len(points) else WORLD.size, MPI.MIN)
    if domain.comm.rank == holder:  # on one rank; all of them raise
        increment[:] = np.nan
    with pytest.raises(PointsNotFinite):
        convect(domain, points, increment, "error", constants)
    for name, values in points.arrays().items():
        np.testing.assert_array_equal(values, before[name])


@pytest.mark.parametrize("outside", ["park", "delete"])
def test_leaving_by_policy(outside):
    step = (np.zeros((2, 2)), [2.5, 0.2], 0.0)
    back = (np.zeros((2, 2)), [-2.5, -0.2], 0.0)
    low, high = [8.0, 3.0], [11.0, 6.0]
    domain, points, report = same_as_alone("quadrilateral", 1, low, high, [step, back], outside)
    ledger = report.ledger
    # 36 points of 1900/4 kg; three columns of cells, of which one and a half leave.
    assert ledger.num_points == 18
    assert (ledger.parked, ledger.deleted) == ((18, 0) if outside == "park" else (0, 18))
    assert ledger.mass == pytest.approx(18 * 1900 / 4, rel=1e-13)
    assert ledger.parked_mass + ledger.deleted_mass == pytest.approx(18 * 1900 / 4, rel=1e-13)
    assert ledger.imbalance == 0.0
    S = transfer_matrix(points, domain.V)
    weighed = domain.comm.allreduce(particle_mass_matrix(S, points.mass).sum())
    assert weighed == pytest.approx(ledger.mass, rel=1e-13)  # who left weighs no longer
