# SPDX-License-Identifier: MIT
"""Figures: what they show, as read back from the folder."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import LogNorm
from support.results_builder import DEGRADES, make_result

from fenics_hytf.motion import GRAVITY, fourier_amplitude, smoothed
from fenics_hytf.results import open_result, read_result
from fenics_hytf.results.figures import style
from fenics_hytf.results.figures.convergence import convergence
from fenics_hytf.results.figures.drawing import all_figures
from fenics_hytf.results.figures.energy import energy_balance
from fenics_hytf.results.figures.histories import base_motions, histories
from fenics_hytf.results.figures.profiles import peak_profiles, profiles
from fenics_hytf.results.figures.section import section
from fenics_hytf.results.figures.shown import shown_receivers, solved_band
from fenics_hytf.results.figures.spectra import (
    fourier_amplitudes,
    response_spectra,
    transfer_functions,
)
from fenics_hytf.results.figures.stiffness import stiffness


def store(folder, result):
    with open_result(folder) as opened:
        opened.write(result)
    return read_result(folder)


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


def test_spectra_and_their_amplification_over_the_input_as_solved(tmp_path):
    stored = store(tmp_path / "r", make_result(compliant=True))
    with style.figure_style():
        above, below = response_spectra(stored, "x").axes
    names = [line.get_label() for line in above.lines]
    assert names == ["input (outcrop)", "r0", "r1", "r2"]
    outcrop = stored.spectra["outcrop.x"]
    np.testing.assert_array_equal(above.lines[0].get_ydata(), outcrop / GRAVITY)
    # r0 moves with 2.5 times the input at all periods; round-off of a sum over 240 samples
    np.testing.assert_allclose(below.lines[0].get_ydata(), 2.5, rtol=1e-12)
    assert above.get_ylabel().endswith("[g]") and below.get_ylabel().endswith("[-]")
    assert below.get_xlabel() == "Period [s]" and above.get_xlabel() == ""


def test_spectra_of_a_component_without_input_have_no_ratio(tmp_path):
    result = make_result()
    lapse = result.lapses[0]
    total = lapse.total_acceleration.copy()
    total[:, 1] = 0.4 * total[:, 0]
    stored = store(
        tmp_path / "r", replace(result, lapses=(replace(lapse, total_acceleration=total),))
    )
    with style.figure_style():
        (axes,) = response_spectra(stored, "y").axes
    assert [line.get_label() for line in axes.lines] == ["r0", "r1", "r2"]


def test_fourier_amplitudes_are_smoothed_but_for_lines_far_apart(tmp_path):
    stored = store(tmp_path / "r", make_result())
    band = solved_band(stored)
    assert band == (1 / 6, 10.0)  # as the lines of the made-up lapse
    with style.figure_style():
        axes = fourier_amplitudes(stored, "x", band).axes[0]
    frequency, amplitude = fourier_amplitude(stored.receivers["r0.A_x"], 0.05)
    line = next(line for line in axes.lines if line.get_label() == "r0")
    x, y = line.get_data()
    np.testing.assert_allclose(x[:8], np.arange(2, 10) / 12.0, rtol=1e-14)  # 12 s: 1/12 Hz apart
    # far apart, each is alone in its window
    np.testing.assert_allclose(y[:4], amplitude[2:6], rtol=1e-12)
    np.testing.assert_array_equal(y, smoothed(frequency, amplitude, x))
    assert np.all(np.diff(x) > 0) and x[-1] == pytest.approx(10.0, rel=1e-15)


def test_a_single_line_has_no_fourier_spectrum(tmp_path):
    result = make_result(loop=False)
    lapse = result.lapses[0]
    lapse = replace(
        lapse, frequency=np.array([0.01]), transfer=lapse.transfer[..., :1], solved_lines=1
    )
    assert solved_band(store(tmp_path / "r", replace(result, lapses=(lapse,)))) is None


def test_both_motions_of_a_compliant_base(tmp_path):
    result = make_result(compliant=True, lapses=3)
    stored = store(tmp_path / "r", result)
    with style.figure_style():
        figure = base_motions(stored, "x")
    left, right = figure.subfigs
    assert [a.get_title("left") for a in left.axes] == ["Outcrop (the input)", "Within"]
    drawn = [axes.lines[0].get_ydata() * GRAVITY for axes in left.axes]
    # to g and back
    np.testing.assert_allclose(drawn[0], result.outcrop_acceleration[0], rtol=1e-15)
    np.testing.assert_allclose(drawn[1], result.within_acceleration[0], rtol=1e-15)
    assert [line.get_label() for line in right.axes[0].lines] == ["outcrop", "within"]


def test_a_receiver_at_the_base_rests_relative_to_it(tmp_path):
    result = make_result()
    lapse = result.lapses[0]
    displacement = lapse.displacement.copy()
    displacement[2] = 1e-17 * np.sin(np.arange(240))
    result = replace(result, lapses=(replace(lapse, displacement=displacement),))
    with style.figure_style():
        right = histories(store(tmp_path / "r", result), "x").subfigs[1]
    assert [a.get_title("right") for a in right.axes[1:]] == ["1.50 cm", "1.00 cm", "0 cm"]


def test_the_input_on_top_is_the_one_given(tmp_path):
    stored = store(tmp_path / "r", make_result(compliant=True))
    with style.figure_style():
        first = histories(stored, "x").subfigs[0].axes[0]
    assert first.get_title("left") == "Input (outcrop): synthetic"
    values = first.lines[0].get_ydata() * GRAVITY
    np.testing.assert_allclose(values, make_result().base_acceleration[0], rtol=1e-15)


@pytest.mark.parametrize(
    ("case", "titles"),
    [
        ({}, ["velocity [m/s]", "displacement [cm]", "stress [kPa]", "total vertical stress [-]"]),
        ({"loop": False}, ["velocity [m/s]", "displacement [cm]", "total vertical stress [-]"]),
        (
            {"output": {"water_table": 20.0}},
            [
                "velocity [m/s]",
                "displacement [cm]",
                "stress [kPa]",
                "effective vertical stress [-]",
            ],
        ),
    ],
    ids=str,
)
def test_profiles_of_further_peaks(tmp_path, case, titles):
    result = make_result(**case)
    stored = store(tmp_path / "r", result)
    with style.figure_style():
        axes = peak_profiles(stored).axes
    assert [a.get_xlabel().split("\n")[1] for a in axes] == titles
    cells = result.lapses[0].cells
    np.testing.assert_array_equal(axes[0].lines[0].get_xdata()[::2], cells.peak_velocity)
    np.testing.assert_allclose(
        axes[1].lines[0].get_xdata()[::2], 100 * cells.peak_displacement, rtol=1e-15
    )
    assert axes[0].get_ylabel() == "Depth [m]"


def test_maps_of_a_section_leave_the_air_out(tmp_path):
    result = make_result(kind="box")
    lapse = result.lapses[0]
    x, y = lapse.cells.centroid.T
    ground = (y < 12.0) | (x < 16.0) | (x > 28.0)  # a trench, 12 m wide and deep
    cells = {k: v[ground] for k, v in vars(lapse.cells).items() if v is not None}
    lapse = replace(lapse, cells=replace(lapse.cells, **cells))
    sizes = result.sizes | {"cells": np.count_nonzero(ground)}
    stored = store(tmp_path / "r", replace(result, lapses=(lapse,), sizes=sizes))
    with style.figure_style():
        figure = section(stored)
        figure.canvas.draw()
    maps = [a for a in figure.axes if a.get_title("left")]
    assert [a.get_title("left") for a in maps] == [
        "Peak total acceleration [g]",
        "Peak shear strain [%]",
        "G/Gmax [-]",
    ]
    for axes in maps:
        contours = axes.collections[0]

        def shown(place, contours=contours):
            return any(path.contains_point(place) for path in contours.get_paths())

        assert shown((10.0, 18.0)) and shown((34.0, 18.0)) and shown((22.0, 6.0))
        assert not shown((22.0, 18.0)) and not shown((22.0, 14.0))


@pytest.mark.parametrize("case", [{}, {"gdim": 3, "kind": "box"}], ids=str)
def test_no_map_of_columns_and_solids(tmp_path, case):
    assert section(store(tmp_path / "r", make_result(**case))) is None


def test_a_map_of_one_value_and_of_values_that_span_decades(tmp_path):
    result = make_result(kind="box")
    cells = result.lapses[0].cells
    cells = replace(
        cells,
        peak_strain=np.geomspace(1e-6, 1e-3, cells.region.size),
        g_over_gmax=np.ones(cells.region.size),
        peak_acceleration=np.where(cells.region == 0, cells.peak_acceleration, np.nan),
    )
    lapse = replace(result.lapses[0], cells=cells)
    stored = store(tmp_path / "r", replace(result, lapses=(lapse,)))
    with style.figure_style():
        figure = section(stored)
        figure.canvas.draw()
    strain = next(a for a in figure.axes if a.get_title("left").startswith("Peak shear"))
    assert isinstance(strain.collections[0].norm, LogNorm)


def test_convergence_shows_every_iteration_and_the_tolerance(tmp_path):
    stored = store(tmp_path / "r", make_result(lapses=3))
    with style.figure_style():
        axes = convergence(stored).axes[0]
    assert len(axes.lines) == 4
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), [0.5, 0.08, 0.011, 7e-4])
    assert axes.lines[3].get_ydata()[0] == 1e-3


@pytest.mark.parametrize("lapses", [1, 3, 40])
def test_energy_adds_up_from_lapse_to_lapse(tmp_path, lapses):
    law = {"complex_modulus": "maxwell"}
    result = make_result(lapses=lapses, continuity="transient", solver=law)
    stored = store(tmp_path / "r", result)
    with style.figure_style():
        figure = energy_balance(stored)
    above = figure.axes[0]
    assert len(figure.axes) == (1 if lapses == 1 else 2)
    factor = 1e3 if "[kJ/m]" in above.get_ylabel() else 1.0
    energies = [lapse.energy for lapse in result.lapses]
    come = next(line for line in above.lines if line.get_label() == "input")
    time, energy = come.get_data()
    np.testing.assert_allclose(time, np.linspace(0.0, 12.0, lapses + 1), atol=1e-12)
    np.testing.assert_allclose(factor * energy[1:], np.cumsum([e.input for e in energies]))
    # the top of what is lost and stored is what came in, at the base and at seams
    top = np.cumsum([e.damping for e in energies]) + [e.stored[1] for e in energies]
    drawn = max(
        path.vertices[:, 1].max() for part in above.collections for path in part.get_paths()
    )
    assert factor * drawn == pytest.approx(top.max(), rel=1e-12)
    if lapses > 1:
        both = next(line for line in above.lines if line.get_label() == "input and seams")
        # each lapse is off by 1e-3
        np.testing.assert_allclose(factor * both.get_ydata()[1:], top, atol=1.1e-3 * lapses)
        marks = {line.get_label(): line for line in figure.axes[1].lines}
        np.testing.assert_allclose(
            factor * marks["jump at the seam"].get_ydata(), [e.seam for e in energies[1:]]
        )
        np.testing.assert_allclose(
            factor * marks["from fading stress"].get_ydata(), [-e.rest for e in energies[1:]]
        )


def test_stiffness_is_a_step_a_lapse(tmp_path):
    result = make_result(lapses=3, effects=DEGRADES)
    stored = store(tmp_path / "r", result)
    with style.figure_style():
        above, below = stiffness(stored).axes
    assert [line.get_label() for line in above.lines] == ["fill, 0–4 m", "sand, 4–24 m"]
    softest = [[c.g_over_gmax[c.region == r].min() for c in (i.cells for i in result.lapses)]
               for r in (1, 0)]  # fmt: skip
    for line, values in zip(above.lines, softest, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), [0.0, 4.0, 8.0, 12.0])
        np.testing.assert_array_equal(line.get_ydata()[:-1], values)
        assert line.get_drawstyle() == "steps-post"
    np.testing.assert_array_equal(below.lines[0].get_ydata(), [1.0, 0.98, 0.98**2, 0.98**2])


@pytest.mark.parametrize(
    ("case", "panels"),
    [
        ({}, None),
        ({"lapses": 3, "loop": False}, None),
        ({"lapses": 3, "continuity": "steady"}, ["G/Gmax [-]"]),
        (
            {"lapses": 3, "loop": False, "effects": {"degradation": True}},
            ["Degradation index [-]"],
        ),
    ],
    ids=str,
)
def test_stiffness_is_drawn_where_it_changes(tmp_path, case, panels):
    with style.figure_style():
        figure = stiffness(store(tmp_path / "r", make_result(**case)))
    assert (None if figure is None else [a.get_ylabel() for a in figure.axes]) == panels


def test_transfer_functions_on_a_damped_contour_say_so(tmp_path):
    stored = store(tmp_path / "r", make_result(lapses=3))
    with style.figure_style():
        drawn = [(f, d) for f, d in all_figures(stored) if d.file == "transfer_x.png"]
    [(figure, drawing)] = drawn
    assert "at s = η + iω" in figure.axes[0].get_ylabel()
    assert "damped contour s = η + iω, η = 0.575 1/s" in drawing.caption


def test_six_receivers_at_most_from_top_to_bottom(tmp_path):
    shown = shown_receivers(store(tmp_path / "r", make_result(receivers=9)))
    assert len(shown) == 6 and shown[0] == "r0" and shown[-1] == "r8"


@pytest.mark.parametrize(
    ("peak", "unit"), [(2.0, "m"), (0.5, "cm"), (4e-3, "mm"), (2e-6, "µm"), (0.0, "mm")]
)
def test_units_of_length(peak, unit):
    assert style.length_unit(peak)[1] == unit


def test_names_are_shown_as_they_are():
    assert style.label("a$b$") == r"a\$b\$"
    assert style.label("_hidden").endswith("_hidden") and not style.label("_hidden").startswith("_")
    assert len(style.label("x" * 100)) == 28


@pytest.mark.parametrize(
    "case",
    [
        {"compliant": True},
        {"kind": "box", "loop": False},
        {"kind": "box", "gdim": 3},
        {"lapses": 3, "effects": DEGRADES},
    ],
    ids=str,
)
def test_every_axis_has_its_unit(tmp_path, case):
    stored = store(tmp_path / "r", make_result(**case))
    with style.figure_style():
        for figure, drawing in all_figures(stored):
            every = list(figure.axes)
            labels = {a.get_xlabel() for a in every} | {a.get_ylabel() for a in every}
            labels |= {part.get_supylabel() for part in (figure, *figure.subfigs)}
            labels -= {""}
            titles = (
                {a.get_title("left") for a in every} if drawing.file == "section.png" else set()
            )
            assert len(labels) >= 2, drawing.file
            for text in (labels | titles) - {""}:
                assert re.search(r"\[[^]]+\]\s*$", text), (drawing.file, text)
