# SPDX-License-Identifier: MIT
"""Memory foretold over the peak that was measured: rows of the table in ``unit/test_demand.py``."""

import pytest
from support.foretold import told_and_taken
from support.peaks import MIB

from fenics_hytf.scene import Scene

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(3600)]

SAND = {"density": 1835.0, "shear_wave_velocity": 225.0, "poisson": 0.3, "damping": 0.05}
TIED = {"left": "tied", "right": "tied"}


def box(*cells: int, **mesh) -> dict:
    """Of cells of a metre."""
    size = [float(n) for n in cells]
    cell = {"cell": mesh.pop("cell")} if "cell" in mesh else {}
    return {"mesh": {"box": {"size": size, "cells": list(cells), **cell}, **mesh}}


LAYER = {"thickness": 20.0, "soil": "s", "cells": 20}
LONG = {"n": 40_000, "dt": 0.01}
CASES = {
    "2D, direct, one lapse": box(120, 60) | {"solver": {"sweep": "direct"}, "boundary": TIED},
    "2D, reduced, triangles": box(200, 100, cell="triangle") | {"boundary": TIED},
    "2D, out of the plane": box(200, 100, kinematics="antiplane") | {"boundary": TIED},
    "2D, a record of 40 000 samples": {
        "mesh": {"column": {"width": 1.0, "layers": [LAYER]}},
        "boundary": TIED,
        "motion": [{"direction": "x", "synthetic": LONG, "pga": 0.1}],
    },
    "3D, direct, hexahedra": box(12, 12, 10) | {"solver": {"sweep": "direct"}},
    "3D, reduced, hexahedra": box(16, 16, 12),
    "3D, reduced, tetrahedra": box(14, 14, 10, cell="tetrahedron"),
}


@pytest.mark.parametrize("case", CASES)
def test_memory_foretold_over_measured(case, figure):
    given = CASES[case]
    direction = "z" if "kinematics" in given["mesh"] else "x"
    motion = {"direction": direction, "synthetic": {"n": 256, "dt": 0.02}, "pga": 0.1}
    usual = {"soil": {"s": SAND}, "motion": [motion]}
    unknowns, points, told, taken = told_and_taken(Scene.from_dict(usual | given))
    row = f"{unknowns:>8} {points:>7} {told / MIB:9.0f} {taken / MIB:9.0f} {told / taken:6.2f}"
    print(f"\n    {case:<40} {row}")
    figure(f"memory foretold, {case}: off by a factor", max(told / taken, taken / told), 2.0)
