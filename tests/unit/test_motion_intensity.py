# SPDX-License-Identifier: MIT
"""Intensity measures against closed forms and against reference columns."""

from __future__ import annotations

import numpy as np
import pytest
from support.reference import load

from fenics_hytf.motion import (
    GRAVITY,
    arias_intensity,
    cumulative_absolute_velocity,
    integrated,
    intensity_measures,
    significant_duration,
)

AMPLITUDE, FREQUENCY, CYCLES, SAMPLES = 1.7, 2.0, 6, 480
OMEGA = 2 * np.pi * FREQUENCY
DT = CYCLES / FREQUENCY / SAMPLES
PGA = ("0p05", "0p2", "0p5")


def sine(samples=SAMPLES):
    return AMPLITUDE * np.sin(OMEGA * DT * np.arange(samples))


def test_a_harmonic_of_whole_cycles():
    measures = intensity_measures(sine(), DT)
    # 80 samples a cycle hold the peaks of sine and cosine; round-off of two transforms
    assert measures.pga == pytest.approx(AMPLITUDE, rel=1e-12)
    assert measures.pgv == pytest.approx(AMPLITUDE / OMEGA, rel=1e-12)
    assert measures.pgd == pytest.approx(AMPLITUDE / OMEGA**2, rel=1e-12)


def test_arias_and_cav_of_a_harmonic():
    closed = sine(SAMPLES + 1)  # with the sample at its end: the integral over the whole cycles
    duration = CYCLES / FREQUENCY
    # the trapezoidal rule is exact for sin² over whole cycles
    expected = np.pi / (2 * GRAVITY) * AMPLITUDE**2 * duration / 2
    assert arias_intensity(closed, DT) == pytest.approx(expected, rel=1e-12)
    # and short of |sin| by the factor (h/2) cot(h/2), h = ω dt
    half = OMEGA * DT / 2
    expected = 2 * AMPLITUDE * duration / np.pi * half / np.tan(half)
    assert cumulative_absolute_velocity(closed, DT) == pytest.approx(expected, rel=1e-12)


def test_significant_duration_of_a_square_wave():
    square = np.where(np.arange(1001) // 50 % 2, -2.0, 2.0)  # a² constant over 10 s
    assert significant_duration(square, 0.01) == pytest.approx(0.9 * 10.0, rel=1e-12)
    assert significant_duration(square, 0.01, (0.05, 0.75)) == pytest.approx(7.0, rel=1e-12)
    late = np.concatenate([np.zeros(500), square, np.zeros(500)])
    # the jumps from zero add a sliver of area at both ends, half a step each
    assert significant_duration(late, 0.01) == pytest.approx(9.0, abs=0.01)


def test_velocity_of_a_record_that_ends_at_rest():
    """Next to integration from rest it is short of the mean velocity, nothing more."""
    pulse = np.zeros(20_000)
    pulse[100:200], pulse[200:300] = 1.0, -1.0
    velocity = integrated(pulse, 0.01)
    trapezoid = np.concatenate([[0.0], np.cumsum(0.5 * (pulse[1:] + pulse[:-1]) * 0.01)])
    difference = velocity - trapezoid
    # the rectangle's corners ring: the trapezoidal rule cuts them off, the series does not
    assert np.abs(difference + trapezoid.mean()).max() < 0.01


def test_no_motion_and_no_number():
    zero = intensity_measures(np.zeros(10), 0.01)
    assert (zero.pga, zero.pgv, zero.pgd, zero.arias, zero.cav) == (0.0,) * 5
    assert np.isnan(zero.significant_duration)
    lost = intensity_measures(np.array([0.0, 1.0, np.nan, np.nan]), 0.01)
    assert all(np.isnan(value) for value in vars(lost).values())


def test_along_the_last_axis():
    both = np.stack([sine(), 2 * sine()])
    np.testing.assert_array_equal(arias_intensity(both, DT)[0], arias_intensity(both[0], DT))
    # powers of two: no rounding
    assert cumulative_absolute_velocity(both, DT)[1] == 2 * cumulative_absolute_velocity(sine(), DT)
    np.testing.assert_array_equal(integrated(both, DT, times=2)[1], integrated(both[1], DT, 2))


@pytest.mark.parametrize("motion", ["synthetic", "NIS090"])
def test_surface_motion_of_the_reference_columns(motion, figure):
    arias, velocity = [], []
    for name in (f"{base}_darendeli24_{motion}_pga{p}" for base in "cd" for p in PGA):
        case = load(name)
        results = case["results"]
        surface = GRAVITY * np.array(results["surface_accel_g"])
        # the reference is analysed over fa_length samples, of which the file holds the record's
        surface = np.pad(surface, (0, max(0, case["motion"]["fa_length"] - surface.size)))
        measures = intensity_measures(surface, case["motion"]["dt_s"])
        arias.append(abs(measures.arias / results["surface_arias_m_s"] - 1))
        velocity.append(abs(measures.pgv / results["surface_pgv_m_s"] - 1))
    # what the file cuts off after the record's end, and the digits it is printed with
    figure(f"reference columns, {motion}: Arias intensity", max(arias), 2e-6)
    figure(f"reference columns, {motion}: PGV", max(velocity), 3e-4)
