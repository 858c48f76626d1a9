# SPDX-License-Identifier: MIT
# # Lapses that go on: the paper's column of real soils under a steady harmonic
#
# This demo shows how to:
#
# - run every step of the paper's flow chart on its column, with soils whose published curves make
#   stiffness and damping follow the strain of each lapse, while the material points move;
# - let lapses go on from each other ("transient"): displacement, velocity, stress and what the
#   soil remembers pass over every seam, wherever in a cycle it falls;
# - read what a lapse says about itself: the jump at its seam and its energy ledger;
# - check where it all ends: in the steady state, which has a closed form.
#
# The same scene runs on the command line: `hytf run harmonic_lapses.toml`.

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from fenics_hytf import Scene, simulate
from fenics_hytf.soil import maxwell_factor

# ## The scene
#
# 50 m of clay (Vucetic and Dobry 1991) on 50 m of sand (Darendeli 2001) in the paper's 20 quads,
# from rest under 0.5 m/s² at 0.6 Hz, 40 cycles in 7 lapses: a seam is never at the end of a cycle.

AMPLITUDE, FREQUENCY = 0.5, 0.6  # m/s^2, Hz
OMEGA = 2 * np.pi * FREQUENCY

scene = Scene.load(Path(__file__).with_name("harmonic_lapses.toml"))
moved = []
result = simulate(scene, snapshot=lambda shot: moved.append(shot.points["displacement"]))
lapses = result.lapses
work = result.work
print(
    f"lapses: {len(lapses)} of {lapses[0].num_samples * result.dt:.3g} s, {result.dt:.4g} s a step"
)
print(f"mass weighed {work.assemblies['mass']} times, {work.excited_lines} lines solved")
print(f"points moved and found again: {work.inverse_mappings}, none lost")

# ## What each lapse says
#
# The loop starts from the strain of the lapse before: soon there is nothing left to change. The
# jump is that of displacement and velocity at the seam over their peaks. Energies are per metre
# across the section: what the base put in, and what was lost in the soil; the rest of stress that
# stays where moduli have changed fades and gives up a little; what is left is stored.

print()
print("lapse  passes  G/Gmax   D,   points moved,    jump at   input   lost   rest  stored  off by")
print("                   least    %   m at its end   its seam    kJ/m   kJ/m   kJ/m    kJ/m")
for lapse, displacement in zip(lapses, moved, strict=True):
    cells, energy = lapse.cells, lapse.energy
    seam = "-" if lapse.seam_error is None else f"{lapse.seam_error:.0e}"
    stored = energy.stored[1] - energy.stored[0]
    print(
        f"{lapse.index + 1:5}{len(lapse.loop.change):8}{cells.g_over_gmax.min():9.3f}"
        f"{100 * cells.damping.max():6.1f}{np.abs(displacement).max():14.3f}{seam:>12}"
        f"{energy.input / 1e3:8.1f}{energy.damping / 1e3:7.1f}{energy.rest / 1e3:7.2f}"
        f"{stored / 1e3:8.1f}{abs(energy.imbalance) / energy.input:9.0e}"
    )

# ## Theory
#
# With the moduli that the last lapse has found the column is a stack of layers; in the steady state
# waves of one frequency go up and down in each (Kramer 1996, section 7.2). Cells are numbered from
# the top. Under the Maxwell law a modulus at the frequency of the shaking is G times a factor
# close to 1 + 2iD. Motions are the imaginary parts of their amplitudes times e^{iωt}.


def steady_amplitudes(thickness, density, modulus):
    """Displacement relative to the base [m] at the tops of all layers, from the top down."""
    speed = np.sqrt(modulus / density)
    impedance = density * speed
    up = down = 1.0 + 0.0j
    total = []
    for layer, height in enumerate(thickness):
        total.append(up + down)
        phase = np.exp(1j * OMEGA * height / speed[layer])
        ratio = impedance[layer] / impedance[min(layer + 1, len(thickness) - 1)]
        up, down = (
            0.5 * up * (1 + ratio) * phase + 0.5 * down * (1 - ratio) / phase,
            0.5 * up * (1 - ratio) * phase + 0.5 * down * (1 + ratio) / phase,
        )
    over_base = np.array(total) / (up + down)
    return -AMPLITUDE / OMEGA**2 * (over_base - 1)


def theory_of(cells):
    """Steady displacement of the surface and the middle with the moduli of a lapse, all samples."""
    density = np.array([scene.soil[result.region_names[r]].density for r in cells.region])
    modulus = cells.shear_modulus * maxwell_factor(cells.damping, 1j * OMEGA, FREQUENCY)
    amplitude = steady_amplitudes(np.full(20, 5.0), density, modulus)[[0, 10]]
    return np.imag(amplitude[:, None] * np.exp(1j * OMEGA * result.time))


u = result.history("displacement")[:, 0]
theory = theory_of(lapses[-1].cells)
peak = np.abs(theory).max()
starts = [round(lapse.start_time / result.dt) for lapse in lapses]
off = np.array([np.abs(u - theory)[:, n:].max() for n in starts]) / peak
print("\noff the steady state from each lapse on, %:", (100 * off).round(2))

# The steady state itself, by the paper's continuity: one lapse, one line, its own loop. Its moduli
# are those which the transient lapses have come to by themselves.

changes = {"lapses": {"count": 1, "continuity": "steady"}}
steady = simulate(Scene.from_dict(scene.data | changes, scene.folder)).lapses[0]
moduli = np.abs(lapses[-1].cells.shear_modulus / steady.cells.shear_modulus - 1).max()
peaks = np.abs(u[:, starts[-1] :]).max(axis=1) / np.abs(steady.displacement[:, 0]).max(axis=1)
print(f"moduli of the last lapse off those of the steady lapse: {100 * moduli:.2f} %")
print(
    f"peaks of the last lapse off those of the steady lapse:  {100 * np.abs(peaks - 1).max():.2f} %"
)

