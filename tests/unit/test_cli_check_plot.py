# SPDX-License-Identifier: MIT
"""``hytf check --plot``: the figure of the soils' curves, and every way it can be refused."""

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.colors import to_hex
from mpi4py import MPI

from fenics_hytf.cli import main
from fenics_hytf.cli.app import fill_plot
from fenics_hytf.cli.check import check_scene
from fenics_hytf.cli.outcome import RunRequest
from fenics_hytf.results.figures.curves import curve_figure
from fenics_hytf.results.figures.style import COLOURS, figure_style
from fenics_hytf.scene.soil import read_soils

SCENE = """
[mesh]
column = { width = 1.0, layers = [
    { thickness = 4.0, soil = "sand", cells = 2 }, { thickness = 4.0, soil = "clay", cells = 2 } ] }
[soil.sand]
density = 1800.0
shear_wave_velocity = 160.0
poisson = 0.3
curves = { model = "seed_idriss_1970_mean" }
[soil.clay]
density = 1700.0
shear_wave_velocity = 140.0
poisson = 0.45
curves = { model = "darendeli", plasticity_index = 40, mean_stress = 50e3, shear_strength = 30e3 }
[[motion]]
direction = "x"
harmonic = { amplitude = 1.0, frequency = 2.0, cycles = 1, samples = 32 }
[boundary]
left = "tied"
right = "tied"
"""
BASE = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3}


@pytest.fixture
def here(here):
    Path("site.toml").write_text(SCENE)
    return here


@pytest.fixture
def check(capsys):
    def call(*arguments):
        with pytest.raises(SystemExit) as stop:
            main(["check", *map(str, arguments)])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        (("site.toml", "--plot"), "site-curves.png"),
        (("--plot", "site.toml"), "site-curves.png"),
        (("site.toml", "--plot", "--set", "solver.tolerance=1e-5"), "site-curves.png"),
        (("site.toml", "--plot", "sub/c.PNG"), "sub/c.PNG"),
        (("--plot=c.png", "site.toml"), "c.png"),
    ],
    ids=str,
)
def test_the_figure_is_written_and_told(here, check, arguments, file):
    Path("sub").mkdir()
    code, out, err = check(*arguments)
    assert (code, err) == (0, "")
    assert out.startswith("ok\n") and out.endswith(f"  curves          {file} (2 soils)\n")
    pixels = matplotlib.image.imread(here / file)
    assert pixels.shape[0] > 400 and len(np.unique(pixels.reshape(-1, 4), axis=0)) > 10


def test_without_plot_nothing_is_written(here, check):
    code, out, _ = check("site.toml")
    assert code == 0 and "curves" not in out
    assert names(here) == ["site.toml"]


def test_no_soil_with_curves(here, check):
    lines = SCENE.splitlines(keepends=True)
    Path("site.toml").write_text("".join(x for x in lines if not x.startswith("curves")))
    code, out, err = check("site.toml", "--plot")
    assert (code, err) == (0, "")
    assert out.endswith("  curves          no soil has any, no figure\n")
    assert names(here) == ["site.toml"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("--plot", "--set", "soil.clay.curves.shear_strength=1"),
            ["soil.clay.curves.shear_strength:"],
        ),
        (("--plot", "--set", "soil.sand.poisson=0.5"), ["soil.sand.poisson:"]),
        (("--plot", "--set", "output.receivers.top=[0.5, 9.0]"), ["output.receivers.top:"]),
        (("--plot=c.pdf",), ["--plot: found c.pdf; expected a file that ends in .png"]),
        (("--plot=no/c.png",), ["--plot: found no folder no; expected one"]),
        (("--plot=folder.png",), ["--plot: found the folder folder.png"]),
        (("--plot=c.pdf", "--set", "title=3"), ["title:", "--plot:"]),
    ],
    ids=str,
)
def test_wrong_input_is_2_and_writes_nothing(here, check, arguments, words):
    Path("folder.png").mkdir()
    code, out, err = check("site.toml", *arguments)
    assert (code, out) == (2, "")
    lines = err.splitlines()
    assert len(lines) == len(words)
    assert all(line.startswith(f"hytf: {word}") for word, line in zip(words, lines, strict=True))
    assert names(here) == ["folder.png", "site.toml"] and not names(here / "folder.png")


