# SPDX-License-Identifier: MIT
import tomllib
from pathlib import Path

import basix
import numpy as np
import pytest

from fenics_hytf.motion import GRAVITY
from fenics_hytf.particles import quadrature_rule
from fenics_hytf.scene import Scene, SceneError, check, examine

COLUMN = """
[mesh]
column = { width = 1.0, layers = [
    { thickness = 1.0, soil = "fill", cells = 1 },
    { thickness = 23.0, soil = "sand", cells = 23 } ] }
[soil.fill]
density = 1800
shear_modulus = 5e7
poisson = 0.25
damping = 0.02
[soil.sand]
density = 1835.0
shear_wave_velocity = 225.0
poisson = 0.3
damping = 0.05
curves = { strain = [1e-6, 1e-4, 1e-2], modulus = [1.0, 0.8, 0.1], damping = [0.01, 0.03, 0.2] }
[[motion]]
direction = "x"
harmonic = { amplitude = 2.0, frequency = 0.5, cycles = 3, samples = 301 }
"""

BOX = """
[mesh]
box = { size = [9.0, 6.0], cells = [9, 6] }
regions = [
    { soil = "seam", polygon = [[0, 3], [9, 3], [9, 4], [0, 4]] },
    { soil = "clay", below = 2.5 }, { soil = "sand" } ]
[soil]
seam = { density = 1500, shear_modulus = 1e6, poisson = 0.3 }
clay = { density = 1700, youngs_modulus = 1e8, poisson = 0.4 }
sand = { density = 1900, shear_wave_velocity = 200, poisson = 0.3 }
[[motion]]
direction = "y"
synthetic = {}
"""


def scene(text: str, extra: str = "", folder: Path | str = ".") -> Scene:
    return Scene.from_dict(tomllib.loads(text + extra), folder)


@pytest.fixture
def at2(tmp_path):
    path = tmp_path / "record.at2"
    path.write_text("a\nb\nc\nNPTS=    6, DT=   .0100 SEC\n .1 .2 -.4 .3 .0 .1\n")
    return path


def test_the_file_is_mirrored():
    s = scene(COLUMN)
    assert s.mesh.column.width == 1.0
    assert [(x.thickness, x.soil, x.cells) for x in s.mesh.column.layers] == [
        (1.0, "fill", 1),
        (23.0, "sand", 23),
    ]
    assert s.mesh.box is None and s.mesh.file is None
    assert s.mesh.size == (1.0, 24.0) and s.mesh.gdim == 2
    assert s.mesh.soil_names == ("fill", "sand")
    assert s.mesh.boundaries == ("base", "top", "left", "right")
    assert s.motion[0].direction == "x" and s.motion[0].input == "within"
    assert s.directions == ("x",)
    assert s.data == tomllib.loads(COLUMN)


def test_defaults():
    s = scene(COLUMN)
    assert (s.mesh.degree, s.mesh.kinematics, s.mesh.points_per_cell) == (1, "plane_strain", None)
    assert s.mesh.points_in("quadrilateral") == 4
    assert s.boundary.kinds == {} and s.boundary.rock is None
    assert (s.lapses.count, s.lapses.duration, s.lapses.continuity) == (1, None, "steady")
    assert s.effects.named == ()
    assert s.effects.equivalent_linear is None and s.effects.rayleigh is None
    assert s.points.outside == "error"
    assert (s.solver.sweep, s.solver.complex_modulus, s.solver.keep) == (
        "reduced",
        "hysteretic",
        "poisson",
    )
    assert (s.solver.tolerance, s.solver.max_frequency, s.solver.excited) == (1e-6, None, 1e-8)
    assert s.output.receivers == {} and not s.output.fields and s.output.every == 1


def test_an_effect_of_defaults():
    loop = scene(COLUMN, "[effects]\nequivalent_linear = true").effects.equivalent_linear
    assert (loop.tolerance, loop.strain_ratio, loop.magnitude) == (1e-3, 0.65, None)
    assert (loop.max_iterations, loop.strain) == (50, "plane")


