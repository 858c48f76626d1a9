# SPDX-License-Identifier: MIT
"""The material law of cells in parts: complex constants, Maxwell branches, absorbing layers."""

from dataclasses import replace

import numpy as np
import pytest

from fenics_hytf.lapse import ElasticConstants, Ground, Material, Moduli, material
from fenics_hytf.lapse.material import part_functions
from fenics_hytf.scene import Solver
from fenics_hytf.soil import RELAXATION_TIMES, maxwell_factor

EPS = np.finfo(float).eps
FACTORS = {
    "hysteretic": lambda D: 1 + 2j * D,
    "kramer": lambda D: 1 - D**2 + 2j * D,
    "shake91": lambda D: 1 - 2 * D**2 + 2j * D * np.sqrt(1 - D**2),
    "dormieux": lambda D: np.sqrt(1 - 4 * D**2) + 2j * D,
}
MIXED = Ground(
    np.zeros(3, np.int32),
    np.full(3, 1800.0),
    np.array([50e6, 80e6, 20e6]),
    np.array([0.0, 0.3, 0.49]),
    np.zeros(3),
    (None,),
)
SECANT = Moduli(np.array([30e6, 80e6, 5e6]), np.array([0.1, 0.0, 0.24]))
UNDAMPED = replace(SECANT, damping=np.zeros(3))
BULK = 2 * MIXED.shear_modulus * (1 + MIXED.poisson) / (3 * (1 - 2 * MIXED.poisson))
REFERENCE = 2.5  # [Hz]
S = np.array([1e-6, 3.0, 0.4 + 0.3j, 20j, 2j * np.pi * REFERENCE, 1.5 - 40j, 600j])
EVERY = np.arange(3)


def branches_of(found):
    return [part for part in found.parts if part.relaxation_time is not None]


def shear_of(found, s, cells):
    """G(s) of some cells [Pa], shape ``(len(cells), num_lines)``."""
    moduli = [part.constants.shear_modulus[cells] for part in found.parts]
    return np.stack(moduli, axis=1) @ part_functions(found.parts, s)


def law(convention, keep="poisson", moduli=SECANT, ground=MIXED) -> Material:
    reference = REFERENCE if convention == "maxwell" else None
    solver = Solver(complex_modulus=convention, keep=keep, reference_frequency=reference)
    return material(ground, moduli, solver)


def constants_at(found: Material, s: complex) -> tuple[np.ndarray, np.ndarray]:
    """λ and G of every cell, summed over the parts."""
    parts = [(part.function(s), *part.constants.at(EVERY)) for part in found.parts]
    return sum(f * lame for f, lame, _ in parts), sum(f * shear for f, _, shear in parts)


# ---------------------------------------------------------------- complex constants


@pytest.mark.parametrize("convention", FACTORS)
def test_keeping_poissons_ratio(convention):
    found = law(convention)
    lame, G = constants_at(found, 5j)
    np.testing.assert_allclose(G, SECANT.shear_modulus * FACTORS[convention](SECANT.damping))
    np.testing.assert_allclose(lame / (2 * (lame + G)), MIXED.poisson, atol=4 * EPS)  # ν, real
    np.testing.assert_array_equal(found.real.shear_modulus, G.real)
    np.testing.assert_array_equal(found.real.lame_lambda, lame.real)


@pytest.mark.parametrize("convention", FACTORS)
def test_keeping_the_bulk_modulus(convention):
    lame, G = constants_at(law(convention, "bulk"), 5j)
    np.testing.assert_allclose(G, SECANT.shear_modulus * FACTORS[convention](SECANT.damping))
    np.testing.assert_allclose(lame + 2 / 3 * G, BULK, rtol=1e-14)  # small strain, undamped


@pytest.mark.parametrize("keep", ["poisson", "bulk"])
@pytest.mark.parametrize("convention", ["shake91", "maxwell"])
def test_without_damping_there_is_one_part(convention, keep):
    found = law(convention, keep, UNDAMPED)
    assert [part.name for part in found.parts] == ["real"] and not branches_of(found)
    np.testing.assert_array_equal(found.real.shear_modulus, SECANT.shear_modulus)
    for name in ("lame_lambda", "shear_modulus"):
        constants = found.parts[0].constants
        np.testing.assert_array_equal(getattr(constants, name), getattr(found.real, name))


