# SPDX-License-Identifier: MIT
import os
import re
from pathlib import Path

import numpy as np
import pytest

from fenics_hytf.motion import GRAVITY, RecordError, read, read_at2, read_csv

SHARED = Path(__file__).parents[2].parent / "shared"

VALUES = np.array([0.1, -0.25, 3e-4, 0.0, 0.125, -1e-6, 0.5])
BODY = "  0.100000E+00 -0.250000E+00  3.00000E-04  0.0  .125\n -1.0e-06   +5.0E-01\n"
OLD = "PEER NGA\nSOMEWHERE\nACCELERATION TIME HISTORY IN UNITS OF G\n    7    0.0050    NPTS, DT\n"
NEW = (
    "PEER NGA STRONG MOTION DATABASE RECORD\nSomewhere, 1/1/2000\n"
    "ACCELERATION TIME SERIES IN UNITS OF G\nNPTS=      7, DT=   .0050 SEC\n"
)


@pytest.fixture
def write(tmp_path):
    def to_file(text, name="motion.csv"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return to_file


@pytest.mark.parametrize(
    "header",
    [
        OLD,
        NEW,
        NEW.lower(),
        OLD.replace("    7    0.0050    NPTS, DT", "7 5.0E-3 npts, dt (sec), trailing text"),
        NEW.replace("NPTS=      7, DT=   .0050 SEC", "NPTS =7,DT =.005SEC, and more"),
        NEW.replace("NPTS=", "  NPTS= "),
        "one line more\n" + NEW,
    ],
)
def test_at2_headers(write, header):
    record = read_at2(write(header + BODY, "R.AT2"))
    assert record.dt == 0.005
    assert record.name == "R"
    assert np.array_equal(record.acceleration, GRAVITY * VALUES)


@pytest.mark.parametrize("old", [True, False])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("  .125", ""), "NPTS = 7, but 6 values"),
        (lambda t: t + " 0.1\n", "NPTS = 7, but 8 values"),
        (lambda t: t.replace(".125", "nan"), "line 5: found 'nan'"),
        (lambda t: t.replace("+5.0E-01", "inf"), "line 6: found 'inf'"),
        (lambda t: t.replace("+5.0E-01", "0.5*"), "line 6: found '0.5*'"),
        (lambda t: t.replace("+5.0E-01", "*******"), "line 6: found"),
        (lambda t: t.replace("NPTS", "COUNT"), "no header with NPTS and DT"),
        (lambda t: t.replace("UNITS OF G", "UNITS OF CM/S/S"), "line 3: found units of CM/S/S"),
        (lambda t: t.replace("0.0050", "0.0").replace(".0050", "0.0"), "line 4: found NPTS = 7, D"),
        (lambda t: "", "no header"),
    ],
)
def test_at2_faults(write, old, change, message):
    path = write(change((OLD if old else NEW) + BODY), "R.AT2")
    with pytest.raises(RecordError) as caught:
        read_at2(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


def test_file_that_is_not_there(tmp_path):
    for name in ("none.at2", "none.csv"):
        with pytest.raises(RecordError, match=f"{name}: found No such file"):
            read(tmp_path / name)
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(RecordError, match="readable file"):
        read(tmp_path / "folder.csv")


def test_at2_of_the_old_peer_database():
    if not SHARED.exists():
        pytest.skip("reference data beside the checkout are absent")
    record = read(SHARED / "reference/ground/motions/NIS090.AT2")
    assert (record.num_samples, record.dt) == (4096, 0.01)
    # values of the file's ends and its peak, as printed there
    assert record.acceleration[0] == GRAVITY * 0.233833e-06
    assert record.pga == pytest.approx(0.502749 * GRAVITY, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        "time_s,acceleration\n0.0,1\n0.5,-2.5\n1.0,3\n",
        "# a title\n# Time (s),Acceleration (g's)\n0.0,1\n0.5,-2.5\n\n1.0,3\n",
        "0.0,1\r\n0.5,-2.5\r\n1.0,3\r\n",
        "0.0 1\n0.5\t-2.5\n1.0   3\n",
        "t;a\n0.0;1\n0.5;-2.5\n1.0;3",
        "7.0,1\n7.5,-2.5\n8.0,3\n",  # the first time need not be 0
    ],
)
def test_csv_with_times(write, text):
    record = read_csv(write(text))
    assert record.dt == 0.5
    assert record.name == "motion"
    assert np.array_equal(record.acceleration, GRAVITY * np.array([1.0, -2.5, 3.0]))


