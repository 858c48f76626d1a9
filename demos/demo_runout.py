# SPDX-License-Identifier: MIT
# # A slope that fails and runs out
#
# This demo shows how to:
#
# - let a slope go that does not stand under its own weight;
# - follow the mechanism that slips to the next one as the ground changes its shape, until it rests;
# - check the books: mass to the last bit, energy of every lapse, points that are all still there.
#
# The same scene runs on the command line: `hytf run runout.toml`.

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from fenics_hytf import Scene, simulate

SCENE = Scene.load(Path(__file__).with_name("runout.toml"))
shots = []
result = simulate(SCENE, snapshot=shots.append)

# ## From mechanism to mechanism
#
# A lapse ends when a third of a cell has slipped, and the mechanism is sought anew where the ground
# is then. The yield coefficient begins below nought: at rest the slope cannot hold itself. It rises
# as the slope grows flat, and what it moves by then is only carried on by its own motion.

slips = [lapse.slip for lapse in result.lapses]
total = np.cumsum([slip.slip[-1] for slip in slips])
print("lapse  from, s    k_y  slip, m    at, m/s  energy open, kJ/m")
for lapse, slip, so_far in zip(result.lapses, slips, total, strict=True):
    print(
        f"{lapse.index:5}{lapse.start_time:9.2f}{slip.yield_coefficient:7.3f}{so_far:9.3f}"
        f"{slip.rate[-1]:11.3f}{lapse.energy.imbalance / 1e3:20.1f}"
    )
yields = [slip.yield_coefficient for slip in slips]
at_rest = result.lapses[-1].start_time + slips[-1].time_step * int(np.argmax(slips[-1].rate == 0))
print(f"factor of safety {slips[0].factor_of_safety:.2f}; at rest after {at_rest:.1f} s")
print(f"run-out {total[-1]:.2f} m along the mechanism")
assert slips[0].factor_of_safety < 1 and yields[0] < -0.1
assert slips[-1].rate[-1] == 0 and yields[-1] > 0.04
assert 5.7 < total[-1] < 6.3  # 5.72 m on cells of 0.5 m

# ## The books
#
# What gravity brings less what the mechanism takes, Q_y λ, goes into motion, and is lost in the
# ground. What the books of all lapses are open by, beside the work of the mechanism's strength:

work = sum(slip.dissipation * slip.slip[-1] for slip in slips)
open_by = sum(lapse.energy.imbalance for lapse in result.lapses)
ledger = result.lapses[-1].ledger
print(f"energy open by {100 * abs(open_by) / work:.1f} % of what the strength takes")
print(f"mass open by {ledger.imbalance:.0e}; points parked: {ledger.parked}")
assert abs(open_by) < 0.03 * work
assert ledger.imbalance < 1e-14
fill = max(lapse.cells.fill.max() for lapse in result.lapses)
print(f"the fullest cell holds {fill:.2f} times its volume of soil")
assert fill < 1.1

chosen = [shots[0], shots[len(shots) // 2], shots[-1]]
figure, rows = plt.subplots(3, 1, figsize=(9, 7.5), layout="constrained", sharex=True, sharey=True)
for axes, shot in zip(rows, chosen, strict=True):
    moved = np.linalg.norm(shot.points["displacement"], axis=1)
    x, y = shot.points["position"].T
    dots = axes.scatter(x, y, c=moved, s=2, cmap="viridis", vmin=0, vmax=total[-1])
    axes.plot([0, 20, 35, 70], [15, 15, 5, 5], color="0.5", linewidth=0.8)
    axes.set_aspect("equal")
    axes.set_title(f"after {shot.time:.1f} s", loc="left", fontsize=10)
    axes.set_ylabel("y [m]")
rows[-1].set_xlabel("x [m]")
figure.colorbar(dots, ax=rows, label="displacement [m]", shrink=0.6)
folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
figure.savefig(folder / "demo_runout.png", dpi=120)
