# SPDX-License-Identifier: MIT
"""Operators against their twins: forms written another way in UFL, closed forms, dense algebra."""

import numpy as np
import pytest
import ufl
from dolfinx.fem import Constant, Function, assemble_scalar, form, functionspace
from dolfinx.fem.petsc import assemble_matrix
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from support.meshes import scene

from fenics_hytf.domain import build, constraint_matrix
from fenics_hytf.operators import (
    ElasticForm,
    GeometricForm,
    assemble_mass,
    constrained_rows,
    displacement_rows,
    rayleigh_damping,
    strain_rows,
)
from fenics_hytf.particles import (
    default_points_per_cell,
    gradient_matrices,
    particle_mass_matrix,
    seed,
    to_components,
    to_tensor,
    transfer_matrix,
    update_stress,
)

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
LAMBDA, SHEAR = 30e6, 20e6  # [Pa]
DENSITY = (1800.0, 2100.0)  # [kg/m3]
CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
# Sums of a few hundred products of order one: some hundred roundings, seldom in one direction.
ROUND_OFF = 1e-13


def box(cell, degree=1, comm=WORLD, distorted=False):
    """A box of 2 m x 1.5 m (x 1 m), the lower part clay; inner nodes can be moved."""
    gdim = 2 if cell in ("triangle", "quadrilateral") else 3
    size, cells = [2.0, 1.5, 1.0][:gdim], ([4, 3], [2, 2, 2])[gdim - 2]
    regions = [{"soil": "clay", "below": 0.5}, {"soil": "sand"}]
    mesh = {"box": {"size": size, "cells": cells, "cell": cell}, "regions": regions}
    domain = build(scene(mesh | {"degree": degree}), comm)
    if distorted:
        x = domain.mesh.geometry.x
        bump = np.prod(np.sin(np.pi * x[:, :gdim] / size), axis=1)
        x[:, 0] += 0.15 * bump
        x[:, 1] -= 0.1 * bump
    return domain


def everywhere(domain, *values):
    """A value for each region, on all local cells."""
    return np.array(values)[domain.regions]


