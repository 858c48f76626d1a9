# SPDX-License-Identifier: MIT
"""Published tables by depth, by plasticity, and those of SHAKE91."""

from itertools import pairwise

import numpy as np
import pytest

from fenics_hytf.soil import curve_from_model, epri_1993_pi, seed_idriss_1970

# Readings of the site-response program Strata as its author's library pystrata 0.5.4 has them:
# G/Gmax at strains of 1e-4, 1e-3 and 1e-2, sum over the whole table; the same of the damping. The
# modulus of GeoMatrix at 50 to 150 ft sums to 6.732 there, for the reading told in the module.
STRATA = {
    "epri_1993_0_20ft": ([0.759, 0.278, 0.043], 10.727, [0.05066, 0.15443, 0.27217], 1.57819),
    "epri_1993_20_50ft": ([0.83, 0.366, 0.066], 11.465, [0.03622, 0.125, 0.24699], 1.32002),
    "epri_1993_50_120ft": ([0.878, 0.444, 0.092], 12.056, [0.0283, 0.10381, 0.2258], 1.12913),
    "epri_1993_120_250ft": ([0.909, 0.507, 0.118], 12.517, [0.02198, 0.08686, 0.20906], 0.98382),
    "epri_1993_250_500ft": ([0.934, 0.575, 0.148], 12.993, [0.01774, 0.07206, 0.19072], 0.85258),
    "epri_1993_500_1000ft": ([0.96, 0.66, 0.2], 13.566, [0.01234, 0.05408, 0.16459], 0.67999),
    "gei_1983_0_50ft": ([0.78, 0.33, 0.065], 5.855, [0.0385, 0.131, 0.23], 1.247),
    "gei_1983_50_100ft": ([0.816, 0.36, 0.065], 6.011, [0.0315, 0.1175, 0.225], 1.1895),
    "gei_1983_100_250ft": ([0.852, 0.425, 0.065], 6.209, [0.025, 0.1, 0.22], 1.128),
    "gei_1983_250_500ft": ([0.89, 0.495, 0.08], 6.46, [0.021, 0.0825, 0.205], 1.0385),
    "gei_1983_below_500ft": ([0.925, 0.565, 0.1], 6.73, [0.0175, 0.0625, 0.19], 0.947),
    "geomatrix_1990_0_50ft": ([0.854, 0.454, 0.1], 6.378, [0.0373, 0.1123, 0.2109], 1.1601),
    "geomatrix_1990_50_150ft": ([0.9, 0.536, 0.134], 6.731, [0.0295, 0.0857, 0.1859], 1.026),
    "geomatrix_1990_150_300ft": ([0.939, 0.62, 0.162], 7.031, [0.0225, 0.0619, 0.1566], 0.9201),
    "geomatrix_1990_below_300ft": ([0.939, 0.62, 0.162], 7.031, [0.0107, 0.0415, 0.1208], 0.6634),
    "imperial_valley_0_300ft": ([0.973, 0.699, 0.247], 7.282, [0.0122, 0.0406, 0.1204], 0.3113),
    "imperial_valley_below_300ft": ([0.986, 0.767, 0.329], 7.575, [0.0054, 0.0271, 0.0987], 0.2218),
    "peninsular_range_0_50ft": ([0.868, 0.427, 0.088], 6.244, [0.0288, 0.1059, 0.23], 0.6371),
    "peninsular_range_50_500ft": ([0.941, 0.647, 0.191], 7.014, [0.0121, 0.0545, 0.1665], 0.3919),
}
EPRI_PI = {
    10: ([0.746, 0.244, 0.032], 10.472, [0.03981, 0.13339, 0.19936], 1.28882),
    30: ([0.872, 0.409, 0.074], 11.832, [0.03095, 0.10295, 0.18956], 1.11157),
    50: ([0.951, 0.585, 0.153], 13.103, [0.02773, 0.07759, 0.17429], 0.96401),
    70: ([0.996, 0.785, 0.299], 14.485, [0.02662, 0.05279, 0.13704], 0.79163),
}


def require(curve, pinned):
    modulus, modulus_sum, damping, damping_sum = pinned
    strain = np.array([1e-4, 1e-3, 1e-2])
    at = np.searchsorted(curve.strain, strain)
    assert np.array_equal(curve.strain[at], strain)
    assert curve.modulus[at].tolist() == modulus and curve.damping[at].tolist() == damping
    assert curve.modulus.sum() == pytest.approx(modulus_sum, rel=1e-12)  # round-off of a sum
    assert curve.damping.sum() == pytest.approx(damping_sum, rel=1e-12)


@pytest.mark.parametrize("name", STRATA)
def test_tables_by_depth_against_strata(name):
    curve = curve_from_model(name)
    require(curve, STRATA[name])
    steps = np.diff(np.log10(curve.strain))  # quarters or halves of a decade, to 4 digits
    assert steps == pytest.approx(0.25 if name.startswith("epri") else 0.5, abs=2e-4)


@pytest.mark.parametrize("plasticity_index", EPRI_PI)
def test_epri_by_plasticity_against_strata(plasticity_index):
    require(epri_1993_pi(plasticity_index), EPRI_PI[plasticity_index])


