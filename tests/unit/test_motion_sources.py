# SPDX-License-Identifier: MIT
import json
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from fenics_hytf.motion import (
    GRAVITY,
    RecordError,
    excited_lines,
    frequencies,
    harmonic,
    recorded,
    recorded_names,
    sources,
    synthetic,
    to_frequency,
    to_time,
)
from fenics_hytf.soil import complex_factor

B1 = json.loads((Path(__file__).parents[1] / "data/b1_two_layer_linear_synthetic.json").read_text())


@pytest.mark.parametrize("cycles", [1, 3, 7, 16])
@pytest.mark.parametrize("samples", [33, 128, 400, 1001])
def test_harmonic_excites_exactly_one_line(cycles, samples):
    record = harmonic(2.0, 0.01, cycles, samples)
    assert record.num_samples == samples
    assert record.duration == pytest.approx(cycles / 0.01, rel=1e-14)
    spectrum = to_frequency(record.acceleration)
    assert np.array_equal(excited_lines(spectrum, record.dt, samples), [cycles])
    # a sine of amplitude A has the coefficient -iAN/2; the transform rounds at 1e-15
    assert spectrum[cycles] == pytest.approx(-1j * samples, rel=1e-13)
    assert frequencies(samples, record.dt)[cycles] == pytest.approx(0.01, rel=1e-13)


def test_harmonic_is_the_sine_with_its_end_excluded():
    record = harmonic(3.0, 2.0, 2.5, 50)
    assert record.dt == 2.5 / (2.0 * 50)
    # phases up to 16 rad, each rounded
    exact = 3.0 * np.sin(2 * np.pi * 2.0 * record.time)
    assert record.acceleration == pytest.approx(exact, abs=3.0 * 32 * np.finfo(float).eps)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ((1.0, 0.0, 1, 100), "frequency"),
        ((1.0, -1.0, 1, 100), "frequency"),
        ((1.0, 1.0, 0, 100), "cycles"),
        ((np.nan, 1.0, 1, 100), "amplitude"),
        ((1.0, 1.0, 1, 2), "samples"),
        ((1.0, 1.0, 0.1, 1), "samples"),
        ((1.0, 1.0, 10, 20), "samples"),  # all samples would be zero
        ((1.0, 1.0, 1, 100.5), "samples"),
    ],
)
def test_harmonic_invalid(arguments, name):
    with pytest.raises(ValueError, match=f"^{name}: found"):
        harmonic(*arguments)


def test_synthetic_defaults_are_those_of_the_reference():
    parameters = dict(B1["motion"]["parameters"])
    assert parameters.pop("golden") == sources._GOLDEN
    default, explicit = synthetic(0.1), synthetic(0.1, **parameters)
    assert np.array_equal(default.acceleration, explicit.acceleration)
    assert default.num_samples == B1["motion"]["npts"]
    assert default.dt == B1["motion"]["dt_s"]
    assert default.pga == pytest.approx(B1["motion"]["pga_g"] * GRAVITY, rel=1e-15)


def test_synthetic_formula_term_by_term():
    record = synthetic(0.3, dt=0.02, n=700, nf=5, t1=2.0, t2=6.0, c=0.4)
    values = []
    for j in range(700):
        t = 0.02 * j
        e = (t / 2.0) ** 2 if t < 2.0 else 1.0 if t < 6.0 else np.exp(-0.4 * (t - 6.0))
        values.append(
            e
            * sum(
                np.sin(
                    2 * np.pi * 0.4 * 20.0 ** ((k - 1) / 4) * t
                    + 2 * np.pi * ((0.6180339887498949 * k) % 1.0)
                )
                for k in range(1, 6)
            )
        )
    values = np.array(values) * 0.3 * GRAVITY / np.abs(values).max()
    assert record.acceleration == pytest.approx(values, abs=1e-12)  # phases of 700 rad, rounded


