# SPDX-License-Identifier: MIT
"""Compliant bases: closed form, within and outcrop motions, what a mean acceleration does."""

from collections import Counter

import numpy as np
import pytest
from mpi4py import MPI
from scipy.special import expit
from support.reference import comb, two_layer_transfer

from fenics_hytf.domain import build
from fenics_hytf.lapse import Equations, seed_points
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate
from fenics_hytf.soil import complex_factor

pytestmark = pytest.mark.mpi

SOIL = {
    "soft": {"density": 1800.0, "shear_wave_velocity": 180.0, "poisson": 0.3, "damping": 0.05},
    "firm": {"density": 1950.0, "shear_wave_velocity": 320.0, "poisson": 0.3, "damping": 0.03},
}
ROCK = {"density": 2300.0, "shear_wave_velocity": 800.0, "poisson": 0.25, "damping": 0.02}
LAYERS = (8.0, 14.0)  # thickness, from the top [m]
DT, SAMPLES = 0.02, 500
CURVES = {"model": "darendeli", "plasticity_index": 15, "mean_stress": 80e3}


def column(motion: list, **sections) -> Scene:
    layers = [
        {"thickness": LAYERS[0], "soil": "soft", "cells": 8},
        {"thickness": LAYERS[1], "soil": "firm", "cells": 10},
    ]
    data = {
        "mesh": {"column": {"width": 2.0, "layers": layers}, "degree": 2},
        "soil": SOIL,
        "motion": motion,
        "boundary": {"left": "tied", "right": "tied", "base": {"compliant": ROCK}},
        "output": {"receivers": {"surface": [0.7, 22.0], "base": [0.3, 0.0]}},
        # to round-off; a record keeps half of its Nyquist line
        "solver": {"max_frequency": 24.0, "sweep": "direct"},
    }
    return Scene.from_dict(data | sections)


def wide(path, direction: str, kind: str = "outcrop", seed: int = 3) -> dict:
    """A smooth pulse with some noise, and a mean."""
    t = DT * np.arange(SAMPLES)
    noise = np.random.default_rng(seed).normal(size=SAMPLES)
    shape = expit(4 * (t - 1.5)) * expit(3 * (6.0 - t))
    np.savetxt(path, np.convolve(noise, np.hanning(9), "same") * shape + 0.02)
    return {"direction": direction, "file": str(path), "dt": DT, "units": "m/s2", "input": kind}


@pytest.mark.parametrize("convention", ["hysteretic", "kramer", "shake91", "dormieux"])
@pytest.mark.parametrize("direction", ["x", "y"])
def test_two_layers_on_rock(direction, convention, tmp_path, figure):
    lines = np.arange(1, 80)
    motion = comb(tmp_path / f"comb{MPI.COMM_WORLD.rank}.csv", lines, SAMPLES, DT)
    given = motion | {"direction": direction, "input": "outcrop"}
    scene = column([given], solver={"complex_modulus": convention})
    lapse = simulate(scene).lapses[0]
    axis = "xy".index(direction)
    omega = 2 * np.pi * lapse.frequency
    ratio = [
        np.sqrt((2 - 2 * s["poisson"]) / (1 - 2 * s["poisson"])) for s in (*SOIL.values(), ROCK)
    ]
    speed = [s["shear_wave_velocity"] for s in (*SOIL.values(), ROCK)]
    if direction == "y":
        speed = [v * r for v, r in zip(speed, ratio, strict=True)]
    damped = [complex_factor(s["damping"], convention) for s in (*SOIL.values(), ROCK)]
    density = [s["density"] for s in (*SOIL.values(), ROCK)]
    modulus = [d * v**2 * f for d, v, f in zip(density, speed, damped, strict=True)]
    over_within = two_layer_transfer(omega, LAYERS, tuple(density[:2]), tuple(modulus[:2]))
    outcrop = outcrop_over_within(omega, density, modulus)
    expected = over_within / outcrop
    found = lapse.transfer[0, axis, 0]
    name = f"two layers on rock, {direction}, {convention}: transfer function"
    figure(name, 100 * np.max(abs(found - expected) / abs(expected)), 0.2, "%")


def outcrop_over_within(omega, density, modulus) -> np.ndarray:
    """1 + τ/(iωρV* u) at the base, from the motion and traction of waves through both layers."""
    u, tau = np.ones(len(omega), complex), np.zeros(len(omega), complex)
    for thickness, rho, m in zip(LAYERS, density, modulus, strict=False):
        k, z = omega * np.sqrt(rho / m), np.sqrt(rho * m)
        c, s = np.cos(k * thickness), np.sin(k * thickness)
        # downwards from the top: tau is what the layer below pulls with
        u, tau = u * c - tau / (omega * z) * s, tau * c + u * omega * z * s
    return 1 - tau / (1j * omega * np.sqrt(density[2] * modulus[2]) * u)


