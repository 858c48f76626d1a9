# SPDX-License-Identifier: MIT
"""The digitised curves against other readings of the same figures.

Vucetic and Dobry (1991): read off independently by A. Ghofrani (2018), here interpolated to the
strains of the table and rounded to 3 digits. Seed and Idriss (1970): read off by F. Gatti (2015)
and by the makers of DynaEngine, likewise.
"""

from itertools import pairwise

import numpy as np
import pytest

from fenics_hytf.soil import Curve, curve_from_model, seed_idriss_1970, vucetic_dobry_1991

STRAIN = np.array([1e-6, 3.16e-6, 1e-5, 3.16e-5, 1e-4, 3.16e-4, 1e-3, 3.16e-3, 1e-2])

GHOFRANI = {
    0: (
        [1.000, 0.997, 0.966, 0.882, 0.720, 0.488, 0.265, 0.111, 0.037],
        [1.680, 1.778, 2.081, 3.045, 5.417, 9.831, 15.134, 20.000, 23.779],
    ),
    15: (
        [1.000, 1.000, 0.994, 0.940, 0.822, 0.653, 0.423, 0.225, 0.099],
        [1.498, 1.574, 1.811, 2.564, 4.525, 7.605, 11.447, 15.670, 19.706],
    ),
    30: (
        [1.000, 1.000, 1.000, 0.983, 0.909, 0.767, 0.553, 0.350, 0.173],
        [0.809, 0.919, 1.265, 2.217, 3.737, 5.921, 8.504, 12.211, 16.624],
    ),
    50: (
        [1.000, 1.000, 1.000, 0.996, 0.959, 0.860, 0.687, 0.480, 0.259],
        [1.081, 1.144, 1.341, 1.937, 2.999, 4.235, 6.131, 9.165, 13.294],
    ),
    100: (
        [1.000, 1.000, 1.000, 1.000, 0.990, 0.937, 0.825, 0.633, 0.378],
        [1.351, 1.371, 1.436, 1.637, 2.141, 2.886, 3.992, 6.133, 9.559],
    ),
    200: (
        [1.000, 1.000, 1.000, 1.000, 0.997, 0.972, 0.904, 0.749, 0.484],
        [1.141, 1.141, 1.141, 1.241, 1.701, 2.133, 2.986, 4.671, 7.992],
    ),
}

GATTI = {
    "upper": (
        [1.000, 0.999, 0.993, 0.948, 0.838, 0.635, 0.382, 0.204, 0.096],
        [0.240, 0.361, 0.712, 1.396, 2.742, 5.210, 9.727, 15.815, 20.973],
    ),
    "lower": (
        [1.000, 0.975, 0.923, 0.824, 0.639, 0.419, 0.232, 0.111, 0.058],
        [0.656, 1.198, 2.688, 5.720, 9.969, 15.224, 21.051, 25.874, 27.916],
    ),
}

DYNAENGINE = {
    "upper": (
        [1.000, 0.998, 0.986, 0.943, 0.838, 0.631, 0.360, 0.179, 0.081],
        [0.245, 0.372, 0.718, 1.389, 2.684, 5.179, 9.597, 15.350, 20.848],
    ),
    "lower": (
        [0.998, 0.976, 0.922, 0.811, 0.629, 0.413, 0.220, 0.105, 0.038],
        [0.691, 1.215, 2.672, 5.661, 9.745, 14.971, 20.661, 25.324, 27.553],
    ),
}


@pytest.mark.parametrize("plasticity_index", GHOFRANI)
def test_vucetic_dobry_against_another_reading(plasticity_index):
    modulus, damping = map(np.array, GHOFRANI[plasticity_index])
    ours = vucetic_dobry_1991(plasticity_index)
    assert np.array_equal(ours.strain, STRAIN)
    # two readings of a printed line agree to its width, 0.025; at the end of the line for
    # PI = 200 they part by 0.05
    assert ours.modulus == pytest.approx(modulus, abs=0.05 if plasticity_index == 200 else 0.025)
    # damping to 0.4 percentage points; below 3e-5, where the figure's lines run together and end,
    # to 1.1
    assert ours.damping[3:] == pytest.approx(damping[3:] / 100, abs=0.004)
    assert ours.damping[:3] == pytest.approx(damping[:3] / 100, abs=0.011)


