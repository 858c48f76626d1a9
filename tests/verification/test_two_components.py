# SPDX-License-Identifier: MIT
"""Both components move: one record a direction, one influence vector a direction.

The method's source writes a one on every degree of freedom for the influence vector, which holds
only where the direction across the input is constrained, and says so. Here it is constrained
nowhere: on ground that is not level an input along x moves the ground along y too.
"""

import numpy as np
import pytest
from support.meshes import mesh_script
from support.reference import comb

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate

ROUND_OFF = 1e-10  # of the largest value: a solve's residual times the condition of its matrix
SOIL = {
    "soft": {"density": 1700.0, "shear_wave_velocity": 150.0, "poisson": 0.35, "damping": 0.05},
    "stiff": {"density": 2200.0, "shear_wave_velocity": 600.0, "poisson": 0.2, "damping": 0.02},
}
HISTORIES = ("displacement", "velocity", "acceleration", "total_acceleration")


def solve(mesh, motions, boundary, receivers, soil=SOIL):
    scene = {
        "mesh": mesh,
        "soil": soil,
        "motion": motions,
        "boundary": boundary,
        "solver": {"sweep": "direct"},  # to round-off
        "output": {"receivers": receivers},
    }
    return simulate(Scene.from_dict(scene)).lapses[0]


def inclusion():
    """A section with a stiff block half buried at one side of its soft surface."""
    corner = [[8, 4], [13, 4], [13, 8], [8, 8]]
    regions = [{"soil": "stiff", "polygon": corner}, {"soil": "soft"}]
    mesh = {"box": {"size": [20.0, 8.0], "cells": [20, 8]}, "regions": regions, "degree": 2}
    receivers = {"block": [12.0, 8.0], "free": [4.0, 8.0], "deep": [10.0, 3.3]}
    return mesh, {"left": "tied", "right": "tied"}, receivers


def buttressed_block():
    """A block of soft soil, one of its sides held by rock."""
    box = {"size": [6.0, 6.0, 5.0], "cells": [4, 4, 4]}
    regions = [{"soil": "stiff", "below": 2.0}, {"soil": "soft"}]
    receivers = {"top": [4.0, 2.0, 5.0], "edge": [6.0, 6.0, 5.0]}
    return {"box": box, "regions": regions}, {"left": "fixed"}, receivers


@pytest.mark.parametrize(("ground", "axes"), [(inclusion, "xy"), (buttressed_block, "xyz")])
def test_records_at_once_superpose(ground, axes, tmp_path, figure):
    mesh, boundary, receivers = ground()
    # A comb each, of teeth that the others lack: a record that leaked into another would show.
    motions = [
        {
            "direction": axis,
            **comb(tmp_path / f"{axis}.csv", np.arange(3 + number, 60, 4), 200, 0.02),
            "scale": 1.0 - 0.3 * number,
        }
        for number, axis in enumerate(axes)
    ]
    together = solve(mesh, motions, boundary, receivers)
    alone = [solve(mesh, [motion], boundary, receivers) for motion in motions]
    error = 0.0
    for name in HISTORIES:
        added = np.sum([getattr(lapse, name) for lapse in alone], axis=0)
        error = max(error, np.abs(getattr(together, name) - added).max() / np.abs(added).max())
    for number, lapse in enumerate(alone):
        lines = np.isin(together.frequency, lapse.frequency)
        assert 0 < lines.sum() < len(lines)
        mine, single = together.transfer[:, :, number, lines], lapse.transfer[:, :, 0]
        error = max(error, np.abs(mine - single).max() / np.abs(single).max())
    name = ground.__name__.replace("_", " ")
    figure(f"{name}: records at once against their sum", error, ROUND_OFF)
    # Superposing is worth a test only where the components couple.
    coupling = max(
        np.abs(together.transfer[:, i, j]).max()
        for i in range(len(axes))
        for j in range(len(axes))
        if i != j
    )
    figure(f"{name}: largest response across the input", coupling, 0.5, "", at_least=True)