@pytest.mark.parametrize("off", ["equivalent_linear", "rayleigh", "gravity", "sliding"])
def test_an_effect_that_is_off_costs_nothing(off):
    assert scene(COLUMN, f"[effects]\n{off} = false").effects.named == ()


def test_rayleigh_of_zeros_is_none():
    assert scene(COLUMN, "[effects]\nrayleigh = { alpha = 0.0, beta = 0 }").effects.named == ()


def test_named_effects():
    text = """
    [effects]
    equivalent_linear = { magnitude = 7.5, tolerance = 1e-2 }
    rayleigh = { beta = 0.001 }
    geometric_stiffness = true
    convection = true
    """
    effects = scene(COLUMN, text).effects
    assert effects.named == (
        "equivalent_linear",
        "rayleigh",
        "geometric_stiffness",
        "convection",
    )
    assert effects.equivalent_linear.strain_ratio == 0.65  # (7.5 - 1) / 10
    assert (effects.rayleigh.alpha, effects.rayleigh.beta) == (0.0, 0.001)


def test_soils_give_elastic_constants_either_way():
    soil = scene(COLUMN).soil
    assert soil["fill"].elastic.shear_modulus == 5e7
    # G = rho Vs^2, from the constants themselves
    assert soil["sand"].elastic.shear_modulus == pytest.approx(1835 * 225**2, rel=1e-14)
    clay = scene(BOX).soil["clay"].elastic
    assert clay.shear_modulus == pytest.approx(1e8 / 2.8, rel=1e-14)  # E / (2 (1 + nu))


def test_damping_ratio_follows_the_rule():
    soil = scene(COLUMN).soil
    assert soil["sand"].damping_ratio(with_curves=True) == 0.01  # the curve rules
    assert soil["sand"].damping_ratio(with_curves=False) == 0.05  # the curve is ignored
    assert soil["fill"].damping_ratio(with_curves=True) == 0.02  # there is no curve
    curve_only = scene(COLUMN.replace("damping = 0.05\n", "")).soil["sand"]
    assert curve_only.damping_ratio(with_curves=False) == 0.01
    assert scene(BOX).soil["sand"].damping_ratio(with_curves=True) == 0.0


def test_curves_by_model():
    text = COLUMN.replace(
        "[[motion]]",
        "[soil.x]\ndensity=1\npoisson=0.1\nyoungs_modulus=1\n"
        'curves = { model = "darendeli", plasticity_index = 0, mean_stress = 12e3, ocr = 1 }\n'
        "[[motion]]",
    )
    curve = scene(text).soil["x"].curve
    assert 0 < curve.small_strain_damping < 0.05 < curve.damping.max()


def test_strength_is_accepted():
    soil = scene(COLUMN.replace("damping = 0.05", "friction_angle = 32\ncohesion = 5e3")).soil
    assert (soil["sand"].friction_angle, soil["sand"].cohesion) == (32.0, 5e3)


def test_box_regions_by_centroid_first_match_wins():
    mesh = scene(BOX).mesh
    assert mesh.box.cell == "quadrilateral" and mesh.size == (9.0, 6.0)
    x = np.array([[0.5, 0.5], [0.5, 2.5], [4.5, 3.5], [8.5, 5.5]])
    assert mesh.region_index(x).tolist() == [1, 2, 0, 2]


def test_polygon_agrees_with_signed_areas():
    # a star-shaped polygon: inside where the place is left of every edge's fan triangle
    text = BOX.replace("[[0, 3], [9, 3], [9, 4], [0, 4]]", "[[1, 1], [8, 2], [5, 3], [2, 5]]")
    region = scene(text).mesh.regions[0]
    rng = np.random.default_rng(3)
    x = rng.uniform(0, 9, (2000, 2))
    p = np.array(region.polygon)
    inside = np.zeros(len(x), dtype=bool)
    for a, b, c in ((p[0], p[1], p[2]), (p[0], p[2], p[3])):  # fan from vertex 0
        sides = [
            (e[0] - s[0]) * (x[:, 1] - s[1]) - (e[1] - s[1]) * (x[:, 0] - s[0]) > 0
            for s, e in ((a, b), (b, c), (c, a))
        ]
        inside |= np.all(sides, axis=0)
    np.testing.assert_array_equal(region.holds(x), inside)


