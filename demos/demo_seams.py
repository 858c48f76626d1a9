# SPDX-License-Identifier: MIT
# # What a seam costs, and what the law that can cross it changes
#
# This demo shows how to:
#
# - cut one motion into five lapses that go on from each other, and measure what the seams cost
#   beside one lapse: with dashpots, in a section and a solid, with points that move;
# - check five lapses with the equivalent-linear loop inside against an integration in time;
# - choose between the hysteretic law and the causal "maxwell", which are not the same: peaks as
#   high, but higher modes at higher frequencies.
#
# The same scene runs on the command line: `hytf run seams.toml`.

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from scipy.linalg import expm
from scipy.signal import resample

from fenics_hytf import Scene, simulate
from fenics_hytf.soil import RELAXATION_TIMES, branch_weights, maxwell_factor, relaxed_factor

SCENE = Scene.load(Path(__file__).with_name("seams.toml"))
LAPSES = 5


def run(count=LAPSES, scale=1.0, **sections):
    """The scene with other sections, its motion scaled, in so many lapses."""
    motion = {**SCENE.data["motion"][0], "scale": scale}
    data = {**SCENE.data, "motion": [motion], **sections, "lapses": {"count": count}}
    data["lapses"]["continuity"] = "transient"
    return simulate(Scene.from_dict(data, SCENE.folder))


def off(found, expected, scale=1.0):
    """Largest difference of displacement over the peak, and rms of that of acceleration."""
    u, a = (
        (found.history(n), scale * expected.history(n)) for n in ("displacement", "acceleration")
    )
    rms = np.sqrt(np.mean((a[0] - a[1]) ** 2) / np.mean(a[1] ** 2))
    return np.abs(u[0] - u[1]).max() / np.abs(u[1]).max(), rms


# ## Five lapses against one
#
# The column of the scene; on rock; a section with a slanted lens and a solid, both between
# dashpots. None of it changes at the seams, so that one lapse is what five should come to.

ROCK = {"density": 2200.0, "shear_wave_velocity": 760.0, "poisson": 0.25}
ON_ROCK = [{**SCENE.data["motion"][0], "input": "outcrop"}]
SOFT = {**SCENE.data["soil"]["soil"], "shear_wave_velocity": 120.0, "damping": 0.08}
SOILS = {"soil": {**SCENE.data["soil"], "soft": SOFT}}
LENS = [[8.0, 6.0], [20.0, 3.0], [40.0, 10.0], [30.0, 14.0]]
DIRECT = {"solver": {**SCENE.data["solver"], "sweep": "direct"}}  # faster where it is small
SECTION = {
    **SOILS,
    **DIRECT,
    "mesh": {
        "box": {"size": [48.0, 24.0], "cells": [12, 6], "cell": "quadrilateral"},
        "regions": [{"soil": "soft", "polygon": LENS}, {"soil": "soil"}],
    },
    "boundary": {"left": "dashpot", "right": "dashpot"},
    "output": {"receivers": {"crest": [24.0, 24.0], "side": [48.0, 12.0]}},
}
SOLID = {
    **SOILS,
    **DIRECT,
    "mesh": {
        "box": {"size": [16.0, 8.0, 12.0], "cells": [3, 2, 4], "cell": "hexahedron"},
        "regions": [{"soil": "soil", "below": 6.0}, {"soil": "soft"}],
    },
    "boundary": dict.fromkeys(("left", "right", "front", "back"), "dashpot"),
    "output": {"receivers": {"crest": [4.0, 2.0, 12.0], "middle": [8.0, 4.0, 6.0]}},
}
SIDES = {"left": "tied", "right": "tied"}
HYSTERETIC = {"solver": {"complex_modulus": "hysteretic"}}
CASES = {
    "column, maxwell 5 %": {},
    "column on rock (dashpots at the base)": {
        "motion": ON_ROCK,
        "boundary": {**SIDES, "base": {"compliant": ROCK}},
    },
    "column, hysteretic 5 % (the whole record in every lapse)": HYSTERETIC,
    "section between dashpots": SECTION,
    "section between dashpots, on rock": {
        **SECTION,
        "motion": ON_ROCK,
        "boundary": {**SECTION["boundary"], "base": {"compliant": ROCK}},
    },
    "solid between dashpots": SOLID,
}
print(f"{f'{LAPSES} lapses against one, nothing changing at the seams':62}    u, %  a rms, %")
whole, cost = {name: run(1, **sections) for name, sections in CASES.items()}, {}
for name, sections in CASES.items():
    cost[name] = off(run(**sections), whole[name])
    print(f"  {name:60}{100 * cost[name][0]:8.4f}{100 * cost[name][1]:9.3f}")

# ## Points that move
#
# Now the points take their displacement along at every seam, and strain, stress and memory turn
# with them. One lapse knows nothing of that; the difference is what the moving is worth, and it
# has to vanish with the strain.

