# SPDX-License-Identifier: MIT
"""Records that are written are read back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fenics_hytf.motion import Record, read, read_at2, read_csv, write_at2, write_csv

# accelerations of shaking ground and far beyond; AT2's eight digits reach from 1e-99 to 1e99
VALUES = st.lists(
    st.floats(-1e6, 1e6, allow_subnormal=False).map(lambda v: 0.0 if abs(v) < 1e-90 else v),
    min_size=2,
    max_size=23,
)
STEPS = st.one_of(st.sampled_from([0.01, 0.005, 1 / 256, 1 / 3, 1e-5]), st.floats(1e-4, 1.0))


@settings(max_examples=60, deadline=None)
@given(values=VALUES, dt=STEPS)
def test_at2_comes_back(tmp_path_factory, values, dt):
    path = tmp_path_factory.mktemp("at2") / "a.at2"
    write_at2(path, Record(np.array(values), dt))
    record = read_at2(path)
    assert record.dt == dt and record.name == "a"
    # half a unit of the eighth digit, and two roundings of g
    np.testing.assert_allclose(record.acceleration, values, rtol=5.01e-8)


@settings(max_examples=60, deadline=None)
@given(values=VALUES, dt=STEPS, units=st.sampled_from(["g", "m/s2"]))
def test_csv_comes_back(tmp_path_factory, values, dt, units):
    path = tmp_path_factory.mktemp("csv") / "a.csv"
    write_csv(path, Record(np.array(values), dt), units)
    record = read_csv(path, units=units)
    assert record.dt == pytest.approx(dt, rel=1e-11)  # times have twelve digits
    # the file states its unit
    np.testing.assert_array_equal(read_csv(path).acceleration, record.acceleration)
    # division by g and multiplication with it
    np.testing.assert_allclose(record.acceleration, values, rtol=0 if units == "m/s2" else 3e-16)


def test_as_files_are_read_unless_something_is_said(tmp_path):
    record = Record(np.array([0.5, -1.5, 0.25]), 0.02, "somewhere")
    write_csv(tmp_path / "a.csv", record)
    write_at2(tmp_path / "b.at2", record)
    for name in ("a.csv", "b.at2"):
        np.testing.assert_allclose(
            read(tmp_path / name).acceleration, record.acceleration, rtol=5.01e-8
        )
    assert (tmp_path / "a.csv").read_text().splitlines()[:2] == [
        "# somewhere [g]",
        "time_s,acceleration",
    ]


def test_at2_looks_as_peer_writes_it(tmp_path):
    record = Record(9.80665 * np.array([1e-3, -0.25, 0.0, 12.5, -1e-12, 0.5, 1.0]), 0.005, "r")
    write_at2(tmp_path / "a.at2", record, "A site,\nwith a break", "surface, x")
    lines = (tmp_path / "a.at2").read_text().splitlines()
    assert lines[:4] == [
        "A site, with a break",
        "surface, x",
        "ACCELERATION TIME SERIES IN UNITS OF G",
        "NPTS=      7, DT= 0.005 SEC",
    ]
    assert lines[4] == "  1.0000000E-03 -2.5000000E-01  0.0000000E+00  1.2500000E+01 -1.0000000E-12"
    assert [len(line) for line in lines[4:]] == [75, 30]


@pytest.mark.parametrize(
    "title", ["acceleration in units of m/s2", "NPTS= 3, DT= 0.5", "7 0.01 NPTS, DT", "ä" * 300, ""]
)
def test_titles_that_look_like_the_header_are_left_out(tmp_path, title):
    record = Record(np.array([1.0, 2.0, 3.0, 4.0]), 0.01, title)
    write_at2(tmp_path / "a.at2", record, title, title)
    back = read_at2(tmp_path / "a.at2")
    assert (back.num_samples, back.dt) == (4, 0.01)
    assert all(len(line) <= 80 for line in (tmp_path / "a.at2").read_text().splitlines())


def test_what_cannot_be_written(tmp_path):
    record = Record(np.array([1.0, 2.0]), 0.01)
    with pytest.raises(ValueError, match="units: found 'cm/s2'; expected one of g, m/s2"):
        write_csv(tmp_path / "a.csv", record, "cm/s2")
    for write in (write_at2, write_csv):
        with pytest.raises(OSError, match="No such file"):
            write(tmp_path / "nowhere" / "a", record)
    assert list(tmp_path.iterdir()) == []
