# SPDX-License-Identifier: MIT
"""Runs in processes of their own: costs, what is kept, and every way a run can fail."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import simulate
from fenics_hytf.study import BudgetSpent, Processes, runs
from fenics_hytf.study.runs import Job, read_job, write_job
from fenics_hytf.study.twin import viscous_twin
from fenics_hytf.study.worker import warm

SAND = {"density": 1800.0, "shear_wave_velocity": 160.0, "poisson": 0.3, "damping": 0.05}
CURVES = {"strain": [1e-6, 1e-4, 1e-2], "modulus": [1.0, 0.8, 0.1], "damping": [0.02, 0.05, 0.2]}


def column(**sections) -> Scene:
    layers = [{"thickness": 8.0, "soil": "sand", "cells": 4}]
    data = {
        "mesh": {"column": {"width": 1.0, "layers": layers}},
        "soil": {"sand": SAND},
        "motion": [{"direction": "x", "synthetic": {"n": 128, "dt": 0.02}}],
        "boundary": {"left": "tied", "right": "tied"},
        "solver": {"sweep": "direct"},
        "output": {"receivers": {"top": [0.5, 8.0]}},
    }
    return Scene.from_dict(data | sections)


def replace_worker(monkeypatch, tmp_path, code: str) -> None:
    """Let another program do the runs."""
    script = tmp_path / "worker.py"
    script.write_text(code)
    start = runs.subprocess.Popen

    def popen(command, **options):
        return start([sys.executable, str(script), command[-1]], **options)

    monkeypatch.setattr(runs.subprocess, "Popen", popen)


def test_a_run_is_what_simulate_does_and_is_kept(tmp_path):
    job = Job(column())
    run = Processes(tmp_path / "runs")
    outcome = run(job)
    assert outcome.failure == "" and not outcome.kept
    expected = simulate(job.scene)
    np.testing.assert_allclose(
        outcome.response, expected.history("total_acceleration"), rtol=1e-12, atol=1e-15
    )
    assert outcome.cost.factorisations == expected.work.factorisations
    assert outcome.cost.unknowns == expected.sizes["unknowns"]
    assert 0 < outcome.cost.core_s < 10 and outcome.cost.peak_memory > 50e6
    again = Processes(tmp_path / "runs", before=lambda: pytest.fail("it is kept"))(job)
    assert again.kept and again.cost == outcome.cost
    np.testing.assert_array_equal(again.response, outcome.response)
    assert len(list((tmp_path / "runs").iterdir())) == 2


def test_a_march_is_a_run_too(tmp_path):
    twin = viscous_twin(column())
    outcome = Processes(tmp_path)(Job(twin, "newmark", 2))
    assert outcome.failure == "" and outcome.response.shape == (1, 2, 128)
    assert outcome.cost.factorisations >= 1 and outcome.cost.solves > 2 * 128


def test_the_key_changes_with_what_matters(tmp_path):
    record = tmp_path / "record.csv"
    motion = {"direction": "x", "file": str(record), "dt": 0.02, "units": "m/s2"}

    def key(values, **sections):
        np.savetxt(record, values)
        return Job(column(motion=[motion], **sections)).key

    keys = {
        key([0.0, 1.0, 0.0, 0.5]),
        key([0.0, 1.0, 0.0, 0.6]),  # the same scene file, another record
        key([0.0, 1.0, 0.0, 0.5], solver={"sweep": "reduced"}),
    }
    assert len(keys) == 3 and key([0.0, 1.0, 0.0, 0.5]) in keys
    scene = column()
    assert len({Job(scene).key, Job(scene, "hht").key, Job(scene, "hht", 2).key}) == 3


def test_a_job_reads_back(tmp_path):
    job = Job(column(), "hht", 4)
    write_job(tmp_path / "job.json", job)
    back = read_job(tmp_path / "job.json")
    assert back.key == job.key and (back.method, back.substeps) == ("hht", 4)


def test_what_stops_the_numerics_is_told(tmp_path):
    loop = {"tolerance": 1e-9, "max_iterations": 1}
    soil = {"sand": SAND | {"curves": CURVES}}
    outcome = Processes(tmp_path)(Job(column(soil=soil, effects={"equivalent_linear": loop})))
    assert outcome.cost is None and "equivalent-linear" in outcome.failure
    assert list(tmp_path.iterdir()) == []  # failed runs are tried again


def test_a_crash_is_told(tmp_path, monkeypatch):
    replace_worker(monkeypatch, tmp_path, "import os; os.kill(os.getpid(), 9)")
    assert Processes(tmp_path / "runs")(Job(column())).failure == "ended by SIGKILL"
    replace_worker(monkeypatch, tmp_path, "raise TypeError('a slip')")
    outcome = Processes(tmp_path / "runs")(Job(column()))
    assert outcome.failure == "ended with code 1: TypeError: a slip"


def test_a_run_that_takes_too_long_is_given_up(tmp_path, monkeypatch):
    code = (
        "import os, sys, time\n"
        f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid()))\n"
        "time.sleep(60)\n"
    )
    replace_worker(monkeypatch, tmp_path, code)
    outcome = Processes(tmp_path / "runs")(Job(column()), limit=2.0)
    assert "given up" in outcome.failure
    with pytest.raises(ProcessLookupError):
        os.kill(int(Path(tmp_path / "pid").read_text()), signal.SIGTERM)


def test_an_outcome_cut_short_is_run_again(tmp_path):
    job = Job(column())
    Processes(tmp_path)(job)
    (tmp_path / f"{job.key}.npy").write_bytes(b"\x93NUMPY")
    assert not Processes(tmp_path)(job).kept


def test_nothing_starts_when_the_time_is_over(tmp_path):
    def spent():
        raise BudgetSpent("spent")

    with pytest.raises(BudgetSpent):
        Processes(tmp_path, before=spent)(Job(column()))


def test_peak_memory_is_that_of_the_program():
    """Whatever the program that started it has taken."""
    block = np.ones(2**26)  # 512 MiB
    grow = "b = peak_memory(); x = np.ones(2**24); print(b, peak_memory() - b)"
    code = f"import numpy as np; from fenics_hytf.simulation import peak_memory; {grow}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    before, grown = map(int, done.stdout.split())
    assert before < block.nbytes
    assert 0.9 * 2**27 < grown < 1.1 * 2**27  # 128 MiB


def test_lapses_that_go_on_are_warmed_up_too():
    """They bear no low frequency alone, which is what other scenes are warmed up with."""
    data = column(lapses={"count": 2}, solver={}).data
    with pytest.raises(SceneError, match="max_frequency"):
        Scene.from_dict(data | {"solver": {"max_frequency": 1.0}})
    warm(Job(Scene.from_dict(data)))
