# SPDX-License-Identifier: MIT
"""The transfer matrix S and the particle mass, proved against dolfinx's forms and evaluation."""

import basix
import basix.ufl
import numpy as np
import pytest
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.mesh import (
    CellType,
    GhostMode,
    Mesh,
    create_cell_partitioner,
    create_mesh,
    create_unit_cube,
    create_unit_square,
)
from mpi4py import MPI

from fenics_hytf.particles import (
    Sites,
    default_points_per_cell,
    gradient_matrices,
    particle_mass_matrix,
    seed,
    transfer_matrix,
)

CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
DENSITY = np.array([1800.0, 2100.0])
# Sums of a few tens of terms of size one, each rounded: 1e-13 is 450 eps.
ROUNDING = 1e-13


def distorted_mesh(cell: str) -> Mesh:
    ghosts = GhostMode.shared_facet
    comm = MPI.COMM_WORLD
    if cell in ("triangle", "quadrilateral"):
        mesh = create_unit_square(comm, 6, 5, CellType[cell], ghost_mode=ghosts)
    else:
        mesh = create_unit_cube(comm, 3, 4, 3, CellType[cell], ghost_mode=ghosts)
    x = mesh.geometry.x
    gdim = mesh.geometry.dim
    bump = np.prod(np.sin(np.pi * x[:, :gdim]), axis=1)
    for axis in range(gdim):
        x[:, axis] += (0.06 - 0.03 * axis) * bump
    return mesh


def curved_mesh(cell: str) -> Mesh:
    """The same cells with geometry of degree 2 and bent edges."""
    flat = distorted_mesh(cell)
    gdim = flat.geometry.dim
    V = fem.functionspace(flat, ("Lagrange", 2))
    index_map = V.dofmap.index_map
    nodes = V.tabulate_dof_coordinates()[: index_map.size_local, :gdim]
    num_cells = flat.topology.index_map(gdim).size_local
    cells = V.dofmap.list[:num_cells]
    cells = index_map.local_to_global(cells.reshape(-1)).reshape(cells.shape)
    bent = nodes + 0.04 * np.sin(2 * np.pi * nodes[:, ::-1])
    element = basix.ufl.element("Lagrange", cell, 2, shape=(gdim,))
    partitioner = create_cell_partitioner(GhostMode.shared_facet)
    return create_mesh(flat.comm, cells, bent, ufl.Mesh(element), partitioner)


def make_mesh(cell: str, geometry: int) -> Mesh:
    return distorted_mesh(cell) if geometry == 1 else curved_mesh(cell)


def num_owned(mesh: Mesh) -> int:
    return mesh.topology.index_map(mesh.topology.dim).size_local


def random_sites(mesh: Mesh, per_cell: int = 3) -> tuple[Sites, np.ndarray]:
    """Places in the owned cells, and their positions by dolfinx's own map."""
    rng = np.random.default_rng(mesh.comm.rank)
    cells = np.repeat(np.arange(num_owned(mesh), dtype=np.int32), per_cell)
    X = rng.dirichlet(np.ones(mesh.topology.dim + 1), cells.size)[:, 1:]
    if mesh.topology.cell_name() in ("quadrilateral", "hexahedron"):
        X = rng.random((cells.size, mesh.topology.dim))
    nodes = mesh.geometry.x[mesh.geometry.dofmap, : mesh.geometry.dim]
    push = mesh.geometry.cmap.push_forward
    x = [push(X[i : i + 1], nodes[cell])[0] for i, cell in enumerate(cells)]
    return Sites(cells, X), np.array(x).reshape(-1, mesh.geometry.dim)


def nodal(u: fem.Function) -> np.ndarray:
    return u.x.array.reshape(-1, u.function_space.dofmap.bs)


def regions(mesh: Mesh) -> np.ndarray:
    index_map = mesh.topology.index_map(mesh.topology.dim)
    num_cells = index_map.size_local + index_map.num_ghosts
    return (mesh.topology.original_cell_index[:num_cells] % 3 == 0).astype(np.int32)