def test_epri_interpolates_in_the_plasticity_index():
    below, above, between = epri_1993_pi(30.0), epri_1993_pi(50.0), epri_1993_pi(35.0)
    assert between.modulus == pytest.approx(0.75 * below.modulus + 0.25 * above.modulus, rel=1e-14)
    assert between.damping == pytest.approx(0.75 * below.damping + 0.25 * above.damping, rel=1e-14)


@pytest.mark.parametrize("plasticity_index", [9.9, 70.1, np.nan])
def test_epri_invalid(plasticity_index):
    with pytest.raises(ValueError, match=r"plasticity_index: found .* expected 10 to 70"):
        epri_1993_pi(plasticity_index)


@pytest.mark.parametrize(
    "family", ["epri_1993_", "gei_1983_", "geomatrix_1990_", "imperial_valley_", "peninsular_"]
)
def test_deeper_soils_stay_linear_longer(family):
    curves = [curve_from_model(name) for name in STRATA if name.startswith(family)]
    for shallow, deep in pairwise(curves):
        assert np.all(deep.modulus >= shallow.modulus)
        assert np.all(deep.damping <= shallow.damping)


# Idriss (1990) as Strata has it, read off at other strains than SHAKE91 lists
IDRISS_STRAIN = [3.162e-6, 3.162e-5, 3.162e-4, 3.162e-3]
IDRISS_STRATA = {
    "clay": ([1.0, 0.979, 0.839, 0.429], [0.0044, 0.0146, 0.0531, 0.1574]),
    "sand": ([1.0, 0.955, 0.628, 0.176], [0.0044, 0.0146, 0.0531, 0.1574]),
}


@pytest.mark.parametrize("soil", IDRISS_STRATA)
def test_idriss_against_strata(soil):
    modulus, damping = curve_from_model(f"idriss_1990_{soil}").evaluate(IDRISS_STRAIN)
    # last digits of both
    assert modulus == pytest.approx(IDRISS_STRATA[soil][0], abs=1e-3)
    assert damping == pytest.approx(IDRISS_STRATA[soil][1], abs=1e-4)


def test_idriss_sand_is_close_to_the_upper_bound_of_seed_and_idriss():
    upper = seed_idriss_1970("upper")
    modulus, damping = curve_from_model("idriss_1990_sand").evaluate(upper.strain)
    assert modulus == pytest.approx(upper.modulus, abs=0.025)  # the width of a printed line
    assert damping == pytest.approx(upper.damping, abs=0.007)


# sublayers of the sample problem in the manual of SHAKE91 (Idriss and Sun, 1992, table B-2):
# effective strain [%], G/Gmax, damping, from the last iteration, each as printed
SHAKE91_SAMPLE = {
    "idriss_1990_sand": [
        (0.00077, 0.992, 0.007),
        (0.00295, 0.960, 0.014),
        (0.00634, 0.892, 0.023),
        (0.00976, 0.852, 0.028),
        (0.01356, 0.792, 0.034),
        (0.01233, 0.810, 0.032),
        (0.00865, 0.863, 0.026),
    ],
    "idriss_1990_clay": [
        (0.01099, 0.933, 0.030),
        (0.01403, 0.912, 0.035),
        (0.01362, 0.915, 0.034),
        (0.01566, 0.903, 0.037),
    ],
}


@pytest.mark.parametrize("name", SHAKE91_SAMPLE)
def test_against_the_sample_problem_of_shake91(name):
    strain, modulus, damping = np.array(SHAKE91_SAMPLE[name]).T
    found = curve_from_model(name).evaluate(strain / 100)
    # three digits printed, of the strain too
    assert found[0] == pytest.approx(modulus, abs=1.2e-3)
    assert found[1] == pytest.approx(damping, abs=6e-4)


def test_shake91_at_large_strain_and_rock():
    clay, sand = (curve_from_model(f"idriss_1990_{soil}") for soil in ("clay", "sand"))
    strain = [1e-2, 3e-2, 3.16e-2, 1e-1]
    assert clay.evaluate(strain)[0][[0, 1, 3]] == pytest.approx([0.238, 0.144, 0.110], rel=1e-12)
    assert clay.evaluate(strain)[1][[0, 2, 3]] == pytest.approx([0.21, 0.25, 0.28], rel=1e-12)
    assert sand.evaluate(strain)[0][[0, 1, 3]] == pytest.approx([0.08, 0.05, 0.035], rel=1e-12)
    rock = curve_from_model("schnabel_1973_rock")
    strain = [1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 1e-2]
    modulus, damping = rock.evaluate(strain)
    assert modulus == pytest.approx([1.0, 0.9875, 0.9, 0.81, 0.725, 0.55], rel=1e-12)
    # between its points, 1.5 % at 1e-4 and 3 % at 1e-3, linear in ln gamma
    third = 0.015 + 0.015 * np.log10(3)
    assert damping == pytest.approx([0.004, 0.008, 0.015, third, 0.03, 0.046], rel=1e-12)
