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

from fenics_hytf.motion import response_spectrum
from fenics_hytf.results import open_result, read_result, read_table
from fenics_hytf.results.summary import plain
from tests.unit.results_builder import make_result, make_snapshot

CASES = [
    {},
    {"lapses": 3},
    {"directions": ("x", "y"), "loop": False},
    {"directions": ("x", "z"), "gdim": 3, "kind": "box", "lapses": 3},
    {"kind": "box", "loop": False, "receivers": 0},
]


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
    assert list(table)[-1] == "input.x"
    expected = response_spectrum(result.base_acceleration[0], result.dt, table["period_s"])
    np.testing.assert_array_equal(table["input.x"], expected)
    # the receiver's total acceleration is 2.5 times the input by construction; round-off of a sum
    # over 240 samples
    np.testing.assert_allclose(table["r0.PSA_x"], 2.5 * table["input.x"], rtol=1e-12)
    assert not np.any(table["r0.PSA_y"])


def test_cells_of_every_lapse(tmp_path):
    result = make_result(directions=("x",), gdim=3, kind="box", lapses=3)
    write(tmp_path / "r", result)
    expected = "lapse,cell,region,x,y,z,shear_modulus,g_over_gmax,damping,effective_strain,"
    expected += "peak_stress,peak_acceleration"
    assert ",".join(header(tmp_path / "r/cells.csv")) == expected
    table = read_table(tmp_path / "r/cells.csv")
    cells = result.lapses[2].cells
    here = table["lapse"] == 2
    np.testing.assert_array_equal(table["cell"][here], np.arange(576))
    np.testing.assert_array_equal(table["z"][here], cells.centroid[:, 2])
    np.testing.assert_array_equal(table["damping"][here], cells.damping)
    names = np.array(result.region_names, dtype=object)[cells.region]
    np.testing.assert_array_equal(table["region"][here], names)


def test_plane_cells_have_no_z(tmp_path):
    write(tmp_path / "r", make_result())
    assert header(tmp_path / "r/cells.csv")[3:6] == ["x", "y", "shear_modulus"]


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
