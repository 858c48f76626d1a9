# SPDX-License-Identifier: MIT
import json
from pathlib import Path

import numpy as np
import pytest

from fenics_hytf.soil import CURVE_MODELS, Curve, curve_from_model, darendeli

C = json.loads((Path(__file__).parents[1] / "data/c_darendeli24_synthetic_pga0p2.json").read_text())

# parameters of the models that need some
PARAMETERS = {
    "darendeli": {"plasticity_index": 10.0, "mean_stress": 1e5},
    "menq": {"uniformity_coefficient": 10.0, "d50": 5.0, "mean_stress": 1e5},
    "ishibashi_zhang": {"plasticity_index": 10.0, "mean_stress": 1e5},
    "hardin_drnevich": {"reference_strain": 4e-4, "max_damping": 0.25},
    "mkz": {"reference_strain": 4e-4, "curvature": 0.9, "small_strain_damping": 0.01, "p1": 0.7},
    "vucetic_dobry_1991": {"plasticity_index": 10.0},
    "epri_1993_pi": {"plasticity_index": 20.0},
}

CURVE = Curve(np.array([1e-5, 1e-4, 1e-2]), np.array([1.0, 0.8, 0.1]), np.array([0.01, 0.03, 0.2]))


def test_points_and_outside():
    strain = np.array([0.0, 1e-9, 1e-5, 1e-4, 1e-2, 0.5])
    modulus, damping = CURVE.evaluate(strain)
    # points come back through a logarithm
    assert modulus == pytest.approx([1.0, 1.0, 1.0, 0.8, 0.1, 0.1], rel=1e-14)
    assert damping == pytest.approx([0.01, 0.01, 0.01, 0.03, 0.2, 0.2], rel=1e-14)
    assert CURVE.small_strain_damping == 0.01


def test_linear_in_the_logarithm():
    modulus, damping = CURVE.evaluate(1e-3)  # half-way between 1e-4 and 1e-2
    assert modulus.shape == damping.shape == ()
    assert modulus == pytest.approx(0.45, rel=1e-14)
    assert damping == pytest.approx(0.115, rel=1e-14)


def test_shape_is_kept_and_nan_is_passed_on():
    modulus, damping = CURVE.evaluate(np.array([[1e-4, np.nan, 1e-3]]))
    assert modulus.shape == damping.shape == (1, 3)
    assert np.array_equal(np.isnan(modulus), [[False, True, False]])
    assert np.array_equal(np.isnan(damping), [[False, True, False]])


def test_columns_are_read_only_copies():
    strain = np.array([1e-5, 1e-4])
    curve = Curve(strain, [1.0, 0.9], [0.01, 0.02])
    strain[0] = 1.0
    assert curve.strain[0] == 1e-5
    with pytest.raises(ValueError, match="read-only"):
        curve.modulus[0] = 0.5


def test_damping_may_dip():
    # as EPRI (1993) tabulates for PI = 10 at its smallest strains
    Curve([1e-6, 1.778e-6, 3.162e-6], [1.0, 1.0, 0.998], [0.01, 0.00991, 0.01054])


@pytest.mark.parametrize(
    ("strain", "modulus", "damping", "message"),
    [
        ([1e-4], [1.0], [0.1], "1 strains, 1 moduli and 1 damping ratios"),
        ([1e-4, 1e-3], [1.0], [0.1, 0.2], "2 strains, 1 moduli"),
        ([1e-4, 1e-3], [1.0, 0.5], [0.1, 0.2, 0.3], "3 damping ratios"),
        ([1e-4, 1e-4], [1.0, 0.5], [0.1, 0.2], r"strain: found 0.0001 then 0.0001 .* increase"),
        ([1e-3, 1e-4], [1.0, 0.5], [0.1, 0.2], "strain: found 0.001 then 0.0001"),
        ([0.0, 1e-4], [1.0, 0.5], [0.1, 0.2], "strain: found 0.0 at position 1"),
        ([-1e-4, 1e-4], [1.0, 0.5], [0.1, 0.2], "strain: found -0.0001"),
        ([1e-4, np.inf], [1.0, 0.5], [0.1, 0.2], "strain: found inf"),
        ([1e-4, np.nan], [1.0, 0.5], [0.1, 0.2], "strain: found nan"),
        ([1e-4, 1e-3], [0.5, 0.6], [0.1, 0.2], r"modulus: found 0.5 then 0.6 .* do not increase"),
        ([1e-4, 1e-3], [1.1, 0.6], [0.1, 0.2], r"modulus: found 1.1 .* 0 < G/Gmax <= 1"),
        ([1e-4, 1e-3], [1.0, 0.0], [0.1, 0.2], "modulus: found 0.0 at position 2"),
        ([1e-4, 1e-3], [1.0, np.nan], [0.1, 0.2], "modulus: found nan"),
        ([1e-4, 1e-3], [1.0, 0.5], [0.1, 1.0], r"damping: found 1.0 .* 0 <= damping < 1"),
        ([1e-4, 1e-3], [1.0, 0.5], [2.0, 15.0], r"damping: found 2.0 .* not in percent"),
        ([1e-4, 1e-3], [1.0, 0.5], [-0.1, 0.2], "damping: found -0.1"),
        ([1e-4, 1e-3], [1.0, 0.5], [0.1, np.nan], "damping: found nan"),
        ([[1e-4, 1e-3]], [1.0, 0.5], [0.1, 0.2], r"strain: found shape \(1, 2\)"),
        (["a", 1e-3], [1.0, 0.5], [0.1, 0.2], "strain: found .* expected a list of numbers"),
        ([1e-4, 1e-3], 0.5, [0.1, 0.2], r"modulus: found shape \(\)"),
    ],
)
def test_invalid_tables(strain, modulus, damping, message):
    with pytest.raises(ValueError, match=message):
        Curve(strain, modulus, damping)


