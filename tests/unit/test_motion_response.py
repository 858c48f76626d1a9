# SPDX-License-Identifier: MIT
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import resample

from fenics_hytf.motion import default_periods, harmonic, response_spectrum, synthetic
from fenics_hytf.motion.response import _oscillator

C = json.loads((Path(__file__).parents[1] / "data/c_darendeli24_synthetic_pga0p2.json").read_text())


def test_default_periods():
    periods = default_periods()
    assert (periods[0], periods[-1]) == (0.01, 10.0)
    # 60 a decade, but for the rounding of logarithms
    assert np.diff(np.log(periods)) == pytest.approx(np.log(10) / 60, rel=1e-12)


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.7])
@pytest.mark.parametrize("ratio", [0.02, 0.3, 1.0, 40.0])  # step over period
def test_recursion_is_exact_for_straight_lines(damping, ratio):
    # an acceleration of straight lines, not at rest at the start: a stiff ODE solver agrees at
    # its own tolerance
    points = np.array([1.0, 2.0, -1.5, 0.5, 0.5, -3.0])
    period = 1.0 / ratio
    omega = 2 * np.pi / period

    def rate(t, x):
        a = np.interp(t, np.arange(points.size), points)
        return [omega * x[1], -omega * x[0] - 2 * damping * omega * x[1] - omega * a]

    exact = [0.0]
    x = np.zeros(2)
    for j in range(points.size - 1):  # one smooth piece after the other
        x = solve_ivp(rate, (j, j + 1), x, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
        exact.append(x[0])
    assert _oscillator(points, 1.0, period, damping) == pytest.approx(np.array(exact), abs=1e-7)


def test_harmonic_against_the_closed_form():
    # from rest: u = particular + decaying solution, on a fine grid. The record has 50 samples a
    # cycle; its interpolation, the grid of 40 points a period and straight lines between them
    # cost below 0.3 % together.
    damping, frequency = 0.05, 2.0
    record = harmonic(1.0, frequency, 40, 2000)
    t = np.linspace(0.0, record.duration, 400_001)
    for period in (0.05, 0.2, 0.45, 0.5, 0.55, 1.5, 4.0):
        w, p = 2 * np.pi / period, 2 * np.pi * frequency
        wd = w * np.sqrt(1 - damping**2)
        steady = -1.0 / (w**2 - p**2 + 2j * damping * w * p)  # Im(steady e^{ipt}) solves it
        u0, v0 = -steady.imag, -(1j * p * steady).imag
        decaying = np.exp(-damping * w * t) * (
            u0 * np.cos(wd * t) + (v0 + damping * w * u0) / wd * np.sin(wd * t)
        )
        u = np.imag(steady * np.exp(1j * p * t)) + decaying
        psa = response_spectrum(record.acceleration, record.dt, [period], damping)
        assert psa == pytest.approx(w**2 * np.abs(u).max(), rel=3e-3)


def test_resonance_reaches_one_over_twice_the_damping():
    record = harmonic(1.0, 1.0, 60, 6000)
    # after 60 cycles exp(-0.05 * 2 pi * 60) = 6e-9 of the transient is left
    psa = response_spectrum(record.acceleration, record.dt, [1.0], 0.05)
    assert psa == pytest.approx(10.0, rel=2e-3)


def test_vanishing_period_gives_the_peak():
    record = synthetic(0.3)
    fine = np.abs(resample(record.acceleration, 32 * record.num_samples)).max()
    psa = response_spectrum(record.acceleration, record.dt, [1e-4, 1e-3])
    # 8 Hz is far below the oscillator's 1000 Hz: (8/1000)^2
    assert psa == pytest.approx(fine, rel=2e-4)
    assert record.pga <= fine < 1.01 * record.pga


def test_long_period_gives_the_displacement():
    # an oscillator of long period stays behind: omega^2 |u| with u the ground's displacement
    record = harmonic(1.0, 5.0, 1, 200)
    t = record.time
    ground = (t - np.sin(2 * np.pi * 5 * t) / (10 * np.pi)) / (10 * np.pi)
    period = 100.0
    psa = response_spectrum(record.acceleration, record.dt, [period], 0.0)
    w = 2 * np.pi / period
    # after the pulse the mass runs free with the pulse's momentum (zero) from its displacement
    assert psa == pytest.approx(w**2 * ground[-1], rel=1e-2)


def test_free_vibration_after_the_record_counts():
    # a pulse much shorter than the period: the peak comes a quarter of a period after it
    pulse = np.zeros(40)
    pulse[10:30] = np.hanning(20)
    impulse = 0.01 * pulse.sum()
    psa = response_spectrum(pulse, 0.01, [20.0], 0.0)
    # the pulse lasts 0.2 s of 20 s: its centre is known to that ratio squared
    assert psa == pytest.approx(2 * np.pi / 20.0 * impulse, rel=2e-3)


def test_shapes_and_scaling():
    record = synthetic()
    a = record.acceleration
    periods = [0.02, 0.3, 2.0]
    one = response_spectrum(a, record.dt, periods)
    many = response_spectrum(np.stack([[a, -a], [2 * a, 0 * a]]), record.dt, periods)
    assert many.shape == (2, 2, 3)
    assert many[0, 0] == pytest.approx(one, rel=1e-12)
    assert many[0, 1] == pytest.approx(one, rel=1e-12)
    assert many[1, 0] == pytest.approx(2 * one, rel=1e-12)
    assert not many[1, 1].any()


def test_against_pystrata_at_the_samples():
    # pystrata takes the peak of the oscillator's response at the samples, in the frequency
    # domain. The recursion at the same instants agrees to 1e-4 (straight lines between 16 points
    # a sample); beyond 1.5 s the reference holds response to the 20 s of motion after those that
    # the file lists.
    results = C["results"]
    surface = np.concatenate([results["surface_accel_g"], np.zeros(400)])
    fine = resample(surface, 16 * surface.size)
    for period, psa in zip(
        results["resp_spec_period_s"], results["resp_spec_psa_g_5pct"], strict=True
    ):
        if period <= 1.5:
            at_samples = np.abs(_oscillator(fine, 0.01 / 16, period, 0.05)[::16]).max()
            assert at_samples == pytest.approx(psa, rel=1e-4)


def test_against_pystrata():
    # the peak between samples, which pystrata leaves out, adds up to 0.5 % here
    results = C["results"]
    period = np.array(results["resp_spec_period_s"])
    reference = np.array(results["resp_spec_psa_g_5pct"])
    ratio = response_spectrum(results["surface_accel_g"], 0.01, period) / reference
    short = period <= 1.5
    assert np.all(ratio[short] > 1 - 5e-4)
    assert np.all(ratio[short] < 1 + 5e-3)
    assert ratio[~short] == pytest.approx(1.0, abs=8e-3)  # the motion that the file leaves out


@pytest.mark.parametrize(
    ("periods", "damping", "message"),
    [
        ([0.1, 0.0], 0.05, "periods: found 0.0"),
        ([-1.0], 0.05, "periods: found -1.0"),
        ([np.nan], 0.05, "periods: found nan"),
        ([0.1], 1.0, "damping: found 1.0"),
        ([0.1], -0.1, "damping: found -0.1"),
    ],
)
def test_invalid(periods, damping, message):
    with pytest.raises(ValueError, match=message):
        response_spectrum(np.ones(10), 0.01, periods, damping)
