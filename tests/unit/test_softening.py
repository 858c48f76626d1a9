# SPDX-License-Identifier: MIT
"""Static stress that falls with G, and what ground then gives way by, against elastic ground."""

import numpy as np
import pytest
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.fem.petsc import LinearProblem
from mpi4py import MPI
from support.meshes import SOIL, scene

from fenics_hytf.domain import build
from fenics_hytf.lapse import FillingSurvey, Moduli, Softening, Statics, seed_points, survey
from fenics_hytf.lapse.softening import fallen_stress
from fenics_hytf.particles import move

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
ROUND_OFF = 1e-10
G0 = 9.80665


def plane_strain(bulk: float, shear: float) -> np.ndarray:
    """D in plane strain, of stress and of strain as γ."""
    lame = bulk - 2 / 3 * shear
    return np.array([[lame + 2 * shear, lame, 0], [lame, lame + 2 * shear, 0], [0, 0, shear]])


def test_the_fall_keeps_elastic_strain_and_bulk_modulus():
    poisson, before, now = 0.35, 0.8, 0.3
    bulk = 2 * (1 + poisson) / (3 * (1 - 2 * poisson))
    strain = np.random.default_rng(3).normal(size=(5, 3))
    was, expected = (strain @ plane_strain(bulk, ratio) for ratio in (before, now))
    ones = np.ones(5)
    fallen = fallen_stress(was, before * ones, now * ones, poisson * ones)
    np.testing.assert_allclose(fallen, expected, rtol=1e-13)

    # The same ground in space, with the stress across the section that plane strain has.
    across = (bulk - 2 / 3 * before) * strain[:, :2].sum(axis=1)
    space = np.column_stack([was[:, :2], across, 0 * ones, 0 * ones, was[:, 2]])
    in_space = fallen_stress(space, before * ones, now * ones, poisson * ones)
    np.testing.assert_allclose(in_space[:, [0, 1, 5]], fallen, rtol=1e-13)
    mean = space[:, :3].mean(axis=1)
    np.testing.assert_allclose(in_space[:, :3].mean(axis=1), mean, rtol=1e-13)
    deviator = space.copy()
    deviator[:, :3] -= mean[:, None]
    fell = in_space.copy()
    fell[:, :3] -= mean[:, None]
    np.testing.assert_allclose(fell, now / before * deviator, rtol=1e-12, atol=1e-14)


def cliff(dim: int = 2, degree: int = 1, stress: str = "elastic", **effects):
    """Two soils in a block that is free on the right: its stress is not determined by balance."""
    size, cells = ([8.0, 6.0], [4, 3]) if dim == 2 else ([4.0, 2.0, 3.0], [3, 2, 2])
    return scene(
        {
            "box": {"size": size, "cells": cells},
            "regions": [{"soil": "clay", "below": 2.0}, {"soil": "sand"}],
            "degree": degree,
        },
        soil={
            "clay": SOIL | {"k0": 0.6},
            "sand": SOIL | {"shear_wave_velocity": 120.0, "poisson": 0.2, "k0": 0.5},
        },
        boundary={"left": "roller"},
        lapses={"count": 2},
        effects={"gravity": {"initial_stress": stress}, "degradation": True, "softening": True}
        | effects,
    )


def softened(case, ratios, comm=WORLD):
    """Ground whose secant moduli are so many parts of the small-strain ones, one after another."""
    domain = build(case, comm)
    points = seed_points(case, domain)
    statics = Statics(case, domain)
    ground = survey(case, domain, points)
    statics.settle(points, ground)
    softening, total = Softening(domain, statics), 0.0
    for ratio in ratios:
        moduli = Moduli(ratio * ground.shear_modulus, ground.damping)
        increment = softening(points, ground, moduli)
        total = total + (0.0 if increment is None else increment)
    left = statics.unknowns.collect(statics.imbalance(points))
    weight = statics.unknowns.collect(statics.weight_of(points))
    return domain, points, ground, total, left.norm() / weight.norm()


def fluctuating(case, steps=6):
    """Ratios of every cell that come and go, and the least of them."""
    size = np.prod(case.mesh.box.cells)
    ratios = np.random.default_rng(7).uniform(0.2, 1.0, (steps, size))
    return ratios, ratios.min(axis=0)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("dim", "degree", "stress"), [(2, 1, "elastic"), (2, 1, "k0"), (2, 2, "k0"), (3, 1, "k0")]
)
def test_only_the_least_modulus_counts(dim, degree, stress, figure):
    """However it came about, also where balance does not determine the stress."""
    case = cliff(dim, degree, stress)
    ratios, least = fluctuating(case)
    *_, points, _, u, left = softened(case, ratios)
    *_, at_once, _, expected, _ = softened(case, [least])
    name = f"softening in steps, {dim}D, degree {degree}, {stress}"
    figure(f"{name}: off balance", left, 1e-9)
    largest = WORLD.allreduce(np.abs(expected).max(), MPI.MAX)
    off = WORLD.allreduce(np.abs(u - expected).max(), MPI.MAX)
    figure(f"{name}: u against one step", off / largest, ROUND_OFF)
    for field in ("permanent_displacement", "stress", "softest"):
        scale = WORLD.allreduce(np.abs(at_once[field]).max(initial=0), MPI.MAX)
        np.testing.assert_allclose(points[field], at_once[field], atol=ROUND_OFF * scale)


