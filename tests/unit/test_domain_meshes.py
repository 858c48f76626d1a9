# SPDX-License-Identifier: MIT
"""Mesh files with faults, as ``hytf check`` answers them: exit code 2, and each fault by name."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from support.meshes import gmsh_model, gmsh_section

from fenics_hytf.cli import main
from fenics_hytf.domain.files import read_mesh

SCENE = """
title = "A section"
[mesh]
file = "a.msh"
[soil.clay]
density = 1800.0
shear_wave_velocity = 200.0
poisson = 0.3
damping = 0.05
[soil.sand]
density = 1800.0
shear_wave_velocity = 200.0
poisson = 0.3
damping = 0.05
[[motion]]
direction = "x"
harmonic = { amplitude = 1.0, frequency = 2.0, cycles = 1, samples = 32 }
[boundary]
base = "rigid"
[output]
receivers = { middle = [2.0, 1.0] }
"""
CURVES = "{ strain = [1e-6, 1e-2], modulus = [1.0, 0.1], damping = [0.01, 0.2] }"
VERSIONS = pytest.mark.parametrize("version", [2.2, 4.1])


@pytest.fixture
def check(tmp_path, monkeypatch, capsys):
    """Check a scene of a.msh; what is wrong, by key."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments, scene=SCENE):
        Path("s.toml").write_text(scene)
        capsys.readouterr()  # meshio prints when it writes
        with pytest.raises(SystemExit) as stop:
            main(["check", "s.toml", *arguments])
        out, err = capsys.readouterr()
        assert "Traceback" not in err
        assert (stop.value.code, out) == (2, "") if err else stop.value.code == 0
        said = [line.removeprefix("hytf: ").split(": ", 1) for line in err.splitlines()]
        assert len({key for key, _ in said}) == len(said)
        return dict(said)

    return call


def section(groups, **options):
    """A section of 4 m x 2 m, clay under sand; groups may share a name."""
    with gmsh_model(Path("a.msh"), **options) as gmsh:
        geo = gmsh.model.geo
        places = [(0, 0), (4, 0), (4, 1), (0, 1), (4, 2), (0, 2)]
        a, b, c, d, e, f = (geo.addPoint(*place, 0, 0.7) for place in places)
        lines = [(a, b), (b, c), (c, d), (d, a), (c, e), (e, f), (f, d)]
        lines = [geo.addLine(*ends) for ends in lines]
        geo.addPlaneSurface([geo.addCurveLoop(lines[:4])])
        geo.addPlaneSurface([geo.addCurveLoop([-lines[2], *lines[4:]])])
        geo.synchronize()
        for name, dim, entities in groups:
            gmsh.model.addPhysicalGroup(dim, entities, name=name)


SOILS = [("clay", 2, [1]), ("sand", 2, [2])]
BASE = ("base", 1, [1])


@VERSIONS
@pytest.mark.parametrize("binary", [0, 1])
def test_a_sound_file(check, version, binary):
    section([*SOILS, BASE], MshFileVersion=version, Binary=binary)
    assert check() == {}
    data = read_mesh(Path("a.msh"), ("clay", "sand"))
    assert np.bincount(data.region).min() > 0 and set(data.facets) == {"base"}


# ---------------------------------------------------------------- names


@VERSIONS
@pytest.mark.parametrize("binary", [0, 1])
def test_a_region_and_a_boundary_of_one_name(check, version, binary):
    # meshio drops the first: there would be no upper side, or no base
    for groups in ([*SOILS, BASE, ("sand", 1, [6])], [("base", 2, [1, 2]), BASE]):
        section(groups, MshFileVersion=version, Binary=binary)
        found = check()["mesh.file"]
        name = groups[-1][0]
        assert f"groups of dimension 1 and 2 in a.msh that are all named '{name}'" in found
        assert "a name of its own for each physical group" in found


@VERSIONS
def test_two_boundaries_of_one_name(check, version):
    # gmsh drops the name of the second: half of the sides would be lost without a word
    section([*SOILS, BASE, ("side", 1, [2, 5]), ("side", 1, [4, 7])], MshFileVersion=version)
    found = check()["mesh.file"]
    assert "group 5 of dimension 1 in a.msh, which has no name" in found
    assert "gmsh drops one that is used twice" in found


@VERSIONS
def test_two_regions_of_one_name(check, version):
    section([("clay", 2, [1]), ("clay", 2, [2]), BASE], MshFileVersion=version)
    assert "group 2 of dimension 2 in a.msh, which has no name" in check()["mesh.file"]


def test_a_file_that_names_two_regions_alike(check):
    section([*SOILS, BASE])
    text = Path("a.msh").read_text()
    Path("a.msh").write_text(text.replace('"sand"', '"clay"'))
    assert "groups of dimension 2 and 2 in a.msh that are all named 'clay'" in check()["mesh.file"]


