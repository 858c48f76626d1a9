# SPDX-License-Identifier: MIT
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fenics_hytf.soil import Elastic

EPS = np.finfo(float).eps


def test_textbook_values():
    # steel-like: E = 200 GPa, nu = 0.25 gives G = 80, lambda = 80, kappa = 400/3 GPa
    steel = Elastic.from_constants(density=7800.0, poisson=0.25, youngs_modulus=200e9)
    assert steel.shear_modulus == pytest.approx(80e9, rel=4 * EPS)
    assert steel.lame_lambda == pytest.approx(80e9, rel=4 * EPS)
    assert steel.bulk_modulus == pytest.approx(400e9 / 3, rel=4 * EPS)
    assert steel.shear_wave_velocity == pytest.approx(3202.563, rel=1e-6)  # 7 digits
    assert steel.p_wave_velocity == pytest.approx(3202.563 * np.sqrt(3.0), rel=1e-6)


@given(
    st.floats(1.0, 1e4), st.floats(-0.95, 0.499), st.floats(1e3, 1e12)
)  # cancellation in 1 - 2 nu and 1 + nu costs a factor of 500 at the ends
def test_the_three_ways_agree_and_relations_hold(density, poisson, shear_modulus):
    direct = Elastic(density, shear_modulus, poisson)
    for name in ("shear_modulus", "youngs_modulus", "shear_wave_velocity"):
        other = Elastic.from_constants(
            density=density, poisson=poisson, **{name: getattr(direct, name)}
        )
        assert other.shear_modulus == pytest.approx(shear_modulus, rel=10 * EPS)
    mu, lam = direct.shear_modulus, direct.lame_lambda
    scale = 1000 * EPS
    assert direct.youngs_modulus == pytest.approx(mu * (3 * lam + 2 * mu) / (lam + mu), rel=scale)
    assert direct.bulk_modulus == pytest.approx(lam + 2 * mu / 3, rel=scale, abs=scale * mu)
    assert direct.p_wave_velocity**2 * density == pytest.approx(lam + 2 * mu, rel=scale)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"density": 0.0}, "^density: found 0.0; expected a positive number in kg/m"),
        ({"density": -1800.0}, "^density: found -1800.0"),
        ({"density": np.nan}, "^density: found nan"),
        ({"poisson": 0.5}, "^poisson: found 0.5; expected -1 < poisson < 0.5"),
        ({"poisson": 0.6}, "^poisson: found 0.6"),
        ({"poisson": -1.0}, "^poisson: found -1.0"),
        ({"poisson": np.nan}, "^poisson: found nan"),
        ({"shear_modulus": 0.0}, "^shear_modulus: found 0.0; expected a positive number in Pa"),
        ({"shear_modulus": np.inf}, "^shear_modulus: found inf"),
        ({"shear_modulus": None}, "^stiffness: found none; expected exactly one of"),
        ({"shear_modulus": None, "youngs_modulus": -1.0}, "^youngs_modulus: found -1.0"),
        (
            {"shear_modulus": None, "shear_wave_velocity": 0.0},
            "^shear_wave_velocity: found 0.0; expected a positive number in m/s",
        ),
        (
            {"shear_wave_velocity": 200.0},
            "^stiffness: found shear_modulus and shear_wave_velocity; expected exactly one",
        ),
    ],
)
def test_invalid(changes, message):
    constants = {"density": 1800.0, "poisson": 0.3, "shear_modulus": 1e8} | changes
    with pytest.raises(ValueError, match=message):
        Elastic.from_constants(**constants)


def test_invalid_without_the_constructor():
    with pytest.raises(ValueError, match=r"^poisson"):
        Elastic(1800.0, 1e8, 0.5)
