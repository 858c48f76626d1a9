# SPDX-License-Identifier: MIT
"""Curves limited by the shear strength: hyperbola of Yee, Stewart and Tokimatsu (2013)."""

import numpy as np
import pytest

from fenics_hytf.soil import (
    CURVE_MODELS,
    Curve,
    LimitedCurve,
    curve_from_model,
    darendeli,
    limit_strength,
    mkz,
    seed_idriss_1970,
    vucetic_dobry_1991,
)

G = 60e6  # G_max [Pa]
STRAIN = np.logspace(-8, 1, 4000)

CURVES = {
    "darendeli": darendeli(15.0, 50e3),
    "mkz": mkz(5e-4, 0.9, small_strain_damping=0.01),
    "sand": seed_idriss_1970(),
    "softens": vucetic_dobry_1991(0.0),  # its stress falls beyond 0.3 %
    "two points": Curve([1e-5, 1e-2], [1.0, 0.1], [0.01, 0.2]),
    **{name: curve_from_model(name) for name in CURVE_MODELS if name.startswith("epri_1993_1")},
}


def stress(curve, strain=STRAIN):
    return G * strain * curve.evaluate(strain)[0]


@pytest.mark.parametrize("strength", [2e3, 10e3, 40e3, 300e3, 5e6])
@pytest.mark.parametrize("name", CURVES)
def test_stress_grows_towards_the_strength(name, strength):
    curve = CURVES[name]
    limited = limit_strength(curve, G, strength)
    found = stress(limited)
    assert np.all(limited.evaluate(STRAIN)[0] > 0.0)
    above = STRAIN > limited.transition_strain
    assert np.all(np.diff(found[above]) >= 0.0)
    assert found.max() <= strength
    # the hyperbola is 1 / (1 + tangent * strain / reserve) below the strength
    far = 1e6 * strength / (G * limited.tangent)
    assert stress(limited, far) == pytest.approx(strength, rel=2e-6)


@pytest.mark.parametrize("strength", [2e3, 40e3, 300e3, 5e6])
@pytest.mark.parametrize("name", CURVES)
def test_nothing_changes_where_the_stress_is_far_below_the_strength(name, strength):
    curve = CURVES[name]
    limited = limit_strength(curve, G, strength)
    below = STRAIN[STRAIN <= limited.transition_strain]
    assert below.size
    assert limited.evaluate(below)[0] == pytest.approx(curve.evaluate(below)[0], rel=1e-12)
    # the transition is where 0.3 of the strength is mobilised, for the first time
    begin = limited.transition_strain
    assert stress(curve, begin) == pytest.approx(0.3 * strength, rel=1e-9)  # of the root
    assert stress(curve, below[:-1]).max(initial=0.0) <= 0.3 * strength
    # and the damping is that of the curve everywhere
    assert limited.evaluate(STRAIN)[1] == pytest.approx(curve.evaluate(STRAIN)[1], rel=1e-12)


def test_strength_out_of_reach_changes_nothing_at_all():
    curve = darendeli(15.0, 50e3)
    limited = limit_strength(curve, G, 1e12)
    strain = np.logspace(-9, 0, 100)
    assert np.array_equal(limited.evaluate(strain)[0], curve.evaluate(strain)[0])


@pytest.mark.parametrize("name", CURVES)
def test_stress_and_tangent_go_on_at_the_transition(name):
    curve = CURVES[name]
    limited = limit_strength(curve, G, 30e3)
    begin, step = limited.transition_strain, 1e-7
    at, after = (stress(limited, begin * (1 + d)) for d in (0.0, step))
    assert after == pytest.approx(at, rel=2 * step)  # no jump: tangent <= secant
    tangent = (after - at) / (G * begin * step)
    assert tangent == pytest.approx(limited.tangent, rel=1e-5)  # of the difference
    # tangents of the polygon through the table's points, on both sides of the transition
    x = np.log(curve.strain)
    chords = np.diff(curve.modulus) / np.diff(x)
    i = int(np.searchsorted(curve.strain, begin)) - 1
    around = chords[max(i - 1, 0) : i + 2]
    secant = float(curve.evaluate(begin)[0])
    assert secant + around.min() <= limited.tangent <= secant + around.max()


def test_tangent_is_that_of_the_smooth_curve():
    # of the hyperbola, 1 / (1 + x)^2; the table has ten points a decade
    limited = limit_strength(mkz(5e-4), G, 30e3)
    x = limited.transition_strain / 5e-4
    assert limited.tangent == pytest.approx(1 / (1 + x) ** 2, rel=5e-3)