def test_rock_that_keeps_its_bulk_modulus(tmp_path, figure):
    """P waves: M* = K + 4G*/3 in the soils and in the rock."""
    motion = comb(tmp_path / f"comb{MPI.COMM_WORLD.rank}.csv", np.arange(1, 80), SAMPLES, DT)
    rock = ROCK | {"damping": 0.1}
    scene = column(
        [motion | {"direction": "y", "input": "outcrop"}],
        boundary={"left": "tied", "right": "tied", "base": {"compliant": rock}},
        solver={"keep": "bulk"},
    )
    lapse = simulate(scene).lapses[0]
    density, modulus = [], []
    for s in (*SOIL.values(), rock):
        shear = s["density"] * s["shear_wave_velocity"] ** 2
        nu = s["poisson"]
        bulk = shear * 2 * (1 + nu) / (3 * (1 - 2 * nu))
        density.append(s["density"])
        modulus.append(bulk + 4 / 3 * shear * (1 + 2j * s["damping"]))
    omega = 2 * np.pi * lapse.frequency
    over_within = two_layer_transfer(omega, LAYERS, tuple(density[:2]), tuple(modulus[:2]))
    expected = over_within / outcrop_over_within(omega, density, modulus)
    error = np.max(abs(lapse.transfer[0, 1, 0] - expected) / abs(expected))
    figure("two layers on rock, y, bulk modulus kept: transfer function", 100 * error, 0.01, "%")
    assert scene.boundary.rock.damping == 0.1


@pytest.mark.parametrize("sides", ["free", "dashpot", "roller"])
def test_no_outcrop_motion_where_the_sides_take_a_part(sides, tmp_path):
    motion = wide(tmp_path / f"x{MPI.COMM_WORLD.rank}.csv", "x", "within")
    boundary = {"left": sides, "right": sides, "base": {"compliant": ROCK}}
    result = simulate(column([motion], boundary=boundary))
    assert result.outcrop_acceleration is None


@pytest.mark.parametrize("loop", [False, True])
def test_within_and_outcrop_lead_to_each_other(loop, tmp_path, figure):
    rank = MPI.COMM_WORLD.rank
    effects = {"equivalent_linear": {"tolerance": 1e-9}} if loop else {}
    soil = {name: s | ({"curves": CURVES} if loop else {}) for name, s in SOIL.items()}
    there = simulate(
        column(
            [wide(tmp_path / f"x{rank}.csv", "x"), wide(tmp_path / f"y{rank}.csv", "y", seed=5)],
            soil=soil,
            effects=effects,
        )
    )
    motions = []
    for direction, record in zip("xy", there.within_acceleration, strict=True):
        path = tmp_path / f"within_{direction}{rank}.csv"
        np.savetxt(path, record)
        motions.append({"direction": direction, "file": str(path), "dt": DT, "units": "m/s2"})
    back = simulate(column(motions, soil=soil, effects=effects))
    peak = abs(there.outcrop_acceleration).max()
    # The loop stops at 1e-9 of the moduli; the response differs by some times that.
    limit = 1e-7 if loop else 1e-10
    for name, difference in (
        ("outcrop", back.outcrop_acceleration - there.outcrop_acceleration),
        ("surface", back.history("total_acceleration") - there.history("total_acceleration")),
    ):
        figure(
            f"outcrop to within and back, loop {loop}: {name}", abs(difference).max() / peak, limit
        )
    relative = back.history("displacement") - there.history("displacement")
    figure(
        f"outcrop to within and back, loop {loop}: displacement",
        abs(relative).max() / abs(there.history("displacement")).max(),
        limit,
    )


def test_stiff_rock_is_a_rigid_base(tmp_path, figure):
    rank = MPI.COMM_WORLD.rank
    records = [wide(tmp_path / f"{d}{rank}.csv", d) for d in "xy"]
    rigid = simulate(column([m | {"input": "within"} for m in records]))
    errors = []
    for factor in (1e2, 1e4):
        stiff = ROCK | {"shear_wave_velocity": 800.0 * factor}
        sides = {"left": "tied", "right": "tied", "base": {"compliant": stiff}}
        result = simulate(column(records, boundary=sides))
        difference = result.history("total_acceleration") - rigid.history("total_acceleration")
        error = abs(difference).max() / abs(rigid.history("total_acceleration")).max()
        # The impedance ratio is what is left: 10 to 20 times it at the resonances.
        figure(f"rock {factor:g} times as fast, against a rigid base", error, 5.0 / factor)
        errors.append(error)
    assert errors[1] < errors[0] / 50


def test_a_mean_acceleration_strains_the_ground_as_it_would_at_rest(tmp_path):
    # Constant acceleration a of everything: τ(y) = ρ a (H − y) from the base up, no more.
    rank = MPI.COMM_WORLD.rank
    path = tmp_path / f"constant{rank}.csv"
    np.savetxt(path, np.full(64, 0.5))
    motion = {"direction": "x", "file": str(path), "dt": DT, "units": "m/s2", "input": "outcrop"}
    lapse = simulate(column([motion])).lapses[0]
    weight = [s["density"] for s in SOIL.values()]
    depth = 22.0 - lapse.cells.centroid[:, 1]
    over = weight[0] * np.minimum(depth, 8.0) + weight[1] * np.maximum(depth - 8.0, 0.0)
    np.testing.assert_allclose(lapse.cells.peak_stress, 0.5 * over, rtol=1e-6)
    np.testing.assert_allclose(lapse.total_acceleration[:, 0], 0.5, rtol=1e-12)
    np.testing.assert_allclose(lapse.velocity, 0.0, atol=1e-9)


def test_what_is_not_called_for_is_not_assembled(tmp_path):
    rank = MPI.COMM_WORLD.rank
    motion = wide(tmp_path / f"x{rank}.csv", "x")
    standing = simulate(column([motion])).work.assemblies
    held = simulate(column([motion | {"input": "within"}])).work.assemblies
    assert standing["dashpot"] == 1 and "dashpot" not in held
    scene = column([motion | {"input": "within"}])
    domain = build(scene, MPI.COMM_WORLD)
    equations = Equations(scene, domain, Counter())
    equations.weigh(seed_points(scene, domain))
    assert equations.base_is_held
    equations.destroy()
