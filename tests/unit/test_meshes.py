# SPDX-License-Identifier: MIT
"""Scripts of slopes: regions, boundaries and areas, cells by wavelength, seams, and refusals."""

import dataclasses
import inspect
import math
import runpy
from pathlib import Path

import basix
import gmsh
import numpy as np
import pytest
from dolfinx.mesh import compute_midpoints, entities_to_geometry
from mpi4py import MPI
from support.meshes import mesh_script, scene

from fenics_hytf.domain import build, jacobian_determinants
from fenics_hytf.domain.files import read_mesh

MESHES = Path(__file__).parents[2] / "meshes"
ROUNDING = 1e-12  # sums over a few thousand cells
SLOPE = dict(height=10.0, slope=1.5, depth=5.0, behind=20.0, before=25.0)  # 60 m x 15 m
SECTION = 20 * 15 + 15 * 10 + 25 * 5  # its area: behind, under and before the face
LAYERS = (("rock", 3.0), ("clay", 9.0), ("fill", math.inf))


def drawn(name, path, soils, **options):
    """A mesh as the package builds it, which refuses cells that are inverted."""
    file = mesh_script(name)(path / f"{name}.msh", **options)
    return build(scene({"file": str(file)}, soils), MPI.COMM_SELF)


def volumes(domain) -> dict[str, float]:
    """Area or volume of every region."""
    X, w = basix.make_quadrature(getattr(basix.CellType, domain.mesh.topology.cell_name()), 4)
    each = domain.gather_cells(jacobian_determinants(domain.mesh, X) @ w)
    region = domain.gather_cells(domain.regions)
    return {name: each[region == k].sum() for k, name in enumerate(domain.region_names)}


def lengths(domain) -> dict[str, float]:
    """Length of every boundary of a section, by its facets' ends."""
    mesh = domain.mesh
    mesh.topology.create_connectivity(1, 0)
    mesh.topology.create_connectivity(0, 2)
    found = {}
    for name, facets in domain.boundaries.items():
        ends = mesh.geometry.x[entities_to_geometry(mesh, 1, facets)]
        found[name] = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
    return found


