# SPDX-License-Identifier: MIT
"""``hytf check`` tells whether the ground stands at rest, as a run then finds it."""

import re
from pathlib import Path

import pytest
from mpi4py import MPI
from support.sliding import slope

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import factor_of_safety, simulate

# A vertical cut of 1 m in cells of H/20, γ = 18 kN/m3, γH/c = 2.
CUT = """
[mesh]
box = { size = [2.5, 1.5], cells = [50, 30] }
empty = ["air"]
[[mesh.regions]]
soil = "air"
polygon = [[0, 0.5], [1, 0.5], [1, 1.5], [0, 1.5]]
[[mesh.regions]]
soil = "clay"
[soil.clay]
density = 1800.0
shear_wave_velocity = 120.0
poisson = 0.3
cohesion = 9e3
[[motion]]
direction = "x"
harmonic = { amplitude = 1.0, frequency = 2.0, cycles = 1, samples = 32 }
[boundary]
left = "roller"
right = "roller"
[effects]
gravity = { acceleration = 10.0 }
sliding = true
"""
LEVEL = """
[mesh]
column = { width = 1.0, layers = [ { thickness = 4.0, soil = "clay", cells = 4 } ] }
[boundary]
left = "tied"
right = "tied"
"""
LOOKING = "hytf: looking for the factor of safety at rest: some tens of factorisations\n"


@pytest.fixture
def cut(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("cut.toml").write_text(CUT)


def told(out: str) -> str:
    (line,) = re.findall(r"^  stability       (.*)$", out, re.MULTILINE)
    return line


def test_of_a_vertical_cut(cut, hytf, figure):
    """N = γH/c is 3.776, approached from above: cells of H/20 are left 5 % too much."""
    code, out, err = hytf("check", "cut.toml")
    assert (code, err) == (0, LOOKING)
    safety = float(told(out).removeprefix("factor of safety at rest "))
    figure("hytf check, vertical cut: γH/c", 2 * safety, 3.95)
    figure("hytf check, vertical cut: γH/c", 2 * safety, 3.78, at_least=True)
    assert [path.name for path in Path().iterdir()] == ["cut.toml"]


def test_what_does_not_stand_is_refused_as_by_a_run(cut, hytf):
    weak = ("--set", "soil.clay.cohesion=4e3")
    answers = [hytf(command, "cut.toml", *weak) for command in ("check", "run")]
    for code, out, err in answers:
        assert code == 2 and "ok" not in out
        assert "effects.sliding: found a slope with a factor of safety of 0.8" in err
    code, out, _ = hytf("check", "cut.toml", *weak, "effects.sliding={unstable_at_rest=true}")
    assert code == 0
    assert re.fullmatch(
        r"factor of safety at rest 0\.8\d+, and unstable_at_rest lets it go", told(out)
    )


def test_of_level_ground(cut, hytf):
    sections = CUT.index("[soil"), CUT.index("[boundary]"), CUT.index("[effects]")
    soil, effects = CUT[sections[0] : sections[1]], CUT[sections[2] :]
    Path("level.toml").write_text(LEVEL + soil + effects)
    code, out, _ = hytf("check", "level.toml")
    assert code == 0
    assert told(out) == "no factor of safety at rest: gravity shears nothing"


@pytest.mark.parametrize("side", ["dashpot", "free_field"])
def test_ground_that_nothing_lets_slide_is_a_fault(cut, hytf, side):
    """One cell between two sides that hold it has nowhere to go."""
    sections = CUT.index("[soil"), CUT.index("[boundary]"), CUT.index("[effects]")
    soil, effects = CUT[sections[0] : sections[1]], CUT[sections[2] :]
    Path("held.toml").write_text(LEVEL.replace("tied", side) + soil + effects)
    for command in ("check", "run"):
        code, _, err = hytf(command, "held.toml")
        assert code == 2
        assert "effects.sliding: found boundaries that hold every node of soil along x" in err
    assert not Path("held-result").exists()


def test_shaken_in_two_directions_it_slides_where_it_can(cut, hytf):
    """A column a cell thick is held across by free field, and slides along the other axis."""
    text = CUT.replace("[2.5, 1.5]", "[1.0, 2.0, 1.0]").replace("[50, 30]", "[1, 2, 2]")
    start, end = text.index("empty"), text.index("[soil")
    boundary = 'left = "roller"\nright = "roller"\nfront = "tied"\nback = "tied"\n'
    text = text[:start] + text[end:].replace('left = "roller"\nright = "roller"\n', boundary)
    y = '[[motion]]\ndirection = "y"\nharmonic = { amplitude = 1.0, frequency = 2.0, '
    Path("s.toml").write_text(
        text.replace("[boundary]", y + "cycles = 1, samples = 32 }\n[boundary]")
    )
    code, _, err = hytf("run", "s.toml", "--no-plots", "--quiet")
    assert (code, err) == (0, "")


def test_nothing_is_looked_for_where_nothing_slides(cut, hytf, monkeypatch):
    monkeypatch.setattr("fenics_hytf.cli.check.factor_of_safety", None)  # fails if it is called
    code, out, err = hytf("check", "cut.toml", "--set", "effects.sliding=false")
    assert (code, err) == (0, "") and "stability" not in out


def test_vertical_motion_alone_is_a_fault(cut, hytf):
    code, out, err = hytf("check", "cut.toml", "--set", "motion.0.direction='y'")
    assert (code, out) == (2, "") and "motion: found vertical motion alone" in err


@pytest.mark.mpi
def test_is_that_of_a_run_on_any_number_of_ranks(figure):
    scene = Scene.from_dict(slope())
    alone = simulate(scene, MPI.COMM_SELF).lapses[0].slip.factor_of_safety
    off = abs(factor_of_safety(scene, MPI.COMM_WORLD) / alone - 1)
    # Moduli some 1e9 times apart: ranks that share a mesh know it to 1e-7.
    figure("factor of safety: hytf check against a run", off, 1e-7)