@pytest.mark.parametrize(
    ("size", "cells", "cell", "default"),
    [("[4, 2]", "[2, 1]", "triangle", "quadrilateral"),
     ("[4, 2, 3]", "[2, 1, 1]", "tetrahedron", "hexahedron")],
)  # fmt: skip
def test_cell_types(size, cells, cell, default):
    head = f"[mesh]\nbox = {{ size = {size}, cells = {cells} "
    tail = "\n[soil]\ns = { density = 1, shear_modulus = 1, poisson = 0 }\n"
    tail += COLUMN[COLUMN.index("[[motion]]") :]
    assert scene(head + "}" + tail).mesh.box.cell == default
    mesh = scene(f'{head}, cell = "{cell}" }}{tail}').mesh
    assert mesh.box.cell == cell
    assert mesh.kinematics == ("plane_strain" if mesh.gdim == 2 else None)
    assert mesh.region_index(np.zeros((2, mesh.gdim))).tolist() == [0, 0]


CELLS = {"triangle": 2, "quadrilateral": 2, "tetrahedron": 3, "hexahedron": 3}


def of_cells(cell, degree, points):
    size = [1.0] * CELLS[cell]
    data = tomllib.loads(COLUMN)
    data["soil"] = {"sand": data["soil"]["sand"]}
    box = {"size": size, "cells": [1] * len(size), "cell": cell}
    data["mesh"] = {"box": box, "degree": degree, "points_per_cell": points}
    return data


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("degree", [1, 2])
def test_points_per_cell_are_those_that_there_are_rules_for(cell, degree):
    # every number that the scene takes has a rule under which M is regular, and no other is taken
    taken = []
    for points in range(1, 1400):
        faults = check(of_cells(cell, degree, points), ".")[1]
        if faults:
            assert [fault.key for fault in faults] == ["mesh.points_per_cell"]
            assert faults[0].found == str(points) and cell in faults[0].expected
        else:
            taken.append(points)
    for points in taken:
        X, w = quadrature_rule(cell, points)
        assert w.sum() == pytest.approx(quadrature_rule(cell, 1)[1].sum(), rel=1e-13)  # rounding
        element = basix.create_element(basix.ElementFamily.P, basix.CellType[cell], degree)
        N = element.tabulate(0, X)[0, :, :, 0]
        assert np.linalg.matrix_rank(N) == element.dim  # so is N^T diag(w) N, w > 0
    least = {  # counted by hand: Gauss points; rules exact to degrees 2 and 4
        "triangle": (3, 6),
        "quadrilateral": (4, 9),
        "tetrahedron": (4, 14),
        "hexahedron": (8, 27),
    }
    dim = CELLS[cell]
    assert taken[0] == least[cell][degree - 1]
    assert (degree + 1) ** dim in taken
    if cell in ("quadrilateral", "hexahedron"):
        assert taken == [m**dim for m in range(degree + 1, 11)]


def test_points_per_cell_of_a_file_wait_for_its_cells(tmp_path):
    (tmp_path / "a.msh").write_text("")
    data = of_cells("triangle", 2, 6)
    data["mesh"] = {"file": "a.msh", "degree": 2, "points_per_cell": 6}
    mesh = Scene.from_dict(data, tmp_path).mesh
    assert mesh.points_in("triangle") == 6
    for cell in ("quadrilateral", "tetrahedron", "hexahedron"):
        with pytest.raises(SceneError, match=rf"^mesh\.points_per_cell: found 6; .*{cell}"):
            mesh.points_in(cell)
    data["mesh"]["points_per_cell"] = 5  # no cell has a rule of five points
    (fault,) = check(data, tmp_path)[1]
    assert fault.key == "mesh.points_per_cell"
    assert all(cell in fault.expected for cell in CELLS)


