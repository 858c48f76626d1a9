# SPDX-License-Identifier: MIT
"""Hyperbolic backbones: their points, and damping against loops by Masing's rules."""

import numpy as np
import pytest
from scipy.integrate import quad

from fenics_hytf.soil import hardin_drnevich, mkz
from fenics_hytf.soil.masing import masing_damping


def loop_damping(strain, reference_strain, curvature, beta):
    """Area of Masing's loop, 8 (work to the tip - triangle), over 4 pi times the triangle."""

    def stress(g):
        return g / (1 + beta * (g / reference_strain) ** curvature)

    triangle = 0.5 * stress(strain) * strain
    work = quad(stress, 0.0, strain, epsabs=0.0, epsrel=1e-12, limit=200)[0]
    return 8 * (work - triangle) / (4 * np.pi * triangle)


@pytest.mark.parametrize("curvature", [0.3, 0.7, 0.919, 1.0, 1.1])
@pytest.mark.parametrize("beta", [0.5, 1.0, 1.4])
def test_mkz_damping_is_that_of_masing_loops(curvature, beta):
    strain = np.logspace(-5, -1, 9)
    curve = mkz(4e-4, curvature=curvature, beta=beta, strain=strain)
    loops = [loop_damping(g, 4e-4, curvature, beta) for g in strain]
    assert curve.damping == pytest.approx(np.array(loops), rel=1e-8)  # of the area by quadrature
    assert curve.modulus == pytest.approx(1 / (1 + beta * (strain / 4e-4) ** curvature), rel=1e-14)


def test_masing_damping_of_the_hyperbola_is_closed():
    k = np.array([0.1, 1.0, 10.0, 1e3])
    closed = (4 * (k - np.log1p(k)) * (1 + k) / k**2 - 2) / np.pi
    assert masing_damping(k) == pytest.approx(closed, rel=1e-12)
    assert masing_damping([0.0])[0] == 0.0
    assert masing_damping([1e-10])[0] == pytest.approx(2e-10 / (3 * np.pi), rel=1e-9)
    assert masing_damping([1e12])[0] == pytest.approx(2 / np.pi, rel=1e-5)


def test_mkz_small_strain_damping_and_reduction():
    plain = mkz(4e-4, 0.9)
    assert mkz(4e-4, 0.9, small_strain_damping=0.02).damping == pytest.approx(plain.damping + 0.02)
    reduced = mkz(4e-4, 0.9, p1=0.8, p2=0.5, p3=2.0)
    factor = 0.8 - 0.5 * (1 - plain.modulus) ** 2  # Phillips and Hashash (2009)
    assert reduced.damping == pytest.approx(factor * plain.damping, rel=1e-14)
    assert np.array_equal(reduced.modulus, plain.modulus)


def test_mkz_at_its_extremes():
    for curve in (
        mkz(1e-12, 1.1, small_strain_damping=0.2, strain=np.logspace(-9, 0, 50)),
        mkz(0.99, 0.01, beta=1e-9, strain=np.logspace(-9, 0, 50)),
    ):
        assert np.all(curve.damping >= 0.0) and np.all(curve.damping < 1.0)
        assert np.all(np.diff(curve.modulus) <= 0.0)


def test_hardin_drnevich():
    curve = hardin_drnevich(5e-4, 0.3, 0.02, strain=[5e-12, 5e-4, 1.5e-3, 500.0])
    assert curve.modulus == pytest.approx([1.0, 0.5, 0.25, 0.0], abs=2e-6)
    assert curve.damping == pytest.approx([0.02, 0.16, 0.23, 0.3], abs=2e-6)
    # as published, D = D_max (1 - G/Gmax)
    published = hardin_drnevich(5e-4, 0.3)
    assert published.damping == pytest.approx(0.3 * (1 - published.modulus), rel=1e-14)


@pytest.mark.parametrize(
    ("model", "arguments", "name"),
    [
        (mkz, {"reference_strain": 0.0}, "reference_strain"),
        (mkz, {"reference_strain": 1.0}, "reference_strain"),
        (mkz, {"curvature": 0.0}, "curvature"),
        (mkz, {"curvature": 1.2}, "curvature"),
        (mkz, {"beta": 0.0}, "beta"),
        (mkz, {"small_strain_damping": -0.01}, "small_strain_damping"),
        (mkz, {"small_strain_damping": 0.8}, "small_strain_damping"),
        (mkz, {"p1": 1.1}, "p1"),
        (mkz, {"p1": 0.5, "p2": 0.6}, "p2"),
        (mkz, {"p3": 0.0}, "p3"),
        (mkz, {"strain": [0.0, 1.0]}, "strain"),
        (hardin_drnevich, {"reference_strain": np.nan}, "reference_strain"),
        (hardin_drnevich, {"max_damping": 25.0}, "max_damping"),
        (hardin_drnevich, {"max_damping": 0.0}, "max_damping"),
        (hardin_drnevich, {"small_strain_damping": 0.4}, "small_strain_damping"),
    ],
)
def test_invalid(model, arguments, name):
    given = {"reference_strain": 5e-4, **({} if model is mkz else {"max_damping": 0.3})}
    with pytest.raises(ValueError, match=f"^curves.{name}: found"):
        model(**given | arguments)
