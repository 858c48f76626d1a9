# SPDX-License-Identifier: MIT
"""Tables, summary and ParaView files: what is read back is what was there."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace

import meshio
import numpy as np
import pytest
from support.results_builder import DEGRADES, make_result, make_snapshot

from fenics_hytf.motion import (
    GRAVITY,
    arias_intensity,
    intensity_measures,
    response_spectrum,
)
from fenics_hytf.results import open_result, read_result, read_table
from fenics_hytf.results.summary import plain

CASES = [
    {},
    {"lapses": 3},
    {"directions": ("x", "y"), "loop": False},
    {"directions": ("x", "z"), "gdim": 3, "kind": "box", "lapses": 3},
    {"kind": "box", "loop": False, "receivers": 0},
    {"compliant": True},
    {"directions": ("z",), "kind": "box"},
]
LAYERS = [(4.0, "fill", 4), (10.0, "sand", 5), (10.0, "fill", 5)]


def write(folder, result):
    with open_result(folder) as opened:
        return opened.write(result)


def header(path):
    with path.open(encoding="utf-8", newline="") as file:
        return next(csv.reader(file))


@pytest.mark.parametrize("case", CASES, ids=str)
def test_receivers_read_back_to_the_last_bit(tmp_path, case):
    result = make_result(**case)
    write(tmp_path / "r", result)
    expected_header, expected = ["time_s"], [result.time]
    names = {
        "u": "displacement",
        "v": "velocity",
        "a": "acceleration",
        "A": "total_acceleration",
    }
    for r, receiver in enumerate(result.receivers):
        for letter, name in names.items():
            for c, component in enumerate(result.components):
                expected_header.append(f"{receiver}.{letter}_{component}")
                expected.append(np.concatenate([getattr(i, name)[r, c] for i in result.lapses]))
    assert header(tmp_path / "r/receivers.csv") == expected_header
    values = np.loadtxt(tmp_path / "r/receivers.csv", delimiter=",", skiprows=1, ndmin=2)
    # shortest text that reads back the same double: no tolerance
    np.testing.assert_array_equal(values, np.column_stack(expected))


def test_transfer_has_a_block_a_lapse(tmp_path):
    result = make_result(lapses=3)
    write(tmp_path / "r", result)
    assert header(tmp_path / "r/transfer.csv")[:4] == [
        "frequency_hz",
        "lapse",
        "r0.A_x.re",
        "r0.A_x.im",
    ]
    table = read_table(tmp_path / "r/transfer.csv")
    np.testing.assert_array_equal(table["lapse"], np.repeat([0, 1, 2], 60))
    for lapse in result.lapses:
        here = table["lapse"] == lapse.index
        np.testing.assert_array_equal(table["frequency_hz"][here], lapse.frequency)
        value = table["r1.A_x.re"][here] + 1j * table["r1.A_x.im"][here]
        np.testing.assert_array_equal(value, lapse.transfer[1, 0, 0])


def test_transfer_of_two_motions_names_response_and_direction(tmp_path):
    result = make_result(directions=("x", "y"))
    write(tmp_path / "r", result)
    table = read_table(tmp_path / "r/transfer.csv")
    assert "r0.A_x.re" not in table
    for c, component in enumerate("xy"):
        for m, direction in enumerate("xy"):
            value = (
                table[f"r2.A_{component}/{direction}.re"]
                + 1j * table[f"r2.A_{component}/{direction}.im"]
            )
            np.testing.assert_array_equal(value, result.lapses[0].transfer[2, c, m])


def test_spectra_of_receivers_and_input(tmp_path):
    result = make_result(lapses=3)
    write(tmp_path / "r", result)
    table = read_table(tmp_path / "r/spectra.csv")
    assert list(table)[:3] == ["period_s", "r0.PSA_x", "r0.PSA_y"]
    assert list(table)[-2:] == ["input.x", "within.x"]
    expected = response_spectrum(result.base_acceleration[0], result.dt, table["period_s"])
    np.testing.assert_array_equal(table["input.x"], expected)
    # the receiver's total acceleration is 2.5 times the input by construction; round-off of a sum
    # over 240 samples
    np.testing.assert_allclose(table["r0.PSA_x"], 2.5 * table["input.x"], rtol=1e-12)
    assert not np.any(table["r0.PSA_y"])
    np.testing.assert_array_equal(table["within.x"], table["input.x"])


@pytest.mark.parametrize("directions", [("x",), ("x", "y")])
def test_the_base_within_and_outcrop(tmp_path, directions):
    result = make_result(directions=directions, compliant=True, lapses=3)
    summary = write(tmp_path / "r", result)
    names = [f"{kind}.A_{d}" for d in directions for kind in ("within", "outcrop")]
    assert header(tmp_path / "r/base.csv") == ["time_s", *names]
    table = read_table(tmp_path / "r/base.csv")
    np.testing.assert_array_equal(table["time_s"], result.time)
    spectra = read_table(tmp_path / "r/spectra.csv")
    for m, d in enumerate(directions):
        for kind, motion in (
            ("within", result.within_acceleration[m]),
            ("outcrop", result.outcrop_acceleration[m]),
        ):
            np.testing.assert_array_equal(table[f"{kind}.A_{d}"], motion)
            expected = response_spectrum(motion, result.dt, spectra["period_s"])
            np.testing.assert_array_equal(spectra[f"{kind}.{d}"], expected)
            told = summary["base"][d]
            assert told[f"{kind}_pga_g"] == np.abs(motion).max() / GRAVITY
            arias = float(arias_intensity(motion, result.dt))
            assert told[f"{kind}_intensity"]["arias_m_s"] == arias


def test_a_base_without_rock_has_no_outcrop(tmp_path):
    summary = write(tmp_path / "r", make_result())
    assert header(tmp_path / "r/base.csv") == ["time_s", "within.A_x"]
    told = summary["base"]["x"]
    # scaled to 0.2 g by the scene; round-off
    assert told["within_pga_g"] == pytest.approx(0.2, rel=1e-12)
    assert told["outcrop_pga_g"] is None and told["outcrop_intensity"] is None


@pytest.mark.parametrize("continuity", ["steady", "transient"])
def test_intensity_of_every_receiver(tmp_path, continuity):
    result = make_result(("x", "z"), gdim=3, kind="box", lapses=3, continuity=continuity)
    summary = write(tmp_path / "r", result)
    history = result.history("total_acceleration")
    # transient lapses are one motion, steady ones are periods of their own
    seams = [0, 80, 160] if continuity == "steady" else [0]
    for r, name in enumerate(result.receivers):
        for c, component in enumerate(result.components):
            told = summary["intensity"][name][component]
            expected = intensity_measures(history[r, c], result.dt, seams)
            assert told["pga_m_s2"] == expected.pga and told["pgv_m_s"] == expected.pgv
            assert told["pgd_m"] == expected.pgd and told["cav_m_s"] == expected.cav
            assert told["arias_m_s"] == expected.arias
            if component == "y":  # does not move
                assert told["pga_m_s2"] == 0.0 and told["d5_95_s"] is None
            else:
                assert told["d5_95_s"] == expected.significant_duration


def test_layers_of_a_column(tmp_path):
    result = make_result(lapses=3)
    layers = write(tmp_path / "r", result)["lapses"][1]["layers"]
    cells = result.lapses[1].cells
    assert [layer["soil"] for layer in layers] == ["fill", "sand"]
    assert [layer["depth_m"] for layer in layers] == [[0.0, 4.0], [4.0, 24.0]]
    assert [layer["cells"] for layer in layers] == [4, 10]
    assert [layer["change"] for layer in layers] == [7e-4, 2e-4]
    assert [layer["converged"] for layer in layers] == [True, True]
    sand = cells.region == 0
    for key in ("effective_strain", "g_over_gmax", "damping"):
        values = getattr(cells, key)[sand]
        assert layers[1][key] == [values.min(), values.max()]


def test_layers_of_one_soil_at_two_depths_are_two(tmp_path):
    layers = [{"thickness": t, "soil": s, "cells": c} for t, s, c in LAYERS]
    result = make_result(mesh={"column": {"width": 1.0, "layers": layers}})
    told = write(tmp_path / "r", result)["lapses"][0]["layers"]
    assert [(i["soil"], i["depth_m"], i["cells"]) for i in told] == [
        ("fill", [0.0, 4.0], 4),
        ("sand", [4.0, 14.0], 5),
        ("fill", [14.0, 24.0], 5),
    ]


def test_a_layer_that_has_not_converged_says_so(tmp_path):
    result = make_result()
    lapse = result.lapses[0]
    change = np.where(lapse.cells.region == 0, 2e-3, 1e-4)  # the tolerance is 1e-3
    lapse = replace(lapse, cells=replace(lapse.cells, change=change))
    layers = write(tmp_path / "r", replace(result, lapses=(lapse,)))["lapses"][0]["layers"]
    assert [layer["converged"] for layer in layers] == [True, False]


def test_regions_of_a_box_from_the_top_and_no_loop(tmp_path):
    result = make_result(kind="box", loop=False)
    layers = write(tmp_path / "r", result)["lapses"][0]["layers"]
    assert [layer["soil"] for layer in layers] == ["fill", "sand"]
    # cells 2 m high: centres from 1 to 19 m and from 21 to 23 m
    np.testing.assert_allclose([i["elevation_m"] for i in layers], [[21, 23], [1, 19]], rtol=1e-14)
    assert [layer["change"] for layer in layers] == [None, None]
    assert [layer["converged"] for layer in layers] == [None, None]


def test_cells_of_every_lapse(tmp_path):
    result = make_result(directions=("x",), gdim=3, kind="box", lapses=3)
    write(tmp_path / "r", result)
    expected = "lapse,cell,region,x,y,z,shear_modulus,g_over_gmax,damping,effective_strain,"
    expected += "peak_stress,peak_acceleration,peak_velocity,peak_displacement,peak_strain,"
    expected += "vertical_stress,stress_ratio,change"
    assert ",".join(header(tmp_path / "r/cells.csv")) == expected
    table = read_table(tmp_path / "r/cells.csv")
    cells = result.lapses[2].cells
    here = table["lapse"] == 2
    np.testing.assert_array_equal(table["cell"][here], np.arange(576))
    np.testing.assert_array_equal(table["z"][here], cells.centroid[:, 2])
    for name in ("damping", "peak_velocity", "peak_displacement", "peak_strain", "change"):
        np.testing.assert_array_equal(table[name][here], getattr(cells, name))
    # 20 m of sand below 4 m of fill, 1835 kg/m3 both
    stress = GRAVITY * 1835.0 * (24.0 - cells.centroid[:, 2])
    np.testing.assert_allclose(table["vertical_stress"][here], stress, rtol=1e-13)
    np.testing.assert_allclose(table["stress_ratio"][here], cells.peak_stress / stress, rtol=1e-13)
    names = np.array(result.region_names, dtype=object)[cells.region]
    np.testing.assert_array_equal(table["region"][here], names)


def test_cells_that_degrade_have_a_column_more(tmp_path):
    result = make_result(lapses=3, effects=DEGRADES)
    summary = write(tmp_path / "r", result)
    write(tmp_path / "s", make_result(lapses=3))
    plain_header = header(tmp_path / "s/cells.csv")
    assert header(tmp_path / "r/cells.csv") == [*plain_header, "degradation"]
    table = read_table(tmp_path / "r/cells.csv")
    for i, lapse in enumerate(result.lapses):
        index = lapse.cells.degradation
        np.testing.assert_array_equal(table["degradation"][table["lapse"] == i], index)
        assert summary["lapses"][i]["degradation"] == index.min()
        fill, sand = (layer["degradation"] for layer in summary["lapses"][i]["layers"])
        assert fill == [index.min()] * 2 and sand == [1.0, 1.0]
    assert summary["scene"]["degradation"]["threshold"] == 1e-4


@pytest.mark.parametrize("gdim", [2, 3])
def test_energy_of_lapses_and_of_the_run(tmp_path, gdim):
    result = make_result(lapses=4, kind="box", gdim=gdim)
    summary = write(tmp_path / "r", result)
    unit = "J/m" if gdim == 2 else "J"
    for told, lapse in zip(summary["lapses"], result.lapses, strict=True):
        energy = lapse.energy
        assert told["seam_error"] == lapse.seam_error
        assert told["energy"] == {
            "unit": unit,
            "input": energy.input,
            "damping": energy.damping,
            "rest": energy.rest,
            "slip": 0.0,
            "kinetic": list(energy.kinetic),
            "strain": list(energy.strain),
            "seam": energy.seam,
            "imbalance": energy.imbalance,
        }
    run = summary["energy"]
    assert run["unit"] == unit
    assert summary["worst_seam_error"] == max(i.seam_error for i in result.lapses[1:])
    come = sum(lapse.energy.input for lapse in result.lapses)
    assert run["input"] == come
    # a lapse is off by 1e-3; round-off of sums of some 1e3
    assert run["worst_imbalance"] == pytest.approx(1e-3 / come, rel=1e-8)
    left = run["input"] - run["damping"] - run["rest"] + run["seam"] - run["imbalance"]
    assert left == pytest.approx(run["stored"][1] - run["stored"][0], abs=1e-10)
    assert summary["warnings"] == []


@pytest.mark.parametrize(
    "case", [{"continuity": "steady"}, {"solver": {"complex_modulus": "hysteretic"}}], ids=str
)
def test_without_a_causal_law_there_is_no_energy(tmp_path, case):
    summary = write(tmp_path / "r", make_result(lapses=3, **case))
    assert summary["energy"] is None and summary["lapses"][1]["energy"] is None
    assert (summary["worst_seam_error"] is None) == ("continuity" in case)
    assert summary["scene"]["scheme"] == ("steady" if "continuity" in case else "whole_record")


def test_what_was_solved_is_told(tmp_path):
    told = write(tmp_path / "r", make_result(lapses=3))["scene"]
    assert told["continuity"] == "transient" and told["scheme"] == "handover"
    assert told["solver"]["complex_modulus"] == "maxwell"
    assert told["solver"]["reference_frequency"] > 0
    # six lapses of 80 samples of 0.05 s, over which e^(ηt) grows by e^13.8
    assert told["contour"]["period_s"] == pytest.approx(24.0, rel=1e-15)
    assert told["contour"]["eta_1_s"] == pytest.approx(13.8 / 24.0, rel=1e-15)
    told = write(tmp_path / "s", make_result())["scene"]
    assert told["scheme"] == "steady" and told["contour"] is None


def test_warnings_of_seams_energy_and_the_law(tmp_path):
    result = make_result(lapses=3)
    first, lapse, last = result.lapses
    energy = replace(lapse.energy, damping=lapse.energy.damping + 100.0)
    cells = replace(lapse.cells, damping=np.full_like(lapse.cells.damping, 0.3))
    lapse = replace(lapse, seam_error=0.05, energy=energy, cells=cells)
    found = write(tmp_path / "r", replace(result, lapses=(first, lapse, last)))["warnings"]
    assert len(found) == 4
    assert "seam between lapses by 5 %" in found[0] and "shorter time steps" in found[1]
    assert "off balance by" in found[2]
    assert "30 %" in found[3] and "Maxwell" in found[3]


@pytest.mark.parametrize("case", [{}, {"directions": ("z",), "kind": "box"}], ids=str)
def test_plane_cells_have_no_z(tmp_path, case):
    write(tmp_path / "r", make_result(**case))
    assert header(tmp_path / "r/cells.csv")[3:6] == ["x", "y", "shear_modulus"]


def test_below_a_water_table_the_stress_ratio_is_larger(tmp_path):
    result = make_result()
    output = dict(result.scene.data["output"], water_table=20.0)
    write(tmp_path / "dry", result)
    write(tmp_path / "wet", make_result(output=output))
    dry, wet = (read_table(tmp_path / name / "cells.csv") for name in ("dry", "wet"))
    uplift = 9806.65 * np.maximum(20.0 - dry["y"], 0.0)
    # differences of numbers up to 4e5
    np.testing.assert_allclose(dry["vertical_stress"] - wet["vertical_stress"], uplift, atol=1e-9)
    ratio = wet["peak_stress"] / wet["vertical_stress"]
    np.testing.assert_allclose(wet["stress_ratio"], ratio, rtol=1e-15)


def test_without_level_ground_there_is_no_vertical_stress(tmp_path):
    (tmp_path / "slope.msh").write_text("")
    mesh = {"file": str(tmp_path / "slope.msh")}
    output = {"receivers": {"r0": [0.5, 24.0]}, "water_table": 3.0}
    result = make_result(loop=False, kind="box", mesh=mesh, output=output)
    summary = write(tmp_path / "r", result)
    with (tmp_path / "r/cells.csv").open(encoding="utf-8") as file:
        assert {(row["vertical_stress"], row["stress_ratio"]) for row in csv.DictReader(file)} == {
            ("", "")
        }
    assert any("output.water_table is not used" in text for text in summary["warnings"])


def test_what_does_not_exist_is_empty_or_null(tmp_path):
    result = make_result()
    lapse = result.lapses[0]
    damping = lapse.cells.damping.copy()
    damping[3] = np.nan
    cells = replace(lapse.cells, damping=damping)
    lapse = replace(lapse, cells=cells, worst_residual=np.nan)
    write(tmp_path / "r", replace(result, lapses=(lapse,)))
    for name in ("cells.csv", "receivers.csv", "transfer.csv", "spectra.csv", "summary.json"):
        text = (tmp_path / "r" / name).read_text(encoding="utf-8").lower()
        assert "nan" not in text and "inf" not in text
    with (tmp_path / "r/cells.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["damping"] == "" for row in rows] == [i == 3 for i in range(14)]
    assert math.isnan(read_table(tmp_path / "r/cells.csv")["damping"][3])
    summary = json.loads((tmp_path / "r/summary.json").read_text(encoding="utf-8"))
    assert summary["lapses"][0]["worst_residual"] is None


@pytest.mark.parametrize("case", CASES, ids=str)
def test_summary_says_what_the_contract_lists(tmp_path, case):
    result = make_result(**case)
    write(tmp_path / "r", result)
    summary = json.loads((tmp_path / "r/summary.json").read_text(encoding="utf-8"))
    assert summary["title"] == "A made-up scene"
    assert summary["ranks"] == 1
    assert summary["effects"] == list(result.scene.effects.named)
    assert summary["sizes"] == result.sizes
    assert summary["scene_hash"] == result.scene.hash
    assert set(summary["versions"]) >= {"fenics_hytf", "dolfinx", "petsc", "numpy", "python"}
    assert summary["versions"]["petsc"] is not None
    assert summary["peak_memory_bytes"] == result.peak_memory
    assert len(summary["lapses"]) == len(result.lapses)
    for told, lapse in zip(summary["lapses"], result.lapses, strict=True):
        assert told["excited_lines"] == told["solved_lines"] == 60
        assert told["iterations"] == len(lapse.loop.change)
        assert told["final_change"] == (lapse.loop.change[-1] if lapse.loop.change else None)
        assert told["points_lost"] == told["points_parked"] == 0
        assert told["mass_ledger"]["mass"] == lapse.ledger.mass
    work = summary["work"]
    assert work["factorisations"] == 240
    assert work["assemblies"] == {"elasticity": 8, "mass": 1}
    assert work["wall_s"] == summary["wall_s"]
    phases = ["setup", "assembly", "sweep", "response", "convection", "output"]
    assert list(summary["wall_s"]) == phases
    assert summary["wall_s"]["output"] > 0
    assert [m["direction"] for m in summary["motions"]] == list(result.directions)
    # scaled to 0.2 g by the scene; round-off
    assert summary["motions"][0]["pga_g"] == pytest.approx(0.2, rel=1e-12)
    for r, name in enumerate(result.receivers):
        for c, component in enumerate(result.components):
            peak = max(np.abs(i.total_acceleration[r, c]).max() for i in result.lapses)
            assert summary["peaks"][name][f"A_{component}"] == peak


def test_warnings_of_residual_strain_and_lost_points(tmp_path):
    result = make_result()
    lapse = result.lapses[0]
    strain = np.full_like(lapse.cells.effective_strain, 0.02)
    lapse = replace(
        lapse,
        worst_residual=1e-3,
        cells=replace(lapse.cells, effective_strain=strain),
        ledger=replace(lapse.ledger, parked=2, deleted=1),
    )
    assert write(tmp_path / "a", result)["warnings"] == []
    warnings = write(tmp_path / "b", replace(result, lapses=(lapse,)))["warnings"]
    assert [
        word in text for word, text in zip(("1.0e-03", "3 points", "2 %"), warnings, strict=True)
    ]
    assert len(warnings) == 3


def test_points_and_fields_read_back(tmp_path):
    with open_result(tmp_path / "r") as folder:
        folder.snapshot(make_snapshot(index=7))
    points = meshio.read(tmp_path / "r/points_0007.vtu")
    place = make_snapshot().points["position"]
    np.testing.assert_array_equal(points.points[:, :2], place)
    assert not points.points[:, 2].any()
    np.testing.assert_array_equal(points.point_data["id"], np.arange(4))
    assert points.point_data["displacement"].shape == (4, 3)
    fields = meshio.read(tmp_path / "r/fields_0007.vtu")
    assert fields.cells[0].type == "quad"
    np.testing.assert_array_equal(fields.cell_data["shear_modulus"][0], [9e7])
    # damping does not exist there: 0, and marked
    np.testing.assert_array_equal(fields.cell_data["damping"][0], [0.0])
    np.testing.assert_array_equal(fields.cell_data["has_damping"][0], [0])


def test_three_dimensions_and_no_fields(tmp_path):
    with open_result(tmp_path / "r") as folder:
        folder.snapshot(make_snapshot(gdim=3, fields=False))
    assert [p.name for p in (tmp_path / "r").iterdir()] == ["points_0000.vtu"]
    points = meshio.read(tmp_path / "r/points_0000.vtu")
    np.testing.assert_array_equal(points.points, make_snapshot(gdim=3).points["position"])


def test_names_with_commas_and_quotes_survive(tmp_path):
    result = replace(make_result(), region_names=('a "b", c', "ton, weich"))
    write(tmp_path / "r", result)
    assert set(read_table(tmp_path / "r/cells.csv")["region"]) == {'a "b", c', "ton, weich"}


def test_plain_values():
    value = {"a": np.float64(2.0), "b": (np.int32(1), float("inf")), "c": np.array([1.0, np.nan])}
    assert plain(value) == {"a": 2.0, "b": [1, None], "c": [1.0, None]}


def test_a_stored_result_knows_its_transfer_functions(tmp_path):
    result = make_result(lapses=3)
    write(tmp_path / "r", result)
    stored = read_result(tmp_path / "r")
    frequency, amplitude = stored.transfer_function("r0.A_x", 1)
    np.testing.assert_array_equal(frequency, result.lapses[1].frequency)
    # hypot against abs: the last bit
    np.testing.assert_allclose(amplitude, np.abs(result.lapses[1].transfer[0, 0, 0]), rtol=4e-16)
