# SPDX-License-Identifier: MIT
"""A slope in space between smooth sides is its section: mechanism, slip, motion and points."""

import numpy as np
import pytest
from support.meshes import mesh_script
from support.sliding import total

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate

GROUND = {"height": 8.0, "depth": 2.0, "behind": 10.0, "before": 14.0, "air": 2.0, "size": 2.0}
WIDTH = 4.0  # [m], two cells


def run(path, kind, moves, locking, **options):
    """A slope of clay that a sine makes slide, in two lapses."""
    gdim = 3 if kind == "slope3d" else 2
    crest = [9.0, 9.5] if gdim == 2 else [9.0, WIDTH / 2, 9.5]
    sides = ("left", "right") if gdim == 2 else ("left", "right", "front", "back")
    soil = {"density": 1800.0, "shear_wave_velocity": 150.0, "poisson": 0.4, "damping": 0.05}
    data = {
        "mesh": {
            "file": str(mesh_script(kind)(path / f"{kind}.msh", **GROUND, **options)),
            "empty": ["air"],
            "points_per_cell": 4 if gdim == 2 else 8,
        },
        "soil": {"soil": {**soil, "cohesion": 30e3}},
        "motion": [
            {
                "direction": "x",
                "harmonic": {"amplitude": 2.5, "frequency": 2.0, "cycles": 2, "samples": 60},
            }
        ],
        "boundary": dict.fromkeys(sides, "roller"),
        "lapses": {"count": 2},
        "effects": {
            "gravity": True,
            "convection": moves,
            "locking": locking,
            "sliding": {"time_step": 0.005},
        },
        "output": {"receivers": {"crest": crest}},
    }
    return simulate(Scene.from_dict(data))


# The cure for locking takes what is over of dilation from two directions in a plane, from three in
# space; without it the two are the same to what the sweep leaves (1e-7 on a damped contour).
@pytest.mark.parametrize(
    ("moves", "locking", "limit"), [(False, False, 1e-7), (True, False, 1e-7), (True, True, 1e-3)]
)
def test_a_slope_between_smooth_sides_is_its_section(moves, locking, limit, tmp_path, figure):
    plane = run(tmp_path, "slope", moves, locking)
    space = run(tmp_path, "slope3d", moves, locking, width=WIDTH)
    assert total(plane) > 0.02
    assert len(plane.lapses) == len(space.lapses)
    what = f"slope in space, {'moving' if moves else 'fixed'}{', cured' if locking else ''}"
    for quantity in ("factor_of_safety", "yield_coefficient"):
        there, here = (getattr(result.lapses[0].slip, quantity) for result in (space, plane))
        figure(f"{what}: {quantity.replace('_', ' ')}", abs(there / here - 1), 1e-8)
    figure(f"{what}: slip", abs(total(space) / total(plane) - 1), limit)
    u, v = (result.history("displacement")[0] for result in (space, plane))
    figure(f"{what}: crest", np.abs(u[[0, 2]] - v).max() / np.abs(v).max(), limit)
    figure(f"{what}: motion across", np.abs(u[1]).max() / np.abs(v).max(), 1e-8)
