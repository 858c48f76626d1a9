# SPDX-License-Identifier: MIT
"""Commands, their messages and exit codes: every way a command can end."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.results_builder import make_result, make_snapshot

from fenics_hytf.cli import app, run
from fenics_hytf.scene import Fault, SceneError
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
harmonic = { amplitude = 1.0, frequency = 2.0, cycles = 1, samples = 32 }
[boundary]
left = "tied"
right = "tied"
[output]
receivers = { top = [0.5, 8.0] }
"""


@pytest.fixture
def here(here):
    Path("s.toml").write_text(SCENE)
    return here


def files(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def replace_simulate(monkeypatch, action):
    def simulate(scene, comm, progress, snapshot, group_size, checkpoint=None):
        return action(snapshot)

    monkeypatch.setattr(run, "simulate", simulate)


def test_run_writes_a_finished_result(here, hytf):
    code, out, err = hytf("run", "s.toml")
    assert code == 0, err
    assert "A column" in out and "1 solved of 1 excited" in out and "s-result/report.html" in out
    done, *rest = err.splitlines()[-3:]
    assert "done" in done and rest == ["writing tables", "drawing figures and the report"]
    summary = json.loads(Path("s-result/summary.json").read_text())
    assert summary["work"]["factorisations"] == 1 and summary["lapses"][0]["solved_lines"] == 1
    assert "rayleigh" not in summary["work"]["assemblies"]
    assert Path("s-result/report.html").exists() and Path("s-result/points_0000.vtu").exists()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (
            ("solver.complex_modulus='maxwell'",),
            r"error of a seam at most \d\.\de-\d+ \(estimate\), energy of a lapse off by at most "
            r"\d\.\de-\d+ of input",
        ),
        (
            ("solver.complex_modulus='hysteretic'",),
            r"error of a seam at most \d\.\de-\d+ .estimate.",
        ),
        (("lapses.continuity='steady'",), None),
    ],
    ids=str,
)
def test_a_transient_run_ends_with_its_seams(here, hytf, settings, words):
    transient = (
        "motion.0.harmonic.cycles=2",
        "motion.0.harmonic.samples=64",
        "lapses.count=2",
        "lapses.continuity='transient'",
    )
    code, out, err = hytf("run", "s.toml", "--no-plots", "--set", *transient, *settings)
    assert code == 0, err
    rows = [line for line in out.splitlines() if line.startswith("  seams ")]
    assert len(rows) == (words is not None)
    assert words is None or re.fullmatch(f"  seams       {words}", rows[0])


def test_quiet_says_nothing(here, hytf):
    assert hytf("run", "s.toml", "--quiet", "--no-plots", "-o", "deep/er") == (0, "", "")
    assert Path("deep/er/summary.json").exists()
    assert not list(Path("deep/er").glob("*.png")) and not Path("deep/er/report.html").exists()


def test_a_finished_result_needs_force(here, hytf):
    assert hytf("run", "s.toml", "--no-plots")[0] == 0
    before = {p: Path(p).stat().st_mtime_ns for p in files(here)}
    code, out, err = hytf("run", "s.toml", "--no-plots")
    assert (code, out) == (2, "") and "--force" in err and "Traceback" not in err
    assert {p: Path(p).stat().st_mtime_ns for p in files(here)} == before
    assert hytf("run", "s.toml", "--no-plots", "--force")[0] == 0


