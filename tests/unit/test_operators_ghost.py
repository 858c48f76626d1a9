# SPDX-License-Identifier: MIT
"""The ghost term against a sum over two cells written out in numpy, and what it may not feel."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from support.meshes import scene

from fenics_hytf.domain import Domain, build, facet_cells
from fenics_hytf.operators import STRENGTH, ElasticForm, GhostForm
from fenics_hytf.study.stability.ground import csr

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
CELLS = ["triangle", "quadrilateral", "tetrahedron", "hexahedron"]
EXACT = 1e-13  # sums of some ten products
E = 3e8

MOTION = {"harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 8}}


def box(cell: str, degree=1, cells=(3, 2, 2), comm=WORLD, antiplane=False, shift=0.1) -> Domain:
    """A box with some of its nodes moved; the faces of hexahedra stay plane."""
    gdim = 2 if cell in CELLS[:2] else 3
    size = [3.0, 2.0, 2.0][:gdim]
    mesh = {"box": {"size": size, "cells": list(cells[:gdim]), "cell": cell}, "degree": degree}
    if antiplane:
        mesh["kinematics"] = "antiplane"
    motion = [MOTION | {"direction": "z" if antiplane else "x"}]
    domain = build(scene(mesh, ("clay",), motion=motion), comm)
    x = domain.mesh.geometry.x
    x[:, 0] += shift * x[:, 0] * (3.0 - x[:, 0]) + shift * x[:, 1]
    if cell != "hexahedron":
        x[:, 1] += shift * np.sin(2 * x[:, 0]) * x[:, 1] * (2.0 - x[:, 1])
    return domain


def ghost(domain: Domain, modulus=None, **options) -> PETSc.Mat:
    """K_G on all inner facets."""
    form = GhostForm(domain, facet_cells(domain.mesh)[0], **options)
    K = form.create_matrix()
    form.assemble(K, np.full(len(domain.regions), E) if modulus is None else modulus)
    return K


def image(domain: Domain, K: PETSc.Mat, u) -> tuple[np.ndarray, float]:
    """K u at this rank's own nodes, and uᵀ K u over all ranks; u is a function of place."""
    x = domain.V.tabulate_dof_coordinates()[: domain.V.dofmap.index_map.size_local, : domain.gdim]
    values, force = K.createVecs()
    values.array[:] = np.asarray(u(x), complex).reshape(len(x), -1).ravel()
    K.mult(values, force)
    return force.array_r.real.copy(), values.tDot(force).real


def waves(size: int):
    """A field of some components that bends everywhere."""
    return lambda x: np.column_stack(
        [np.sin((k + 1.3) * x.sum(axis=1)) + np.cos(x[:, 0] - k * x[:, 1]) for k in range(size)]
    )


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_a_linear_displacement_feels_nothing(cell, degree, figure):
    domain = box(cell, degree)
    K = ghost(domain)
    gdim = domain.gdim
    slope = np.random.default_rng(1).normal(size=(gdim, gdim))
    force, _ = image(domain, K, lambda x: x @ slope + 0.3)
    bent, energy = image(domain, K, waves(gdim))
    scale = WORLD.allreduce(np.abs(bent).max(initial=0.0), MPI.MAX)
    felt = WORLD.allreduce(np.abs(force).max(initial=0.0), MPI.MAX) / scale
    figure(f"ghost of a linear field, {cell}, degree {degree}", felt, EXACT)
    assert energy > 0  # the wave does feel it


@pytest.mark.parametrize("cell", CELLS)
def test_a_parabola_feels_nothing_at_degree_two(cell):
    domain = box(cell, 2, comm=SELF, shift=0.0)
    K, gdim = ghost(domain), domain.gdim
    bend = np.random.default_rng(2).normal(size=(gdim, gdim, gdim))
    force, _ = image(domain, K, lambda x: np.einsum("ni,nj,ijk->nk", x, x, bend))
    bent, _ = image(domain, K, waves(gdim))
    assert np.abs(force).max() < EXACT * np.abs(bent).max()


