# SPDX-License-Identifier: MIT
"""The store of material points: seeding, memory, the exact ledger, volume and stress updates."""

import math
from itertools import product

import numpy as np
import pytest
from dolfinx.mesh import CellType, GhostMode, Mesh, create_unit_cube, create_unit_square
from mpi4py import MPI
from scipy.linalg import expm

from fenics_hytf.particles import (
    MassLedger,
    default_points_per_cell,
    quadrature_rule,
    seed,
    to_components,
    to_tensor,
    update_kinematics,
    update_stress,
)
from fenics_hytf.particles.kinematics import exponentials
from fenics_hytf.particles.ledger import exact_sum, rounded
from fenics_hytf.scene.faults import fault_from

EPS = np.finfo(np.float64).eps
CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
NO_REGION = np.iinfo(np.int32).max


def distorted_mesh(cell: str, comm: MPI.Comm = MPI.COMM_WORLD) -> Mesh:
    ghosts = GhostMode.shared_facet
    if cell in ("triangle", "quadrilateral"):
        mesh = create_unit_square(comm, 6, 5, CellType[cell], ghost_mode=ghosts)
    else:
        mesh = create_unit_cube(comm, 3, 4, 3, CellType[cell], ghost_mode=ghosts)
    x = mesh.geometry.x
    gdim = mesh.geometry.dim
    bump = np.prod(np.sin(np.pi * x[:, :gdim]), axis=1)  # the unit box keeps its boundary
    for axis in range(gdim):
        x[:, axis] += (0.06 - 0.03 * axis) * bump
    return mesh


def two_regions(mesh: Mesh) -> np.ndarray:
    index_map = mesh.topology.index_map(mesh.topology.dim)
    num_cells = index_map.size_local + index_map.num_ghosts
    return (mesh.topology.original_cell_index[:num_cells] % 3 == 0).astype(np.int32)


def gathered(comm: MPI.Comm, points) -> dict[str, np.ndarray]:
    parts = comm.allgather({k: v for k, v in points.arrays().items() if k != "cell"})
    order = np.argsort(np.concatenate([part["id"] for part in parts]))
    return {k: np.concatenate([part[k] for part in parts])[order] for k in parts[0]}


# ---------------------------------------------------------------- sums and ledger


def test_exact_sum_agrees_with_fsum_in_any_order():
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.lognormal(0, 40, 5000) * rng.choice([-1, 1], 5000), [5e-324, 0]])
    assert rounded(exact_sum(values)) == math.fsum(values)  # both round once: equal to the bit
    assert exact_sum(values) == exact_sum(rng.permutation(values))
    assert exact_sum(values[:100]) + exact_sum(values[100:]) == exact_sum(values)
    assert exact_sum(np.empty(0)) == 0
    assert rounded(exact_sum(np.array([1e-310, 5e-324]))) == 1e-310 + 5e-324


def test_exact_sum_refuses_what_is_not_a_number():
    with pytest.raises(ValueError, match="NaN or infinity"):
        exact_sum(np.array([1.0, np.nan]))


def test_ledger_tells_what_is_missing():
    masses = (exact_sum(np.array([0.6])), exact_sum(np.array([0.25])), 0)
    ledger = MassLedger.balance(MPI.COMM_SELF, (6, 2, 1), masses, exact_sum(np.array([1.0])), 3)
    assert ledger.as_dict() == {
        "num_points": 6,
        "mass": 0.6,
        "parked": 2,
        "parked_mass": 0.25,
        "deleted": 1,
        "deleted_mass": 0.0,
        "migrated": 3,
        "initial_mass": 1.0,
        "imbalance": pytest.approx(0.15, rel=EPS),
    }
    nothing = MassLedger.balance(MPI.COMM_SELF, (0, 0, 0), (0, 0, 0), 0)
    assert nothing.imbalance == 0.0


