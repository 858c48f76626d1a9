# SPDX-License-Identifier: MIT
"""Curves in the scene: by model, as a table, from a file, limited by the shear strength."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fenics_hytf.scene.soil import read_curves, read_soils
from fenics_hytf.soil import CURVE_MODELS, LimitedCurve, limit_strength, menq

SAND = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3}  # G_max = 72 MPa
DARENDELI = {"model": "darendeli", "plasticity_index": 0, "mean_stress": 50e3}
CSV = "strain_percent,modulus,damping_percent\n1e-4,1,0.8\n0.01,0.76,3.9\n1,0.05,20.5\n"


def read(curves, folder=Path(), **others):
    soils, faults = read_soils({"sand": {**SAND, "curves": curves, **others}}, folder=folder)
    assert (soils["sand"] is None) == bool(faults)
    return soils["sand"], [str(fault) for fault in faults]


def test_a_model_by_name():
    soil, faults = read(
        {"model": "menq", "uniformity_coefficient": 8, "d50": 2.5, "mean_stress": 80e3}
    )
    assert not faults
    expected = menq(8, 2.5, 80e3)
    assert np.array_equal(soil.curve.modulus, expected.modulus)
    assert np.array_equal(soil.curve.damping, expected.damping)


def test_a_file_beside_the_scene(tmp_path):
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "clay.csv").write_text(CSV)
    soil, faults = read({"file": "lab/clay.csv"}, tmp_path)
    assert not faults
    assert soil.curve.strain == pytest.approx([1e-6, 1e-4, 1e-2], rel=1e-15)
    assert soil.curve.modulus.tolist() == [1.0, 0.76, 0.05]
    assert soil.curve.damping == pytest.approx([0.008, 0.039, 0.205], rel=1e-15)
    # the table holds where it came from, and lasts when the file is gone
    (tmp_path / "lab" / "clay.csv").unlink()
    assert soil.curves["file"] == "lab/clay.csv" and len(soil.curves["strain"]) == 3
    assert soil.model_copy().curve.small_strain_damping == pytest.approx(0.008)


def test_a_file_read_by_itself(tmp_path):
    (tmp_path / "clay.csv").write_text(CSV)
    curve, faults = read_curves({"file": "clay.csv"}, "curves", tmp_path)
    assert not faults and curve.modulus.tolist() == [1.0, 0.76, 0.05]
    assert read_curves({"file": "clay.csv"}, "curves", tmp_path / "elsewhere")[0] is None


@pytest.mark.parametrize(
    ("curves", "key", "found", "expected"),
    [
        ({"file": "no.csv"}, "file", '"no.csv", which is not there', "a CSV file of curves;"),
        ({"file": 3}, "file", "3", "the path of a CSV file"),
        ({"file": ""}, "file", '""', "the path of a CSV file"),
        ({"file": "clay.csv", "strain": [1]}, "strain", "[1]", "nothing beside file"),
        ({"file": "clay.csv", "model": "mkz"}, "model", '"mkz"', "nothing beside file"),
        ({"file": "clay.csv", "ocr": 1}, "ocr", "1", "model, or strain, modulus, damping, or file"),
        ({"file": "word.csv"}, "file", "'x' (word.csv, line 2)", "a finite number in the column"),
        ({"file": "header.csv"}, "file", "'1', '2', '3' (header.csv, line 1)", "the column names"),
        ({"file": "order.csv"}, "file", "0.01 then 0.0001 at positions 1 and 2 (order.csv, colu",
         "values that increase"),
        ({"file": "percent.csv"}, "file", "3.9 at position 2 (percent.csv, column damping)",
         "0 <= damping < 1, as a ratio, not in percent"),
        ({"file": "short.csv"}, "file", "1 strains, 1 moduli and 1 damping ratios (short.csv)",
         "at least 2"),
        ({**DARENDELI, "shear_strength": 0}, "shear_strength", "0", "a positive number [Pa]"),
        ({**DARENDELI, "shear_strength": "high"}, "shear_strength", '"high"', "a positive number"),
        ({**DARENDELI, "shear_strength": True}, "shear_strength", "true", "a positive number"),
        ({**DARENDELI, "shear_strength": float("inf")}, "shear_strength", "inf", "a positive num"),
        ({**DARENDELI, "shear_strength": 50.0}, "shear_strength", "50 Pa",
         "more than 71.59 Pa, which the curve mobilises at its smallest strain, 1e-06"),
        ({**DARENDELI, "transition_strain": 1e-3}, "transition_strain", "0.001",
         "nothing without shear_strength"),
        ({**DARENDELI, "shear_strength": 2e4, "transition_strain": -1}, "transition_strain", "-1",
         "a positive number [-]"),
        ({**DARENDELI, "shear_strength": 1e4, "transition_strain": 1e-2}, "transition_strain",
         "0.01, where the curve mobilises", "less than the strength, 10000 Pa"),
    ],
    ids=str,
)  # fmt: skip
def test_one_fault_gives_one_message(tmp_path, curves, key, found, expected):
    header = "strain,modulus,damping\n"
    for name, text in {
        "clay.csv": CSV,
        "word.csv": f"{header}1e-6,x,0.01\n1e-4,0.8,0.02\n",
        "header.csv": "1,2,3\n",
        "order.csv": f"{header}1e-2,1,0.01\n1e-4,0.8,0.02\n",
        "percent.csv": f"{header}1e-6,1,0.8\n1e-4,0.8,3.9\n",
        "short.csv": f"{header}1e-6,1,0.01\n",
    }.items():
        (tmp_path / name).write_text(text)
    _, faults = read(curves, tmp_path)
    [fault] = faults
    assert fault.startswith(f"soil.sand.curves.{key}: found {found}")
    assert expected in fault


def test_every_fault_of_a_file_and_of_the_soil_is_told(tmp_path):
    (tmp_path / "bad.csv").write_text("strain,modulus,damping\n1e-6,1,0.01\n1e-7,1.2,3.0\n")
    _, faults = read({"file": "bad.csv"}, tmp_path, density=-1.0)
    assert [fault.split(";")[0] for fault in faults] == [
        "soil.sand.curves.file: found 1e-06 then 1e-07 at positions 1 and 2 (bad.csv, column "
        "strain)",
        "soil.sand.curves.file: found 1.2 at position 2 (bad.csv, column modulus)",
        "soil.sand.curves.file: found 3.0 at position 2 (bad.csv, column damping)",
        "soil.sand.density: found -1.0",
    ]


def test_the_shear_strength_limits_models_tables_and_files(tmp_path):
    (tmp_path / "clay.csv").write_text(CSV)
    table = {"strain": [1e-6, 1e-4, 1e-2], "modulus": [1.0, 0.76, 0.05], "damping": [0, 0.1, 0.2]}
    for curves in (DARENDELI, table, {"file": "clay.csv"}):
        free, _ = read(curves, tmp_path)
        soil, faults = read({**curves, "shear_strength": 40e3}, tmp_path)
        assert not faults and isinstance(soil.curve, LimitedCurve)
        expected = limit_strength(free.curve, 72e6, 40e3)
        strain = np.logspace(-7, 0, 50)
        assert np.array_equal(soil.curve.evaluate(strain)[0], expected.evaluate(strain)[0])
        assert 72e6 * soil.curve.evaluate(1.0)[0] == pytest.approx(40e3, rel=0.01)


def test_the_small_strain_modulus_of_the_soil_counts():
    # however the stiffness is given
    limit = {**DARENDELI, "shear_strength": 40e3}
    by_velocity, _ = read(limit)
    by_modulus, _ = read(limit, shear_wave_velocity=None, shear_modulus=72e6)
    stiffer, _ = read(limit, shear_wave_velocity=300.0)
    assert by_modulus.curve.strength == pytest.approx(by_velocity.curve.strength, rel=1e-14)
    assert stiffer.curve.strength == pytest.approx(by_velocity.curve.strength / 2.25, rel=1e-12)
    given_strain, _ = read({**limit, "transition_strain": 2e-4})
    assert given_strain.curve.transition_strain == 2e-4


def test_without_constants_a_curve_is_not_limited():
    curve, faults = read_curves({**DARENDELI, "shear_strength": 40e3}, "curves")
    assert not faults and not isinstance(curve, LimitedCurve)


VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-2, 2),
    st.floats(),
    st.sampled_from(["", "a", "clay.csv", *CURVE_MODELS]),
    st.lists(st.floats(0, 2), max_size=3),
)
KEYS = ("model", "file", "strain", "modulus", "damping", "shear_strength", "transition_strain")
PARAMETERS = ("plasticity_index", "mean_stress", "reference_strain", "curvature", "d50", "x")


@given(st.dictionaries(st.sampled_from(KEYS + PARAMETERS), VALUES))
def test_whatever_the_curves_hold_there_are_faults_or_a_curve(curves):
    soil, faults = read(curves)
    assert faults or np.all(soil.curve.evaluate([0.0, 1e-4, 1.0])[0] > 0.0)
    assert all(": found " in fault for fault in faults)
