# SPDX-License-Identifier: MIT
# # A level site on rock, under a record of bare rock
#
# This demo shows how to:
#
# - shake a site by a record that was measured on rock at the surface: an outcrop motion on a
#   compliant base;
# - tell the three motions of the rock apart: outcrop, within the ground, and of the surface;
# - check the result against theory: with the moduli that the equivalent-linear loop has found, the
#   site is a stack of layers on a half-space, whose transfer functions have a closed form.
#
# The same scene runs on the command line, `hytf run level_site.toml`, which writes a report.

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from fenics_hytf import Scene, simulate
from fenics_hytf.motion import GRAVITY, default_periods, response_spectrum

# ## The scene
#
# 38 m of fill, clay, sand, stiff clay and gravel, one degree-2 cell a metre, on rock of 1000 m/s;
# the record of Pacoima Dam, Northridge 1994, scaled to 0.2 g on bare rock.

scene = Scene.load(Path(__file__).with_name("level_site.toml"))
result = simulate(scene)
lapse = result.lapses[0]
cells = lapse.cells

# ## Three motions
#
# The outcrop motion is what the record holds: twice the wave that comes up. At the base of the
# ground the same wave comes up, but what comes down again is what the ground sends back: the
# motion there ("within") is smaller near the site's own frequencies.

surface = lapse.total_acceleration[result.receivers.index("surface"), 0]
within, outcrop = result.within_acceleration[0], result.outcrop_acceleration[0]
for name, motion in (("outcrop", outcrop), ("within", within), ("surface", surface)):
    print(f"peak acceleration, {name:<8} {np.abs(motion).max() / GRAVITY:.3f} g")
print("iterations:", len(lapse.loop.change), " last change:", f"{lapse.loop.change[-1]:.1e}")
print(f"smallest G/Gmax {cells.g_over_gmax.min():.2f}, largest D {100 * cells.damping.max():.1f} %")

# ## Theory
#
# In each layer waves go up and down, with amplitudes a and b at its top. Displacement and stress
# are continuous from layer to layer and into the rock; nothing pulls at the surface, where a = b
# (Kramer 1996, section 7.2). Bare rock moves by twice the wave that comes up through it, a; the
# base of the ground by a + b. Cells of the column are numbered from the top.


def layers_on_rock(frequency, thickness, density, modulus):
    """Surface and base over the outcrop; G* and density from the top down, the rock last."""
    omega = 2 * np.pi * frequency
    speed = np.sqrt(modulus / density)
    impedance = density * speed
    up = down = np.ones(len(omega), complex)
    for layer, height in enumerate(thickness):
        phase = np.exp(1j * omega * height / speed[layer])
        ratio = impedance[layer] / impedance[layer + 1]
        up, down = (
            0.5 * up * (1 + ratio) * phase + 0.5 * down * (1 - ratio) / phase,
            0.5 * up * (1 - ratio) * phase + 0.5 * down * (1 + ratio) / phase,
        )
    return 1 / up, (up + down) / (2 * up)


rock = scene.boundary.rock
density = [scene.soil[result.region_names[region]].density for region in cells.region]
density = np.array([*density, rock.density])
modulus = cells.shear_modulus * (1 + 2j * cells.damping)
rock_modulus = rock.density * rock.shear_wave_velocity**2 * (1 + 2j * rock.damping)
theory = layers_on_rock(lapse.frequency, np.ones(38), density, np.append(modulus, rock_modulus))
computed = [lapse.transfer[result.receivers.index(name), 0, 0] for name in ("surface", "base")]
errors = [
    np.abs(found - exact).max() / np.abs(exact).max()
    for found, exact in zip(computed, theory, strict=True)
]
print(f"surface over outcrop against theory: {100 * errors[0]:.3f} % of its peak")
print(f"within over outcrop against theory:  {100 * errors[1]:.3f} % of its peak")

# ## One figure

figure, axes = plt.subplots(1, 3, figsize=(13, 4.5), layout="constrained")
colors = {"outcrop": "0.45", "within": "#0072B2", "surface": "#D55E00"}
names = ("surface", "within")
for name, found, exact in zip(names, computed, theory, strict=True):
    color = colors[name]
    axes[0].semilogx(lapse.frequency, np.abs(found), color=color, alpha=0.4, lw=4, label=name)
    axes[0].semilogx(lapse.frequency, np.abs(exact), "k--", lw=1)
axes[0].plot([], [], "k--", lw=1, label="layers on a half-space")
axes[0].set(
    xlim=(0.1, 25), ylim=(0, None), xlabel="Frequency [Hz]", ylabel="|motion / outcrop motion| [-]"
)
axes[0].legend(frameon=False, loc="lower left")
periods = default_periods()
for name, motion in (("outcrop", outcrop), ("within", within), ("surface", surface)):
    spectrum = response_spectrum(motion, result.dt, periods) / GRAVITY
    axes[1].semilogx(periods, spectrum, color=colors[name], lw=2, label=name)
axes[1].set(
    xlim=(0.04, 5), ylim=(0, None), xlabel="Period [s]", ylabel="Pseudo-acceleration, 5 % [g]"
)
axes[1].legend(frameon=False)
depth = np.arange(39)
axes[2].stairs(
    cells.g_over_gmax, depth, orientation="horizontal", baseline=None, lw=2, color="#0072B2"
)
axes[2].stairs(cells.damping, depth, orientation="horizontal", baseline=None, lw=2, color="#D55E00")
axes[2].text(0.62, 24, "$G/G_{max}$", color="#0072B2", ha="right", va="center")
axes[2].text(0.09, 24, "$D$", color="#D55E00", va="center")
below = 0.0
for layer in scene.mesh.column.layers:
    if below:
        axes[2].axhline(below, color="0.8", lw=0.8, zorder=0)
    middle = below + layer.thickness / 2
    axes[2].text(1.03, middle, layer.soil.replace("_", " "), va="center", clip_on=False)
    below += layer.thickness
axes[2].set(xlim=(0, 1), ylim=(38, 0), xlabel="Ratio [-]", ylabel="Depth [m]")
figure.savefig(Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "demo_level_site.png", dpi=150)

# Four cells and more of degree 2 to the shortest wave, in the softened clay: the mesh's error stays
# below half a per cent of the peak over the whole band.

assert max(errors) < 5e-3
assert np.abs(outcrop - result.base_acceleration[0]).max() < 1e-3 * np.abs(outcrop).max()
