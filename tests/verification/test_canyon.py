# SPDX-License-Identifier: MIT
"""Antiplane waves round a semi-circular canyon, against Trifunac's series (1973).

A plane SH wave comes up through a half-space; the canyon of radius a in its surface scatters it.
The section is 16 a wide and 8 a deep on a compliant base of the same rock, with free field beyond
its sides. The rock is undamped: what the canyon scatters can only leave through the dashpots.
"""

import numpy as np
import pytest
from scipy.special import h2vp, hankel2, jvp
from support.meshes import mesh_script
from support.reference import comb, load

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate

RADIUS, DEPTH, SPEED = 100.0, 800.0, 1000.0  # m, m, m/s
ROCK = {"density": 2200.0, "shear_wave_velocity": SPEED, "poisson": 0.25}
ETA = (0.25, 0.5, 1.0, 1.5, 2.0)  # the canyon's diameter over the wavelength, ωa/(πV)


def trifunac(x, y, wavenumber):
    """Motion over that of the incident wave at the origin, the middle of the canyon's edges.

    The free field 2 cos(ky) is J_0 and the J_2n cos(2nθ); each meets an outgoing wave H_2n^(2) that
    takes the traction off the canyon's wall (Trifunac 1973, here with e^{+iωt}).
    """
    distance, angle = np.hypot(x, y), np.arctan2(y, x)
    motion = 2 * np.cos(wavenumber * y).astype(complex)
    for n in range(0, 40, 2):
        wall = jvp(n, wavenumber * RADIUS) / h2vp(n, wavenumber * RADIUS)
        outgoing = hankel2(n, wavenumber * distance) * np.cos(n * angle)
        motion -= (2 if n == 0 else 4) * wall * outgoing
    return motion


def surface(x):
    """Depth of the ground's surface below the level of the edges [m]."""
    return np.sqrt(np.maximum(RADIUS**2 - x**2, 0.0))


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """Places, their names and the complex motion over that of the incident wave, lines last."""
    folder = tmp_path_factory.mktemp("canyon")
    table = load("analytic_2d")["canyon_SH_vertical"]
    tabulated = RADIUS * np.array(table["x_over_a"])
    across = np.concatenate([tabulated, np.linspace(-4, 4, 81) * RADIUS])
    size = {"radius": RADIUS, "half_width": 8 * RADIUS, "depth": DEPTH}
    # Of degree 2: a phase error of (2π/8)**4/1440 a radian, over the eight wavelengths that the
    # shortest wave takes from the base to the surface 0.013.
    fine = {"wavelength": 2 * RADIUS / max(ETA), "cells_per_wavelength": 8}
    path = mesh_script("canyon")(folder / "canyon.msh", **size, **fine)
    base = SPEED / (2 * RADIUS)  # Hz at eta = 1
    lines = np.rint(np.array(ETA) / 0.25).astype(int)
    motion = comb(folder / "comb.csv", lines, 32, 1 / (32 * 0.25 * base))
    # A ten-thousandth below the circle, which cells of second order follow to a millionth.
    places = enumerate(zip(across, DEPTH - surface(across) * (1 + 1e-4), strict=True))
    scene = Scene.from_dict(
        {
            "mesh": {"file": str(path), "degree": 2, "kinematics": "antiplane"},
            "soil": {"rock": ROCK},
            "motion": [{"direction": "z", "input": "outcrop", **motion}],
            "boundary": {"base": {"compliant": ROCK}, "left": "free_field", "right": "free_field"},
            "output": {"receivers": {f"r{number}": list(place) for number, place in places}},
        }
    )
    lapse = simulate(scene).lapses[0]
    np.testing.assert_allclose(lapse.frequency, base * np.array(ETA), rtol=1e-9)
    return table, across, 2 * lapse.transfer[:, 0, 0]  # an outcrop motion is twice the incident


@pytest.mark.parametrize("line", range(len(ETA)), ids=lambda line: f"eta={ETA[line]}")
def test_amplitude_and_phase(line, solved, figure):
    table, across, motion = solved
    eta = ETA[line]
    reference = np.array(table["cases"][f"eta={eta}"]["abs"])
    count = len(reference)
    found = np.abs(motion[:count, line])
    error = 100 * np.abs(found / reference - 1).max()
    figure(f"canyon, eta = {eta}: amplitude at nine points", error, 5.0, "%")
    # The incident wave passes the base at its phase of nought, the surface later.
    wavenumber = np.pi * eta / RADIUS
    exact = trifunac(across, surface(across), wavenumber) * np.exp(-1j * wavenumber * DEPTH)
    np.testing.assert_allclose(np.abs(exact[:count]), reference, rtol=0, atol=6e-7)  # as printed
    error = 100 * np.abs(motion[:, line] - exact).max() / np.abs(exact).max()
    figure(f"canyon, eta = {eta}: complex motion at 90 points", error, 5.0, "% of the peak")
