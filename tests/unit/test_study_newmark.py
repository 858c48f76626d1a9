# SPDX-License-Identifier: MIT
"""The march in time: one oscillator in closed form, energy, and the sweep on the same matrices."""

from itertools import pairwise

import numpy as np
import pytest
from scipy import sparse
from support.meshes import scene

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate
from fenics_hytf.study import newmark
from fenics_hytf.study.matrices import assemble
from fenics_hytf.study.newmark import SCHEMES, Marcher, integrate
from fenics_hytf.study.twin import viscous_twin

OMEGA, DAMPING = 2 * np.pi, 0.05  # of the oscillator
SOIL = {"density": 1800.0, "shear_wave_velocity": 150.0, "poisson": 0.3, "damping": 0.05}
RECORD = {"synthetic": {"n": 400, "t1": 0.5, "t2": 2.0, "f2": 4.0}, "pga": 0.1}
CURVES = {"strain": [1e-6, 1e-3], "modulus": [1.0, 0.5], "damping": [0.03, 0.2]}
CURVED = dict.fromkeys(("soft", "stiff"), SOIL | {"curves": CURVES})
ROCK = {"density": 2200.0, "shear_wave_velocity": 800.0, "poisson": 0.25, "damping": 0.02}


def one(value: float) -> sparse.csr_matrix:
    return sparse.csr_matrix([[value]])


def oscillator(step: float, scheme: str = "newmark", damping: float = DAMPING) -> Marcher:
    C = one(2 * damping * OMEGA) if damping else None
    return Marcher(one(OMEGA**2), one(1.0), C, step, SCHEMES[scheme])


def duhamel(time: np.ndarray, drive: float) -> np.ndarray:
    """Acceleration of the oscillator at rest under sin(drive t) from t = 0."""
    steady = 1 / (OMEGA**2 - drive**2 + 2j * DAMPING * OMEGA * drive)  # e^{i drive t}
    decay = -DAMPING * OMEGA + 1j * OMEGA * np.sqrt(1 - DAMPING**2)
    # u = Im(steady e^{i drive t}) + Re(free e^{decay t}), at rest at first
    real = -steady.imag
    free = complex(real, (real * decay.real + (1j * drive * steady).imag) / decay.imag)
    forced = (-(drive**2) * steady * np.exp(1j * drive * time)).imag
    return forced + (decay**2 * free * np.exp(decay * time)).real


@pytest.mark.parametrize("scheme", ["newmark", "hht"])
def test_second_order_to_the_duhamel_integral(scheme, figure):
    errors = []
    for steps in (400, 800, 1600):
        time = 5.0 / steps * np.arange(steps + 2)
        drive = np.sin(3.0 * time)[None]
        found = oscillator(time[1], scheme).run(np.ones((1, 1)), drive, one(1.0))
        exact = duhamel(time[:-1], 3.0)
        errors.append(np.abs(SCHEMES[scheme].at_steps(found)[0] - exact).max())
    for coarse, fine in pairwise(errors):
        # the next term of the error is smaller by a step's square
        figure(f"{scheme}: order in time", abs(np.log2(coarse / fine) - 2), 0.05)


def test_the_accelerations_of_hht_lie_before_the_end_of_the_step(figure):
    """As they come they are of first order: why they are read off between two steps."""
    alpha, errors = SCHEMES["hht"].alpha, {}
    for shift in (0.0, alpha):
        pair = []
        for steps in (1600, 3200):
            time = 5.0 / steps * np.arange(steps + 1)
            drive = np.sin(3.0 * time)[None]
            found = oscillator(time[1], "hht").run(np.ones((1, 1)), drive, one(1.0))
            exact = duhamel(np.maximum(time + shift * time[1], 0.0), 3.0)
            pair.append(np.abs(found[0] - exact)[1:].max())
        errors[shift] = np.log2(pair[0] / pair[1])
    figure("hht: order of ü⁺ at t + h", abs(errors[0.0] - 1), 0.1)
    figure("hht: order of ü⁺ at t + (1 + α)h", abs(errors[alpha] - 2), 0.05)


def free_vibration(step: float, num_steps: int, scheme: str) -> np.ndarray:
    rest = np.zeros((1, num_steps + 1))
    marcher = oscillator(step, scheme, damping=0.0)
    return marcher.run(np.ones((1, 1)), rest, one(1.0), np.ones(1), np.zeros(1))[0]


@pytest.mark.parametrize("step", [0.02, 0.1, 0.5])
def test_period_elongation_of_the_average_acceleration(step, figure):
    # Bathe and Wilson (1973): it turns by 2 atan(ωh/2) a step, and neither grows nor decays.
    number = np.arange(201)
    exact = -(OMEGA**2) * np.cos(2 * np.arctan(OMEGA * step / 2) * number)
    error = np.abs(free_vibration(step, 200, "newmark") - exact).max() / OMEGA**2
    figure(f"period elongation, step of {step} s", error, 200 * 200 * np.finfo(float).eps)


