# SPDX-License-Identifier: MIT
"""B̄ against a closed form, its reduced-integration twin, and what any stiffness has to satisfy."""

import numpy as np
import pytest
import ufl
from dolfinx import la
from dolfinx.fem import Constant, Function, form
from dolfinx.fem.petsc import assemble_matrix
from mpi4py import MPI
from petsc4py import PETSc
from support.meshes import scene

from fenics_hytf.domain import Domain, build
from fenics_hytf.operators import (
    Dilation,
    ElasticForm,
    InternalForce,
    isotropic_stress,
    strain_rows,
)
from fenics_hytf.particles import cell_centres, gradient_matrices, seed

WORLD = MPI.COMM_WORLD
G, NU = 20e6, 0.4999
LAMBDA = 2 * G * NU / (1 - 2 * NU)
BLOCKY = ["quadrilateral", "hexahedron"]
DEGREES = [1, 2]
# Sums of some hundred products; λ is 5000 times G, and what is compared is of the size of λ.
ROUND_OFF = 1e-12


def box(cell: str, degree: int = 1, cells=(3, 3, 3), comm=WORLD, shift=0.0, **mesh) -> Domain:
    """A box of 2 m x 1.5 m (x 1.2 m); every node but those of its faces is moved."""
    gdim = 2 if cell in ("triangle", "quadrilateral") else 3
    size = [2.0, 1.5, 1.2][:gdim]
    grid = {"box": {"size": size, "cells": list(cells[:gdim]), "cell": cell}}
    domain = build(scene({**grid, "degree": degree, **mesh}, ("clay",), **motion(mesh)), comm)
    x = domain.mesh.geometry.x
    bump = np.prod(np.sin(np.pi * x[:, :gdim] / size), axis=1)
    for axis, wave in enumerate((2.0, 3.0, 5.0)[:gdim]):
        x[:, axis] += shift * bump * np.cos(wave * x.sum(axis=1))
    return domain


def motion(mesh: dict) -> dict:
    direction = "z" if mesh.get("kinematics") == "antiplane" else "x"
    harmonic = {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 16}
    return {"motion": [{"direction": direction, "harmonic": harmonic}]}


def one_cell(cell: str, degree: int = 1, distortion: float = 0.2) -> Domain:
    """A single cell of about a metre with every corner moved, the faces of a hexahedron warped."""
    domain = box(cell, degree, (1, 1, 1), MPI.COMM_SELF)
    x = domain.mesh.geometry.x[:, : domain.gdim]
    x += distortion * np.random.default_rng(7).uniform(-1, 1, x.shape)
    return domain


def stiffness(domain: Domain, lame=LAMBDA, shear=G, locking=True) -> PETSc.Mat:
    elastic = ElasticForm(domain, locking)
    K, count = elastic.create_matrix(), len(domain.regions)
    elastic.assemble(K, np.full(count, lame), np.full(count, shear))
    return K


def dense(K: PETSc.Mat) -> np.ndarray:
    size = K.getSize()[0]
    return K.getValues(range(size), range(size)).real


def nodal(domain: Domain, field) -> Function:
    u = Function(domain.V)
    u.x.array[:] = field(domain.V.tabulate_dof_coordinates()[:, : domain.gdim]).ravel()
    return u


def wavy(domain: Domain) -> Function:
    waves = np.arange(1, domain.num_components + 1)
    return nodal(domain, lambda x: np.sin(3 * x[:, :1] * waves + 2 * x[:, 1:2]) + x[:, :1])


def own(domain: Domain, values: np.ndarray) -> np.ndarray:
    return values[: domain.V.dofmap.index_map.size_local * domain.num_components].real


def summed(domain: Domain, values: np.ndarray) -> np.ndarray:
    """What all ranks' cells do to this rank's own nodes."""
    force = Function(domain.V)
    force.x.array[:] = values
    force.x.scatter_reverse(la.InsertMode.add)
    return own(domain, force.x.array)