@pytest.mark.parametrize("cell", CELLS)
def test_a_jump_of_curvature_is_held_at_degree_two(cell):
    """u = max(x − 1.5, 0)²/2 bends on one side of the middle: a_K Ē h³/20 times the area of it."""
    domain = box(cell, 2, (2, 1, 1), comm=SELF, shift=0.0)
    along = np.eye(domain.gdim)[0]
    energy = image(
        domain, ghost(domain), lambda x: np.outer(np.maximum(x[:, 0] - 1.5, 0) ** 2 / 2, along)
    )[1]
    depth = {"triangle": 0.75, "tetrahedron": 0.5}.get(cell, 1.5)  # volume over area of the facet
    area = 2.0 ** (domain.gdim - 1)
    strength = 2 * STRENGTH[domain.gdim]
    assert energy == pytest.approx(strength * E * depth**3 / 20 * area, rel=1e-12)


@pytest.mark.mpi
@pytest.mark.parametrize("antiplane", [False, True])
@pytest.mark.parametrize("cell", CELLS[:2])
def test_it_is_symmetric_and_never_negative(cell, antiplane):
    domain = box(cell, 2, antiplane=antiplane)
    K = ghost(domain)
    assert K.isTranspose(K, EXACT * K.norm(PETSc.NormType.INFINITY))
    rng = np.random.default_rng(WORLD.rank)
    for _ in range(5):
        _, energy = image(domain, K, lambda x: rng.normal(size=(len(x), domain.num_components)))
        assert energy > 0


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", CELLS)
def test_it_is_the_same_on_any_ranks(cell, degree):
    found = []
    for comm in (WORLD, SELF):
        domain = box(cell, degree, comm=comm)
        modulus = E * (1.0 + domain.input_cells % 3)
        found.append(image(domain, ghost(domain, modulus), waves(domain.gdim))[1])
    assert found[0] == pytest.approx(found[1], rel=1e-12)


def test_its_pattern_holds_that_of_the_cells():
    """Stiffness is assembled into it, and no entry is new."""
    domain = box("quadrilateral", comm=SELF)
    K = ghost(domain, 0 * domain.regions)
    K.setOption(PETSc.Mat.Option.NEW_NONZERO_LOCATION_ERR, True)
    cells = np.ones(len(domain.regions))
    ElasticForm(domain).assemble(K, cells, cells)
    assert K.norm() > 0


# ---------------------------------------------------------------- two cells in numpy

GAUSS, WEIGHT = np.polynomial.legendre.leggauss(3)
GAUSS, WEIGHT = (GAUSS + 1) / 2, WEIGHT / 2


def quad_gradients(corners: np.ndarray, place: np.ndarray) -> np.ndarray:
    """∂N/∂x of a parallelogram with corners in tensor order, shape ``(4, 2)``."""
    a, b = corners[1] - corners[0], corners[2] - corners[0]
    s, t = np.linalg.solve(np.column_stack([a, b]), place - corners[0])
    local = np.array([[t - 1, s - 1], [1 - t, -s], [-t, 1 - s], [t, s]])
    return local @ np.linalg.inv(np.column_stack([a, b]))


def triangle_gradients(corners: np.ndarray, place: np.ndarray) -> np.ndarray:
    """∂N/∂x of a triangle, shape ``(3, 2)``."""
    edges = np.column_stack([corners[1] - corners[0], corners[2] - corners[0]])
    return np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]) @ np.linalg.inv(edges)


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_two_cells_written_out(cell, components, figure):
    """a_K Ē h/3 ∫ [[∂N_a/∂n]] [[∂N_b/∂n]] over the one facet, from the corners alone."""
    count = (2, 1) if cell == "quadrilateral" else (1, 1)
    domain = box(cell, cells=count, comm=SELF, antiplane=components == 1, shift=0.0)
    x = domain.mesh.geometry.x
    x[:, 0] += 0.2 * x[:, 1] + 0.3 * np.where(x[:, 0] > 1.4, x[:, 0] - 1.5, 0.0)  # two sheared ones
    facets, _ = facet_cells(domain.mesh)
    assert len(facets) == 1
    modulus = np.array([1e8, 4e8])
    form = GhostForm(domain, facets, strength=0.07)
    K = form.create_matrix()
    form.assemble(K, modulus)
    found = csr(K).toarray().real

    nodes = domain.V.dofmap.list
    places = domain.V.tabulate_dof_coordinates()[:, :2]
    shared = np.intersect1d(nodes[0], nodes[1])
    ends = places[shared]
    length = np.linalg.norm(ends[1] - ends[0])
    normal = np.array([ends[1, 1] - ends[0, 1], ends[0, 0] - ends[1, 0]]) / length
    gradients = quad_gradients if cell == "quadrilateral" else triangle_gradients
    depths = []
    for corners in (places[nodes[0]], places[nodes[1]]):
        edges = corners[1] - corners[0], corners[2] - corners[0]
        area = abs(edges[0][0] * edges[1][1] - edges[0][1] * edges[1][0])
        depths.append((area if cell == "quadrilateral" else area / 2) / length)
    scalar = np.zeros((len(places), len(places)))
    for t, weight in zip(GAUSS, WEIGHT, strict=True):
        here = ends[0] + t * (ends[1] - ends[0])
        jump = np.zeros(len(places))
        for sign, side in ((1.0, nodes[0]), (-1.0, nodes[1])):
            jump[side] += sign * gradients(places[side], here) @ normal
        scalar += weight * length * np.outer(jump, jump)
    scalar *= 0.07 * modulus.mean() * np.mean(depths) / 3
    expected = np.kron(scalar, np.eye(components))
    error = np.abs(found - expected).max() / np.abs(expected).max()
    figure(f"ghost of two cells, {cell}, {components} components", error, EXACT)


