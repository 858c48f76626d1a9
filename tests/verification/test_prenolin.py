# SPDX-License-Identifier: MIT
"""PRENOLIN's first canonical column, P1, under the published input, linear, on a rigid base.

Input and column are those of the worked example "Prenolin_benchmark_P1model_PSV" of SEM2DPACK:
20 m, density 2000 kg/m3, Vs = 300 m/s, Vp = 700 m/s, its base held to a record in both directions
at once. The published files give this input and no result. That example's soil is elastoplastic;
here it is linear with D = 1/60, a quality factor of Vs/10 = 30 for both kinds of wave, and the
result is the closed form 1/cos(ωH/V*) (Kramer 1996, section 7.2). The file does not say whether it
holds acceleration or velocity: a transfer function is the same for either.
"""

import numpy as np
import pytest
from support.reference import PUBLISHED, rms

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate

HEIGHT, DENSITY, SHEAR, COMPRESSION, DAMPING = 20.0, 2000.0, 300.0, 700.0, 1 / 60
POISSON = (COMPRESSION**2 - 2 * SHEAR**2) / (2 * (COMPRESSION**2 - SHEAR**2))


@pytest.fixture
def record(tmp_path):
    """The published file under a name that says how it is read: time [s], value."""
    published = PUBLISHED / "prenolin_P1_sem2dpack_inputp1"
    if not published.exists():
        if PUBLISHED.exists():
            pytest.fail(f"{PUBLISHED} is there, but not the input of P1")
        pytest.skip("the published input is not in the repository")
    path = tmp_path / "p1.csv"
    path.write_text(published.read_text())
    return path


def column(record) -> Scene:
    """Cells of 0.5 m, 45 of degree 2 to the shear wavelength of 13.3 Hz, the highest line."""
    layers = [{"thickness": HEIGHT, "soil": "P1", "cells": 40}]
    soil = {"density": DENSITY, "shear_wave_velocity": SHEAR, "poisson": POISSON}
    motion = {"file": str(record), "units": "m/s2"}
    return Scene.from_dict(
        {
            "mesh": {"column": {"width": 1.0, "layers": layers}, "degree": 2},
            "soil": {"P1": soil | {"damping": DAMPING}},
            "motion": [{"direction": "x", **motion}, {"direction": "y", **motion}],
            "boundary": {"left": "tied", "right": "tied"},
            "lapses": {"duration": 8.192},
            # Values of six decimals under a peak of 0.034: below 1e-4 of the spectral peak there is
            # nothing but their rounding.
            "solver": {"excited": 1e-4},
            "output": {"receivers": {"surface": [0.5, HEIGHT]}},
        }
    )


def test_transfer_functions_and_surface_motion(record, figure):
    scene = column(record)
    lapse = simulate(scene).lapses[0]
    assert lapse.solved_lines == lapse.excited_lines > 100
    assert lapse.frequency.max() > 13.0  # beyond the second resonance in shear, 11.25 Hz
    given = np.loadtxt(record)[:, 1]
    base = np.zeros(lapse.num_samples)
    base[: len(given)] = given
    np.testing.assert_array_equal(scene.base_acceleration, [base, base])
    frequency = np.fft.rfftfreq(lapse.num_samples, lapse.dt)
    for axis, (name, velocity) in enumerate((("x", SHEAR), ("y", COMPRESSION))):
        complex_velocity = velocity * np.sqrt(1 + 2j * DAMPING)
        exact = 1 / np.cos(2 * np.pi * frequency * HEIGHT / complex_velocity)
        lines = np.isin(np.arange(len(frequency)), np.rint(lapse.frequency / frequency[1]))
        error = np.abs(lapse.transfer[0, axis, axis] / exact[lines] - 1).max()
        figure(f"P1, transfer function in {name}, every line", 100 * error, 0.2, "%")
        # All lines here, the rounding of the file included, which was not solved for.
        surface = np.fft.irfft(np.fft.rfft(base) * exact, lapse.num_samples)
        error = rms(lapse.total_acceleration[0, axis] - surface) / rms(surface)
        figure(f"P1, surface motion in {name}", 100 * error, 0.2, "% rms")
