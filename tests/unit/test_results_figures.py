# SPDX-License-Identifier: MIT
"""Figures and the report: drawn from the folder alone, for every kind of result."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from fenics_hytf.results import open_result, publish, read_result, style
from fenics_hytf.results.figures import (
    convergence,
    histories,
    shown_receivers,
    transfer_functions,
)
from fenics_hytf.results.profiles import profiles
from tests.unit.results_builder import make_result

PNG = b"\x89PNG\r\n\x1a\n"
VOID = {"meta", "img"}


class Page(HTMLParser):
    """Checks that tags nest; collects text and attributes."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.text, self.attributes = [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def store(folder, result):
    with open_result(folder) as opened:
        opened.write(result)
    return read_result(folder)


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ({}, {"histories_x", "transfer_x", "profiles", "spectra_x", "convergence"}),
        ({"loop": False, "kind": "box"}, {"histories_x", "transfer_x", "profiles", "spectra_x"}),
        (
            {"directions": ("x", "z"), "gdim": 3, "kind": "box", "lapses": 3, "receivers": 9},
            {"histories_x", "histories_z", "transfer_x_x", "transfer_z_z", "profiles"}
            | {"spectra_x", "spectra_z", "convergence"},
        ),
        ({"receivers": 0, "loop": False}, {"profiles"}),
    ],
    ids=str,
)
def test_every_figure_and_the_report(tmp_path, case, expected):
    with open_result(tmp_path / "r") as folder:
        folder.write(make_result(**case), publish)
    assert {path.stem for path in (tmp_path / "r").glob("*.png")} == expected
    for path in (tmp_path / "r").glob("*.png"):
        assert path.read_bytes().startswith(PNG)
        path.unlink()
    (tmp_path / "r/report.html").unlink()
    written = publish(tmp_path / "r")  # again, from CSV and JSON alone
    assert {name.removesuffix(".png") for name in written} == {*expected, "report.html"}
    page = Page((tmp_path / "r/report.html").read_text(encoding="utf-8"))
    assert page.tags.count("img") == len(expected)
    assert "script" not in page.tags and "link" not in page.tags
    for name, value in page.attributes:
        if name in ("src", "href"):  # nothing outside the page
            assert value.startswith("data:image/png;base64,")
    assert "None" not in " ".join(page.text) and not re.search(r"\bnan\b", " ".join(page.text))


def test_texts_of_the_user_are_escaped(tmp_path):
    title = '<script>alert("1")</script> & $\\alpha$'
    soil = "<b>sand</b> $x_1$"
    result = make_result(kind="box", loop=False)
    data = dict(result.scene.data)
    data["title"] = title
    data["soil"] = {soil: data["soil"]["sand"], "fill": data["soil"]["fill"]}
    mesh = dict(data["mesh"])
    mesh["regions"] = [{"soil": soil, "below": 20.0}, {"soil": "fill"}]
    data["mesh"] = mesh
    scene = type(result.scene).from_dict(data)
    result = replace(result, scene=scene, region_names=(soil, "fill"))
    with open_result(tmp_path / "r") as folder:
        folder.write(result, publish)
    html = (tmp_path / "r/report.html").read_text(encoding="utf-8")
    page = Page(html)
    assert "script" not in page.tags and "b" not in page.tags
    assert title in page.text and soil in page.text


def test_histories_share_scales_and_mark_seams(tmp_path):
    stored = store(tmp_path / "r", make_result(lapses=3))
    with style.figure_style():
        left, right = histories(stored, "x").subfigs
    assert not right.axes[0].axison and not right.axes[0].lines  # nothing beside the input
    # curve, peak, and a line at the start of lapses 1 and 2 (80 samples of 0.05 s each)
    for axes in (*left.axes, *right.axes[1:]):
        assert [line.get_xdata()[0] for line in axes.lines[2:]] == [4.0, 8.0]
    assert len({axes.get_ylim() for axes in left.axes}) == 1
    assert len({axes.get_ylim() for axes in right.axes[1:]}) == 1
    values = left.axes[0].lines[0].get_ydata() * 9.80665
    # total minus relative acceleration: cancellation of numbers 2.5 times as large
    np.testing.assert_allclose(values, make_result().base_acceleration[0], atol=1e-14)


def test_a_single_line_is_a_marker(tmp_path):
    result = make_result(loop=False)
    lapse = result.lapses[0]
    lapse = replace(
        lapse, frequency=np.array([0.01]), transfer=lapse.transfer[..., :1], solved_lines=1
    )
    stored = store(tmp_path / "r", replace(result, lapses=(lapse,)))
    with style.figure_style():
        axes = transfer_functions(stored, "x", "x").axes[0]
    lines = [line for line in axes.lines if line.get_label().startswith("r")]
    assert len(lines) == 3 and all(line.get_marker() == "o" for line in lines)
    low, high = axes.get_xlim()
    assert low < 0.01 < high
    for r, line in enumerate(lines):
        assert line.get_xydata()[0, 1] == pytest.approx(abs(lapse.transfer[r, 0, 0, 0]), rel=1e-15)


