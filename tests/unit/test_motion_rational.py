# SPDX-License-Identifier: MIT
"""Transfer functions on all lines from few: close where they are smooth, all lines where not."""

import numpy as np
import pytest

from fenics_hytf.motion import ConvolutionQuadrature, from_few


def resonances(s, damping):
    """Sixty modes from 1 to 60 Hz, that end in a constant."""
    frequency = 2 * np.pi * np.arange(1.0, 61.0)[:, None]
    share = 1 / np.arange(1, 61)[:, None] ** 2
    return 1 + np.sum(share * s**2 / (s**2 + 2 * damping * frequency * s + frequency**2), axis=0)


class Watched:
    """A function that keeps count of what it is asked for."""

    def __init__(self, values):
        self.values, self.asked = values, []

    def __call__(self, lines):
        self.asked.extend(lines.tolist())
        return self.values[lines]


@pytest.mark.parametrize(
    ("steps", "damping", "share"),
    [
        (1600, 0.05, 0.35),  # a lapse of 4 s, as soil is damped
        (1600, 0.0, 0.35),  # the contour itself damps so much
        (8000, 0.0, 0.1),  # sharp resonances in a long lapse
    ],
)
def test_few_lines_tell_of_all(steps, damping, share, figure):
    s = ConvolutionQuadrature(steps, 0.0025).s
    expected = resonances(s, damping)
    function = Watched(expected)
    found = from_few(function, s)
    name = f"{steps} lines from {len(function.asked)}, damping {damping}"
    figure(name, np.abs(found - expected).max() / np.abs(expected).max(), 1e-9)
    assert len(function.asked) == len(set(function.asked))
    assert len(function.asked) <= share * len(s)


@pytest.mark.parametrize("steps", [1, 2, 60, 1600])
def test_all_lines_where_few_do_not_tell(steps):
    """Noise is no rational function; and few lines leave none to spare."""
    s = ConvolutionQuadrature(steps, 0.0025).s
    noise = Watched(np.random.default_rng(3).standard_normal(len(s)) + 0j)
    np.testing.assert_array_equal(from_few(noise, s), noise.values)
    assert sorted(noise.asked) == list(range(len(s)))
