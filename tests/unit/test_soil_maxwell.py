# SPDX-License-Identifier: MIT
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fenics_hytf.soil import (
    RELAXATION_TIMES,
    branch_weights,
    branches,
    maxwell,
    maxwell_factor,
    relaxed_factor,
)

TAU = np.array(RELAXATION_TIMES)
FREQUENCIES = np.geomspace(0.2, 20.0, 1001)  # the whole band, with both its ends
S = 2j * np.pi * FREQUENCIES


def loss_factor(weights):
    """Im G / Re G in the band, shape (..., 1001), of weights of shape (..., 4)."""
    x = S[:, None] * TAU
    modulus = 1 + weights @ (x / (1 + x)).T
    return modulus.imag / modulus.real


def test_a_branch_takes_numbers_and_arrays():
    assert len(branches) == 4
    s = np.array([[0.0, 1j, 3.0], [1 + 2j, -5j, 1e3j]])
    for kappa, tau in zip(branches, RELAXATION_TIMES, strict=True):
        assert kappa.relaxation_time == tau
        assert kappa(s).shape == (2, 3)
        assert kappa(s) == pytest.approx(s * tau / (1 + s * tau), rel=1e-15)
        assert type(kappa(1 + 2j)) is complex
        assert kappa(1 + 2j) == pytest.approx(kappa(s)[1, 0], rel=1e-15)
        assert kappa(1j / tau) == pytest.approx(0.5 + 0.5j, rel=1e-15)  # the peak of the loss


@pytest.mark.parametrize(
    ("damping", "error"),  # as measured, rounded up
    [(1e-9, 0.0066), (0.01, 0.0066), (0.02, 0.0081), (0.05, 0.0132), (0.1, 0.0234), (0.2, 0.05)],
)
def test_loss_factor_in_the_band(damping, error):
    factor = maxwell_factor(damping, S, 2.0)
    found = np.abs(factor.imag / factor.real / (2 * damping) - 1).max()
    assert 0.9 * error < found <= error


@pytest.mark.parametrize(
    ("damping", "error", "middle"),  # as measured, rounded up
    [(0.02, 0.0016, 0.0004), (0.05, 0.0042, 0.001), (0.1, 0.0095, 0.002)],
)
@pytest.mark.parametrize("reference_frequency", [1.0, 2.0, 5.0])
def test_dispersion_is_that_of_constant_loss(damping, error, middle, reference_frequency):
    # Kjartansson (1979): G ~ s^(2 gamma), so that the phase velocity grows as f^gamma
    velocity = 1 / np.real(1 / np.sqrt(maxwell_factor(damping, S, reference_frequency)))
    at_reference = maxwell_factor(damping, 2j * np.pi * reference_frequency, reference_frequency)
    velocity *= np.real(1 / np.sqrt(at_reference))
    constant_loss = (FREQUENCIES / reference_frequency) ** (np.arctan(2 * damping) / np.pi)
    difference = np.abs(velocity / constant_loss - 1)
    assert difference.max() <= error
    assert difference[(FREQUENCIES >= 0.5) & (FREQUENCIES <= 8.0)].max() <= middle


@pytest.mark.parametrize("reference_frequency", [0.05, 0.2, 2.0, 20.0, 300.0])
def test_given_modulus_at_the_reference_frequency(reference_frequency):
    damping = np.linspace(0.0, 0.999, 50)
    factor = maxwell_factor(damping, 2j * np.pi * reference_frequency, reference_frequency)
    assert factor.real == pytest.approx(1.0, abs=1e-14)


def test_weights_against_the_fit_they_interpolate():
    # half-way between rows of the table, and closely where weights become zero
    closely = np.linspace(-0.0021, 0.0021, 127)
    damping = np.concatenate(
        [
            [1e-12],
            np.arange(0.001, 1.0, 0.002),
            *(kink + closely for kink in (0.3402, 0.6237, 0.7049)),
        ]
    )
    weights = branch_weights(damping)
    fitted = damping[:, None] * maxwell._fit(damping)
    assert np.all(weights >= 0.0)
    assert np.all(weights[damping < 0.34] > 0.0)
    error = np.abs(loss_factor(weights) / loss_factor(fitted) - 1).max(axis=1)
    assert error[damping < 0.3].max() < 5e-5
    assert error.max() < 1e-4


def test_shapes():
    damping = np.array([[0.0, 0.02, 0.05], [0.1, 0.2, 0.9]])
    assert branch_weights(damping).shape == (2, 3, 4)
    assert branch_weights(0.05).shape == (4,)
    assert branch_weights([]).shape == (0, 4)
    assert relaxed_factor(damping, 2.0).shape == (2, 3)
    assert relaxed_factor(0.05, 2.0).shape == ()
    factor = maxwell_factor(damping[..., None], S, 2.0)
    assert factor.shape == (2, 3, S.size)
    assert factor[1, 0] == pytest.approx(maxwell_factor(0.1, S, 2.0), rel=1e-15)
    assert factor[1, 0, 7] == pytest.approx(complex(maxwell_factor(0.1, S[7], 2.0)), rel=1e-15)