def test_the_line_at_zero_frequency_has_no_place_on_a_logarithmic_axis(tmp_path):
    result = make_result(loop=False)
    lapse = result.lapses[0]
    lapse = replace(lapse, frequency=lapse.frequency - lapse.frequency[0])
    stored = store(tmp_path / "r", replace(result, lapses=(lapse,)))
    with style.figure_style():
        axes = transfer_functions(stored, "x", "x").axes[0]
    assert len(axes.lines[0].get_xdata()) == 59 and min(axes.lines[0].get_xdata()) > 0


def test_resonances_without_damping_are_drawn_on_a_logarithmic_axis(tmp_path):
    result = make_result(loop=False)
    lapse = replace(result.lapses[0], transfer=1e4 * result.lapses[0].transfer)
    stored = store(tmp_path / "r", replace(result, lapses=(lapse,)))
    with style.figure_style():
        assert transfer_functions(stored, "x", "x").axes[0].get_yscale() == "log"


def test_column_profiles_are_steps_between_the_layers_of_cells(tmp_path):
    stored = store(tmp_path / "r", make_result())
    with style.figure_style():
        axes = profiles(stored).axes
    assert [a.get_xlabel().split("\n")[0] for a in axes] == [
        "Peak total",
        "Peak shear",
        "G/Gmax [-]",
        "Damping",
    ]
    strain, depth = axes[1].lines[0].get_data()
    # 10 cells of 2 m below 4 of 1 m, the base at 24 m; sums of centroids, a few roundings
    faces = np.concatenate([24.0 - 2.0 * np.arange(11), [3.0, 2.0, 1.0, 0.0]])
    np.testing.assert_allclose(depth, np.repeat(faces, 2)[1:-1], atol=1e-13)
    # effective strain is 0.65 of the peak, which is what is drawn; round-off of the division
    expected = 100 * make_result().lapses[0].cells.peak_strain
    np.testing.assert_allclose(strain[::2], expected, rtol=1e-14)


def test_profiles_over_lapses_are_envelopes(tmp_path):
    result = make_result(kind="box", lapses=3)
    stored = store(tmp_path / "r", result)
    with style.figure_style():
        axes = profiles(stored).axes
    # fill lies above sand, so it comes first; its dots hold each cell's envelope
    above = result.lapses[0].cells.region == 1
    modulus = np.min([lapse.cells.g_over_gmax[above] for lapse in result.lapses], axis=0)
    np.testing.assert_array_equal(axes[2].lines[0].get_xdata(), modulus)
    strain = np.max([lapse.cells.effective_strain[above] for lapse in result.lapses], axis=0)
    np.testing.assert_allclose(axes[1].lines[0].get_xdata(), 100 * strain / 0.65, rtol=1e-15)


def test_convergence_shows_every_iteration_and_the_tolerance(tmp_path):
    stored = store(tmp_path / "r", make_result(lapses=3))
    with style.figure_style():
        axes = convergence(stored).axes[0]
    assert len(axes.lines) == 4
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), [0.5, 0.08, 0.011, 7e-4])
    assert axes.lines[3].get_ydata()[0] == 1e-3


def test_six_receivers_at_most_from_top_to_bottom(tmp_path):
    stored = store(tmp_path / "r", make_result(receivers=9))
    shown = shown_receivers(stored)
    assert len(shown) == 6 and shown[0] == "r0" and shown[-1] == "r8"
    with open_result(tmp_path / "s") as folder:
        folder.write(make_result(receivers=9), publish)
    assert "6 of 9 receivers" in (tmp_path / "s/report.html").read_text(encoding="utf-8")


def test_the_report_tells_figures_with_their_digits(tmp_path):
    with open_result(tmp_path / "r") as folder:
        folder.write(make_result(), publish)
    page = Page((tmp_path / "r/report.html").read_text(encoding="utf-8"))
    text = " ".join(page.text)
    # r0 moves with 2.5 times an input of 0.2 g, and by 15 mm; nothing moves in y
    assert re.search(r"r0 0\.5, 24 x 0\.500 2\.50 0\.300 0\.00750 15\.0", text)
    assert "No motion in y." in text
    assert "darendeli" not in text and "table of 3 strains" in text


@pytest.mark.parametrize(
    ("peak", "unit"), [(2.0, "m"), (0.5, "cm"), (4e-3, "mm"), (2e-6, "µm"), (0.0, "mm")]
)
def test_units_of_length(peak, unit):
    assert style.length_unit(peak)[1] == unit


def test_names_are_shown_as_they_are():
    assert style.label("a$b$") == r"a\$b\$"
    assert style.label("_hidden").endswith("_hidden") and not style.label("_hidden").startswith("_")
    assert len(style.label("x" * 100)) == 28
