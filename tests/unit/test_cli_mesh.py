# SPDX-License-Identifier: MIT
"""``hytf mesh``: kinds listed, meshes drawn, and every way it can be refused."""

import sys
from pathlib import Path

import pytest

from fenics_hytf.cli import mesh
from fenics_hytf.domain.files import read_mesh

KINDS = ["canyon", "embankment", "slope", "slope3d", "terraces"]
SCENE = """
title = "A slope"
[mesh]
file = "slope.msh"
[soil.soil]
density = 1800.0
shear_wave_velocity = 200.0
poisson = 0.3
damping = 0.05
[[motion]]
direction = "x"
harmonic = { amplitude = 1.0, frequency = 2.0, cycles = 1, samples = 32 }
[boundary]
left = "roller"
right = "roller"
[output]
receivers = { crest = [5.0, 6.0] }
"""


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("arguments", [(), ("--help",), ("-h",)])
def test_the_kinds_are_listed(here, hytf, arguments):
    code, out, err = hytf("mesh", *arguments)
    assert (code, err) == (0, "")
    lines = out.splitlines()[: len(KINDS)]
    assert [line.split()[0] for line in lines] == KINDS
    assert all(" Mesh of a " in line and len(line) < 90 for line in lines)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_tells_its_options(here, hytf, kind):
    code, out, err = hytf("mesh", kind, "--help")
    assert (code, err) == (0, "")
    assert out.startswith(f"usage: hytf mesh {kind} ") and "--force" in out and "--output" in out
    assert names(here) == []


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_drawn(here, hytf, kind):
    size = ["--size", "5"] if kind in ("slope3d", "terraces") else []
    code, out, err = hytf("mesh", kind, *size)
    assert (code, err) == (0, "")
    assert names(here) == [f"{kind}.msh"]
    region = {"canyon": "rock", "embankment": "fill"}.get(kind, "soil")
    data = read_mesh(Path(f"{kind}.msh"), (region,))
    assert out.startswith(f"{kind}.msh: {len(data.cells)} cells ({region} {len(data.cells)}), ")


def test_options_are_handed_on(here, hytf):
    arguments = "--height 6 --angle 45 --depth 2 --behind 7 --before 8 --layers rock:1 clay"
    arguments += " --seam 0 8 14 2 1.5 --air 1.5 -o mine.msh"
    code, out, err = hytf("mesh", "slope", *arguments.split())
    assert (code, err) == (0, "")
    assert all(name in out for name in ("mine.msh: ", "rock ", "clay ", "seam ", "air "))
    data = read_mesh(Path("mine.msh"), ("rock", "clay", "seam"))
    assert data.points.max(axis=0) == pytest.approx([7 + 6 + 8, 2 + 6 + 1.5])
    assert set(data.region_names) == {"rock", "clay", "seam", "air"}


def test_what_is_said_of_the_cells(here, hytf):
    # a cut 10 m high with cells of 1 m x 1 m x 2 m
    arguments = [
        "--angle",
        "90",
        "--size",
        "1",
        "--style",
        "grid",
        "--behind",
        "2",
        "--before",
        "2",
    ]
    assert hytf("mesh", "slope", *arguments, "--depth", "2")[1] == (
        "slope.msh: 28 cells (soil 28), longest side 1 m, ratio of sides at most 1, inverse "
        "condition number at least 1\n"
    )


def test_a_drawn_slope_can_be_computed_with(here, hytf):
    size = "--height 4 --depth 2 --size 2 --behind 8 --before 8"
    assert hytf("mesh", "slope", *size.split())[0] == 0
    Path("s.toml").write_text(SCENE)
    code, out, err = hytf("check", "s.toml")
    assert code == 0, err
    assert out.startswith("ok")


def test_a_file_is_replaced_only_when_told(here, hytf):
    Path("slope.msh").write_text("mine")
    code, out, err = hytf("mesh", "slope", "--size", "5")
    assert (code, out) == (2, "") and "--force" in err
    assert Path("slope.msh").read_text() == "mine"
    assert hytf("mesh", "slope", "--size", "5", "--force")[0] == 0
    assert Path("slope.msh").read_text() != "mine"
    assert names(here) == ["slope.msh"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("hill",), "expected one of canyon, embankment, slope, slope3d, terraces"),
        (("_section",), "expected one of"),
        (("-o", "a.msh"), "found '-o'"),
        (("slope", "--hight", "3"), "unrecognized arguments: --hight 3"),
        (("slope", "--height", "tall"), "invalid float value: 'tall'"),
        (("slope", "--height"), "expected one argument"),
        (("slope", "--height", "-3"), "found height -3.0; expected a positive number"),
        (("slope3d", "--height", "1e-300"), "expected a positive number, from 1e-06 to 1e+09"),
        (("slope", "--slope", "2", "--angle", "30"), "not allowed with"),
        (("slope", "--layers", "clay:deep", "sand"), "'clay:deep' is no NAME or NAME:TOP"),
        (("slope", "--seam", "1", "2"), "expected 5 arguments"),
        (("slope", "--style", "round"), "invalid choice: 'round'"),
        (("embankment", "--cells", "0", "4"), "at least one cell a direction"),
        (("canyon", "--depth", "1"), "more than twice as much"),
        (("slope", "-o", "a.vtk"), "expected a file that ends in .msh"),
        (("slope", "-o", "nowhere/a.msh"), "found no folder nowhere"),
        (("slope", "-o", "folder.msh"), "found the folder folder.msh"),
    ],
)
def test_faults_write_nothing(here, hytf, arguments, said):
    Path("folder.msh").mkdir()
    code, out, err = hytf("mesh", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("hytf: ") and said in err and len(err.splitlines()) == 1
    assert names(here) == ["folder.msh"] and names(here / "folder.msh") == []


def test_what_went_wrong_while_drawing_leaves_nothing(here, hytf, monkeypatch):
    def inverted(path):
        assert path.exists() and path.name == "slope.msh"
        raise RuntimeError("found 3 inverted cells; expected none")

    monkeypatch.setattr(mesh, "describe_mesh", inverted)
    code, out, err = hytf("mesh", "slope", "--size", "5")
    assert (code, out, err) == (3, "", "hytf: mesh slope: found 3 inverted cells; expected none\n")
    assert names(here) == []


def test_without_gmsh(here, hytf, monkeypatch):
    for name in [name for name in sys.modules if name in ("gmsh", "_file", "_ground", "_section")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "gmsh", None)
    assert hytf("mesh")[0] == 0  # they are listed all the same
    code, out, err = hytf("mesh", "slope")
    assert (code, out) == (2, "") and "fenics-hytf[gmsh]" in err
    assert names(here) == []


def test_only_the_first_rank_draws(here, hytf, monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "1")
    assert hytf("mesh", "slope", "--size", "5") == (0, "", "")
    assert names(here) == []


def test_scripts_are_found_beside_the_package():
    assert mesh.mesh_folder().name == "meshes"
