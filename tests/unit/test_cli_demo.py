# SPDX-License-Identifier: MIT
"""Demos: listed, copied with the files they refer to, run, and run again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fenics_hytf.cli import demos

SCENE = """
title = "A demo"
[mesh]
column = { width = 1.0, layers = [ { thickness = 8.0, soil = "sand", cells = 4 } ] }
[soil.sand]
density = 1800.0
shear_wave_velocity = 160.0
poisson = 0.3
damping = 0.05
[[motion]]
direction = "x"
file = "../records/sine.csv"
[boundary]
left = "tied"
right = "tied"
[output]
receivers = { top = [0.5, 8.0] }
"""
RECORD = "time_s,acceleration\n" + "".join(f"{0.1 * i:.1f},{i % 4}\n" for i in range(16))


@pytest.fixture
def here(tmp_path, monkeypatch):
    (tmp_path / "package/demos").mkdir(parents=True)
    (tmp_path / "package/records").mkdir()
    (tmp_path / "package/demos/sine.toml").write_text(SCENE)
    (tmp_path / "package/demos/other.toml").write_text('title = "Another"\n')
    (tmp_path / "package/demos/demo_sine.py").write_text("")
    (tmp_path / "package/records/sine.csv").write_text(RECORD)
    monkeypatch.setattr(demos, "demo_folder", lambda: tmp_path / "package/demos")
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_list_names_and_titles(here, hytf):
    assert hytf("demo") == (0, "other  Another\nsine   A demo\n", "")


def test_a_demo_is_copied_with_its_files_and_run(here, hytf):
    code, out, err = hytf("demo", "sine", "--no-plots")
    assert code == 0, err
    assert "A demo" in out
    assert names(here) == ["sine-result", "sine.csv", "sine.toml"]
    assert Path("sine.csv").read_text() == RECORD
    # the copy refers to its neighbour; nothing else is changed
    assert Path("sine.toml").read_text() == SCENE.replace("../records/sine.csv", "sine.csv")
    assert hytf("run", "sine.toml", "-o", "again", "--no-plots")[0] == 0


def test_a_demo_can_be_run_twice(here, hytf):
    for _ in range(2):
        code, _, err = hytf("demo", "sine", "--no-plots")
        assert code == 0, err


def test_the_result_of_something_else_is_not_overwritten(here, hytf):
    assert hytf("demo", "sine", "--no-plots", "--set", "soil.sand.damping=0.1")[0] == 0
    written = Path("sine-result/summary.json").stat().st_mtime_ns
    code, _, err = hytf("demo", "sine", "--no-plots")
    assert code == 2 and "--force" in err
    assert Path("sine-result/summary.json").stat().st_mtime_ns == written
    assert hytf("demo", "sine", "--no-plots", "--force")[0] == 0


@pytest.mark.parametrize("name", ["sine.toml", "sine.csv"])
def test_another_file_of_that_name_is_never_overwritten(here, hytf, name):
    Path(name).write_text("mine")
    code, out, err = hytf("demo", "sine", "--force")
    assert (code, out) == (2, "") and name in err and "Traceback" not in err
    assert names(here) == [name] and Path(name).read_text() == "mine"


@pytest.mark.parametrize(
    "arguments",
    [
        ("nothing",),
        ("sine", "--motion", "nowhere.at2"),
        ("sine", "--set", "title=1"),
        ("other",),
    ],
)
def test_faults_write_nothing(here, hytf, arguments):
    code, out, err = hytf("demo", *arguments)
    assert (code, out) == (2, "") and err and "Traceback" not in err
    assert names(here) == []


def test_another_motion(here, hytf):
    Path("mine.csv").write_text(RECORD.replace(",3", ",5"))
    assert hytf("demo", "sine", "--motion", "mine.csv", "--no-plots", "-o", "r")[0] == 0
    summary = json.loads(Path("r/summary.json").read_text())
    assert "mine" in summary["motions"][0]["name"]


def test_a_demo_is_gone_on_with_until_it_is_finished(here, hytf):
    code, _, err = hytf("demo", "sine", "--resume", "--no-plots")
    assert code == 0 and "starting at the first lapse" in err
    code, out, err = hytf("demo", "sine", "--resume")
    assert (code, out) == (0, "") and "finished already" in err
    code, out, err = hytf("demo", "sine", "--resume", "--set", "soil.sand.damping=0.04")
    assert (code, out) == (2, "") and "found a finished result" in err


def test_demos_are_found_beside_the_package():
    assert demos.demo_folder().name == "demos"
