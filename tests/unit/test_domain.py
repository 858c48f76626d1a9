# SPDX-License-Identifier: MIT
"""Meshes: made or read, with their regions and boundaries, and those that are refused."""

import re

import basix
import basix.ufl
import meshio
import numpy as np
import pytest
import ufl
from dolfinx.fem import assemble_scalar, form
from dolfinx.mesh import compute_midpoints, create_mesh
from mpi4py import MPI
from support.meshes import gmsh_block, gmsh_model, gmsh_section, scene

from fenics_hytf.domain import build, jacobian_determinants, refuse_inverted_cells
from fenics_hytf.scene import SceneError

SELF = MPI.COMM_SELF
EPS = np.finfo(np.float64).eps
ULPS = 10 * 10 * EPS  # a few roundings of coordinates up to 10 m
RULE = 1000 * EPS  # sums over some hundred quadrature points or facets


def volumes(domain) -> np.ndarray:
    """Volume of each cell of the input, by the rule that integrates a trilinear Jacobian."""
    cell = getattr(basix.CellType, domain.mesh.topology.cell_name())
    X, w = basix.make_quadrature(cell, 4)
    return domain.gather_cells(jacobian_determinants(domain.mesh, X) @ w)


def midpoints(domain) -> np.ndarray:
    """Of each cell of the input, by dolfinx."""
    tdim = domain.mesh.topology.dim
    cells = np.arange(domain.num_owned_cells, dtype=np.int32)
    return domain.gather_cells(compute_midpoints(domain.mesh, tdim, cells)[:, : domain.gdim])


def facet_midpoints(domain, name) -> np.ndarray:
    fdim = domain.mesh.topology.dim - 1
    return compute_midpoints(domain.mesh, fdim, domain.boundaries[name])[:, : domain.gdim]


def exterior(domain, facets) -> np.ndarray:
    """Cell and local facet of exterior facets, as dolfinx integrates them."""
    topology = domain.mesh.topology
    tdim = topology.dim
    topology.create_connectivity(tdim - 1, tdim)
    topology.create_connectivity(tdim, tdim - 1)
    to_cell, to_facet = topology.connectivity(tdim - 1, tdim), topology.connectivity(tdim, tdim - 1)
    pairs = [(c, list(to_facet.links(c)).index(f)) for f in facets for c in to_cell.links(f)]
    return np.array(pairs, np.int32).ravel()


def measure(domain, name) -> float:
    ds = ufl.Measure(
        "ds", domain.mesh, subdomain_data=[(1, exterior(domain, domain.boundaries[name]))]
    )
    return assemble_scalar(form(1.0 * ds(1), dtype=np.complex128)).real


def soils_of_cells(domain) -> list[str]:
    return [domain.region_names[r] for r in domain.gather_cells(domain.regions)]


def faults(mesh, soils=("clay",), **sections) -> dict[str, str]:
    """What building a scene's mesh finds wrong, by key."""
    with pytest.raises(SceneError) as caught:
        build(scene(mesh, soils, **sections), SELF)
    return {fault.key: f"{fault.found}; {fault.expected}" for fault in caught.value.faults}


# ---------------------------------------------------------------- column


def column():
    layers = [
        {"thickness": 1.0, "soil": "clay", "cells": 2},
        {"thickness": 6.0, "soil": "sand", "cells": 3},
        {"thickness": 3.0, "soil": "clay", "cells": 1},
    ]
    return build(scene({"column": {"width": 2.0, "layers": layers}}), SELF)


def test_column_numbers_its_cells_from_the_top():
    domain = column()
    depth = 10.0 - midpoints(domain)[:, 1]
    np.testing.assert_allclose(depth, [0.25, 0.75, 2, 4, 6, 8.5], rtol=0, atol=ULPS)
    assert soils_of_cells(domain) == ["clay", "clay", "sand", "sand", "sand", "clay"]
    np.testing.assert_allclose(volumes(domain), [1, 1, 4, 4, 4, 6], rtol=RULE)