def test_hht_damps_what_a_step_does_not_resolve(figure):
    # For ωh -> ∞ the two roots are -(1 + α)/(1 - α), and motion (a + bn) times its n-th power.
    alpha = SCHEMES["hht"].alpha
    number = np.arange(20, 60)
    line = free_vibration(1e5, 60, "hht")[number] * (-(1 - alpha) / (1 + alpha)) ** number
    bend = np.abs(np.diff(line, 2)).max() / np.abs(np.diff(line)).max()
    figure("hht: spectral radius where a step resolves nothing", bend, 1e-6)
    # It keeps what a step does resolve: the algorithmic damping falls with the step's cube.
    coarse, fine = (algorithmic_damping(step, "hht") for step in (0.02, 0.01))
    figure("hht: algorithmic damping at 50 steps a period", coarse, 1e-3)
    figure("hht: order at which it falls", abs(np.log2(coarse / fine) - 3), 0.05)
    none = abs(algorithmic_damping(0.02, "newmark"))
    figure("newmark: algorithmic damping", none, 1e-12)


def algorithmic_damping(step: float, scheme: str) -> float:
    """Damping ratio of a free vibration, from the roots of the recursion that it follows."""
    history = free_vibration(step, 100, scheme)
    terms = 2 if scheme == "newmark" else 3
    past = np.lib.stride_tricks.sliding_window_view(history, terms + 1)
    weights, *_ = np.linalg.lstsq(past[:, :terms], past[:, terms])
    root = np.log(complex(max(np.roots([1.0, *-weights[::-1]]), key=abs)))
    return -root.real / abs(root)


def random_system(num: int, seed: int = 5) -> tuple[sparse.csr_matrix, ...]:
    """K, M and C, positive definite and full."""
    random = np.random.default_rng(seed)

    def positive(size: float) -> sparse.csr_matrix:
        root = random.normal(size=(num, num))
        return sparse.csr_matrix(size * (root @ root.T + num * np.eye(num)))

    return positive(40.0), positive(1.0), positive(0.5)


def test_energy_balance(figure):
    """Average acceleration: work of the mean force in a step is energy gained and dissipated."""
    K, M, C = random_system(12)
    h, num_steps = 0.05, 300
    random = np.random.default_rng(3)
    loads, motion = random.normal(size=(2, 12)), random.normal(size=(2, num_steps + 1))
    rows = sparse.csr_matrix(np.eye(12))
    a = Marcher(K, M, C, h).run(loads, motion, rows).T
    mean = (a[:-1] + a[1:]) / 2
    v = np.concatenate([np.zeros((1, 12)), np.cumsum(h * mean, axis=0)])
    middle = (v[:-1] + v[1:]) / 2
    u = np.concatenate([np.zeros((1, 12)), np.cumsum(h * middle, axis=0)])
    energy = (np.sum(v * (M @ v.T).T, axis=1) + np.sum(u * (K @ u.T).T, axis=1)) / 2
    force = motion.T @ loads
    work = h * np.sum(middle * (force[:-1] + force[1:]) / 2, axis=1)
    lost = h * np.sum(middle * (C @ middle.T).T, axis=1)
    unbalanced = np.abs(np.diff(energy) - work + lost).max()
    # round-off of sums of 300 steps over 12 unknowns
    figure("energy out of balance in a step", unbalanced / energy.max(), 1e-12)
    assert energy.max() > 10 * np.abs(work).max() / num_steps


@pytest.mark.parametrize("scheme", ["newmark", "hht"])
def test_the_compiled_march_is_the_one_of_large_systems(scheme, monkeypatch, figure):
    matrices = random_system(20)
    random = np.random.default_rng(8)
    loads, motion = random.normal(size=(2, 20)), random.normal(size=(2, 100))
    rows = sparse.csr_matrix(random.normal(size=(3, 20)))
    start = random.normal(size=(2, 20))

    def march() -> np.ndarray:
        return Marcher(*matrices, 0.01, SCHEMES[scheme]).run(loads, motion, rows, *start)

    small = march()
    monkeypatch.setattr(newmark, "_CACHED", 0)
    large = march()
    error = np.abs(small - large).max() / np.abs(large).max()
    figure(f"{scheme}: compiled against SuperLU's solves", error, 1e-11)
    force = loads.T @ motion[:, 0] - matrices[0] @ start[0] - matrices[2] @ start[1]
    first = rows @ np.linalg.solve(matrices[1].toarray(), force)
    assert small[:, 0] == pytest.approx(first, rel=1e-9)


def column(**sections) -> Scene:
    layers = [
        {"thickness": 6.0, "soil": "soft", "cells": 3},
        {"thickness": 9.0, "soil": "stiff", "cells": 3},
    ]
    given = {
        "soil": {"soft": SOIL, "stiff": SOIL | {"shear_wave_velocity": 300.0}},
        "motion": [RECORD | {"direction": "x"}],
        "boundary": {"left": "tied", "right": "tied"},
        "output": {"receivers": {"top": [0.5, 15.0], "mid": [0.3, 8.0]}},
    }
    return scene({"column": {"width": 1.0, "layers": layers}, "degree": 2}, **(given | sections))


