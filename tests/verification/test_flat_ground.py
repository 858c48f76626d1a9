# SPDX-License-Identifier: MIT
"""Level ground with tied sides is a column: sections and blocks against it, on 1, 2 and 3 ranks.

Cells of equal height and a pattern that repeats from cell to cell: what is tied repeats with the
cells. Nodes of quadrilaterals, of hexahedra, and of triangles and tetrahedra of degree 1 stand in
full columns, so the repeating solution is level, is in the column's own space, and is the column's
up to round-off. Triangles and tetrahedra of degree 2 have nodes half-way on their diagonals, where
nothing makes it level; they are asked for their order of convergence, 2 × degree for transfer
functions, which are ratios of energies (Strang and Fix 1973, chapter 6).
"""

import numpy as np
import pytest
from mpi4py import MPI
from support.reference import comb, two_layer_transfer

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate

pytestmark = pytest.mark.mpi

LIMIT = 1e-6
TOP, BOTTOM = 4.0, 8.0  # m
SOIL = {
    "soft": {"density": 1700.0, "shear_wave_velocity": 150.0, "poisson": 0.35, "damping": 0.06},
    "firm": {"density": 2000.0, "shear_wave_velocity": 320.0, "poisson": 0.25, "damping": 0.03},
}
CURVES = {"model": "darendeli", "plasticity_index": 10, "mean_stress": 50e3}
SIDES = {2: ("left", "right"), 3: ("left", "right", "front", "back")}


def scene(mesh, motion, receivers, degree, sides, **sections) -> Scene:
    return Scene.from_dict(
        {
            "mesh": {**mesh, "degree": degree},
            "soil": SOIL,
            "motion": motion,
            "boundary": dict.fromkeys(sides, "tied"),
            "solver": {"sweep": "direct"},  # to round-off
            "output": {"receivers": receivers},
            **sections,
        }
    )