def test_column_knows_its_sides():
    domain = column()
    counts = {name: len(facets) for name, facets in domain.boundaries.items()}
    assert counts == {"base": 1, "top": 1, "left": 6, "right": 6}
    assert facet_midpoints(domain, "base").tolist() == [[1.0, 0.0]]
    assert facet_midpoints(domain, "top").tolist() == [[1.0, 10.0]]
    assert not facet_midpoints(domain, "left")[:, 0].any()
    assert np.all(facet_midpoints(domain, "right")[:, 0] == 2.0)


def test_column_of_thirds_still_finds_its_base_and_top():
    # Thicknesses whose sums round: levels come from one cumulative sum.
    layers = [{"thickness": 0.1 * k, "soil": "clay", "cells": 3} for k in (1, 2, 3, 7, 9)]
    domain = build(scene({"column": {"width": 0.3, "layers": layers}}, ("clay",)), SELF)
    assert [len(domain.boundaries[name]) for name in ("base", "top", "left")] == [1, 1, 15]


# ---------------------------------------------------------------- box

BOXES = {
    "quadrilateral": ([6.0, 3.0], [4, 3], 1),
    "triangle": ([6.0, 3.0], [4, 3], 2),
    "hexahedron": ([6.0, 3.0, 2.0], [3, 2, 2], 1),
    "tetrahedron": ([6.0, 3.0, 2.0], [3, 2, 2], 6),
}


@pytest.mark.parametrize("cell", BOXES)
@pytest.mark.parametrize("degree", [1, 2])
def test_box(cell, degree):
    size, cells, parts = BOXES[cell]
    mesh = {"box": {"size": size, "cells": cells, "cell": cell}, "degree": degree}
    domain = build(scene(mesh, ("clay",)), SELF)
    assert domain.num_cells == parts * np.prod(cells)
    volume = volumes(domain)
    np.testing.assert_allclose(volume, np.prod(size) / domain.num_cells, rtol=RULE)
    x = midpoints(domain)
    assert np.all((x > 0) & (x < size))
    assert domain.V.ufl_element().degree == degree
    area = {"base": -1, "top": -1, "left": 0, "right": 0, "front": 1, "back": 1}
    assert set(domain.boundaries) == set(list(area)[: 2 * len(size)])
    for name in domain.boundaries:
        assert measure(domain, name) == pytest.approx(
            np.prod(size) / size[area[name]], rel=100 * EPS
        )


def test_box_numbers_cells_x_fastest_from_the_base():
    domain = build(scene({"box": {"size": [4.0, 2.0], "cells": [4, 2]}}, ("clay",)), SELF)
    expected = [[x + 0.5, y + 0.5] for y in range(2) for x in range(4)]
    np.testing.assert_allclose(midpoints(domain), expected, atol=ULPS)


@pytest.mark.parametrize("cell", BOXES)
def test_regions_below_go_by_centroid(cell):
    size, cells, _ = BOXES[cell]
    regions = [{"soil": "clay", "below": size[-1] / 2}, {"soil": "sand"}]
    mesh = {"box": {"size": size, "cells": cells, "cell": cell}, "regions": regions}
    domain = build(scene(mesh), SELF)
    height = midpoints(domain)[:, -1]
    assert soils_of_cells(domain) == ["clay" if z < size[-1] / 2 else "sand" for z in height]
    assert set(soils_of_cells(domain)) == {"clay", "sand"}


def test_the_first_region_that_matches_wins():
    square = [[1, 0], [3, 0], [3, 2], [1, 2]]
    regions = [
        {"soil": "seam", "polygon": square},
        {"soil": "clay", "below": 1.0},
        {"soil": "sand"},
    ]
    mesh = {"box": {"size": [4.0, 2.0], "cells": [4, 2]}, "regions": regions}
    domain = build(scene(mesh, ("clay", "sand", "seam")), SELF)
    lower, upper = ["clay", "seam", "seam", "clay"], ["sand", "seam", "seam", "sand"]
    assert soils_of_cells(domain) == lower + upper


