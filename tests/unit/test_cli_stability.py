# SPDX-License-Identifier: MIT
"""``hytf stability``: what it writes, says and refuses, and how it can end."""

from __future__ import annotations

import numpy as np
import pytest

from fenics_hytf.cli import stability
from fenics_hytf.study import StudyProgress
from fenics_hytf.study.stability.records import LAPSES, StabilityRun
from fenics_hytf.study.stability.verdicts import Verdict

WHERE = {
    "path": "falls",
    "lapse_times_max_frequency": 10.0,
    "damping": 0.05,
    "modulus_left": 1.0,
    "eta_lapse": 2.3,
}
RUNS = [
    StabilityRun(LAPSES, WHERE, {"error": 1e-4}, Verdict.CONVERGES, 0.1),
    StabilityRun(LAPSES, WHERE | {"eta_lapse": 6.9}, {"error": np.inf}, Verdict.BLOWS_UP, 0.1),
]


@pytest.fixture
def two_runs(monkeypatch):
    """Maps of two runs, made at once."""
    made = []

    def conduct(progress):
        made.append(progress)
        for done, run in enumerate(RUNS):
            if progress is not None:
                progress(StudyProgress(done, 2, "lapses of 10 periods"))
            yield [run]

    monkeypatch.setattr(stability, "conduct_stability", conduct)
    return made


def test_maps_are_written_and_told(here, hytf, two_runs):
    code, out, err = hytf("stability")
    assert code == 0, err
    assert "2 runs: 1 converge, 1 blow up" in out and "stability.csv" in out
    assert "run 1 of about 2: lapses of 10 periods" in err
    written = {path.name for path in (here / "stability").iterdir()}
    assert written == {"stability.csv", "stability_lapses.png"}
    rows = (here / "stability/stability.csv").read_text().splitlines()
    assert len(rows) == 3 and rows[1].startswith("lapses,falls,10,0.05,1,2.3,")
    assert ",inf," in rows[2] and ",blows up," in rows[2]


def test_quiet_says_nothing_and_writes_where_it_is_told(here, hytf, two_runs):
    assert hytf("stability", "--quiet", "-o", "deep/er") == (0, "", "")
    assert (here / "deep/er/stability.csv").exists()


def test_maps_are_not_replaced_unless_forced(here, hytf, two_runs):
    hytf("stability", "--quiet")
    table = here / "stability/stability.csv"
    table.write_text("kept")
    code, out, err = hytf("stability")
    assert (code, out) == (2, "") and "found stability maps" in err and "--force" in err
    assert table.read_text() == "kept" and len(two_runs) == 1
    assert hytf("stability", "--quiet", "--force")[0] == 0
    assert table.read_text() != "kept"


def test_a_finished_result_is_not_a_place_for_maps(here, hytf, two_runs):
    (here / "result").mkdir()
    (here / "result/summary.json").write_text("{}")
    code, out, err = hytf("stability", "-o", "result")
    assert (code, out) == (2, "") and "summary.json" in err and not two_runs


def test_a_file_is_not_a_folder(here, hytf, two_runs):
    (here / "file").write_text("")
    code, _, err = hytf("stability", "-o", "file")
    assert code == 2 and "is no folder" in err and not two_runs


def test_under_mpirun_it_is_refused(here, hytf, two_runs, monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    code, _, err = hytf("stability")
    assert code == 2 and "found mpirun" in err and not two_runs


def test_interrupted_it_leaves_a_table_of_what_is_done_and_no_figure(here, hytf, monkeypatch):
    """Minutes of runs are not lost, and half a map is not drawn."""

    def stopped(progress):
        yield RUNS[:1]
        raise KeyboardInterrupt("interrupted")

    monkeypatch.setattr(stability, "conduct_stability", stopped)
    for again in ((), ("--quiet", "--force")):
        assert hytf("stability", *again)[0] == 130
        assert [path.name for path in (here / "stability").iterdir()] == ["stability.csv"]
        _, row = (here / "stability/stability.csv").read_text().splitlines()
        assert row.startswith("lapses,falls,10,")
