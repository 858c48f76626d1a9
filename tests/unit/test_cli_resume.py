# SPDX-License-Identifier: MIT
"""``hytf run --resume``: what it goes on from, what it refuses, and how an interrupt ends."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.results_builder import make_result, make_snapshot

from fenics_hytf.cli import run
from fenics_hytf.simulation import SimulationError

SCENE = """
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
harmonic = { amplitude = 1.0, frequency = 2.0, cycles = 3, samples = 96 }
[boundary]
left = "tied"
right = "tied"
[lapses]
count = 3
[output]
receivers = { top = [0.5, 8.0] }
"""
STATE = "s-result/checkpoint/state.npz"


@pytest.fixture
def here(here):
    Path("s.toml").write_text(SCENE)
    return here


@pytest.fixture
def march(monkeypatch):
    """A simulation that does nothing but keep checkpoints, and is stopped after some lapse."""
    done = []

    def set_up(stop=None, error=None):
        done.clear()

        def simulate(scene, comm, progress, snapshot, group_size, checkpoint):
            done.clear()
            start = 0 if checkpoint.found is None else checkpoint.found.lapse + 1
            for lapse in range(start, 3):
                snapshot(make_snapshot(lapse))
                checkpoint.save(lapse, 1, {"sum": 1.0 + lapse})
                done.append(lapse)
                if lapse == stop:
                    raise error
            return make_result(lapses=3)

        monkeypatch.setattr(run, "simulate", simulate)
        return done

    return set_up


def files(folder="s-result"):
    return sorted(str(p.relative_to(folder)) for p in Path(folder).rglob("*") if p.is_file())


def test_an_unfinished_run_is_gone_on_with(here, hytf, march):
    march(stop=1, error=KeyboardInterrupt())
    code, out, err = hytf("run", "s.toml", "--no-plots")
    assert (code, out) == (130, "") and "Traceback" not in err
    assert files() == [
        "checkpoint/state.npz",
        *(f"{kind}_000{lapse}.vtu" for kind in ("fields", "points") for lapse in (0, 1)),
    ]
    before = Path(STATE).read_bytes()
    done = march()
    for arguments in ((), ("--quiet",), ("--set", "soil.sand.density=1900")):
        code, out, err = hytf("run", "s.toml", *arguments)
        assert (code, out) == (2, "") and err.startswith("hytf: s-result: found an unfinished run")
        assert "--resume" in err and "--force" in err
    assert Path(STATE).read_bytes() == before and done == []
    code, out, err = hytf("run", "s.toml", "--no-plots", "--resume", "--set", "title='Other'")
    assert code == 0 and "going on after lapse 1 (2 of 3)" in err and done == [2]
    assert "checkpoint/state.npz" not in files() and not Path("s-result/checkpoint").exists()
    assert "summary.json" in files() and "points_0000.vtu" in files()


def test_lapses_that_sliding_adds_are_told_apart(here, hytf, march):
    march(stop=2, error=KeyboardInterrupt())
    two = ("--no-plots", "--set", "lapses.count=2")
    assert hytf("run", "s.toml", *two)[0] == 130
    march()
    code, _, err = hytf("run", "s.toml", *two, "--resume")
    assert code == 0
    assert "going on after lapse 2 (2 of the scene, 1 that sliding added)" in err


def test_without_a_checkpoint_it_starts_anew(here, hytf, march):
    done = march()
    code, _, err = hytf("run", "s.toml", "--no-plots", "--resume")
    assert code == 0 and "found no checkpoint; starting at the first lapse" in err
    assert done == [0, 1, 2]


@pytest.mark.parametrize("arguments", [(), ("--resume",), ("--force",), ("--resume", "--force")])
@pytest.mark.parametrize("kind", ["file", "link"])
def test_what_is_no_folder_where_the_checkpoint_goes_is_refused(here, hytf, march, kind, arguments):
    """Naively a lapse is solved first, or the checkpoint is written to another folder."""
    done = march()
    Path("mine").mkdir()
    Path("mine/old.npz").write_text("mine")
    place = Path("s-result/checkpoint")
    place.parent.mkdir()
    if kind == "file":
        place.write_text("mine")
    else:
        place.symlink_to(here / "mine")
    code, out, err = hytf("run", "s.toml", *arguments)
    assert (code, out, done) == (2, "", [])
    assert err == (
        f"hytf: s-result/checkpoint: found a {kind}; expected a folder, or nothing. Remove it, or "
        "choose another folder with -o\n"
    )
    assert files("mine") == ["old.npz"] and len(list(place.parent.iterdir())) == 1


def test_force_starts_anew_and_removes_the_checkpoint(here, hytf, march):
    march(stop=2, error=KeyboardInterrupt())
    hytf("run", "s.toml")
    done = march(stop=0, error=KeyboardInterrupt())
    code, *_ = hytf("run", "s.toml", "--force", "--set", "lapses.count=2")
    assert code == 130 and done == [0]
    assert files() == ["checkpoint/state.npz", "fields_0000.vtu", "points_0000.vtu"]


def test_force_beside_resume_goes_on_and_replaces_what_is_finished(here, hytf, march):
    march(stop=1, error=KeyboardInterrupt())
    hytf("run", "s.toml")
    done = march()
    for expected in ([2], [0, 1, 2]):
        assert hytf("run", "s.toml", "--resume", "--force", "--no-plots")[0] == 0
        assert done == expected


def test_a_changed_scene_is_refused_with_its_keys(here, hytf, march):
    march(stop=0, error=KeyboardInterrupt())
    hytf("run", "s.toml")
    before = Path(STATE).read_bytes()
    changes = ("soil.sand.density=1900", "solver.tolerance=1e-4", "output.every=2")
    code, out, err = hytf("run", "s.toml", "--resume", "--set", *changes)
    assert (code, out) == (2, "")
    density, tolerance, advice = err.splitlines()
    assert density == (
        "hytf: soil.sand.density: found 1900.0; expected 1800.0, as in the checkpoint"
    )
    assert tolerance.startswith("hytf: solver.tolerance: found 0.0001; expected 1e-06")
    assert "s-result/checkpoint: found the checkpoint of another scene" in advice
    assert Path(STATE).read_bytes() == before and ".hytf.lock" not in files()


@pytest.mark.parametrize("harm", [lambda b: b[:-1], lambda b: b"", lambda b: b"x" + b[1:]])
def test_a_damaged_checkpoint_is_wrong_input(here, hytf, march, harm):
    march(stop=0, error=KeyboardInterrupt())
    hytf("run", "s.toml")
    Path(STATE).write_bytes(harm(Path(STATE).read_bytes()))
    before = files()
    code, out, err = hytf("run", "s.toml", "--resume")
    assert (code, out) == (2, "") and len(err.splitlines()) == 1
    assert f"{STATE}: found a file that is damaged" in err and "--force" in err
    assert files() == before
    march()
    assert hytf("run", "s.toml", "--force", "--no-plots")[0] == 0


def test_a_finished_run_is_left_as_it_is(here, hytf):
    assert hytf("run", "s.toml", "--no-plots", "--quiet")[0] == 0
    assert not Path("s-result/checkpoint").exists()
    before = {p: Path("s-result", p).stat().st_mtime_ns for p in files()}
    code, out, err = hytf("run", "s.toml", "--resume")
    assert (code, out) == (0, "") and "finished already (summary.json)" in err
    assert hytf("run", "s.toml", "--resume", "--quiet") == (0, "", "")
    code, out, err = hytf("run", "s.toml", "--resume", "--set", "soil.sand.density=1900")
    assert (code, out) == (2, "") and "found a finished result" in err and "--force" in err
    assert {p: Path("s-result", p).stat().st_mtime_ns for p in files()} == before


def test_numerics_that_stop_keep_the_checkpoint(here, hytf, march):
    march(stop=1, error=SimulationError(1, "found no convergence", make_result(lapses=3)))
    code, _, err = hytf("run", "s.toml")
    assert code == 3 and "found no convergence" in err
    assert "partial-summary.json" in files() and "checkpoint/state.npz" in files()
    done = march()
    assert hytf("run", "s.toml", "--resume", "--no-plots")[0] == 0 and done == [2]
    assert "partial-summary.json" not in files()


def test_tables_that_cannot_be_written_keep_the_checkpoint(here, hytf, march, monkeypatch):
    done = march()

    def full(_folder, _result):
        raise OSError(28, "No space left on device", "receivers.csv")

    with monkeypatch.context() as patch:
        patch.setattr("fenics_hytf.results.folder.write_tables", full)
        assert hytf("run", "s.toml")[0] == 3
    assert "checkpoint/state.npz" in files() and done == [0, 1, 2]
    assert hytf("run", "s.toml", "--resume", "--no-plots")[0] == 0 and done == []


def test_a_full_disk_stops_the_run_and_keeps_the_checkpoint(here, hytf, march, monkeypatch):
    march(stop=0, error=KeyboardInterrupt())
    hytf("run", "s.toml")
    before = Path(STATE).read_bytes()
    march()

    def full(_handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    code, out, err = hytf("run", "s.toml", "--resume")
    assert (code, out) == (3, "") and "Traceback" not in err
    assert "stopped: s-result/checkpoint/state.npz: found no room for the checkpoint" in err
    assert "The checkpoint before is kept" in err and Path(STATE).read_bytes() == before


def test_a_checkpoint_that_cannot_be_the_first_leaves_no_folder(here, hytf, march, monkeypatch):
    march()

    def full(_handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("fenics_hytf.results.folder.write_snapshot", lambda *_: None)
    monkeypatch.setattr(os, "fsync", full)
    code, _, err = hytf("run", "s.toml")
    assert code == 3 and "There is none before" in err
    assert [p.name for p in here.iterdir()] == ["s.toml"]


RUNNING = """
import os, pathlib, sys, time
from fenics_hytf.cli import main, run
def simulate(scene, comm, progress, snapshot, group_size, checkpoint):
    for lapse in range({lapses}):
        checkpoint.save(lapse, 1, {{}})
    pathlib.Path(f"started{{comm.rank}}").write_text(str(os.getpid()))
    try:
        if comm.rank in {stuck}:
            comm.recv(source=comm.rank)  # for ever, and no handler runs
        time.sleep(60)
    finally:
        if comm.size > 1:
            comm.Barrier()  # what ranks share is destroyed together
