# SPDX-License-Identifier: MIT
# # A slope that slides, and what each effect costs and changes
#
# This demo shows how to:
#
# - run one slope with the effects that a scene may call for, one after the other, and see in one
#   table what each brings and what it costs;
# - see that an effect which a scene does not name costs nothing: the same counters of work;
# - compare the slip of the coupled analysis with a rigid and a decoupled sliding block.
#
# The same scene runs on the command line: `hytf run slope.toml`.

from __future__ import annotations

import sys
import time
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from fenics_hytf import Scene, simulate

SCENE = Scene.load(Path(__file__).with_name("slope.toml"))
LADDER = ("gravity", "geometric_stiffness", "convection", "sliding", "equivalent_linear")


def run(**effects):
    """The scene with these effects alone, and the seconds it takes."""
    data = {**SCENE.data, "effects": effects, "lapses": {"count": 2, "continuity": "transient"}}
    data["solver"] = {"complex_modulus": "maxwell", "reference_frequency": 2.0}
    scene = Scene.from_dict(data, SCENE.folder)
    start = time.perf_counter()
    result = simulate(scene)
    return result, time.perf_counter() - start


# ## One effect after the other
#
# Each row adds an effect to those above it. Gravity alone changes nothing that is seen of the
# shaking; the stiffness of the stress it brings, and points that move, change little in a slope
# that stands; the mechanism that slips changes where it ends; soil that softens with strain
# changes how it shakes, and takes a sweep an iteration.

run()  # forms are compiled the first time they are met
runs = {"linear": run()}
effects = {}
for name in LADDER:
    effects[name] = SCENE.data["effects"][name]
    runs[f"+ {name}"] = run(**effects)

crest = list(SCENE.output.receivers).index("crest")
first = runs["linear"][1]
print(f"{'':24}{'time':>7}{'factor-':>9}{'crest A':>9}{'crest u':>9}{'left':>8}")
print(
    f"{'':24}{'ratio':>7}{'isations':>9}{'m/s2':>9}{'m':>9}{'m':>8}   forms beyond elasticity, mass"
)
for name, (result, seconds) in runs.items():
    u = result.history("displacement")[crest, 0]
    acceleration = np.abs(result.history("total_acceleration")[crest, 0]).max()
    forms = [form for form in result.work.assemblies if form not in ("elasticity", "mass")]
    print(
        f"{name:24}{seconds / first:7.2f}{result.work.factorisations:9d}{acceleration:9.2f}"
        f"{np.abs(u).max():9.4f}{u[-1]:8.4f}   {', '.join(forms)}"
    )

# ## What a scene does not name costs nothing
#
# Every effect named and switched off, against a scene that never heard of them.

off, _ = run(**dict.fromkeys(LADDER, False))
never = runs["linear"][0].work
assert (off.work.factorisations, off.work.solves) == (never.factorisations, never.solves)
assert off.work.assemblies == never.assemblies
assert off.work.inverse_mappings == never.inverse_mappings == 0
print("all effects switched off: the same factorisations, solves and assemblies as without a word")

# ## Coupled, decoupled and rigid
#
# A rigid block knows nothing of how the slope shakes; a decoupled one shakes as if nothing slipped.

result = runs["+ equivalent_linear"][0]
slips = [lapse.slip for lapse in result.lapses]
total = {
    "coupled": sum(slip.slip[-1] for slip in slips),
    "decoupled": sum(slip.decoupled for slip in slips),
    "rigid": sum(slip.rigid for slip in slips),
}
print(f"factor of safety {slips[0].factor_of_safety:.2f}, k_y {slips[0].yield_coefficient:.3f}")
print(", ".join(f"{name} {slip:.3f} m" for name, slip in total.items()))
assert slips[0].factor_of_safety > 1.0
assert total["coupled"] > 0.01
# The slip is what is left of the shaking at the crest.
left = result.history("displacement")[crest, 0, -1]
assert 0.5 < left / total["coupled"] < 1.2

figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6), layout="constrained", sharex=True)
offset, clock = 0.0, 0.0
for slip in slips:
    t = clock + slip.time_step * np.arange(len(slip.slip))
    above.plot(t, offset + slip.slip, color="C0", label="coupled slip" if clock == 0 else None)
    below.plot(t, slip.driving / 9.81, color="C7", linewidth=0.8)
    below.hlines(slip.yield_coefficient, t[0], t[-1], color="C3")
    offset, clock = offset + slip.slip[-1], t[-1]
u = result.history("displacement")[crest, 0]
above.plot(result.time[: len(u)], u, color="C1", linewidth=0.8, label="crest")
above.set_ylabel("displacement [m]")
above.legend(frameon=False)
below.set_ylabel("driving acceleration [g]\n(red: it yields)")
below.set_xlabel("time [s]")
folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
figure.savefig(folder / "demo_slope.png", dpi=120)
