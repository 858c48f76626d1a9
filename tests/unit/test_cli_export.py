# SPDX-License-Identifier: MIT
"""``hytf export``: what is written, what is read back, and every way it can be refused."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.results_builder import make_result

from fenics_hytf.motion import RecordError, read, read_csv
from fenics_hytf.results import open_result, read_table
from fenics_hytf.results.summary import FORMAT


@pytest.fixture
def hytf(hytf):
    return lambda *arguments: hytf("export", *arguments)


def store(name="r", **case):
    result = make_result(**case)
    with open_result(Path(name)) as folder:
        folder.write(result)
    return result


def files(folder):
    return sorted(p.relative_to(folder).as_posix() for p in Path(folder).rglob("*") if p.is_file())


def test_all_that_moves_and_the_base(here, hytf):
    result = store(compliant=True, lapses=3)
    code, out, err = hytf("r")
    assert (code, err) == (0, "") and out.startswith("r-motions: r0_x.at2, r1_x.at2")
    names = ["outcrop_x.at2", "r0_x.at2", "r1_x.at2", "r2_x.at2", "within_x.at2"]
    assert files("r-motions") == names
    record = read("r-motions/r1_x.at2")
    assert record.dt == result.dt
    # eight digits
    expected = result.history("total_acceleration")[1, 0]
    np.testing.assert_allclose(record.acceleration, expected, rtol=5.01e-8)
    for kind in ("within", "outcrop"):
        expected = getattr(result, f"{kind}_acceleration")[0]
        back = read(f"r-motions/{kind}_x.at2").acceleration
        np.testing.assert_allclose(back, expected, rtol=5.01e-8)
    head = Path("r-motions/r0_x.at2").read_text().splitlines()[:2]
    assert head == ["fenics_hytf: A made-up scene", "r0 at (0.5, 24) m, x: total acceleration"]


def test_components_that_rounding_alone_moves_are_left_out(here, hytf):
    result = make_result(directions=("x", "y"))
    lapse = result.lapses[0]
    total = lapse.total_acceleration.copy()
    total[0, 1] = 1e-12 * total[0, 0]  # as at the middle of what is symmetric
    with open_result(Path("r")) as folder:
        folder.write(replace(result, lapses=(replace(lapse, total_acceleration=total),)))
    assert hytf("r", "r0", "r1")[0] == 0
    assert files("r-motions") == ["r0_x.at2", "r1_x.at2", "r1_y.at2"]


def test_a_motion_without_rock_has_no_outcrop(here, hytf):
    store(directions=("x", "y"))
    assert hytf("r", "r0")[0] == 0
    assert files("r-motions") == ["r0_x.at2", "r0_y.at2"]
    assert hytf("r", "within", "-o", "deep/er")[0] == 0
    assert files("deep/er") == ["within_x.at2", "within_y.at2"]
    code, _, err = hytf("r", "outcrop", "-o", "no")
    assert code == 2 and "expected one of r0, r1, r2, within" in err


@pytest.mark.parametrize(
    ("quantity", "letter", "head"),
    [
        ("displacement", "u", "r1 at (0.5, 16) m, x: displacement relative to the base [m]"),
        ("velocity", "v", "r1 at (0.5, 16) m, x: velocity relative to the base [m/s]"),
        ("acceleration", "a", "r1 at (0.5, 16) m, x: acceleration relative to the base [g]"),
        ("total_acceleration", "A", "r1 at (0.5, 16) m, x: total acceleration [g]"),
    ],
)
def test_every_quantity_as_csv(here, hytf, quantity, letter, head):
    store()
    assert hytf("r", "r1", "--format", "csv", "--quantity", quantity, "-o", ".")[0] == 0
    name = "r1_x.csv" if letter == "A" else f"r1_x_{quantity}.csv"
    assert files(".")[:1] == ["r/base.csv"] and name in files(".")
    lines = Path(name).read_text().splitlines()
    column = "acceleration" if letter in "aA" else quantity
    assert lines[:2] == [f"# {head}", f"time_s,{column}"]
    table = read_table(Path("r/receivers.csv"))
    values = np.loadtxt(name, delimiter=",", skiprows=2)
    np.testing.assert_allclose(values[:, 0], table["time_s"], rtol=1e-11)
    if letter in "aA":
        # as files of records are read: in g; division and multiplication
        np.testing.assert_allclose(read_csv(name).acceleration, table[f"r1.{letter}_x"], rtol=3e-16)
    else:
        np.testing.assert_array_equal(values[:, 1], table[f"r1.{letter}_x"])
        with pytest.raises(RecordError, match="give accelerations instead"):
            read_csv(name)


def test_relative_accelerations_as_at2(here, hytf):
    result = store()
    assert hytf("r", "--quantity", "acceleration")[0] == 0
    # nothing of the base: relative to itself it does not move
    assert files("r-motions") == [f"r{i}_x_acceleration.at2" for i in range(3)]
    back = read("r-motions/r0_x_acceleration.at2").acceleration
    np.testing.assert_allclose(back, result.history("acceleration")[0, 0], rtol=5.01e-8)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere",), ["nowhere: found no summary.json"]),
        (("r", "nix"), ["RECEIVER: found nix; expected one of r0, r1, r2, within"]),
        (("r", "--format", "xlsx"), ["--format: found xlsx; expected at2 or csv"]),
        (("r", "--quantity", "strain"), ["--quantity: found strain; expected displacement"]),
        (("r", "--quantity", "velocity"), ["--format: found at2 for a velocity; expected csv"]),
        (
            ("r", "within", "--format", "csv", "--quantity", "velocity"),
            ["RECEIVER: found within with velocity; expected total_acceleration"],
        ),
        (
            ("r", "a", "b", "--format", "f", "--quantity", "q"),
            ["--format: found f", "--quantity: found q", "found a;", "found b;"],
        ),
        (("r", "-o", "r/summary.json"), ["is no folder; expected a folder"]),
        (("r", "-o", "r/summary.json/below"), ["is no folder; expected a folder"]),
        ((), ["DIR"]),
    ],
    ids=str,
)
def test_wrong_input_is_2_and_writes_nothing(here, hytf, arguments, words):
    store()
    before = files(".")
    code, out, err = hytf(*arguments)
    assert (code, out) == (2, "")
    assert all(word in err for word in words), err
    assert files(".") == before and [p.name for p in here.iterdir()] == ["r"]


def test_files_that_are_there_need_force(here, hytf):
    store()
    assert hytf("r", "r0")[0] == 0
    Path("r-motions/r0_x.at2").write_text("mine")
    code, _, err = hytf("r")
    assert code == 2 and "found r0_x.at2 there" in err and "--force" in err
    assert files("r-motions") == ["r0_x.at2"]
    assert Path("r-motions/r0_x.at2").read_text() == "mine"
    assert hytf("r", "--force")[0] == 0
    assert len(files("r-motions")) == 4 and read("r-motions/r0_x.at2").num_samples == 240


def test_an_older_result_is_refused(here, hytf):
    store()
    path = Path("r/summary.json")
    path.write_text(path.read_text().replace(f'"format": {FORMAT}', f'"format": {FORMAT - 1}'))
    code, _, err = hytf("r")
    assert code == 2 and f"of format {FORMAT - 1}, this version reads {FORMAT}" in err
    assert not Path("r-motions").exists()


def test_a_receiver_whose_point_has_left_the_mesh(here, hytf):
    result = make_result(lapses=3)
    last = result.lapses[-1]
    lost = last.total_acceleration.copy()
    lost[1] = np.nan
    lapses = (*result.lapses[:-1], replace(last, total_acceleration=lost))
    with open_result(Path("r")) as folder:
        folder.write(replace(result, lapses=lapses))
    code, _, err = hytf("r")
    assert code == 2 and "for r1, whose point left the mesh" in err
    assert not Path("r-motions").exists()
    assert hytf("r", "r0", "r2", "within")[0] == 0


def test_a_scene_without_receivers_has_its_base(here, hytf):
    store(receivers=0, loop=False)
    assert hytf("r")[0] == 0
    assert files("r-motions") == ["within_x.at2"]
    code, _, err = hytf("r", "--quantity", "acceleration", "-o", "no")
    assert code == 2 and "found none that moves" in err


def test_a_full_disk_leaves_nothing(here, hytf, monkeypatch):
    store()

    def full(*_arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("fenics_hytf.cli.export.write_at2", full)
    code, _, err = hytf("r", "-o", "deep/er")
    assert code == 2 and "cannot be written" in err and "No space left" in err
    assert not Path("deep").exists()


def test_further_ranks_leave_it_to_the_first(here, hytf, monkeypatch):
    store()
    monkeypatch.setitem(os.environ, "OMPI_COMM_WORLD_RANK", "1")
    assert hytf("r")[0] == 0
    assert not Path("r-motions").exists()