def section() -> Scene:
    """Two directions, dashpots at the sides, rock below, and a receiver that rides a point."""
    motions = [
        RECORD | {"direction": "x", "input": "outcrop"},
        RECORD | {"direction": "y", "input": "outcrop", "pga": 0.05, "synthetic": {"n": 300}},
    ]
    mesh = {"size": [30.0, 10.0], "cells": [10, 4]}
    regions = [
        {"soil": "stiff", "polygon": [[0, 0], [9, 0], [9, 8], [0, 8]]},
        {"soil": "soft", "below": 10.5},
    ]
    receivers = {"top": [15.0, 10.0], "low": {"point": [6.0, 4.0]}, "base": [10.0, 0.0]}
    return scene(
        {"box": mesh, "regions": regions},
        soil={"soft": SOIL, "stiff": SOIL | {"shear_wave_velocity": 300.0}},
        motion=motions,
        boundary={"left": "dashpot", "right": "dashpot", "base": {"compliant": ROCK}},
        output={"receivers": receivers},
    )


@pytest.mark.parametrize("case", [column, section], ids=["column", "section"])
@pytest.mark.parametrize("method", ["newmark", "hht"])
def test_against_the_sweep(case, method, figure):
    """On the twin both solve one problem: marches tend to the sweep with the square of the step."""
    twin = viscous_twin(case())
    swept = simulate(twin).history("total_acceleration")
    errors = {}
    for substeps in (32, 64):
        march = integrate(twin, method, substeps)
        samples = march.total_acceleration.shape[2]
        assert samples == 400
        difference = march.total_acceleration - swept[:, :, :samples]
        errors[substeps] = np.linalg.norm(difference) / np.linalg.norm(swept[:, :, :samples])
        assert march.cost.steps >= 400 * substeps
    name = f"{case.__name__}, {method}"
    figure(f"{name} against the sweep, 64 steps a sample", errors[64], 1e-4)
    figure(f"{name}: order", abs(np.log2(errors[32] / errors[64]) - 2), 0.05)


def test_what_a_march_costs():
    march = integrate(viscous_twin(column()), substeps=2)
    assert set(march.cost.cpu_s) == {"assembly", "factorise", "march", "output"}
    assert march.cost.factorisations == 1  # it begins at rest: the mass is not factorised
    assert (march.unknowns, march.cells) == (assemble(viscous_twin(column())).num_unknowns, 6)


def test_matrices_are_those_of_the_sweep(figure):
    """K + iK_i + sC + s²M on the receivers, against the run's transfer function."""
    case = column(effects={"rayleigh": {"alpha": 0.3, "beta": 1e-3}})
    matrices = assemble(case)
    result = simulate(case).lapses[0]
    line = len(result.frequency) // 3
    s = 2j * np.pi * result.frequency[line]
    A = matrices.stiffness + 1j * matrices.hysteresis + s * matrices.damping + s**2 * matrices.mass
    h = sparse.linalg.spsolve(A.tocsc(), matrices.loads[0])
    found = (matrices.receivers @ (s**2 * h)).reshape(2, 2) + np.array([1.0, 0.0])
    error = np.abs(found - result.transfer[:, :, 0, line]).max()
    figure("transfer function from the matrices", error / np.abs(found).max(), 1e-9)


@pytest.mark.parametrize(
    ("sections", "arguments", "reason"),
    [
        ({}, {}, "not causal"),
        ({"lapses": {"count": 2}}, {}, "2 lapses"),
        ({"soil": CURVED, "effects": {"equivalent_linear": True}}, {}, "equivalent_linear on"),
        ({"boundary": {"left": "free_field", "right": "free_field"}}, {}, "free_field"),
        ({}, {"method": "wilson"}, "expected one of newmark, hht"),
        ({}, {"substeps": 0}, "whole number from 1"),
    ],
)
def test_what_is_not_marched(sections, arguments, reason):
    with pytest.raises(ValueError, match=reason):
        integrate(column(**sections), **arguments)


def test_damped_rock_is_not_marched():
    motion = RECORD | {"direction": "x", "input": "outcrop"}
    boundary = {"left": "tied", "right": "tied", "base": {"compliant": ROCK}}
    soil = {"soft": SOIL | {"damping": 0.0}, "stiff": SOIL | {"damping": 0.0}}
    with pytest.raises(ValueError, match="undamped rock"):
        integrate(column(motion=[motion], boundary=boundary, soil=soil))


def test_ground_without_mass_or_support_is_refused():
    def full(*values: float) -> sparse.csr_matrix:
        return sparse.csr_matrix((np.array(values), [0, 1, 0, 1], [0, 2, 4]))

    with pytest.raises(RuntimeError, match="pivots"):
        Marcher(full(0.0, 1.0, 1.0, 0.0), full(0.0, 0.0, 0.0, 0.0), None, 0.01)
