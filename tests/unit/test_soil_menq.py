# SPDX-License-Identifier: MIT
"""Menq (2003) against the program pystrata 0.5.4, printed to 8 digits."""

import numpy as np
import pytest

from fenics_hytf.soil import menq

STRAIN = [1e-6, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2]

# (C_u, d50 [mm], mean stress [Pa], cycles): G/Gmax and damping at STRAIN
PYSTRATA = {
    (10.0, 5.0, 101.3e3, 10.0): (
        [
            *(0.99267562, 0.94926141, 0.72087356, 0.50100102),
            *(0.26281285, 0.1217251, 0.04690465, 0.01877284),
        ],
        [
            *(0.00472029, 0.00863629, 0.03941991, 0.07869378),
            *(0.12934769, 0.16420165, 0.1831974, 0.18478747),
        ],
    ),
    (1.5, 0.3, 50e3, 1.0): (
        [
            *(0.99551546, 0.97048887, 0.82969118, 0.66202539),
            *(0.41917719, 0.22491345, 0.09658626, 0.04121553),
        ],
        [
            *(0.00890177, 0.01071776, 0.02677047, 0.05287381),
            *(0.09894857, 0.14012898, 0.17039218, 0.18267718),
        ],
    ),
    (40.0, 20.0, 400e3, 30.0): (
        [
            *(0.99221618, 0.93879441, 0.64858418, 0.40191314),
            *(0.18172339, 0.07481078, 0.02602695, 0.00963594),
        ],
        [
            *(0.0035818, 0.00947836, 0.05265003, 0.10153396),
            *(0.15787794, 0.19131224, 0.20324878, 0.20324878),
        ],
    ),
}


@pytest.mark.parametrize("parameters", PYSTRATA)
def test_menq_against_pystrata(parameters):
    modulus, damping = PYSTRATA[parameters]
    curve = menq(*parameters, strain=STRAIN)
    assert curve.modulus == pytest.approx(np.array(modulus), abs=6e-9)  # half of the last digit
    assert curve.damping == pytest.approx(np.array(damping), abs=6e-9)


def test_menq_at_the_reference_strain():
    # of one atmosphere and C_u = 1 it is 0.12 %, where G is half; the damping begins at 0.55 % for
    # grains of 1 mm
    curve = menq(1.0, 1.0, 101325.0, strain=[1e-12, 0.0012])
    assert curve.modulus[1] == pytest.approx(0.5, rel=1e-12)
    assert curve.damping[0] == pytest.approx(0.0055, rel=1e-6)


def test_menq_trends():
    base = menq(10.0, 5.0, 100e3)
    assert np.all(menq(40.0, 5.0, 100e3).modulus < base.modulus)  # wider grading: less linear
    assert np.all(menq(10.0, 5.0, 400e3).modulus[:-3] > base.modulus[:-3])
    assert menq(10.0, 20.0, 100e3).damping[0] < base.damping[0]
    assert np.array_equal(menq(10.0, 20.0, 100e3).modulus, base.modulus)
    assert np.all(menq(10.0, 5.0, 100e3, cycles=100.0).damping[5:] < base.damping[5:])


@pytest.mark.parametrize("stress", [100.0, 1e3, 1e5, 1e7, 1e8])
@pytest.mark.parametrize("cu", [1.0, 5.0, 100.0])
def test_menq_damping_never_falls(stress, cu):
    curve = menq(cu, 1.0, stress, strain=np.logspace(-9, 0, 200))
    assert curve.damping[0] > 0.0
    assert np.all(np.diff(curve.damping) >= 0.0)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"uniformity_coefficient": 0.9}, "uniformity_coefficient"),
        ({"d50": 0.005}, "d50"),  # 5 mm written in metres
        ({"d50": np.inf}, "d50"),
        ({"mean_stress": 99.0}, "mean_stress"),
        ({"mean_stress": np.nan}, "mean_stress"),
        ({"cycles": 0.0}, "cycles"),
        ({"strain": [0.0, 1e-4]}, "strain"),
    ],
)
def test_menq_invalid(arguments, name):
    given = {"uniformity_coefficient": 10.0, "d50": 5.0, "mean_stress": 1e5} | arguments
    with pytest.raises(ValueError, match=f"^curves.{name}: found"):
        menq(**given)