@pytest.mark.parametrize("direction", ["x", "y"])
def test_level_ground_does_not_mind_what_is_free_across(direction, tmp_path, figure):
    """Shear and compression waves part: the direction across may be held, as in the source."""
    layers = [{"thickness": t, "soil": s, "cells": 6} for t, s in ((4.0, "soft"), (6.0, "stiff"))]
    mesh = {"column": {"width": 1.0, "layers": layers}, "degree": 2}
    motion = {"direction": direction, **comb(tmp_path / "m.csv", np.arange(1, 50), 200, 0.02)}
    receivers = {"surface": [0.3, 10.0], "mid": [0.5, 5.0]}
    free = {"left": "tied", "right": "tied"}
    held = free | {"top": "roller"} if direction == "x" else {"left": "roller", "right": "roller"}
    loose, constrained = (solve(mesh, [motion], kinds, receivers) for kinds in (free, held))
    axis = "xy".index(direction)
    scale = np.abs(constrained.transfer).max()
    same = np.abs(loose.transfer[:, axis] - constrained.transfer[:, axis]).max() / scale
    across = np.abs(loose.transfer[:, 1 - axis]).max() / scale
    figure(f"level ground along {direction}: free across against held across", same, ROUND_OFF)
    figure(f"level ground along {direction}: motion across, where it is free", across, ROUND_OFF)


def test_an_embankment_moves_across_the_input(tmp_path, figure):
    """One influence vector a direction, on slopes that differ so that nothing is symmetric."""
    draw = mesh_script("embankment")
    shape = {"height": 12.0, "crest": 6.0, "cells": (16, 8)}
    slopes = {"lopsided": (1.5, 2.5), "mirrored": (2.5, 1.5)}
    soil = {"fill": SOIL["soft"]}
    motions = [
        {"direction": axis, **comb(tmp_path / "m.csv", np.arange(1, 41), 250, 0.02)}
        for axis in "xy"
    ]
    transfer = {}
    for name, (left, right) in slopes.items():
        path = draw(tmp_path / f"{name}.msh", **shape, slope=left, right_slope=right)
        sign = 1.0 if name == "lopsided" else -1.0
        # The outer places last: the foot is the base itself.
        places = {"crest": (2.0, 12.0), "face": (13.0, 6.0), "inner": (-1.0, 5.0), "foot": (33, 0)}
        receivers = {key: [sign * x, y] for key, (x, y) in places.items()}
        mesh = {"file": str(path), "degree": 2}
        transfer[name] = solve(mesh, motions, {}, receivers, soil).transfer
    ours, theirs = transfer["lopsided"], transfer["mirrored"]
    for axis, across in ((0, 1), (1, 0)):
        name = f"embankment shaken along {'xy'[axis]}"
        figure(f"{name}: largest motion across", np.abs(ours[:, across, axis]).max(), 0.5, "", True)
        # The base moves along the input and stands still across it.
        base = ours[3, :, axis]
        assert np.abs(base[axis] - 1).max() < ROUND_OFF and np.abs(base[across]).max() < ROUND_OFF
        # What does not deform follows the influence vector: r along the input, nothing across. At
        # the lowest line, 0.2 Hz of a first mode near 3, inertia deforms by (0.2/3)**2.
        lowest = ours[:, :, axis, 0]
        still = max(np.abs(lowest[:, axis] - 1).max(), np.abs(lowest[:, across]).max())
        figure(f"{name}: departure from r at 0.2 Hz", still, 0.01)
    # Seen from behind, x turns round and y does not: the coupling changes its sign.
    turned = theirs * np.array([[1.0, -1.0], [-1.0, 1.0]])[None, :, :, None]
    error = np.abs(turned - ours).max() / np.abs(ours).max()
    figure("embankment against its mirror image", error, ROUND_OFF)
