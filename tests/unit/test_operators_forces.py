# SPDX-License-Identifier: MIT
"""Nodal forces of a stress at Gauss points against the forms of the stiffness and closed forms."""

import numpy as np
import pytest
import ufl
from dolfinx import la
from dolfinx.fem import Constant, Function, form
from dolfinx.fem.petsc import assemble_vector
from mpi4py import MPI
from petsc4py import PETSc
from support.meshes import scene

from fenics_hytf.domain import Domain, build
from fenics_hytf.operators import ElasticForm, InternalForce, isotropic_stress, strain_rows
from fenics_hytf.operators.forms import quadrature_degree
from fenics_hytf.particles import gradient_matrices

WORLD = MPI.COMM_WORLD
CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
FLAT = ("triangle", "quadrilateral")
KINDS = [(cell, "plane_strain") for cell in CELLS] + [(cell, "antiplane") for cell in FLAT]
LAMBDA, SHEAR = np.array([30e6, 2e6]), np.array([20e6, 5e6])  # [Pa], of each region
ROUND_OFF = 1e-13


def box(cell: str, degree: int, kinematics: str = "plane_strain") -> Domain:
    """A distorted box of 2 m x 1.5 m (x 1 m), the lower part clay."""
    gdim = 2 if cell in FLAT else 3
    size, cells = [2.0, 1.5, 1.0][:gdim], ([5, 3], [2, 3, 2])[gdim - 2]
    regions = [{"soil": "clay", "below": 0.5}, {"soil": "sand"}]
    mesh = {"box": {"size": size, "cells": cells, "cell": cell}, "regions": regions}
    across = {"direction": "z" if kinematics == "antiplane" else "x"}
    harmonic = {"harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 16}}
    kind = {"kinematics": kinematics} if gdim == 2 else {}
    domain = build(scene(mesh | {"degree": degree} | kind, motion=[across | harmonic]), WORLD)
    x = domain.mesh.geometry.x
    bump = np.prod(np.sin(np.pi * x[:, :gdim] / size), axis=1)
    x[:, 0] += 0.15 * bump
    x[:, 1] -= 0.1 * bump
    return domain


def motion(domain: Domain, field) -> Function:
    """The nodal values of a field of the places."""
    u = Function(domain.V)
    x = domain.V.tabulate_dof_coordinates()[:, : domain.gdim]
    u.x.array[:] = field(x).ravel()
    return u


def wavy(domain: Domain) -> Function:
    components = np.arange(1, domain.num_components + 1)
    return motion(domain, lambda x: np.sin(3 * x[:, :1] * components + 2 * x[:, 1:2]) + x[:, :1])


def strain_at(domain: Domain, sites, u: Function) -> np.ndarray:
    B = strain_rows(gradient_matrices(sites, domain.V), domain.num_components)
    return (B @ u.x.array.real).reshape(len(sites), -1)


def summed(domain: Domain, nodal: np.ndarray) -> np.ndarray:
    """What all ranks' cells do to this rank's own nodes."""
    force = Function(domain.V)
    force.x.array[:] = nodal
    force.x.scatter_reverse(la.InsertMode.add)
    return own(domain, force.x.array)


def own(domain: Domain, nodal: np.ndarray) -> np.ndarray:
    return nodal[: domain.V.dofmap.index_map.size_local * domain.num_components].real


def largest(values: np.ndarray) -> float:
    return WORLD.allreduce(float(np.abs(values).max(initial=0.0)), MPI.MAX)


def twin(domain: Domain, u: Function) -> np.ndarray:
    """∫ σ(u) : ε(v) dV, its stress written out with a trace of gradients."""
    tags = [
        (i, np.flatnonzero(domain.regions[: domain.num_owned_cells] == i).astype(np.int32))
        for i in (0, 1)
    ]
    metadata = {"quadrature_degree": quadrature_degree(domain)}
    dx = ufl.Measure("dx", domain.mesh, subdomain_data=tags, metadata=metadata)
    v, total = ufl.TestFunction(domain.V), 0
    for i in (0, 1):
        scalar = PETSc.ScalarType
        a, b = (Constant(domain.mesh, scalar(c[i])) for c in (LAMBDA, SHEAR))
        if domain.num_components == 1:
            total += b * ufl.inner(ufl.grad(u), ufl.grad(v)) * dx(i)
        else:
            total += a * ufl.inner(ufl.div(u), ufl.div(v)) * dx(i)
            total += b * ufl.inner(ufl.grad(u) + ufl.grad(u).T, ufl.grad(v)) * dx(i)
    vector = assemble_vector(form(total))
    vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
    values = vector.array_r.real.copy()
    vector.destroy()
    return values


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(("cell", "kinematics"), KINDS)
def test_force_of_the_elastic_stress_is_that_of_the_stiffness(cell, kinematics, degree, figure):
    domain = box(cell, degree, kinematics)
    assert domain.num_components == (1 if kinematics == "antiplane" else domain.gdim)
    internal, u = InternalForce(domain), wavy(domain)
    region = domain.regions[internal.sites.cell]
    stress = isotropic_stress(strain_at(domain, internal.sites, u), LAMBDA[region], SHEAR[region])
    found = summed(domain, internal(stress))
    elastic = ElasticForm(domain)
    K = elastic.create_matrix()
    elastic.assemble(K, LAMBDA[domain.regions], SHEAR[domain.regions])
    x, Ku = K.createVecs()
    x.array[:] = own(domain, u.x.array)
    K.mult(x, Ku)
    scale = largest(Ku.array_r)
    error = max(largest(found - expected) for expected in (Ku.array_r.real, twin(domain, u)))
    figure(f"force of stress, {cell}, degree {degree}, {kinematics}", error / scale, ROUND_OFF)
    for owned in (K, x, Ku):
        owned.destroy()


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(("cell", "kinematics"), KINDS)
def test_virtual_work_of_a_uniform_stress(cell, kinematics, degree):
    """f·v = V σ:ε for v linear in the places, on cells of any shape."""
    domain = box(cell, degree, kinematics)
    internal = InternalForce(domain)
    volume = np.prod([2.0, 1.5, 1.0][: domain.gdim])
    assert WORLD.allreduce(internal.volume.sum()) == pytest.approx(volume, rel=1e-13)
    rng = np.random.default_rng(1)
    H = rng.normal(size=(domain.num_components, domain.gdim))
    v = motion(domain, lambda x: x @ H.T + 3.0)
    num_strains = {1: 2, 2: 3, 3: 6}[domain.num_components]
    sigma = rng.normal(size=num_strains)
    force = summed(domain, internal(np.tile(sigma, (len(internal.sites), 1))))
    work = WORLD.allreduce(float(force @ own(domain, v.x.array)))
    strain = {
        1: lambda: H[0],
        2: lambda: [H[0, 0], H[1, 1], H[0, 1] + H[1, 0]],
        3: lambda: [*H.diagonal(), H[1, 2] + H[2, 1], H[0, 2] + H[2, 0], H[0, 1] + H[1, 0]],
    }[domain.num_components]()
    assert work == pytest.approx(volume * np.dot(sigma, strain), rel=1e-12)
    # It has no resultant.
    total = WORLD.allreduce(force.reshape(-1, domain.num_components).sum(axis=0))
    assert np.abs(total).max() < 1e-12 * largest(force)


@pytest.mark.parametrize("num_strains", [2, 3, 6])
def test_isotropic_stress_as_a_tensor(num_strains):
    rng = np.random.default_rng(num_strains)
    strain = rng.normal(size=(7, num_strains))
    lame, shear = rng.uniform(1, 2, 7), rng.uniform(1, 2, 7)
    pairs = {
        2: [(0, 2), (1, 2)],
        3: [(0, 0), (1, 1), (0, 1)],
        6: [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)],
    }[num_strains]
    tensor = np.zeros((7, 3, 3))
    for column, (i, j) in enumerate(pairs):
        half = 1.0 if i == j else 0.5  # γ = 2ε
        tensor[:, i, j] = tensor[:, j, i] = half * strain[:, column]
    trace = np.trace(tensor, axis1=1, axis2=2)
    stress = lame[:, None, None] * trace[:, None, None] * np.eye(3)
    stress += 2 * shear[:, None, None] * tensor
    expected = np.stack([stress[:, i, j] for i, j in pairs], axis=1)
    given = strain.copy()
    np.testing.assert_allclose(isotropic_stress(given, lame, shear), expected, rtol=1e-14)
    np.testing.assert_array_equal(given, strain)
