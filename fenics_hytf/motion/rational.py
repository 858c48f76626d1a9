# SPDX-License-Identifier: MIT
"""A transfer function on many lines, from its values at few of them.

What a damped structure answers is close to a rational function of s of few poles, which the AAA
algorithm finds from samples (Nakatsukasa, Sète and Trefethen 2018, SIAM J. Sci. Comput. 40(3),
A1494–A1522). Samples lie ever farther apart, as resonances are the wider the higher they lie. Lines
between samples that had no part in it tell whether it holds; where it does not, as with sharp
resonances in a long lapse, samples are drawn closer, and at last they are all lines.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.interpolate import AAA

ComplexArray = npt.NDArray[np.complex128]
Lines = npt.NDArray[np.intp]

# From one sample to the next, of the place from the start; half the width of a resonance is a
# damping ratio, and 2 % were enough for soil with ratios of 2 to 5 %.
_APART = (0.02, 0.01, 0.005)
_FIT = 1e-11  # of the largest value: what is left at the samples
_HOLDS = 1e-9  # likewise between them
_HELD_OUT = 24  # lines that see to it
_FEW = 4  # times as many lines as samples: else all lines are taken


def from_few(evaluate: Callable[[Lines], ComplexArray], s: ComplexArray) -> ComplexArray:
    """Evaluate a function on all lines by way of some.

    Args:
        evaluate: Values on lines by their numbers; each is asked for once.
        s: Complex frequencies in their order along a curve that begins near nought [rad/s], shape
            ``(num_lines,)``. The function of a conjugate is the conjugate of the function.

    Returns:
        Values, right to 1e-9 of the largest, shape ``(num_lines,)``.
    """
    found: ComplexArray = np.zeros(len(s), np.complex128)
    known: Lines = np.empty(0, np.intp)
    for apart in _APART:
        samples = _samples(len(s), apart)
        if _FEW * len(samples) > len(s):
            break
        between = _between(samples)
        wanted = np.setdiff1d(np.union1d(samples, between), known)
        found[wanted] = evaluate(wanted)
        known = np.union1d(known, wanted)
        rational = _fitted(s[samples], found[samples])
        off = np.abs(rational(s[between]) - found[between]).max(initial=0.0)
        if off <= _HOLDS * np.abs(found[known]).max():
            rest = np.setdiff1d(np.arange(len(s)), known)
            found[rest] = rational(s[rest])
            return found
    rest = np.setdiff1d(np.arange(len(s)), known)
    found[rest] = evaluate(rest)
    return found


def _samples(count: int, apart: float) -> Lines:
    """Lines ever farther apart, the first and the last among them."""
    places = [0]
    while places[-1] < count - 1:
        places.append(min(places[-1] + max(1, round(apart * places[-1])), count - 1))
    return np.array(places, np.intp)


def _between(samples: Lines) -> Lines:
    """Lines amid gaps, from the first gap to the last."""
    gaps = np.flatnonzero(np.diff(samples) > 1)
    some = gaps[np.unique(np.linspace(0, len(gaps) - 1, _HELD_OUT).round().astype(np.intp))]
    return np.asarray((samples[some] + samples[some + 1]) // 2)


def _fitted(s: ComplexArray, values: ComplexArray) -> AAA:
    """A rational function through samples and their conjugates."""
    complex_ones = s.imag > 0
    z = np.concatenate([s, s[complex_ones].conj()])
    f = np.concatenate([values, values[complex_ones].conj()])
    with warnings.catch_warnings():  # that it stops short is seen by the lines held out
        warnings.simplefilter("ignore", RuntimeWarning)
        return AAA(z, f, rtol=_FIT, max_terms=len(s) // 2, clean_up=False)