def test_hysteretic_parts():
    real, imaginary = law("hysteretic").parts
    assert (real.instantaneous, imaginary.instantaneous) == (1.0, 0.0)
    assert (real.relaxation_time, imaginary.relaxation_time) == (None, None)
    assert (imaginary.function(3j), imaginary.function(1 - 3j), imaginary.function(2.0)) == (
        1j,
        -1j,
        0,
    )


# ---------------------------------------------------------------- Maxwell branches


@pytest.mark.parametrize("keep", ["poisson", "bulk"])
def test_maxwell_parts_sum_to_the_law(keep):
    found = law("maxwell", keep)
    expected = SECANT.shear_modulus[:, None] * maxwell_factor(SECANT.damping[:, None], S, REFERENCE)
    summed = np.stack([constants_at(found, complex(s))[1] for s in S], axis=1)
    np.testing.assert_allclose(summed, expected, rtol=1e-14)
    np.testing.assert_allclose(shear_of(found, S, EVERY), expected, rtol=1e-14)
    some = shear_of(found, S, np.array([2, 0]))
    np.testing.assert_allclose(some, expected[[2, 0]], rtol=1e-14)


def test_maxwell_keeping_poissons_ratio():
    found = law("maxwell")
    for s in map(complex, S):
        lame, G = constants_at(found, s)
        np.testing.assert_allclose(lame / (2 * (lame + G)), MIXED.poisson, atol=4 * EPS)


def test_maxwell_keeping_the_bulk_modulus():
    found = law("maxwell", "bulk")
    for s in map(complex, S):
        lame, G = constants_at(found, s)
        np.testing.assert_allclose(lame + 2 / 3 * G, BULK, rtol=1e-14)


@pytest.mark.parametrize("keep", ["poisson", "bulk"])
def test_at_the_reference_frequency_the_real_part_is_the_given_modulus(keep):
    found = law("maxwell", keep)
    lame, G = constants_at(found, 2j * np.pi * REFERENCE)
    np.testing.assert_allclose(G.real, SECANT.shear_modulus, rtol=1e-14)
    np.testing.assert_array_equal(found.real.shear_modulus, SECANT.shear_modulus)
    np.testing.assert_allclose(lame.real, found.real.lame_lambda, rtol=1e-13, atol=1e-6)
    # Round a constant loss factor of 2D, which four branches hold to some per cent.
    np.testing.assert_allclose(G.imag / G.real, 2 * SECANT.damping, rtol=0.07)


def test_branches_remember_in_the_order_of_their_times():
    found = law("maxwell")
    assert found.parts[0].relaxation_time is None
    assert [part.relaxation_time for part in branches_of(found)] == list(RELAXATION_TIMES)
    assert [part.instantaneous for part in found.parts] == pytest.approx([1.0] * 5, rel=1e-9)
    assert all(part.function(0.0) == 0 for part in branches_of(found))  # at rest they have relaxed
    assert all((part.constants.shear_modulus[[0, 2]] > 0).all() for part in branches_of(found))
    assert all(part.constants.shear_modulus[1] == 0 for part in branches_of(found))  # undamped


# ---------------------------------------------------------------- an absorbing layer


@pytest.mark.parametrize("convention", ["hysteretic", "maxwell"])
def test_an_absorbing_layer_adds_damping(convention):
    layer = replace(MIXED, absorbing=np.array([0.0, 0.15, 0.06]))
    more = replace(SECANT, damping=SECANT.damping + layer.absorbing)
    absorbed, expected = law(convention, ground=layer), law(convention, moduli=more)
    for s in map(complex, S):
        np.testing.assert_allclose(
            constants_at(absorbed, s), constants_at(expected, s), rtol=1e-14, atol=1e-8
        )
    np.testing.assert_array_equal(absorbed.real.shear_modulus, SECANT.shear_modulus)


def test_an_absorbing_layer_under_maxwell_is_never_overdamped():
    rim = replace(MIXED, absorbing=np.array([2.0, 0.95, 0.9]))
    G = shear_of(law("maxwell", moduli=UNDAMPED, ground=rim), S, EVERY)
    factor = maxwell_factor(np.array([0.95, 0.95, 0.9])[:, None], S, REFERENCE)
    np.testing.assert_allclose(G, SECANT.shear_modulus[:, None] * factor, rtol=1e-14)


def test_constants_of_some_cells():
    constants = ElasticConstants(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]))
    lame, shear = constants.at(np.array([2, 0, 2]))
    assert lame.tolist() == [3.0, 1.0, 3.0] and shear.tolist() == [6.0, 4.0, 6.0]
