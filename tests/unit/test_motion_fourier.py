# SPDX-License-Identifier: MIT
"""Fourier amplitudes and their smoothing."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_hytf.motion import fourier_amplitude, smoothed


def test_amplitude_of_a_harmonic_and_parseval():
    dt, samples = 0.01, 1000
    record = 3.0 * np.cos(2 * np.pi * 2.0 * dt * np.arange(samples))
    frequency, amplitude = fourier_amplitude(record, dt)
    assert frequency[20] == pytest.approx(2.0, rel=1e-15)
    # ∫A cos(ωt) e^{-iωt} dt over T is A T/2; round-off of a transform
    assert amplitude[20] == pytest.approx(3.0 * 10.0 / 2, rel=1e-13)
    noise = np.random.default_rng(1).normal(size=(2, 999))
    frequency, amplitude = fourier_amplitude(noise, dt)
    twice = np.where(frequency > 0, 2.0, 1.0)  # an odd number of samples: only zero stands alone
    energy = (twice * amplitude**2).sum(axis=1) * frequency[1]
    np.testing.assert_allclose(energy, (noise**2).sum(axis=1) * dt, rtol=1e-12)


def test_smoothing_keeps_what_is_flat_and_ignores_zero_frequency():
    frequency = 0.05 * np.arange(500)
    flat = np.full(500, 2.5)
    flat[0] = 1e9
    centres = np.geomspace(0.5, 20.0, 40)
    np.testing.assert_allclose(smoothed(frequency, flat, centres), 2.5, rtol=1e-13)


def test_the_window_is_symmetric_in_the_logarithm_and_vanishes_outside():
    frequency = np.geomspace(0.1, 10.0, 2001)  # the centre of the axis is 1 Hz, number 1000
    line = np.zeros(2001)
    line[1000] = 1.0
    ratio = 1.1
    below, above = smoothed(frequency, line, [1 / ratio, ratio])
    assert below == pytest.approx(above, rel=1e-10) and below > 0.0
    b = 40.0
    x = b * np.log10(ratio)
    total = np.sinc(b * np.log10(frequency / ratio) / np.pi) ** 4
    total = total[np.abs(b * np.log10(frequency / ratio)) <= np.pi].sum()
    assert above == pytest.approx((np.sin(x) / x) ** 4 / total, rel=1e-10)
    edge = 10 ** (np.pi / b)
    assert smoothed(frequency, line, [1.001 * edge, 0.999 / edge]).tolist() == [0.0, 0.0]


def test_many_centres_are_done_in_blocks(monkeypatch):
    frequency = 0.1 * np.arange(1, 300)
    amplitude = np.sin(frequency) ** 2
    centres = np.geomspace(1.0, 20.0, 31)
    whole = smoothed(frequency, amplitude, centres)
    monkeypatch.setattr("fenics_hytf.motion.fourier._AT_ONCE", 700)  # two centres at a time
    # sums over as many lines, in another order
    np.testing.assert_allclose(smoothed(frequency, amplitude, centres), whole, rtol=1e-13)


def test_no_line_no_value():
    assert np.isnan(smoothed([5.0, 5.1], [1.0, 1.0], [1.0])).all()