def test_the_hyperbola_itself_comes_back():
    # a hyperbolic backbone with its own strength, G reference_strain, is its own limit
    curve = mkz(5e-4, strain=np.logspace(-9, 0, 2500))
    limited = limit_strength(curve, G, G * 5e-4)
    # to the error of the tangent, central differences over 1/140 of a decade
    assert limited.evaluate(STRAIN)[0] == pytest.approx(1 / (1 + STRAIN / 5e-4), rel=1e-4, abs=1e-9)


def test_worked_example():
    # Yee et al. (2013) by hand: at 0.1 % the curve has 0.5, that is tau_1 = 30 kPa, and the slope
    # -0.2 of the line through its neighbours in ln gamma, so that G_1 = 0.3 G_max; with a strength
    # of 100 kPa, gamma_ref = 70e3 / 18e6
    e = np.e
    curve = Curve([1e-3 / e, 1e-3, 1e-3 * e], [0.7, 0.5, 0.3], [0.01, 0.1, 0.2])
    limited = limit_strength(curve, G, 100e3, transition_strain=1e-3)
    assert limited.tangent == pytest.approx(0.3, rel=1e-12)
    excess = 4e-3
    expected = 30e3 + 18e6 * excess / (1 + excess / (70e3 / 18e6))
    assert stress(limited, 5e-3) == pytest.approx(expected, rel=1e-12)


def test_a_point_of_the_table_may_be_the_transition():
    curve = Curve([1e-5, 1e-4, 1e-3, 1e-2], [1.0, 0.7, 0.3, 0.05], [0.01, 0.03, 0.1, 0.2])
    for strain, modulus in zip(curve.strain[:3], curve.modulus[:3], strict=True):
        for nudge in (1 - 1e-15, 1.0, 1 + 1e-15):
            limited = limit_strength(curve, G, nudge * G * strain * modulus / 0.3)
            assert limited.transition_strain == pytest.approx(strain, rel=1e-12)
            assert np.all(np.diff(limited.modulus) <= 0.0)


def test_weak_and_strong_soil_lie_on_both_sides_of_the_curve():
    curve = darendeli(15.0, 50e3)
    strain = np.array([1e-2, 3e-2])
    own = stress(curve, strain)
    weak, strong = limit_strength(curve, G, 0.7 * own[-1]), limit_strength(curve, G, 2 * own[-1])
    assert np.all(stress(weak, strain) < own) and np.all(stress(strong, strain) > own)


@pytest.mark.parametrize("name", CURVES)
def test_the_table_samples_the_limited_curve(name):
    limited = limit_strength(CURVES[name], G, 30e3)
    assert isinstance(limited, LimitedCurve) and limited.strain[-1] >= 0.1
    modulus, damping = limited.evaluate(limited.strain)
    assert limited.modulus == pytest.approx(modulus, rel=1e-12)
    assert limited.damping == pytest.approx(damping, rel=1e-12)
    assert limited.small_strain_damping == CURVES[name].small_strain_damping
    assert limited.transition_strain in limited.strain
    assert np.isin(CURVES[name].strain, limited.strain).all()


def test_shape_is_kept_and_nan_is_passed_on():
    limited = limit_strength(darendeli(0.0, 50e3), G, 30e3)
    modulus, damping = limited.evaluate(np.array([[0.0, np.nan, 1e-2]]))
    assert modulus.shape == damping.shape == (1, 3)
    assert np.array_equal(np.isnan(modulus), [[False, True, False]])
    assert limited.evaluate(1e-2)[0].shape == ()


@pytest.mark.parametrize(
    ("strength", "transition", "message"),
    [
        # the smallest strain, 1e-6, with all of G_max mobilises 60 Pa
        (59.0, None, r"shear_strength: found 59 Pa; expected more than 60 Pa.* strain, 1e-06"),
        (60.0, None, "shear_strength: found 60 Pa"),
        (-1.0, None, "shear_strength: found -1 Pa"),
        (np.nan, None, "shear_strength: found nan Pa"),
        (np.inf, None, "shear_strength: found inf Pa"),
        (10e3, 1e-2, r"transition_strain: found 0.01, where the curve mobilises 1.8e\+04 Pa.*1000"),
        (40e3, 9e-3, r"transition_strain: found 0.009, where .* no longer grows; .* smaller"),
        (40e3, 0.0, "transition_strain: found 0; expected a positive strain"),
        (40e3, np.nan, "transition_strain: found nan"),
    ],
)
def test_invalid(strength, transition, message):
    with pytest.raises(ValueError, match=f"^curves.{message}"):
        limit_strength(vucetic_dobry_1991(0.0), G, strength, transition)
