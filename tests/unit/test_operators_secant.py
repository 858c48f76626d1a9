# SPDX-License-Identifier: MIT
"""The secant stiffness and its strains against forms and tensors written out another way."""

import numpy as np
import pytest
import ufl
from dolfinx.fem import Function, form, functionspace
from dolfinx.fem.petsc import assemble_matrix, assemble_vector
from mpi4py import MPI
from petsc4py import PETSc
from support.meshes import scene

from fenics_hytf.domain import Domain, build
from fenics_hytf.operators import BULK_OVER_SHEAR, SecantForm
from fenics_hytf.operators.quadrature import gauss_sites, quadrature_degree
from fenics_hytf.particles import transfer_matrix

WORLD = MPI.COMM_WORLD
CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
FLAT = ("triangle", "quadrilateral")
# Sums of a few hundred products, of which those with κ are 1e4 times the others.
ROUND_OFF = 1e-13


def box(cell: str, degree: int = 1, shape=None, comm=WORLD, shift=0.1, **mesh) -> Domain:
    """A box of 2 m x 1.5 m (x 1 m) with its inner nodes moved."""
    gdim = 2 if cell in FLAT else 3
    size, cells = [2.0, 1.5, 1.0][:gdim], shape or ([5, 3], [2, 3, 2])[gdim - 2]
    across = {"direction": "z" if mesh.get("kinematics") == "antiplane" else "x"}
    harmonic = {"harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 16}}
    grid = {"box": {"size": size, "cells": cells, "cell": cell}, "degree": degree}
    domain = build(scene(grid | mesh, ("clay",), motion=[across | harmonic]), comm)
    x = domain.mesh.geometry.x
    bump = np.prod(np.sin(np.pi * x[:, :gdim] / size), axis=1)
    x[:, 0] += shift * bump
    x[:, 1] -= 0.7 * shift * bump
    return domain


def nodal(domain: Domain, field) -> np.ndarray:
    return field(domain.V.tabulate_dof_coordinates()[:, : domain.gdim])


def wavy(domain: Domain) -> np.ndarray:
    waves = np.arange(1, domain.gdim + 1)
    return nodal(domain, lambda x: np.sin(3 * x[:, :1] * waves + 2 * x[:, 1:2]) + x[:, :1])


def gauss_places(domain: Domain) -> np.ndarray:
    """Shape ``(num_owned_cells, num_gauss_points, gdim)``, by the shape functions of the nodes."""
    sites, volume = gauss_sites(domain)
    x = domain.V.tabulate_dof_coordinates()[:, : domain.gdim]
    return (transfer_matrix(sites, domain.V) @ x).reshape(*volume.shape, -1)


def modulus(x):
    """G_s, of NumPy's or UFL's places."""
    return 1e6 * (1 + 3 * x[0] * x[1] + 20 * x[0] ** 2)


def parts(domain: Domain) -> np.ndarray:
    """How far cells are filled, from their place."""
    x = domain.mesh.geometry.x[domain.mesh.geometry.dofmap].mean(axis=1)
    return np.where(x[:, 0] < 0.5, 0.0, np.round(0.3 + 0.3 * x[:, 1], 3))


def assembled(domain: Domain) -> tuple[SecantForm, np.ndarray, PETSc.Mat]:
    secant = SecantForm(domain)
    G = modulus(np.moveaxis(gauss_places(domain), 2, 0))
    K = secant.create_matrix()
    secant.assemble(K, G, parts(domain))
    return secant, G, K


def twin(domain: Domain) -> PETSc.Mat:
    """Of tensors of three dimensions, the modulus a function of the places."""
    cells = functionspace(domain.mesh, ("DG", 0))
    weight, kappa = Function(cells), Function(cells)
    weight.x.array[:] = parts(domain)
    degree, gdim = quadrature_degree(domain), domain.gdim
    full, reduced = (
        ufl.dx(domain.mesh, metadata={"quadrature_degree": d}) for d in (degree, degree - 2)
    )
    G = modulus(ufl.SpatialCoordinate(domain.mesh))
    test = ufl.TestFunction(cells)
    mean, volume = (assemble_vector(form(c * ufl.conj(test) * full)) for c in (G, G / G))
    owned = domain.num_owned_cells
    kappa.x.array[:owned] = 1e4 * mean.array[:owned] / volume.array[:owned]
    mean.destroy()
    volume.destroy()

    def deviator(u):
        gradient = ufl.grad(u)
        L = [[gradient[i, j] if max(i, j) < gdim else 0 for j in range(3)] for i in range(3)]
        return ufl.dev(ufl.sym(ufl.as_tensor(L)))

    u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
    # Apart: in one form of two rules the compiler confuses the places of their points.
    shear = assemble_matrix(form(2 * G * weight * ufl.inner(deviator(u), deviator(v)) * full))
    bulk = assemble_matrix(form(kappa * weight * ufl.inner(ufl.div(u), ufl.div(v)) * reduced))
    shear.assemble()
    bulk.assemble()
    shear.axpy(1.0, bulk, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    bulk.destroy()
    return shear


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_stiffness_equals_its_twin(cell, degree, figure):
    domain = box(cell, degree)
    _, _, K = assembled(domain)
    expected = twin(domain)
    scale = expected.norm()
    assert scale > 1e9
    expected.axpy(-1.0, K, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    figure(f"secant stiffness, {cell}, degree {degree}", expected.norm() / scale, ROUND_OFF)
    for matrix in (K, expected):
        matrix.destroy()


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_energy_is_that_of_the_strains(cell, degree):
    """u·K_s u = ∫ G_s (γ² + 1e4 θ²) dV, with the mean of G_s in κ that makes it so."""
    domain = box(cell, degree)
    secant, G, K = assembled(domain)
    field = wavy(domain)
    u, Ku = K.createVecs()
    u.array[:] = field.ravel()[: u.getLocalSize()]
    K.mult(u, Ku)
    squares = (secant.strain(field) ** 2).sum(axis=2)
    filled = secant.volume * parts(domain)[: domain.num_owned_cells, None]
    expected = WORLD.allreduce(float((filled * G * squares).sum()))
    assert u.dot(Ku).real == pytest.approx(expected, rel=1e-12)
    # and γ is the part of it that has no κ
    gamma = secant.shear_strain(field)
    assert np.all(gamma**2 <= squares * (1 + 1e-12))
    assert WORLD.allreduce(float(gamma.max(initial=0.0)), MPI.MAX) > 1.0
    for owned in (K, u, Ku):
        owned.destroy()


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_strains_of_a_linear_field(cell, degree):
    """γ = √(2 e:e) of the tensor of three dimensions, and θ its trace, in every cell."""
    domain = box(cell, degree)
    secant, gdim = SecantForm(domain), domain.gdim
    L = np.random.default_rng(gdim).normal(size=(gdim, gdim))
    field = nodal(domain, lambda x: x @ L.T + 5.0)
    strain = np.zeros((3, 3))
    strain[:gdim, :gdim] = (L + L.T) / 2
    deviator = strain - np.trace(strain) / 3 * np.eye(3)
    gamma = np.sqrt(2 * np.sum(deviator**2))
    np.testing.assert_allclose(secant.shear_strain(field), gamma, rtol=1e-12)
    squares = (secant.strain(field) ** 2).sum(axis=2)
    expected = gamma**2 + BULK_OVER_SHEAR * np.trace(L) ** 2
    np.testing.assert_allclose(squares, expected, rtol=1e-12)
    spin = nodal(domain, lambda x: x @ (L - L.T).T)
    assert np.abs(secant.strain(spin)).max() < 1e-11  # 1e2 of √κ/G times round-off of 1


@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron"])
def test_a_cell_flows_in_bending(cell):
    """u_x = (x − 1)(y − ¾): what locks a cell of degree 1 under full integration has no κ."""
    gdim = 2 if cell == "quadrilateral" else 3
    domain = box(cell, shape=[1] * gdim, comm=MPI.COMM_SELF, shift=0.0)
    secant = SecantForm(domain)
    field = nodal(domain, lambda x: np.eye(gdim)[0] * ((x[:, :1] - 1.0) * (x[:, 1:2] - 0.75)))
    squares = (secant.strain(field) ** 2).sum(axis=2)
    np.testing.assert_allclose(squares, secant.shear_strain(field) ** 2, rtol=1e-9)
    assert squares.min() > 0.05


def test_a_section_across_its_plane_is_refused():
    with pytest.raises(ValueError, match="1 component in 2 dimensions; expected plane strain"):
        SecantForm(box("quadrilateral", kinematics="antiplane"))
