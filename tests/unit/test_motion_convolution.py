# SPDX-License-Identifier: MIT
"""Weights of convolution quadrature against closed forms, recursions and a convolution itself."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lfilter

from fenics_hytf.motion import ConvolutionQuadrature

EPS = np.finfo(float).eps
AMPLIFIED = 1e4  # what becomes of an error at the last weight


def impulse(num: int) -> np.ndarray:
    return np.eye(1, num)[0]


def test_frequencies_lie_in_the_upper_right_quarter():
    quadrature = ConvolutionQuadrature(40, 0.02)
    s = quadrature.s
    assert s.shape == (41,)
    assert s.real.min() > 0 and (s.imag[1:-1] > 0).all()
    assert s.imag[0] == s.imag[-1] == 0
    radius = quadrature.radius
    assert radius**80 == pytest.approx(1e-8, rel=1e-12)
    # the ends of the curve are δ(ρ) and δ(−ρ); 0.02 s is a step of 50 1/s
    assert s[0].real == pytest.approx(50 * (1 - radius) * (3 - radius) / 2, rel=1e-13)
    assert s[-1].real == pytest.approx(50 * (1 + radius) * (3 + radius) / 2, rel=1e-14)


@pytest.mark.parametrize("num_steps", [1, 2, 5, 64, 1001])
@pytest.mark.parametrize("power", [0, 1, 2])
def test_weights_of_derivatives_are_those_of_the_formula(num_steps, power):
    dt = 0.005
    quadrature = ConvolutionQuadrature(num_steps, dt)
    formula = np.array([1.0])
    for _ in range(power):
        formula = np.convolve(formula, [1.5, -2.0, 0.5])
    expected = np.zeros(max(num_steps, formula.size))
    expected[: formula.size] = formula / dt**power
    # a polynomial longer than the circle has points for is aliased, which is no round-off
    beyond = np.abs(expected[2 * num_steps :]).sum() * 1e-8
    found = quadrature.weights(3.0 * quadrature.s**power) / 3.0
    limit = 10 * EPS * AMPLIFIED * (4 / dt) ** power
    np.testing.assert_allclose(found, expected[:num_steps], rtol=0, atol=limit + 2 * beyond)


def test_weights_of_an_integral_and_what_is_aliased(figure):
    """1/δ(ζ) = Σ (1 − 3^{−n−1}) ζⁿ: the weights of an integral tend to δt, and so does p_{n+2N}."""
    quadrature = ConvolutionQuadrature(500, 0.01)
    found = quadrature.weights(1 / quadrature.s)
    exact = 0.01 * (1 - 3.0 ** -(np.arange(500) + 1.0))
    error = (found - exact) / 0.01
    figure("weights of an integral, error", np.abs(error).max(), 1.001e-8)
    assert np.median(error) == pytest.approx(1e-8, rel=1e-3)


@pytest.mark.parametrize("rate", [0.0, 0.3, 40.0, 3e3])
def test_weights_against_a_recursion(rate, figure):
    """P = (s + a)⁻²: the power series is the impulse response of a filter, taken twice."""
    num, dt = 600, 0.005
    quadrature = ConvolutionQuadrature(num, dt)
    denominator = [1.5 + rate * dt, -2.0, 0.5]
    exact = impulse(3 * num)
    for _ in range(2):
        exact = dt * lfilter([1.0], denominator, exact)
    found = quadrature.weights((quadrature.s + rate) ** -2.0)
    # what is aliased is 1e-8 of a weight beyond 2N, at most the largest of 3N
    error = np.abs(found - exact[:num]).max() / exact.max()
    figure(f"weights of (s + {rate:g})^-2 against a recursion", error, 1.1e-8)


def test_a_convolution_is_of_second_order(figure):
    """An oscillator's response to t² e^{−t}, whose closed form is a sum of partial fractions."""
    omega, damping, horizon = 2 * np.pi, 0.05, 4.0
    pole = omega * complex(-damping, np.sqrt(1 - damping**2))

    def exact(t):
        # X(s) = 2/(s + 1)³ / ((s − p)(s − p̄)): residues at −1 (triple) and at p and its conjugate
        a, b = pole, pole.conjugate()
        q = (-1 - a) * (-1 - b)
        dq = -2 - a - b
        at_one = t**2 / q - 2 * t * dq / q**2 + (2 * dq**2 / q**3 - 2 / q**2)
        at_pole = 2 / ((a + 1) ** 3 * (a - b)) * np.exp(a * t)
        return (np.exp(-t) * at_one).real + 2 * at_pole.real

    errors = []
    for num in (400, 800, 1600):
        quadrature = ConvolutionQuadrature(num, horizon / num)
        s, time = quadrature.s, quadrature.dt * np.arange(num)
        weights = quadrature.weights(1 / (s**2 + 2 * damping * omega * s + omega**2))
        found = np.convolve(weights, time**2 * np.exp(-time))[:num]
        errors.append(np.abs(found - exact(time)).max() / np.abs(exact(time)).max())
    figure("oscillator by quadrature, 200 steps a period", errors[1], 2e-3)
    for coarse, fine in pairwise(errors):
        figure("quadrature: order in time", abs(np.log2(coarse / fine) - 2), 0.05)


def test_how_errors_are_amplified(figure):
    """An error of P is at most ρ^{−n} of itself in a weight, and that much if it is in tune."""
    num, error = 800, 1e-6
    quadrature = ConvolutionQuadrature(num, 0.01)
    lines = np.arange(num + 1)
    for n in (0, num // 2, num - 1):
        tuned = error * np.exp(-1j * np.pi * lines * n / num)
        found = quadrature.weights(tuned)
        assert found[n] == pytest.approx(error * quadrature.radius**-n, rel=1e-9)
    figure("amplification at the last weight", found[-1] / error, AMPLIFIED)
    random = np.random.default_rng(2)
    noise = error * np.exp(2j * np.pi * random.random(num + 1))
    scattered = np.abs(quadrature.weights(noise))
    # of N weights of a normal distribution none is beyond five standard deviations
    expected = error * quadrature.radius ** -np.arange(num) / np.sqrt(2 * num)
    figure("scattered errors over what is expected", (scattered / expected).max(), 5.0)
    assert np.median(scattered / expected) == pytest.approx(0.67, abs=0.1)


def test_several_kernels_at_once():
    quadrature = ConvolutionQuadrature(20, 0.1)
    s = quadrature.s
    together = quadrature.weights(np.stack([1 / s, 2 + s, s**2])[None])
    assert together.shape == (1, 3, 20)
    for row, kernel in enumerate([1 / s, 2 + s, s**2]):
        np.testing.assert_array_equal(together[0, row], quadrature.weights(kernel))


@pytest.mark.parametrize(
    ("num_steps", "dt", "reason"),
    [(0, 0.1, "num_steps"), (5, 0.0, "dt"), (5, -1.0, "dt"), (5, np.nan, "dt")],
)
def test_what_has_no_weights(num_steps, dt, reason):
    with pytest.raises(ValueError, match=reason):
        ConvolutionQuadrature(num_steps, dt)


def test_values_that_are_refused():
    quadrature = ConvolutionQuadrature(5, 0.1)
    with pytest.raises(ValueError, match=r"found shape \(5,\); expected 6"):
        quadrature.weights(np.ones(5))
    with pytest.raises(ValueError, match="expected 6"):
        quadrature.weights(1.0)
    with pytest.raises(ValueError, match="1 that are not finite"):
        quadrature.weights([1.0, 2.0, np.nan, 1.0, 1.0, 1.0])
