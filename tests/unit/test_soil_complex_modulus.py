# SPDX-License-Identifier: MIT
import json
from pathlib import Path

import numpy as np
import pytest

from fenics_hytf.soil import COMPLEX_MODULUS, complex_factor

A2 = json.loads((Path(__file__).parents[1] / "data/a2_uniform_damped5.json").read_text())
NAMES_OF_THE_REFERENCE = {
    "hysteretic": "seed",
    "kramer": "kramer",
    "shake91": "shake91",
    "dormieux": "dormieux",
}


@pytest.mark.parametrize("convention", COMPLEX_MODULUS)
def test_transfer_function_of_the_reference(convention):
    # surface over base of a uniform layer on a rigid base, 1 / cos(omega H / Vs*)
    layer = A2["profile"]["layers_top_down"][0]
    velocity = layer["vs_m_s"] * np.sqrt(complex_factor(layer["damping"], convention))
    omega = 2 * np.pi * np.array(A2["results"]["freq_hz"])
    transfer = 1 / np.cos(omega * layer["thickness_m"] / velocity)
    name = NAMES_OF_THE_REFERENCE[convention]
    reference = np.array(A2["results"][f"tf_re_{name}"]) + 1j * np.array(
        A2["results"][f"tf_im_{name}"]
    )
    # 12 printed digits of numbers up to 13
    assert transfer == pytest.approx(reference, abs=1e-10)


def test_the_reference_tells_the_conventions_apart():
    results = A2["results"]
    for a in NAMES_OF_THE_REFERENCE.values():
        for b in NAMES_OF_THE_REFERENCE.values():
            difference = np.abs(
                np.array(results[f"tf_im_{a}"]) - np.array(results[f"tf_im_{b}"])
            ).max()
            assert a == b or difference > 1e-4


def test_formulas_at_ten_percent():
    assert complex_factor(0.1) == 1 + 0.2j
    assert complex_factor(0.1, "hysteretic") == 1 + 0.2j
    assert complex_factor(0.1, "kramer") == pytest.approx(0.99 + 0.2j, rel=1e-15)
    assert complex_factor(0.1, "shake91") == pytest.approx(0.98 + 0.2j * np.sqrt(0.99), rel=1e-15)
    assert complex_factor(0.1, "dormieux") == pytest.approx(np.sqrt(0.96) + 0.2j, rel=1e-15)


@pytest.mark.parametrize("convention", ["shake91", "dormieux"])
def test_magnitude_is_kept(convention):
    damping = np.linspace(0.0, 0.499, 50)
    assert np.abs(complex_factor(damping, convention)) == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize("convention", COMPLEX_MODULUS)
def test_shape_and_limit_without_damping(convention):
    factor = complex_factor(np.zeros((2, 3)), convention)
    assert factor.shape == (2, 3)
    assert factor.dtype == np.complex128
    assert np.all(factor == 1.0)
    assert complex_factor([], convention).shape == (0,)
    assert complex_factor(0.05, convention).shape == ()
    # the share of energy lost to first order in D
    assert np.imag(complex_factor(1e-6, convention)) == pytest.approx(2e-6, rel=1e-9)


@pytest.mark.parametrize("convention", COMPLEX_MODULUS)
def test_invalid(convention):
    limit = 0.5 if convention == "dormieux" else 1.0
    complex_factor(np.nextafter(limit, 0.0), convention)
    for faulty in (limit, -1e-9, np.nan, np.inf):
        with pytest.raises(
            ValueError, match=rf"^damping: found {faulty}; .*< {limit:g} .*{convention}"
        ):
            complex_factor([0.1, faulty], convention)


def test_unknown_convention():
    with pytest.raises(ValueError, match="found 'seed'; expected one of hysteretic, kramer, shake"):
        complex_factor(0.1, "seed")