def test_it_grows_with_strength_and_modulus():
    domain = box("quadrilateral", comm=SELF)
    usual = image(domain, ghost(domain), waves(2))[1]
    strong = image(domain, ghost(domain, strength=2 * STRENGTH[2]), waves(2))[1]
    stiff = image(domain, ghost(domain, 5 * E + 0 * domain.regions), waves(2))[1]
    K = ghost(domain)
    form = GhostForm(domain, facet_cells(domain.mesh)[0], strength=2 * STRENGTH[2])
    form.add(K, np.full(len(domain.regions), 0.5 * E))
    assert image(domain, K, waves(2))[1] == pytest.approx(2 * usual, rel=1e-12)
    assert strong == pytest.approx(2 * usual, rel=1e-12)
    assert stiff == pytest.approx(5 * usual, rel=1e-12)


def twist(x):
    """Displacement whose normal derivative jumps at x = 1.5 by ±1 at the corners of a facet."""
    kink = np.maximum(x[:, 0] - 1.5, 0) * (2 * x[:, 1:] - 1).prod(axis=1)
    return np.column_stack([kink, 0 * kink, 0 * kink])


def test_a_twist_of_two_hexahedra_weighs_as_much_as_an_even_jump():
    """On corners a_K Ē h/3 · ¼ Σ 1² of a facet of 1 m²; an exact integral makes a ninth of it."""
    mesh = {"box": {"size": [3.0, 1.0, 1.0], "cells": [2, 1, 1], "cell": "hexahedron"}}
    domain = build(scene(mesh, ("clay",), motion=[MOTION | {"direction": "x"}]), SELF)
    energy = image(domain, ghost(domain), twist)[1]
    assert energy == pytest.approx(STRENGTH[3] * E * 1.5 / 3, rel=1e-12)


def test_the_looser_of_both_cells_rules():
    domain = box("quadrilateral", cells=(2, 1), comm=SELF)
    whole = image(domain, ghost(domain), waves(2))[1]
    form = GhostForm(domain, facet_cells(domain.mesh)[0])
    K = form.create_matrix()
    for loose, expected in (((1.0, 0.3), 1.0), ((0.0, 0.4), 0.4), ((0.0, 0.0), 0.0)):
        form.loosen(np.array(loose))
        form.assemble(K, np.full(2, E))
        assert image(domain, K, waves(2))[1] == pytest.approx(expected * whole, rel=1e-12)


def test_it_acts_on_the_facets_given_and_no_others():
    domain = box("quadrilateral", cells=(3, 1), comm=SELF, shift=0.0)
    facets, cells = facet_cells(domain.mesh)
    middle = domain.mesh.geometry.x[domain.mesh.geometry.dofmap].mean(axis=1)[:, 0]
    left = facets[np.argmin(middle[cells].mean(axis=1))]
    form = GhostForm(domain, np.array([left], np.int32))
    K = form.create_matrix()
    form.assemble(K, np.full(len(domain.regions), E))
    force, energy = image(domain, K, lambda x: np.column_stack([np.maximum(x[:, 0] - 2.0, 0)] * 2))
    bent, there = image(domain, K, lambda x: np.column_stack([np.maximum(x[:, 0] - 1.0, 0)] * 2))
    assert there == pytest.approx(2 * STRENGTH[2] * E / 3 * 1.0 * 2.0, rel=1e-12)
    # The kink of the first is at the other facet.
    assert abs(energy) < EXACT * there and np.abs(force).max() < EXACT * np.abs(bent).max()