print(f"\n{'the same with points that move, against one lapse':62}    u, %  a rms, %")
moving = {}
for name in ("column, maxwell 5 %", "section between dashpots"):
    for scale in (0.01, 0.1, 1.0):
        found = run(scale=scale, effects={"convection": True}, **CASES[name])
        strain = max(lapse.cells.peak_strain.max() for lapse in found.lapses)
        moving[name, scale] = off(found, whole[name], scale)  # one lapse is linear
        said = f"{name}, {scale * 0.1:g} g: strain up to {100 * strain:.2g} %"
        print(f"  {said:60}{100 * moving[name, scale][0]:8.4f}{100 * moving[name, scale][1]:9.3f}")

# ## The sweep on the damped contour
#
# Towards the end of a lapse an error of its lines has grown by e^{ηT} = 10. The reduced sweep takes
# that into account; here it is beside the direct one, which solves every line by itself.

print(f"\n{'reduced sweep against direct, 5 lapses of the section':62}    u, %  a rms, %")
direct = run(**SECTION)
sweeps = {}
for tolerance in (1e-3, 1e-6):
    found = run(**{**SECTION, "solver": {**SCENE.data["solver"], "tolerance": tolerance}})
    sweeps[tolerance] = off(found, direct)
    said = f"tolerance {tolerance:.0e}: {found.work.factorisations} factorisations for "
    said += f"{direct.work.factorisations}"
    print(f"  {said:60}{100 * sweeps[tolerance][0]:8.0e}{100 * sweeps[tolerance][1]:9.0e}")

# ## The loop inside
#
# With curves every lapse finds moduli of its own, and every seam changes them. The moduli that five
# lapses have found, fixed, in an integration in time: a spring and four Maxwell branches in each of
# 20 elements, ζ̇_m = γ̇ − ζ_m/τ_m, and the rest of stress that the seams leave, which fades with
# 0.5 s. Within a lapse that is ẋ = Ax + ba, stepped by e^{Ah}, eight steps a sample.

CELLS, SIZE, DENSITY, FADING = 20, 2.0, 1850.0, 0.5
TAU = np.array([*RELAXATION_TIMES, FADING])
B = (np.eye(CELLS) - np.eye(CELLS, k=-1)) / SIZE
MASS = DENSITY * SIZE / 6 * (4 * np.eye(CELLS) + np.eye(CELLS, k=1) + np.eye(CELLS, k=-1))
MASS[-1, -1] /= 2
LOAD = DENSITY * SIZE * np.append(np.ones(CELLS - 1), 0.5)


def integrate(stages, acceleration, dt, num_samples, steps=8):
    """Displacement of the nodes; moduli and damping ratios of the elements, a pair a lapse."""
    u, v, *memories = (slice(n * CELLS, (n + 1) * CELLS) for n in range(7))
    x, before, found = np.zeros(7 * CELLS), None, []
    values = resample(np.pad(acceleration, (0, len(acceleration))), 2 * steps * len(acceleration))
    for number, (modulus, damping) in enumerate(stages):
        relaxed = modulus * relaxed_factor(damping, 1.0)
        shares = np.column_stack([relaxed[:, None] * branch_weights(damping), np.ones(CELLS)])
        stress = np.zeros((CELLS, 7 * CELLS))
        stress[:, u] = relaxed[:, None] * B
        for m, memory in enumerate(memories):
            stress[:, memory] = np.diag(shares[:, m])
        if before is not None:
            x[memories[-1]] += (before - stress) @ x
        A = np.zeros((7 * CELLS + 2, 7 * CELLS + 2))  # the input and its rate join the state
        A[u, v] = np.eye(CELLS)
        A[v, : 7 * CELLS] = -np.linalg.solve(MASS, SIZE * B.T @ stress)
        A[v, -2], A[-2, -1] = -np.linalg.solve(MASS, LOAD), 1.0
        for m, memory in enumerate(memories):
            A[memory, v] = B if m < 4 else 0.0
            A[memory, memory] = -np.eye(CELLS) / TAU[m]
        h, before = dt / steps, stress
        step = expm(h * A)[: 7 * CELLS]
        for n in range(number * num_samples * steps, (number + 1) * num_samples * steps):
            if n % steps == 0:
                found.append(x[u])
            x = step @ np.concatenate([x, [values[n], (values[n + 1] - values[n]) / h]])
    return np.array(found).T


CURVES = {"model": "darendeli", "plasticity_index": 15, "mean_stress": 100e3}
loop = run(
    scale=0.3,
    **DIRECT,
    effects={"equivalent_linear": {"tolerance": 1e-3}},
    soil={"soil": {**SCENE.data["soil"]["soil"], "curves": CURVES}},
)
upwards = np.argsort(loop.lapses[0].cells.centroid[:, 1])
stages = [(la.cells.shear_modulus[upwards], la.cells.damping[upwards]) for la in loop.lapses]
nodes = integrate(stages, loop.base_acceleration[0], loop.dt, loop.lapses[0].num_samples)
u = loop.history("displacement")[:, 0]
inside = np.abs(u - nodes[[19, 9]]).max() / np.abs(nodes).max()
print("\nthe loop inside: G/Gmax least in each lapse", end=" ")
print(*(f"{lapse.cells.g_over_gmax.min():.2f}" for lapse in loop.lapses))
print(f"  against the same moduli, fixed, integrated in time: {100 * inside:.4f} % of the peak")