def test_a_triangle_outside_every_region_is_refused():
    # The square's centre lies in the region, the centroid of one of its triangles does not.
    regions = [{"soil": "clay", "polygon": [[-1, -1], [0.6, -1], [0.6, 2], [-1, 2]]}]
    mesh = {"box": {"size": [1.0, 1.0], "cells": [1, 1], "cell": "triangle"}, "regions": regions}
    found = faults(mesh)
    assert list(found) == ["mesh.regions"]
    assert "1 cells in no region" in found["mesh.regions"]
    assert "[0.666666" in found["mesh.regions"]


# ---------------------------------------------------------------- gmsh


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("quads", [False, True])
@pytest.mark.parametrize("order", [1, 2])
def test_gmsh_section(tmp_path, order, quads, version):
    file = gmsh_section(tmp_path / "a.msh", order=order, quads=quads, MshFileVersion=version)
    domain = build(scene({"file": str(file), "degree": order}), SELF)
    assert domain.mesh.topology.cell_name() == ("quadrilateral" if quads else "triangle")
    assert domain.mesh.geometry.cmap.degree == order
    assert volumes(domain).sum() == pytest.approx(8.0, rel=RULE)
    for soil, height in zip(soils_of_cells(domain), midpoints(domain)[:, 1], strict=True):
        assert soil == ("clay" if height < 1 else "sand")
    assert set(domain.boundaries) == {"base", "left", "right"}
    assert not facet_midpoints(domain, "base")[:, 1].any()
    assert not facet_midpoints(domain, "left")[:, 0].any()
    assert np.all(facet_midpoints(domain, "right")[:, 0] == 4.0)
    assert measure(domain, "left") == pytest.approx(2.0, rel=RULE)


@pytest.mark.parametrize("order", [1, 2])
def test_gmsh_tetrahedra(tmp_path, order):
    file = gmsh_block(tmp_path / "a.msh", order=order)
    domain = build(scene({"file": str(file)}, ("sand",)), SELF)
    assert domain.mesh.topology.cell_name() == "tetrahedron"
    assert domain.mesh.geometry.cmap.degree == order
    assert volumes(domain).sum() == pytest.approx(2.0, rel=RULE)
    assert measure(domain, "base") == pytest.approx(2.0, rel=RULE)


def test_second_order_cells_bend(tmp_path):
    # A quarter of a disc: straight sides lose 1 - sin(h)/h of its area, at h = π/8 a fortieth.
    file = tmp_path / "disc.msh"
    with gmsh_model(file, order=2) as gmsh:
        geo = gmsh.model.geo
        o, a, b = (geo.addPoint(*x, 0, 1) for x in ((0, 0), (1, 0), (0, 1)))
        lines = [geo.addLine(o, a), geo.addCircleArc(a, o, b), geo.addLine(b, o)]
        geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], name="clay")
        gmsh.model.addPhysicalGroup(1, [1], name="base")
    domain = build(scene({"file": str(file)}, ("clay",)), SELF)
    # A parabola through three points of an arc of π/4 is off by 1e-3 of the segment it cuts.
    assert volumes(domain).sum() == pytest.approx(np.pi / 4, rel=1e-3)


def test_a_curve_may_be_in_two_groups(tmp_path):
    groups = {
        "clay": (2, [1]),
        "sand": (2, [2]),
        "base": (1, [1]),
        "left": (1, [4, 7]),
        "sides": (1, [2, 4, 5, 7]),
    }
    for version in (2.2, 4.1):
        file = gmsh_section(tmp_path / "a.msh", groups=groups, MshFileVersion=version)
        domain = build(scene({"file": str(file)}, boundary={"sides": "roller"}), SELF)
        assert measure(domain, "sides") == pytest.approx(4.0, rel=RULE)
        assert measure(domain, "left") == pytest.approx(2.0, rel=RULE)


def test_a_group_that_is_no_soil_does_not_hide_the_soil(tmp_path):
    groups = {"clay": (2, [1]), "sand": (2, [2]), "all": (2, [1, 2]), "base": (1, [1])}
    file = gmsh_section(tmp_path / "a.msh", groups=groups)
    domain = build(scene({"file": str(file)}), SELF)
    assert set(soils_of_cells(domain)) == {"clay", "sand"}
    # Version 2 writes such cells twice, which dolfinx crashes on.
    file = gmsh_section(tmp_path / "b.msh", groups=groups, MshFileVersion=2.2)
    assert "of the same nodes" in faults({"file": str(file)}, ("clay", "sand"))["mesh.file"]


