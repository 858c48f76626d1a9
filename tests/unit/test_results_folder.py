# SPDX-License-Identifier: MIT
"""Who may write to a result folder, when it is finished, what stays after trouble."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from support.results_builder import make_result, make_snapshot

from fenics_hytf.motion.files import replace_file
from fenics_hytf.results import (
    ResultError,
    folder_faults,
    locked,
    open_result,
    publish,
    read_result,
)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_finished_is_refused_without_force(tmp_path):
    with open_result(tmp_path / "r") as folder:
        folder.write(make_result())
    before = names(tmp_path / "r")
    assert "summary.json" in folder_faults(tmp_path / "r", force=False)[0]
    with pytest.raises(ResultError, match="--force"):
        open_result(tmp_path / "r")
    assert names(tmp_path / "r") == before
    assert folder_faults(tmp_path / "r", force=True) == []


def test_every_file_of_a_run_goes_when_it_is_replaced(tmp_path):
    with open_result(tmp_path / "r") as folder:
        folder.snapshot(make_snapshot())
        folder.write(make_result(kind="box", compliant=True, receivers=1), publish)
    assert {"base_x.png", "fourier_x.png", "section.png"} <= set(names(tmp_path / "r"))
    with open_result(tmp_path / "r", force=True) as folder:
        folder.snapshot(make_snapshot(index=9, fields=False))
        assert names(tmp_path / "r") == [".hytf.lock", "points_0009.vtu"]


def test_force_touches_nothing_before_it_writes(tmp_path):
    with open_result(tmp_path / "r") as folder:
        folder.snapshot(make_snapshot(index=5))
        folder.write(make_result(lapses=3))
    (tmp_path / "r/notes.txt").write_text("mine")
    before = names(tmp_path / "r")
    with open_result(tmp_path / "r", force=True):
        pass
    assert names(tmp_path / "r") == before
    with open_result(tmp_path / "r", force=True) as folder:
        folder.snapshot(make_snapshot(index=0))
        # no longer finished once a part of it is new
        assert names(tmp_path / "r") == [
            ".hytf.lock",
            "fields_0000.vtu",
            "notes.txt",
            "points_0000.vtu",
        ]
        folder.write(make_result())
    assert "points_0005.vtu" not in names(tmp_path / "r")
    assert "notes.txt" in names(tmp_path / "r")


def test_a_second_run_is_refused_while_one_writes(tmp_path):
    script = "import sys, pathlib; from fenics_hytf.results import open_result; "
    script += "open_result(pathlib.Path(sys.argv[1]), force=True)"
    with open_result(tmp_path / "r") as folder:
        folder.snapshot(make_snapshot())
        with pytest.raises(ResultError, match="another run"):
            open_result(tmp_path / "r", force=True)
        command = [sys.executable, "-c", script, str(tmp_path / "r")]
        other = subprocess.run(command, capture_output=True, text=True, check=False)
        assert other.returncode == 1 and "another run is writing there" in other.stderr
        assert names(tmp_path / "r") == [".hytf.lock", "fields_0000.vtu", "points_0000.vtu"]
    open_result(tmp_path / "r").close()


def test_a_lock_left_by_a_killed_run_does_not_hold(tmp_path):
    (tmp_path / ".hytf.lock").write_text("")
    open_result(tmp_path).close()
    assert names(tmp_path) == []


def test_an_empty_folder_that_was_made_goes_again(tmp_path):
    with open_result(tmp_path / "a/b/c"):
        assert names(tmp_path / "a/b/c") == [".hytf.lock"]
    assert names(tmp_path) == []
    (tmp_path / "mine").mkdir()
    with open_result(tmp_path / "mine"):
        pass
    assert names(tmp_path) == ["mine"]


def test_places_that_cannot_be_folders(tmp_path):
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file", tmp_path / "file/below"):
        assert "no folder" in folder_faults(place, force=True)[0]
        with pytest.raises(ResultError, match="no folder"):
            open_result(place)
    with pytest.raises(ResultError, match="cannot be written"):
        open_result(tmp_path / ("x" * 300))
    assert names(tmp_path) == ["file"]


def test_summary_is_last_and_whole(tmp_path):
    seen = []

    def look(folder, summary):
        seen.append(names(folder))
        assert summary["title"] == "A made-up scene"

    with open_result(tmp_path / "r") as folder:
        folder.write(make_result(), look)
    assert "summary.json" not in seen[0]
    tables = {"receivers.csv", "base.csv", "transfer.csv", "spectra.csv", "cells.csv"}
    assert tables <= set(seen[0])
    assert "summary.json" in names(tmp_path / "r")
    assert not [name for name in names(tmp_path / "r") if name.startswith(".")]


def test_a_result_is_finished_even_if_its_figures_fail(tmp_path):
    def fail(folder, summary):
        raise KeyError("a bug in a figure")

    with open_result(tmp_path / "r") as folder, pytest.raises(KeyError):
        folder.write(make_result(), fail)
    assert read_result(tmp_path / "r").summary["title"] == "A made-up scene"


def test_partial_results_are_not_finished(tmp_path):
    with open_result(tmp_path / "r") as folder:
        folder.write_partial(make_result(lapses=3))
    assert "partial-summary.json" in names(tmp_path / "r")
    assert folder_faults(tmp_path / "r", force=False) == []
    with pytest.raises(ResultError, match=r"no summary\.json"):
        read_result(tmp_path / "r")
    with open_result(tmp_path / "r") as folder:
        folder.write(make_result())
    assert "partial-summary.json" not in names(tmp_path / "r")


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "summary.json"
    replace_file(path, "old")
    monkeypatch.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(OSError(28, "full")))
    with pytest.raises(OSError, match="full"):
        replace_file(path, "new")
    assert path.read_text() == "old"
    assert names(tmp_path) == ["summary.json"]


def test_unreadable_results_are_refused(tmp_path):
    with pytest.raises(ResultError, match=r"no summary\.json"):
        publish(tmp_path / "nowhere")
    with open_result(tmp_path / "r") as folder:
        folder.write(make_result())
    text = (tmp_path / "r/summary.json").read_text()
    for broken in ("{", "[]", json.dumps({**json.loads(text), "format": 99})):
        (tmp_path / "r/summary.json").write_text(broken)
        with pytest.raises(ResultError, match="cannot be read"):
            read_result(tmp_path / "r")
    old = json.dumps({**json.loads(text), "format": 4})
    (tmp_path / "r/summary.json").write_text(old)
    with pytest.raises(ResultError, match=r"of format 4, this version reads 5.*Run the scene"):
        publish(tmp_path / "r")
    (tmp_path / "r/summary.json").write_text(text)
    (tmp_path / "r/cells.csv").write_text("lapse,cell\n1\n")
    with pytest.raises(ResultError, match="do not fit"):
        read_result(tmp_path / "r")


def test_locked_needs_a_finished_result(tmp_path):
    with pytest.raises(ResultError, match=r"no summary\.json"), locked(tmp_path):
        pass
    assert names(tmp_path) == []
    with open_result(tmp_path / "r") as folder:
        folder.write(make_result())
    with locked(tmp_path / "r"), pytest.raises(ResultError, match="another run"):
        open_result(tmp_path / "r", force=True)
    assert ".hytf.lock" not in names(tmp_path / "r")
