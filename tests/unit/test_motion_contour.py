# SPDX-License-Identifier: MIT
"""Transforms on the damped contour against closed forms and quadrature; bands of a record."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fenics_hytf.motion import (
    Contour,
    LapseRecord,
    StartFunctions,
    band_limited,
    dominant_frequency,
    energy_band,
    frequencies,
)
from fenics_hytf.soil import RELAXATION_TIMES

DT = 0.01  # [s]
CONTOUR = Contour.over(400, DT, 4, 9.2)
EPS = np.finfo(float).eps
NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)


def gauss(edges) -> tuple[np.ndarray, np.ndarray]:
    """Places and weights of Gauss' rule between neighbouring edges, a row for each pair."""
    half = np.diff(edges)[:, None] / 2
    return edges[:-1, None] + half + half * NODES, half * WEIGHTS


def laplace(function, s, edges) -> np.ndarray:
    """∫ f(t) e^{−st} dt."""
    t, weight = gauss(edges)
    values = weight * function(t)
    return np.array([np.sum(values * np.exp(-z * t)) for z in s])


# ---------------------------------------------------------------- the contour


def test_lines_of_a_contour():
    contour = Contour.over(50, 0.02, 4, 9.2)
    assert (contour.period, contour.dt) == (200, 0.02)
    assert contour.eta == pytest.approx(9.2 / 4.0, rel=1e-15)
    s = contour.s
    assert s.shape == (101,)
    np.testing.assert_allclose(s, 2.3 + 2j * np.pi * np.arange(101) / 4.0, rtol=1e-15)
    np.testing.assert_allclose(contour.growth(3), np.exp(2.3 * np.array([0, 0.02, 0.04])))


CLOSED = {  # x, its transform, and x, ẋ, ẍ at the start
    "decay": (lambda t: np.exp(-3 * t), lambda s: 1 / (s + 3), [1, -3, 9]),
    "sine": (
        lambda t: np.exp(-2 * t) * np.sin(9 * t),
        lambda s: 9 / ((s + 2) ** 2 + 81),
        [0, 9, -36],
    ),
    "cosine": (
        lambda t: np.exp(-2 * t) * np.cos(9 * t),
        lambda s: (s + 2) / ((s + 2) ** 2 + 81),
        [1, -2, -77],
    ),
    "cubic": (lambda t: t**3 * np.exp(-3 * t), lambda s: 6 / (s + 3) ** 4, [0, 0, 0]),
}


@pytest.mark.parametrize("name", CLOSED)
def test_transforms_against_closed_forms(name, figure):
    x, X, derivatives = CLOSED[name]
    time = DT * np.arange(CONTOUR.period)
    found = DT * CONTOUR.transform(x(time), np.array(derivatives, float))
    expected = X(CONTOUR.s)
    error = np.abs(found - expected).max() / np.abs(expected).max()
    figure(f"transform of a {name}, all lines", error, 1e-6)
    # Without what is known of the start a jump is aliased all over the contour.
    blind = DT * CONTOUR.transform(x(time), np.zeros(3))
    if derivatives[0]:
        assert np.abs(blind - expected).max() > 1e3 * np.abs(found - expected).max()


