# SPDX-License-Identifier: MIT
"""Marches of a slip: Newmark's block, a system of two masses marched in time, pyslammer."""

from functools import cache
from itertools import pairwise
from types import ModuleType

import numpy as np
import pytest
from scipy.optimize import brentq
from support.two_masses import LIMIT, STEP, TwoMasses, burst, linear_driving

from fenics_hytf.motion import (
    GRAVITY,
    SlipError,
    SlipHistory,
    decoupled_slip,
    march,
    recorded,
    rigid_slip,
    straight_lines,
)

G = 9.81


# ---------------------------------------------------------------- Newmark's block


def sine(dt: float) -> np.ndarray:
    """Five cycles of 1 Hz and 0.5 g, and rest up to 8 s."""
    time = dt * np.arange(round(8 / dt))
    return np.where(time < 5, 0.5 * G * np.sin(2 * np.pi * time), 0.0)


def sine_slip() -> float:
    """Of a rigid block that yields at 0.25 g, in closed form: it sticks before a cycle is over."""
    amplitude, limit, omega = 0.5 * G, 0.25 * G, 2 * np.pi
    start = np.arcsin(0.5) / omega

    def rate(t):
        return amplitude / omega * (np.cos(omega * start) - np.cos(omega * t)) - limit * (t - start)

    stop = brentq(rate, 0.3, 1.0, xtol=1e-14)
    span = stop - start
    sines = np.sin(omega * stop) - np.sin(omega * start)
    cosine = np.cos(omega * start)
    once = amplitude * (cosine * span / omega - sines / omega**2) - limit * span**2 / 2
    return 5 * once


def test_newmarks_block_in_closed_form(figure):
    exact = sine_slip()
    assert exact == pytest.approx(0.7863, abs=5e-5)
    errors = []
    for dt in (0.01, STEP, 0.0025, 0.00125):
        drive = sine(dt)
        slip = rigid_slip(drive, 0.25 * G, dt).slip[-1]
        # the same as the coupled march of a mass without memory
        alone = np.eye(1, drive.size)[0] * 4e3
        coupled = march(4e3 * drive, 4e3 * 0.25 * G, alone, dt).slip[-1]
        assert coupled == pytest.approx(slip, rel=1e-12)
        errors.append(abs(slip / exact - 1))
    figure("rigid block, sine, 5 ms", errors[1], 6.2e-4)
    figure("rigid block, sine, 1.25 ms", errors[3], 4e-5)  # of second order
    assert decoupled_slip(30 * drive, 30 * 0.25 * G, 30.0, dt).slip[-1] == pytest.approx(slip)


def test_constant_force_from_rest(figure):
    """λ = a t²/2: the jump of α at sample 0 counts by half, which makes it of second order."""
    for dt in (0.02, 0.01):
        history = rigid_slip(np.full(101, 3.0), 1.0, dt)
        time = dt * np.arange(101)
        assert history.acceleration[0] == pytest.approx(1.0)
        np.testing.assert_allclose(history.acceleration[1:], 2.0, rtol=1e-12)
        np.testing.assert_allclose(history.rate[10:], 2.0 * time[10:], rtol=1e-6)
        error = np.abs(history.slip - time**2).max() / dt**2
        # it stays the same however long slip goes on
        figure("constant force: error of slip over a δt²", error / 2.0, 0.75 + 1e-9)


def test_a_history_is_one_of_the_formula():
    random = np.random.default_rng(4)
    driving = np.cumsum(random.normal(size=400))
    weights = 2.0 * np.exp(-0.1 * np.arange(450)) * np.cos(0.3 * np.arange(450))
    rate = 0.7
    history = march(driving, 1.5, weights, 0.1, start_rate=rate)
    past = -rate * 0.1 * np.arange(4, 0, -1)
    slip = np.concatenate([past, history.slip])
    assert (np.diff(slip) >= 0).all() and history.num_steps == 400
    twice = np.convolve([1.5, -2.0, 0.5], [1.5, -2.0, 0.5]) / 0.1**2
    alpha = np.convolve(slip, twice)[4:404]
    np.testing.assert_allclose(history.acceleration, alpha, atol=1e-10 * np.abs(alpha).max())
    once = np.convolve(slip, [1.5, -2.0, 0.5])[4:404] / 0.1
    np.testing.assert_allclose(history.rate, np.maximum(once, 0), atol=1e-10 * once.max())
    # where it slips the force is Q_y, where it does not it is not above
    force = driving - np.convolve(weights, alpha)[:400]
    force[0] = driving[0] - 2 * weights[0] * alpha[0]
    slips = np.diff(slip)[3:] > 0
    assert 50 < slips.sum() < 350
    scale = np.abs(force).max()
    np.testing.assert_allclose(force[slips], 1.5, atol=1e-9 * scale)
    assert force[~slips].max() <= 1.5 + 1e-9 * scale