# ---------------------------------------------------------------- rules and seeding


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("degree", [1, 2])
def test_default_rule_integrates_products_of_shape_functions(cell, degree):
    size = default_points_per_cell(cell, degree)
    X, w = quadrature_rule(cell, size)
    assert w.size == size and np.all(w > 0)
    tensor = cell in ("quadrilateral", "hexahedron")
    for powers in product(range(2 * degree + 1), repeat=X.shape[1]):
        if not tensor and sum(powers) > 2 * degree:
            continue
        exact = (
            math.prod(1 / (p + 1) for p in powers)
            if tensor
            else math.prod(map(math.factorial, powers)) / math.factorial(sum(powers) + X.shape[1])
        )
        value = w @ np.prod(X**powers, axis=1)
        assert value == pytest.approx(exact, abs=50 * EPS)  # rounding of the tabulated rule


def test_rules_by_size():
    assert quadrature_rule("quadrilateral", 25)[1].size == 25
    X, _ = quadrature_rule("hexahedron", 27)
    assert len(np.unique(X[:, 0].round(12))) == 3  # a grid of 3 in each direction
    # squares and cubes stand for the rule of that order
    assert quadrature_rule("triangle", 4)[1].size == default_points_per_cell("triangle", 1)
    assert quadrature_rule("tetrahedron", 27)[1].size == default_points_per_cell("tetrahedron", 2)
    assert quadrature_rule("hexahedron", 1000)[1].size == 1000
    with pytest.raises(ValueError, match=r"points_per_cell: found 5; expected one of 1, 4, 9") as e:
        quadrature_rule("quadrilateral", 5)
    fault = fault_from(e.value, "mesh.points_per_cell", "")  # the message reads as a scene's fault
    assert (fault.key, fault.found) == ("mesh.points_per_cell", "5")
    with pytest.raises(ValueError, match="for a tetrahedron"):
        quadrature_rule("tetrahedron", 5)  # basix has one, with a negative weight


@pytest.mark.mpi
@pytest.mark.parametrize("cell", CELLS)
def test_seed_is_the_same_on_any_number_of_ranks(cell):
    comm = MPI.COMM_WORLD
    mesh, alone = distorted_mesh(cell), distorted_mesh(cell, MPI.COMM_SELF)
    size = default_points_per_cell(cell, 1)
    fields = ("velocity", "stress")
    points = seed(mesh, two_regions(mesh), [1800.0, 2000.0], size, fields)
    reference = seed(alone, two_regions(alone), [1800.0, 2000.0], size, fields)
    num_cells = mesh.topology.index_map(mesh.topology.dim).size_global
    everywhere, expected = gathered(comm, points), gathered(MPI.COMM_SELF, reference)
    assert np.array_equal(everywhere["id"], np.arange(num_cells * size))
    for name, values in expected.items():
        assert np.array_equal(everywhere[name], values), name
    assert points.ledger(comm) == reference.ledger(MPI.COMM_SELF)  # to the last bit
    assert np.all(points.cell < mesh.topology.index_map(mesh.topology.dim).size_local)
    assert np.all(np.diff(mesh.topology.original_cell_index[points.cell]) >= 0)


@pytest.mark.mpi
@pytest.mark.parametrize("cell", CELLS)
def test_seed_fills_the_box(cell):
    mesh = distorted_mesh(cell)
    size = default_points_per_cell(cell, 2)
    points = seed(mesh, 0 * two_regions(mesh), [1835.0], size)
    volume = mesh.comm.allreduce(points.volume.sum())
    # det J is of degree 2 a direction at most: integrated exactly; rounding of 1e2..1e3 terms
    assert volume == pytest.approx(1.0, abs=1e-13)
    assert points.ledger(mesh.comm).mass == pytest.approx(1835.0, rel=1e-13)
    nodes = mesh.geometry.x[mesh.geometry.dofmap, : mesh.geometry.dim]
    for i in range(0, len(points), 17):  # dolfinx's own map puts the points in the same places
        x = mesh.geometry.cmap.push_forward(points.X[i : i + 1], nodes[points.cell[i]])
        assert np.allclose(points.x[i], x[0], rtol=0, atol=20 * EPS)


