# SPDX-License-Identifier: MIT
# # An embankment: two dimensions, both components
#
# This demo shows how to:
#
# - run a section on a mesh made with gmsh (`meshes/embankment.py`), whose ground moves up and down
#   where it is shaken from side to side;
# - check it while it is linear: transfer functions against an independent finite-element code;
# - let stiffness and damping follow the strain, and see what a strong motion leaves of them.
#
# The same scene runs on the command line: `hytf run embankment.toml`.

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import meshio
import numpy as np
from matplotlib.collections import PolyCollection

from fenics_hytf import Scene, simulate
from fenics_hytf.motion import GRAVITY

scene = Scene.load(Path(__file__).with_name("embankment.toml"))

# ## Linear, 5 % of damping
#
# Total acceleration over that of the base at the middle of the crest (along x), and at mid-height
# of the right face (along x and y), where the section is not symmetric and moves up and down.
# Reference: scikit-fem, 48 x 24 biquadratic quadrilaterals, its own error below 0.06 % of the
# peaks; G* = G(√(1 − 4D²) + 2iD) on the whole elasticity tensor. Here 24 x 12 cells.

REFERENCE = np.array(
    [  # Hz, crest x, face x, face y
        [1.0, 1.2207, 1.1226, 0.0017],
        [2.0, 2.6771, 1.8524, 0.0170],
        [2.6, 10.9499, 5.4777, 0.1309],
        [2.8, 14.5162, 6.2417, 0.2091],
        [3.2, 4.9991, 1.4204, 0.1018],
        [4.2, 2.6154, 0.3157, 0.1129],
        [5.0, 2.2938, 1.1755, 0.1755],
        [5.6, 3.0922, 2.8534, 0.3908],
        [6.0, 5.4251, 5.7655, 0.9707],
        [7.0, 2.4466, 2.6076, 1.1739],
        [8.0, 2.0002, 2.0264, 1.0425],
    ]
)
COLUMNS = {"crest x": (0, 0), "face x": (1, 0), "face y": (1, 1)}  # receiver, component
changes = {"effects": {}, "solver": {**scene.data["solver"], "complex_modulus": "dormieux"}}
linear = simulate(Scene.from_dict(scene.data | changes, scene.folder)).lapses[0]
lines = np.searchsorted(linear.frequency, REFERENCE[:, 0] - 1e-6)
np.testing.assert_allclose(linear.frequency[lines], REFERENCE[:, 0])
computed = np.array(
    [np.abs(linear.transfer[place, axis, 0, lines]) for place, axis in COLUMNS.values()]
).T
print("|motion / base|, computed (reference)")
print(f"{'Hz':>5}" + "".join(f"{name:>20}" for name in COLUMNS))
for (frequency, *expected), found in zip(REFERENCE, computed, strict=True):
    pairs = zip(found, expected, strict=True)
    print(f"{frequency:5.1f}" + "".join(f"{f'{a:.4f} ({b:.4f})':>20}" for a, b in pairs))
peaks = REFERENCE.max(axis=0)[[1, 2, 2]]  # of the point, whichever component it belongs to
error = np.abs(computed - REFERENCE[:, 1:]).max(axis=0) / peaks
print("largest difference, % of each point's peak:", (100 * error).round(2))

# ## Equivalent linear, 0.15 g
#
# The scene as it stands: Darendeli's curves, and the record of Pacoima Dam at the base.

result = simulate(scene)
lapse = result.lapses[0]
cells = lapse.cells
acceleration = np.abs(lapse.total_acceleration).max(axis=2) / GRAVITY
print("iterations:", len(lapse.loop.change), " last change:", f"{lapse.loop.change[-1]:.1e}")
for place, (along, across) in zip(result.receivers, acceleration, strict=True):
    print(f"peak acceleration, {place:<5} {along:.2f} g along x, {across:.2f} g along y")
first = lapse.frequency[np.abs(lapse.transfer[0, 0, 0]).argmax()]
print(f"first peak at the crest: {first:.2f} Hz, where it was 2.74 Hz at small strain")

# ## One figure

figure, (top, bottom) = plt.subplots(
    2, 1, figsize=(9, 6.5), layout="constrained", height_ratios=(2, 3)
)
crest = REFERENCE[:, :2].T
bottom.plot(
    linear.frequency, np.abs(linear.transfer[0, 0, 0]), color="#0072B2", label="linear, 5 %"
)
bottom.plot(*crest, "o", color="k", ms=4, mfc="none", label="independent code")
bottom.plot(
    lapse.frequency, np.abs(lapse.transfer[0, 0, 0]), color="#D55E00", label="equivalent linear"
)
bottom.set(
    xlim=(0, 8), ylim=(0, None), xlabel="Frequency [Hz]", ylabel="|crest / base|, along x [-]"
)
bottom.legend(frameon=False)
mesh = meshio.read(scene.mesh.file)
corners = mesh.points[mesh.cells_dict["quad"]][:, :, :2]
section = PolyCollection(corners, array=cells.g_over_gmax, cmap="viridis", edgecolor="face", lw=0.6)
top.add_collection(section)
figure.colorbar(section, label="$G/G_{max}$ [-]", shrink=0.8)
for name, (x, y) in zip(result.receivers, result.places, strict=True):
    top.plot(x, y, "o", color="w", mec="k", ms=6, clip_on=False)
    box = {"fc": "w", "ec": "none", "alpha": 0.7, "pad": 1}
    top.annotate(name, (x, y), (8, 6), textcoords="offset points", bbox=box)
top.set(xlim=(-66, 66), ylim=(0, 34), aspect="equal", xlabel="x [m]", ylabel="y [m]")
for side in ("top", "right"):
    top.spines[side].set_visible(False)
figure.savefig(Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "demo_embankment.png", dpi=150)

# Nearly six cells of degree 2 to the shortest wave, while it is linear: one per cent of each
# point's peak. Strong shaking softens the fill, so that it answers to slower motion; and the face
# moves up and down.

assert error.max() < 0.01
assert first < 2.74
assert acceleration[1, 1] > 0.01