def test_one_soil_needs_no_names(tmp_path):
    file = gmsh_section(tmp_path / "a.msh", groups={})
    domain = build(scene({"file": str(file)}, ("clay",)), SELF)
    assert set(soils_of_cells(domain)) == {"clay"}
    assert set(domain.boundaries) == {"base", "top", "left", "right"}
    assert measure(domain, "top") == pytest.approx(4.0, rel=RULE)


# ---------------------------------------------------------------- other formats

# Two squares side by side and a strip above them, corner (3, -1) m.
PLACES = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0, 3], [1, 3], [2, 3]], float)
SQUARES = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])


def write(path, cells, kind="quad", places=PLACES, **more):
    points = np.column_stack([places, np.zeros((len(places), 3 - places.shape[1]))])
    mesh = meshio.Mesh(points, [(kind, np.asarray(cells)), *more.pop("blocks", [])], **more)
    if path.suffix == ".med":
        mesh.cell_tags = more.get("cell_tags", {})
    mesh.write(path)
    return {"file": str(path)}


@pytest.mark.parametrize("ending", ["inp", "med", "vtu", "vtk", "xdmf", "bdf", "mesh"])
def test_formats_without_names(tmp_path, ending):
    shifted = PLACES + np.array([3.0, -1.0])
    domain = build(scene(write(tmp_path / f"a.{ending}", SQUARES, places=shifted), ("clay",)), SELF)
    np.testing.assert_allclose(volumes(domain), [1, 1, 2, 2], rtol=RULE)
    assert midpoints(domain).tolist() == [[3.5, -0.5], [4.5, -0.5], [3.5, 1], [4.5, 1]]
    assert {n: len(f) for n, f in domain.boundaries.items()} == {
        "base": 2,
        "top": 2,
        "left": 2,
        "right": 2,
    }


def test_hexahedra_in_vtu(tmp_path):
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 2) for x in (0, 1, 3)], float)
    hexes = [[0, 1, 4, 3, 6, 7, 10, 9], [1, 2, 5, 4, 7, 8, 11, 10]]
    domain = build(scene(write(tmp_path / "a.vtu", hexes, "hexahedron", cube), ("clay",)), SELF)
    np.testing.assert_allclose(volumes(domain), [2, 4], rtol=RULE)
    assert {n: len(f) for n, f in domain.boundaries.items()} == {
        "base": 2,
        "top": 2,
        "left": 1,
        "right": 1,
        "front": 2,
        "back": 2,
    }


def test_sets_of_abaqus(tmp_path):
    sets = {
        "clay": [np.array([0, 1]), np.array([], int)],
        "sand": [np.array([2, 3]), np.array([], int)],
        "base": [np.array([], int), np.array([0, 1])],
    }
    blocks = [("line", np.array([[0, 1], [1, 2]]))]
    mesh = write(tmp_path / "a.inp", SQUARES, blocks=blocks, cell_sets=sets)
    domain = build(scene(mesh), SELF)
    assert soils_of_cells(domain) == ["clay", "clay", "sand", "sand"]
    assert {n: len(f) for n, f in domain.boundaries.items()} == {"base": 2}


def test_families_of_med(tmp_path):
    # A family carries several group names; MED numbers families of cells below zero.
    points = np.column_stack([PLACES, np.zeros(len(PLACES))])
    blocks = [("quad", SQUARES), ("line", np.array([[0, 1], [1, 2]]))]
    families = [np.array([-1, -1, -2, -3]), np.array([-4, -4])]
    mesh = meshio.Mesh(points, blocks, cell_data={"cell_tags": families})
    mesh.cell_tags = {-1: ["clay"], -2: ["sand"], -3: ["sand", "corner"], -4: ["base"]}
    mesh.write(tmp_path / "a.med")
    domain = build(scene({"file": str(tmp_path / "a.med")}), SELF)
    assert soils_of_cells(domain) == ["clay", "clay", "sand", "sand"]
    assert {n: len(f) for n, f in domain.boundaries.items()} == {"base": 2}