# ## One figure

BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"
figure, axes = plt.subplot_mosaic(
    [["u", "u", "u"], ["a", "a", "a"], ["z", "G", "E"]],
    figsize=(12, 8.5),
    layout="constrained",
    height_ratios=(1, 1, 1.35),
)
acceleration = result.history("total_acceleration")[:, 0]
seams = [lapse.start_time for lapse in lapses[1:]]
ends = [0.0, *seams, result.time[-1]]
for name, history in (("u", 100 * u), ("a", acceleration)):
    for place, color in ((0, ORANGE), (1, BLUE)):
        label = ("surface", "mid-height")[place]
        axes[name].plot(result.time, history[place], color=color, lw=1.3, label=label)
    for number in range(0, len(lapses), 2):
        axes[name].axvspan(ends[number], ends[number + 1], color="0.94", zorder=0, lw=0)
    axes[name].set(xlim=(0, result.time[-1]), xlabel="Time [s]")
for lapse in lapses:
    middle = lapse.start_time + 0.5 * lapse.num_samples * result.dt
    axes["u"].text(middle, 21.5, f"lapse {lapse.index + 1}", ha="center", va="center", color="0.4")
for sign in (-1, 1):
    level = 100 * sign * np.abs(theory[0]).max()
    label = "steady state, closed form" if sign > 0 else None
    axes["u"].axhline(level, color="k", lw=0.9, ls=":", label=label)
axes["u"].set(ylim=(-20, 24), ylabel="Displacement [cm]")
axes["a"].set_ylabel("Total acceleration [m/s²]")
figure.legend(
    *axes["u"].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False
)
near = np.abs(result.time - seams[-1]) < 1.25 / FREQUENCY
zoom = axes["z"]
for place, color in ((0, ORANGE), (1, BLUE)):
    zoom.plot(result.time[near], 100 * theory[place, near], color="k", lw=0.9, zorder=3)
    zoom.plot(result.time[near], 100 * u[place, near], "o", color=color, ms=3.5, mew=0)
zoom.axvline(seams[-1], ymax=0.86, color="0.35", lw=0.8, ls=(0, (4, 3)), zorder=0)
zoom.plot([], [], "k", lw=0.9, label="closed form")
zoom.plot([], [], "o", color="0.5", ms=3.5, label="every sample")
zoom.set(
    title="The last seam, sample by sample",
    xlabel="Time [s]",
    ylabel="Displacement [cm]",
    ylim=(-18, 24),
)
zoom.legend(frameon=False, ncols=2, loc="upper center", columnspacing=1)
colors = plt.get_cmap("viridis")(np.linspace(0, 0.85, 3))
for number, color in zip((0, 1, 6), colors, strict=True):
    style = {"lw": 1.4, "ls": "--", "color": "k"} if number == 6 else {"lw": 2.5, "color": color}
    axes["G"].stairs(
        lapses[number].cells.g_over_gmax,
        np.arange(0, 101, 5),
        orientation="horizontal",
        baseline=None,
        label=f"lapse {number + 1}",
        **style,
    )
axes["G"].axhline(50, color="0.7", lw=0.8, zorder=0)
axes["G"].text(0.98, 48, "clay", ha="right", color="0.4")
axes["G"].text(0.98, 56, "sand", ha="right", color="0.4")
axes["G"].set(xlim=(0, 1), ylim=(100, 0), xlabel="$G/G_{max}$ [-]", ylabel="Depth [m]")
axes["G"].set_title("Stiffness that each lapse found")
axes["G"].legend(frameon=False, loc="lower left")
ledger = [lapse.energy for lapse in lapses]
number = np.arange(1, len(lapses) + 1)
entered = np.array([energy.input for energy in ledger]) / 1e3
lost = np.array([energy.damping + energy.rest for energy in ledger]) / 1e3
gain = np.array([energy.stored[1] - energy.stored[0] for energy in ledger]) / 1e3
for shift, below, above, color, label in (
    (-0.2, entered, -gain, BLUE, "put in by the base"),
    (0.2, lost, gain, ORANGE, "lost in the soil"),
):
    axes["E"].bar(number + shift, below, 0.36, color=color, label=label)
    axes["E"].bar(number + shift, np.maximum(above, 0), 0.36, bottom=below, color=GREEN)
axes["E"].bar([0], [0], color=GREEN, label="taken from or left in store")
axes["E"].set(xlim=(0.4, 7.6), ylim=(0, 430), xticks=number, xlabel="Lapse", ylabel="Energy [kJ/m]")
axes["E"].set_title("Both sides of the ledger")
axes["E"].legend(frameon=False)
for axis in axes.values():
    axis.spines[["top", "right"]].set_visible(False)
figure.savefig(
    Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "demo_harmonic_lapses.png", dpi=110
)

# Nothing jumps, nothing is lost, and the start is forgotten: 1 % of the closed form.

assert max(lapse.seam_error for lapse in lapses[1:]) < 1e-3
assert max(abs(lapse.energy.imbalance) / lapse.energy.input for lapse in lapses) < 1e-3
assert off[-1] < 0.01 < off[0]
assert moduli < 0.01 and np.abs(peaks - 1).max() < 0.01
assert lapses[-1].ledger.imbalance == 0
assert work.inverse_mappings == len(lapses) * result.sizes["points"]
