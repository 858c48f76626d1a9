# SPDX-License-Identifier: MIT
import numpy as np
import pytest

from fenics_hytf.motion import (
    excited_lines,
    frequencies,
    harmonic,
    split,
    synthetic,
    to_frequency,
    to_time,
)

EPS = np.finfo(float).eps


@pytest.mark.parametrize("num_samples", [2, 3, 64, 101, 400])
def test_round_trip(num_samples):
    values = np.random.default_rng(1).normal(size=(2, 3, num_samples))
    coefficients = to_frequency(values)
    assert coefficients.shape == (2, 3, num_samples // 2 + 1)
    # each transform rounds like log2 of its length
    assert to_time(coefficients, num_samples) == pytest.approx(values, abs=50 * EPS)


@pytest.mark.parametrize("num_samples", [8, 9])
def test_sign_of_the_exponent(num_samples):
    # a(t) = Re(exp(+i omega t) * (1 + 2i)) must have a coefficient along +(1 + 2i)
    j = np.arange(num_samples)
    values = np.real(np.exp(2j * np.pi * 3 * j / num_samples) * (1 + 2j))
    expected = np.zeros(num_samples // 2 + 1, complex)
    expected[3] = 0.5 * num_samples * (1 + 2j)
    assert to_frequency(values) == pytest.approx(expected, abs=100 * EPS)


def test_frequencies():
    assert frequencies(8, 0.1) == pytest.approx([0, 1.25, 2.5, 3.75, 5.0], rel=4 * EPS)
    assert frequencies(9, 0.1)[-1] == pytest.approx(4 / 0.9, rel=4 * EPS)


def test_to_time_refuses_lines_of_another_length():
    with pytest.raises(ValueError, match="found 5 lines for 10 samples; expected 6"):
        to_time(np.ones(5), 10)


def test_a_harmonic_cut_into_lapses_of_whole_periods_stays_one_line():
    record = harmonic(1.0, 0.5, 12, 600)
    for segment in split(record.num_samples, record.dt, count=4):
        spectrum = to_frequency(record.acceleration[segment.samples])
        assert np.array_equal(excited_lines(spectrum, record.dt, segment.num_samples), [3])


def test_zero_record_excites_no_line():
    assert excited_lines(np.zeros((2, 51)), 0.01, 100).size == 0


def test_one_zero_motion_beside_another():
    spectra = to_frequency(np.stack([np.zeros(100), harmonic(1.0, 1.0, 4, 100).acceleration]))
    assert np.array_equal(excited_lines(spectra, 0.04, 100), [4])


def test_threshold_is_relative_to_each_motions_own_peak():
    spectra = np.zeros((2, 51), complex)
    spectra[0, [2, 3, 4]] = [1e6j, 1.0, 1e-3]
    spectra[1, [10, 11]] = [1e-6, 1e-9]
    assert np.array_equal(excited_lines(spectra, 0.01, 100, fraction=1e-4), [2, 10, 11])
    assert np.array_equal(excited_lines(spectra, 0.01, 100, fraction=1e-2), [2, 10])
    # "above": a line that stands exactly at the fraction does not count
    assert np.array_equal(excited_lines(spectra, 0.01, 100, fraction=1e-6), [2, 10, 11])
    assert np.array_equal(excited_lines(spectra, 0.01, 100), [2, 3, 10, 11])


def test_mean_is_line_zero():
    assert np.array_equal(excited_lines(to_frequency(np.ones(10)), 0.1, 10), [0])


def test_largest_frequency_is_included():
    record = synthetic()
    spectrum = to_frequency(record.acceleration)  # lines 0.05 Hz apart
    lines = excited_lines(spectrum, record.dt, record.num_samples, max_frequency=5.15)
    assert lines[-1] == 103
    assert np.array_equal(lines, np.arange(104))
    lines = excited_lines(spectrum, record.dt, record.num_samples, max_frequency=5.1499)
    assert lines[-1] == 102


def test_all_lines_of_a_pulse():
    pulse = np.zeros(64)
    pulse[5] = 1.0
    assert np.array_equal(excited_lines(to_frequency(pulse), 0.1, 64), np.arange(33))


def test_lines_that_do_not_belong_to_the_samples():
    with pytest.raises(ValueError, match="found 10 lines for 100 samples; expected 51"):
        excited_lines(np.ones((1, 10)), 0.01, 100)