@pytest.mark.parametrize("reading", [GATTI, DYNAENGINE])
@pytest.mark.parametrize("bound", ["upper", "lower"])
def test_seed_idriss_bounds_against_other_readings(reading, bound):
    modulus, damping = map(np.array, reading[bound])
    ours = seed_idriss_1970(bound)
    assert np.array_equal(ours.strain, STRAIN)
    assert ours.modulus == pytest.approx(modulus, abs=0.025)  # the width of a printed line
    assert ours.damping == pytest.approx(damping / 100, abs=0.007)


def test_seed_idriss_upper_is_what_shake91_comes_with():
    # sample input of SHAKE91 (Idriss and Sun, 1992): modulus of sand, upper range, and damping of
    # Idriss (1990), which is the lower range; its strains lie within 6 % of the table's
    modulus = [1.0, 1.0, 0.99, 0.96, 0.85, 0.64, 0.37, 0.18, 0.08]
    damping = [0.24, 0.42, 0.80, 1.40, 2.80, 5.10, 9.80, 15.50, 21.0]
    strain = [1e-6, 3e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2]
    ours = seed_idriss_1970("upper").evaluate(strain)
    assert ours[0] == pytest.approx(modulus, abs=0.03)
    assert ours[1] == pytest.approx(np.array(damping) / 100, abs=0.006)


def test_seed_idriss_mean_lies_in_the_middle_of_the_bounds():
    mean, upper, lower = (seed_idriss_1970(bound) for bound in ("mean", "upper", "lower"))
    # of two lines that were read off apart, to the width of a printed line and a percentage point
    assert mean.modulus == pytest.approx(0.5 * (upper.modulus + lower.modulus), abs=0.025)
    assert mean.damping == pytest.approx(0.5 * (upper.damping + lower.damping), abs=0.01)


def test_upper_is_the_stiffer_and_the_less_damped():
    mean, upper, lower = (seed_idriss_1970(bound) for bound in ("mean", "upper", "lower"))
    assert np.all(upper.modulus >= mean.modulus)
    assert np.all(mean.modulus >= lower.modulus)
    assert np.all(upper.damping <= mean.damping)
    assert np.all(mean.damping <= lower.damping)


@pytest.mark.parametrize("bound", ["mean", "upper", "lower"])
def test_seed_idriss_as_a_model(bound):
    curve = curve_from_model(f"seed_idriss_1970_{bound}")
    assert np.array_equal(curve.modulus, seed_idriss_1970(bound).modulus)
    assert np.array_equal(curve.damping, seed_idriss_1970(bound).damping)


def test_seed_idriss_default_and_unknown_bound():
    assert np.array_equal(seed_idriss_1970().modulus, seed_idriss_1970("mean").modulus)
    with pytest.raises(ValueError, match="found 'average'; expected one of mean, upper, lower"):
        seed_idriss_1970("average")


def test_vucetic_dobry_interpolates_in_the_plasticity_index():
    below, above = vucetic_dobry_1991(30.0), vucetic_dobry_1991(50.0)
    between = vucetic_dobry_1991(35.0)
    assert between.modulus == pytest.approx(0.75 * below.modulus + 0.25 * above.modulus, rel=1e-14)
    assert between.damping == pytest.approx(0.75 * below.damping + 0.25 * above.damping, rel=1e-14)


def test_vucetic_dobry_plastic_soils_stay_linear_longer():
    curves: list[Curve] = [vucetic_dobry_1991(pi) for pi in np.linspace(0.0, 200.0, 41)]
    for low, high in pairwise(curves):
        assert np.all(high.modulus >= low.modulus)
        assert np.all(high.damping <= low.damping)


@pytest.mark.parametrize("plasticity_index", [-1.0, 200.1, np.nan])
def test_vucetic_dobry_invalid(plasticity_index):
    with pytest.raises(ValueError, match=r"plasticity_index: found .* expected 0 to 200"):
        vucetic_dobry_1991(plasticity_index)