@pytest.mark.mpi
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_elastic_ground_gives_way_by_the_difference_of_stiffnesses(dim, degree, figure):
    """K(G_min)⁻¹f_g − K(G₀)⁻¹f_g, of forms of dolfinx's own."""
    case = cliff(dim, degree)
    ratios, least = fluctuating(case)
    domain, _, ground, u, _ = softened(case, ratios)
    V, mesh = domain.V, domain.mesh

    def under_weight(ratio) -> np.ndarray:
        G = ratio * ground.shear_modulus
        nu = ground.poisson
        lame = 2 * ground.shear_modulus * (1 + nu) / (3 * (1 - 2 * nu)) - 2 / 3 * G
        Q = fem.functionspace(mesh, ("DG", 0))
        coefficients = []
        for values in (lame, G, G0 * ground.density):
            coefficients.append(fem.Function(Q))
            coefficients[-1].x.array[:] = values[domain.input_cells]
        lam, mu, weight = coefficients
        v, w = ufl.TrialFunction(V), ufl.TestFunction(V)
        strain = ufl.sym(ufl.grad(v))
        sigma = lam * ufl.tr(strain) * ufl.Identity(dim) + 2 * mu * strain
        dx = ufl.dx(metadata={"quadrature_degree": 2 * degree})
        a = ufl.inner(sigma, ufl.sym(ufl.grad(w))) * dx
        down = ufl.as_vector([0.0] * (dim - 1) + [-1.0])
        L = ufl.inner(weight * down, w) * dx
        tdim = mesh.topology.dim
        held = [
            fem.dirichletbc(
                np.zeros(dim, default_scalar_type),
                fem.locate_dofs_topological(V, tdim - 1, domain.boundaries["base"]),
                V,
            ),
            fem.dirichletbc(
                default_scalar_type(0.0),
                fem.locate_dofs_topological(V.sub(0), tdim - 1, domain.boundaries["left"]),
                V.sub(0),
            ),
        ]
        options = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}
        solution = LinearProblem(a, L, held, petsc_options=options).solve()
        return solution.x.array.real.reshape(-1, dim)

    expected = under_weight(least) - under_weight(np.ones_like(least))
    largest = WORLD.allreduce(np.abs(expected).max(), MPI.MAX)
    off = WORLD.allreduce(np.abs(u - expected).max(), MPI.MAX) / largest
    figure(f"softening in elastic ground, {dim}D, degree {degree}", off, ROUND_OFF)


def test_nothing_moves_without_a_new_minimum():
    case = cliff()
    ratios, least = fluctuating(case)
    domain, points, ground, _, _ = softened(case, ratios, SELF)
    stress = points["stress"].copy()
    softening = Softening(domain, None)  # asked for nothing
    assert softening(points, ground, Moduli(least * ground.shear_modulus, ground.damping)) is None
    assert np.array_equal(points["stress"], stress)


SLOPE = [
    {"soil": "clay", "polygon": [[0, 0], [24, 0], [24, 4], [16, 4], [8, 12], [0, 12]]},
    {"soil": "air"},
]


@pytest.mark.mpi
@pytest.mark.parametrize("count", [4, 9])
def test_points_that_have_moved_are_softened_where_they_are(count, figure):
    """Ground flows downslope and fills cells in part; its points bring their own least moduli.

    What the fall takes is borne again, and what was out of balance before it is so after it.
    """
    case = scene(
        {
            "box": {"size": [24.0, 16.0], "cells": [24, 16]},
            "regions": SLOPE,
            "empty": ["air"],
            "points_per_cell": count,
        },
        soil={"clay": SOIL},
        boundary={"left": "roller", "right": "roller"},
        lapses={"count": 2},
        effects={
            "gravity": {"initial_stress": "elastic"},
            "degradation": True,
            "softening": True,
            "convection": True,
        },
    )
    domain = build(case, WORLD)
    points = seed_points(case, domain)
    statics, look = Statics(case, domain), FillingSurvey(case, domain)

    def weighed():
        filling = look(points)
        statics.occupy(filling)
        return survey(case, domain, points, filling)

    def off() -> np.ndarray:
        left = statics.unknowns.collect(statics.imbalance(points))
        return left.array_r.real.copy()

    ground = weighed()
    statics.settle(points, ground)
    softening = Softening(domain, statics)
    ratio = np.linspace(0.9, 0.4, domain.num_cells)
    softening(points, ground, Moduli(ratio * ground.shear_modulus, ground.damping))
    assert points["softest"].min(initial=1.0) < 1.0
    carried = dict(zip(points.id.tolist(), points["softest"].tolist(), strict=True))

    move(domain.mesh, points, 0.4 * np.sin(points.x / 5) * points.x[:, 1:] / 12)
    everyone = {k: v for part in WORLD.allgather(carried) for k, v in part.items()}
    assert all(everyone[i] == r for i, r in zip(points.id, points["softest"], strict=True))
    ground, before = weighed(), off()
    softest = points["softest"].copy()
    ratio = np.where(np.arange(domain.num_cells) % 3, 1.0, 0.3)
    softening(points, ground, Moduli(ratio * ground.shear_modulus, ground.damping))
    fell = ratio[domain.input_cells[points.cell]] < softest
    np.testing.assert_array_equal(points["softest"], np.where(fell, 0.3, softest))
    weight = statics.unknowns.collect(statics.weight_of(points)).norm()
    change = np.sqrt(WORLD.allreduce(float(np.sum((off() - before) ** 2)))) / weight
    figure(f"softening of a moved slope, {count} points, {WORLD.size} ranks", change, 1e-8)