def test_motion_is_read_and_scaled(at2):
    text = COLUMN.replace("harmonic =", "pga = 0.3\nharmonic =")
    assert scene(text).motion[0].record.pga == pytest.approx(0.3 * GRAVITY, rel=1e-14)
    text = COLUMN[: COLUMN.index("harmonic")] + 'file = "record.at2"\nscale = -2'
    record = scene(text, folder=at2.parent).motion[0].record
    np.testing.assert_allclose(  # the file's numbers in g
        record.acceleration, -2 * GRAVITY * np.array([0.1, 0.2, -0.4, 0.3, 0, 0.1]), rtol=1e-14
    )
    assert record.dt == 0.01


def test_csv_takes_time_step_and_units(tmp_path):
    (tmp_path / "r.csv").write_text("1.0\n-2.0\n0.5\n")
    text = COLUMN[: COLUMN.index("harmonic")] + 'file = "r.csv"\ndt = 0.5\nunits = "m/s2"'
    record = scene(text, folder=tmp_path).motion[0].record
    assert record.acceleration.tolist() == [1.0, -2.0, 0.5] and record.dt == 0.5


def test_several_motions_are_padded_to_the_longest_and_the_lapses():
    text = """
    [[motion]]
    direction = "y"
    harmonic = { amplitude = 1.0, frequency = 0.5, cycles = 2, samples = 200 }
    [lapses]
    count = 4
    """
    base = COLUMN.replace("samples = 301", "samples = 300")
    s = scene(base, text)
    s4 = scene(base, text.replace("count = 4", "count = 7"))
    assert s.dt == pytest.approx(0.02, rel=1e-14)
    assert [x.num_samples for x in s.segments] == [75] * 4
    assert s.base_acceleration.shape == (2, 300)
    assert s4.base_acceleration.shape == (2, 7 * 43)  # ceil(300 / 7) = 43
    np.testing.assert_array_equal(s.base_acceleration[1, :200], s.motion[1].record.acceleration)
    assert not s4.base_acceleration[1, 200:].any() and not s4.base_acceleration[0, 300:].any()


def test_lapses_by_duration():
    extra = "[lapses]\nduration = 2.0"
    s = scene(COLUMN.replace("samples = 301", "samples = 300"), extra)
    assert [(x.start, x.num_samples) for x in s.segments] == [(0, 100), (100, 100), (200, 100)]


def test_receivers():
    extra = '[output]\nreceivers = { top = [0.5, 24], "mp-1" = { point = [0.5, 11.0] } }'
    receivers = scene(COLUMN, extra).output.receivers
    assert receivers["top"].place == (0.5, 24.0) and not receivers["top"].rides
    assert receivers["mp-1"].place == (0.5, 11.0) and receivers["mp-1"].rides


def test_a_receiver_on_a_top_of_summed_thicknesses():
    layer = '{ thickness = 0.1, soil = "fill", cells = 1 }'
    text = COLUMN[: COLUMN.index("layers")] + f"layers = [{', '.join([layer] * 3)}] }}\n"
    text += COLUMN[COLUMN.index("[soil.fill]") :]
    assert 0.1 + 0.1 + 0.1 != 0.3
    scene(text, "[output]\nreceivers = { top = [0.5, 0.3] }")


def test_a_scene_does_not_change():
    s = scene(COLUMN)
    with pytest.raises(ValueError, match="frozen"):
        s.solver.tolerance = 1.0
    with pytest.raises(AttributeError):
        s.title = "x"
    with pytest.raises(ValueError, match="read-only"):
        s.base_acceleration[0, 0] = 1.0


def test_hash_is_of_the_data():
    data = tomllib.loads(COLUMN)
    a = Scene.from_dict(data).hash
    assert len(a) == 64
    backwards = dict(reversed(data.items()))
    assert Scene.from_dict(backwards).hash == a  # order does not matter
    data["mesh"]["column"]["width"] = 1  # nor does the way a number is written
    assert Scene.from_dict(data).hash == a
    data["mesh"]["column"]["width"] = 2
    assert Scene.from_dict(data).hash != a


def test_load(tmp_path):
    path = tmp_path / "level.toml"
    path.write_bytes(b"\xef\xbb\xbf" + COLUMN.encode())  # as Windows' editors write UTF-8
    s = Scene.load(path)
    assert s.title == "level" and s.folder == tmp_path
    assert s.hash == scene(COLUMN).hash
    path.write_text('title = "Ours"\n' + COLUMN)
    assert Scene.load(str(path)).title == "Ours"


