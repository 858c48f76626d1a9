# SPDX-License-Identifier: MIT
# # A column that many cycles wear down
#
# This demo shows how to:
#
# - let the cycles that the soil went through lower its stiffness from lapse to lapse;
# - check that lapses hand over to each other: the same stiffness, constant over each lapse, in one
#   finely stepped integration in time from beginning to end;
# - see how many lapses the answer takes.
#
# The same scene runs on the command line: `hytf run degrading_column.toml`.

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from fenics_hytf import Scene, simulate

# ## The scene
#
# 30 m of soft clay under 40 cycles of 1 m/s² at 1 Hz, in 2, 5, 10, 20 and 40 lapses: 40 is one
# lapse a cycle. In one lapse nothing degrades.

HEIGHT, CELLS, SPEED, DENSITY = 30.0, 10, 140.0, 1700.0
ALPHA, BETA = 0.3, 0.003  # of C = αM + βK
COUNTS = (2, 5, 10, 20, 40)

scene = Scene.load(Path(__file__).with_name("degrading_column.toml"))


def run(count):
    """The scene in so many lapses."""
    data = {**scene.data, "lapses": {**scene.data["lapses"], "count": count}}
    if count == 1:
        data["effects"] = {"rayleigh": data["effects"]["rayleigh"]}
    return simulate(Scene.from_dict(data, scene.folder))


# ## The same ground, step by step
#
# Ten linear elements with consistent mass, M ü + C u̇ + ∫Bᵀ(Gγ + σ_q) dy = −M r a, by Newmark's
# average acceleration, 16 steps a sample. The moduli are those that the run has found, constant
# over each lapse. Displacement and velocity go over a seam as they are. So does the stress: what
# the new modulus would change in it, σ_q += (G_old − G_new)γ, stays for the moment and fades with
# 0.5 s. Viscous damping remembers nothing, so that this is all there is to carry.

FADING = 0.5  # s
SIZE = HEIGHT / CELLS
B = (np.eye(CELLS) - np.eye(CELLS, k=-1)) / SIZE  # strain of each element; the base is at rest
CONSISTENT = np.diag(np.full(CELLS, 4.0)) + np.eye(CELLS, k=1) + np.eye(CELLS, k=-1)
CONSISTENT[-1, -1] = 2.0
MASS = DENSITY * SIZE / 6 * CONSISTENT
LOAD = DENSITY * SIZE * np.append(np.ones(CELLS - 1), 0.5)


def newmark(moduli, num_samples, dt, steps):
    """Displacement relative to the base [m], shape ``(CELLS, len(moduli) * num_samples)``.

    Moduli are those of the elements from the base up, a row a lapse [Pa].
    """
    h = dt / steps
    u, v, rest = np.zeros((3, CELLS))
    found = []
    for lapse, modulus in enumerate(moduli):
        if lapse:
            rest = rest * np.exp(-num_samples * dt / FADING) + (moduli[lapse - 1] - modulus) * (
                B @ u
            )
        K = B.T @ (SIZE * modulus[:, None] * B)
        C = ALPHA * MASS + BETA * K
        time = h * np.arange(num_samples * steps + 1)
        base = np.sin(2 * np.pi * (lapse * num_samples * dt + time))
        force = -np.outer(base, LOAD) - np.outer(np.exp(-time / FADING), SIZE * B.T @ rest)
        a = np.linalg.solve(MASS, force[0] - C @ v - K @ u)
        inverse = np.linalg.inv(MASS + 0.5 * h * C + 0.25 * h**2 * K)
        for step in range(num_samples * steps):
            if step % steps == 0:
                found.append(u)
            u, v = u + h * v + 0.25 * h**2 * a, v + 0.5 * h * a
            a = inverse @ (force[step + 1] - C @ v - K @ u)
            u, v = u + 0.25 * h**2 * a, v + 0.5 * h * a
    return np.array(found).T


def moduli_of(result):
    """Shear moduli from the base up, a row a lapse [Pa]."""
    upwards = np.argsort(result.lapses[0].cells.centroid[:, 1])
    return np.array([lapse.cells.shear_modulus[upwards] for lapse in result.lapses])


# ## Lapses against steps

print("lapses   G/Gmax     surface's peak   off Newmark  Newmark, a step  jump at    energy")
print("         at the end    cm       at s    1/16, %     a sample, %    seams     off by")
results, references, peaks, errors = {}, {}, {}, {}
for count in (1, *COUNTS):
    result = results[count] = run(count)
    moduli, size = moduli_of(result), result.lapses[0].num_samples
    u = result.history("displacement")[0, 0]
    fine, coarse = (newmark(moduli, size, result.dt, steps)[-1] for steps in (16, 1))
    references[count], peaks[count] = fine, np.abs(u).max()
    errors[count], march = (np.abs(x - fine).max() / np.abs(fine).max() for x in (u, coarse))
    seam = max((lapse.seam_error for lapse in result.lapses[1:]), default=0.0)
    ledger = [lapse.energy for lapse in result.lapses]
    energy = abs(sum(e.imbalance for e in ledger)) / sum(e.input for e in ledger)
    print(
        f"{count:6}{moduli[-1].min() / (DENSITY * SPEED**2):11.3f}{100 * peaks[count]:12.2f}"
        f"{np.abs(u).argmax() * result.dt:9.2f}{100 * errors[count]:11.4f}{100 * march:16.2f}"
        f"{seam:14.0e}{energy:10.0e}"
    )