def test_transforms_of_several_functions_and_of_what_ends_early():
    time = DT * np.arange(300)
    both = np.stack([np.sin(np.pi * time / 3.0) ** 4, np.cos(np.pi * time / 3.0) - 1])
    starts = np.array([[0, 0, 0], [0, 0, -((np.pi / 3.0) ** 2)]])
    found = CONTOUR.transform(both, starts)
    assert found.shape == (2, CONTOUR.period // 2 + 1)
    for one, start, alone in zip(both, starts, found, strict=True):
        padded = np.pad(one, (0, CONTOUR.period - 300))
        np.testing.assert_allclose(CONTOUR.transform(padded, start), alone, rtol=1e-13, atol=1e-13)
    edges = np.linspace(0.0, 3.0, 301)
    exact = laplace(lambda t: np.sin(np.pi * t / 3.0) ** 4, CONTOUR.s, edges)
    np.testing.assert_allclose(DT * found[0], exact, atol=1e-7 * np.abs(exact).max())


@pytest.mark.parametrize(("damping", "decay"), [(0.0, 13.8), (0.05, 9.2)])
def test_an_oscillator_from_rest(damping, decay, figure):
    """What comes round after the period is e^{−ηT_p} of it, and no resonance is on the way."""
    contour, omega = Contour.over(400, DT, 6, decay), 2 * np.pi * 1.5
    time = DT * np.arange(400)

    def force(t):
        return np.exp(-2 * t) * np.sin(9 * t)

    weights = DT * contour.transform(
        force(DT * np.arange(contour.period)), np.array([0.0, 9.0, -36.0])
    )
    s = contour.s
    response = weights / (s**2 + 2 * damping * omega * s + omega**2)
    found = np.fft.irfft(response, contour.period)[:400] / DT * contour.growth(400)
    exact = solve_ivp(
        lambda t, y: [y[1], force(t) - 2 * damping * omega * y[1] - omega**2 * y[0]],
        (0.0, time[-1]),
        [0.0, 0.0],
        t_eval=time,
        rtol=1e-11,
        atol=1e-14,
    ).y[0]
    error = np.abs(found - exact).max() / np.abs(exact).max()
    figure(f"oscillator from rest, {damping:.0%} of damping", error, 1e-5)


# ---------------------------------------------------------------- start functions

START = StartFunctions(3.7, DT)


def test_start_functions_against_their_definition():
    t = DT * np.arange(250)
    expected = [np.exp(-3.7 * t), t * np.exp(-3.7 * t), t**2 / 2 * np.exp(-3.7 * t)]
    expected.append(t**3 / 6 * np.exp(-3.7 * t))
    np.testing.assert_allclose(START.in_time(250), expected, rtol=1e-14)
    np.testing.assert_array_equal(START.at(t, 2), START.in_time(250, 2))


@pytest.mark.parametrize("derivative", [1, 2, 3])
def test_derivatives_of_start_functions(derivative):
    t, step = np.linspace(0.05, 2.0, 40), 1e-4
    before, after = (START.at(t + sign * step, derivative - 1) for sign in (-1, 1))
    found = START.at(t, derivative)
    scale = np.abs(found).max(axis=1, keepdims=True)
    assert np.abs(found - (after - before) / (2 * step)).max() < 1e-6 * scale.max()


def test_transforms_of_start_functions():
    s = np.array([0.5, 1 + 3j, 2 - 20j, 0.3 + 100j])
    edges = np.linspace(0.0, 20.0, 4001)
    for k, found in enumerate(START.transformed(s)):
        expected = laplace(lambda t, k=k: START.at(t.ravel())[k].reshape(t.shape), s, edges)
        np.testing.assert_allclose(found, expected, rtol=1e-10)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_coefficients_give_the_derivatives_at_the_start(count):
    given = np.random.default_rng(count).normal(size=(5, count))
    c = START.coefficients(given)
    assert c.shape == (5, count)
    at_start = np.stack([START.at(np.zeros(1), j)[:count, 0] for j in range(count)])
    np.testing.assert_allclose(c @ at_start.T, given, rtol=1e-12, atol=1e-12)


def test_start_functions_fade_and_keep_away_from_memories():
    rates = tuple(1 / tau for tau in RELAXATION_TIMES)
    for samples in range(20, 3000, 7):
        contour = Contour.over(samples, DT, 4, 9.2)
        free = StartFunctions.fading_in(contour)
        apart = StartFunctions.fading_in(contour, rates=rates)
        for start in (free, apart):
            assert start.dt == DT
            assert np.exp(-start.rate * contour.period * DT) < 1e-7
        assert min(abs(apart.rate - rate) / rate for rate in rates) > 0.0999
        assert abs(apart.rate / free.rate - 1) < 0.25


@pytest.mark.parametrize("tau", [*RELAXATION_TIMES, 0.5])
@pytest.mark.parametrize("samples", [40, 400, 1200])
def test_memory_of_start_functions(tau, samples):
    """ζ̇ = φ̇ − ζ/τ with ζ(0) = φ(0): ζ = φ − ∫ e^{−(t−v)/τ} φ(v) dv/τ."""
    rates = tuple(1 / each for each in (*RELAXATION_TIMES, 0.5))
    start = StartFunctions.fading_in(Contour.over(samples, DT, 4, 9.2), rates=rates)
    time = np.linspace(0.0, samples * DT, 12)
    found = start.remembered(tau, time)
    assert found[:, 0].tolist() == [1.0, 0.0, 0.0, 0.0]
    scale = np.abs(start.in_time(samples)).max(axis=1)
    worst = 0.0
    for column, t in enumerate(time[1:], start=1):
        v, weight = gauss(t * (1 - np.linspace(1.0, 0.0, 200) ** 3))  # close where it is recent
        lag = start.at(v.ravel()) @ (weight * np.exp(-(t - v) / tau)).ravel() / tau
        exact = start.at(np.array([t]))[:, 0] - lag
        worst = max(worst, float((np.abs(found[:, column] - exact) / scale).max()))
    assert worst < 1e-12


# ---------------------------------------------------------------- records and lapses


def shaking(t):
    """A record of two frequencies that grows and dies out in six seconds."""
    t = np.asarray(t)
    shape = np.where((t > 0) & (t < 6.0), np.sin(np.pi * np.clip(t, 0, 6.0) / 6.0) ** 4, 0.0)
    return shape * (np.sin(7 * t + 0.3) + 0.4 * np.cos(23 * t))


RECORD = LapseRecord(np.stack([shaking(DT * np.arange(700)), 0.5 * np.ones(700)]), DT)


def test_derivatives_of_a_record():
    record = LapseRecord(np.stack([np.sin(5 * DT * np.arange(400)), np.arange(400.0) ** 2]), DT)
    found = record.derivatives
    assert found.shape == (3, 2, 400)
    np.testing.assert_array_equal(found[0], record.samples)
    inner, time = slice(20, -20), DT * np.arange(400)  # a spline knows least at its ends
    np.testing.assert_allclose(found[1, 0, inner], 5 * np.cos(5 * time)[inner], atol=5e-8)
    np.testing.assert_allclose(found[2, 0, inner], -25 * np.sin(5 * time)[inner], atol=25e-6)
    np.testing.assert_allclose(found[1, 1], 2 * np.arange(400) / DT, rtol=1e-7, atol=1e-4)
    np.testing.assert_allclose(found[2, 1], 2 / DT**2, rtol=1e-6)


@pytest.mark.parametrize("count", [2, 5])
def test_derivatives_of_a_short_record(count):
    ramp = LapseRecord(3.0 * np.arange(count)[None], DT)
    np.testing.assert_allclose(ramp.derivatives[1], 3.0 / DT, rtol=1e-12)
    np.testing.assert_array_equal(ramp.derivatives[2], 0.0)


@pytest.mark.parametrize(("start", "samples"), [(0, 200), (150, 200), (470, 200)])
def test_weights_of_a_lapse_are_the_transform_of_what_runs_on(start, samples, figure):
    """The record as it is in the lapse, then under half a cosine, squared."""
    contour = Contour.over(samples, DT, 4, 9.2)
    found = DT * RECORD.weights(contour, start, samples)
    assert found.shape == (2, contour.period // 2 + 1)
    end, over = (samples - 0.5) * DT, samples // 2 * DT

    def lapse(t):
        fall = np.cos(np.pi / 2 * np.clip((t - end) / over, 0.0, 1.0)) ** 2
        return fall * shaking(start * DT + t)

    edges = np.concatenate([np.linspace(0, end, 150), np.linspace(end, end + over, 80)[1:]])
    expected = laplace(lapse, contour.s, edges)
    error = np.abs(found[0] - expected).max() / np.abs(expected).max()
    figure(f"weights of a lapse from sample {start}", error, 1e-5)


def test_weights_come_back_as_the_record():
    contour = Contour.over(200, DT, 4, 9.2)
    weights = RECORD.weights(contour, 150, 200)
    start = StartFunctions.fading_in(contour)
    c = start.coefficients(RECORD.derivatives[:, :, 150].T)
    held = c @ start.transformed(contour.s)[:3] / DT
    rest = np.fft.irfft(weights - held, contour.period)[:, :200] * contour.growth(200)
    found = rest + c @ start.in_time(200)[:3]
    np.testing.assert_allclose(found, RECORD.samples[:, 150:350], atol=1e-12)


# ---------------------------------------------------------------- bands


def burst(frequency, centre, count=1000, dt=0.02):
    """A harmonic of about a second: its lines spread by 0.16 Hz."""
    time = dt * (np.arange(count) - centre)
    return np.exp(-(time**2) / 2) * np.cos(2 * np.pi * frequency * time)


def test_a_band_limited_record():
    low, high = burst(3.0, 400), burst(11.0, 600)
    found = band_limited(np.stack([low + high, low, high]), 0.02, 7.0)
    np.testing.assert_allclose(found[0], low, atol=1e-10)
    np.testing.assert_allclose(found[1], low, atol=1e-10)
    np.testing.assert_allclose(found[2], 0.0, atol=1e-10)
    np.testing.assert_allclose(found[0], found[1] + found[2], atol=1e-14)


@pytest.mark.parametrize("limit", [None, 25.0, 30.0])
def test_a_record_without_a_limit_stays_as_it_is(limit):
    record = np.random.default_rng(1).normal(size=(2, 101))
    np.testing.assert_array_equal(band_limited(record, 0.02, limit), record)


def test_nothing_wraps_round_when_a_band_is_cut():
    late = burst(3.0, 980) + burst(11.0, 980)  # it is cut off at its height
    early = band_limited(late[None], 0.02, 7.0)[0, :20]
    beyond = band_limited(np.pad(late, (0, 3000))[None], 0.02, 7.0)[0]
    assert np.abs(early).max() < 1e-3 < 0.01 * np.abs(beyond[1000:1020]).max()


def test_the_band_that_holds_the_energy():
    time, dt = 0.02 * np.arange(500), 0.02
    lines = [2.0, 5.0, 12.0, 20.0]  # whole cycles in ten seconds
    energy = [0.5, 0.3, 0.185, 0.015]
    record = sum(
        np.sqrt(e) * np.cos(2 * np.pi * f * time + f) for e, f in zip(energy, lines, strict=True)
    )
    for share, expected in ((0.4, 2.0), (0.6, 5.0), (0.98, 12.0), (0.99, 20.0)):
        assert energy_band(record[None], dt, share) == pytest.approx(expected, rel=1e-12)
    assert energy_band(record[None], dt) == pytest.approx(20.0)
    slow = np.cos(2 * np.pi * time)
    assert energy_band(np.stack([slow, record, 0 * record]), dt) == pytest.approx(20.0)
    assert energy_band(np.stack([slow, 0 * record]), dt) == pytest.approx(1.0)
    assert energy_band(np.zeros((2, 500)), dt) == 0.0


def test_the_dominant_frequency():
    dt, time = 0.02, 0.02 * np.arange(1000)
    record = np.cos(2 * np.pi * 3.0 * time) + 0.3 * np.cos(2 * np.pi * 8.0 * time)
    # Centres are 1.6 % apart.
    assert dominant_frequency(record[None], dt) == pytest.approx(3.0, rel=0.01)
    stronger = 2 * np.cos(2 * np.pi * 0.8 * time)
    assert dominant_frequency(np.stack([record, stronger]), dt) == pytest.approx(0.8, rel=0.01)


def test_a_lone_line_is_not_dominant():
    """A narrow band of many lines beside one line that is higher than any of them."""
    dt, count = 0.02, 4000
    frequency = frequencies(count, dt)
    band = (frequency > 4.0) & (frequency < 6.0)
    phase = np.random.default_rng(2).uniform(0, 2 * np.pi, len(frequency))
    spectrum = np.where(band, np.exp(1j * phase), 0.0)
    spectrum[np.argmin(abs(frequency - 10.0))] = 3.0
    record = np.fft.irfft(spectrum, count)
    assert 4.0 < dominant_frequency(record[None], dt) < 6.0


@pytest.mark.parametrize("count", [2, 3, 500])
def test_the_dominant_frequency_is_above_zero_whatever_the_record(count):
    lowest = frequencies(count, 0.02)[1]
    for record in (np.zeros(count), np.ones(count)):
        assert dominant_frequency(record[None], 0.02) >= lowest > 0
    assert dominant_frequency(np.zeros((2, count)), 0.02) == lowest
