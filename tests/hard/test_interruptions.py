# SPDX-License-Identifier: MIT
"""Hard cases 31 and 32: a run that is stopped, killed or out of room, and gone on with.

Naively a restart is nearly right, a file that is half written takes the one before with it, and a
full disk ends in a traceback. What goes on over ranks is in ``verification/test_resume.py``.
"""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from support.restart import SCENE

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import CheckpointFolder, simulate

HYTF = [sys.executable, "-m", "fenics_hytf.cli", "run", "s.toml", "--no-plots", "--quiet"]
TEN = ["--set", "lapses.count=10", "--set", "motion.0.synthetic.n=400"]
KILLS = int(os.environ.get("HYTF_KILLS", "3"))  # ten by 'docker/run hard'


class Stop(Exception):
    pass


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(SCENE)
    return tmp_path


def same_files(whole: str, resumed: str) -> int:
    """All tables alike to the byte, the summary but for times; how many files that were."""
    names = sorted(p.name for p in Path(whole).iterdir())
    assert names == sorted(p.name for p in Path(resumed).iterdir())
    assert "checkpoint" not in names
    for name in names:
        if not name.endswith(".json"):
            assert Path(whole, name).read_bytes() == Path(resumed, name).read_bytes(), name
    summaries = [json.loads(Path(d, "summary.json").read_text()) for d in (whole, resumed)]
    for summary in summaries:
        for key in ("written", "wall_s", "peak_memory_bytes"):
            del summary[key]
        del summary["work"]["wall_s"]
    assert summaries[0] == summaries[1]
    return len(names)


@pytest.mark.parametrize("stop", [0, 1, 2])
def test_31_restart_at_any_lapse(stop, folder, figure):
    """Naively positions go on and velocity, memory or the warm start of the loop are forgotten."""
    case = Scene.load("s.toml")
    whole = simulate(case, MPI.COMM_SELF)

    def stopped(shown):
        if shown.index == stop + 1:
            raise Stop

    kept = folder / "checkpoint"
    with pytest.raises(Stop):
        simulate(case, MPI.COMM_SELF, None, stopped, checkpoint=CheckpointFolder(kept, case))
    go_on = CheckpointFolder(kept, case, MPI.COMM_SELF, resume=True)
    assert go_on.lapse == stop
    result = simulate(case, MPI.COMM_SELF, checkpoint=go_on)
    off = 0.0
    for found, expected in zip(result.lapses, whole.lapses, strict=True):
        for field in dataclasses.fields(expected.cells):
            a, b = (getattr(lapse.cells, field.name) for lapse in (found, expected))
            off = off if a is None else max(off, float(np.abs(a - b).max()))
        off = max(off, float(np.abs(found.velocity - expected.velocity).max()))
    figure(f"case 31, restart after lapse {stop}: difference", off, 0.0)


@pytest.mark.timeout(900)
def test_32_killed_at_random_moments(folder, figure):
    """Naively what was being written is lost, and the one before with it."""
    subprocess.run([*HYTF, *TEN, "-o", "whole"], check=True)  # compiles what is not compiled yet
    start = time.perf_counter()
    subprocess.run([*HYTF, *TEN, "-o", "timed"], check=True)
    took = time.perf_counter() - start
    random, died, alike = np.random.default_rng(32), 0, 0
    for number in range(KILLS):
        out = ["-o", f"killed{number}"]
        process = subprocess.Popen([*HYTF, *TEN, *out])
        time.sleep(random.uniform(0.2, 1.0) * took)
        process.send_signal(signal.SIGKILL)
        died += process.wait() == -signal.SIGKILL
        # Killed before the first checkpoint there is none, and the run starts anew.
        subprocess.run([*HYTF, *TEN, *out, "--resume"], check=True)
        alike += same_files("whole", f"killed{number}") > 0
    assert died > 0
    figure(
        f"case 32, killed at {KILLS} moments ({died} while it ran): alike", alike, KILLS, "", True
    )


DYING = """
import os, signal, sys
from fenics_hytf.cli import main
from fenics_hytf.simulation import checkpoint
old, saves = os.replace, []
def replace(part, path):
    if str(path).endswith(checkpoint.FILE):
        saves.append(path)
        if len(saves) == int(sys.argv[1]):
            with open(part, "r+b") as file:
                file.truncate(os.path.getsize(part) // 2)
            os.kill(os.getpid(), signal.SIGKILL)
    old(part, path)
os.replace = replace
main(sys.argv[2:])
"""


def test_32_killed_while_a_checkpoint_is_written(folder):
    """The one before is gone on with; all tables are those of the run that was not killed."""
    subprocess.run([*HYTF, "-o", "whole"], check=True)
    dying = [sys.executable, "-c", DYING, "2", *HYTF[3:], "-o", "killed"]
    for resume in ((), ("--resume",)):  # twice: in the second of each run's checkpoints
        assert subprocess.run([*dying, *resume], check=False).returncode == -9
        assert {p.name for p in Path("killed/checkpoint").iterdir()} == {
            "state.npz",
            "state.npz.part",
        }
    subprocess.run([*HYTF, "-o", "killed", "--resume"], check=True)
    assert same_files("whole", "killed") > 0


LIMITED = """
import resource, sys
from fenics_hytf.cli import main
from fenics_hytf.simulation import checkpoint_folder
old = checkpoint_folder.write_checkpoint
def write(folder, meta, arrays):
    if meta["lapse"] == 2:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))
    old(folder, meta, arrays)
checkpoint_folder.write_checkpoint = write
main(sys.argv[1:])
"""


def test_32_a_limit_of_the_file_size(folder):
    command = [sys.executable, "-c", LIMITED, "run", "s.toml", "--no-plots", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 3 and len(done.stderr.splitlines()) == 1
    assert "no room for the checkpoint (File too large)" in done.stderr
    hytf = [sys.executable, "-m", "fenics_hytf.cli", "run", "s.toml", "--no-plots", "--resume"]
    done = subprocess.run(hytf, capture_output=True, text=True, check=True)
    assert "going on after lapse 1 (2 of 4)" in done.stderr
    assert Path("s-result/summary.json").exists()