def test_sides_that_stand_on_nothing(check):
    # Held across the sides and shaken along them, the section would run, and fall.
    section([*SOILS, ("left", 1, [4, 7]), ("right", 1, [2, 5])])
    sides = SCENE.replace('base = "rigid"', 'left = "roller"\nright = "roller"')
    assert "no boundary named base, only left, right" in check(scene=sides)["mesh.file"]


@VERSIONS
def test_groups_of_which_none_has_a_name(check, version):
    section([("", 2, [1, 2])], MshFileVersion=version)
    assert "in no named region" in check()["mesh.file"]
    data = read_mesh(Path("a.msh"), ("clay",))  # one soil needs none
    assert data.region_names == ("clay",)


def test_a_region_without_soil(check):
    section([("clay", 2, [1]), ("silt", 2, [2]), BASE])
    assert check() == {"mesh.file": "found regions silt; expected a soil for each"}


def test_an_empty_region_of_another_name_is_told_once(check):
    section([("clay", 2, [1]), ("air", 2, [2]), BASE])
    expected = "found 'sky', no region of the mesh; expected one of air, clay"
    assert check("--set", "mesh.empty=['sky']") == {"mesh.empty[0]": expected}
    section([("silt", 2, [1]), ("air", 2, [2]), BASE])
    assert set(check("--set", "mesh.empty=['sky']")) == {"mesh.empty[0]", "mesh.file"}


def test_a_mesh_without_curves_is_told_once(check):
    section([*SOILS, BASE])
    loop = ("--set", "effects.equivalent_linear=true")
    said = "found no soil with curves; expected curves"
    assert check(*loop)["effects.equivalent_linear"] == f"{said} in one of the soils clay, sand"
    # of a soil that the mesh lacks: the mesh alone shows it
    chalk = SCENE.split("[soil.sand]")[1].split("[[motion]]")[0]
    scene = SCENE.replace("[[motion]]", f"[soil.chalk]{chalk}curves = {CURVES}\n[[motion]]")
    told = check(*loop, scene=scene)["effects.equivalent_linear"]
    assert told == f"{said} for one of the mesh's soils, clay, sand"


def test_a_boundary_that_the_mesh_lacks(check):
    section([*SOILS, BASE])
    scene = SCENE.replace('base = "rigid"', 'base = "rigid"\nleft = "roller"')
    expected = "found no such boundary in the mesh; expected base"
    assert check(scene=scene) == {"boundary.left": expected}


def test_a_soil_that_is_a_boundary(check):
    section([("clay", 2, [1, 2]), BASE, ("sand", 1, [6])])
    scene = SCENE.replace('base = "rigid"', 'base = "rigid"\nclay = "roller"')
    assert list(check(scene=scene)) == ["boundary.clay"]


# ---------------------------------------------------------------- dimensions


def test_the_skin_of_a_volume(check):
    with gmsh_model(Path("a.msh")) as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 2, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1, 2, 3, 4, 5, 6], name="clay")
    found = check()["mesh.file"]
    assert "cells of a.msh out of the plane z = const" in found
    assert "a 2D mesh in x and y, y up, or the cells of a volume" in found


@pytest.mark.parametrize(("dim", "kind"), [(0, "vertex"), (1, "line")])
def test_lines_or_points_only(check, dim, kind):
    with gmsh_model(Path("a.msh"), dim=1) as gmsh:
        gmsh.model.occ.addRectangle(0, 0, 0, 2, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(dim, [1], name="clay")
    found = check()["mesh.file"]
    assert (
        found == f"found no cells in a.msh, only {kind}; expected cells of an area or of a volume"
    )


# ---------------------------------------------------------------- cells


def test_inverted_cells(check):
    gmsh_section(Path("a.msh"), quads=True)
    mesh = meshio.read("a.msh")
    quads = next(block for block in mesh.cells if block.type == "quad")
    quads.data[3] = quads.data[3][::-1]
    meshio.Mesh(mesh.points, [("quad", quads.data)]).write("b.vtu")
    scene = SCENE.replace("a.msh", "b.vtu").split("[soil.sand]")
    scene = scene[0] + "[[motion]]" + scene[1].split("[[motion]]")[1]
    found = check(scene=scene)
    assert list(found) == ["mesh"]
    assert "found 1 cells with a non-positive Jacobian, by input cell: 3 (" in found["mesh"]


def test_a_part_that_floats(check):
    with gmsh_model(Path("a.msh")) as gmsh:
        for x in (0, 3):
            gmsh.model.occ.addRectangle(x, 0, 0, 2, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="clay")
        gmsh.model.addPhysicalGroup(2, [2], name="sand")
        gmsh.model.addPhysicalGroup(1, [1], name="base")
    found = check()["mesh.file"]
    assert "that hang together with nothing held" in found and "parts that share nodes" in found