def test_synthetic_through_the_reference_column():
    # The reference gives the surface motion of a two-layer column on a rigid base under this
    # record; the closed form of the column (exact, in the reference's complex modulus) gives it
    # here. The reference prints 7 digits of each sample.
    samples = B1["motion"]["fa_length"]
    record = synthetic(B1["motion"]["pga_g"])
    omega = 2 * np.pi * frequencies(samples, record.dt)
    displacement, stress = np.ones(omega.size, complex), np.zeros(omega.size, complex)
    for layer in B1["profile"]["layers_top_down"]:
        density, height = layer["density_kg_m3"], layer["thickness_m"]
        modulus = (
            density * layer["vs_m_s"] ** 2 * complex_factor(layer["damping"], "dormieux").item()
        )
        k = omega / np.sqrt(modulus / density)
        c, s = np.cos(k * height), height * np.sinc(k * height / np.pi)
        displacement, stress = (
            c * displacement + s / modulus * stress,
            c * stress - s * k**2 * modulus * displacement,
        )
    base = to_frequency(record.padded(samples).acceleration)
    surface = to_time(base / displacement, samples)[: record.num_samples] / GRAVITY
    within = B1["results_by_base_input"]["within"]
    assert surface == pytest.approx(np.array(within["surface_accel_g"]), abs=1e-7)
    assert np.abs(surface).max() == pytest.approx(within["surface_pga_g"], rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ({"pga_g": 0.0}, "pga_g"),
        ({"dt": -0.01}, "dt"),
        ({"n": 1}, "n"),
        ({"n": 10.5}, "n"),
        ({"nf": 1}, "nf"),
        ({"f1": 0.0}, "f1"),
        ({"f2": 0.3}, "f2"),
        ({"f2": 51.0}, "f2"),  # above the Nyquist frequency
        ({"t2": 2.0}, "t2"),
        ({"c": np.nan}, "c"),
    ],
)
def test_synthetic_invalid(arguments, name):
    with pytest.raises(ValueError, match=f"^{name}: found"):
        synthetic(**arguments)


def test_recorded_motions_are_all_readable():
    if find_spec("pyslammer") is None:
        pytest.skip("pyslammer, an optional extra, is not installed")
    imported = "pyslammer" in sys.modules
    names = recorded_names()
    assert "Kobe_1995_TAK-090" in names
    for name in names:
        record = recorded(name)
        assert record.name == name
        assert 0.002 <= record.dt <= 0.02  # what accelerographs sample at
        assert 0.1 < record.pga / GRAVITY < 1.5  # the suite is of strong motions, in g
    assert ("pyslammer" in sys.modules) == imported  # the files are read, no code is imported


def test_recorded_motion_against_its_file():
    if find_spec("pyslammer") is None:
        pytest.skip("pyslammer, an optional extra, is not installed")
    record = recorded("Kobe_1995_TAK-090")
    table = np.loadtxt(sources._suite() / "Kobe_1995_TAK-090.csv", delimiter=",")
    assert np.array_equal(record.acceleration, GRAVITY * table[:, 1])
    # the mean step is kept to 12 digits
    assert record.time == pytest.approx(table[:, 0], rel=1e-11)


def test_recorded_unknown_name():
    if find_spec("pyslammer") is None:
        pytest.skip("pyslammer, an optional extra, is not installed")
    with pytest.raises(RecordError, match=r"found 'Kobe'; expected one of .*Kobe_1995_TAK-090"):
        recorded("Kobe")


def test_recorded_without_the_package(monkeypatch):
    monkeypatch.setattr(sources, "find_spec", lambda name: None)
    with pytest.raises(RecordError, match=r"pip install fenics-hytf\[records\]"):
        recorded("Kobe_1995_TAK-090")


def test_recorded_with_a_package_that_lacks_the_folder(monkeypatch, tmp_path):
    class Spec:
        submodule_search_locations = (str(tmp_path),)

    monkeypatch.setattr(sources, "find_spec", lambda name: Spec())
    with pytest.raises(RecordError, match="found no folder"):
        recorded_names()
