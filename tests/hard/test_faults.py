# SPDX-License-Identifier: MIT
"""What a machine does to a run: full disks, locked folders, signals, lost ranks, clocks, streams.

Each ends as the README says: a message that names what is wrong and what to do, an exit code, and
a folder from which ``--resume`` gives what a run would have given that nothing befell. Kills and
restarts are in ``test_interruptions.py``; what a checkpoint file stands is in
``unit/test_checkpoint.py``.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from fenics_hytf.cli.progress import Estimate
from fenics_hytf.results import open_result
from fenics_hytf.simulation import Progress
from fenics_hytf.simulation.checkpoint import read_checkpoint
from tests.hard.test_interruptions import same_files
from tests.unit.results_builder import make_result

COLUMN = """
title = "A column"
[mesh]
column = { width = 1.0, layers = [ { thickness = 8.0, soil = "sand", cells = 4 } ] }
[soil.sand]
density = 1800.0
shear_wave_velocity = 160.0
poisson = 0.3
damping = 0.05
[[motion]]
direction = "x"
synthetic = { n = 48, dt = 0.04 }
[boundary]
left = "tied"
right = "tied"
[lapses]
count = 2
[effects]
convection = true
[output]
receivers = { top = [0.5, 8.0] }
fields = true
"""
STATE = Path("s-result/checkpoint/state.npz")
RUN = ("run", "s.toml", "--no-plots")
HYTF = [sys.executable, "-m", "fenics_hytf.cli"]
FOLDER = "s-result"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"):
        monkeypatch.delenv(name, raising=False)
    Path("s.toml").write_text(COLUMN)
    return tmp_path


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> str:
    """The result of the run that nothing befell."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "s.toml").write_text(COLUMN)
    subprocess.run([*HYTF, *RUN, "--quiet"], cwd=folder, check=True)
    return str(folder / FOLDER)


def told(error: str) -> str:
    """What was said after lines of progress: one line, no traceback."""
    assert "Traceback" not in error
    (line,) = [line for line in error.splitlines() if line.startswith("hytf: ")]
    return line


# ---------------------------------------------------------------- a full disk


class Disk:
    """A disk that is full for one of the files below a folder that are opened or put in place."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.full_at, self.count = str(folder), 0, 0
        self.full_for, self.names = "", list[str]()

    def __call__(self, event: str, arguments: tuple) -> None:
        if event == "open":
            path, _, flags = arguments
            if not isinstance(flags, int) or not flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT):
                return
        elif event == "os.rename":
            path = arguments[1]
        elif event == "os.mkdir":
            path = arguments[0]
        else:
            return
        if isinstance(path, int) or not os.path.abspath(os.fsdecode(path)).startswith(self.folder):
            return
        name = os.path.basename(os.fsdecode(path))
        self.count += 1
        self.names.append(name)
        if self.count == self.full_at or name == self.full_for:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), os.fsdecode(path))


_disks: list[Disk] = []


def _hook(event: str, arguments: tuple) -> None:
    for disk in _disks:
        disk(event, arguments)


@pytest.fixture
def disk(here):
    """Watches, and stops, what is written: by an audit hook, which stays but does nothing after."""
    if not hasattr(sys, "_hytf_audited"):
        sys.addaudithook(_hook)
        sys._hytf_audited = True
    watching = Disk(here)
    _disks.append(watching)
    yield watching
    _disks.clear()


def test_a_disk_that_is_full_for_any_one_file_of_a_run(here, whole, hytf, disk):
    """Each file of a run once. Naively half a table passes for a whole one, or a traceback ends."""
    assert hytf(*RUN, "--quiet", "-o", "counted")[0] == 0
    names = list(disk.names)
    assert {"receivers.csv", "summary.json", "state.npz", "points_0001.vtu"} <= set(names)
    codes = []
    for number in range(1, len(names) + 1):
        out = ("-o", f"full{number}")
        disk.count, disk.full_at, disk.names = 0, number, []
        code, out_said, error = hytf(*RUN, "--quiet", *out)
        disk.full_at = 0
        stopped = disk.names[number - 1].lstrip(".").removesuffix(".part")
        codes.append((code, stopped))
        assert out_said == "" and "No space left on device" in told(error), stopped
        folder = Path(out[1])
        if code == 2:  # the folder itself, or its lock: nothing has begun
            assert not folder.exists()
            continue
        assert code == 3 and stopped in told(error), told(error)
        assert not (folder / "summary.json").exists()
        left = [p.name for p in folder.rglob(".*")] if folder.exists() else []
        assert left == []
        if (folder / "checkpoint").exists():
            assert read_checkpoint(folder / "checkpoint") is not None
        assert hytf(*RUN, "--quiet", *out, "--resume")[0] == 0
        assert same_files(whole, out[1]) > 0
    assert [code for code, _ in codes].count(2) == 2


@pytest.mark.parametrize("kilobytes", [0, 2, 6, 12])
def test_files_that_find_no_more_room_than_this(here, whole, hytf, kilobytes):
    """A limit of the size of files: every output is begun, and cut short where it grows too long."""
    with at_most(1024 * kilobytes):
        code, out, error = hytf(*RUN, "--quiet")
    assert (code, out) == (3, "") and "File too large" in told(error)
    assert re.search(r"s-result/[\w/]+\.(npz|vtu|csv|json)", told(error)), told(error)
    assert not Path(FOLDER, "summary.json").exists()
    assert hytf(*RUN, "--quiet", "--resume")[0] == 0
    assert same_files(whole, FOLDER) > 0


@contextlib.contextmanager
def at_most(size: int):
    """No file grows beyond a size [bytes]."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("file", ["profiles.png", "report.html"])
def test_a_disk_that_is_full_for_a_figure_or_the_report(here, hytf, disk, file):
    """The run is not finished then: gone on with, it writes tables and figures again."""
    disk.full_for = f".{file}"
    code, out, error = hytf("run", "s.toml", "--quiet")
    assert (code, out) == (3, "") and file in told(error) and "No space left" in told(error)
    assert STATE.exists() and not Path(FOLDER, "summary.json").exists()
    disk.full_for = ""
    assert hytf("run", "s.toml", "--quiet", "--resume")[0] == 0
    assert Path(FOLDER, file).exists() and Path(FOLDER, "summary.json").exists()


def test_a_figure_that_cannot_be_drawn_again_stays_as_it_was(here, hytf):
    with open_result(Path(FOLDER)) as folder:
        folder.write(make_result())
    Path(FOLDER, "profiles.png").write_bytes(b"as it was")
    with at_most(1000):
        code, out, error = hytf("plot", FOLDER)
    assert (code, out) == (2, "") and "File too large" in told(error) and ".png" in told(error)
    assert Path(FOLDER, "profiles.png").read_bytes() == b"as it was"
    assert not list(Path(FOLDER).glob(".*"))