# ## How many lapses?
#
# A lapse's cycles soften the next one only: with few lapses the ground is too stiff for too long.
# The peak is late by one lapse, so its error halves where the number doubles, once a lapse is
# short beside the time in which the ground changes. Twice the last peak less the one before is an
# estimate of what an infinity of lapses would come to.

limit = 2 * peaks[40] - peaks[20]
short = {count: 1 - peaks[count] / limit for count in (1, *COUNTS)}
print(f"\npeak with ever more lapses, estimated: {100 * limit:.1f} cm; short of it by, %:")
print("  ".join(f"{count}: {100 * value:.0f}" for count, value in short.items()))

# ## One figure

COLORS = dict(zip(COUNTS, ("#E69F00", "#D55E00", "#CC79A7", "#0072B2", "#009E73"), strict=True))
figure, axes = plt.subplot_mosaic(
    [["5", "5", "5"], ["20", "20", "20"], ["z", "G", "p"]],
    figsize=(12, 8.5),
    layout="constrained",
    height_ratios=(1, 1, 1.35),
)
time = result.time
for count in (5, 20):
    axis, length = axes[str(count)], 40.0 / count
    u = results[count].history("displacement")[0, 0]
    axis.plot(time, 100 * u, color=COLORS[count], lw=2.6, alpha=0.75, label="lapses")
    axis.plot(time, 100 * references[count], "k", lw=0.7, label="Newmark, 1/16 of a sample")
    for start in np.arange(0, 40, 2 * length):
        axis.axvspan(start, start + length, color="0.94", zorder=0, lw=0)
    axis.set(xlim=(0, 40), ylim=(-34, 34), xlabel="Time [s]", ylabel="Surface [cm]")
    axis.text(0.4, 27, f"{count} lapses", color=COLORS[count], weight="bold", va="center")
    axis.legend(frameon=False, ncols=2, loc=(0.09, 0.83))
seam, zoom = 24.0, axes["z"]
near = np.abs(time - seam) < 1.3
u = results[5].history("displacement")[0, 0]
zoom.plot(time[near], 100 * references[5][near], "k", lw=0.9, label="Newmark")
zoom.plot(
    time[near], 100 * u[near], "o", color=COLORS[5], ms=4, mew=0, label="lapses, every sample"
)
zoom.axvline(seam, ymax=0.86, color="0.35", lw=0.8, ls=(0, (4, 3)), zorder=0)
zoom.set(title="A seam of five lapses", xlabel="Time [s]", ylabel="Surface [cm]", ylim=(-20, 28))
zoom.legend(frameon=False, ncols=2, loc="upper center", columnspacing=1)
for count in COUNTS[:-1]:
    ratio = moduli_of(results[count]).min(axis=1) / (DENSITY * SPEED**2)
    edges = np.linspace(0, 40, count + 1)
    axes["G"].stairs(ratio, edges, baseline=None, color=COLORS[count], lw=2, label=f"{count}")
axes["G"].set(xlim=(0, 40), xlabel="Time [s]", ylabel="$G/G_{max}$ of the lowest cell [-]")
axes["G"].set_title("What the cycles leave of the stiffness")
axes["G"].legend(frameon=False, title="lapses")
axes["p"].axhline(100 * limit, color="0.35", lw=0.9, ls=(0, (4, 3)))
axes["p"].text(1, 100 * limit + 0.6, "ever more lapses, estimated", color="0.35")
axes["p"].semilogx(list(peaks), [100 * peak for peak in peaks.values()], "-", color="0.6", zorder=1)
for count, peak in peaks.items():
    axes["p"].plot(count, 100 * peak, "o", color=COLORS.get(count, "k"), ms=8)
for count, reference in references.items():
    axes["p"].plot(count, 100 * np.abs(reference).max(), "k+", ms=13, mew=1)
axes["p"].plot([], [], "k+", ms=10, label="Newmark with the same moduli")
axes["p"].legend(frameon=False, loc="lower right")
axes["p"].set(xlabel="Number of lapses", ylabel="Peak of the surface [cm]", ylim=(0, 36))
axes["p"].set_xticks([1, *COUNTS], [str(count) for count in (1, *COUNTS)], minor=False)
axes["p"].minorticks_off()
axes["p"].set_title("How many lapses the answer takes")
for axis in axes.values():
    axis.spines[["top", "right"]].set_visible(False)
figure.savefig(
    Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "demo_degrading_column.png", dpi=110
)

# A thousandth of the peak, over every number of lapses; and more lapses come nearer.

assert max(errors.values()) < 1e-3
assert all(short[a] > short[b] for a, b in zip((1, *COUNTS), COUNTS, strict=False))
