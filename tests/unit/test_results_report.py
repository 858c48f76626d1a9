# SPDX-License-Identifier: MIT
"""The report and all that is drawn for it: from the folder alone, for every kind of result."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from support.results_builder import DEGRADES, ROCK, make_result

from fenics_hytf.motion import intensity_measures
from fenics_hytf.results import open_result, publish
from fenics_hytf.results.report.conventions import method
from fenics_hytf.results.summary import warnings

MOTION_X = ("histories_x", "transfer_x", "spectra_x", "fourier_x")
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


def text_of(result, folder):
    with open_result(folder) as opened:
        opened.write(result, publish)
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    return re.sub(r"\s+", " ", " ".join(page.text))


@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ({}, {"histories_x", "transfer_x", "spectra_x", "fourier_x", "convergence"}),
        ({"compliant": True, "loop": False}, {"base_x", *MOTION_X}),
        ({"loop": False, "kind": "box"}, {"section", *MOTION_X}),
        (
            {"directions": ("z",), "kind": "box"},
            {"section", "convergence", "histories_z", "transfer_z", "spectra_z", "fourier_z"},
        ),
        (
            {"directions": ("x", "z"), "gdim": 3, "kind": "box", "lapses": 3, "receivers": 9},
            {"histories_x", "histories_z", "transfer_x_x", "transfer_z_z", "convergence"}
            | {"energy", "stiffness", "spectra_x", "spectra_z", "fourier_x", "fourier_z"},
        ),
        ({"receivers": 0, "loop": False}, set()),
        (
            {"lapses": 3, "solver": {"complex_modulus": "hysteretic"}},
            {"stiffness", "convergence", *MOTION_X},
        ),
    ],
    ids=str,
)
def test_every_figure_and_the_report(tmp_path, case, expected):
    expected = {"profiles", "profiles_peaks", *expected}
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


def test_the_report_tells_the_base_and_its_rock(tmp_path):
    text = text_of(make_result(compliant=True), tmp_path / "r")
    assert "The base is compliant" in text and "The input is an outcrop motion" in text
    assert "density 2243.0 kg/m³, Vs 760.0 m/s, Poisson's ratio 0.25, damping 1 %" in text
    assert re.search(r"outcrop \(the input\) x 0\.200 [^w]*within x 0\.140 ", text)
    text = text_of(make_result(), tmp_path / "s")
    assert "The base is rigid. The input is a within motion" in text
    assert re.search(r"within \(the input\) x 0\.200 ", text) and "outcrop" not in text


def test_the_report_tells_a_within_motion_above_rock(tmp_path):
    result = make_result(boundary={"base": {"compliant": ROCK}})
    text = text_of(result, tmp_path / "r")
    assert "the base is held to it" in text and "to find the outcrop motion that belongs" in text


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ({"solver": {"complex_modulus": "shake91"}}, "G* = G(1 − 2D² + 2iD√(1 − D²))"),
        ({"solver": {"complex_modulus": "kramer"}}, "G* = G(1 − D² + 2iD)"),
        ({"solver": {"keep": "bulk"}}, "the bulk modulus is kept and has no damping"),
        (
            {"effects": {"equivalent_linear": {"magnitude": 7.0}}},
            "0.6 (from the magnitude, (M − 1)/10 with M = 7; Idriss and Sun, 1992)",
        ),
        ({"effects": {"rayleigh": {"alpha": 0.2, "beta": 1e-3}}, "loop": False}, "C = αM + βK"),
        ({"loop": False}, "The soil is linear"),
        ({"solver": {"max_frequency": 8.0}}, "up to 8 Hz, were solved"),
        ({}, "up to 10 Hz, the Nyquist frequency, were solved. Lines are 0.0833 Hz apart"),
        ({"boundary": {"left": "tied", "right": "tied"}}, "left and right tied to the opposite"),
        ({"boundary": {"left": "roller"}}, "left held to the input's motion across the boundary"),
        ({"boundary": {"left": "dashpot"}}, "left lined with dashpots (ρVp across and ρVs along"),
        ({"boundary": {"left": "free_field"}}, "left joined by dashpots to level ground"),
        ({"directions": ("z",), "kind": "box"}, "moves across its plane (SH waves)"),
        ({"output": {"water_table": 20.0}}, "below the water table at elevation 20 m"),
        ({"lapses": 3}, "cut into 3 lapses of 4 s"),
        ({"lapses": 3, "continuity": "steady"}, "Each lapse is taken as periodic"),
        ({"lapses": 3}, "memory of the soil at the end of one, carried by the material points"),
        ({"lapses": 3}, "a spring beside four Maxwell branches"),
        (
            {"lapses": 3},
            "modes 2 to 5 rise in frequency by 1–3 % at D = 2 %, 4–8 % at 5 % and 8–16",
        ),
        ({"lapses": 3}, "Above D = 0.25 four branches no longer hold the loss factor"),
        ({"lapses": 3}, "Transfer functions are those on the contour"),
        ({"lapses": 3}, "all 60 of them, up to 10 Hz, the Nyquist frequency, were solved in each"),
        ({"lapses": 3, "compliant": True}, "The dashpots of the base are real, ρV"),
        (
            {"lapses": 3, "solver": {"complex_modulus": "maxwell", "reference_frequency": 2.5}},
            "G at the reference frequency of 2.50 Hz",
        ),
        (
            {"lapses": 3, "solver": {"complex_modulus": "hysteretic"}},
            "in every lapse the response to the whole record is solved",
        ),
        ({"continuity": "transient"}, "The analysed 12 s begin at rest."),
        ({"lapses": 3, "effects": DEGRADES}, "Cycles of shear strain counted in a lapse"),
        (
            {"lapses": 3, "loop": False, "effects": {"degradation": True}},
            "but for what cycles leave of the modulus",
        ),
        (
            {"effects": {"calm": {"sides": ["left"], "thickness": 5.0, "damping": 0.3}}},
            "Along left a layer 5 m thick absorbs waves: damping grows by up to 0.3",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_the_method_is_told_as_it_was(tmp_path, case, words):
    with open_result(tmp_path / "r") as folder:
        summary = folder.write(make_result(**case))
    assert words in " ".join(method(summary))


def test_the_report_tells_seams_and_energy(tmp_path):
    result = make_result(lapses=3, effects=DEGRADES)
    text = text_of(result, tmp_path / "r")
    assert "The seam error is estimated at 0.03 % or less" in text
    assert "The worst is lapse 2." in text
    energies = [lapse.energy for lapse in result.lapses]
    come, lost = (sum(getattr(e, name) for e in energies) for name in ("input", "damping"))
    assert f"{come:.0f} J/m came in at the base, {100 * lost / come:.2g} % of it was lost" in text
    assert re.search(rf"2 8 3\.0e-04 {energies[2].input:.3g} ", text)
    assert f"all {come:.0f} {lost:.0f} 10.0 — — 7.00 3.0e-03" in text
    assert "Degradation fill: above a strain of 0.01 %" in text
    assert "Degradation index [-]" in text and " 0.960 " in text


@pytest.mark.parametrize(("share", "told"), [(1.2, False), (4.0, True)])
def test_moduli_that_bring_more_energy_than_the_shaking_stand_out(share, told, tmp_path):
    result = make_result(lapses=3)
    come = sum(lapse.energy.input for lapse in result.lapses)
    last = result.lapses[2]
    pumped = replace(last, energy=replace(last.energy, seam=share * come))
    text = text_of(replace(result, lapses=(*result.lapses[:2], pumped)), tmp_path / "r")
    assert ("pump the ground up" in text) == told


@pytest.mark.parametrize("case", [{}, {"lapses": 3, "continuity": "steady"}], ids=str)
def test_without_a_seam_or_energy_there_is_no_section_on_them(tmp_path, case):
    assert "Seams and energy" not in text_of(make_result(**case), tmp_path / "r")


def test_the_report_tells_layers_iterations_and_intensity(tmp_path):
    result = make_result()
    text = text_of(result, tmp_path / "r")
    # strain from 0.65 x 1e-4 x (1 + depth/6) at 0.5 and 3.5 m, and between 5 and 23 m
    assert "fill 0 to 4 4 0.00704 to 0.0103 " in text and " 7.0e-04 yes" in text
    assert "sand 4 to 24 10 0.0119 to 0.0314 " in text and " 2.0e-04 yes" in text
    # the fourth iteration was worst in cell 7, in 15 m of 24
    assert "4 7.0e-04 7 9 sand" in text
    measures = intensity_measures(result.history("total_acceleration")[0, 0], result.dt)
    assert f"r0 x 0.500 {measures.pgv:.3g}" in text and f"{measures.arias:.3g}" in text


def test_what_has_not_converged_stands_out(tmp_path):
    result = make_result(lapses=3)
    lapse = result.lapses[1]
    cells = replace(lapse.cells, change=np.where(lapse.cells.region == 0, 2e-3, 1e-4))
    lapses = (result.lapses[0], replace(lapse, cells=cells), result.lapses[2])
    text = text_of(replace(result, lapses=lapses), tmp_path / "r")
    assert text.count(" 2.0e-03 NO") == 1 and text.count(" yes") == 5


def test_what_rounding_leaves_of_no_motion_is_nought(tmp_path):
    result = make_result()
    lapse = result.lapses[0]
    displacement = lapse.displacement.copy()
    displacement[1] = 1e-17
    result = replace(result, lapses=(replace(lapse, displacement=displacement),))
    assert re.search(r"r1 0\.5, 16 x \S+ \S+ \S+ \S+ 0 ", text_of(result, tmp_path / "r"))


@pytest.mark.parametrize(
    ("curves", "words"),
    [
        (
            {"model": "darendeli", "plasticity_index": 15, "mean_stress": 5e4, "ocr": 2},
            "Darendeli, plasticity index 15 %, mean stress 50 kPa, OCR 2",
        ),
        ({"model": "seed_idriss_1970_mean"}, "Seed and Idriss (1970), mean"),
        (
            {"model": "vucetic_dobry_1991", "plasticity_index": 30},
            "Vucetic and Dobry (1991), plasticity index 30 %",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_curves_are_told_with_their_units(tmp_path, curves, words):
    sand = {"density": 1835.0, "shear_wave_velocity": 225.0, "poisson": 0.3, "curves": curves}
    result = make_result(soil={"sand": sand, "fill": sand})
    with open_result(tmp_path / "r") as folder:
        assert folder.write(result)["scene"]["soils"]["sand"]["curves"] == words


def test_receivers_that_figures_leave_out_are_told(tmp_path):
    assert "6 of 9 receivers are shown" in text_of(make_result(receivers=9), tmp_path / "r")


@pytest.mark.parametrize(
    "case", [{"compliant": True}, {"kind": "box", "gdim": 3, "lapses": 3}], ids=str
)
def test_every_column_of_figures_has_its_unit(tmp_path, case):
    with open_result(tmp_path / "r") as folder:
        folder.write(make_result(**case), publish)
    html = (tmp_path / "r/report.html").read_text(encoding="utf-8")
    heads = re.findall(r"<th class=n>([^<]*)</th>", html)
    without = {head for head in heads if not re.search(r"\[[^]]+\]$", head)}
    # numbers that count or name, and times that carry their unit with them
    assert without <= {"Lapse", "Iteration", "in cell", "Time"} and len(heads) > 40


def test_the_report_tells_figures_with_their_digits(tmp_path):
    with open_result(tmp_path / "r") as folder:
        folder.write(make_result(), publish)
    page = Page((tmp_path / "r/report.html").read_text(encoding="utf-8"))
    text = " ".join(page.text)
    # r0 moves with 2.5 times an input of 0.2 g, and by 15 mm; nothing moves in y
    assert re.search(r"r0 0\.5, 24 x 0\.500 2\.50 0\.300 0\.00750 15\.0", text)
    assert "Components that do not move are left out." in text
    assert "darendeli" not in text and "table of 3 strains" in text


@pytest.mark.parametrize(("strength", "told"), [(1e9, False), (2e3, True)])
def test_a_peak_stress_above_the_strength_is_told(strength, told):
    curves = {"model": "darendeli", "plasticity_index": 0, "mean_stress": 50e3}
    soil = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3}
    limited = soil | {"curves": curves | {"shear_strength": strength}}
    result = make_result(soil={"fill": limited, "sand": soil | {"curves": curves}})
    found = [text for text in warnings(result) if "strength" in text]
    assert len(found) == told
    assert not told or found[0].startswith("Soil fill: peak shear stresses reach")