def test_elastic_without_damping():
    assert np.all(branch_weights(np.zeros(3)) == 0.0)
    assert relaxed_factor(0.0, 2.0) == 1.0
    assert np.all(maxwell_factor(0.0, S, 2.0) == 1.0)


def relaxation_function(damping, time):
    """Stress over G after a unit step of strain: an exponential per branch."""
    remembered = branch_weights(damping) * np.exp(-time[:, None] / TAU)
    return relaxed_factor(damping, 2.0) * (1 + remembered.sum(axis=1))


@pytest.mark.parametrize("damping", [0.001, 0.05, 0.2, 0.5, 0.99])
def test_causal_and_passive(damping):
    # G(s)/s is the transform of a function that is positive and decays: Talbot's contour
    time = np.geomspace(1e-4, 10.0, 40)
    theta = np.pi * (np.arange(32) + 0.5) / 32
    z = 32 * (-0.4814 + 0.6443j * theta + 0.5653 * theta / np.tan(0.6407 * theta))
    slope = 0.5653 * (1 / np.tan(0.6407 * theta) - 0.6407 * theta / np.sin(0.6407 * theta) ** 2)
    dz = 32 * (0.6443j + slope)
    kernel = maxwell_factor(damping, z / time[:, None], 2.0) / z
    inverse = np.imag(np.sum(np.exp(z) * kernel * dz, axis=1)) / 32
    relaxation = relaxation_function(damping, time)
    assert inverse == pytest.approx(relaxation, rel=1e-8)
    assert np.all(relaxation > 0.0)
    assert np.all(np.diff(relaxation) <= 0.0)
    # energy is lost at every frequency, real motion stays real, stiffness grows with frequency
    s = 2j * np.pi * np.geomspace(1e-4, 1e4, 500)
    factor = maxwell_factor(damping, s, 2.0)
    assert np.all(factor.imag > 0.0)
    assert np.all(np.diff(factor.real) > 0.0)
    assert np.all(maxwell_factor(damping, -s, 2.0) == factor.conj())
    assert maxwell_factor(damping, 0.0, 2.0) == relaxed_factor(damping, 2.0)


@pytest.mark.parametrize("frequency", [0.3, 2.0, 12.0])
def test_memory_strains_in_time(frequency):
    # d zeta/dt = d gamma/dt - zeta/tau from rest, under gamma = sin(omega t)
    omega = 2 * np.pi * frequency
    time = np.linspace(0.0, 3 / frequency, 200)
    solution = solve_ivp(
        lambda t, zeta: omega * np.cos(omega * t) - zeta / TAU,
        (0.0, time[-1]),
        np.zeros(4),
        t_eval=time,
        rtol=1e-10,
        atol=1e-12,
    )
    for zeta, kappa, tau in zip(solution.y, branches, RELAXATION_TIMES, strict=True):
        amplitude = kappa(1j * omega)
        steady = np.imag(amplitude * np.exp(1j * omega * time))
        fading = -amplitude.imag * np.exp(-time / tau)
        assert zeta == pytest.approx(steady + fading, abs=1e-8)


def test_energy_of_a_loop_in_time():
    # D = loss over 4 pi times the energy of the spring, of a steady cycle at f_ref
    damping, frequency = 0.05, 2.0
    omega = 2 * np.pi * frequency
    weights, relaxed = branch_weights(damping), relaxed_factor(damping, frequency)

    def rates(t, state):
        zeta, rate = state[:4], omega * np.cos(omega * t)
        stress = relaxed * (np.sin(omega * t) + weights @ zeta)
        return np.append(rate - zeta / TAU, stress * rate)

    start = np.append([kappa(1j * omega).imag for kappa in branches], 0.0)
    cycle = solve_ivp(rates, (0.0, 1 / frequency), start, rtol=1e-10, atol=1e-12)
    loss = cycle.y[4, -1]
    assert cycle.y[:4, -1] == pytest.approx(start[:4], abs=1e-8)
    expected = maxwell_factor(damping, 1j * omega, frequency)
    assert loss == pytest.approx(np.pi * expected.imag, rel=1e-8)
    assert loss / (4 * np.pi * 0.5) == pytest.approx(damping, rel=0.0132)


def test_invalid_damping():
    branch_weights(np.nextafter(1.0, 0.0))
    for faulty in (1.0, 5.0, -1e-9, np.nan, np.inf):
        for call in (
            branch_weights,
            lambda d: relaxed_factor(d, 2.0),
            lambda d: maxwell_factor(d, 1j, 2.0),
        ):
            with pytest.raises(
                ValueError, match=rf"^damping: found {faulty}; expected 0 <= damping < 1.*'maxwell'"
            ):
                call([0.1, faulty])


@pytest.mark.parametrize("faulty", [0.0, -2.0, np.nan, np.inf])
def test_invalid_reference_frequency(faulty):
    with pytest.raises(ValueError, match=rf"^reference_frequency: found {faulty}; .*in Hz"):
        relaxed_factor(0.05, faulty)
    with pytest.raises(ValueError, match=r"^reference_frequency: found"):
        maxwell_factor(0.05, 1j, faulty)