def test_every_fault_is_told_at_once_and_nothing_written(here, hytf):
    hytf("run", "s.toml", "--no-plots", "--quiet")
    before = files(here)
    code, out, err = hytf(
        "run", "s.toml", "--set", "solver.tolerance=2", "soil.sand.poisson=0.5", "title=3"
    )
    assert (code, out) == (2, "")
    keys = ("title", "soil.sand.poisson", "solver.tolerance", "s-result")
    assert [line.split(":")[1].strip() for line in err.splitlines()] == list(keys)
    assert all("found" in line and "expected" in line for line in err.splitlines())
    assert "Traceback" not in err
    assert files(here) == before


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("nowhere.toml",), "nowhere.toml"),
        (("s.toml", "--motion", "nowhere.at2"), "nowhere.at2"),
        (("s.toml", "-o", "s.toml/below"), "no folder"),
        (("s.toml", "-o", "x" * 300), "cannot be written"),
        (("s.toml", "--set", "output.receivers.top=[0.5, 9.0]"), "top"),
        (("s.toml", "--set", "nonsense"), "nonsense"),
        (("s.toml", "--group-size", "2"), "group size: found 2, with 1 rank; expected one of 1"),
        (("s.toml", "--group-size", "0"), "group size: found 0"),
        (("s.toml", "--set", "effects.softening=true"), "gravity"),
        (("s.toml", "--set", 'lapses.continuity="cyclic"'), '"steady" or "transient"'),
        (("s.toml", "--bogus"), "bogus"),
        ((), "SCENE"),
    ],
    ids=str,
)
def test_wrong_input_is_2_and_writes_nothing(here, hytf, arguments, word):
    code, out, err = hytf("run", *arguments)
    assert (code, out) == (2, "")
    assert word in err and "Traceback" not in err
    assert files(here) == ["s.toml"] and [p.name for p in here.iterdir()] == ["s.toml"]


def test_a_fault_that_the_mesh_shows(here, hytf, monkeypatch):
    def fail(_snapshot):
        raise SceneError([Fault("boundary.slope", '"roller"', "a boundary of the mesh")])

    replace_simulate(monkeypatch, fail)
    code, _, err = hytf("run", "s.toml", "--force")
    assert code == 2 and "boundary.slope" in err
    assert [p.name for p in here.iterdir()] == ["s.toml"]


def test_stopped_numerics_keep_what_there_is(here, hytf, monkeypatch):
    def fail(snapshot):
        snapshot(make_snapshot())
        raise SimulationError(2, "found no convergence", make_result(lapses=3))

    replace_simulate(monkeypatch, fail)
    code, out, err = hytf("run", "s.toml")
    assert (code, out) == (3, "") and "lapse 2: found no convergence" in err
    assert "Traceback" not in err
    there = files(here / "s-result")
    assert "partial-summary.json" in there and "receivers.csv" in there
    assert "points_0000.vtu" in there
    assert "summary.json" not in there and ".hytf.lock" not in there
    assert hytf("plot", "s-result")[0] == 2
    monkeypatch.undo()
    assert hytf("run", here / "s.toml", "-o", here / "s-result", "--no-plots")[0] == 0


def test_numerics_that_stop_in_the_first_lapse_leave_no_folder(here, hytf, monkeypatch):
    def fail(_snapshot):
        raise SimulationError(0, "found a singular matrix", None)

    replace_simulate(monkeypatch, fail)
    assert hytf("run", "s.toml")[0] == 3
    assert [p.name for p in here.iterdir()] == ["s.toml"]


def test_a_disk_that_cannot_be_written_stops_the_run(here, hytf, monkeypatch):
    replace_simulate(monkeypatch, lambda _snapshot: make_result())

    def full(_folder, _result):
        raise OSError(28, "No space left on device", "receivers.csv")

    monkeypatch.setattr("fenics_hytf.results.folder.write_tables", full)
    code, _, err = hytf("run", "s.toml")
    assert code == 3 and "No space left on device" in err and "Traceback" not in err
    assert "summary.json" not in files(here)


def test_a_bug_is_1_and_shows_where(here, hytf, monkeypatch):
    def fail(_snapshot):
        raise ZeroDivisionError("a bug")

    replace_simulate(monkeypatch, fail)
    code, _, err = hytf("run", "s.toml")
    assert code == 1 and "Traceback" in err and "ZeroDivisionError: a bug" in err


def test_an_interrupt_is_130(here, hytf, monkeypatch):
    def interrupt(_snapshot):
        raise KeyboardInterrupt

    replace_simulate(monkeypatch, interrupt)
    code, _, err = hytf("run", "s.toml")
    assert code == 130 and "interrupted" in err and "Traceback" not in err
    assert [p.name for p in here.iterdir()] == ["s.toml"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT], ids=lambda n: n.name)