def pieces(drive: np.ndarray, limit: float, dt: float, count: int) -> float:
    """Slip of a rigid block that is handed over from piece to piece with its rate."""
    rate, total = 0.0, 0.0
    edges = np.linspace(0, drive.size - 1, count + 1).astype(int)
    for first, last in pairwise(edges):
        part = drive[first : last + 1]
        kernel = np.eye(1, part.size)[0]
        history = march(part, limit, kernel, dt, start_rate=rate)
        rate, total = history.rate[-1], total + history.slip[-1]
    return total


@pytest.mark.parametrize("count", [2, 7, 16, 32, 64])
def test_pieces_of_a_rigid_block(count, figure):
    whole = rigid_slip(sine(STEP), 0.25 * G, STEP).slip[-1]
    change = abs(pieces(sine(STEP), 0.25 * G, STEP, count) / whole - 1)
    figure(f"rigid block in {count} pieces", change, 5e-3)


def test_it_stops_at_the_most_slip():
    drive, limit = sine(STEP), 0.25 * G
    whole = rigid_slip(drive, limit, STEP)
    kernel = np.eye(1, drive.size)[0]
    stopped = march(drive, limit, kernel, STEP, most_slip=0.3)
    steps = stopped.num_steps
    assert stopped.slip[-1] > 0.3 >= stopped.slip[-2]
    for name in ("slip", "rate", "acceleration"):
        values = getattr(stopped, name)
        assert values.shape == (steps,)
        np.testing.assert_array_equal(values, getattr(whole, name)[:steps])
    # what stopped goes on from the sample where it stopped
    rest = march(drive[steps - 1 :], limit, kernel, STEP, stopped.rate[-1])
    together = stopped.slip[-1] + rest.slip[-1]
    assert together == pytest.approx(whole.slip[-1], rel=2e-3)
    assert march(drive, limit, kernel, STEP, most_slip=1.0).num_steps == drive.size


# ---------------------------------------------------------------- two masses above a seam


@cache
def exact_slip(mass_damping: float) -> float:
    fine = STEP / 16
    return TwoMasses(mass_damping).elastoplastic(burst(fine), fine, LIMIT)


@pytest.mark.parametrize("mass_damping", [0.0, 1.0])
def test_damping_of_the_mechanism_itself(mass_damping, figure):
    """With C of the mass the kernel needs its terms Cφ; without it there are none."""
    system = TwoMasses(mass_damping)
    exact = exact_slip(mass_damping)
    errors = []
    for dt in (2 * STEP, STEP, STEP / 2):
        drive = burst(dt)
        driving = linear_driving(system, drive, dt)
        slip = march(driving, LIMIT, system.weights(drive.size, dt), dt).slip[-1]
        errors.append(abs(slip / exact - 1))
    name = f"two masses, damping of mass {mass_damping:g}"
    figure(f"{name}: slip at 10 ms", errors[0], 3e-3)
    figure(f"{name}: slip at 5 ms", errors[1], 1e-3)
    figure(f"{name}: slip at 2.5 ms", errors[2], 3e-4)
    # the same without those terms, neither in P nor in the force
    state = system.linear(np.outer(system.mass, drive), dt, np.zeros(4))
    blind = system.weights(drive.size, dt, damped=False)
    missed = system.phi @ system.C @ state[2:]
    other = march(driving + missed, LIMIT, blind, dt).slip[-1]
    if mass_damping:
        figure("two masses: error without the terms Cφ", abs(other / exact - 1), 0.2, at_least=True)
    else:
        assert other == pytest.approx(slip, rel=1e-9)


def handed_over(system: TwoMasses, drive: np.ndarray, count: int) -> float:
    """Slip in pieces; stress and ẇ go over, and λ̇, whose steady part Cφλ̇ loads the next one."""
    total, rate, state = 0.0, 0.0, np.zeros(4)
    drag = system.C @ system.phi
    for first, last in pairwise(np.linspace(0, drive.size - 1, count + 1).astype(int)):
        load = np.outer(system.mass, drive[first : last + 1]) - rate * drag[:, None]
        num = load.shape[1]
        driving = system.seam * system.linear(load, STEP, state)[0]
        weights = system.weights(num, STEP)
        history = march(driving, LIMIT, weights, STEP, start_rate=rate)
        alpha = history.acceleration.copy()
        alpha[0] *= 2  # the whole of the jump
        load -= np.outer(system.M @ system.phi, alpha) + np.outer(drag, history.rate - rate)
        state = system.linear(load, STEP, state)[:, -1]
        rate, total = history.rate[-1], total + history.slip[-1]
    return total