def cells_of(file):
    """Corners of every cell and its region, as gmsh reads the file."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(file))
        tags, places, _ = gmsh.model.mesh.getNodes()
        place = dict(zip(tags.tolist(), places.reshape(-1, 3), strict=True))
        dim = gmsh.model.getDimension()
        found = {}
        for _, group in gmsh.model.getPhysicalGroups(dim):
            (entity,) = gmsh.model.getEntitiesForPhysicalGroup(dim, group)
            _, _, (nodes,) = gmsh.model.mesh.getElements(dim, entity)
            corners = np.array([place[n] for n in nodes.tolist()]).reshape(-1, 2**dim, 3)
            found[gmsh.model.getPhysicalName(dim, group)] = corners
    finally:
        gmsh.finalize()
    return found


def sides(corners):
    """Lengths of the sides of quadrilaterals."""
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1)


def least_sine(corners):
    """Sine of the sharpest or bluntest corner; negative where a cell is inverted."""
    after = (np.roll(corners, -1, axis=1) - corners)[..., :2]
    before = np.roll(after, 1, axis=1)
    cross = before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]
    return (cross / np.linalg.norm(before, axis=-1) / np.linalg.norm(after, axis=-1)).min()


# ---------------------------------------------------------------- a slope


def test_a_slope(tmp_path):
    domain = drawn("slope", tmp_path, ("soil",), **SLOPE)
    assert domain.mesh.topology.cell_name() == "quadrilateral"
    assert volumes(domain) == {"soil": pytest.approx(SECTION, rel=ROUNDING)}
    expected = {"base": 60, "left": 15, "right": 5, "surface": 45 + math.hypot(15, 10)}
    assert lengths(domain) == pytest.approx(expected, rel=ROUNDING)


def test_air_fills_the_box_and_joins_the_slope(tmp_path):
    domain = drawn("slope", tmp_path, ("soil", "air"), **SLOPE, air=2.0)
    area = {"soil": SECTION, "air": 60 * 17 - SECTION}
    assert volumes(domain) == pytest.approx(area, rel=ROUNDING)
    # no "surface": cells of air share the sides of those below, none is left outside
    expected = {"base": 60, "left": 17, "right": 17, "top": 60}
    assert lengths(domain) == pytest.approx(expected, rel=ROUNDING)


def test_lengths_and_angle_have_their_usual_values(tmp_path):
    angle = math.degrees(math.atan(1 / 1.5))
    one = mesh_script("slope")(tmp_path / "a.msh")
    for options in ({"angle": angle}, SLOPE):
        other = mesh_script("slope")(tmp_path / "b.msh", **options)
        np.testing.assert_allclose(cells_of(other)["soil"], cells_of(one)["soil"], atol=1e-9)


@pytest.mark.parametrize("air", [None, 1.0])
@pytest.mark.parametrize("slope", [0.0, 0.4, 0.75, 1.0, 1.5, 2.5, 4.0])
def test_faces_of_every_inclination(tmp_path, slope, air):
    file = mesh_script("slope")(tmp_path / "a.msh", slope=slope, air=air, height=8.0, depth=3.0)
    cells = cells_of(file)
    area = 16 * 11 + slope * 8 * 7 + 20 * 3
    shoelace = 0.5 * np.abs(
        np.cross(*(cells["soil"][:, k + 2] - cells["soil"][:, k] for k in (0, 1)))
    )
    assert shoelace[:, 2].sum() == pytest.approx(area, rel=ROUNDING)
    for corners in cells.values():
        # the face's own angle where rows lean with it; elsewhere what gmsh reached, from 0.5 on
        assert least_sine(corners) > min(0.45, math.sin(math.atan2(1, slope)) - 0.01)
        assert sides(corners).max() <= 1.8
        assert (sides(corners).max(axis=1) / sides(corners).min(axis=1)).max() < 5


def test_layers_end_at_rows(tmp_path):
    domain = drawn(
        "slope", tmp_path, ("rock", "clay", "fill", "air"), **SLOPE, layers=LAYERS, air=1
    )
    face = [20 + 1.5 * (15 - y) for y in (5, 9, 15)]
    clay = 2 * 60 + 4 * (face[0] + face[1]) / 2
    area = {"rock": 3 * 60, "clay": clay, "fill": 6 * (face[1] + face[2]) / 2}
    found = volumes(domain)
    assert {name: found[name] for name in area} == pytest.approx(area, rel=ROUNDING)


def test_a_layer_that_nearly_ends_at_the_toe_has_no_sliver(tmp_path):
    layers = (("clay", 5.001), ("fill", math.inf))
    file = mesh_script("slope")(tmp_path / "a.msh", **SLOPE, layers=layers)
    corners = np.concatenate(list(cells_of(file).values()))
    assert sides(corners).min() > 0.3


def test_squares(tmp_path):
    file = mesh_script("slope")(tmp_path / "a.msh", **SLOPE, style="grid", air=2.0)
    cells = cells_of(file)
    assert len(cells["soil"]) + len(cells["air"]) == 60 * 17
    for name, corners in cells.items():
        np.testing.assert_allclose(sides(corners), 1.0, rtol=1e-9)
        x, y, _ = corners.mean(axis=1).T
        below = y < 5 + np.clip((35 - x) / 1.5, 0, 10)
        assert np.all(below == (name == "soil"))


def test_squares_without_air_leave_a_staircase(tmp_path):
    domain = drawn("slope", tmp_path, ("soil",), **SLOPE, style="grid")
    found = lengths(domain)
    # up and along the stairs: the ground's width and its height, whatever the steps
    assert found == pytest.approx({"base": 60, "left": 15, "right": 5, "surface": 60 + 10})


# ---------------------------------------------------------------- seams


@pytest.mark.parametrize("style", ["fitted", "grid"])
def test_cells_of_a_seam_have_their_centroid_in_it(tmp_path, style):
    seam = (0.0, 16.5, 38.0, 5.1, 2.4)
    file = mesh_script("slope")(tmp_path / "a.msh", **SLOPE, seam=seam, style=style, air=2.0)
    cells = cells_of(file)
    assert set(cells) == {"soil", "seam", "air"}
    start, end = np.array(seam[:2]), np.array(seam[2:4])
    along = (end - start) / math.dist(start, end)
    for name in ("soil", "seam"):
        place = cells[name].mean(axis=1)[:, :2] - start
        off = np.linalg.norm(place - (place @ along)[:, None] * along, axis=1)
        inside = (off <= 1.2) & (place @ along <= math.dist(start, end))
        assert np.all(inside == (name == "seam"))


def test_a_seam_crosses_layers_and_has_its_own_name(tmp_path):
    options = {"layers": LAYERS, "seam": (0.0, 8.0, 60.0, 2.0, 2.0), "seam_name": "weak"}
    domain = drawn("slope", tmp_path, ("rock", "clay", "fill", "weak"), **SLOPE, **options)
    assert set(domain.region_names) == {"rock", "clay", "fill", "weak"}


# ---------------------------------------------------------------- cells by wavelength


@pytest.mark.parametrize("style", ["fitted", "grid"])
@pytest.mark.parametrize("slope", [0.5, 1.5])
def test_no_side_is_longer_than_the_wavelength_allows(tmp_path, slope, style):
    options = {"layers": LAYERS, "vs": (600.0, 150.0, 200.0), "max_frequency": 10.0, "air": 2.0}
    options |= {"slope": slope, "style": style, "cells_per_wavelength": 8.0}
    cells = cells_of(mesh_script("slope")(tmp_path / "a.msh", **options))
    most = {"rock": 7.5, "clay": 1.875, "fill": 2.5}
    for name, limit in most.items():
        assert sides(cells[name]).max() <= limit * (1 + 1e-9)
    assert sides(cells["clay"]).max() > 0.7 * most["clay"]  # and not much shorter than need be


def test_one_velocity_holds_for_all_layers(tmp_path):
    script = mesh_script("slope")
    one = script(tmp_path / "a.msh", layers=LAYERS, vs=(200.0,), max_frequency=10.0)
    three = script(tmp_path / "b.msh", layers=LAYERS, vs=(200.0,) * 3, max_frequency=10.0)
    assert one.read_bytes() == three.read_bytes()


# ---------------------------------------------------------------- other shapes


@pytest.mark.parametrize("riser_slope", [0.0, 0.5, 1.2])
def test_terraces(tmp_path, riser_slope):
    steps, rise, tread, depth = 3, 2.0, 4.0, 3.0
    options = {"steps": steps, "rise": rise, "tread": tread, "riser_slope": riser_slope}
    options |= {"depth": depth, "behind": 6.0, "before": 5.0}
    domain = drawn("terraces", tmp_path, ("soil",), **options)
    run = riser_slope * rise
    width = 6 + 3 * run + 2 * tread + 5
    heights = np.array([3, 2, 1, 0]) * rise + depth  # of the level parts from the crest on
    area = heights @ [6, tread, tread, 5] + run * (heights[:-1] + heights[1:]).sum() / 2
    assert volumes(domain) == {"soil": pytest.approx(area, rel=ROUNDING)}
    surface = 6 + 2 * tread + 5 + 3 * math.hypot(run, rise)
    expected = {"base": width, "left": 9, "right": 3, "surface": surface}
    assert lengths(domain) == pytest.approx(expected, rel=ROUNDING)
    whole = drawn("terraces", tmp_path, ("soil", "air"), **options, air=1.0)
    area = {"soil": area, "air": 10 * width - area}
    assert volumes(whole) == pytest.approx(area, rel=ROUNDING)


@pytest.mark.parametrize("slopes", [(2.0, 2.0), (0.0, 1.5), (0.5, 3.0)])
def test_an_embankment_in_air(tmp_path, slopes):
    options = {"height": 6.0, "crest": 5.0, "slope": slopes[0], "right_slope": slopes[1]}
    soils = ("fill", "air")
    domain = drawn("embankment", tmp_path, soils, **options, cells=(8, 6), air=2.0, beside=4.0)
    width = 5 + 6 * sum(slopes) + 8
    fill = 6 * (5 + 6 * sum(slopes) / 2)
    area = {"fill": fill, "air": 8 * width - fill}
    assert volumes(domain) == pytest.approx(area, rel=ROUNDING)
    expected = {"base": width, "top": width, "left": 8, "right": 8}
    assert lengths(domain) == pytest.approx(expected, rel=ROUNDING)


# ---------------------------------------------------------------- in space

BLOCK = {**SLOPE, "width": 10.0, "size": 2.5}


def test_a_slope_in_space(tmp_path):
    domain = drawn("slope3d", tmp_path, ("soil", "air"), **BLOCK, air=2.5)
    assert domain.mesh.topology.cell_name() == "hexahedron"
    volume = {"soil": SECTION * 10, "air": (60 * 17.5 - SECTION) * 10}
    assert volumes(domain) == pytest.approx(volume, rel=ROUNDING)
    assert set(domain.boundaries) == {"base", "top", "left", "right", "front", "back"}
    places = {"base": (2, 0), "top": (2, 17.5), "left": (0, 0), "right": (0, 60)}
    for name, (axis, place) in (places | {"front": (1, 0), "back": (1, 10)}).items():
        middles = compute_midpoints(domain.mesh, 2, domain.boundaries[name])
        np.testing.assert_allclose(middles[:, axis], place, atol=1e-9)


@pytest.mark.parametrize("air", [None, 2.5])
def test_a_cut_of_some_width(tmp_path, air):
    size = {"width": 60.0, "cut": (20.0, 36.0), "size": 3.0}
    domain = drawn("slope3d", tmp_path, ("soil", "air"), **SLOPE, **size, air=air)
    # the void at a height h over the toe: 25 + s h long, 16 + 2 s h wide
    s, h = 1.5, 10.0
    void = 25 * 16 * h + (25 * 2 * s + s * 16) * h**2 / 2 + 2 * s * s * h**3 / 3
    assert volumes(domain)["soil"] == pytest.approx(60 * 60 * 15 - void, rel=ROUNDING)
    assert ("surface" in domain.boundaries) == (air is None)


def test_a_bulge(tmp_path):
    domain = drawn("slope3d", tmp_path, ("soil",), **BLOCK, bulge=-3.0)
    # chords of a parabola over n cells keep 2/3 (1 - 1/n²) of its height
    more = -3.0 * 2 / 3 * (1 - 1 / 4**2) * 10 * 10
    assert volumes(domain)["soil"] == pytest.approx(SECTION * 10 + more, rel=1e-10)


def test_cubes(tmp_path):
    bay = {"width": 50.0, "cut": (18.0, 32.0), "size": 2.5, "bulge": -2.0, "style": "grid"}
    file = mesh_script("slope3d")(tmp_path / "a.msh", **SLOPE, **bay)
    (corners,) = cells_of(file).values()
    np.testing.assert_allclose(np.ptp(corners, axis=1), 2.5, rtol=1e-9)
    x, y, z = corners.mean(axis=1).T
    back = 1.5 * (np.clip(z, 5, 15) - 5)
    middle = 1 - (np.clip(y - 25, -7 - back, 7 + back) / (7 + back)) ** 2
    void = (z > 5) & (np.abs(y - 25) < 7 + back) & (x > 35 - back - 2 * middle)
    assert not void.any()
    assert len(x) + _cubes_in_the_void() == 24 * 20 * 6


def _cubes_in_the_void() -> int:
    x, y, z = np.meshgrid(*(np.arange(n) * 2.5 + 1.25 for n in (24, 20, 6)), indexing="ij")
    back = 1.5 * (np.clip(z, 5, 15) - 5)
    middle = 1 - (np.clip(y - 25, -7 - back, 7 + back) / (7 + back)) ** 2
    return int(((z > 5) & (np.abs(y - 25) < 7 + back) & (x > 35 - back - 2 * middle)).sum())


def test_hexahedra_by_wavelength(tmp_path):
    options = {"vs": (200.0,), "max_frequency": 5.0, "bulge": 5.0, "width": 20.0}
    corners = cells_of(mesh_script("slope3d")(tmp_path / "a.msh", **options))["soil"]
    ends = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)]
    ends += [(k, k + 4) for k in range(4)]
    longest = max(np.linalg.norm(corners[:, a] - corners[:, b], axis=1).max() for a, b in ends)
    assert 0.7 * 4 < longest <= 4 * (1 + 1e-9)


# ---------------------------------------------------------------- kept files, and refusals

KEPT = {
    "slope": ("slope", {"air": 2.0}, {"soil", "air"}),
    "slope_seam": (
        "slope",
        {"air": 2.0, "seam": (0.0, 16.5, 38.3, 5.0, 2.5)},
        {"soil", "seam", "air"},
    ),
    "slope3d": ("slope3d", {"size": 2.5, "air": 2.5}, {"soil", "air"}),
}


@pytest.mark.parametrize("name", KEPT)
def test_a_kept_file_is_what_its_script_draws(tmp_path, name):
    script, options, regions = KEPT[name]
    path = MESHES / f"{name}.msh"
    assert path.stat().st_size < 300_000
    kept = read_mesh(path, tuple(regions))
    drawn = read_mesh(mesh_script(script)(tmp_path / "a.msh", **options), tuple(regions))
    assert set(kept.region_names) == regions
    np.testing.assert_allclose(kept.points, drawn.points, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(kept.cells, drawn.cells)
    np.testing.assert_array_equal(kept.region, drawn.region)


@pytest.mark.parametrize(
    ("name", "wrong", "said"),
    [
        ("slope", {"height": 0.0}, "height 0.0"),
        ("slope", {"depth": -1.0}, "depth"),
        ("slope", {"behind": math.nan}, "behind nan"),
        ("slope", {"slope": 1.0, "angle": 45.0}, "one of them"),
        ("slope", {"angle": 95.0}, "angle of 95"),
        ("slope", {"slope": 20.0}, "slope of 20"),
        ("slope", {"air": 0.0}, "0.0 m of air"),
        ("slope", {"size": 0.0}, "size 0.0"),
        ("slope", {"size": 1e-3}, "cells; expected at most"),
        ("slope", {"size": 1.0, "max_frequency": 5.0, "vs": (200.0,)}, "one of them"),
        ("slope", {"vs": (200.0,)}, "a frequency with them"),
        ("slope", {"max_frequency": 5.0}, "0 velocities for 1 layers"),
        ("slope", {"max_frequency": 5.0, "vs": (1.0, 2.0)}, "2 velocities for 1 layers"),
        ("slope", {"max_frequency": 5.0, "vs": (-1.0,)}, "vs -1.0"),
        ("slope", {"style": "round"}, "style 'round'"),
        ("slope", {"layers": (("a", 3.0),)}, "tops"),
        ("slope", {"layers": (("a", 3.0), ("b", 2.0), ("c", math.inf))}, "ascending"),
        ("slope", {"layers": (("a", 30.0), ("b", math.inf))}, "below the crest"),
        ("slope", {"layers": (("a", 3.0), ("a", math.inf))}, "names that differ"),
        ("slope", {"layers": (("air", math.inf),)}, "names that differ"),
        ("slope", {"seam": (0, 5, 0, 5, 1)}, "two different points"),
        ("slope", {"seam": (0, 5, 60, 5, 0)}, "positive thickness"),
        ("slope", {"seam": (0, 90, 60, 90, 1)}, "no cell with its centroid in seam"),
        ("terraces", {"steps": 0}, "0 steps"),
        ("terraces", {"rise": -1.0}, "rise -1.0"),
        ("terraces", {"tread": 0.0}, "tread 0.0"),
        ("terraces", {"riser_slope": -0.1}, "slope of -0.1"),
        ("embankment", {"air": -1.0}, "-1.0 m of air"),
        ("embankment", {"beside": 3.0}, "no height"),
        ("slope3d", {"width": 0.0}, "width 0.0"),
        ("slope3d", {"cut": (5.0, 15.0)}, "room for its ends"),
        ("slope3d", {"bulge": 20.0}, "bulge of 20"),
    ],
)
def test_what_makes_no_mesh_is_refused(tmp_path, name, wrong, said):
    with pytest.raises(ValueError, match=r"(?s)found .*; expected") as caught:
        mesh_script(name)(tmp_path / "a.msh", **wrong)
    assert said in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_an_unknown_option_is_refused(tmp_path):
    with pytest.raises(TypeError):
        mesh_script("slope")(tmp_path / "a.msh", hight=3.0)


@pytest.mark.parametrize("name", ["slope", "terraces", "embankment", "canyon", "slope3d"])
def test_options_of_the_command_line_are_arguments_of_the_function(name):
    script = runpy.run_path(str(MESHES / f"{name}.py"))
    given = vars(script["parser"]().parse_args([]))
    known = set(inspect.signature(script[name]).parameters) - {"path", "ground"}
    if "Ground" in script and name != "embankment":
        known |= {field.name for field in dataclasses.fields(script["Ground"])}
    assert set(given) == known | {"output"}
    assert given["output"] == Path(f"{name}.msh")