def test_nodes_that_no_cell_uses_are_dropped(tmp_path):
    mesh = write(tmp_path / "a.vtu", [[3, 4, 7, 6]], places=PLACES)
    domain = build(scene(mesh, ("clay",)), SELF)
    assert domain.mesh.geometry.x.shape[0] == 4
    assert volumes(domain).tolist() == pytest.approx([2.0], rel=RULE)


# ---------------------------------------------------------------- files that are refused


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.msh", "not a mesh", "Couldn't read file"),
        ("a.msh", "", "ValueError"),
        ("a.vtu", "<VTKFile>", "not readable"),
        ("a.step", "x", "Could not deduce file format"),
        ("a", "x", "Could not deduce file format"),
    ],
)
def test_unreadable_files(tmp_path, capfd, name, content, said):
    (tmp_path / name).write_text(content)
    found = faults({"file": str(tmp_path / name)})
    assert list(found) == ["mesh.file"]
    assert said in found["mesh.file"]
    assert capfd.readouterr() == ("", "")  # meshio prints, a library does not


def test_serendipity_cells(tmp_path):
    file = gmsh_section(tmp_path / "a.msh", order=2, quads=True, SecondOrderIncomplete=1)
    found = faults({"file": str(file)}, ("clay", "sand"))["mesh.file"]
    assert "quad8" in found
    assert "not serendipity" in found


def test_mixed_cells(tmp_path):
    blocks = [("triangle", np.array([[3, 4, 7], [3, 7, 6]]))]
    found = faults(write(tmp_path / "a.vtu", SQUARES[:2], blocks=blocks))["mesh.file"]
    assert found.startswith("quad, triangle in a.vtu; cells of one type")


def test_no_cells(tmp_path):
    found = faults(write(tmp_path / "a.vtu", [[0, 1], [1, 2]], "line"))["mesh.file"]
    assert found.startswith("no cells in a.vtu")


def test_a_2d_mesh_on_edge(tmp_path):
    upright = PLACES @ [[1.0, 0, 0], [0, 0, 1]]
    found = faults(write(tmp_path / "a.vtu", SQUARES, places=upright))["mesh.file"]
    assert "out of the plane z = const" in found


def test_cells_in_no_region(tmp_path):
    groups = {"clay": (2, [1]), "base": (1, [1])}
    file = gmsh_section(tmp_path / "a.msh", groups=groups, SaveAll=1, MshFileVersion=2.2)
    found = faults({"file": str(file)}, ("clay", "sand"))["mesh.file"]
    assert re.match(r"\d+ cells of a.msh in no named region, the first cell \d+", found)
    # meshio 5.3 cannot read version 4 files of which only some entities have a group.
    file = gmsh_section(tmp_path / "b.msh", groups=groups, SaveAll=1)
    found = faults({"file": str(file)}, ("clay", "sand"))["mesh.file"]
    assert "every cell in a physical group or none" in found


def test_several_soils_and_no_region(tmp_path):
    found = faults(write(tmp_path / "a.vtu", SQUARES), ("clay", "sand"))["mesh.file"]
    assert "4 cells of a.vtu in no named region, the first cell 0" in found


def test_a_region_without_soil(tmp_path):
    found = faults({"file": str(gmsh_section(tmp_path / "a.msh"))}, ("clay",))
    assert found == {"mesh.file": "regions sand; a soil for each"}


def test_a_cell_in_two_soils(tmp_path):
    groups = {"clay": (2, [1]), "sand": (2, [1, 2]), "base": (1, [1])}
    file = gmsh_section(tmp_path / "a.msh", groups=groups)
    assert "one soil a cell" in faults({"file": str(file)}, ("clay", "sand"))["mesh.file"]