@pytest.mark.mpi
def test_a_region_of_density_zero_stays_empty():
    mesh = distorted_mesh("quadrilateral")
    regions = two_regions(mesh)
    points = seed(mesh, regions, [0.0, 2000.0], 4)
    assert np.all(points.region == 1)
    assert np.all(regions[points.cell] == 1)
    assert points.ledger(mesh.comm).num_points == 4 * 10  # every third of 30 cells


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("regions", "density", "size", "message"),
    [
        (0, [-1.0], 4, "none negative"),
        (0, [np.nan], 4, "finite"),
        (NO_REGION, [1.0], 4, "numbers from 0 to 0"),
        (0, [1.0], 3, "points_per_cell: found 3; expected one of 1, 4"),
        (None, [1.0], 4, "Found regions of 0 cells"),
    ],
)
def test_seed_refuses(regions, density, size, message):
    mesh = distorted_mesh("quadrilateral")
    values = two_regions(mesh)[:0] if regions is None else 0 * two_regions(mesh)
    if regions == NO_REGION and mesh.comm.rank == 0:
        values[0] = 7  # one rank's fault stops all of them
    with pytest.raises(ValueError, match=message):
        seed(mesh, values, density, size)


# ---------------------------------------------------------------- arrays


def test_only_what_is_called_for_has_an_array():
    mesh = distorted_mesh("hexahedron", MPI.COMM_SELF)
    bare = seed(mesh, two_regions(mesh), [1.0, 1.0], 8)
    assert bare.history == {}
    with pytest.raises(KeyError, match=r"no array 'stress'.*fields"):
        bare["stress"]
    full = seed(
        mesh, two_regions(mesh), [1.0, 1.0], 8, ("velocity", "acceleration", "strain", "stress")
    )
    assert full["velocity"].shape == full.x.shape
    assert full["stress"].shape == (len(full), 6)
    assert full.bytes_per_point == bare.bytes_per_point + 8 * (3 + 3 + 6 + 6)
    # the memory stated is the memory held
    assert full.bytes_per_point * len(full) == sum(a.nbytes for a in full.arrays().values())
    assert bare.bytes_per_point <= 400  # the bound, "without history"
    assert full.bytes_per_point <= 400


def test_arrays_of_any_shape():
    mesh = distorted_mesh("triangle", MPI.COMM_SELF)
    points = seed(mesh, two_regions(mesh), [1.0, 1.0], 3)
    points.add("memory", (5, 3))
    points["memory"] = np.ones((len(points), 5, 3))
    assert points.arrays()["memory"].sum() == 15 * len(points)
    with pytest.raises(ValueError, match="second array 'memory'"):
        points.add("memory", (5, 3))
    with pytest.raises(ValueError, match="no known shape"):
        points.add("memories")
    with pytest.raises(ValueError, match="broadcast"):
        points["memory"] = np.ones((len(points), 4, 3))


# ---------------------------------------------------------------- volume, strain, stress


def rotation_rate(dim: int, angle: float) -> np.ndarray:
    rate = np.zeros((dim, dim))
    rate[0, 1], rate[1, 0] = -angle, angle
    if dim == 3:
        rate[1, 2], rate[2, 1] = -0.5 * angle, 0.5 * angle
    return rate


def random_components(n: int, dim: int) -> np.ndarray:
    return np.random.default_rng(dim).normal(size=(n, 3 * dim - 3)) * 1e5


