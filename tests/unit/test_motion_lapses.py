# SPDX-License-Identifier: MIT
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fenics_hytf.motion import Segment, split, synthetic


def lengths(segments):
    return [segment.num_samples for segment in segments]


@given(st.integers(2, 5000), st.integers(1, 60))
def test_count_covers_the_record_with_equal_lapses_that_join(num_samples, count):
    if -(-num_samples // count) < 2:
        with pytest.raises(ValueError, match="at least 2 samples"):
            split(num_samples, 0.01, count=count)
        return
    segments = split(num_samples, 0.01, count=count)
    assert len(segments) == count
    assert len(set(lengths(segments))) == 1
    assert segments[0].start == 0
    assert all(a.stop == b.start for a, b in pairwise(segments))
    assert [segment.index for segment in segments] == list(range(count))
    # no longer than it must be: one sample less a lapse would not cover the record
    assert segments[-1].stop >= num_samples > count * (segments[0].num_samples - 1)


@given(st.integers(2, 5000), st.integers(2, 700))
def test_duration_covers_the_record(num_samples, steps):
    segments = split(num_samples, 0.005, duration=0.005 * steps)
    assert set(lengths(segments)) == {steps}
    assert segments[-1].start < num_samples <= segments[-1].stop


def test_default_is_one_lapse():
    assert split(7, 0.1) == [Segment(0, 0, 7)]


def test_duration_longer_than_the_record_pads_one_lapse():
    assert split(100, 0.01, duration=2.0) == [Segment(0, 0, 200)]


def test_lapses_join_sample_for_sample():
    record = synthetic()
    segments = split(record.num_samples, record.dt, count=7)
    padded = record.padded(segments[-1].stop)
    pieces = [padded.acceleration[segment.samples] for segment in segments]
    joined = np.concatenate(pieces)
    assert np.array_equal(joined[: record.num_samples], record.acceleration)
    assert not joined[record.num_samples :].any()


@pytest.mark.parametrize("dt", [0.005, 0.0078125, 1 / 30, 0.01 * (1 + 1e-8)])
def test_duration_of_whole_steps_up_to_rounding(dt):
    assert split(1000, dt, duration=float(f"{200 * dt:.9g}"))[0].num_samples == 200


def test_duration_must_be_a_whole_number_of_steps():
    with pytest.raises(ValueError, match=r"333.333 time steps .* use 1.998 or 2.004 s"):
        split(1000, 0.006, duration=2.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"count": 2, "duration": 1.0}, "expected one of them"),
        ({"count": 0}, "at least 1"),
        ({"count": 2.5}, "whole number"),
        ({"count": 100}, "at least 2 samples"),
        ({"duration": 0.01}, "at least 2 samples"),
        ({"duration": 0.001}, "at least 2 samples"),
        ({"duration": 0.0}, "positive"),
        ({"duration": -1.0}, "positive"),
        ({"duration": np.nan}, "positive"),
        ({"duration": np.inf}, "positive"),
        ({"duration": 1e6}, "at most 10000000 samples in all"),
        ({"duration": 1e300}, "at most 10000000 samples in all"),
    ],
)
def test_invalid(arguments, message):
    with pytest.raises(ValueError, match=message):
        split(100, 0.01, **arguments)


def test_more_lapses_than_anyone_means():
    for cut in ({"count": 10_001}, {"duration": 0.09}):
        with pytest.raises(ValueError, match="at most 10000 lapses"):
            split(100_000, 0.01, **cut)
    assert len(split(100_000, 0.01, count=10_000)) == 10_000
