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
from support.restart import KILLS, other_files

from fenics_hytf.cli.progress import Estimate
from fenics_hytf.results import open_result
from fenics_hytf.simulation import Progress
from fenics_hytf.simulation.checkpoint import read_checkpoint
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
    start = time.perf_counter()
    subprocess.run([*HYTF, *RUN, "--quiet"], cwd=folder, check=True)
    (folder / "took").write_text(f"{time.perf_counter() - start}")
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


# ---------------------------------------------------------------- what may not be written or read

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


# ---------------------------------------------------------------- signals and lost ranks


def test_a_request_to_end_at_any_moment_of_a_run(here, whole, hytf):
    """While libraries are loaded, in set-up, sweeps and tables: what is told is what is kept."""
    took = float(Path(whole, "../took").read_text())
    for number, part in enumerate(np.random.default_rng(4).uniform(0.1, 1.0, KILLS)):
        out = Path(f"ended{number}")
        arguments = [*RUN, "--quiet", "-o", str(out)]
        process = subprocess.Popen([*HYTF, *arguments], stderr=subprocess.PIPE, text=True)
        time.sleep(part * took)
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=60)
        if process.returncode == -signal.SIGTERM:  # before this package was loaded, or after all
            assert not out.exists() or (out / "summary.json").exists()
        elif process.returncode:
            assert process.returncode == 130 and "interrupted" in told(error)
            assert not (out / "summary.json").exists()
            assert (out / "checkpoint/state.npz").exists() == ("is kept" in told(error))
        assert hytf(*arguments, "--resume")[0] == 0
        assert other_files(whole, str(out)) == 0


ENDED_IN_FIGURES = """
import os, signal
from fenics_hytf.cli import main
from fenics_hytf.results.figures import drawing
figures = drawing.all_figures
def all_figures(stored):
    for number, figure in enumerate(figures(stored)):
        if number == 1:
            os.kill(os.getpid(), signal.SIGTERM)
        yield figure
drawing.all_figures = all_figures
main(["run", "s.toml", "--quiet"])
"""


def test_a_request_to_end_while_figures_are_drawn(here, whole, hytf):
    """Naively the result passes for finished, without figures, and the words speak of what went."""
    command = [sys.executable, "-c", ENDED_IN_FIGURES]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 130 and "after lapse 1 (2 of 2) is kept" in told(done.stderr)
    assert STATE.exists() and not Path(FOLDER, "summary.json").exists()
    assert hytf("run", "s.toml", "--quiet", "--resume", "--no-plots")[0] == 0
    assert other_files(whole, FOLDER) == 0


STRUCK = """
import os, signal, sys
from mpi4py import MPI
from fenics_hytf.cli import main
from fenics_hytf.simulation.run import Run
rank, what = int(sys.argv[1]), sys.argv[2]
solve = Run.solve_lapse
def solve_lapse(self, segment):
    if segment.index == 1 and MPI.COMM_WORLD.rank == rank:
        if what == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        raise {"memory": MemoryError("Unable to allocate 3 TiB"), "bug": KeyError("bug")}[what]
    return solve(self, segment)
Run.solve_lapse = solve_lapse
main(["run", "s.toml", "--no-plots", "-o", sys.argv[3]])
"""
_PATIENCE = (
    60  # seconds in which a run on several ranks has to end; measured: 3, of which 2 to start
)


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("ranks", "rank", "what", "code", "words"),
    [
        (2, 1, "killed", 137, "process rank 1 with PID"),
        (3, 0, "killed", 137, "process rank 0 with PID"),
        (2, 1, "memory", 3, "rank 1 of 2 ran out of memory (Unable to allocate 3 TiB)"),
        (2, 1, "bug", 1, "hytf: rank 1 of 2 met an error of the program, told above"),
        (1, 0, "memory", 3, "the run ran out of memory (Unable to allocate 3 TiB)"),
    ],
)
def test_a_rank_that_is_lost_ends_the_run_with_words(
    here, whole, hytf, ranks, rank, what, code, words
):
    """Naively the others wait for it for ever, and nobody says which it was."""
    launched = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*launched, sys.executable, "-c", STRUCK, str(rank), what, FOLDER]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_PATIENCE)
    assert done.returncode == code, done.stderr
    assert words in " ".join(done.stderr.split()), done.stderr
    assert "goes on after its last checkpoint with the same command and --resume" in done.stderr
    assert ("KeyError: 'bug'" in done.stderr) == (what == "bug")
    assert read_checkpoint(STATE.parent).lapse == 0
    assert not Path(FOLDER, "summary.json").exists()
    if ranks == 1:
        assert hytf(*RUN, "--quiet", "--resume")[0] == 0
        assert other_files(whole, FOLDER) == 0


# ---------------------------------------------------------------- damaged checkpoints


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory) -> bytes:
    """The checkpoint of a run that was lost in its second lapse."""
    folder = tmp_path_factory.mktemp("unfinished")
    (folder / "s.toml").write_text(COLUMN)
    command = [sys.executable, "-c", STRUCK, "0", "killed", FOLDER]
    assert subprocess.run(command, cwd=folder, check=False).returncode == -signal.SIGKILL
    return (folder / STATE).read_bytes()


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
    for name in ("receivers.csv", ".summary.json", "checkpoint/state.npz.part", "points_0000.vtu"):
        Path(FOLDER, name).symlink_to(here / f"outside-{Path(name).name}")
    Path("outside-receivers.csv").write_text("mine")
    assert hytf(*RUN, "--quiet", "--resume")[0] == 0
    assert {p.name for p in here.iterdir()} == {"s.toml", FOLDER, "outside-receivers.csv"}
    assert Path("outside-receivers.csv").read_text() == "mine"
    assert not any(path.is_symlink() for path in Path(FOLDER).rglob("*"))


@pytest.mark.parametrize(
    "command",
    [
        "hytf demo | head -0",
        "hytf run s.toml --no-plots 2>&1 | head -1 >/dev/null",
        "hytf run s.toml --no-plots <&- >&- 2>&-",
        "hytf check s.toml >/dev/full",
    ],
)
def test_streams_that_nobody_reads(here, command):
    """What a command does is done whether or not anybody listens."""
    line = command.replace("hytf", " ".join(HYTF))
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line}"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    assert "Broken" not in done.stderr and "Exception ignored" not in done.stderr
    assert Path(FOLDER, "summary.json").exists() == (" run s.toml" in command)
    if "check" in command:
        assert "standard output cannot be written (No space left on device)" in done.stderr


@pytest.mark.parametrize(
    "variables",
    [
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"PYTHONIOENCODING": "ascii", "COLUMNS": "1", "TERM": "dumb"},
    ],
    ids=lambda v: " ".join(f"{name}={value}" for name, value in v.items()),
)
def test_another_language_or_a_narrow_terminal(here, variables):
    """Texts of the scene that an encoding does not have are shown somehow, files are UTF-8."""
    Path("s.toml").write_text(COLUMN.replace("A column", "Böschung 山"), encoding="utf-8")
    for command in (["run", "s.toml", "--no-plots"], ["run", "--help"]):
        done = subprocess.run(
            [*HYTF, *command], capture_output=True, check=False, env=os.environ | variables
        )
        assert done.returncode == 0 and b"Traceback" not in done.stderr, done.stderr
    summary = json.loads(Path(FOLDER, "summary.json").read_text(encoding="utf-8"))
    assert summary["title"] == "Böschung 山"
