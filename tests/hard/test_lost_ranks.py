# SPDX-License-Identifier: MIT
"""Requests to end a run, and ranks that are lost.

Naively the ranks that are left wait for ever, and nobody is told what is kept.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support.restart import KILLS, other_files
from support.small_run import FOLDER, HYTF, RUN, STATE, STRUCK, told

from fenics_hytf.simulation.checkpoint import read_checkpoint


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


_PATIENCE = 60  # seconds: 14 to 20 on two cores with five times as much to do


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