run.simulate = simulate
main(["run", "s.toml"])
"""


def start(ranks, lapses=2, stuck=()):
    command = [sys.executable, "-c", RUNNING.format(lapses=lapses, stuck=stuck)]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    for _ in range(1200):
        started = [Path(f"started{rank}") for rank in range(ranks)]
        if all(path.exists() and path.read_text() for path in started):
            break
        time.sleep(0.05)
    return process, [int(path.read_text()) for path in started]


SAID = (
    "hytf: interrupted: the checkpoint after lapse 1 (2 of 3) is kept in s-result/checkpoint. "
    "Go on with the same command and --resume"
)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=lambda n: n.name)
def test_a_signal_names_the_checkpoint(here, number):
    process, _ = start(1)
    process.send_signal(number)
    process.send_signal(number)  # a second one does not disturb
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130 and out == "" and err.splitlines() == [SAID]
    assert files() == ["checkpoint/state.npz"]


def test_a_signal_before_the_first_lapse_leaves_nothing(here):
    process, _ = start(1, lapses=0)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130 and "there is no checkpoint" in err
    assert not Path("s-result").exists()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=lambda n: n.name)
def test_a_signal_while_libraries_are_loaded(here, number):
    script = """
import os, signal, sys
from fenics_hytf.cli import environment, main
class Hook:
    def find_spec(self, name, path=None, target=None):
        if name == "dolfinx.cpp":
            os.kill(os.getpid(), int(sys.argv[1]))
