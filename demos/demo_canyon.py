# SPDX-License-Identifier: MIT
# # A canyon: waves that come up, are scattered, and leave
#
# This demo shows how to:
#
# - model a piece of a half-space: a compliant base, and sides with free field beyond them;
# - shake it across its plane ("antiplane", SH waves) by a record of bare rock;
# - check it against theory: Trifunac's series for a semi-circular canyon.
#
# The same scene runs on the command line: `hytf run canyon.toml`.

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import h2vp, hankel2, jvp

from fenics_hytf import Scene, simulate
from fenics_hytf.motion import GRAVITY

# ## The scene
#
# A canyon of 100 m radius in rock of 1000 m/s, in a section 1200 m wide and 600 m deep; receivers
# along the ground, down the canyon's wall and up again.

RADIUS, DEPTH = 100.0, 600.0  # m


def depth_of_ground(x):
    """Depth of the ground below the level of the canyon's edges [m]."""
    return np.sqrt(np.maximum(RADIUS**2 - x**2, 0.0))


scene = Scene.load(Path(__file__).with_name("canyon.toml"))
wall = RADIUS * np.sin(np.deg2rad(np.arange(-90, 91, 10)))
level = np.arange(125.0, 401.0, 25.0)
across = np.concatenate([-level[::-1], wall, level])
height = DEPTH - depth_of_ground(across)
places = {f"r{n}": [x, y] for n, (x, y) in enumerate(zip(across, height, strict=True))}
scene = Scene.from_dict(scene.data | {"output": {"receivers": places}}, scene.folder)
result = simulate(scene)
lapse = result.lapses[0]
acceleration = lapse.total_acceleration[:, 0] / GRAVITY
outcrop = np.abs(result.outcrop_acceleration).max() / GRAVITY
print(f"peak acceleration up to 5 Hz, level rock      {outcrop:.2f} g")
for name, x in (("canyon's bottom", 0.0), ("canyon's edge", RADIUS), ("300 m beside", 4 * RADIUS)):
    peak = np.abs(acceleration[np.abs(across - x).argmin()]).max()
    print(f"peak acceleration up to 5 Hz, {name:<15} {peak:.2f} g")

# ## Theory
#
# Level ground would move by 2 cos(ky) of what comes up; in polar coordinates round the middle of
# the canyon that is J_0(kr) and the J_2n(kr) cos(2nθ). The canyon's wall is free of traction: to
# each of them belongs a wave that leaves, H_2n(kr) cos(2nθ), of a size that takes the traction
# away (Trifunac 1973; here with e^{+iωt}, so with H of the second kind). Damping makes k complex.


def trifunac(x, frequency):
    """Motion of the ground over the outcrop motion at the base, shape ``(len(x), len(f))``."""
    rock = scene.soil["rock"]
    speed = rock.shear_wave_velocity * np.sqrt(1 + 2j * rock.damping)
    k = 2 * np.pi * frequency / speed
    below = depth_of_ground(x)[:, None]
    r, angle = np.hypot(x[:, None], below), np.arctan2(below, x[:, None])
    motion = 2 * np.cos(k * below)
    for n in range(0, 24, 2):
        size = (2 if n == 0 else 4) * jvp(n, k * RADIUS) / h2vp(n, k * RADIUS)
        motion = motion - size * hankel2(n, k * r) * np.cos(n * angle)
    # Over the wave that comes up through the origin; an outcrop motion is twice that wave, and it
    # is taken at the base, DEPTH earlier on the way.
    return motion / 2 * np.exp(-1j * k * DEPTH)


solved = lapse.frequency > 0  # at rest all moves alike
theory = trifunac(across, lapse.frequency[solved])
computed = lapse.transfer[:, 0, 0, solved]
error = np.abs(computed - theory).max(axis=0) / np.abs(theory).max(axis=0)
print(f"largest difference from theory: {100 * error.max():.1f} % of the line's peak, 0 to 5 Hz")

# ## One figure

figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5), layout="constrained")
fine = np.concatenate([np.linspace(-400, -100, 200), 100 * np.sin(np.linspace(-1.57, 1.57, 200))])
fine = np.concatenate([fine, -fine[199::-1]])
for wanted, color in ((1.25, "#0072B2"), (2.5, "#D55E00"), (5.0, "#009E73")):
    line = np.abs(lapse.frequency - wanted).argmin()
    frequency = lapse.frequency[[line]]
    ratio = np.abs(lapse.transfer[:, 0, 0, line])
    left.plot(across, ratio, "o", color=color, ms=4, label=f"{frequency[0]:.2f} Hz")
    left.plot(fine, np.abs(trifunac(fine, frequency)), color=color, lw=1)
left.plot([], [], color="0.3", lw=1, label="Trifunac (1973)")
left.axvspan(-RADIUS, RADIUS, color="0.94", zorder=0)
left.set(xlim=(-400, 400), ylim=(0, None), xlabel="x [m]", ylabel="|motion / outcrop motion| [-]")
left.legend(frameon=False)
along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(across), np.diff(height)))])
along -= along.mean()
shown = (result.time > 2.0) & (result.time < 8.0)
for distance, history in zip(along, acceleration, strict=True):
    wiggle = distance + 130 * history[shown]
    right.plot(result.time[shown], wiggle, color="#222222", lw=0.7)
right.axhspan(-RADIUS * np.pi / 2, RADIUS * np.pi / 2, color="0.94", zorder=0)
right.set(
    xlim=(2, 8), xlabel="Time [s]", ylabel="Distance along the ground [m]; 0.5 g is 65 m high"
)
figure.savefig(Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "demo_canyon.png", dpi=150)

# Dashpots send back a little of what meets them at a slant: a few per cent, less in a wider
# section. The mesh adds less.

assert error.max() < 0.05
