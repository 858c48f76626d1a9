# SPDX-License-Identifier: MIT
"""Disks that are full, for any file of a run.

Naively a file is left half written, and a traceback names none.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import resource
import sys
from pathlib import Path

import pytest
from support.restart import other_files
from support.results_builder import make_result
from support.small_run import FOLDER, RUN, STATE, told

from fenics_hytf.results import open_result
from fenics_hytf.simulation.checkpoint import read_checkpoint


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
    codes, kept = [], {}
    for number in range(1, len(names) + 1):
        out = ("-o", f"full{number}")
        disk.count, disk.full_at, disk.names = 0, number, []
        code, out_said, error = hytf(*RUN, "--quiet", *out)
        disk.full_at = 0
        stopped = disk.names[number - 1].lstrip(".")
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
        lapse = None
        if (folder / "checkpoint").exists():
            lapse = read_checkpoint(folder / "checkpoint").lapse
        kept[lapse] = out  # the last one with this checkpoint: most is left beside it
    assert kept.keys() == {None, 0, 1}
    for out in kept.values():
        assert hytf(*RUN, "--quiet", *out, "--resume")[0] == 0
        assert other_files(whole, out[1]) == 0
    assert [code for code, _ in codes].count(2) == 2


@pytest.mark.parametrize("kilobytes", [0, 2, 6, 12])
def test_files_that_find_no_more_room_than_this(here, whole, hytf, kilobytes):
    """A limit of the size of files: every output is begun, and some are cut short."""
    with at_most(1024 * kilobytes):
        code, out, error = hytf(*RUN, "--quiet")
    assert (code, out) == (3, "") and "File too large" in told(error)
    assert re.search(r"s-result/[\w/]+\.(npz|vtu|csv|json)", told(error)), told(error)
    assert not Path(FOLDER, "summary.json").exists()
    assert hytf(*RUN, "--quiet", "--resume")[0] == 0
    assert other_files(whole, FOLDER) == 0


@contextlib.contextmanager
def at_most(size: int):
    """No file grows beyond a size [bytes]."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_disk_that_is_full_for_a_figure_or_the_report(here, hytf, disk):
    """The run is not finished then: gone on with, it writes tables and figures again."""
    for file, resume in (("profiles.png", ()), ("report.html", ("--resume",))):
        disk.full_for = f".{file}"
        code, out, error = hytf("run", "s.toml", "--quiet", *resume)
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