@pytest.mark.parametrize("dim", [2, 3])
def test_components_and_tensors(dim):
    components = random_components(7, dim)
    tensor = to_tensor(components)
    assert np.array_equal(tensor, tensor.transpose(0, 2, 1))
    assert np.array_equal(np.trace(tensor, axis1=1, axis2=2), components[:, :dim].sum(axis=1))
    assert np.array_equal(to_components(tensor), components)
    assert np.array_equal(tensor[:, 0, 1], components[:, -1])


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 0.3, 1.0])
@pytest.mark.parametrize("dim", [2, 3])
def test_exponentials_of_many_matrices(dim, size):
    matrices = size * np.random.default_rng(dim).uniform(-1, 1, (50, dim, dim))
    expected = np.stack([expm(matrix) for matrix in matrices])
    # up to three squarings, each of which doubles what round-off there is
    assert np.abs(exponentials(matrices) - expected).max() < 100 * EPS * np.abs(expected).max()
    assert exponentials(matrices[:0]).shape == (0, dim, dim)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_stressed_block_turned_in_steps_keeps_its_invariants(dim):
    n, steps = 5, 20
    rate = rotation_rate(dim, np.pi / 2 / steps)
    stress = initial = random_components(n, dim)
    gradient = np.tile(rate, (n, 1, 1))
    for _ in range(steps):
        stress = update_stress(stress, gradient, np.full(n, 1e8), np.full(n, 5e7))
    turned = to_tensor(stress)
    R = expm(steps * rate)
    scale = np.abs(initial).max()
    # rounding of 20 matrix products; the moduli are 1e3 times the stress and act on a strain of 0
    assert np.abs(turned - R @ to_tensor(initial) @ R.T).max() < 1e-12 * scale
    first, last = (np.linalg.eigvalsh(t) for t in (to_tensor(initial), turned))
    assert np.abs(first - last).max() < 1e-12 * scale


def test_stress_under_confined_compression():
    # L = diag(a, 0): F = diag(e^a, 1), det F = e^a, d = L
    a, lam, G = -0.05, 3e7, 2e7
    gradient = np.zeros((1, 2, 2))
    gradient[0, 0, 0] = a
    sxx, syy, sxy = -1e5, -2e5, 3e4
    found = update_stress(np.array([[sxx, syy, sxy]]), gradient, np.full(1, lam), np.full(1, G))[0]
    expected = (np.exp(a) * (sxx + (lam + 2 * G) * a), np.exp(-a) * (syy + lam * a), sxy)
    assert np.allclose(found, expected, rtol=20 * EPS)


def test_kinematics_of_the_points():
    mesh = distorted_mesh("quadrilateral", MPI.COMM_SELF)
    points = seed(mesh, two_regions(mesh), [1.0, 1.0], 4, ("strain", "stress"))
    volume, n = points.volume.copy(), len(points)
    turn = np.tile(rotation_rate(2, 0.1), (n, 1, 1))
    points["stress"] = np.tile([-1e5, -2e5, 0.0], (n, 1))
    for _ in range(10):
        update_kinematics(points, turn, 1e8, 5e7)
    assert np.array_equal(points.volume, volume)  # exp(0) = 1: a rotation changes no volume
    assert np.all(points["strain"] == 0.0)
    stretch = np.zeros((n, 2, 2))
    stretch[:, 0, 0], stretch[:, 0, 1], stretch[:, 1, 1] = 0.01, 0.02, -0.004
    update_kinematics(points, stretch, np.full(n, 1e8), 5e7)
    assert np.allclose(points.volume, volume * np.exp(0.006), rtol=4 * EPS)
    assert np.allclose(points["strain"], [0.01, -0.004, 0.01], rtol=4 * EPS)


def test_kinematics_refuses():
    mesh = distorted_mesh("quadrilateral", MPI.COMM_SELF)
    points = seed(mesh, two_regions(mesh), [1.0, 1.0], 4, ("stress",))
    with pytest.raises(ValueError, match="Found gradients of shape"):
        update_kinematics(points, np.zeros((3, 2, 2)))
    with pytest.raises(ValueError, match="no moduli"):
        update_kinematics(points, np.zeros((len(points), 2, 2)))