@cache
def in_one_piece() -> float:
    return handed_over(TwoMasses(1.0), burst(STEP), 1)


@pytest.mark.parametrize("count", [2, 5, 8, 16, 32])
def test_pieces_of_two_masses(count, figure):
    assert in_one_piece() == pytest.approx(exact_slip(1.0), rel=1e-3)
    change = abs(handed_over(TwoMasses(1.0), burst(STEP), count) / in_one_piece() - 1)
    figure(f"two masses in {count} pieces", change, 5e-3)


# ---------------------------------------------------------------- pyslammer

RATIOS = (0.1, 0.2, 0.4, 0.6, 0.8)  # k_y over k_max
COARSEST = "Northridge_1994_PAC-175"  # 20 ms
MOTIONS = ("Kobe_1995_TAK-090", COARSEST, "Loma_Prieta_1989_HSP-000", "Chi-Chi_1999_TCU068-090")


@pytest.fixture(scope="module")
def pyslammer():
    return pytest.importorskip("pyslammer", reason="pyslammer, an optional extra")


def largest_difference(
    pyslammer: ModuleType, acceleration: np.ndarray, dt: float
) -> tuple[float, float]:
    """Between this and pyslammer's slip, rigid and decoupled, relative; over all ratios."""
    motion = pyslammer.GroundMotion(acceleration / GRAVITY, dt, "record")
    column = {"height": 30.0, "vs_slope": 200.0, "vs_base": 1e6, "damp_ratio": 0.05}
    # its own average acceleration of the column is the drive of both
    average = np.array(pyslammer.Decoupled(1.0, motion, **column).HEA)
    rigid, decoupled = [], []
    for ratio in RATIOS:
        limit = ratio * acceleration.max()
        theirs = pyslammer.RigidAnalysis(limit / GRAVITY, motion).max_sliding_disp
        rigid.append(rigid_slip(acceleration, limit, dt).slip[-1] / theirs - 1)
        limit = ratio * average.max()
        theirs = pyslammer.Decoupled(limit / GRAVITY, motion, **column).max_sliding_disp
        mine = decoupled_slip(5e4 * average, 5e4 * limit, 5e4, dt)
        decoupled.append(mine.slip[-1] / theirs - 1)
    return float(np.abs(rigid).max()), float(np.abs(decoupled).max())


@pytest.mark.parametrize("name", MOTIONS)
def test_against_pyslammer(name, pyslammer, figure):
    """At the step of the record, as it is used: both rigid blocks start and stop at samples."""
    record = recorded(name)
    rigid, decoupled = largest_difference(pyslammer, record.acceleration, record.dt)
    figure(f"{name}: rigid block and pyslammer's", rigid, 0.09)
    figure(f"{name}: decoupled block and pyslammer's", decoupled, 0.02)


def test_against_pyslammer_at_a_fine_step(pyslammer, figure):
    """The two tend to each other."""
    record = recorded(COARSEST)
    rigid, decoupled = largest_difference(
        pyslammer, straight_lines(record.acceleration, 16), record.dt / 16
    )
    figure(f"{COARSEST}, 1.25 ms: rigid block and pyslammer's", rigid, 0.002)
    figure(f"{COARSEST}, 1.25 ms: decoupled block and pyslammer's", decoupled, 5e-4)


def block_on_lines(acceleration: np.ndarray, limit: float, dt: float) -> float:
    """Newmark's block under straight lines between samples, exactly, from one event to the next.

    While it slides its velocity is v + e t + k t²/2, with e the excess over the limit and k the
    slope of the line; it starts where e rises through nought, and stops where the velocity does.
    """
    slip = velocity = 0.0
    for before, after in pairwise(acceleration - limit):
        slope, time = (after - before) / dt, 0.0
        while time < dt:
            excess, left = before + slope * time, dt - time
            if velocity == 0.0 and excess < 0.0:
                start = -before / slope if slope > 0.0 else np.inf
                if start >= dt:
                    break
                time, excess, left = start, 0.0, dt - start
            zeros = np.roots([slope / 2, excess, velocity])
            stops = [z.real for z in zeros if z.imag == 0.0 and 1e-12 * dt < z.real < left]
            spent = min(stops, default=left)
            slip += velocity * spent + excess * spent**2 / 2 + slope * spent**3 / 6
            velocity = 0.0 if stops else velocity + excess * spent + slope * spent**2 / 2
            time += spent
    return slip


