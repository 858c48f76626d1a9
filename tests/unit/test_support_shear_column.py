# SPDX-License-Identifier: MIT
"""The column that the transient lapses are held against, held against closed forms itself."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp
from support import shear_column as column
from support.shear_column import (
    FADING,
    RELAXATION,
    ShearColumn,
    Stage,
    maxwell_factor,
    maxwell_weights,
    quiet_record,
    usual_column,
    usual_stages,
    window,
)

ROUND_OFF = 1e-9  # of what is integrated by exponentials, over some thousand steps

LAWS = {
    "elastic": ({"law": "elastic"}, 0.0),
    "viscous": ({"law": "viscous", "alpha": 0.1, "beta": 2e-3}, 0.0),
    "on rock": ({"law": "viscous", "beta": 2e-3, "impedance": 2200.0 * 760.0}, 0.0),
    "maxwell": ({"law": "maxwell"}, 0.05),
    "maxwell on rock": ({"law": "maxwell", "alpha": 0.1, "impedance": 2200.0 * 760.0}, 0.1),
}
law = pytest.mark.parametrize(("options", "damping"), LAWS.values(), ids=LAWS)


def error(found, expected) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


# ---------------------------------------------------------------- the law


@pytest.mark.parametrize(
    ("damping", "limit"), [(0.02, 0.008), (0.05, 0.013), (0.1, 0.0235), (0.2, 0.05)]
)
def test_loss_factor(damping, limit):
    modulus = maxwell_factor(2j * np.pi * np.geomspace(0.2, 20.0, 999), damping, 2.0)
    assert np.abs(modulus.imag / modulus.real / (2 * damping) - 1).max() <= 1.01 * limit


def test_reference_and_relaxed_modulus():
    assert maxwell_factor(2j * np.pi * 3.0, 0.1, 3.0).real == pytest.approx(1.0, rel=1e-14)
    soil = usual_column(law="maxwell", reference_frequency=3.0)
    relaxed = soil.relaxed(np.full(20, 5e7), np.full(20, 0.1))
    np.testing.assert_allclose(relaxed, 5e7 * maxwell_factor(0.0, 0.1, 3.0).real, rtol=1e-14)
    assert np.all(maxwell_weights([0.0, 0.0]) == 0.0)


# ---------------------------------------------------------------- one mode


def test_frequencies_of_a_uniform_column():
    # ω² = 6 G/(ρ h²) (1 − cos θ)/(2 + cos θ), θ = (2k − 1) π/2n: Vs²/h² and linear elements.
    omega, shapes, _ = usual_column().frequencies(usual_stages([1.0])[0].modulus)
    cosine = np.cos((2 * np.arange(20) + 1) * np.pi / 40)
    expected = (column.SPEED / column.CELL) ** 2 * 6 * (1 - cosine) / (2 + cosine)
    np.testing.assert_allclose(omega**2, expected, rtol=1e-10)
    M = usual_column().mass()[1:, 1:]
    np.testing.assert_allclose(shapes.T @ M @ shapes, np.eye(20), atol=1e-10)


@pytest.mark.parametrize("mode", [0, 4])
@pytest.mark.parametrize("damping", [(0.0, 0.0), (0.3, 0.0), (0.0, 2e-3)])
def test_free_decay_of_a_mode(mode, damping):
    alpha, beta = damping
    soil = usual_column(law="viscous", alpha=alpha, beta=beta)
    stages = usual_stages([1.0], num_samples=400)
    omega, shapes, _ = soil.frequencies(stages[0].modulus)
    shape, w = np.concatenate([[0.0], shapes[:, mode]]), omega[mode]
    xi = (alpha / w + beta * w) / 2
    start = shape, -xi * w * shape  # the velocity of a pure e^{−ξωt} cos ω_d t
    found = soil.respond(np.zeros(400), 0.01, stages, start=start)
    time, damped = 0.01 * np.arange(400), w * np.sqrt(1 - xi**2)
    expected = np.exp(-xi * w * time) * np.cos(damped * time)
    assert error(found.displacement, np.outer(shape, expected)) <= ROUND_OFF


def test_free_decay_of_a_maxwell_mode():
    """One element let go: U(s) in partial fractions, of its vibration and of four slow decays."""
    soil = ShearColumn(np.array([10.0]), np.array([1800.0]), "maxwell", reference_frequency=2.0)
    stage = Stage(800, np.array([7e6]), np.array([0.1]))
    m, a, tau = soil.mass()[1, 1], maxwell_weights(0.1), RELAXATION
    k = 7e6 / 10 * maxwell_factor(0.0, 0.1, 2.0).real
    # (s²m + k + k Σ aκ(s)) U = (s m + k Σ aτ/(1 + sτ)) u₀, each over the product of 1 + sτ
    whole = Polynomial.fromroots(-1 / tau) * np.prod(tau)
    poles = whole * Polynomial([k, 0.0, m])
    for strength, time in zip(a, tau, strict=True):
        poles += k * strength * Polynomial([0.0, time]) * (whole // Polynomial([1.0, time]))
    p = poles.roots()[:, None]
    assert np.sum(np.abs(p.imag) > 1) == 2
    above = m * p + k * (a * tau / (1 + p * tau)).sum(axis=1, keepdims=True)
    below = 2 * m * p + k * (a * tau / (1 + p * tau) ** 2).sum(axis=1, keepdims=True)
    expected = (above / below * np.exp(p * 0.01 * np.arange(800))).sum(axis=0)
    start = np.array([0.0, 1.0]), np.zeros(2)
    found = soil.respond(np.zeros(800), 0.01, [stage], start=start)
    assert error(found.displacement[1], expected.real) <= ROUND_OFF


# ---------------------------------------------------------------- steady state, resonance


@pytest.mark.parametrize("name", [name for name in LAWS if name != "elastic"])
@pytest.mark.parametrize("frequency", [0.7, 3.3])
def test_harmonic_steady_state(name, frequency):
    """Against the dynamic stiffness with G*(iω): another way to write the same law."""
    options, damping = LAWS[name]
    thickness, density = np.array([2.0, 3.0, 2.0, 1.5]), np.array([2000.0, 1900, 1800, 1700])
    soil = ShearColumn(thickness, density, **options)
    modulus = density * np.array([300.0, 250, 200, 150]) ** 2
    dampings = damping * np.array([1.0, 0.8, 0.6, 1.2])
    dt, samples = 0.005, 8000
    time = dt * np.arange(samples)
    shaking = window(time, 0.1, samples * dt, 2.0) * np.sin(2 * np.pi * frequency * time)
    found = soil.respond(shaking, dt, [Stage(samples, modulus, dampings)], steps=1)
    s = 2j * np.pi * frequency
    factors = np.array([maxwell_factor(s, d, soil.reference_frequency) for d in dampings])
    u = soil.steady(s, modulus * factors if damping else modulus + 0j, modulus)
    late = slice(6000, 7500)
    expected = np.imag(np.outer(u, np.exp(s * time[late])))
    expected -= expected[:1]
    assert error(found.above_base()[:, late], expected) <= 1e-6
    velocity = np.imag(np.outer(s * u, np.exp(s * time[late])))
    assert error(found.above_base("velocity")[:, late], velocity - velocity[:1]) <= 1e-6


def test_resonance_grows_as_it_should():
    """q̈ + ω²q = p sin ωt: q = p (sin ωt − ωt cos ωt)/2ω², and the other modes beside it."""
    soil, stages = usual_column(), usual_stages([1.0], num_samples=801)
    omega, shapes, parts = soil.frequencies(stages[0].modulus)
    w = omega[0]
    dt = 20 * 2 * np.pi / w / 800
    time = dt * np.arange(801)
    q = np.empty((20, 801))
    q[0] = (np.sin(w * time) - w * time * np.cos(w * time)) / (2 * w**2)
    for mode in range(1, 20):
        free = np.sin(w * time) - w / omega[mode] * np.sin(omega[mode] * time)
        q[mode] = free / (omega[mode] ** 2 - w**2)
    expected = shapes @ (parts[:, None] * q)
    found = soil.respond(np.sin(w * time), dt, stages).displacement[1:]
    # The sine starts with a kink, which the band-limited input rounds off over a sample or so.
    assert error(found, expected) <= 1e-3
    assert error(found[-1, -40:], expected[-1, -40:]) <= 3e-4


# ---------------------------------------------------------------- any motion, any stages


@law
@pytest.mark.parametrize("jump", ["fade", "keep", "drop"])
def test_against_an_integrator_of_another_kind(options, damping, jump):
    """Equations written out anew, under a motion given as a function, by Runge and Kutta."""
    thickness, density = np.array([4.0, 5.0, 3.0]), np.array([2000.0, 1900.0, 1700.0])
    soil = ShearColumn(thickness, density, **options)
    first = density * np.array([300.0, 220.0, 180.0]) ** 2
    moduli = [first, first * [0.8, 0.5, 0.9]]
    dampings = [damping * np.ones(3), damping * np.array([1.0, 1.8, 1.2])]
    dt, samples = 0.01, 100

    def shaking(time):
        time = np.asarray(time, float)
        return window(time, 0.1, 1.6, 0.6) * np.sin(2 * np.pi * 2.3 * time)

    stages = [Stage(samples, *pair) for pair in zip(moduli, dampings, strict=True)]
    found = soil.respond(shaking(dt * np.arange(2 * samples)), dt, stages, jump=jump)

    first_free = soil.free.start or 0
    M = soil.mass()
    n = 4 - first_free

    def unpack(x):
        u, v = np.zeros(4), np.zeros(4)
        u[first_free:], v[first_free:] = x[:n], x[n : 2 * n]
        return u, v, x[2 * n : 2 * n + 12].reshape(3, 4), x[2 * n + 12 :]

    def stress(x, stage):
        u, _, zeta, _ = unpack(x)
        a = soil.weights(dampings[stage])
        G = soil.relaxed(moduli[stage], dampings[stage])
        return G * (np.diff(u) / thickness + (a * zeta).sum(axis=1))

    def rates(time, x, stage):
        _, v, zeta, residual = unpack(x)
        sigma = stress(x, stage) + residual
        rate = np.diff(v) / thickness
        sigma = sigma + soil.beta * moduli[stage] * rate
        force = -soil.alpha * M @ v - M.sum(axis=1) * shaking(time)
        force[:-1] += sigma
        force[1:] -= sigma
        force[0] -= (soil.impedance or 0.0) * v[0]
        a = np.linalg.solve(M[first_free:, first_free:], force[first_free:])
        fading = residual / FADING if jump == "fade" else 0 * residual
        memory = rate[:, None] - zeta / RELAXATION
        return np.concatenate([v[first_free:], a, memory.ravel(), -fading])

    x, parts = np.zeros(2 * n + 15), []
    for stage in range(2):
        if stage and jump != "drop":
            x[-3:] += stress(x, 0) - stress(x, 1)
        times = dt * samples * (stage + np.array([0.0, 1.0]))
        at = dt * (samples * stage + np.arange(samples + 1))
        at[-1] = times[1]
        scale = np.abs(found.displacement).max()
        solved = solve_ivp(
            rates, times, x, "DOP853", at, args=(stage,), rtol=1e-10, atol=1e-12 * scale
        )
        x = solved.y[:, -1]
        parts.append(solved.y[:, :-1])
    y = np.concatenate(parts, axis=1)
    assert error(found.displacement[first_free:], y[:n]) <= 1e-6
    assert error(found.velocity[first_free:], y[n : 2 * n]) <= 1e-6


@law
@pytest.mark.parametrize("ratios", [(1.0,), (1.0, 0.8, 0.5, 0.4)], ids=["one", "four"])
def test_converged_and_balanced(options, damping, ratios, figure):
    soil, stages = usual_column(**options), usual_stages(ratios, damping)
    found = soil.respond(quiet_record(), 0.01, stages)
    finer = soil.respond(quiet_record(), 0.01, stages, steps=9)
    name = f"reference column, {options['law']}, {len(ratios)} stages"
    steps = max(
        error(getattr(found, motion), getattr(finer, motion))
        for motion in ("displacement", "velocity", "acceleration")
    )
    figure(f"{name}: 4 against 9 steps a sample", steps, ROUND_OFF)
    energy = found.energy
    closed = np.abs(energy.imbalance).max() / energy.supplied.max()
    figure(f"{name}: balance of energy", closed, 1e-6)
    assert np.all(np.diff(energy.dissipated) >= -1e-9 * energy.supplied.max())


@law
def test_stages_of_the_same_moduli_are_one(options, damping):
    soil = usual_column(**options)
    one = soil.respond(quiet_record(), 0.01, usual_stages([1.0], damping))
    many = soil.respond(quiet_record(), 0.01, usual_stages([1.0] * 10, damping))
    for name in ("displacement", "velocity", "acceleration"):
        assert error(getattr(many, name), getattr(one, name)) <= ROUND_OFF


@pytest.mark.parametrize(("name", "damping"), [("elastic", 0.0), ("maxwell", 0.1)])
def test_stress_stays_at_a_seam(name, damping):
    """As the stress does, the acceleration stays; with the stress of the new moduli it jumps."""
    soil, record = usual_column(law=name), quiet_record()
    before, after = usual_stages([1.0, 0.5], damping)
    seam = before.num_samples
    ahead = soil.respond(record, 0.01, [replace(before, num_samples=2 * seam)]).acceleration
    held = soil.respond(record, 0.01, [before, after]).acceleration
    assert error(held[:, seam], ahead[:, seam]) <= ROUND_OFF
    dropped = soil.respond(record, 0.01, [before, after], jump="drop").acceleration
    assert error(dropped[:, seam], ahead[:, seam]) > 0.1


def test_residual_stress_fades():
    """Under a lasting acceleration the column comes to rest where its new moduli hold it."""
    thickness, ones = np.full(4, 2.5), np.ones(4)
    soil = ShearColumn(thickness, 1800 * ones, "viscous", alpha=8.0)
    time = 0.01 * np.arange(2000)
    stages = [Stage(700, 2e7 * ones, 0 * ones), Stage(1300, 1e7 * ones, 0 * ones)]
    record = window(time, 0.2, 20.0, 2.0)
    at = 1500
    static = 1800 / 1e7 * (soil.height**2 / 2 - 10.0 * soil.height)
    fades = soil.respond(record, 0.01, stages).displacement[:, at]
    keeps = soil.respond(record, 0.01, stages, jump="keep").displacement[:, at]
    assert error(fades, static) <= 1e-4
    assert error(keeps, static / 2) <= 1e-4


# ---------------------------------------------------------------- the package's own elements


@pytest.mark.parametrize("damped", ["hysteretic", "rayleigh", "on rock"])
def test_is_the_column_of_the_package(damped, tmp_path):
    """Steady state, line by line."""
    from fenics_hytf.scene import Scene
    from fenics_hytf.simulation import simulate

    rock = {"density": 2200.0, "shear_wave_velocity": 760.0, "poisson": 0.25}
    soil = usual_column(
        law="elastic" if damped == "hysteretic" else "viscous",
        alpha=0.0 if damped == "hysteretic" else 0.2,
        beta=0.0 if damped == "hysteretic" else 2e-3,
        impedance=2200.0 * 760.0 if damped == "on rock" else None,
    )
    effects = {} if damped == "hysteretic" else {"rayleigh": {"alpha": 0.2, "beta": 2e-3}}
    scene = column.table(
        tmp_path,
        quiet_record(),
        lapses={"count": 1},
        damping=0.05 if damped == "hysteretic" else 0.0,
        rock=rock if damped == "on rock" else None,
        effects=effects,
        solver={"sweep": "direct", "max_frequency": 9.0},
    )
    lapse = simulate(Scene.from_dict(scene)).lapses[0]
    modulus = usual_stages([1.0])[0].modulus
    for line in range(5, len(lapse.frequency), 10):
        s = 2j * np.pi * lapse.frequency[line]
        u = soil.steady(s, modulus * (1 + (0.1j if damped == "hysteretic" else 0)), modulus)
        found = lapse.transfer[:, 0, 0, line]
        assert error(found, 1 + s**2 * u) <= 1e-9