# ## Two laws
#
# A uniform column moves at its surface by 1/cos(ωH√(ρ/G*)) of its base. The hysteretic modulus is
# G(1 + 2iD) at all frequencies; the causal one has the same loss within 0.2 to 20 Hz, but has to
# grow with frequency, the more the larger the damping.

HEIGHT, SPEED, FIRST = 40.0, 170.0, 170.0 / 160.0
RATIOS = (0.02, 0.05, 0.1, 0.2)
frequency = np.linspace(0.05, 13.5, 20000)
figure, axes = plt.subplot_mosaic(
    [list("abG"), list("cdL")], figsize=(12, 6.4), layout="constrained", width_ratios=(1, 1, 0.85)
)
print("\nmaxwell beside hysteretic: heights of peaks 1 to 5, and their rise in frequency, %")
heights, rises = {}, {}
for name, damping, color in zip(
    "abcd", RATIOS, ("#0072B2", "#009E73", "#D55E00", "#CC79A7"), strict=True
):
    factors = {
        "hysteretic": 1 + 2j * damping,
        "maxwell": maxwell_factor(damping, 2j * np.pi * frequency, FIRST),
    }
    tops = {}
    for law, factor in factors.items():
        surface = np.abs(1 / np.cos(2 * np.pi * frequency * HEIGHT / (SPEED * np.sqrt(factor))))
        peaks = np.flatnonzero((surface[1:-1] > surface[:-2]) & (surface[1:-1] > surface[2:])) + 1
        tops[law] = frequency[peaks[:5]], surface[peaks[:5]]
        style = {"color": "k", "lw": 1} if law == "hysteretic" else {"color": color, "lw": 2.2}
        axes[name].semilogy(
            frequency, surface, **style, label=law, zorder=2 + (law == "hysteretic")
        )
    count = min(len(where) for where, _ in tops.values())
    (f0, t0), (f1, t1) = ((f[:count], t[:count]) for f, t in tops.values())
    heights[damping], rises[damping] = 100 * (t1 / t0 - 1), 100 * (f1 / f0 - 1)
    print(
        f"  D = {100 * damping:2.0f} %:  " + " ".join(f"{v:6.2f}" for v in heights[damping]), end=""
    )
    print("    " + " ".join(f"{v:6.2f}" for v in rises[damping]))
    axes[name].set(xlim=(0, 10), ylim=(0.1, 60), title=f"D = {100 * damping:g} %")
    axes[name].legend(frameon=False, loc="upper right")
    axes[name].set(xlabel="Frequency [Hz]", ylabel="|surface / base| [-]")
    wide = np.geomspace(0.05, 50, 400)
    factor = maxwell_factor(damping, 2j * np.pi * wide, FIRST)
    axes["G"].semilogx(wide, factor.real, color=color, lw=2, label=f"{100 * damping:g} %")
    axes["L"].semilogx(wide, factor.imag / factor.real / (2 * damping), color=color, lw=2)
axes["G"].axhline(1, color="k", lw=1)
axes["L"].axhline(1, color="k", lw=1)
axes["G"].legend(frameon=False, title="maxwell, D")
axes["G"].set(title="Stiffness over $G$", ylabel="Re $G^*/G$ [-]")
axes["L"].set(title="Loss factor over $2D$", ylabel="Im $G^*$/Re $G^*$/$2D$ [-]", ylim=(0, 1.3))
for name in "GL":
    axes[name].set(xlabel="Frequency [Hz]", xlim=(0.05, 50))
    axes[name].axvspan(0.2, 20, color="0.94", zorder=0, lw=0)
axes["L"].text(2, 0.12, "0.2 to 20 Hz", ha="center", color="0.4")
for axis in axes.values():
    axis.spines[["top", "right"]].set_visible(False)
figure.savefig(Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "demo_seams.png", dpi=110)

# A thousandth of the peak, and half a per cent of the acceleration; the worth of moving points goes
# with the strain; peaks of the two laws are as high, modes 2 to 5 up to 16 % higher in frequency.

assert max(u for u, _ in cost.values()) < 1e-3
assert max(a for _, a in cost.values()) < 5e-3
assert all(u < 1e-3 for (_, scale), (u, _) in moving.items())
assert sweeps[1e-6][0] < 1e-4
assert inside < 1e-3
assert all(np.abs(heights[damping]).max() < 1 for damping in RATIOS[:3])
assert rises[0.02][1:].max() < 3 < rises[0.1][1:].min()