SAID = [
    ("time_s,acceleration_m_s2", "m/s2"),
    ("time [s],Acceleration [m/s²]", "m/s2"),
    ("Time (s);acc (m/sec^2)", "m/s2"),
    ("t\tacceleration in m/s/s", "m/s2"),
    ("Time (s) Acceleration (m s-2)", "m/s2"),
    ("t,a_mps2", "m/s2"),
    ("# Time (s),Acceleration (m/s**2)", "m/s2"),
    ("# a record [m/s2]\ntime_s,acceleration", "m/s2"),
    ("time [s],acceleration [g]", "g"),
    ("time_s,acc_g", "g"),
    ("t,G", "g"),
    ("t / s;acceleration / g", "g"),
    ("Time, s; Acceleration, m/s2", "m/s2"),
    ('"time_s","acc_m_per_s2"', "m/s2"),
    ("# Time (s),Acceleration (g's)", "g"),
    ("# a record [g]\ntime_s,acceleration", "g"),
]
SILENT = [
    "time_s,acceleration",
    "t,a_g",
    "t,acc_in",
    "t,in",
    "t,m",
    "time_s,acc (EW)",
    "# in Gravesend (m)\nt,a",
]
SILENT += ["# Time history, velocity to 30 cm/s\nt,a", "# Time, at a depth of 3, (m)\nt,a"]
VALUES_OF_TWO = "\n0.0,1\n0.5,2\n"


@pytest.mark.parametrize(("names", "unit"), SAID)
def test_names_of_columns_state_the_unit(write, names, unit):
    factor = {"g": GRAVITY, "m/s2": 1.0}
    path = write(names + VALUES_OF_TWO)
    for given in (None, unit):
        assert read_csv(path, units=given).acceleration[0] == factor[unit]
    other = "g" if unit == "m/s2" else "m/s2"
    advice = f'expected accelerations in {other}, as units = "{other}" says; give units = "{unit}"'
    with pytest.raises(RecordError, match=re.escape(advice)):
        read_csv(path, units=other)


@pytest.mark.parametrize("names", SILENT)
def test_names_of_columns_that_state_no_unit(write, names):
    path = write(names + VALUES_OF_TWO)
    assert read_csv(path).acceleration[0] == GRAVITY
    assert read_csv(path, units="m/s2").acceleration[0] == 1.0