def layers_of_the_reference():
    """Plasticity index and exact mean stress [kPa] of each curve: its name rounds the stress."""
    stresses: dict[str, list[float]] = {}
    plasticity = {}
    for layer in C["profile"]["layers_top_down"]:
        stresses.setdefault(layer["curve"], []).append(layer["mean_eff_stress_kPa"])
        plasticity[layer["curve"]] = layer["PI"]
    return [(name, plasticity[name], np.mean(values)) for name, values in stresses.items()]


@pytest.mark.parametrize(("name", "plasticity_index", "stress"), layers_of_the_reference())
def test_darendeli_against_pystrata(name, plasticity_index, stress):
    reference = C["curves"][name]
    curve = darendeli(plasticity_index, 1e3 * stress)
    # the reference prints 8 digits
    assert curve.strain == pytest.approx(np.array(reference["strain"]), rel=1e-7)
    assert curve.modulus == pytest.approx(np.array(reference["G_over_Gmax"]), rel=1e-7)
    assert curve.damping == pytest.approx(np.array(reference["damping"]), rel=1e-7)


def test_darendeli_equivalent_linear_state_of_the_reference():
    # the reference's converged G and D lie on its curves at 0.65 of its strains (7 digits)
    names = [layer["curve"] for layer in C["profile"]["layers_top_down"]]
    curves = {name: darendeli(pi, 1e3 * p) for name, pi, p in layers_of_the_reference()}
    results = C["results"]
    for i, name in enumerate(names):
        modulus, damping = curves[name].evaluate(
            C["strain_ratio"] * results["max_shear_strain_mid"][i]
        )
        assert modulus == pytest.approx(results["G_over_Gmax"][i], rel=1e-6)
        assert damping == pytest.approx(results["damping"][i], rel=1e-6)


def test_darendeli_trends():
    base = darendeli(15.0, 100e3)
    for stiffer in (darendeli(30.0, 100e3), darendeli(15.0, 400e3), darendeli(15.0, 100e3, ocr=4)):
        assert np.all(stiffer.modulus > base.modulus)
    assert darendeli(15.0, 100e3, frequency=10.0).damping[0] > base.damping[0]
    assert np.all(darendeli(15.0, 100e3, cycles=100.0).damping[5:] < base.damping[5:])
    assert np.all(np.diff(base.damping) >= 0.0)


def test_darendeli_at_the_reference_strain():
    # at one atmosphere and PI = 0 the reference strain is 0.0352 %, where G is half by definition
    curve = darendeli(0.0, 101325.0, strain=[1e-10, 0.000352, 0.01])
    assert curve.modulus[1] == pytest.approx(0.5, rel=1e-12)
    # and at vanishing strain the damping is its minimum, 0.8005 %, but for 2/3 of the strain over
    # the reference strain
    assert curve.damping[0] == pytest.approx(0.008005, rel=1e-5)


