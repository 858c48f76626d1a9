# SPDX-License-Identifier: MIT
import numpy as np
import pytest

from fenics_hytf.motion import GRAVITY, Record, RecordError


def record(values, dt=0.1):
    return Record(np.array(values, dtype=float), dt, "test")


def test_properties():
    r = record([0.0, 1.0, -3.0, 2.0])
    assert r.num_samples == 4
    assert r.duration == 4 * 0.1  # the period of the discrete transform, not the last time
    assert r.pga == 3.0
    assert np.array_equal(r.time, 0.1 * np.arange(4))


def test_acceleration_is_a_read_only_copy():
    values = np.array([0.0, 1.0])
    r = record(values)
    values[0] = 9.0
    assert r.acceleration[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        r.acceleration[0] = 1.0


@pytest.mark.parametrize(
    ("values", "dt", "message"),
    [
        ([1.0], 0.1, "at least 2 samples"),
        ([], 0.1, "at least 2 samples"),
        ([[1.0, 2.0]], 0.1, "one row"),
        ([1.0, np.nan, 2.0], 0.1, "nan at sample 1"),
        ([1.0, 2.0, -np.inf], 0.1, "-inf at sample 2"),
        ([1.0, 2.0], 0.0, "time step 0.0"),
        ([1.0, 2.0], -0.1, "time step -0.1"),
        ([1.0, 2.0], np.nan, "time step nan"),
    ],
)
def test_invalid(values, dt, message):
    with pytest.raises(RecordError, match=message) as caught:
        record(values, dt)
    assert "found" in str(caught.value)
    assert "expected" in str(caught.value)


def test_scaled():
    r = record([0.0, 1.0, -4.0])
    up = r.scaled(pga_g=0.2)
    assert up.pga == pytest.approx(0.2 * GRAVITY, rel=1e-15)  # one rounding
    assert up.acceleration[2] < 0.0  # the polarity is kept
    assert np.array_equal(r.scaled(scale=-2.0).acceleration, [-0.0, -2.0, 8.0])
    assert r.scaled() is r


def test_scaled_invalid():
    r = record([0.0, 1.0])
    with pytest.raises(ValueError, match="one of the two"):
        r.scaled(pga_g=0.1, scale=2.0)
    for pga in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match="positive peak"):
            r.scaled(pga_g=pga)
    with pytest.raises(ValueError, match="finite factor"):
        r.scaled(scale=np.inf)
    with pytest.raises(RecordError, match="zero acceleration throughout"):
        record([0.0, 0.0]).scaled(pga_g=0.1)


def test_padded():
    r = record([1.0, 2.0])
    assert np.array_equal(r.padded(4).acceleration, [1.0, 2.0, 0.0, 0.0])
    assert np.array_equal(r.padded(2).acceleration, r.acceleration)
    with pytest.raises(ValueError, match="at most 1"):
        r.padded(1)


def test_velocity_of_constant_and_linear_acceleration():
    t = 0.1 * np.arange(50)
    assert record(np.full(50, 2.0)).velocity() == pytest.approx(2.0 * t, rel=1e-13, abs=1e-13)
    # the trapezoidal rule is exact for straight lines, but for round-off of 50 sums
    assert record(t).velocity() == pytest.approx(0.5 * t**2, rel=1e-13, abs=1e-13)
