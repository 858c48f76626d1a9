# SPDX-License-Identifier: MIT
"""Ishibashi and Zhang (1993) against the library groundhog and an evaluation written out apart."""

import numpy as np
import pytest

from fenics_hytf.soil import ishibashi_zhang

STRAIN = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2]

# the formulas evaluated apart, to 6 digits, before G/Gmax is cut at 1; (PI [%], stress [kPa])
WRITTEN_OUT = {
    (0, 100): (
        [1.005363, 0.999856, 0.837907, 0.44691, 0.106078],
        [0.012987, 0.013005, 0.038355, 0.141749, 0.28055],
    ),
    (10, 50): (
        [1.004307, 1.007163, 0.896876, 0.430353, 0.083473],
        [0.011356, 0.011356, 0.02443, 0.128923, 0.254761],
    ),
    (30, 200): (
        [1.003838, 1.017909, 1.034252, 0.692114, 0.145764],
        [0.008436, 0.008436, 0.008436, 0.045426, 0.170226],
    ),
    (100, 100): (
        [0.999805, 0.997952, 0.979357, 0.824503, 0.324068],
        [0.006526, 0.006642, 0.007848, 0.02052, 0.093565],
    ),
}


@pytest.mark.parametrize(("plasticity_index", "stress"), WRITTEN_OUT)
def test_against_an_evaluation_apart(plasticity_index, stress):
    modulus, damping = WRITTEN_OUT[plasticity_index, stress]
    curve = ishibashi_zhang(plasticity_index, 1e3 * stress, strain=STRAIN)
    assert curve.modulus == pytest.approx(np.minimum(modulus, 1.0), abs=6e-7)
    assert curve.damping == pytest.approx(np.array(damping), abs=6e-7)


@pytest.mark.parametrize(
    ("plasticity_index", "stress", "modulus", "damping"),
    [(0, 100e3, 0.84, 3.84), (100, 100e3, 0.98, 0.78), (0, 400e3, 0.98, 1.61)],
)
def test_against_groundhog(plasticity_index, stress, modulus, damping):
    # what groundhog's own tests have at 0.01 %, to two digits
    curve = ishibashi_zhang(plasticity_index, stress, strain=[1e-4, 1e-3])
    assert curve.modulus[0] == pytest.approx(modulus, abs=0.005)
    assert 100 * curve.damping[0] == pytest.approx(damping, abs=0.005)


@pytest.mark.parametrize("stress", [1e2, 1e4, 1e5, 1e6, 1e7])
@pytest.mark.parametrize("plasticity_index", [0.0, 5.0, 15.0, 15.1, 40.0, 70.0, 70.1, 200.0])
def test_in_the_whole_range(plasticity_index, stress):
    curve = ishibashi_zhang(plasticity_index, stress, strain=np.logspace(-9, 0, 300))
    assert curve.modulus.max() <= 1.0
    assert np.all(np.diff(curve.modulus) <= 0.0)
    assert np.all(np.diff(curve.damping) >= 0.0)
    assert 0.0 < curve.damping[0] < 0.014 and curve.damping[-1] < 0.334


@pytest.mark.parametrize("plasticity_index", [15.0, 70.0])
def test_pieces_of_the_plasticity_meet(plasticity_index):
    below = ishibashi_zhang(plasticity_index, 1e5)
    above = ishibashi_zhang(plasticity_index * (1 + 1e-9), 1e5)
    assert below.modulus == pytest.approx(above.modulus, abs=0.007)  # as well as published


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"plasticity_index": -1.0}, "plasticity_index"),
        ({"plasticity_index": np.inf}, "plasticity_index"),
        ({"mean_stress": 0.0}, "mean_stress"),
        ({"strain": [-1e-3, 1e-3]}, "strain"),
    ],
)
def test_invalid(arguments, name):
    with pytest.raises(ValueError, match=f"^curves.{name}: found"):
        ishibashi_zhang(**{"plasticity_index": 0.0, "mean_stress": 1e5} | arguments)