def test_overrides(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(COLUMN)
    s = Scene.load(
        path,
        [
            "solver.max_frequency=10",
            "solver.complex_modulus=kramer",
            'soil."sand".poisson = 0.2',
            "motion[0].harmonic.amplitude=1",
            "motion.0.direction=y",
            "mesh.column={ width = 3, layers = [{ thickness = 2, soil = 'sand', cells = 2 }] }",
        ],
    )
    assert (s.solver.max_frequency, s.solver.complex_modulus) == (10.0, "kramer")
    assert s.soil["sand"].poisson == 0.2
    # sampled, so just below the amplitude: within (pi/samples a cycle)^2/2
    assert s.motion[0].record.pga == pytest.approx(1.0, rel=5e-4)
    assert s.motion[0].direction == "y"
    assert s.mesh.size == (3.0, 2.0)
    assert s.data["solver"] == {"max_frequency": 10, "complex_modulus": "kramer"}


@pytest.mark.parametrize(
    "override",
    [
        "solver",
        "=3",
        "a b=3",
        "motion[4].pga=3",
        "motion.x=3",
        "mesh.column.width.x=1",
        "a\nb=3",
        "",
    ],
)
def test_overrides_that_cannot_be_set(tmp_path, override):
    path = tmp_path / "s.toml"
    path.write_text(COLUMN)
    _, faults = examine(path, [override])
    assert [fault.key for fault in faults] == [f"--set {override}"]


@pytest.mark.parametrize(
    ("override", "key", "found"),
    [
        ("lapses.count=" + "1" * 5000, "--set lapses.count", "an integer of more than 4300 digits"),
        ("motion[" + "1" * 5000 + "].pga=3", "--set motion[1", "111"),
    ],
    ids=["value", "index"],
)
def test_overrides_of_more_digits_than_are_read(tmp_path, override, key, found):
    path = tmp_path / "s.toml"
    path.write_text(COLUMN)
    _, faults = examine(path, [override])
    assert [fault.key.startswith(key) and found in fault.found for fault in faults] == [True]


def test_motion_file_takes_the_place_of_the_source(tmp_path, at2, monkeypatch):
    path = tmp_path / "scenes" / "s.toml"
    path.parent.mkdir()
    path.write_text(COLUMN.replace("harmonic", "pga = 0.1\nharmonic"))
    monkeypatch.chdir(tmp_path)  # the path is relative to where one stands
    s = Scene.load(path, motion_file="record.at2")
    assert s.motion[0].record.num_samples == 6
    assert s.motion[0].direction == "x"
    assert s.motion[0].record.pga == pytest.approx(0.1 * GRAVITY, rel=1e-14)
    with pytest.raises(SceneError, match=r"motion\[0\].file: found .*which is not there"):
        Scene.load(path, motion_file="none.at2")


def test_sections_without_fault_survive_those_with():
    data = tomllib.loads(COLUMN)
    data["mesh"]["degree"] = 3
    data["soil"]["fill"]["density"] = -1
    sections, faults = check(data, ".")
    assert {fault.key for fault in faults} == {"mesh.degree", "soil.fill.density"}
    assert sections.mesh is None
    assert sections.soil["fill"] is None and sections.soil["sand"] is not None
    assert sections.motion[0].record.num_samples == 301
    with pytest.raises(ValueError, match="checked scene"):
        Scene.from_sections(sections)


def test_mesh_file(tmp_path):
    (tmp_path / "m.msh").write_text("")
    text = '[mesh]\nfile = "m.msh"\n' + COLUMN[COLUMN.index("[soil.fill]") :]
    extra = "[boundary]\nsea = 'free'\n[output]\nreceivers = { a = [1, 2, 3] }"
    s = scene(text, extra, tmp_path)
    assert s.mesh.file == tmp_path / "m.msh"
    assert s.mesh.gdim is None and s.mesh.size is None and s.mesh.kinematics is None
    assert s.boundary.kinds == {"sea": "free"}  # whether it is there, the mesh file knows