def test_every_unknown_boundary_and_axis_at_once(tmp_path):
    motion = [
        {"direction": "z", "harmonic": {"amplitude": 1, "frequency": 1, "cycles": 1, "samples": 8}}
    ]
    found = faults(
        {"file": str(gmsh_section(tmp_path / "a.msh"))},
        ("clay", "sand"),
        boundary={"lft": "roller", "rigth": "roller", "base": "rigid"},
        motion=motion,
    )
    assert found == {
        "boundary.lft": "no such boundary in the mesh; base, right, left",
        "boundary.rigth": "no such boundary in the mesh; base, right, left",
        "motion[0].direction": '"z"; "x" or "y": the mesh is a section in plane strain',
    }


def test_kinematics_of_a_3d_file(tmp_path):
    mesh = {"file": str(gmsh_block(tmp_path / "a.msh")), "kinematics": "plane_strain"}
    assert list(faults(mesh, ("sand",))) == ["mesh.kinematics"]


def test_a_file_without_base(tmp_path):
    # What is held then is for the constraints to say.
    groups = {"clay": (2, [1]), "sand": (2, [2]), "left": (1, [4, 7])}
    mesh = {"file": str(gmsh_section(tmp_path / "a.msh", groups=groups))}
    held = build(scene(mesh, boundary={"left": "fixed"}), SELF)
    assert set(held.boundaries) == {"left"}


def two_rectangles(file, apart):
    with gmsh_model(file) as gmsh:
        occ = gmsh.model.occ
        lower, upper = occ.addRectangle(0, 0, 0, 2, 1), occ.addRectangle(0, 1 + apart, 0, 2, 1)
        occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [lower], name="clay")
        gmsh.model.addPhysicalGroup(2, [upper], name="sand")
        gmsh.model.addPhysicalGroup(1, [1], name="base")
        gmsh.model.addPhysicalGroup(1, [7], name="top")
    return file


def test_parts_that_touch_and_share_no_node_are_refused(tmp_path):
    file = two_rectangles(tmp_path / "a.msh", 0.0)
    for held in ({}, {"top": "fixed"}):  # whether or not the upper one would float
        with pytest.raises(SceneError, match=r"in one place, the first at \(.*, 1\)"):
            build(scene({"file": str(file)}, boundary=held), SELF)


def test_a_part_that_floats_is_refused(tmp_path):
    file = two_rectangles(tmp_path / "a.msh", 0.5)
    found = faults({"file": str(file)}, ("clay", "sand"))["mesh.file"]
    assert "that hang together with nothing held" in found
    mesh = meshio.read(file)
    lower = sum(len(b.data) for b in mesh.cells if b.type == "triangle" and _flat_below(mesh, b))
    assert f"the first {lower}," in found
    # Two parts, each of them held, are two parts.
    build(scene({"file": str(file)}, boundary={"top": "fixed"}), SELF)


def _flat_below(mesh, block) -> bool:
    return bool(mesh.points[block.data.ravel(), 1].max() <= 1.0)


def test_an_uneven_floor_needs_a_name(tmp_path):
    uneven = PLACES.copy()
    uneven[2, 1] = 0.25
    found = faults(write(tmp_path / "a.vtu", SQUARES, places=uneven))["mesh.file"]
    assert "whose lowest side is not level" in found


def test_a_boundary_that_is_no_side(tmp_path):
    # The named line joins two nodes, but is no side of a cell.
    sets = {"clay": [np.arange(4), None], "base": [None, np.array([0])]}
    sets = {name: [np.array([], int) if s is None else s for s in v] for name, v in sets.items()}
    blocks = [("line", np.array([[0, 4]]))]
    found = faults(write(tmp_path / "a.inp", SQUARES, blocks=blocks, cell_sets=sets))
    assert found == {
        "boundary.base": "no side of a cell; a boundary made of sides of the mesh's cells"
    }


# ---------------------------------------------------------------- cells that are refused


def moved(**places):
    """The four squares with some nodes elsewhere."""
    nodes = PLACES.copy()
    for name, place in places.items():
        nodes[int(name[1:])] = place
    return nodes


