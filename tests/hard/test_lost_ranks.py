# SPDX-License-Identifier: MIT
"""Requests to end a run, and ranks that are lost.

Naively the ranks that are left wait for ever, and nobody is told what is kept.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support.restart import KILLS, other_files
from support.small_run import FOLDER, HYTF, RUN, STATE, STRUCK, out_of_memory, told

from fenics_hytf.results.figures import drawing
from fenics_hytf.simulation.checkpoint import read_checkpoint

_GO_ON = "goes on after its last checkpoint with the same command and --resume"
_PATIENCE = 60  # seconds: 14 to 20 on two cores with five times as much to do


def test_a_request_to_end_at_any_moment_of_a_run(here, whole, hytf):
    """While libraries are loaded, in set-up, sweeps and tables: what is told is what is kept."""
    took = float(Path(whole, "../took").read_text())
    moments = np.random.default_rng(4).uniform(0.1, 1.0, KILLS) * took
    caught = 0
    for number, moment in enumerate(moments):
        out = Path(f"ended{number}")
        arguments = [*RUN, "--quiet", "-o", str(out)]
        process = subprocess.Popen([*HYTF, *arguments], stderr=subprocess.PIPE, text=True)
        if number == 0:  # however fast the machine is: as soon as the run has its folder
            await_folder(out)
        else:
            time.sleep(moment)
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=_PATIENCE)
        if process.returncode == -signal.SIGTERM:  # before this package was loaded, or after all
            assert not out.exists() or (out / "summary.json").exists()
        elif process.returncode:
            assert process.returncode == 130 and "interrupted" in told(error)
            assert not (out / "summary.json").exists()
            assert (out / "checkpoint/state.npz").exists() == ("is kept" in told(error))
            caught += 1
        assert hytf(*arguments, "--resume")[0] == 0
        assert other_files(whole, str(out)) == 0
    assert caught >= 1


def await_folder(folder: Path) -> None:
    end = time.monotonic() + _PATIENCE
    while not folder.exists():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_request_to_end_while_figures_are_drawn(here, whole, hytf, monkeypatch):
    """Naively the result passes for finished, without figures, and the words speak of what went."""
    figures = drawing.all_figures

    def all_figures(stored):
        for number, figure in enumerate(figures(stored)):
            if number == 1:
                os.kill(os.getpid(), signal.SIGTERM)
            yield figure

    def uncaught(_number, _frame):  # else the tests would end with the run
        raise AssertionError("the run does not catch SIGTERM")

    before = signal.signal(signal.SIGTERM, uncaught)
    try:
        with monkeypatch.context() as patch:
            patch.setattr(drawing, "all_figures", all_figures)
            code, _, error = hytf("run", "s.toml", "--quiet")
    finally:
        signal.signal(signal.SIGTERM, before)
    assert code == 130 and "after lapse 1 (2 of 2) is kept" in told(error)
    assert STATE.exists() and not Path(FOLDER, "summary.json").exists()
    assert hytf("run", "s.toml", "--quiet", "--resume", "--no-plots")[0] == 0
    assert other_files(whole, FOLDER) == 0


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("rank", "what", "code", "words"),
    [
        (1, "killed", 137, "process rank 1 with PID"),
        (0, "killed", 137, "process rank 0 with PID"),
        (1, "memory", 3, "rank 1 of 2 ran out of memory (Unable to allocate 3 TiB)"),
        (1, "bug", 1, "hytf: rank 1 of 2 met an error of the program, told above"),
    ],
)
def test_a_rank_that_is_lost_ends_the_run_with_words(here, rank, what, code, words):
    """Naively the others wait for it for ever, and nobody says which it was."""
    command = ["mpirun", "-n", "2", sys.executable, "-c", STRUCK, str(rank), what, FOLDER]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_PATIENCE)
    assert done.returncode == code, done.stderr
    assert words in " ".join(done.stderr.split()), done.stderr
    assert _GO_ON in done.stderr
    assert ("KeyError: 'bug'" in done.stderr) == (what == "bug")
    assert read_checkpoint(STATE.parent).lapse == 0
    assert not Path(FOLDER, "summary.json").exists()


def test_a_run_that_is_out_of_memory_says_so_and_goes_on(here, whole, hytf):
    """The same on one rank, which needs no launcher to be told."""
    with out_of_memory():
        code, _, error = hytf(*RUN)
    assert code == 3 and "the run ran out of memory (Unable to allocate 3 TiB)" in told(error)
    assert _GO_ON in error and read_checkpoint(STATE.parent).lapse == 0
    assert not Path(FOLDER, "summary.json").exists()
    assert hytf(*RUN, "--quiet", "--resume")[0] == 0
    assert other_files(whole, FOLDER) == 0
