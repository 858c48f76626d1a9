# SPDX-License-Identifier: MIT
# # A slope in space that slides
#
# This demo shows how to:
#
# - run a slope of hexahedra with background cells above it, on as many ranks as there are:
#   `mpirun -n 2 python3 demo_slope3d.py`;
# - read the mechanism that slips, and where the ground ends.
#
# The same scene runs on the command line: `mpirun -n 2 hytf run slope3d.toml`.

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from fenics_hytf import Scene, simulate

SCENE = Scene.load(Path(__file__).with_name("slope3d.toml"))
shots = []
result = simulate(SCENE, snapshot=shots.append)

slips = [lapse.slip for lapse in result.lapses]
total = sum(slip.slip[-1] for slip in slips)
if MPI.COMM_WORLD.rank == 0:
    print(f"{result.num_ranks} ranks, {result.sizes['unknowns']} unknowns")
    print(f"factor of safety {slips[0].factor_of_safety:.2f}, k_y {slips[0].yield_coefficient:.3f}")
    for name in ("rigid", "decoupled"):
        print(f"{name:10} {sum(getattr(slip, name) for slip in slips):.3f} m")
    print(f"{'coupled':10} {total:.3f} m")
assert slips[0].factor_of_safety > 1
assert total > 0.01
assert result.lapses[-1].ledger.imbalance < 1e-14
# What is left at the crest is what slipped there; the foundation is where it was.
crest = list(result.receivers).index("crest")
left = np.linalg.norm(result.history("displacement")[crest, :, -1])
assert 0.3 * total < left < 1.2 * total

if MPI.COMM_WORLD.rank == 0:
    points = shots[-1].points
    moved = np.linalg.norm(points["displacement"], axis=1)
    axes = plt.figure(figsize=(8, 5.5), layout="constrained").add_subplot(projection="3d")
    dots = axes.scatter(*points["position"].T, c=moved, s=3, cmap="viridis")
    axes.set_box_aspect(np.ptp(points["position"], axis=0), zoom=1.25)
    axes.set_yticks([0, 10, 20])
    axes.set_zticks([0, 5, 10, 15])
    axes.view_init(elev=22, azim=-60)
    for name in "xyz":
        getattr(axes, f"set_{name}label")(f"{name} [m]")
    plt.colorbar(dots, label="displacement [m]", shrink=0.5, pad=0.12)
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    plt.savefig(folder / "demo_slope3d.png", dpi=120)