def difference(A, B) -> float:
    """Frobenius norm of A - B over that of B."""
    C = A.copy()
    C.axpy(-1.0, B, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    relative = C.norm() / B.norm()
    C.destroy()
    return relative


def assembled(expression) -> PETSc.Mat:
    matrix = assemble_matrix(form(expression))
    matrix.assemble()
    return matrix


def nodal(domain, field) -> PETSc.Vec:
    """A vector of nodal values of a field of the places, components fastest."""
    index_map = domain.V.dofmap.index_map
    x = domain.V.tabulate_dof_coordinates()[: index_map.size_local, : domain.gdim]
    vector = PETSc.Vec().createMPI((x.size, None), comm=domain.comm)
    vector.array[:] = field(x).ravel()
    return vector


def energy(K, u) -> float:
    Ku = K.createVecLeft()
    K.mult(u, Ku)
    return Ku.dot(u).real


# ---------------------------------------------------------------- elastic stiffness


def elastic(domain, lame=(LAMBDA, LAMBDA), shear=(SHEAR, SHEAR)):
    elasticity = ElasticForm(domain)
    K = elasticity.create_matrix()
    elasticity.assemble(K, everywhere(domain, *lame), everywhere(domain, *shear))
    return K


def elastic_twin(domain, lame, shear):
    """K_L from gradients instead of strains, a constant for each region instead of cell values."""
    tags = [
        (i, np.flatnonzero(domain.regions[: domain.num_owned_cells] == i).astype(np.int32))
        for i in (0, 1)
    ]
    u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
    degree = 2 * domain.V.ufl_element().degree
    dx = ufl.Measure("dx", domain.mesh, subdomain_data=tags, metadata={"quadrature_degree": degree})
    total = 0
    for i in (0, 1):
        scalar = PETSc.ScalarType
        a, b = (Constant(domain.mesh, scalar(c[i])) for c in (lame, shear))
        total += a * ufl.inner(ufl.div(u), ufl.div(v)) * dx(i)
        total += b * ufl.inner(ufl.grad(u) + ufl.grad(u).T, ufl.grad(v)) * dx(i)
    return assembled(total)


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_elastic_stiffness_equals_its_twin(cell, degree):
    domain = box(cell, degree, distorted=True)
    lame, shear = (LAMBDA, 2e6), (SHEAR, 5e6)
    K = elastic(domain, lame, shear)
    assert difference(K, elastic_twin(domain, lame, shear)) < ROUND_OFF
    assert difference(K.copy().transpose(), K) < ROUND_OFF


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_rigid_motions_cost_nothing(cell, degree):
    domain = box(cell, degree, distorted=True)
    K = elastic(domain)
    gdim = domain.gdim
    motions = [lambda x, e=e: np.tile(e, (len(x), 1)) for e in np.eye(gdim)]
    for i, j in [(0, 1), (0, 2), (1, 2)][: 2 * gdim - 3]:
        spin = np.zeros((gdim, gdim))
        spin[i, j], spin[j, i] = 1.0, -1.0
        motions.append(lambda x, spin=spin: x @ spin.T)
    for motion in motions:
        u = nodal(domain, motion)
        force = K.createVecLeft()
        K.mult(u, force)
        scale = K.norm(PETSc.NormType.INFINITY) * u.norm(PETSc.NormType.INFINITY)
        assert force.norm(PETSc.NormType.INFINITY) < ROUND_OFF * scale


@pytest.mark.parametrize("cell", CELLS)
def test_energy_of_a_uniform_strain(cell):
    domain = box(cell, 1)
    K = elastic(domain)
    gradient = np.random.default_rng(1).normal(size=(domain.gdim, domain.gdim))
    strain = (gradient + gradient.T) / 2
    volume = 2.0 * 1.5
    expected = volume * (LAMBDA * np.trace(strain) ** 2 + 2 * SHEAR * np.sum(strain**2))
    found = energy(K, nodal(domain, lambda x: x @ gradient.T))
    assert found == pytest.approx(expected, rel=ROUND_OFF)


def test_assembling_again_forgets_what_was_there():
    domain = box("quadrilateral")
    elasticity = ElasticForm(domain)
    K = elasticity.create_matrix()
    for factor in (7.0, 1.0):
        elasticity.assemble(
            K, everywhere(domain, LAMBDA, LAMBDA), factor * everywhere(domain, SHEAR, SHEAR)
        )
    assert difference(K, elastic(domain)) == 0.0


# ---------------------------------------------------------------- geometric stiffness

STRESS = {
    2: np.array([[-80e3, 15e3], [15e3, -160e3]]),
    3: np.array([[-80e3, 15e3, 5e3], [15e3, -60e3, -9e3], [5e3, -9e3, -160e3]]),
}


def geometric(domain, stress):
    K = elastic(domain)
    GeometricForm(domain).assemble(K, stress)
    return K


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_geometric_stiffness_equals_its_twin(cell, degree):
    domain = box(cell, degree, distorted=True)
    gdim = domain.gdim
    K = geometric(domain, np.tile(STRESS[gdim], (len(domain.regions), 1, 1)))
    u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
    sigma = Constant(domain.mesh, STRESS[gdim].astype(PETSc.ScalarType))
    axes = range(gdim)
    integrand = sum(
        sigma[j, i] * ufl.inner(u[k].dx(j), v[k].dx(i)) for i in axes for j in axes for k in axes
    )
    twin = assembled(integrand * ufl.dx(domain.mesh, metadata={"quadrature_degree": 2 * degree}))
    assert difference(K, twin) < ROUND_OFF


@pytest.mark.parametrize("cell", CELLS)
def test_energy_of_a_uniform_stress(cell):
    domain = box(cell)
    gdim = domain.gdim
    K = geometric(domain, np.tile(STRESS[gdim], (len(domain.regions), 1, 1)))
    gradient = np.random.default_rng(2).normal(size=(gdim, gdim))
    expected = 3.0 * np.trace(gradient @ STRESS[gdim] @ gradient.T)
    found = energy(K, nodal(domain, lambda x: x @ gradient.T))
    scale = 3.0 * np.linalg.norm(STRESS[gdim]) * np.sum(gradient**2)
    assert found == pytest.approx(expected, abs=ROUND_OFF * scale)


@pytest.mark.parametrize("cell", CELLS)
def test_both_are_the_tangent_of_the_stress_update(cell):
    """K_L + K_NL is the derivative of the internal force of the points' stress update.

    f(u) = Σ_p V_p e^{tr L} σ_new ∂N/∂x at the moved nodes, differenced about u = 0.
    """
    domain = box(cell, comm=SELF, distorted=cell in ("triangle", "quadrilateral"))
    gdim = domain.gdim
    points = seed(domain.mesh, domain.regions, DENSITY, default_points_per_cell(cell, 1))
    of_region = np.stack([STRESS[gdim], 0.5 * STRESS[gdim] + 20e3 * np.eye(gdim)])
    sigma = of_region[domain.regions]
    lame, shear = (LAMBDA, 2e6), (SHEAR, 5e6)
    gradients = gradient_matrices(points, domain.V)

    def force(u):
        L = np.stack([dN @ u for dN in gradients], axis=2)
        start = to_components(sigma[points.cell])
        region = points.region
        new = to_tensor(update_stress(start, L, np.array(lame)[region], np.array(shear)[region]))
        volume = points.volume * np.exp(np.trace(L, axis1=1, axis2=2))
        # ∂N/∂x at the moved nodes is ∂N/∂X F⁻¹, with F = I + L.
        pull = np.linalg.inv(np.eye(gdim) + L)
        flux = np.einsum("p,pij,pkj->pik", volume, new, pull)
        return sum(dN.T @ flux[:, :, k] for k, dN in enumerate(gradients))

    num_nodes = gradients[0].shape[1]
    direction = np.random.default_rng(3).normal(size=(num_nodes, gdim))
    # Strains of 1e-5: the difference's own error is their square, its round-off 1e-13.
    step = 1e-6
    differenced = (force(step * direction) - force(-step * direction)) / (2 * step)
    u = nodal(domain, lambda x: direction)
    linear, nonlinear = (
        dense(K).real @ u.array.real
        for K in (elastic(domain, lame, shear), geometric(domain, sigma))
    )
    scale = np.abs(differenced).max()
    assert np.abs(linear + nonlinear - differenced.ravel()).max() < 1e-9 * scale
    assert np.abs(nonlinear).max() > 1e-4 * scale  # without K_NL the test would fail


# ---------------------------------------------------------------- mass and damping


def weighed(domain, cell, degree):
    points = seed(domain.mesh, domain.regions, DENSITY, default_points_per_cell(cell, degree))
    mass = particle_mass_matrix(transfer_matrix(points, domain.V), points.mass)
    K = elastic(domain)
    return assemble_mass(domain, mass, K), K


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_mass_at_quadrature_points_is_the_consistent_one(cell, degree):
    # Bilinear cells too: their Jacobian raises the degree by one, which the rule still covers; a
    # trilinear one is beyond it, so hexahedra stay straight.
    domain = box(cell, degree, distorted=cell != "hexahedron")
    M, K = weighed(domain, cell, degree)
    u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
    tags = [
        (i, np.flatnonzero(domain.regions[: domain.num_owned_cells] == i).astype(np.int32))
        for i in (0, 1)
    ]
    dx = ufl.Measure("dx", domain.mesh, subdomain_data=tags)
    twin = assembled(
        sum(
            Constant(domain.mesh, PETSc.ScalarType(DENSITY[i])) * ufl.inner(u, v) * dx(i)
            for i in (0, 1)
        )
    )
    assert difference(M, twin) < 1e-13
    assert difference(M.copy().transpose(), M) < 1e-15  # ranks add in another order
    ones = nodal(domain, np.ones_like)
    assert energy(M, ones) / domain.gdim == pytest.approx(total_mass(domain), rel=1e-13)
    info = PETSc.Mat.InfoType.LOCAL
    assert M.getInfo(info)["nz_used"] == K.getInfo(info)["nz_used"]


def total_mass(domain) -> float:
    """Density times volume of the cells, by dolfinx."""
    density = Function(functionspace(domain.mesh, ("DG", 0)))
    density.x.array[:] = everywhere(domain, *DENSITY)
    return domain.comm.allreduce(assemble_scalar(form(density * ufl.dx)).real)


def test_rayleigh_damping():
    domain = box("quadrilateral", comm=SELF)
    M, K = weighed(domain, "quadrilateral", 1)
    C = rayleigh_damping(M, K, 0.3, 2e-3)
    expected = 0.3 * dense(M) + 2e-3 * dense(K)
    np.testing.assert_allclose(dense(C), expected, rtol=0, atol=1e-15 * np.abs(expected).max())
    info = PETSc.Mat.InfoType.LOCAL
    assert C.getInfo(info)["nz_used"] == K.getInfo(info)["nz_used"]


# ---------------------------------------------------------------- rows


def dense(matrix) -> np.ndarray:
    """All rows on every rank, in the order of the ranks."""
    indptr, indices, values = matrix.getValuesCSR()
    shape = (len(indptr) - 1, matrix.getSize()[1])
    mine = sparse.csr_matrix((values, indices, indptr), shape).toarray()
    return np.concatenate(matrix.comm.tompi4py().allgather(mine))


def polynomial(degree, gdim):
    """A random field of a degree and its gradient: u_i = a_i + B_ij x_j + C_ijk x_j x_k."""
    rng = np.random.default_rng(4)
    a, B = rng.normal(size=gdim), rng.normal(size=(gdim, gdim))
    C = rng.normal(size=(gdim, gdim, gdim)) * (degree > 1)

    def value(x):
        return a + x @ B.T + np.einsum("ijk,pj,pk->pi", C, x, x)

    def gradient(x):
        return B + np.einsum("ijk,pk->pij", C + C.transpose(0, 2, 1), x)

    return value, gradient


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_rows_reproduce_polynomials(cell, degree):
    # Bilinear cells hold all linear fields but not all quadratic ones.
    domain = box(cell, degree, distorted=degree == 1 or cell in ("triangle", "tetrahedron"))
    gdim = domain.gdim
    points = seed(domain.mesh, domain.regions, DENSITY, default_points_per_cell(cell, degree))
    value, gradient = polynomial(degree, gdim)
    u = value(domain.V.tabulate_dof_coordinates()[:, :gdim]).ravel()
    place = displacement_rows(transfer_matrix(points, domain.V), gdim)
    np.testing.assert_allclose((place @ u).reshape(-1, gdim), value(points.x), atol=ROUND_OFF)
    strain = strain_rows(gradient_matrices(points, domain.V), domain.gdim)
    L = gradient(points.x)
    components = to_components((L + L.transpose(0, 2, 1)) / 2)
    components[:, gdim:] *= 2  # the points carry tensor components, rows engineering shear
    found = (strain @ u).reshape(len(points), -1)
    # Derivatives divide by cells of 0.3 m: 100 roundings of order 10.
    np.testing.assert_allclose(found, components, atol=10 * ROUND_OFF)


@pytest.mark.mpi
@pytest.mark.parametrize("cell", CELLS)
def test_constrained_rows_are_the_product_with_t(cell):
    domain = box(cell)
    gdim = domain.gdim
    T = constraint_matrix(domain, {"left": "tied", "right": "tied"})
    points = seed(domain.mesh, domain.regions, DENSITY, default_points_per_cell(cell, 1))
    local = strain_rows(gradient_matrices(points, domain.V), domain.gdim)
    index_map = domain.V.dofmap.index_map
    count = index_map.size_local + index_map.num_ghosts
    numbers = index_map.local_to_global(np.arange(count))
    columns = (numbers[:, None] * gdim + np.arange(gdim)).ravel()
    whole = np.zeros((local.shape[0], index_map.size_global * gdim))
    whole[:, columns] = local.toarray()
    whole = np.concatenate(domain.comm.allgather(whole))
    found = dense(constrained_rows(domain, local, T))
    expected = whole @ dense(T).real
    np.testing.assert_allclose(found, expected, atol=1e-15 * np.abs(expected).max())


@pytest.mark.mpi
def test_a_rank_without_rows():
    domain = box("quadrilateral")
    T = constraint_matrix(domain, {})
    index_map = domain.V.dofmap.index_map
    width = (index_map.size_local + index_map.num_ghosts) * 2
    mine = 2 if domain.comm.rank == 0 else 0
    rows = constrained_rows(domain, sparse.csr_matrix((mine, width)), T)
    assert rows.getSize() == (2, T.getSize()[1])
    assert rows.getLocalSize()[0] == mine
