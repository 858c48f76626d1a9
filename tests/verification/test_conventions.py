# SPDX-License-Identifier: MIT
"""The four conventions of the complex modulus: shear and compression waves in a uniform layer.

Case a2 of the reference data prints the surface's complex transfer function for D = 5 % in each of
them. At D = 20 %, where they differ most, and for compression waves the closed form
cos(ωz/V*)/cos(ωH/V*) takes over; z is the depth and V* the complex wave velocity (Kramer 1996,
section 7.2).
"""

import numpy as np
import pytest
from support.reference import comb, load

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate
from fenics_hytf.soil import Elastic, complex_factor

# The table of the reference by the package's name.
NAMES = {"dormieux": "dormieux", "hysteretic": "seed", "kramer": "kramer", "shake91": "shake91"}
HEIGHT, POISSON = 20.0, 0.3
DEPTHS = {"surface": 0.0, "mid": 10.0}
STRONG = 0.2
LIMIT = 0.2  # per cent of each value


def layer(case, convention, damping, folder, keep="poisson"):
    """The layer of a2 in 40 cells of degree 2, shaken along x and y alike at 0.1 to 25 Hz."""
    soil = case["profile"]["layers_top_down"][0]
    layers = [{"thickness": HEIGHT, "soil": "soil", "cells": 40}]
    motion = comb(folder / "comb.csv", np.arange(1, 251), 1000, 0.01)
    scene = Scene.from_dict(
        {
            "mesh": {"column": {"width": 1.0, "layers": layers}, "degree": 2},
            "soil": {
                "soil": {
                    "density": soil["density_kg_m3"],
                    "shear_wave_velocity": soil["vs_m_s"],
                    "poisson": POISSON,
                    "damping": damping,
                }
            },
            "motion": [{"direction": "x", **motion}, {"direction": "y", **motion}],
            "boundary": {"left": "tied", "right": "tied"},
            "solver": {"complex_modulus": convention, "keep": keep},
            "output": {"receivers": {k: [0.5, HEIGHT - z] for k, z in DEPTHS.items()}},
        }
    )
    lapse = simulate(scene).lapses[0]
    return scene.soil["soil"].elastic, lapse.frequency, lapse.transfer


def closed_form(frequency, velocity):
    """At both depths, shape ``(2, num_frequencies)``; ``velocity`` is complex [m/s]."""
    wave = 2 * np.pi * frequency / velocity
    return np.array([np.cos(wave * z) / np.cos(wave * HEIGHT) for z in DEPTHS.values()])


def worst(transfer, reference) -> float:
    return 100 * float(np.max(np.abs(transfer / reference - 1)))


@pytest.mark.parametrize("convention", NAMES)
def test_the_tables_of_a2(convention, tmp_path, figure):
    case = load("a2_uniform_damped5")
    _, frequency, transfer = layer(case, convention, 0.05, tmp_path)
    table = case["results"]
    np.testing.assert_allclose(frequency, table["freq_hz"], rtol=1e-12)
    real, imaginary = (np.array(table[f"tf_{p}_{NAMES[convention]}"]) for p in ("re", "im"))
    error = worst(transfer[0, 0, 0], real + 1j * imaginary)
    figure(f"a2 complex transfer function, {convention}", error, LIMIT, "%")


def strong_layer(elastic, convention, keep, frequency):
    """Closed form at D = 20 % along x and y, shape ``(2, 2, num_frequencies)``, depths second.

    The factor G*/G multiplies the whole elasticity tensor, or G alone where the bulk modulus is
    kept.
    """
    factor = complex(complex_factor(STRONG, convention))
    shear = elastic.shear_modulus * factor
    constrained = elastic.bulk_modulus + 4 / 3 * shear
    if keep == "poisson":
        constrained = (elastic.lame_lambda + 2 * elastic.shear_modulus) * factor
    return np.array(
        [closed_form(frequency, np.sqrt(m / elastic.density)) for m in (shear, constrained)]
    )


@pytest.mark.parametrize("keep", ["poisson", "bulk"])
@pytest.mark.parametrize("convention", NAMES)
def test_both_kinds_of_wave_at_strong_damping(convention, keep, tmp_path, figure):
    case = load("a2_uniform_damped5")
    elastic, frequency, transfer = layer(case, convention, STRONG, tmp_path, keep)
    found = np.array([transfer[:, 0, 0], transfer[:, 1, 1]])
    error = worst(found, strong_layer(elastic, convention, keep, frequency))
    figure(f"D = 20 %, {convention}, {keep} kept, x and y", error, LIMIT, "%")
    # Shear and compression waves of a level layer do not couple.
    assert max(np.abs(transfer[:, 1, 0]).max(), np.abs(transfer[:, 0, 1]).max()) < 1e-9


def test_the_limit_tells_the_conventions_apart(figure):
    elastic = Elastic.from_constants(density=1835.0, poisson=POISSON, shear_wave_velocity=200.0)
    frequency = np.arange(1, 251) / 10
    shear = {name: strong_layer(elastic, name, "poisson", frequency)[0] for name in NAMES}
    nearest = min(worst(shear[a], shear[b]) for a in NAMES for b in NAMES if a != b)
    figure("D = 20 %, the two conventions nearest to each other", nearest, 10 * LIMIT, "%", True)