def test_the_unit_of_a_lone_column_and_in_latin_1(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("Beschl. (m/s²)\n1\n2\n".encode("latin-1"))
    assert read_csv(path, dt=0.1).acceleration[0] == 1.0


@pytest.mark.parametrize(
    ("names", "advice"),
    [
        ("time,acceleration (cm/s2)", "divide the values by 100"),
        ("time_s,acc_gal", "divide the values by 100"),
        ("t,cm_s2", "divide the values by 100"),
        ("t,acc_mg", "convert the values"),
        ("t,acc (%g)", "convert the values"),
        ("t,acceleration [ft/s^2]", "convert the values"),
        ("time,velocity (cm/s)", "differentiate the values once"),
        ("time_s,v_m_s", "differentiate the values once"),
        ("time_s,velocity", "give accelerations instead"),
        ("time (s),u (m)", "differentiate the values twice"),
        ("# Time (s),Displacement", "give accelerations instead"),
        ("time (ms),acceleration", "give the times in s"),
        ("time_msec,acceleration (g)", "give the times in s"),
        ("sample,acceleration", "give the times in s, or the accelerations alone"),
        ("Frequency (Hz),acceleration (g)", "give the times in s, or the accelerations alone"),
    ],
)
def test_columns_of_something_else(write, names, advice):
    path = write(names + VALUES_OF_TWO)
    for units in (None, "m/s2"):
        with pytest.raises(RecordError, match=rf"line 1: found .*; {re.escape(advice)}"):
            read_csv(path, units=units)


@pytest.mark.timeout(10)  # each would take minutes in a time that grows with the square
@pytest.mark.parametrize("piece", ["a_", "a ", "(", "[ ", "acc ", "\t", "m/s"])
def test_a_line_without_end_is_no_name_to_ponder(write, piece):
    path = write("x" + 300_000 * piece + "y" + VALUES_OF_TWO)
    assert read_csv(path).dt == 0.5


def test_lines_that_state_two_units(write):
    path = write("# a record [g]\ntime_s,acc_m_s2" + VALUES_OF_TWO)
    with pytest.raises(RecordError, match=r"line 2: .*in g, as line 1 says"):
        read_csv(path)


@pytest.mark.parametrize("row", ["0,01;0,5", "0,01\t0,5", "0;-1,5e-3"])
def test_decimal_commas(write, row):
    with pytest.raises(RecordError, match="line 2: found decimal commas"):
        read_csv(write(f"Zeit [s];a\n{row}\n0,02;0,6\n"))


def test_text_in_utf_16(tmp_path):
    for name in ("a.csv", "a.at2"):
        (tmp_path / name).write_bytes("0.0,1\n0.1,2\n".encode("utf-16"))
        with pytest.raises(RecordError, match="found text in UTF-16; expected text in UTF-8"):
            read(tmp_path / name)


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.csv")  # which nothing is ever written to
    with pytest.raises(RecordError, match="found no regular file"):
        read(tmp_path / "a.csv")


def test_exponents_of_fortran(write):
    head = NEW.replace(".0050", "0.5D-02")
    record = read_at2(write(head + BODY.replace("E", "D").replace("e", "d"), "a.at2"))
    assert record.dt == 0.005
    assert np.array_equal(record.acceleration, GRAVITY * VALUES)


def test_csv_of_one_column(write):
    path = write("acceleration\n1\n-2.5\n3\n")
    record = read_csv(path, dt=0.02, units="m/s2")
    assert record.dt == 0.02
    assert np.array_equal(record.acceleration, [1.0, -2.5, 3.0])
    with pytest.raises(RecordError, match="line 2: found one column"):
        read_csv(path)


def test_units():
    with pytest.raises(ValueError, match="units: found 'cm/s2'; expected one of g, m/s2"):
        read_csv("any.csv", units="cm/s2")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0.0,1\n0.1,nan\n0.2,3\n", "line 2: found 'nan'"),
        ("0.0,1\n0.1,2\ninf,3\n", "line 3: found 'inf'"),
        ("time_s,acceleration\n0.0,1\n0.1,two\n", "line 3: found 'two'"),
        ("0.0,1\n0.1,\n", "line 2: found ''"),
        ("0.0,1\n0.1,2,3\n", "line 2: found 3 columns; expected 2"),
        ("0.0,1\n0.1\n", "line 2: found 1 columns; expected 2"),
        ("a,b,c\n1,2,3\n", "line 2: found 3 columns"),
        ("0.0,1\n", "found 1 samples"),
        ("# nothing\n", "found 0 samples"),
        ("time_s,acceleration\n", "found 0 samples"),
        ("acceleration,time_s\n1,0.0\n2,0.1\n", "line 1: found 'acceleration,time_s'"),
        # steps that change, a sample lost, times that stand still or go back
        ("0.0,1\n0.1,2\n0.2,3\n0.35,4\n", "line 4: found a time step of 0.15 s"),
        ("0.00,1\n0.01,2\n0.03,3\n0.04,4\n", "found a time step of"),
        ("0.0,1\n0.1,2\n0.1,3\n0.2,4\n", "found a time step of"),
        ("0.2,1\n0.1,2\n0.0,3\n", "line 2: found a time step of -0.1 s"),
        ("0.0,1\n0.0,2\n", "found a time step of 0 s"),
    ],
)
def test_csv_faults(write, text, message):
    path = write(text)
    with pytest.raises(RecordError) as caught:
        read_csv(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


def csv(times, digits):
    return "".join(f"{t:.{digits}f},{i % 3}\n" for i, t in enumerate(times))


@pytest.mark.parametrize(
    ("dt", "digits"), [(0.005, 3), (1 / 30, 4), (1 / 256, 4), (0.0078125, 4), (1 / 3, 2)]
)
def test_times_printed_with_few_digits(write, dt, digits):
    times = dt * np.arange(3000)
    record = read_csv(write(csv(times, digits)))
    # both end points are off by at most half a unit of the last digit
    assert record.dt == pytest.approx(dt, abs=10.0**-digits / 2999, rel=1e-12)


@pytest.mark.parametrize("position", [1, 1500, 2998])
def test_lost_sample_among_times_printed_with_few_digits(write, position):
    times = np.delete(np.arange(3000) / 256, position)
    with pytest.raises(RecordError, match=f"line {position + 1}: found a time step of 0.0078"):
        read_csv(write(csv(times, 4)))


def test_times_too_coarse_to_tell_rounding_from_a_lost_sample(write):
    path = write(csv(0.0125 * np.arange(40), 2))  # steps of 0.01 and 0.02
    with pytest.raises(RecordError, match="or give dt"):
        read_csv(path)
    assert read_csv(path, dt=0.0125).dt == 0.0125


def test_times_summed_in_single_precision(write):
    times = np.cumsum(np.full(4000, 0.01, dtype=np.float32), dtype=np.float32)
    record = read_csv(write("".join(f"{t:.9g},0.1\n" for t in times)))
    assert record.dt == pytest.approx(0.01, rel=1e-4)  # 4000 roundings of 6e-8 of 40 s drift


def test_given_time_step_against_times(write):
    path = write(csv(0.01 * np.arange(1000), 2))
    assert read_csv(path, dt=0.01).dt == 0.01
    for wrong in (0.0101, 0.02, 0.005):
        with pytest.raises(RecordError, match=f"as dt = {wrong} s gives"):
            read_csv(path, dt=wrong)
    with pytest.raises(RecordError, match=r"time step -0\.01 s"):
        read_csv(path, dt=-0.01)


@pytest.mark.parametrize(("dt", "digits"), [(0.01, 2), (0.0125, 2), (1 / 256, 3)])
def test_lost_sample_beside_a_given_time_step(write, dt, digits):
    times = np.delete(dt * np.arange(400), 200)
    with pytest.raises(RecordError, match="line 201: found the time"):
        read_csv(write(csv(times, digits)), dt=dt)


def test_read_chooses_by_suffix(write):
    assert read(write(NEW + BODY, "a.at2")).name == "a"
    assert read(write(OLD + BODY, "b.At2")).dt == 0.005
    assert read(write("1\n2\n", "c.CSV"), dt=0.1, units="m/s2").pga == 2.0
    with pytest.raises(RecordError, match=r"found the suffix '.txt'; expected '.at2' or '.csv'"):
        read(write(NEW + BODY, "d.txt"))


def test_at2_takes_neither_dt_nor_units(write):
    path = write(NEW + BODY, "a.at2")
    for wrong, said in (({"dt": 0.01}, "dt = 0.01"), ({"units": "m/s2"}, "units = 'm/s2'")):
        with pytest.raises(RecordError, match=f"together with {said}; expected neither"):
            read(path, **wrong)
