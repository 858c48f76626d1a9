# SPDX-License-Identifier: MIT
"""Linear columns against closed forms and pystrata: cases a1, a2, b1, b2 of the reference data."""

import numpy as np
import pytest
from support.reference import G0, column, load, motion, rms, two_layer_transfer

from fenics_hytf.simulation import simulate

CONVENTIONS = {
    "dormieux": "dormieux",
    "hysteretic": "seed",
    "kramer": "kramer",
    "shake91": "shake91",
}


def probe(case, folder):
    """A record that excites just the tabulated lines, multiples of 0.1 Hz, and no resonance."""
    lines = np.rint(np.array(case["results"]["freq_hz"]) * 10).astype(int)
    spectrum = np.zeros(501)
    spectrum[lines] = 1.0
    path = folder / "probe.csv"
    np.savetxt(path, np.fft.irfft(spectrum, 1000))
    return {"direction": "x", "file": str(path), "dt": 0.01, "units": "m/s2"}


# A sublayer is one degree-2 cell. Undamped, the lines nearest to a resonance stand 0.1 Hz from it
# and multiply the error of the wave number, which falls with the fourth power of the cell: the
# undamped layer takes 0.4 m, the damped ones 1 m.
def test_uniform_undamped(tmp_path, figure):
    case = load("a1_uniform_undamped")
    result = simulate(column(case, probe(case, tmp_path), cell=0.4, duration=10.0))
    reference = np.array(case["results"]["tf_abs"])
    transfer = np.abs(result.lapses[0].transfer[0, 0, 0])
    np.testing.assert_allclose(result.lapses[0].frequency, case["results"]["freq_hz"], rtol=1e-12)
    figure("a1 transfer function", 100 * np.max(abs(transfer / reference - 1)), 0.2, "%")


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_uniform_damped(convention, tmp_path, figure):
    case = load("a2_uniform_damped5")
    scene = column(case, probe(case, tmp_path), cell=0.5, duration=10.0, convention=convention)
    transfer = np.abs(simulate(scene).lapses[0].transfer[0, 0, 0])
    reference = np.array(case["results"][f"tf_abs_{CONVENTIONS[convention]}"])
    error = 100 * np.max(abs(transfer / reference - 1))
    figure(f"a2 transfer function, {convention}", error, 0.2, "%")


@pytest.mark.parametrize("name", ["b1_two_layer_linear_synthetic", "b2_two_layer_linear_NIS090"])
def test_two_layers(name, figure):
    case = load(name)
    reference = case["results_by_base_input"]["within"]
    period = case["motion"]["fa_length"] * case["motion"]["dt_s"]
    lapse = simulate(column(case, motion(case), cell=0.5, duration=period)).lapses[0]
    expected = np.array(reference["surface_accel_g"])
    surface = lapse.total_acceleration[0, 0, : len(expected)] / G0
    figure(
        f"{name[:2]} surface acceleration",
        100 * rms(surface - expected) / rms(expected),
        0.5,
        "% rms",
    )
    # The reference's printed transfer function, at its own frequencies, and the closed form.
    layers = case["profile"]["layers_top_down"]
    density = tuple(layer["density_kg_m3"] for layer in layers)
    modulus = tuple(
        layer["density_kg_m3"]
        * layer["vs_m_s"] ** 2
        * (np.sqrt(1 - 4 * layer["damping"] ** 2) + 2j * layer["damping"])
        for layer in layers
    )
    thickness = tuple(layer["thickness_m"] for layer in layers)
    printed = two_layer_transfer(
        2 * np.pi * np.array(reference["freq_hz"]), thickness, density, modulus
    )
    np.testing.assert_allclose(
        abs(printed), reference["tf_surface_over_base_within_abs"], rtol=2e-7
    )  # eight printed digits
    band = (lapse.frequency > 0) & (lapse.frequency <= 25.0)
    exact = two_layer_transfer(2 * np.pi * lapse.frequency[band], thickness, density, modulus)
    error = abs(np.abs(lapse.transfer[0, 0, 0, band]) / abs(exact) - 1)
    figure(f"{name[:2]} transfer function", 100 * error.max(), 0.2, "%")
