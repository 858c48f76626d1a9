# SPDX-License-Identifier: MIT
"""What a machine does to a run: locked folders, damaged checkpoints, clocks, streams.

Each ends as the README says: a message that names what is wrong and what to do, an exit code, and
a folder from which ``--resume`` gives what a run would have given that nothing befell. Kills and
restarts are in ``test_interruptions.py``, full disks in ``test_full_disks.py``, signals in
``test_lost_ranks.py``; what a checkpoint file stands is in ``unit/test_checkpoint.py``.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support.restart import other_files
from support.small_run import COLUMN, FOLDER, HYTF, RUN, STATE, out_of_memory, told

from fenics_hytf.cli.progress import Estimate
from fenics_hytf.results import open_result
from fenics_hytf.simulation import Progress

# As root without its powers, or as the user that tests run as: then permissions hold.
POWERLESS = [] if os.geteuid() else ["setpriv", "--bounding-set=-all", "--inh-caps=-all"]

PLACES = """
import io, json, os, pathlib, sys
from contextlib import redirect_stderr, redirect_stdout
from fenics_hytf.cli import main
said = {}
def call(name, *arguments):
    out, error = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(error):
        try:
            main([str(a) for a in arguments])
        except SystemExit as stop:
            code = stop.code
    said[name] = code, out.getvalue(), error.getvalue()
run = ("run", "s.toml", "--quiet", "--no-plots", "-o")
P = pathlib.Path
here = P.cwd()
P("locked").mkdir(); P("locked").chmod(0o555)
call("a folder", *run, "locked")
call("a parent", *run, "locked/a/b")
P("file").write_text("")
call("a file in its place", *run, "file")
call("a file above", *run, "file/a")
call("parents are made", *run, "new/a/b")
P("new/a/b").chmod(0o555)
call("a finished result", *run, "new/a/b", "--force")
call("its figures", "plot", "new/a/b")
P("new/a/b").chmod(0o755)
for file in P("new/a/b").iterdir():
    file.chmod(0o444)
call("read-only files are replaced", *run, "new/a/b", "--force")
P("new/a/b/summary.json").chmod(0)
call("an unreadable summary", "plot", "new/a/b")
P("round").symlink_to("round")
call("a link to itself", *run, "round")
call("below a link to itself", *run, "round/a")
P("nowhere").symlink_to("gone/away")
call("a link to nowhere", *run, "nowhere")
for name, text in {"s": None, "record.csv": "0.1\\n0.2\\n", "mesh.msh": "$MeshFormat"}.items():
    path = P("s.toml" if text is None else name)
    if text:
        path.write_text(text)
    path.chmod(0)