@pytest.mark.parametrize("strain", [1e-16, 1e-12, 1e-9])
def test_darendeli_at_vanishing_strain(strain):
    # the formula as printed takes the difference of two numbers that agree to all digits there:
    # at 1e-12 it gives a negative damping; D - D_min is c1 b (100/pi) (2/3) times the strain over
    # the reference strain, 0.0352 %
    damping = 100 * darendeli(0.0, 101325.0, strain=[strain, 1e-3]).damping[0]
    c1 = -1.1143 * 0.919**2 + 1.8618 * 0.919 + 0.2523
    slope = c1 * (0.6329 - 0.00566 * np.log(10)) * 100 / np.pi * 2 / 3
    assert damping == pytest.approx(0.8005 + slope * strain / 0.000352, rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"plasticity_index": -1.0}, "plasticity_index"),
        ({"mean_stress": 0.0}, "mean_stress"),
        ({"mean_stress": -1e3}, "mean_stress"),
        ({"mean_stress": np.nan}, "mean_stress"),
        ({"ocr": 0.5}, "ocr"),
        ({"frequency": 0.03}, "frequency"),
        ({"cycles": 0.0}, "cycles"),
        ({"strain": [1e-3, 1e-4]}, "strain"),
        ({"strain": [0.0, 1e-4]}, "strain"),
    ],
)
def test_darendeli_invalid(arguments, name):
    with pytest.raises(ValueError, match=f"^curves.{name}: found"):
        darendeli(**{"plasticity_index": 0.0, "mean_stress": 1e5} | arguments)


def test_models_by_name():
    curve = curve_from_model("darendeli", plasticity_index=0, mean_stress=12e3, ocr=1)
    assert np.array_equal(curve.damping, darendeli(0, 12e3).damping)
    assert set(PARAMETERS) < set(CURVE_MODELS)
    assert {name for name in CURVE_MODELS if name not in PARAMETERS} == {
        *(f"seed_idriss_1970_{bound}" for bound in ("mean", "upper", "lower")),
        *("epri_1993_0_20ft", "epri_1993_20_50ft", "epri_1993_50_120ft"),
        *("epri_1993_120_250ft", "epri_1993_250_500ft", "epri_1993_500_1000ft"),
        *("idriss_1990_clay", "idriss_1990_sand", "schnabel_1973_rock"),
        *("gei_1983_0_50ft", "gei_1983_50_100ft", "gei_1983_100_250ft", "gei_1983_250_500ft"),
        *("gei_1983_below_500ft", "geomatrix_1990_0_50ft", "geomatrix_1990_50_150ft"),
        *("geomatrix_1990_150_300ft", "geomatrix_1990_below_300ft"),
        *("imperial_valley_0_300ft", "imperial_valley_below_300ft"),
        *("peninsular_range_0_50ft", "peninsular_range_50_500ft"),
    }


@pytest.mark.parametrize("name", CURVE_MODELS)
def test_every_model_is_sensible_in_the_whole_range_of_strain(name):
    curve = curve_from_model(name, **PARAMETERS.get(name, {}))
    assert type(curve) is Curve
    modulus, damping = curve.evaluate(np.logspace(-9.0, 1.0, 500))
    # tables of measured soils begin near 1 and with a few per cent of damping at most, and lose
    # most of their stiffness; rock keeps half of it and damps little
    rock = name == "schnabel_1973_rock"
    assert 0.98 <= modulus[0] <= 1.0 and modulus[-1] < (0.6 if rock else 0.4)
    assert 0.0 <= damping[0] < 0.03 and (0.04 if rock else 0.09) < damping[-1] < 0.5
    assert np.all(np.diff(modulus) <= 0.0) and np.all(modulus > 0.0)
    assert damping.min() >= 0.0 and damping.max() < 0.5  # below 0.5: Dormieux's modulus takes it


@pytest.mark.parametrize(
    ("model", "parameters", "message"),
    [
        ("hardin", {}, "^curves.model: found 'hardin'; expected one of darendeli, menq, ishib"),
        ("hardin_drnevic", {}, "peninsular_range_50_500ft; did you mean 'hardin_drnevich'"),
        ("darendeli", {"plasticity_index": 0}, "^curves: found no mean_stress"),
        ("darendeli", {}, "found no plasticity_index, mean_stress for the model 'darendeli'"),
        (
            "darendeli",
            {"plasticity_index": 0, "mean_stress": 1e4, "stress": 1},
            "found unknown stress .* expected plasticity_index, mean_stress, ocr, frequency, cyc",
        ),
        ("seed_idriss_1970_mean", {"plasticity_index": 0}, "unknown plasticity_index .* no param"),
        ("vucetic_dobry_1991", {"plasticity_index": "high"}, "plasticity_index: found 'high'"),
        ("vucetic_dobry_1991", {"plasticity_index": True}, "plasticity_index: found True"),
        ("vucetic_dobry_1991", {"plasticity_index": [1.0]}, "plasticity_index: found"),
    ],
)
def test_models_invalid(model, parameters, message):
    with pytest.raises(ValueError, match=message):
        curve_from_model(model, **parameters)