def column(cells, degree, motion, heights, **sections) -> Scene:
    """Layers of 1 : 2 in thickness and in cells, ``cells`` in all."""
    layers = [
        {"thickness": TOP, "soil": "soft", "cells": cells // 3},
        {"thickness": BOTTOM, "soil": "firm", "cells": 2 * cells // 3},
    ]
    mesh = {"column": {"width": 1.0, "layers": layers}}
    receivers = {f"at{z:g}".replace(".", "_"): [0.4, z] for z in heights}
    return scene(mesh, motion, receivers, degree, SIDES[2], **sections)


def level_ground(cell, cells, degree, motion, places, width=1.5, **sections) -> Scene:
    """The same layers in a box; ``cells`` across, ``width`` metres each, and last upwards."""
    size = [width * count for count in cells[:-1]] + [TOP + BOTTOM]
    regions = [{"soil": "firm", "below": BOTTOM}, {"soil": "soft"}]
    mesh = {"box": {"size": size, "cells": list(cells), "cell": cell}, "regions": regions}
    receivers = {f"r{number}": place for number, place in enumerate(places)}
    return scene(mesh, motion, receivers, degree, SIDES[len(cells)], **sections)


@pytest.fixture
def record(shared_path):
    """Lines of 0.5 to 12 Hz, through the column's first resonances (5.3 and 15 Hz; P: 9.7)."""
    path = shared_path / "comb.csv"
    motion = comb(path, np.arange(1, 25), 100, 0.02) if MPI.COMM_WORLD.rank == 0 else None
    return MPI.COMM_WORLD.bcast(motion)


HEIGHTS = (12.0, 8.0, 5.1)


@pytest.mark.parametrize(
    ("cell", "cells", "degree"),
    [
        ("quadrilateral", (5, 12), 1),
        ("quadrilateral", (5, 12), 2),
        ("triangle", (5, 12), 1),
        ("hexahedron", (3, 2, 12), 1),
        ("hexahedron", (2, 2, 12), 2),
        ("tetrahedron", (3, 2, 12), 1),
    ],
)
def test_equal_to_the_column(cell, cells, degree, record, figure):
    gdim = len(cells)
    up = "xyz"[gdim - 1]
    alone = [{"direction": "x", **record}, {"direction": "y", **record}]
    expected = simulate(column(12, degree, alone, HEIGHTS), MPI.COMM_SELF).lapses[0]
    axes = [*"xyz"[: gdim - 1], up]
    # At every height one receiver in the middle of a cell and one on a tied side.
    across = [[0.7] * (gdim - 1), [0.0] * (gdim - 1)]
    places = [[*x, z] for z in HEIGHTS for x in across]
    motion = [{"direction": axis, **record} for axis in axes]
    found = simulate(level_ground(cell, cells, degree, motion, places)).lapses[0]
    np.testing.assert_array_equal(found.frequency, expected.frequency)
    error = 0.0
    for axis, direction in enumerate(axes):
        wave = int(direction == up)  # the column's x is any horizontal axis, its y is up
        pairs = [
            (found.transfer[:, axis, axis], expected.transfer[:, wave, wave]),
            (found.displacement[:, axis], expected.displacement[:, wave]),
        ]
        for mine, exact in pairs:
            difference = np.abs(mine - np.repeat(exact, len(across), axis=0)).max()
            error = max(error, difference / np.abs(exact).max())
    cross = max(
        np.abs(found.transfer[:, i, j]).max() for i in range(gdim) for j in range(gdim) if i != j
    )
    size = " x ".join(map(str, cells))
    name = f"level ground, {size} {cell} cells of degree {degree}, on {MPI.COMM_WORLD.size}"
    figure(f"{name}: every direction", error, LIMIT)
    figure(f"{name}: directions do not couple", cross, LIMIT)


@pytest.mark.parametrize(
    ("cell", "cells"), [("quadrilateral", (4, 12)), ("hexahedron", (2, 2, 12))]
)
def test_equal_to_the_column_with_the_loop(cell, cells, figure):
    """One shear wave: every convention of the strain is the column's."""
    soil = {name: table | {"curves": CURVES} for name, table in SOIL.items()}
    shape = {"n": 200, "dt": 0.02, "f1": 1.0, "f2": 6.0, "nf": 8, "t1": 0.5, "t2": 2.0, "c": 2.0}
    motion = [{"direction": "x", "synthetic": shape, "pga": 0.25}]
    sections = {"soil": soil, "effects": {"equivalent_linear": {"tolerance": 1e-6}}}
    sections["solver"] = {"max_frequency": 15.0, "sweep": "direct"}
    alone = column(12, 1, motion, [12.0], **sections)
    place = [1.0] * (len(cells) - 1) + [12.0]
    expected = simulate(alone, MPI.COMM_SELF).lapses[0]
    found = simulate(level_ground(cell, cells, 1, motion, [place], **sections)).lapses[0]
    assert expected.cells.g_over_gmax.min() < 0.8
    history = expected.total_acceleration[0, 0]
    error = np.abs(found.total_acceleration[0, 0] - history).max() / np.abs(history).max()
    name = f"level ground with the loop, {cell}, on {MPI.COMM_WORLD.size}"
    figure(f"{name}: surface acceleration", error, LIMIT)
    # The column's cells are numbered from the top, the box's in rows from the base.
    rows = expected.cells.g_over_gmax[::-1]
    ratio = found.cells.g_over_gmax.reshape(12, -1)
    figure(f"{name}: G/Gmax of every cell", np.abs(ratio / rows[:, None] - 1).max(), LIMIT)


@pytest.mark.parametrize(
    ("cell", "across"), [("triangle", (2,)), ("tetrahedron", (1, 1))], ids=lambda v: str(v)
)
def test_simplices_of_degree_2_converge(cell, across, record, figure):
    up = "xyz"[len(across)]
    motion = [{"direction": axis, **record} for axis in ("x", up)]
    errors = []
    for cells in (6, 12, 24):
        height = (TOP + BOTTOM) / cells  # as wide as high: all edges shrink alike
        place = [0.3 * height] * len(across) + [TOP + BOTTOM]  # the same place of a cell
        ground = level_ground(cell, (*across, cells), 2, motion, [place], width=height)
        lapse = simulate(ground).lapses[0]
        errors.append(
            [
                np.abs(lapse.transfer[0, "xyz".index(axis), number] - exact).max()
                for number, (axis, exact) in enumerate(
                    zip(("x", up), theory(lapse.frequency), strict=True)
                )
            ]
        )
    order = np.log2(np.array(errors[-2]) / errors[-1])
    for axis, value in zip(("x", up), order, strict=True):
        # 4 in the limit; 3.8 leaves room for what a finite cell adds.
        name = f"level ground, {cell} of degree 2 in {axis}, on {MPI.COMM_WORLD.size}: order in h"
        figure(name, value, 3.8, "", at_least=True)


def theory(frequency):
    """Closed forms of the two layers in shear and in compression."""
    shear, compression = [], []
    for soil in (SOIL["soft"], SOIL["firm"]):
        nu = soil["poisson"]
        modulus = soil["density"] * soil["shear_wave_velocity"] ** 2 * (1 + 2j * soil["damping"])
        shear.append(modulus)
        compression.append(modulus * 2 * (1 - nu) / (1 - 2 * nu))
    density = (SOIL["soft"]["density"], SOIL["firm"]["density"])
    omega = 2 * np.pi * frequency
    return [
        two_layer_transfer(omega, (TOP, BOTTOM), density, tuple(m)) for m in (shear, compression)
    ]