@pytest.mark.mpi
@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize(("degree", "geometry"), [(1, 1), (2, 1), (2, 2)])
def test_linear_fields_are_reproduced(cell, degree, geometry, figure):
    mesh = make_mesh(cell, geometry)
    gdim = mesh.geometry.dim
    V = fem.functionspace(mesh, ("Lagrange", degree, (gdim,)))
    sites, x = random_sites(mesh)
    A = np.random.default_rng(3).normal(size=(gdim, gdim))
    b = np.arange(1.0, gdim + 1)
    u = fem.Function(V)
    u.interpolate(lambda at: A @ at[:gdim] + b[:, None])
    S = transfer_matrix(sites, V)
    index_map = V.dofmap.index_map
    assert S.shape == (len(sites), index_map.size_local + index_map.num_ghosts)
    assert S.dtype == np.float64
    error = np.abs(S @ nodal(u) - (x @ A.T + b)).max(initial=0)
    figure(f"S on a linear field, {cell}, degrees {degree}, {geometry}", error, 1e-13)
    assert np.abs(np.asarray(S.sum(axis=1)) - 1).max(initial=0) < ROUNDING
    for j, gradient in enumerate(gradient_matrices(sites, V)):
        # derivatives are 1/h = 6 times the values
        assert np.abs(gradient @ nodal(u) - A[:, j]).max(initial=0) < 6 * ROUNDING
        assert np.abs(np.asarray(gradient.sum(axis=1))).max(initial=0) < 6 * ROUNDING


@pytest.mark.mpi
@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize(("degree", "geometry"), [(1, 1), (2, 1), (1, 2), (2, 2)])
def test_values_and_gradients_equal_dolfinx_evaluation(cell, degree, geometry):
    mesh = make_mesh(cell, geometry)
    gdim = mesh.geometry.dim
    V = fem.functionspace(mesh, ("Lagrange", degree, (gdim,)))
    u = fem.Function(V)
    rng = np.random.default_rng(mesh.comm.rank)
    u.x.array[:] = rng.normal(size=(u.x.array.size, 2)) @ [1.0, 1.0j]
    X, _ = random_sites(mesh)
    X = X.X[:4]  # the same places in every cell, as an Expression takes them
    owned = num_owned(mesh)
    cells = np.arange(owned, dtype=np.int32)
    sites = Sites(np.repeat(cells, 4), np.tile(X, (owned, 1)))
    value = fem.Expression(u, X).eval(mesh, cells).reshape(-1, gdim)
    slope = fem.Expression(ufl.grad(u), X).eval(mesh, cells).reshape(-1, gdim, gdim)
    assert np.abs(transfer_matrix(sites, V) @ nodal(u) - value).max() < ROUNDING * 10  # |u| to 5
    for j, gradient in enumerate(gradient_matrices(sites, V)):
        scale = np.abs(slope).max()
        assert np.abs(gradient @ nodal(u) - slope[:, :, j]).max() < ROUNDING * scale


@pytest.mark.mpi
@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize(("degree", "geometry"), [(1, 1), (2, 1), (1, 2), (2, 2)])
def test_mass_of_points_at_quadrature_points_is_the_ufl_mass(cell, degree, geometry, figure):
    mesh = make_mesh(cell, geometry)
    gdim = mesh.geometry.dim
    V = fem.functionspace(mesh, ("Lagrange", degree, (gdim,)))
    points = seed(mesh, regions(mesh), DENSITY, default_points_per_cell(cell, degree))
    M = particle_mass_matrix(transfer_matrix(points, V), points.mass).toarray()

    # The rule of this degree is the one the points were seeded on (checked in the next test).
    rho = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    rho.x.array[: regions(mesh).size] = DENSITY[regions(mesh)]
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    dx = ufl.dx(metadata={"quadrature_degree": 2 * degree})
    ufl_mass = fem.assemble_matrix(fem.form(rho * ufl.inner(u, v) * dx))  # this rank's part
    expected = ufl_mass.to_scipy(ghosted=True).toarray()
    scale = np.abs(expected).max()
    size = gdim * M.shape[0]  # further columns are filled by other ranks, which are not asked here
    assert expected.shape[0] == size and not expected[:, size:].any()
    expected = expected[:, :size]
    error = max(
        np.abs(expected[i::gdim, j::gdim] - (M if i == j else 0.0)).max()
        for i in range(gdim)
        for j in range(gdim)
    )
    figure(f"S^T M_p S to UFL mass, {cell}, degrees {degree}, {geometry}", error / scale, 1e-13)
    assert np.array_equal(M, M.T)  # to the bit: a symmetric factorisation may take either half


