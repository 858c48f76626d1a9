# SPDX-License-Identifier: MIT
"""``hytf accuracy``: what it writes, says and refuses, and how it can end."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fenics_hytf.cli import accuracy
from fenics_hytf.simulation import simulate
from fenics_hytf.study import StudyProgress, time_domain
from fenics_hytf.study.runs import Cost, Outcome

SCENE = """
title = "A column"
[mesh]
column = { width = 1.0, layers = [ { thickness = 8.0, soil = "sand", cells = 2 } ] }
[soil.sand]
density = 1800.0
shear_wave_velocity = 160.0
poisson = 0.3
damping = 0.05
[[motion]]
direction = "x"
synthetic = { n = 128, dt = 0.02 }
[boundary]
left = "tied"
right = "tied"
[solver]
max_frequency = 10.0
[output]
receivers = { top = [0.5, 8.0] }
"""


@pytest.fixture
def here(here):
    Path("s.toml").write_text(SCENE)
    return here


@pytest.fixture
def at_hand(monkeypatch):
    """Runs without processes, counted; and no twin."""
    done = []

    def run(job, limit=None):
        before()
        done.append(job)
        result = simulate(job.scene)
        cells = sum(layer.cells for layer in job.scene.mesh.column.layers)
        cost = Cost(0.01 * cells, 0.01 * cells, result.work.factorisations, 1, 2**20, 1, cells)
        return Outcome(cost, result.history("total_acceleration"))

    def processes(folder, guard):
        nonlocal before
        before = guard
        folder.mkdir(parents=True, exist_ok=True)
        return run

    before = lambda: None  # noqa: E731
    monkeypatch.setattr(accuracy, "Processes", processes)
    monkeypatch.setattr(time_domain, "compare", lambda *_: time_domain.nothing("not here"))
    return done


def test_a_study_is_written_and_told(here, hytf, at_hand):
    code, out, err = hytf("accuracy", "s.toml")
    assert code == 0, err
    assert "A column" in out and "closed form" in out and "mesh size alone" in out
    assert "bottleneck" in out and "5 %: cheapest is" in out
    assert "run 1 of about" in err and err.count("\n") == len(at_hand)
    folder = here / "s-accuracy"
    assert {p.name for p in folder.iterdir()} == {
        "accuracy.csv",
        "accuracy.json",
        "accuracy.png",
        "runs",
    }
    with open(folder / "accuracy.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(at_hand)
    own = next(row for row in rows if "own" in row["why"].split())
    assert float(own["core_s"]) == pytest.approx(0.02) and own["set"] == ""
    assert float(own["error_percent"]) > 0 and own["worst_receiver"] == "top"
    record = json.loads((folder / "accuracy.json").read_text())
    assert record["complete"] and all(sentence in out for sentence in record["sentences"])
    assert (folder / "accuracy.png").read_bytes()[:4] == b"\x89PNG"


def test_quiet_says_nothing(here, hytf, at_hand):
    assert hytf("accuracy", "s.toml", "--quiet", "-o", "deep/er") == (0, "", "")
    assert (here / "deep/er/accuracy.csv").exists()


def test_overrides_reach_the_scene(here, hytf, at_hand):
    assert hytf("accuracy", "s.toml", "--set", "solver.sweep=direct", "--quiet")[0] == 0
    assert at_hand[0].scene.solver.sweep == "direct"


def test_a_motion_of_zeros_is_wrong_input(here, hytf, at_hand):
    rows = "".join(f"{0.02 * k},0.0\n" for k in range(64))
    (here / "zeros.csv").write_text("time_s,acceleration\n" + rows)
    code, out, err = hytf("accuracy", "s.toml", "--motion", "zeros.csv")
    assert (code, out) == (2, "") and "motion: found none but zeros" in err
    assert not (here / "s-accuracy").exists()


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["--set", "solver.swep=direct"], "swep"),
        (["--set", "output.receivers={}"], "output.receivers: found none"),
        (["--set", "output.receivers.top=[9.0,9.0]"], "output.receivers.top"),
        (["--budget", "0"], "--budget"),
        (["-o", "s.toml"], "is no folder"),
    ],
)
def test_wrong_input_writes_nothing(here, hytf, at_hand, arguments, said):
    code, out, err = hytf("accuracy", "s.toml", *arguments)
    assert (code, out) == (2, "") and said in err and "Traceback" not in err
    assert [p.name for p in here.iterdir()] == ["s.toml"] and not at_hand


def test_a_result_is_not_written_over(here, hytf, at_hand):
    (here / "r").mkdir()
    (here / "r/summary.json").write_text("{}")
    code, _, err = hytf("accuracy", "s.toml", "-o", "r")
    assert code == 2 and "finished result" in err and not at_hand


def test_under_mpirun_it_is_refused(here, hytf, monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    code, out, err = hytf("accuracy", "s.toml")
    assert (code, out) == (2, "") and "without" in err and len(err.splitlines()) == 1
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    assert hytf("accuracy", "s.toml") == (2, "", "")


def test_the_budget_ends_a_study_that_is_told_so_far(here, hytf, at_hand, monkeypatch):
    passed = iter(range(1000))
    monkeypatch.setattr(accuracy.time, "monotonic", lambda: float(next(passed)))
    code, _, _ = hytf("accuracy", "s.toml", "--budget", "9", "--quiet")
    assert code == 0 and len(at_hand) == 8
    assert not json.loads((here / "s-accuracy/accuracy.json").read_text())["complete"]


def test_a_scene_that_stops_ends_with_three(here, hytf, monkeypatch):
    failing = lambda job, limit=None: Outcome(None, None, "no luck")  # noqa: E731
    monkeypatch.setattr(accuracy, "Processes", lambda folder, guard: failing)
    code, out, err = hytf("accuracy", "s.toml")
    assert (code, out) == (3, "") and "stopped: the scene itself cannot be run: no luck" in err
    assert not (here / "s-accuracy/accuracy.csv").exists()


def test_force_starts_anew(here, hytf, at_hand):
    kept = here / "s-accuracy/runs/kept.json"
    kept.parent.mkdir(parents=True)
    kept.write_text("")
    hytf("accuracy", "s.toml", "--quiet")
    assert kept.exists()
    hytf("accuracy", "s.toml", "--quiet", "--force")
    assert not kept.exists()


def test_progress_on_a_terminal():
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    stream = Terminal()
    with accuracy.show_progress(False, stream) as callback:
        callback(StudyProgress(6, 12, "cells ×2"))
    assert "run 7 of about 12" in stream.getvalue() and "cells ×2" in stream.getvalue()


def test_interrupted_it_keeps_what_is_done_and_goes_on(here):
    """For real: a signal between two runs, and the same command again."""
    command = [sys.executable, "-m", "fenics_hytf.cli", "accuracy", "s.toml"]
    runs = here / "s-accuracy" / "runs"
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        deadline = time.monotonic() + 120
        while len(list(runs.glob("[!.]*.json"))) < 2:
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    assert not list(runs.glob(".run-*")) and not (here / "s-accuracy/accuracy.csv").exists()
    kept = {path: path.stat().st_mtime_ns for path in runs.glob("[!.]*.json")}
    assert len(kept) >= 2
    budget = [*command, "--budget", "3"]
    again = subprocess.run(budget, capture_output=True, text=True, timeout=200, env=os.environ)
    assert again.returncode == 0, again.stderr
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert "the same command goes on from here" in again.stdout
