# SPDX-License-Identifier: MIT
"""Static stress against the weight above, and in balance whatever the points have gone through."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from support.meshes import SOIL, scene

from fenics_hytf.domain import build
from fenics_hytf.lapse import (
    BalanceError,
    FillingSurvey,
    Statics,
    cell_stress,
    seed_points,
    survey,
)
from fenics_hytf.lapse.statics import static_supports
from fenics_hytf.particles import move
from fenics_hytf.simulation.check import checked_domain

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
G0 = 9.80665
BALANCED = 1e-8
ROLLERS = ("left", "right", "front", "back")
LAYERS = {
    "clay": SOIL | {"density": 2000.0, "k0": 0.8, "shear_wave_velocity": 300.0},
    "sand": SOIL | {"density": 1700.0, "k0": 0.45},
}
SLOPE = [
    {"soil": "clay", "polygon": [[0, 0], [24, 0], [24, 4], [16, 4], [8, 12], [0, 12]]},
    {"soil": "air"},
]


def settled(case, comm=WORLD, moved=None):
    """Points of a scene at rest; they have moved before that if ``moved`` says so."""
    domain = build(case, comm)
    points = seed_points(case, domain)
    statics = Statics(case, domain)
    filling = None
    if moved is not None:
        move(domain.mesh, points, moved(points))
    if case.mesh.empty:
        filling = FillingSurvey(case, domain)(points)
        statics.occupy(filling)
    ground = survey(case, domain, points, filling)
    statics.settle(points, ground)
    return SimpleNamespace(
        domain=domain, points=points, statics=statics, ground=ground, filling=filling
    )


def imbalance(found) -> float:
    """What is out of balance, of the weight."""
    unknowns = found.statics.unknowns
    left = unknowns.collect(found.statics.imbalance(found.points))
    return left.norm() / unknowns.collect(found.statics.weight_of(found.points)).norm()


def slope(initial="elastic", boundary=None, soil=None, **mesh):
    grid = {"box": {"size": [24.0, 16.0], "cells": [24, 16]}, "regions": SLOPE, "empty": ["air"]}
    return scene(
        grid | mesh,
        soil={"clay": soil or SOIL},
        boundary=boundary or {"left": "roller", "right": "roller"},
        effects={"gravity": {"initial_stress": initial}, "convection": True},
    )


def layers(gdim: int, degree: int, initial: str | None, soil=None):
    """Sand, 3 m, on clay, 4 m, in cells of half a metre."""
    size, cells = [2.0] * (gdim - 1) + [7.0], [2] * (gdim - 1) + [14]
    gravity = {} if initial is None else {"initial_stress": initial}
    return scene(
        {
            "box": {
                "size": size,
                "cells": cells,
                "cell": "quadrilateral" if gdim == 2 else "hexahedron",
            },
            "regions": [{"soil": "clay", "below": 4.0}, {"soil": "sand"}],
            "degree": degree,
        },
        soil=soil or LAYERS,
        boundary=dict.fromkeys(ROLLERS[: 2 * (gdim - 1)], "roller"),
        effects={"gravity": gravity},
    )


def weight_above(height: np.ndarray) -> np.ndarray:
    """Vertical stress of the layers, tension positive [Pa]."""
    sand = np.minimum(7.0 - height, 3.0)
    return -G0 * (1700.0 * sand + 2000.0 * np.maximum(4.0 - height, 0.0))


# ---------------------------------------------------------------- level ground


@pytest.mark.mpi
@pytest.mark.parametrize("initial", ["k0", None])
@pytest.mark.parametrize(("gdim", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_level_layers_at_rest(gdim, degree, initial, figure):
    """σ_v is the weight above, σ_h = K0 σ_v; level ground takes K0 unasked."""
    found = settled(layers(gdim, degree, initial))
    points, domain = found.points, found.domain
    up = gdim - 1
    if degree == 2:  # linear in each cell, and exact wherever points are
        stress, height, region = points["stress"], points.x[:, up], points.region
    else:  # constant in each cell
        owned = slice(domain.num_owned_cells)
        tensors = cell_stress(domain, points)[owned]
        stress = np.column_stack([tensors[:, i, i] for i in range(gdim)])
        stress = np.column_stack([stress, tensors[:, 0, up]])
        height = domain.centroids()[domain.input_cells[owned], up]
        region = domain.regions[owned]
    k0 = np.array([LAYERS[name]["k0"] for name in domain.region_names])[region]
    scale = -weight_above(0.0)
    vertical = np.abs(stress[:, up] - weight_above(height)).max(initial=0.0)
    sideways = np.abs(stress[:, :up] - (k0 * weight_above(height))[:, None]).max(initial=0.0)
    shear = np.abs(stress[:, gdim:]).max(initial=0.0)
    worst = WORLD.allreduce(max(vertical, sideways, shear) / scale, MPI.MAX)
    case = f"{gdim}D, degree {degree}, {initial or 'unasked'}, {WORLD.size} ranks"
    figure(f"stress at rest, {case}", worst, 1e-10)
    figure(f"imbalance at rest, {case}", imbalance(found), BALANCED)


def test_without_k0_the_ground_rests_as_if_elastic():
    """ν/(1 − ν), what elastic ground that cannot move sideways has of its own."""
    soil = {name: SOIL for name in LAYERS}
    at_rest, elastic = (
        settled(layers(2, 1, how, soil), SELF).points["stress"] for how in ("k0", "elastic")
    )
    scale = np.abs(elastic).max()
    np.testing.assert_allclose(at_rest, elastic, atol=1e-12 * scale)
    np.testing.assert_allclose(elastic[:, 0], 0.3 / 0.7 * elastic[:, 1], atol=1e-12 * scale)


def test_elastic_stress_is_not_replaced():
    stress = settled(layers(2, 1, "elastic"), SELF).points["stress"]
    nu = SOIL["poisson"]
    np.testing.assert_allclose(stress[:, 0] / stress[:, 1], nu / (1 - nu), rtol=1e-10)


# ---------------------------------------------------------------- slopes


@pytest.mark.mpi
@pytest.mark.parametrize("initial", ["elastic", "k0", None])
@pytest.mark.parametrize(("degree", "count"), [(1, 4), (1, 9), (2, 9), (2, 16)])
def test_a_slope_is_in_balance(degree, count, initial, figure):
    initial_stress = {} if initial is None else {"initial": initial}
    found = settled(slope(**initial_stress, degree=degree, points_per_cell=count))
    name = f"{initial or 'unasked'}, degree {degree}, {count} points a cell, {WORLD.size} ranks"
    figure(f"imbalance of a slope, {name}", imbalance(found), BALANCED)
    shear = WORLD.allreduce(np.abs(found.points["stress"][:, 2]).max(initial=0.0), MPI.MAX)
    assert shear > 1e4  # it is one: a tenth of the weight of 6 m


def drift(points) -> np.ndarray:
    """The upper ground slides down a little, more near its surface."""
    x = points.x
    inside = np.sin(np.pi * x[:, 0] / 24) * x[:, 1] / 12
    return np.column_stack([0.5 * inside, -0.4 * inside])


def squeeze(points) -> np.ndarray:
    """Everything settles by a twentieth of its height."""
    return np.column_stack([0 * points.x[:, 0], -0.05 * points.x[:, 1]])


def scatter(points) -> np.ndarray:
    """Every point by itself, up to a fifth of a cell; those at the walls and the base stay."""
    rng = [np.random.default_rng(int(i)).uniform(-0.2, 0.2, 2) for i in points.id]
    x = points.x
    inside = (x[:, 1] > 1) & (x[:, 0] > 1) & (x[:, 0] < 23)
    return np.array(rng).reshape(-1, 2) * inside[:, None]


@pytest.mark.mpi
@pytest.mark.parametrize("count", [4, 9])
@pytest.mark.parametrize("moved", [drift, squeeze, scatter])
def test_a_slope_whose_points_have_moved_is_in_balance(moved, count, figure):
    found = settled(slope(points_per_cell=count), moved=moved)
    name = f"{moved.__name__}, {count} points a cell, {WORLD.size} ranks"
    figure(f"imbalance of a slope after {name}", imbalance(found), BALANCED)


@pytest.mark.mpi
def test_stress_is_the_same_on_any_ranks():
    """To the precision of a solution by factors: 1e-10 of the largest."""
    stress = []
    for comm in (WORLD, SELF):
        found = settled(slope("k0"), comm, drift)
        parts = comm.allgather((found.points.id, found.points["stress"]))
        ids, values = (np.concatenate(part) for part in zip(*parts, strict=True))
        stress.append(values[np.argsort(ids)])
    np.testing.assert_allclose(stress[0], stress[1], atol=1e-10 * np.abs(stress[1]).max())


@pytest.mark.mpi
def test_spreading_as_far_as_can_be():
    """A limit of infinity asks for no balance in the end, not for none at all."""
    found = settled(slope())
    stress = found.points["stress"]
    stress *= 0.9
    assert imbalance(found) == pytest.approx(0.1, rel=1e-6)
    found.statics.spread(found.points, found.ground, limit=np.inf)
    assert imbalance(found) <= BALANCED


def test_what_does_not_come_into_balance_is_an_error():
    found = settled(slope(), SELF)
    found.points["stress"] = 0.9 * found.points["stress"]
    with pytest.raises(BalanceError, match=r"of the weight out of balance") as caught:
        found.statics.spread(found.points, found.ground, limit=1e-20)
    assert 1e-20 < caught.value.left < BALANCED


def test_a_point_alone_in_a_cell(figure):
    """Three stresses bear its weight at two nodes; what they leave free, the ghost term holds."""

    def lift(points) -> np.ndarray:
        place = np.array([4.2113, 11.7887])  # of a cell below the crest
        one = np.linalg.norm(points.x - place, axis=1) < 0.1
        assert one.sum() == 1
        return one[:, None] * np.array([0.1, 0.6])

    found = settled(slope(), SELF, lift)
    loose = np.flatnonzero(found.filling.loose)
    assert len(loose) == 1 and found.filling.share[loose[0]] == pytest.approx(0.25)
    figure("imbalance with a point alone in a cell", imbalance(found), BALANCED)
    # V σ ∇N_a = N_a m g at both nodes on top: σ_yy = −ρ g Y, and no other.
    alone = found.points.x[:, 1] > 12
    expected = [[0.0, -SOIL["density"] * G0 * (found.points.x[alone, 1].item() - 12), 0.0]]
    np.testing.assert_allclose(found.points["stress"][alone], expected, atol=1e-4)


# ---------------------------------------------------------------- what holds it


def test_supports_in_the_long_run():
    kinds = {
        "base": "compliant",
        "left": "dashpot",
        "right": "free_field",
        "front": "tied",
        "back": "roller",
        "top": "free",
    }
    assert static_supports(kinds) == {
        "base": "fixed",
        "left": "roller",
        "right": "roller",
        "front": "tied",
        "back": "roller",
        "top": "free",
    }


@pytest.mark.mpi
def test_what_supports_bear_is_no_imbalance():
    """The base bears the weight and walls push back; where ground may move nothing is left."""
    rock = {"density": 2243.0, "shear_wave_velocity": 760.0, "poisson": 0.25}
    grid = {"box": {"size": [24.0, 16.0], "cells": [12, 8]}, "regions": SLOPE, "empty": ["air"]}
    case = scene(
        grid,
        soil={"clay": SOIL},
        boundary={"left": "free_field", "right": "dashpot", "base": {"compliant": rock}},
        effects={"gravity": True},
        motion=[
            {
                "direction": "x",
                "input": "outcrop",
                "harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 16},
            }
        ],
    )
    checked_domain(case, WORLD)  # a scene that can be run
    found = settled(case)
    assert imbalance(found) <= BALANCED
    left = found.statics.imbalance(found.points).reshape(-1, 2)
    x = found.domain.V.tabulate_dof_coordinates()
    held = x[:, 1] < 1e-9
    assert not left[held].any()
    assert not left[(x[:, 0] < 1e-9) | (x[:, 0] > 24 - 1e-9), 0].any()