def test_two_nodes_in_one_place_are_refused(tmp_path):
    found = faults(write(tmp_path / "a.vtu", SQUARES, places=moved(n6=[1.0, 3.0])))
    assert found["mesh.file"].startswith("1 pairs of nodes of a.vtu in one place")


@pytest.mark.parametrize(
    ("places", "cells", "bad"),
    [
        (PLACES, [SQUARES[0], SQUARES[1][::-1], *SQUARES[2:]], [1]),  # clockwise
        (PLACES, [*SQUARES[:2], SQUARES[2][[0, 2, 1, 3]], SQUARES[3]], [2]),  # bow tie
        (moved(n6=[0.8, 1.2]), SQUARES, [2]),  # concave
        (moved(n4=[1.0, 3.5]), SQUARES, [2, 3]),  # inverted by a node pulled through
        (moved(n6=[0.5, 2.0]), SQUARES, [2]),  # a corner of 180°: the Jacobian vanishes there
    ],
    ids=["clockwise", "bow tie", "concave", "inverted", "flat corner"],
)
def test_quadrilaterals_that_are_refused(tmp_path, places, cells, bad):
    found = faults(write(tmp_path / "a.vtu", cells, places=places))
    listed = re.findall(r"(\d+) \(", found["mesh"])
    assert [int(cell) for cell in listed] == bad
    assert found["mesh"].startswith(f"{len(bad)} cells with a non-positive Jacobian, by input cell")
    assert "counter-clockwise" in found["mesh"]


def test_a_mesh_drawn_clockwise_names_five_of_its_cells(tmp_path):
    file = gmsh_section(tmp_path / "a.msh")
    mesh = meshio.read(file)
    for block in mesh.cells:
        if block.type == "triangle":
            block.data = block.data[:, ::-1].copy()
    mesh.cell_data, mesh.cell_sets = {}, {}
    mesh.write(tmp_path / "b.vtu")
    found = faults({"file": str(tmp_path / "b.vtu")})["mesh"]
    count = sum(len(b.data) for b in mesh.cells if b.type == "triangle")
    assert found.startswith(f"{count} cells")
    assert "reverse the surface in the mesh generator" in found
    assert len(re.findall(r"\d+ \(", found)) == 5


def test_the_input_number_survives_reordering(tmp_path):
    # dolfinx renumbers cells: the number in the message has to be the file's.
    n = 12
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
    places = np.column_stack([x.ravel(), y.ravel()])
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    cells = corner[:, None] + [0, 1, n + 2, n + 1]
    cells[101] = cells[101][::-1]
    found = faults(write(tmp_path / "a.vtu", cells, places=places))["mesh"]
    assert "by input cell: 101 (" in found


@pytest.mark.parametrize("cell", ["triangle", "tetrahedron", "hexahedron"])
def test_other_cells_that_are_refused(cell):
    kind = getattr(basix.CellType, cell)
    x = basix.geometry(kind).copy()
    gdim = x.shape[1]
    good = np.arange(len(x))[None, :]
    element = basix.ufl.element("Lagrange", cell, 1, shape=(gdim,))
    refuse_inverted_cells(create_mesh(SELF, good, x, element))
    mirrored = x * ([-1] + [1] * (gdim - 1))
    with pytest.raises(SceneError, match="right-handed"):
        refuse_inverted_cells(create_mesh(SELF, good, mirrored, element))


def test_a_hexahedron_with_one_corner_pushed_in_is_refused():
    x = basix.geometry(basix.CellType.hexahedron).copy()
    x[7] = 0.3
    element = basix.ufl.element("Lagrange", "hexahedron", 1, shape=(3,))
    with pytest.raises(SceneError, match="input cell: 0"):
        refuse_inverted_cells(create_mesh(SELF, np.arange(8)[None, :], x, element))