def product(domain: Domain, K: PETSc.Mat, u: Function) -> np.ndarray:
    x, Ku = K.createVecs()
    x.array[:] = own(domain, u.x.array)
    K.mult(x, Ku)
    values = Ku.array_r.real.copy()
    x.destroy()
    Ku.destroy()
    return values


def largest(values: np.ndarray) -> float:
    return WORLD.allreduce(float(np.abs(values).max(initial=0.0)), MPI.MAX)


def per_gauss_point(domain: Domain, internal: InternalForce) -> tuple[np.ndarray, np.ndarray]:
    count = len(internal.sites)
    return np.full(count, LAMBDA), np.full(count, G)


# ---------------------------------------------------------------- what it is


def test_a_distorted_quadrilateral_in_closed_form(figure):
    """Its mean gradients are half the diagonals' components (Belytschko et al. 1984)."""
    domain = one_cell("quadrilateral")
    K = stiffness(domain)
    # Corners in the order of dolfinx: (0, 0), (1, 0), (0, 1), (1, 1).
    X = domain.mesh.geometry.x[domain.mesh.geometry.dofmap[0], :2]
    d1, d2 = X[3] - X[0], X[2] - X[1]
    area = (d1[0] * d2[1] - d1[1] * d2[0]) / 2
    mean = np.array([[-d2[1], d2[0]], [d1[1], -d1[0]], [-d1[1], d1[0]], [d2[1], -d2[0]]]).ravel()
    mean /= 2 * area
    expected = np.zeros((8, 8))
    deviatoric = np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    g = 1 / np.sqrt(3)
    for a, b in [(-g, -g), (g, -g), (-g, g), (g, g)]:
        s, t = (1 + a) / 2, (1 + b) / 2
        dN = np.array([[t - 1, s - 1], [1 - t, -s], [-t, 1 - s], [t, s]])
        J = X.T @ dN
        grad = dN @ np.linalg.inv(J)
        B = np.zeros((3, 8))
        B[0, ::2], B[1, 1::2] = grad.T
        B[2, ::2], B[2, 1::2] = grad[:, 1], grad[:, 0]
        expected += 0.25 * np.linalg.det(J) * G * B.T @ deviatoric @ B
    expected += (LAMBDA + G) * area * np.outer(mean, mean)
    order = domain.V.dofmap.list[0][:, None] * 2 + np.arange(2)
    found = dense(K)[np.ix_(order.ravel(), order.ravel())]
    figure("B-bar, distorted quadrilateral", abs(found - expected).max() / LAMBDA, ROUND_OFF)
    K.destroy()


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("cell", "degree", "shift"),
    # One point integrates any quadrilateral's volumetric part; the others are parallelograms.
    [("quadrilateral", 1, 0.15)] + [(cell, degree, 0.0) for cell in BLOCKY for degree in DEGREES],
)
def test_it_is_reduced_integration_of_the_volumetric_part(cell, degree, shift, figure):
    domain = box(cell, degree, shift=shift)
    u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
    shear = ufl.grad(u) + ufl.grad(u).T - 2 / domain.gdim * ufl.div(u) * ufl.Identity(domain.gdim)
    full, reduced = (
        ufl.dx(domain.mesh, metadata={"quadrature_degree": d}) for d in (2 * degree, 2 * degree - 2)
    )
    kappa = Constant(domain.mesh, PETSc.ScalarType(LAMBDA + 2 / domain.gdim * G))
    modulus = Constant(domain.mesh, PETSc.ScalarType(G))
    K = stiffness(domain)
    left, scale = K.copy(), K.norm()
    # One form with both rules is wrong in FFCx 0.9 where one has a single point and cells are not
    # parallelograms: it takes that point's Jacobian for both.
    for part in (
        modulus * ufl.inner(shear, ufl.grad(v)) * full,
        kappa * ufl.inner(ufl.div(u), ufl.div(v)) * reduced,
    ):
        twin = assemble_matrix(form(part))
        twin.assemble()
        left.axpy(-1.0, twin, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        twin.destroy()
    name = f"B-bar, {cell}, degree {degree}, shifted by {shift:g}: twin"
    figure(name, left.norm() / scale, ROUND_OFF)
    left.destroy()
    K.destroy()


@pytest.mark.parametrize(
    ("cell", "mesh"),
    [("triangle", {}), ("tetrahedron", {}), ("quadrilateral", {"kinematics": "antiplane"})],
)
def test_where_there_is_nothing_to_cure_nothing_changes(cell, mesh):
    """In straight triangles of degree 2 strain is linear; across a section there is no trace."""
    domain = box(cell, 2, (2, 2, 2), MPI.COMM_SELF, 0.1, **mesh)
    K, plain = stiffness(domain), stiffness(domain, locking=False)
    np.testing.assert_allclose(dense(K), dense(plain), atol=ROUND_OFF * plain.norm())
    K.destroy()
    plain.destroy()


@pytest.mark.parametrize("cell", BLOCKY)
def test_the_mean_of_a_cell_is_what_its_points_take(cell):
    """At degree 1 θ̄ is the mean of the trace, at every place of the cell."""
    domain = box(cell, comm=MPI.COMM_SELF, shift=0.15)
    u, cells = wavy(domain).x.array.real, domain.num_owned_cells
    internal, plain = InternalForce(domain, locking=True), InternalForce(domain)
    strain = plain.strain(u.reshape(-1, domain.gdim))
    trace = plain.volume * strain[:, : domain.gdim].sum(axis=1)
    cell_of = plain.sites.cell
    mean = np.bincount(cell_of, trace) / np.bincount(cell_of, plain.volume)
    rng = np.random.default_rng(3)
    points = seed(domain.mesh, np.zeros(cells, np.int32), [1800.0], 2**domain.gdim)
    points.X[:] = rng.uniform(0, 1, points.X.shape)
    found = (internal.strain_rows(points) @ u).reshape(len(points), -1)
    np.testing.assert_allclose(found[:, : domain.gdim].sum(axis=1), mean[points.cell], atol=1e-12)
    # and the deviator is that of the points
    B = strain_rows(gradient_matrices(points, domain.V), domain.gdim)
    there = (B @ u).reshape(len(points), -1)
    np.testing.assert_allclose(deviator(found, domain), deviator(there, domain), atol=1e-12)
    if cell == "quadrilateral":  # whose mean is the trace in the middle
        centres = cell_centres(domain.mesh, 0, cells)
        B = strain_rows(gradient_matrices(centres, domain.V), domain.gdim)
        middle = (B @ u).reshape(cells, -1)
        np.testing.assert_allclose(middle[:, :2].sum(axis=1), mean, atol=1e-12)


def deviator(strain: np.ndarray, domain: Domain) -> np.ndarray:
    strain = strain.copy()
    normal = strain[:, : domain.gdim]
    normal -= normal.mean(axis=1, keepdims=True)
    return strain


# ---------------------------------------------------------------- what any stiffness satisfies


@pytest.mark.mpi
@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("cell", BLOCKY)
def test_force_of_the_stress_is_that_of_the_stiffness(cell, degree, figure):
    domain = box(cell, degree, shift=0.15)
    internal, u = InternalForce(domain, locking=True), wavy(domain)
    strain = internal.strain(u.x.array.real.reshape(-1, domain.gdim))
    stress = isotropic_stress(strain, *per_gauss_point(domain, internal))
    K = stiffness(domain)
    expected = product(domain, K, u)
    off = largest(summed(domain, internal(stress)) - expected) / largest(expected)
    figure(f"B-bar, {cell}, degree {degree}: force of stress", off, ROUND_OFF)
    # Twice the energy by quadrature is u·Ku, so that energy is accounted for.
    energy = WORLD.allreduce(float(internal.volume @ np.sum(strain * stress, axis=1)))
    work = WORLD.allreduce(float(expected @ own(domain, u.x.array)))
    assert energy == pytest.approx(work, rel=ROUND_OFF)
    K.destroy()


@pytest.mark.mpi
@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("cell", BLOCKY)
def test_patch_of_distorted_cells(cell, degree, figure):
    """Linear displacement has one strain, and forces on the boundary only."""
    domain = box(cell, degree, shift=0.2)
    gdim = domain.gdim
    gradient = np.random.default_rng(2).normal(size=(gdim, gdim))
    u = nodal(domain, lambda x: x @ gradient.T + 1.0)
    K = stiffness(domain)
    force = product(domain, K, u).reshape(-1, gdim)
    size = np.array([2.0, 1.5, 1.2][:gdim])
    x = domain.V.tabulate_dof_coordinates()[: len(force), :gdim]
    inside = np.all((x > 1e-9) & (x < size - 1e-9), axis=1)
    assert WORLD.allreduce(int(inside.sum())) >= 2**gdim
    off = largest(force[inside]) / largest(force)
    figure(f"B-bar, {cell}, degree {degree}: patch, force inside", off, ROUND_OFF)
    internal = InternalForce(domain, locking=True)
    pairs = [(i, i) for i in range(gdim)] + ([(1, 2), (0, 2)] if gdim == 3 else []) + [(0, 1)]
    strain = [gradient[i, j] + (gradient[j, i] if i != j else 0.0) for i, j in pairs]
    found = internal.strain(u.x.array.real.reshape(-1, gdim))
    assert largest(found - strain) < ROUND_OFF * 10
    K.destroy()


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("cell", BLOCKY)
@pytest.mark.parametrize("distortion", [0.0, 0.2])
def test_an_element_has_no_energy_in_rigid_motions_alone(cell, degree, distortion, figure):
    """No hourglass: 3 zero eigenvalues in a section, 6 in space, and a gap above them."""
    domain = one_cell(cell, degree, distortion)
    gdim = domain.gdim
    K = stiffness(domain)
    values = np.linalg.eigvalsh(dense(K))
    rigid = {2: 3, 3: 6}[gdim]
    name = f"B-bar, {cell}, degree {degree}, distorted by {distortion:g}"
    # Round-off of the largest one, λ; the smallest that is not nought is a part of G.
    assert np.abs(values[:rigid]).max() < 1e-12 * values[-1]
    figure(f"{name}: softest mode over G", values[rigid] / G, 0.01, at_least=True)
    skew = np.triu(np.ones((gdim, gdim)), 1)
    turn = nodal(domain, lambda x: x @ (skew - skew.T) + 1.0)
    assert largest(product(domain, K, turn)) < ROUND_OFF * values[-1]
    K.destroy()


@pytest.mark.mpi
def test_one_rank_sees_the_stiffness_that_several_see():
    """Cells on the edge of a rank add to nodes of another."""
    domain, alone = (box("hexahedron", comm=comm, shift=0.15) for comm in (WORLD, MPI.COMM_SELF))
    K, whole = stiffness(domain), stiffness(alone)
    assert K.norm() == pytest.approx(whole.norm(), rel=1e-13)
    works = [
        float(product(d, matrix, wavy(d)) @ own(d, wavy(d).x.array))
        for d, matrix in ((domain, K), (alone, whole))
    ]
    assert WORLD.allreduce(works[0]) == pytest.approx(works[1], rel=1e-12)
    K.destroy()
    whole.destroy()


def test_the_projection_is_one():
    """Π Π = Π, and Π of a polynomial that it projects on is that polynomial."""
    domain = one_cell("hexahedron", 2)
    internal, dilation = InternalForce(domain), Dilation(domain)
    u = wavy(domain).x.array.real
    trace = dilation.trace_rows(internal.sites) @ u
    L = internal.sites.X
    basis = np.stack(
        [
            (a if i else 1 - a) * (b if j else 1 - b) * (c if k else 1 - c)
            for a, b, c in [L.T]
            for i in (0, 1)
            for j in (0, 1)
            for k in (0, 1)
        ],
        1,
    )
    coefficients, *_ = np.linalg.lstsq(basis, trace, rcond=None)
    assert np.abs(basis @ coefficients - trace).max() < 1e-12
    full = internal.strain(u.reshape(-1, 3))[:, :3].sum(axis=1)
    # What is taken away is orthogonal to every trilinear function, in the measure of the cell.
    assert np.abs((internal.volume * (full - trace)) @ basis).max() < 1e-12
