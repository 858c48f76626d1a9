# SPDX-License-Identifier: MIT
"""What is written, drawn and told of ground that slides."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from PIL import Image
from support.results_builder import (
    SLIPS,
    make_result,
    make_slide,
    make_slide_snapshot,
)

from fenics_hytf.cli import main
from fenics_hytf.cli.closing import closing_words
from fenics_hytf.motion import GRAVITY
from fenics_hytf.results import ResultError, open_result, publish, read_result, read_table
from fenics_hytf.results.figures import animation, style
from fenics_hytf.results.figures.drawing import all_figures
from fenics_hytf.results.figures.energy import energy_balance
from fenics_hytf.results.figures.plane import extent, plane_of
from fenics_hytf.results.figures.profiles import cell_column, envelope
from fenics_hytf.results.figures.slip import slip_history
from fenics_hytf.results.figures.slope import deformed, mechanism, run_out
from fenics_hytf.results.figures.stiffness import stiffness
from fenics_hytf.results.overburden import vertical_stress
from fenics_hytf.results.report.findings import iterations_table, what_slid
from fenics_hytf.simulation.snapshots import _stiffness
from tests.unit.test_results_report import Page, text_of

DT = 0.05
ENDS = (3.0, 4.5, 7.5, 13.5)  # of the lapses of a slide [s]
PICTURES = {"slip.png", "mechanism.png", "deformed.png", "runout.png", "points.gif"}
WORDS = "small slips above k_y/k_max 0.6 are not predicted well by a single mechanism"


def write(folder, result, snapshots=(), fields=False, finish=None):
    with open_result(folder) as opened:
        for index in snapshots:
            opened.snapshot(make_slide_snapshot(result, index, fields))
        return opened.write(result, finish)


def store(folder, result, snapshots=range(4)):
    write(folder, result, snapshots)
    return read_result(folder)


# ---------------------------------------------------------------- summary


def test_the_summary_tells_the_slip_of_lapses_and_of_the_run(tmp_path):
    write(tmp_path / "r", make_slide())
    summary = json.loads((tmp_path / "r/summary.json").read_text(encoding="utf-8"))
    told = summary["lapses"][1]["slip"]
    assert told["yield_coefficient"] == 0.11 and told["factor_of_safety"] == 1.5
    assert (told["direction"], told["sense"], told["iterations"]) == ("x", 1, 21)
    # half a period of a cosine to 0.3 m; a rigid block takes half, a decoupled one twice as much
    assert told["slip_m"] == pytest.approx(0.3, rel=1e-15)
    assert (told["rigid_m"], told["decoupled_m"], told["end_rate_m_s"]) == (0.15, 0.6, 0.0)
    # the driving sine of 3 m/s^2 is sampled at its peak within 1e-3; gravity of the scene is 10
    assert told["peak_driving_g"] == pytest.approx(0.3, rel=2e-3)
    assert told["yield_over_peak"] == pytest.approx(0.11 / 0.3, rel=2e-3)
    assert told["note"] is None
    run = summary["sliding"]
    assert run["slip_m"] == pytest.approx(0.4, rel=1e-15)
    assert run["rigid_m"] == pytest.approx(0.2) and run["decoupled_m"] == pytest.approx(0.8)
    assert (run["yield_coefficient"], run["yield_coefficient_last"]) == (0.1, 0.13)
    assert run["factor_of_safety"] == 1.5
    assert run["yield_over_peak"] == pytest.approx(0.1 / 0.3, rel=2e-3)
    # lapse 2 ends at 7.5 s, and nothing slips after it
    assert run["at_rest_s"] == pytest.approx(ENDS[2], abs=1e-12)
    assert summary["warnings"] == []


@pytest.mark.parametrize(
    ("case", "at_rest", "words"),
    [
        ({"slips": (0.0,) * 4}, 0.0, "The slope did not slide"),
        ({}, 7.5, "The slope slid by 0.400 m towards +x and came to rest after 7.5 s"),
        (
            {"slips": (0.0, 0.3, 0.1, 0.2), "end_rate": 0.25},
            None,
            "was still sliding at 0.250 m/s when the run ended after 13.5 s",
        ),
    ],
    ids=str,
)
def test_whether_it_came_to_rest(tmp_path, case, at_rest, words):
    summary = write(tmp_path / "r", make_slide(**case))
    assert summary["sliding"]["at_rest_s"] == at_rest
    assert words in what_slid(summary)
    told = [text for text in summary["warnings"] if "still sliding" in text]
    assert len(told) == (at_rest is None)
    assert all("0.25 m/s" in text and "effects.sliding.longest" in text for text in told)


@pytest.mark.parametrize(
    ("yields", "slips", "noted", "warned"),
    [
        ((0.15,) * 4, SLIPS, (), False),
        # of a peak of 0.3: 0.67 in lapse 1, which slid; others are driven by more, or did not slide
        ((0.1, 0.2, 0.1, 0.2), SLIPS, (1,), False),
        ((0.2,) * 4, SLIPS, (1, 2), True),
        ((0.2,) * 4, (0.0,) * 4, (), False),
    ],
    ids=str,
)
def test_small_slips_are_not_to_be_trusted(tmp_path, yields, slips, noted, warned):
    summary = write(tmp_path / "r", make_slide(yields=yields, slips=slips))
    told = [lapse["index"] for lapse in summary["lapses"] if lapse["slip"]["note"] == WORDS]
    assert tuple(told) == noted
    assert summary["sliding"]["note"] == (WORDS if warned else None)
    found = [text for text in summary["warnings"] if WORDS in text]
    assert len(found) == warned and all("k_y/k_max is 0.67" in text for text in found)


@pytest.mark.parametrize("moving", [False, True])
def test_a_seam_where_mechanisms_change_says_what_it_does(tmp_path, moving):
    result = make_slide()
    lapse = result.lapses[2]
    slip = replace(lapse.slip, rate=np.full_like(lapse.slip.rate, 0.1 if moving else 0.0))
    lapses = [*result.lapses[:2], replace(lapse, seam_error=0.05, slip=slip), result.lapses[3]]
    summary = write(tmp_path / "r", replace(result, lapses=tuple(lapses)))
    [told] = [text for text in summary["warnings"] if "seam between lapses by 5 %" in text]
    assert ("accelerations of a sample or two" in told) == moving
    assert ("Longer lapses" in told) != moving


def test_nothing_that_drives_it_has_no_ratio(tmp_path):
    result = make_slide()
    slip = replace(result.lapses[3].slip, driving=-np.ones(241))
    lapses = (*result.lapses[:3], replace(result.lapses[3], slip=slip))
    summary = write(tmp_path / "r", replace(result, lapses=lapses))
    assert summary["lapses"][3]["slip"]["yield_over_peak"] is None
    assert summary["sliding"]["yield_over_peak"] == pytest.approx(0.1 / 0.3, rel=2e-3)


def test_ground_that_gravity_does_not_shear_has_no_factor_of_safety(tmp_path):
    """JSON knows no infinity; nor do a report and the closing words."""
    result = make_slide()
    level = [
        replace(lapse, slip=replace(lapse.slip, factor_of_safety=np.inf)) for lapse in result.lapses
    ]
    summary = write(tmp_path / "r", replace(result, lapses=tuple(level)))
    text = (tmp_path / "r/summary.json").read_text(encoding="utf-8")
    assert "Infinity" not in text and json.loads(text)["sliding"]["factor_of_safety"] is None
    assert what_slid(summary).endswith("gravity alone does not shear it.")
    assert re.search(r"sliding +k_y 0\.1; slip", closing_words(summary, tmp_path, False))


def test_without_sliding_there_is_nothing_of_it(tmp_path):
    with open_result(tmp_path / "r") as folder:
        summary = folder.write(make_result(lapses=3), publish)
    assert summary["sliding"] is None and summary["lapses"][0]["slip"] is None
    assert not PICTURES & {path.name for path in (tmp_path / "r").iterdir()}
    assert not (tmp_path / "r/slip.csv").exists() and not (tmp_path / "r/mesh.vtu").exists()
    assert "Sliding" not in (tmp_path / "r/report.html").read_text(encoding="utf-8")
    header = (tmp_path / "r/cells.csv").read_text(encoding="utf-8").splitlines()[0]
    assert header.endswith(",change")
    assert read_result(tmp_path / "r").slip is None


# ---------------------------------------------------------------- tables


def test_the_slip_of_the_run_goes_on_over_seams(tmp_path):
    result = make_slide()
    write(tmp_path / "r", result)
    table = read_table(tmp_path / "r/slip.csv")
    names = ["time_s", "slip_m", "rate_m_s", "driving_m_s2", "yield_m_s2", "lapse"]
    assert list(table) == names
    # two steps a sample, every seam once, and the end of the run; round-off of start + step * dt
    np.testing.assert_allclose(table["time_s"], 0.025 * np.arange(2 * 270 + 1), atol=1e-12)
    at = {round(t / 0.025): i for i, t in enumerate(table["time_s"])}
    for end, slip, lapse in zip(ENDS, np.cumsum(SLIPS), (1, 2, 3, 3), strict=True):
        row = at[round(end / 0.025)]
        assert table["slip_m"][row] == pytest.approx(slip, abs=1e-15)
        assert table["lapse"][row] == lapse
    np.testing.assert_allclose(table["yield_m_s2"][table["lapse"] == 1], 1.1, rtol=1e-15)
    one = result.lapses[1].slip
    here = table["lapse"] == 1
    np.testing.assert_array_equal(table["rate_m_s"][here], one.rate[:-1])
    np.testing.assert_array_equal(table["driving_m_s2"][here], one.driving[:-1])


def test_empty_cells_have_no_rows(tmp_path):
    result = make_slide()
    write(tmp_path / "r", result)
    with (tmp_path / "r/cells.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[-3:] == ["change", "fill", "mechanism_strain"]
    for lapse in result.lapses:
        told = [row for row in rows if int(row["lapse"]) == lapse.index]
        cells = np.flatnonzero(lapse.cells.fill)
        np.testing.assert_array_equal([int(row["cell"]) for row in told], cells)
        for name in ("fill", "peak_strain"):
            values = [float(row[name]) for row in told]
            np.testing.assert_array_equal(values, getattr(lapse.cells, name)[cells])
        strain = [float(row["mechanism_strain"]) for row in told]
        np.testing.assert_array_equal(strain, lapse.slip.shear_strain[cells])


def test_envelopes_are_over_the_lapses_in_which_a_cell_holds_soil(tmp_path):
    result = make_slide()
    stored = store(tmp_path / "r", result, ())
    filled = np.array([lapse.cells.fill > 0 for lapse in result.lapses])
    strain = np.array([lapse.cells.peak_strain for lapse in result.lapses])
    expected = np.where(filled, strain, 0.0).max(axis=0)[filled.any(axis=0)]
    np.testing.assert_array_equal(envelope(stored, "peak_strain"), expected)
    places = result.lapses[0].cells.centroid[filled.any(axis=0)]
    np.testing.assert_array_equal(cell_column(stored, "x"), places[:, 0])
    assert not filled[0, 0] and filled[1, 0]  # a cell that is there from lapse 1 on only


def test_the_worst_cell_is_found_among_those_that_hold_soil(tmp_path):
    """Its row is not its number where cells before it are empty."""
    result = make_slide()
    first = result.lapses[0]
    loop = replace(first.loop, change=(0.5, 1e-4), worst_cell=(19, 200))
    lapses = (replace(first, loop=loop), *result.lapses[1:])
    stored = store(tmp_path / "r", replace(result, lapses=lapses), ())
    text = re.sub(r"<[^>]*>", " ", iterations_table(stored))
    heights = first.cells.centroid[:, 1]
    assert [f"{heights[i]:g}" for i in (19, 200)] == ["15", "17"]
    assert re.search(r"5\.0e-01\s+19\s+15\s+sand", text)


def test_soil_that_moves_keeps_its_line_of_stiffness(tmp_path):
    """Regions come highest first, lapse by lapse; here they change places."""
    result = make_result(lapses=2, kind="box", loop=False, effects={"degradation": True})
    one, two = result.lapses
    cells = replace(two.cells, region=1 - two.cells.region)
    stored = store(tmp_path / "r", replace(result, lapses=(one, replace(two, cells=cells))), ())
    with style.figure_style():
        axes = stiffness(stored).axes[0]
    drawn = {line.get_label(): line.get_ydata()[:2] for line in axes.lines}
    for name, number in (("sand", 0), ("fill", 1)):
        softest = [lapse.degradation[lapse.region == number].min() for lapse in (one.cells, cells)]
        np.testing.assert_array_equal(drawn[name], softest)


def test_air_weighs_nothing():
    scene = make_slide().scene
    stress = vertical_stress(scene, np.array([[30.0, 13.0], [30.0, 18.0], [10.0, 13.0]]))
    # 1 m of soil below the air's floor at 14 m; 11 m elsewhere; sums of a few products
    weight = 1835.0 * GRAVITY
    np.testing.assert_allclose(stress, [weight, 0.0, 11.0 * weight], rtol=1e-12)


# ---------------------------------------------------------------- ParaView


def test_points_tell_stress_by_component(tmp_path):
    for gdim, names in ((2, ("xx", "yy", "xy")), (3, ("xx", "yy", "zz", "yz", "xz", "xy"))):
        result = make_slide(gdim=gdim)
        write(tmp_path / f"{gdim}", result, [1])
        data = meshio.read(tmp_path / f"{gdim}/points_0001.vtu").point_data
        given = make_slide_snapshot(result, 1).points
        assert "stress" not in data and data["displacement"].shape[1] == 3
        for i, name in enumerate(names):
            np.testing.assert_array_equal(data[f"stress_{name}"], given["stress"][:, i])
        assert "g_over_gmax" in data


def test_points_in_cells_that_were_empty_have_their_soil_s_stiffness():
    scene = make_slide().scene
    found = _stiffness(
        scene,
        SimpleNamespace(input_cells=np.array([2, 0, 1]), region_names=("sand", "fill")),
        SimpleNamespace(cell=np.array([0, 1, 2]), region=np.array([1, 0, 0])),
        SimpleNamespace(shear_modulus=np.array([5e6, 6e6, 7e6])),
        SimpleNamespace(g_over_gmax=np.array([0.5, 0.6, 0.7]), fill=np.array([1.0, 0.3, 0.0])),
    )
    np.testing.assert_allclose(found["shear_modulus"], [1835.0 * 225.0**2, 5e6, 6e6], rtol=1e-14)
    np.testing.assert_array_equal(found["g_over_gmax"], [1.0, 0.5, 0.6])


def test_the_mesh_is_written_whole_and_fields_without_empty_cells(tmp_path):
    result = make_slide()
    write(tmp_path / "r", result, [0, 1], fields=True)
    mesh = meshio.read(tmp_path / "r/mesh.vtu")
    centroid = result.lapses[0].cells.centroid
    corners = mesh.points[mesh.cells[0].data][:, :, :2]
    np.testing.assert_allclose(corners.mean(axis=1), centroid, rtol=1e-15)
    for index in (0, 1):
        fields = meshio.read(tmp_path / f"r/fields_{index:04d}.vtu")
        state = result.lapses[index].cells
        held = state.fill > 0
        corners = fields.points[fields.cells[0].data][:, :, :2]
        np.testing.assert_allclose(corners.mean(axis=1), centroid[held], rtol=1e-15)
        [modulus] = fields.cell_data["shear_modulus"]
        np.testing.assert_array_equal(modulus, state.shear_modulus[held])
        # values at the vertices go with them: the snapshot's displacement is their place
        np.testing.assert_array_equal(fields.point_data["displacement"], fields.points)
        assert set(np.unique(fields.cells[0].data)) == set(range(len(fields.points)))


def test_a_run_that_is_replaced_leaves_nothing_of_its_slide(tmp_path):
    write(tmp_path / "r", make_slide(), range(4), finish=publish)
    there = {path.name for path in (tmp_path / "r").iterdir()}
    assert there >= {*PICTURES, "slip.csv", "mesh.vtu"}
    with open_result(tmp_path / "r", force=True) as folder:
        folder.write(make_result())
    there = {path.name for path in (tmp_path / "r").iterdir()}
    assert not there & {*PICTURES, "slip.csv", "mesh.vtu", "points_0000.vtu"}


def test_a_run_that_goes_on_keeps_its_mesh(tmp_path):
    result = make_slide()
    with open_result(tmp_path / "r") as folder:
        folder.snapshot(make_slide_snapshot(result, 0))
    with open_result(tmp_path / "r", resume=True) as folder:
        folder.go_on()
        folder.clear()
        assert {"mesh.vtu", "points_0000.vtu"} <= {p.name for p in (tmp_path / "r").iterdir()}


# ---------------------------------------------------------------- figures


def test_the_slip_is_drawn_beside_its_estimates(tmp_path):
    result = make_slide()
    stored = store(tmp_path / "r", result, ())
    with style.figure_style():
        above, below = slip_history(stored).axes
    lines = {line.get_label(): line for line in above.lines}
    time, slip = lines["coupled"].get_data()
    # 0.3 m, then 0.1 m, in centimetres
    np.testing.assert_allclose(np.interp(ENDS, time, slip), [0.0, 30.0, 40.0, 40.0], atol=1e-12)
    assert above.get_ylabel() == "Slip so far [cm]"
    for name, factor in (("decoupled", 2.0), ("rigid block", 0.5)):
        time, slip = lines[name].get_data()
        np.testing.assert_allclose(time, [0.0, *ENDS], atol=1e-12)
        np.testing.assert_allclose(slip, 100 * factor * np.array([0, *np.cumsum(SLIPS)]))
    lines = {line.get_label(): line for line in below.lines}
    assert max(lines["driving"].get_ydata()) == pytest.approx(3.0 / GRAVITY, rel=2e-3)
    limits = np.unique(np.round(lines["yield"].get_ydata() * GRAVITY, 12))
    np.testing.assert_allclose(limits, [1.0, 1.1, 1.2, 1.3])
    [shaded] = below.collections  # only while it slips: in lapses 1 and 2
    reach = np.concatenate([path.vertices[:, 0] for path in shaded.get_paths()])
    assert 3.0 <= reach.min() < 3.1 and 7.4 < reach.max() <= 7.5


def test_the_mechanism_is_shown_where_there_is_soil(tmp_path):
    result = make_slide()
    stored = store(tmp_path / "r", result)
    with style.figure_style():
        figure = mechanism(stored, plane_of(stored))
        figure.canvas.draw()
    maps = [axes for axes in figure.axes if axes.get_title("left")]
    # lapses 1 and 2 slid, the first one and the last one did not
    titles = [axes.get_title("left") for axes in maps]
    assert titles[0] == "Lapse 1, 3 to 4.5 s: $k_y$ = 0.11, slip 30 cm"
    assert titles[1] == "Lapse 2, 4.5 to 7.5 s: $k_y$ = 0.12, slip 10 cm"
    for axes, index in zip(maps, (1, 2), strict=True):
        lapse = result.lapses[index]
        held = lapse.cells.fill > 0
        cells = axes.collections[0]
        np.testing.assert_array_equal(cells.get_array(), lapse.slip.shear_strain[held])
        middles = [path.vertices[:4].mean(axis=0) for path in cells.get_paths()]
        np.testing.assert_allclose(middles, lapse.cells.centroid[held], rtol=1e-14)
        assert cells.get_clim() == (0.0, result.lapses[2].slip.shear_strain[held].max())
    assert not any(path.contains_point((30.0, 20.0)) for path in maps[0].collections[0].get_paths())


def test_what_did_not_slide_has_a_mechanism_all_the_same(tmp_path):
    stored = store(tmp_path / "r", make_slide(slips=(0.0,) * 4))
    with style.figure_style():
        drawn = {drawing.file: figure for figure, drawing in all_figures(stored)}
    assert {"mechanism.png", "slip.png"} <= set(drawn)
    assert not {"deformed.png", "runout.png"} & set(drawn)
    [axes] = [a for a in drawn["mechanism.png"].axes if a.get_title("left")]
    assert axes.get_title("left").startswith("Lapse 0") and "no slip" in axes.get_title("left")


def test_points_are_shown_where_they_came_to(tmp_path):
    result = make_slide()
    stored = store(tmp_path / "r", result)
    with style.figure_style():
        figure = deformed(stored, plane_of(stored))
        figure.canvas.draw()
    maps = [axes for axes in figure.axes if axes.get_title("left")]
    assert [axes.get_title("left") for axes in maps] == [
        "After 3 s",
        "After 7.5 s",
        "After 13.5 s",
    ]
    for axes, index in zip(maps, (0, 2, 3), strict=True):
        points = make_slide_snapshot(result, index).points
        discs = axes.collections[1]
        np.testing.assert_array_equal(discs.get_offsets(), points["position"])
        length = 100 * np.hypot(*points["displacement"].T)
        np.testing.assert_allclose(discs.get_array(), length, rtol=1e-14)
        # discs of 4 m2
        np.testing.assert_allclose(discs.get_widths(), 4.0 / np.sqrt(np.pi), rtol=1e-12)
    bar = figure.axes[-1]
    assert bar.get_ylabel() == "Displacement [cm]"


def test_toe_and_crest_are_followed(tmp_path):
    """What lies above 10 m goes ahead by the slip, and down by half of it."""
    stored = store(tmp_path / "r", make_slide())
    with style.figure_style():
        axes = run_out(stored, plane_of(stored)).axes[0]
    lines = {line.get_label(): line.get_data() for line in axes.lines}
    came = 100 * np.array([0.0, *np.cumsum(SLIPS)])
    for name, factor in (("toe, forward", 1.0), ("crest, forward", 1.0), ("crest, down", 0.5)):
        time, values = lines[name]
        np.testing.assert_allclose(time, [0.0, *ENDS], atol=1e-12)
        np.testing.assert_allclose(values, factor * came, atol=1e-11)
    assert lines["slip"][1][-1] == pytest.approx(40.0)


def test_a_column_that_slides_has_no_pictures(tmp_path):
    write(tmp_path / "r", make_slide(kind="column"), finish=publish)
    assert PICTURES & {path.name for path in (tmp_path / "r").iterdir()} == {"slip.png"}
    assert "There are no pictures" not in (tmp_path / "r/report.html").read_text(encoding="utf-8")


def test_a_slide_to_the_left_goes_forward_as_well(tmp_path):
    result = make_slide()
    lapses = tuple(replace(i, slip=replace(i.slip, sense=-1)) for i in result.lapses)
    result = replace(result, lapses=lapses)
    with open_result(tmp_path / "r") as folder:
        for index in range(4):
            snapshot = make_slide_snapshot(result, index)
            forward = snapshot.points["displacement"][:, 0].copy()
            for name in ("position", "displacement"):
                snapshot.points[name][:, 0] -= 2.0 * forward
            folder.snapshot(snapshot)
        summary = folder.write(result)
    stored = read_result(tmp_path / "r")
    assert "towards −x" in what_slid(summary)
    with style.figure_style():
        axes = run_out(stored, plane_of(stored)).axes[0]
    toe = next(line for line in axes.lines if line.get_label() == "toe, forward")
    assert toe.get_ydata()[-1] == pytest.approx(40.0)


def test_the_animation_has_a_frame_a_snapshot(tmp_path, monkeypatch):
    stored = store(tmp_path / "r", make_slide())
    path = tmp_path / "r/points.gif"
    with style.figure_style():
        path.write_bytes(animation.animate(stored, plane_of(stored)))
    assert path.stat().st_size < animation.MOST_BYTES == 3_000_000
    with Image.open(path) as image:
        assert image.n_frames == 5 and image.info["loop"] == 0  # the start, and four lapses
        frames = []
        for i in range(image.n_frames):
            image.seek(i)
            frames.append(np.asarray(image.convert("RGB")).astype(int))
    # the darkest violet is where nothing moved: all of the ground, then its lower part alone
    dark = [np.count_nonzero(np.all(np.abs(f - (68, 1, 84)) < 8, axis=2)) for f in frames]
    assert dark[1] == pytest.approx(dark[0], rel=1e-3) and dark[-1] < 0.8 * dark[0]
    yellow = [np.count_nonzero(np.all(np.abs(f - (253, 231, 37)) < 8, axis=2)) for f in frames]
    assert yellow[-1] > 10 * yellow[0]  # the colours' scale has some from the start
    monkeypatch.setattr(animation, "MOST_BYTES", path.stat().st_size - 1)
    with style.figure_style():
        path.write_bytes(animation.animate(stored, plane_of(stored)))
    assert path.stat().st_size <= animation.MOST_BYTES


def test_a_solid_is_cut_along_the_slide(tmp_path):
    result = make_slide(gdim=3)
    stored = store(tmp_path / "r", result)
    plane = plane_of(stored)
    low, high = extent(plane)
    np.testing.assert_allclose([low, high], [[0.0, 0.0], [40.0, 24.0]], atol=1e-12)
    corners = [np.append(o, o[:1], axis=0) for o in plane.outlines]
    areas = [0.5 * np.sum(c[:-1, 0] * c[1:, 1] - c[1:, 0] * c[:-1, 1]) for c in corners]
    # cells of 5 m by 2 m, turning one way, that fill the section once
    np.testing.assert_allclose(areas, 10.0, rtol=1e-12)
    assert len(areas) == 8 * 12
    centroid = result.lapses[0].cells.centroid[plane.numbers]
    middles = [outline.mean(axis=0) for outline in plane.outlines]
    np.testing.assert_allclose(middles, centroid[:, [0, 2]], atol=1e-12)
    np.testing.assert_allclose(centroid[:, 1], 17.5)  # the layer behind the middle, 15 m
    with style.figure_style():
        figure = deformed(stored, plane)
        mechanism(stored, plane)
        run_out(stored, plane)
        figure.canvas.draw()
    shown = figure.axes[0].collections[1].get_offsets()
    held = result.lapses[0].cells
    near = held.centroid[:, 1] == 17.5
    assert len(shown) == np.count_nonzero(near & (held.fill > 0))


def test_a_cut_of_tetrahedra_fills_the_section():
    """A cube of five tetrahedra, cut in the middle: triangles and quadrilaterals of area 1."""
    from fenics_hytf.results.figures.plane import _cut
    from fenics_hytf.results.ground import StoredMesh

    vertices = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    cells = np.array([[0, 1, 2, 4], [3, 2, 1, 7], [5, 4, 7, 1], [6, 7, 4, 2], [1, 2, 4, 7]])
    numbers, outlines = _cut(StoredMesh(vertices, cells, "tetra"), 1, 0.4, (0, 2))
    assert sorted(numbers) == [0, 1, 2, 3, 4] and {len(o) for o in outlines} == {3, 4}
    x, z = zip(*(o.T for o in outlines), strict=True)
    areas = [
        0.5 * abs(np.dot(a, np.roll(b, -1)) - np.dot(b, np.roll(a, -1)))
        for a, b in zip(x, z, strict=True)
    ]
    assert sum(areas) == pytest.approx(1.0, rel=1e-14)


def test_energy_that_goes_into_sliding_is_stacked(tmp_path):
    result = make_slide()
    lapses = []
    for lapse, lost in zip(result.lapses, (0.0, 50.0, 20.0, 0.0), strict=True):
        energy = replace(lapse.energy, slip=lost, damping=lapse.energy.damping - lost)
        lapses.append(replace(lapse, energy=energy))
    result = replace(result, lapses=tuple(lapses))
    stored = store(tmp_path / "r", result, ())
    assert stored.summary["energy"]["slip"] == 70.0
    with style.figure_style():
        axes = energy_balance(stored).axes[0]
    assert "lost in sliding" in axes.get_legend_handles_labels()[1]
    energies = [lapse.energy for lapse in lapses]
    top = np.cumsum([e.damping + e.slip for e in energies]) + [e.stored[1] for e in energies]
    drawn = max(p.vertices[:, 1].max() for part in axes.collections for p in part.get_paths())
    factor = 1e3 if "[kJ/m]" in axes.get_ylabel() else 1.0
    assert factor * drawn == pytest.approx(top.max(), rel=1e-12)


# ---------------------------------------------------------------- report


def test_every_picture_and_the_report(tmp_path):
    write(tmp_path / "r", make_slide(), range(4))
    written = publish(tmp_path / "r")  # from the files alone
    assert set(written) >= PICTURES
    html = (tmp_path / "r/report.html").read_text(encoding="utf-8")
    page = Page(html)
    sources = [value for name, value in page.attributes if name == "src"]
    kinds = [source.split(";")[0] for source in sources]
    assert kinds.count("data:image/gif") == 1 and set(kinds) == {"data:image/gif", "data:image/png"}
    assert len(sources) == len(written) - 1
    assert ("loading", "lazy") in page.attributes
    text = re.sub(r"\s+", " ", " ".join(page.text))
    assert (
        "The slope slid by 0.400 m towards +x and came to rest after 7.5 s; its factor of" in text
    )
    assert "Factor of safety at rest 1.50 k_y, first and last lapse 0.100 and 0.130" in text
    # lapse 1: start, k_y, peak driving, k_y/k_max, coupled, decoupled, rigid, rate, iterations
    assert "1 3 0.110 0.300 0.367 0.300 0.600 0.150 0 21" in text
    assert "all 0.400 0.800 0.200" in text
    assert "cut into 4 lapses of 1.5 to 6 s" in text
    assert "Sliding steps of" in text and "Cohesion [kPa]" in text and " 20.0 0 —" in text
    assert WORDS not in text
    assert not re.search(r"\b(nan|None)\b", text)


def test_the_report_says_what_cannot_be_trusted(tmp_path):
    result = make_slide(yields=(0.2,) * 4, slips=(0.0, 0.3, 0.1, 0.2), end_rate=0.25)
    text = text_of(result, tmp_path / "r")
    assert f"In no lapse is k_y/k_max less than 0.667: {WORDS}." in text
    assert text.count("0.667*") == 3 and f"* S{WORDS[1:]}." in text
    assert "Came to rest no" in text
    assert (
        "There are no pictures of the ground: output.every asked for none of its 4 lapses" in text
    )


@pytest.mark.parametrize("first", [-0.1, 0.1])
def test_blocks_on_ground_that_does_not_stand_are_no_estimates(tmp_path, first):
    text = text_of(make_slide(yields=(first, 0.1, 0.1, 0.1)), tmp_path / "r")
    assert ("the blocks are no estimates of its slip" in text) == (first < 0)


def test_soils_of_a_slide_are_escaped(tmp_path):
    soil = "<i>sand</i>"
    result = make_slide()
    data = json.loads(json.dumps(result.scene.data, default=str))
    data["soil"] = {soil: data["soil"]["sand"], "fill": data["soil"]["fill"]}
    data["mesh"]["regions"][1]["soil"] = soil
    scene = type(result.scene).from_dict(data)
    result = replace(result, scene=scene, region_names=(soil, "fill"))
    write(tmp_path / "r", result, [0], finish=publish)
    page = Page((tmp_path / "r/report.html").read_text(encoding="utf-8"))
    assert "i" not in page.tags and soil in page.text


def test_a_broken_snapshot_is_told(tmp_path):
    write(tmp_path / "r", make_slide(), range(4))
    (tmp_path / "r/points_0003.vtu").write_text("<VTKFile>")
    with pytest.raises(ResultError, match=r"points_0003\.vtu is no VTU file"):
        publish(tmp_path / "r")


# ---------------------------------------------------------------- a run

SCENE = """
title = "A slope of weak clay"
[mesh]
empty = ["air"]
box = { size = [36.0, 12.0], cells = [18, 6] }
regions = [
  { soil = "air", polygon = [[0, 10], [12, 10], [20, 4], [36, 4], [36, 12], [0, 12]] },
  { soil = "clay" },
]
[soil.clay]
density = 1800.0
shear_wave_velocity = 150.0
poisson = 0.4
damping = 0.05
cohesion = 22e3
[[motion]]
direction = "x"
harmonic = { amplitude = -2.0, frequency = 2.0, cycles = 2, samples = 100 }
[boundary]
left = "roller"
right = "roller"
[lapses]
count = 1
[effects]
gravity = true
sliding = { longest = 1.0 }
convection = true
[output]
receivers = { crest = [10.0, 9.0] }
fields = true
"""


def test_a_slope_is_run_drawn_and_drawn_again(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(SCENE)

    def hytf(*arguments):
        with pytest.raises(SystemExit) as stop:
            main(list(arguments))
        out, err = capsys.readouterr()
        assert stop.value.code == 0, err
        return out

    hytf("run", "s.toml", "-o", "r")
    summary = json.loads(Path("r/summary.json").read_text())
    run, lapses = summary["sliding"], summary["lapses"]
    assert run["slip_m"] > 0.01  # k_y is about 0.05, the motion 0.2 g
    assert run["slip_m"] == pytest.approx(sum(i["slip"]["slip_m"] for i in lapses), rel=1e-12)
    assert summary["wall_s"]["mechanism"] > 0
    table = read_table(Path("r/slip.csv"))
    assert table["slip_m"][-1] == pytest.approx(run["slip_m"], rel=1e-12)
    assert np.all(np.diff(table["time_s"]) > 0)
    cells = read_table(Path("r/cells.csv"))
    assert np.all(cells["fill"] > 0) and np.all(cells["mechanism_strain"] >= 0)
    assert np.count_nonzero(cells["lapse"] == 0) < 18 * 6 == len(meshio.read("r/mesh.vtu").cells[0])
    last = lapses[-1]["index"]
    points = meshio.read(f"r/points_{last:04d}.vtu").point_data
    expected = {"displacement", "mechanism", "plastic_strain", "shear_strain", "g_over_gmax"}
    assert set(points) >= expected | {"stress_xx", "stress_yy", "stress_xy"}
    assert np.all(points["stress_yy"] < 100.0) and np.all(points["g_over_gmax"] == 1.0)
    # no point moves farther than all mechanisms together, and the ground shakes by little
    farthest = np.linalg.norm(points["displacement"], axis=1).max()
    assert 0.3 * run["slip_m"] < farthest < run["slip_m"] + 0.05
    fields = meshio.read(f"r/fields_{last:04d}.vtu")
    assert np.all(fields.cell_data["fill"][0] > 0)
    for name in PICTURES:
        Path("r", name).unlink()
    out = hytf("plot", "r")
    assert all(name in out and Path("r", name).exists() for name in PICTURES)