def test_a_bent_cell_that_folds_inside_is_refused():
    # Vertices of a unit triangle; a midside node pulled past the opposite one folds it.
    x = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [0, 0.5], [0.5, 0]])
    cells = np.arange(6)[None, :]
    element = basix.ufl.element("Lagrange", "triangle", 2, shape=(2,))
    refuse_inverted_cells(create_mesh(SELF, cells, x, element))
    x[5] = [0.5, 0.45]
    with pytest.raises(SceneError, match="non-positive Jacobian"):
        refuse_inverted_cells(create_mesh(SELF, cells, x, element))


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ([SQUARES[0], [1, 2, 5, 5]], "cell 1 with a node twice"),
        ([SQUARES[0], SQUARES[1], SQUARES[1][[2, 3, 0, 1]]], "cells 1 and 2 of the same nodes"),
        ([*SQUARES, [4, 1, 0, 8]], "cells 0, 1, 4 at one facet"),
        ([SQUARES[0], [1, 2, 5, 99]], "with nodes that it does not hold"),
    ],
)
def test_cells_that_make_no_mesh(tmp_path, cells, said):
    assert said in faults(write(tmp_path / "a.vtu", cells))["mesh.file"]


@pytest.mark.parametrize("x", [np.nan, np.inf, 1e300])
def test_nodes_that_are_no_numbers(tmp_path, x):
    found = faults(write(tmp_path / "a.vtu", SQUARES, places=moved(n4=[x, 1.0])))
    assert "node 4 of a.vtu" in found["mesh.file"]


# ---------------------------------------------------------------- several ranks


@pytest.mark.mpi
@pytest.mark.parametrize("cell", BOXES)
def test_cells_gather_in_the_order_of_the_input(cell):
    size, cells, _ = BOXES[cell]
    regions = [{"soil": "clay", "below": 1.0}, {"soil": "sand"}]
    section = scene({"box": {"size": size, "cells": cells, "cell": cell}, "regions": regions})
    mine, alone = build(section, MPI.COMM_WORLD), build(section, SELF)
    np.testing.assert_array_equal(midpoints(mine), midpoints(alone))
    np.testing.assert_array_equal(
        mine.gather_cells(mine.regions), alone.gather_cells(alone.regions)
    )
    for name, facets in alone.boundaries.items():
        assert MPI.COMM_WORLD.allreduce(len(mine.boundaries[name])) == len(facets)


@pytest.mark.mpi
def test_a_file_read_on_several_ranks(shared_path):
    file = shared_path / "a.msh"
    if MPI.COMM_WORLD.rank == 0:
        gmsh_section(file, order=2)
    MPI.COMM_WORLD.Barrier()
    section = scene({"file": str(file)})
    mine, alone = build(section, MPI.COMM_WORLD), build(section, SELF)
    np.testing.assert_allclose(midpoints(mine), midpoints(alone), atol=ULPS)
    assert soils_of_cells(mine) == soils_of_cells(alone)
    places = {
        n: np.concatenate(MPI.COMM_WORLD.allgather(facet_midpoints(mine, n)))
        for n in mine.boundaries
    }
    for name, found in places.items():  # a facet between ranks may be seen by both
        seen = np.unique(found.round(9), axis=0)
        np.testing.assert_allclose(seen, np.unique(facet_midpoints(alone, name).round(9), axis=0))


@pytest.mark.mpi
def test_every_rank_refuses_the_same(shared_path):
    file = shared_path / "a.vtu"
    if MPI.COMM_WORLD.rank == 0:
        write(file, [SQUARES[0], SQUARES[1][::-1], *SQUARES[2:]])
    MPI.COMM_WORLD.Barrier()
    with pytest.raises(SceneError, match=r"by input cell: 1 \("):
        build(scene({"file": str(file)}, ("clay",)), MPI.COMM_WORLD)
    with pytest.raises(SceneError, match="in no named region"):
        build(scene({"file": str(file)}), MPI.COMM_WORLD)


@pytest.mark.mpi
def test_fewer_cells_than_ranks():
    layers = [{"thickness": 1.0, "soil": "clay", "cells": 1}]
    domain = build(scene({"column": {"width": 1.0, "layers": layers}}, ("clay",)), MPI.COMM_WORLD)
    assert domain.num_cells == 1
    assert volumes(domain).tolist() == pytest.approx([1.0], rel=RULE)