call("the scene", *run, "r")
P("s.toml").chmod(0o644)
call("a record", *run, "r", "--motion", "record.csv")
text = P("s.toml").read_text()
start, end = text.index("column ="), text.index("[soil.sand]")
P("m.toml").write_text(text[:start] + 'file = "mesh.msh"\\n' + text[end:])
call("a mesh", "run", "m.toml", "-o", "r")
P("dir.toml").mkdir()
call("a folder for a scene", "run", "dir.toml")
P("cwd").mkdir(); os.chdir("cwd"); P("../cwd").chmod(0)
call("where one stands", "run", here / "s.toml", "--quiet", "--no-plots")
call("elsewhere from there", "run", here / "s.toml", "--quiet", "--no-plots", "-o", here / "x")
os.chdir(here); P("cwd").chmod(0o755); os.chdir("cwd"); P("../cwd").rmdir()
call("where nothing is any more", "run", "../s.toml", "--quiet", "--no-plots")
call("a demo there", "demo", "column")
os.chdir(here)
said["left"] = sorted(p.name for p in here.iterdir())
print(json.dumps(said))
"""


def test_what_may_not_be_written_or_read_is_named(here):
    """As an unprivileged user: a read-only file system is one that nobody may write to."""
    done = subprocess.run(
        [*POWERLESS, sys.executable, "-c", PLACES], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert not {"r", "s-result", "m-result"} & set(said.pop("left"))
    for name in ("parents are made", "read-only files are replaced", "elsewhere from there"):
        assert said.pop(name) == [0, "", ""], name
    names = {
        "a folder": "locked",
        "a parent": "locked",
        "a file in its place": "file",
        "a file above": "file",
        "a finished result": "new/a/b",
        "its figures": "new/a/b",
        "an unreadable summary": "summary.json",
        "a link to itself": "round",
        "below a link to itself": "round",
        "a link to nowhere": "nowhere",
        "the scene": "s.toml",
        "a record": "record.csv",
        "a mesh": "mesh.msh",
        "a folder for a scene": "dir.toml",
        "where one stands": "s-result",
        "where nothing is any more": "the folder one stands in",
        "a demo there": "the folder one stands in",
    }
    assert said.keys() == names.keys()
    for name, (code, out, error) in said.items():
        refused = name in ("the scene", "a record")  # before anything is loaded
        words = " ".join(error.split("│")) if refused else told(error)
        assert (code, out) == (2, "") and names[name] in words, (name, code, error)
        assert not refused or "is not readable" in words


# ---------------------------------------------------------------- damaged checkpoints


@pytest.fixture
def unfinished(here, hytf) -> bytes:
    """The checkpoint of a run that was lost in its second lapse; its folder is gone."""
    with out_of_memory():
        assert hytf(*RUN, "--quiet")[0] == 3
    content = STATE.read_bytes()
    shutil.rmtree(FOLDER)
    return content


def test_a_checkpoint_that_is_damaged_anywhere_is_refused(here, hytf, unfinished):
    """Cut anywhere, any bit turned, bytes put in: by the digest, before anything of it is used."""
    STATE.parent.mkdir(parents=True)
    random, size = np.random.default_rng(4), len(unfinished)
    cuts = [unfinished[:end] for end in (0, 1, size - 1, *random.integers(2, size - 1, 6))]
    turned = [bytearray(unfinished) for _ in range(8)]
    for content, bit in zip(turned, random.integers(0, 8 * size, 8), strict=True):
        content[bit // 8] ^= 1 << bit % 8
    longer = [unfinished + b"0", b"0" + unfinished, unfinished + unfinished]
    for content in (*cuts, *turned, *longer):
        STATE.write_bytes(content)
        code, out, error = hytf(*RUN, "--quiet", "--resume")
        assert (code, out) == (2, "") and "damaged or cut short" in told(error)
        assert "--force" in told(error) and STATE.read_bytes() == content
    STATE.write_bytes(unfinished)
    assert hytf(*RUN, "--quiet", "--resume")[0] == 0


def test_a_checkpoint_that_is_a_folder_or_of_another_scene_is_refused(here, hytf, unfinished):
    STATE.mkdir(parents=True)
    code, _, error = hytf(*RUN, "--quiet", "--resume")
    assert code == 2 and "cannot be read (Is a directory)" in told(error)
    STATE.rmdir()
    STATE.write_bytes(unfinished)
    Path("s.toml").write_text(COLUMN.replace("160.0", "170.0"))
    code, _, error = hytf(*RUN, "--quiet", "--resume")
    assert code == 2 and "soil.sand.shear_wave_velocity: found 170.0; expected 160.0" in error


# ---------------------------------------------------------------- clocks, locks, streams


@pytest.mark.parametrize(
    "clock",
    [lambda n: 1e9, lambda n: 2e9 - 1e7 * n, lambda n: 1e9 * (n % 2)],
    ids=["same", "back", "leaps"],
)
def test_a_clock_that_is_put_back_or_stands_still(here, hytf, monkeypatch, clock):
    """The clock of the wall is put, the others may be too coarse to move at all."""
    calls = iter(range(10**9))
    monkeypatch.setattr(time, "time", lambda: clock(next(calls)))
    if clock(0) == clock(1):
        for name in ("monotonic", "perf_counter"):
            monkeypatch.setattr(time, name, lambda: 5.0)
    Path(FOLDER).mkdir()
    lock = Path(FOLDER, ".hytf.lock")  # of a run that was killed, in the year 2100
    lock.touch()
    os.utime(lock, (4.1e9, 4.1e9))
    code, _, error = hytf(*RUN)
    assert code == 0 and "Traceback" not in error
    summary = json.loads(Path(FOLDER, "summary.json").read_text())
    assert all(seconds >= 0 for seconds in summary["wall_s"].values())
    assert not lock.exists()


def test_the_time_left_without_a_clock_that_moves():
    estimate = Estimate(lambda: 7.0)
    for done in range(4):
        estimate.update(Progress(0, 1, "sweep", 0, done, 4))
        assert estimate.seconds_left in (None, 0.0)


def test_two_runs_to_one_folder_at_once(here, hytf):
    with open_result(Path(FOLDER)):
        for arguments in (RUN, (*RUN, "--force"), (*RUN, "--resume")):
            code, out, error = hytf(*arguments)
            assert (code, out) == (2, "") and "another run is writing there" in told(error)
    assert hytf(*RUN, "--quiet")[0] == 0


def test_what_a_killed_run_has_half_written_goes(here, whole, hytf):
    Path(FOLDER).mkdir()
    for name in (".receivers.csv", ".profiles.png", ".report.html", ".points_0007.vtu"):
        Path(FOLDER, name).write_text("half")
    assert hytf(*RUN, "--quiet", "--resume")[0] == 0
    assert other_files(whole, FOLDER) == 0


def test_a_link_in_the_folder_is_replaced_not_written_through(here, hytf):
    """Naively a link that someone left is a way out of the folder."""
    Path(FOLDER, "checkpoint").mkdir(parents=True)
    for name in ("receivers.csv", ".summary.json", "checkpoint/.state.npz", "points_0000.vtu"):
        Path(FOLDER, name).symlink_to(here / f"outside-{Path(name).name}")
    Path("outside-receivers.csv").write_text("mine")
    assert hytf(*RUN, "--quiet", "--resume")[0] == 0
    assert {p.name for p in here.iterdir()} == {"s.toml", FOLDER, "outside-receivers.csv"}
    assert Path("outside-receivers.csv").read_text() == "mine"
    assert not any(path.is_symlink() for path in Path(FOLDER).rglob("*"))


SHORT_MAP = """
from fenics_hytf.cli import main, stability
from fenics_hytf.study import conduct_stability
from fenics_hytf.study.stability.block import block_jobs
jobs = block_jobs((1.0,), (30.0,))
stability.conduct_stability = lambda progress: conduct_stability(progress, jobs)
main()
"""


@pytest.mark.parametrize(
    "command",
    [
        "hytf demo | head -0",
        "hytf run s.toml --no-plots 2>&1 | head -1 >/dev/null",
        "hytf run s.toml --no-plots <&- >&- 2>&-",
        "hytf demo >/dev/full",
        "python3 short_map.py stability >/dev/full",
    ],
)
def test_streams_that_nobody_reads(here, command):
    """What a command does is done whether or not anybody listens."""
    Path("short_map.py").write_text(SHORT_MAP)
    line = command.replace("python3", sys.executable).replace("hytf", " ".join(HYTF))
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line}"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    assert "Broken" not in done.stderr and "Exception ignored" not in done.stderr
    assert Path(FOLDER, "summary.json").exists() == (" run s.toml" in command)
    if "/dev/full" in command:
        assert "standard output cannot be written (No space left on device)" in done.stderr


def test_another_language_and_a_narrow_terminal(here):
    """Texts of the scene that an encoding does not have are shown somehow, files are UTF-8."""
    language = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    terminal = {"PYTHONIOENCODING": "ascii", "COLUMNS": "1", "TERM": "dumb"}
    Path("s.toml").write_text(COLUMN.replace("A column", "Böschung 山"), encoding="utf-8")
    told_so = os.environ | language | terminal
    for command in (["run", "s.toml", "--no-plots"], ["run", "--help"]):
        done = subprocess.run(
            [*HYTF, *command],
            capture_output=True,
            check=False,
            env=told_so,
        )
        assert done.returncode == 0 and b"Traceback" not in done.stderr, done.stderr
    summary = json.loads(Path(FOLDER, "summary.json").read_text(encoding="utf-8"))
    assert summary["title"] == "Böschung 山"