@pytest.mark.mpi
@pytest.mark.parametrize("cell", CELLS)
def test_mass_where_the_rule_suffices_is_the_full_integral(cell):
    # In two dimensions det J is linear in each direction, so that three Gauss points integrate the
    # mass of degree 2 exactly; in three it is quadratic unless the cells are parallelepipeds.
    mesh = distorted_mesh(cell)
    if cell == "hexahedron":
        mesh = create_unit_cube(mesh.comm, 3, 4, 3, CellType.hexahedron)
        mesh.geometry.x[:] = mesh.geometry.x @ np.array([[2, 0.3, 0], [0, 1, 0.4], [0.2, 0, 1.5]])
    V = fem.functionspace(mesh, ("Lagrange", 2))
    points = seed(mesh, regions(mesh), DENSITY, default_points_per_cell(cell, 2))
    M = particle_mass_matrix(transfer_matrix(points, V), points.mass)
    f = fem.Function(V)
    f.interpolate(lambda x: np.cos(3 * x[0]) + x[1] ** 2 + x[2])
    rho = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    rho.x.array[: regions(mesh).size] = DENSITY[regions(mesh)]
    energy = rho * ufl.inner(f, f) * ufl.dx(metadata={"quadrature_degree": 12})
    expected = mesh.comm.allreduce(fem.assemble_scalar(fem.form(energy)).real)
    values = f.x.array.real
    assert mesh.comm.allreduce(values @ (M @ values)) == pytest.approx(expected, rel=ROUNDING)


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("degree", [1, 2])
def test_mass_of_seeded_points_is_regular(cell, degree):
    if MPI.COMM_WORLD.size > 1:
        pytest.skip("a serial matrix")
    mesh = distorted_mesh(cell)
    V = fem.functionspace(mesh, ("Lagrange", degree))
    points = seed(mesh, regions(mesh), DENSITY, default_points_per_cell(cell, degree))
    M = particle_mass_matrix(transfer_matrix(points, V), points.mass).toarray()
    d = np.sqrt(np.diag(M))
    # Scaled consistent mass matrices have eigenvalues of order one (Wathen 1987); a deficient rule
    # leaves one at the rounding level.
    assert np.linalg.eigvalsh(M / np.outer(d, d)).min() > 0.01


@pytest.mark.mpi
def test_nodes_take_the_momentum_of_the_points():
    mesh = distorted_mesh("quadrilateral")
    V = fem.functionspace(mesh, ("Lagrange", 2, (2,)))
    points = seed(mesh, regions(mesh), DENSITY, 9)
    velocity = np.column_stack([np.sin(5 * points.x[:, 0]), points.x[:, 1] - 0.2])
    S = transfer_matrix(points, V)
    nodes = mesh.comm.allreduce((S.T @ (points.mass[:, None] * velocity)).sum(axis=0))
    total = mesh.comm.allreduce((points.mass[:, None] * velocity).sum(axis=0))
    assert nodes == pytest.approx(total, rel=ROUNDING)


def test_a_rank_without_points_has_empty_matrices():
    mesh = distorted_mesh("hexahedron")
    V = fem.functionspace(mesh, ("Lagrange", 1, (3,)))
    points = seed(mesh, 0 * regions(mesh), [0.0], 8)
    S = transfer_matrix(points, V)
    assert S.shape[0] == 0
    assert particle_mass_matrix(S, points.mass).nnz == 0
    assert all(g.shape == S.shape for g in gradient_matrices(points, V))


def test_elements_that_depend_on_orientation_are_refused():
    mesh = distorted_mesh("triangle")
    V = fem.functionspace(mesh, ("N1curl", 1))
    with pytest.raises(ValueError, match="expected a Lagrange element"):
        transfer_matrix(seed(mesh, 0 * regions(mesh), [1.0], 3), V)


def test_scalars_are_complex():
    # The comparison of values above relies on it: S is real and keeps imaginary parts.
    assert np.issubdtype(default_scalar_type, np.complexfloating)