def test_why_the_rigid_blocks_differ(pyslammer, figure):
    """The step, of both: neither starts or stops between samples, as the block on lines does.

    At 20 ms, and of a slip that is a few peaks long, pyslammer's trapezoid takes the start of a
    slide from nought at the sample before, and ends it at the sample before it stops.
    """
    record = recorded(COARSEST)
    for substeps, ours, theirs in ((1, 0.02, 0.06), (16, 1e-3, 1e-3)):
        drive, dt = straight_lines(record.acceleration, substeps), record.dt / substeps
        motion = pyslammer.GroundMotion(drive / GRAVITY, dt, "record")
        errors = []
        for ratio in RATIOS:
            limit = ratio * drive.max()
            exact = block_on_lines(drive, limit, dt)
            block = pyslammer.RigidAnalysis(limit / GRAVITY, motion)
            found = rigid_slip(drive, limit, dt).slip[-1], block.max_sliding_disp
            errors.append(np.abs(np.array(found) / exact - 1))
        mine, other = np.max(errors, axis=0)
        name = f"{COARSEST}, {1e3 * dt:g} ms: off the block on lines"
        # a slide of n samples is off by the order of 1/n² where it starts and where it stops
        figure(f"{name}, ours", mine, ours)
        figure(f"{name}, pyslammer's", other, theirs)


# ---------------------------------------------------------------- samples between samples


def test_refined():
    np.testing.assert_array_equal(straight_lines([1.0, 3.0, -1.0], 2), [1, 2, 3, 1, -1])
    samples = np.random.default_rng(1).normal(size=(2, 3, 7))
    fine = straight_lines(samples, 5)
    assert fine.shape == (2, 3, 31)
    np.testing.assert_array_equal(fine[..., ::5], samples)
    np.testing.assert_allclose(np.diff(fine, 2)[..., :3], 0, atol=1e-14)
    np.testing.assert_array_equal(straight_lines(samples, 1), samples)
    np.testing.assert_array_equal(straight_lines([4.0], 3), [4.0])
    for given, substeps in (([1.0], 0), ([1.0], 1.5), ([], 2), (1.0, 2)):
        with pytest.raises(ValueError, match=r"substeps|samples"):
            straight_lines(given, substeps)


# ---------------------------------------------------------------- what is refused

GOOD = {"driving": np.ones(4), "yield_force": 0.5, "weights": np.ones(4), "dt": 0.1}


def test_what_is_marched():
    assert isinstance(march(**GOOD), SlipHistory)
    longer = march(**(GOOD | {"weights": np.r_[np.ones(4), 7.0]}))
    np.testing.assert_array_equal(longer.slip, march(**GOOD).slip)
    assert march(**(GOOD | {"yield_force": -1.0})).slip[-1] > 0  # unstable at rest


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"driving": np.ones((2, 2))}, "driving: found shape"),
        ({"driving": []}, "driving: found shape"),
        ({"driving": [1.0, np.nan, 1.0, np.inf]}, "driving: found 2 that are not finite"),
        ({"weights": np.ones(3)}, "weights: found 3; expected at least 4"),
        ({"weights": [0.0, 1.0, 1.0, 1.0]}, "expected a positive mass"),
        ({"weights": [np.inf, 1.0, 1.0, 1.0]}, "weights: found 1 that are not finite"),
        ({"yield_force": np.inf}, "yield_force"),
        ({"dt": 0.0}, "dt"),
        ({"dt": np.nan}, "dt"),
        ({"start_rate": -0.1}, "start_rate"),
        ({"start_rate": np.nan}, "start_rate"),
        ({"most_slip": 0.0}, "most_slip"),
        ({"most_slip": np.nan}, "most_slip"),
    ],
)
def test_what_is_not_marched(change, reason):
    with pytest.raises(ValueError, match=reason):
        march(**(GOOD | change))


def test_blocks_that_are_refused():
    for mass in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match="mass"):
            decoupled_slip([1.0, 2.0], 0.5, mass, 0.1)
    with pytest.raises(ValueError, match="drive"):
        rigid_slip([np.nan], 0.5, 0.1)


def test_a_kernel_of_no_passive_ground():
    """Inertia that pushes: slip grows by an order of magnitude every step."""
    weights = np.r_[1.0, np.full(499, -10.0)]
    with pytest.raises(SlipError, match="causal and passive"):
        march(np.ones(500), 0.5, weights, 0.1)