sys.meta_path.insert(0, Hook())
main(["run", "s.toml"])
"""
    command = [sys.executable, "-c", script, str(int(number))]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "hytf: interrupted\n")
    assert [p.name for p in here.iterdir()] == ["s.toml"]


@pytest.mark.parametrize("interrupted", [(0,), (1,), (0, 1)], ids=str)
def test_a_signal_to_any_rank_ends_all_and_is_told_once(here, interrupted):
    process, ranks = start(2)
    for rank in interrupted:
        os.kill(ranks[rank], signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err.count("hytf: interrupted") == err.count(SAID) == 1 and "Traceback" not in err
    assert Path(STATE).exists()


def test_a_rank_speaks_for_one_that_is_deep_inside_mpi(here):
    process, ranks = start(2, stuck=(0,))
    for rank in (0, 1):
        os.kill(ranks[rank], signal.SIGTERM)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130 and err.count(SAID) == 1


def test_a_signal_to_mpirun_keeps_the_checkpoint(here):
    process, _ = start(2)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode != 0 and Path(STATE).exists()


@pytest.mark.mpi
def test_ranks_go_on_together(tmp_path, monkeypatch, hytf, march):
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    monkeypatch.chdir(comm.bcast(tmp_path))
    if comm.rank == 0:
        Path("s.toml").write_text(SCENE)
    comm.Barrier()
    march(stop=1, error=SimulationError(1, "found no convergence", None))
    assert hytf("run", "s.toml")[0] == 3
    comm.Barrier()
    code, _, err = hytf("run", "s.toml")
    assert code == 2 and ("unfinished run" in err) == (comm.rank == 0)
    code, _, err = hytf("run", "s.toml", "--resume", "--set", "solver.tolerance=1e-4")
    assert code == 2 and ("solver.tolerance" in err) == (comm.rank == 0)
    comm.Barrier()
    done = march()
    code, _, err = hytf("run", "s.toml", "--resume", "--no-plots")
    assert code == 0 and done == [2] and ("going on" in err) == (comm.rank == 0)
    comm.Barrier()
    assert json.loads(Path("s-result/summary.json").read_text())["title"]
    assert not Path(STATE).exists()
    comm.Barrier()