def test_signals_end_a_run_with_130(here, number):
    script = """
import pathlib, sys, time
from fenics_hytf.cli import main, run
def wait(*_, **__):
    pathlib.Path("started").touch()
    time.sleep(60)
run.simulate = wait
main(["run", "s.toml"])
"""
    process = subprocess.Popen(
        [sys.executable, "-c", script], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    for _ in range(600):
        if Path("started").exists():
            break
        time.sleep(0.05)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert out == "" and "interrupted" in err and "Traceback" not in err
    assert not Path("s-result").exists()


def test_check_says_ok_and_what_it_takes(here, hytf):
    code, out, err = hytf("check", "s.toml")
    assert (code, err) == (0, "")
    words = {line.split()[0]: line.split(maxsplit=1)[-1] for line in out.splitlines()}
    assert out.startswith("ok\n")
    assert words["cells"] == "4" and words["points"] == "16" and words["unknowns"] == "8"
    assert words["lapses"] == "1 of 32 samples"
    assert words["lines"].split() == ["to", "solve", "1"]
    assert "memory" in words and words["effects"] == "none"
    assert words["continuity"].startswith("steady (the default for one lapse)")
    assert words["complex"] == "modulus hysteretic (the default)"
    assert [p.name for p in here.iterdir()] == ["s.toml"]


def test_check_tells_the_faults(here, hytf):
    code, out, err = hytf("check", "s.toml", "--set", "title=3", "points.outside=1")
    assert (code, out) == (2, "") and len(err.splitlines()) == 2
    code, out, err = hytf("check", "s.toml", "--set", "output.receivers.top=[0.5, 9.0]")
    assert (code, out) == (2, "") and "top" in err


def test_plot_draws_again(here, hytf):
    hytf("run", "s.toml", "--no-plots")
    code, out, _ = hytf("plot", "s-result")
    assert code == 0 and "report.html" in out and Path("s-result/profiles.png").exists()


@pytest.mark.parametrize("folder", ["nowhere", "."])
def test_plot_needs_a_finished_result(here, hytf, folder):
    code, out, err = hytf("plot", folder)
    assert (code, out) == (2, "") and "no summary.json" in err and "Traceback" not in err
    assert [p.name for p in here.iterdir()] == ["s.toml"]


def test_version(hytf):
    code, out, _ = hytf("--version")
    assert code == 0 and out.startswith("hytf 0.")


@pytest.mark.parametrize(
    ("given", "spread"),
    [
        (["--set", "a=1", "b.c=2"], ["--set", "a=1", "--set", "b.c=2"]),
        (["--set", "a=1", "--set", "b=2"], ["--set", "a=1", "--set", "b=2"]),
        (["--set", "motion[0].pga=1", "s.toml"], ["--set", "motion[0].pga=1", "s.toml"]),
        (["s.toml", "--set", "a=1", "-o", "x=1"], ["s.toml", "--set", "a=1", "-o", "x=1"]),
        (["--set", "a=1", "runs/x=1.toml"], ["--set", "a=1", "runs/x=1.toml"]),
        (["s.toml"], ["s.toml"]),
    ],
)
def test_set_takes_several(given, spread):
    assert app.spread_overrides(given) == spread


def test_help_is_quick_because_nothing_heavy_is_imported():
    script = """
import sys
from fenics_hytf.cli import main
try:
    main(["run", "--help"])
except SystemExit as stop:
    heavy = {"dolfinx", "petsc4py", "mpi4py", "numba", "matplotlib", "scipy", "numpy"}
    print(stop.code, sorted(heavy & set(sys.modules)))
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "0 []"


def test_a_missing_library_is_named_with_the_package_to_install(here, hytf, monkeypatch):
    from fenics_hytf.cli import environment

    def missing(name):
        raise ImportError(f"No module named {name!r}")

    monkeypatch.setattr(environment.importlib, "import_module", missing)
    code, out, err = hytf("run", "s.toml")
    assert (code, out) == (2, "") and "python3-dolfinx-complex" in err
    assert "docker/run" in err and len(err.splitlines()) == 3


def test_real_petsc_is_refused(here, hytf, monkeypatch):
    from petsc4py import PETSc

    monkeypatch.setattr(PETSc, "ScalarType", float)
    code, out, err = hytf("check", "s.toml")
    assert (code, out) == (2, "") and "complex" in err and "PETSC_DIR=" in err


def test_further_ranks_are_silent(hytf, monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    assert hytf("run", "--bogus") == (2, "", "")
    assert hytf("accuracy", "s.toml") == (2, "", "")
    assert hytf("--version") == (0, "", "")


@pytest.fixture
def shared(tmp_path, monkeypatch):
    from mpi4py import MPI

    folder = MPI.COMM_WORLD.bcast(tmp_path)
    monkeypatch.chdir(folder)
    if MPI.COMM_WORLD.rank == 0:
        Path("s.toml").write_text(SCENE)
    MPI.COMM_WORLD.Barrier()
    return MPI.COMM_WORLD


@pytest.mark.mpi
def test_ranks_write_one_result(shared, hytf):
    code, out, err = hytf("run", "s.toml", "--no-plots")
    assert code == 0, err
    assert ("A column" in out) == (shared.rank == 0)
    assert json.loads(Path("s-result/summary.json").read_text())["ranks"] == shared.size
    shared.Barrier()


@pytest.mark.mpi
def test_a_scene_that_one_rank_cannot_read_stops_all(shared, hytf):
    name = "s.toml" if shared.rank == 0 else "only-seen-by-others.toml"
    code, _, err = hytf("run", name, "-o", "r")
    if shared.size > 1:
        assert code == 2 and not Path("r").exists()
        assert ("only-seen-by-others" in err) == (shared.rank == 0)
    shared.Barrier()


@pytest.mark.mpi
def test_a_write_that_fails_on_one_rank_stops_all(shared, hytf, monkeypatch):
    def full(_folder, _snapshot):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("fenics_hytf.results.folder.write_snapshot", full)
    code, _, err = hytf("run", "s.toml")
    assert code == 3
    assert ("No space left" in err) == (shared.rank == 0)
    shared.Barrier()
    assert not os.path.exists("s-result")
    shared.Barrier()


def test_faults_of_scene_mesh_and_receivers_are_told_at_once(here, hytf):
    import meshio

    places = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    mesh = meshio.Mesh(places, [("quad", [[0, 1, 2, 3]]), ("line", [[0, 1]])])
    mesh.cell_data = {
        "gmsh:physical": [[1], [2]],
        "gmsh:geometrical": [[1], [2]],
    }
    mesh.field_data = {"clay": [1, 2], "base": [2, 1]}
    meshio.write("box.msh", mesh, file_format="gmsh22", binary=False)
    text = SCENE.replace(
        'column = { width = 1.0, layers = [ { thickness = 8.0, soil = "sand", cells = 4 } ] }',
        'file = "box.msh"\npoints_per_cell = 8',
    )
    text = text.replace("poisson = 0.3", "poisson = 0.7").replace("left =", "nosuch =")
    text = text.replace("[0.5, 8.0]", "[0.5, 8.0], rider = { point = [9, 9] }")
    Path("s.toml").write_text(text)
    before = files(here)
    code, out, err = hytf("run", "s.toml")
    assert (code, out) == (2, "")
    keys = {line.split(": ")[1] for line in err.splitlines()}
    assert {"soil.sand.poisson"} <= keys
    assert files(here) == before
    text = text.replace("poisson = 0.7", "poisson = 0.3").replace('right = "tied"', "")
    Path("s.toml").write_text(text.replace('nosuch = "tied"', 'nosuch = "free"'))
    code, out, err = hytf("run", "s.toml")
    keys = {line.split(": ")[1] for line in err.splitlines()}
    expected = {"mesh.file", "mesh.points_per_cell", "boundary.nosuch"}
    assert expected | {"output.receivers.top", "output.receivers.rider"} <= keys
    assert code == 2 and files(here) == before


def test_a_box_without_soils_is_told_with_the_faults_of_its_mesh(here, hytf):
    start, end = SCENE.index("column ="), SCENE.index("[[motion]]")
    box = "box = { size = [1.0, 8.0], cells = [1, 4] }\n"
    Path("s.toml").write_text("soil = {}\n" + SCENE[:start] + box + SCENE[end:])
    for command in ("check", "run"):
        code, out, err = hytf(command, "s.toml")
        assert (code, out) == (2, "")
        assert "soil: found an empty table" in err


CURVES = "curves = { strain = [1e-6, 1e-2], modulus = [1.0, 0.1], damping = [0.01, 0.2] }\n"
SLOPE = Path(__file__).parents[2] / "meshes" / "slope.msh"
LOOP = ("--set", "effects.equivalent_linear=true")


def with_mesh(mesh: str, *soils: str) -> str:
    """The scene with another mesh and soils alike; that of the last one has curves."""
    start, end = SCENE.index("column ="), SCENE.index("[soil.sand]")
    soil, rest = SCENE[end : SCENE.index("[[motion]]")], SCENE[SCENE.index("[[motion]]") :]
    tables = "".join(soil.replace("sand", name) for name in soils)
    return SCENE[:start] + mesh + tables + CURVES + rest.replace("8.0]", "1.0]")


def test_missing_curves_are_told_once(here, hytf):
    """By the scene where it names all soils of the mesh, by the mesh of a file."""
    told = "hytf: effects.equivalent_linear: found no soil with curves; expected curves "
    code, _, err = hytf("check", "s.toml", *LOOP)
    assert (code, err) == (2, told + "in one of the soils sand\n")
    box = 'box = { size = [1.0, 8.0], cells = [1, 4] }\nregions = [ { soil = "sand" } ]\n'
    Path("s.toml").write_text(with_mesh(box, "sand", "clay"))
    code, _, err = hytf("check", "s.toml", *LOOP)
    assert (code, err) == (2, told + "in one of the soils sand\n")
    file = f'file = "{SLOPE}"\nempty = ["air"]\n'
    Path("s.toml").write_text(with_mesh(file, "soil", "seam", "rock", "clay"))
    code, _, err = hytf("check", "s.toml", *LOOP)
    assert (
        code == 2 and err.startswith(told + "for one of the mesh's soils, ") and "clay" not in err
    )


@pytest.mark.parametrize("sweep", ["direct", "reduced"])
def test_motion_beyond_bounds_stops_the_run(here, hytf, sweep):
    Path("s.toml").write_text(SCENE.replace("amplitude = 1.0", "amplitude = 1e25"))
    code, _, err = hytf("run", "s.toml", "--quiet", "--set", f"solver.sweep='{sweep}'")
    assert code == 3
    assert "lapse 0: found peaks of 4 cells out of bounds, the first: 0, 1, 2, 3" in err
    assert not Path("s-result").exists()


def test_points_that_are_thrown_out_stop_the_run(here, hytf):
    text = SCENE.replace("amplitude = 1.0", "amplitude = 1e12").replace(
        "samples = 32", "samples = 80"
    )
    Path("s.toml").write_text(text)
    more = ("lapses={count=2,continuity='transient'}", "effects={gravity=true,convection=true}")
    code, _, err = hytf("run", "s.toml", "--quiet", "--set", *more)
    assert code == 3 and "16 points left the mesh" in err


def test_a_motion_of_nothing_gives_a_result(here, hytf):
    Path("s.toml").write_text(SCENE.replace("amplitude = 1.0", "amplitude = 0.0"))
    code, _, err = hytf("run", "s.toml", "--quiet")
    assert (code, err) == (0, "")
    assert json.loads(Path("s-result/summary.json").read_text())["work"]["factorisations"] == 0
    assert len(Path("s-result/transfer.csv").read_text().splitlines()) == 1
