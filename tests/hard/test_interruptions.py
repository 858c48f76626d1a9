# SPDX-License-Identifier: MIT
"""Hard case 32: a run that is killed or out of room while it keeps a checkpoint, and gone on with.

Naively a file that is half written takes the one before with it, and a full disk ends in a
traceback.
"""

import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support.restart import KILLS, SCENE, other_files

HYTF = [sys.executable, "-m", "fenics_hytf.cli", "run", "s.toml", "--no-plots", "--quiet"]
TEN = ["--set", "lapses.count=10", "--set", "motion.0.synthetic.n=400"]


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(SCENE)
    return tmp_path


@pytest.mark.timeout(900)
def test_32_killed_at_random_moments(folder, figure):
    """Naively what was being written is lost, and the one before with it."""
    subprocess.run([*HYTF, *TEN, "-o", "whole"], check=True)  # compiles what is not compiled yet
    start = time.perf_counter()
    subprocess.run([*HYTF, *TEN, "-o", "timed"], check=True)
    took = time.perf_counter() - start
    random, died, other = np.random.default_rng(32), 0, 0
    for number in range(KILLS):
        out = ["-o", f"killed{number}"]
        process = subprocess.Popen([*HYTF, *TEN, *out])
        time.sleep(random.uniform(0.2, 1.0) * took)
        process.send_signal(signal.SIGKILL)
        died += process.wait() == -signal.SIGKILL
        # Killed before the first checkpoint there is none, and the run starts anew.
        subprocess.run([*HYTF, *TEN, *out, "--resume"], check=True)
        other += other_files("whole", f"killed{number}")
    figure("files that differ after kills at random moments", other, 0)
    figure("kills that met it while it ran", died, 1, at_least=True)


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


def test_32_killed_while_a_checkpoint_is_written(folder, figure):
    """The one before is gone on with; all tables are those of the run that was not killed."""
    subprocess.run([*HYTF, "-o", "whole"], check=True)
    dying = [sys.executable, "-c", DYING, "2", *HYTF[3:], "-o", "killed"]
    for resume in ((), ("--resume",)):  # twice: in the second of each run's checkpoints
        assert subprocess.run([*dying, *resume], check=False).returncode == -9
        assert {p.name for p in Path("killed/checkpoint").iterdir()} == {
            "state.npz",
            ".state.npz",
        }
    subprocess.run([*HYTF, "-o", "killed", "--resume"], check=True)
    other = other_files("whole", "killed")
    figure("files that differ after kills within a checkpoint", other, 0)


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


def test_32_a_limit_of_the_file_size(folder, figure):
    """Stands for a full disk: one line says so, and what was kept is gone on with."""
    command = [sys.executable, "-c", LIMITED, "run", "s.toml", "--no-plots", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    figure("lines told of a full disk", len(done.stderr.splitlines()), 1)
    assert "no room for the checkpoint (File too large)" in done.stderr
    hytf = [sys.executable, "-m", "fenics_hytf.cli", "run", "s.toml", "--no-plots", "--resume"]
    done = subprocess.run(hytf, capture_output=True, text=True, check=True)
    going_on = re.search(r"going on after lapse (\d+) \(2 of 4\)", done.stderr)
    figure("lapses lost to a full disk", 1 - int(going_on[1]), 0)
    assert Path("s-result/summary.json").exists()