def test_another_word_is_no_file(here, check):
    code, out, err = check("site.toml", "--plot", "c.pdf")
    assert (code, out) == (2, "") and "c.pdf" in err


def test_a_figure_that_cannot_be_written(here, check):
    code, _, err = check("site.toml", "--plot", "x" * 300 + ".png")
    assert code == 3 and "cannot be written" in err and "Traceback" not in err
    assert names(here) == ["site.toml"]


def test_plot_takes_only_what_can_be_a_figure():
    assert fill_plot(["check", "--plot", "s.toml"]) == ["check", "--plot=", "s.toml"]
    assert fill_plot(["check", "s.toml", "--plot"]) == ["check", "s.toml", "--plot="]
    assert fill_plot(["check", "s.toml", "--plot", "a.png"])[2:] == ["--plot", "a.png"]
    assert fill_plot(["check", "--plot", "--motion=a.png"])[1:] == ["--plot=", "--motion=a.png"]
    assert fill_plot([]) == []


@pytest.mark.mpi
def test_one_rank_writes(shared_path, capsys):
    comm = MPI.COMM_WORLD
    if comm.rank == 0:
        (shared_path / "site.toml").write_text(SCENE)
    comm.barrier()
    request = RunRequest(shared_path / "site.toml", shared_path / "result")
    assert check_scene(request, comm, plot=shared_path / "c.png") == 0
    comm.barrier()
    assert names(shared_path) == ["c.png", "site.toml"]
    assert ("(2 soils)" in capsys.readouterr().out) == (comm.rank == 0)


def soils(**curves):
    read, faults = read_soils({name: {**BASE, "curves": c} for name, c in curves.items()})
    assert not faults
    return read


def test_what_is_drawn_is_what_a_run_uses():
    drawn = soils(sand={"model": "seed_idriss_1970_mean"}, rock={"model": "schnabel_1973_rock"})
    drawn |= read_soils({"linear": BASE})[0]
    with figure_style():
        figure = curve_figure(drawn)
    modulus, damping = figure.axes
    assert [axes.get_xlabel() for axes in figure.axes] == ["Shear strain [%]"] * 2
    assert [axes.get_ylabel() for axes in figure.axes] == ["G/Gmax [-]", "Damping ratio [%]"]
    assert {axes.get_xscale() for axes in figure.axes} == {"log"}
    for name, colour in (("sand", COLOURS[0]), ("rock", COLOURS[1])):
        for axes, column, factor in ((modulus, 0, 1.0), (damping, 1, 100.0)):
            [line] = [
                line
                for line in axes.lines
                if to_hex(line.get_color()) == colour.lower() and line.get_linewidth() > 1
            ]
            expected = drawn[name].curve.evaluate(0.01 * line.get_xdata())[column]
            assert line.get_ydata() == pytest.approx(factor * expected, rel=1e-9)
    [legend] = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["sand", "rock"]


def test_limited_soils_show_their_stress():
    limited = {"model": "darendeli", "plasticity_index": 0, "mean_stress": 5e4}
    drawn = soils(clay={**limited, "shear_strength": 30e3}, sand=limited)
    figure = curve_figure(drawn)
    stress = figure.axes[2]
    assert stress.get_ylabel() == "Shear stress [kPa]"
    values = [np.asarray(line.get_ydata()) for line in stress.lines]
    [strength] = {y[0] for y in values if y.size == 2}
    [curve] = [y for y in values if y.size > 2 and not np.isnan(y).any()]
    assert strength == pytest.approx(30.0, rel=1e-12)
    assert curve.max() == pytest.approx(30.0, rel=0.02) and curve.max() < 30.0
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert texts == ["clay", "sand", "outside the table", "shear strength"]


def test_many_soils_are_told_apart():
    many = {
        f"layer {i}": {"model": "darendeli", "plasticity_index": i, "mean_stress": 1e4 + 1e4 * i}
        for i in range(24)
    }
    figure = curve_figure(soils(**many))
    [legend] = figure.legends
    lines = legend.get_lines()
    looks = {(to_hex(line.get_color()), str(line.get_linestyle()), line._dash_pattern[1] and
              tuple(line._dash_pattern[1])) for line in lines}  # fmt: skip
    assert len(lines) == len(looks) == 24
