# SPDX-License-Identifier: MIT
"""Whole scenes on all ranks against the same scenes on one, in the same process.

Ranks add in another order and MUMPS eliminates in another, so results differ by round-off, times
the condition of the matrices and what the equivalent-linear loop makes of it: 1e-10 of the largest
value of each quantity is asked for.
"""

from dataclasses import fields

import numpy as np
import pytest
from mpi4py import MPI
from support.meshes import SOIL, gmsh_block, gmsh_section, scene

from fenics_hytf.lapse import EquivalentLinearError
from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import SimulationError, simulate

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
LIMIT = 1e-10

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(WORLD.size == 1, reason="compares several ranks with one"),
]

CURVES = {"model": "darendeli", "plasticity_index": 15, "mean_stress": 60e3, "ocr": 1}
DAMPED = SOIL | {"damping": 0.04}
SOFT = DAMPED | {"shear_wave_velocity": 120.0}
HISTORIES = ("displacement", "velocity", "acceleration", "total_acceleration", "transfer")
COUNTS = ("factorisations", "solves", "excited_lines", "assemblies", "inverse_mappings")


def record(direction="x", pga=0.1, n=80):
    """A short synthetic record of lines up to 6 Hz."""
    shape = {"n": n, "dt": 0.04, "f1": 0.7, "f2": 6.0, "nf": 6, "t1": 0.4, "t2": 1.5, "c": 1.5}
    return {"direction": direction, "synthetic": shape, "pga": pga}


def worst_difference(mine, alone) -> float:
    """Largest difference over the largest value, of everything that a lapse leaves behind."""
    worst = 0.0

    def compare(a, b):
        nonlocal worst
        if b is None:
            assert a is None
            return
        a, b = np.asarray(a), np.asarray(b)
        assert a.shape == b.shape
        if a.dtype.kind in "iu":
            assert np.array_equal(a, b)
        elif a.size and np.abs(b).max() > 0:
            worst = max(worst, float(np.abs(a - b).max() / np.abs(b).max()))
        else:
            assert not np.any(a)

    assert len(mine.lapses) == len(alone.lapses)
    for lapse, reference in zip(mine.lapses, alone.lapses, strict=True):
        compare(lapse.frequency, reference.frequency)
        for name in HISTORIES:
            compare(getattr(lapse, name), getattr(reference, name))
        compare(lapse.within, reference.within)
        compare(lapse.outcrop, reference.outcrop)
        for field in fields(lapse.cells):
            if field.name != "change":
                compare(getattr(lapse.cells, field.name), getattr(reference.cells, field.name))
        # What is left of a difference of moduli when the loop stops holds few digits of its own.
        worst = max(worst, float(abs(lapse.cells.change - reference.cells.change).max()))
        # The worst cell itself may be either of two that mirror each other.
        compare(lapse.loop.change, reference.loop.change)
        if reference.softening is not None:
            for field in fields(reference.softening):
                compare(*(getattr(r.softening, field.name) for r in (lapse, reference)))
        ledger, other = lapse.ledger.as_dict(), reference.ledger.as_dict()
        del ledger["migrated"], other["migrated"]
        assert ledger == other  # sums of masses are exact
        assert lapse.worst_residual < 1e-10
    return worst


def solved(case, sweep):
    return Scene.from_dict(case.data | {"solver": case.data.get("solver", {}) | {"sweep": sweep}})


def agree(case, figure, name):
    """Ranks that share the mesh, and ranks that share out the lines, against one alone."""
    case = solved(case, "direct")
    alone = simulate(case, SELF)
    for size, way in ((WORLD.size, "mesh"), (1, "lines")):
        mine = simulate(case, WORLD, group_size=size)
        assert mine.group_size == size
        agrees(mine, alone, figure, f"{name}, {way} shared")
    return mine


def agrees(mine, alone, figure, name):
    for count in COUNTS:
        assert getattr(mine.work, count) == getattr(alone.work, count), count
    assert mine.sizes == alone.sizes
    assert mine.num_ranks == WORLD.size
    # Every rank has the whole result.
    surface = mine.history("total_acceleration")
    assert np.any(surface)
    np.testing.assert_array_equal(surface, WORLD.bcast(surface))
    figure(f"{WORLD.size} ranks against one, {name}", worst_difference(mine, alone), LIMIT)


def test_column_with_the_equivalent_linear_loop(figure):
    layers = [
        {"thickness": 2.0, "soil": "fill", "cells": 1},
        {"thickness": 10.0, "soil": "clay", "cells": 8},
        {"thickness": 6.0, "soil": "rock", "cells": 2},
    ]
    case = scene(
        {"column": {"width": 1.0, "layers": layers}, "degree": 2},
        soil={"fill": SOFT | {"curves": CURVES}, "clay": SOFT | {"curves": CURVES}, "rock": DAMPED},
        motion=[record(pga=0.25)],
        boundary={"left": "tied", "right": "tied"},
        effects={"equivalent_linear": {"tolerance": 1e-4}},
        output={"receivers": {"top": [0.5, 18.0], "mid": [0.5, 9.0], "base": [0.5, 0.0]}},
    )
    result = agree(case, figure, "column, equivalent linear")
    assert len(result.lapses[0].loop.change) > 3


@pytest.mark.parametrize("cells", [1, 2, 3])
def test_columns_of_as_many_cells_as_ranks_or_fewer(cells, figure):
    layers = [{"thickness": 6.0, "soil": "clay", "cells": cells}]
    case = scene(
        {"column": {"width": 1.0, "layers": layers}},
        soil={"clay": DAMPED},
        motion=[record()],
        boundary={"left": "tied", "right": "tied"},
        output={"receivers": {"top": [0.5, 6.0], "rider": {"point": [0.5, 3.0]}}},
    )
    agree(case, figure, f"column of {cells} cells")


@pytest.mark.parametrize(
    ("cell", "degree"), [("quadrilateral", 1), ("triangle", 1), ("triangle", 2)]
)
def test_section_with_two_motions(cell, degree, figure):
    regions = [
        {"soil": "soft", "polygon": [[3, 2], [9, 2], [9, 6], [3, 6]]},
        {"soil": "stiff", "below": 3.0},
        {"soil": "clay"},
    ]
    case = scene(
        {
            "box": {"size": [12.0, 6.0], "cells": [12, 6], "cell": cell},
            "regions": regions,
            "degree": degree,
        },
        soil={"clay": DAMPED, "soft": SOFT, "stiff": DAMPED | {"shear_wave_velocity": 400.0}},
        motion=[record("x"), record("y", 0.05)],
        effects={"rayleigh": {"alpha": 0.1, "beta": 1e-3}},
        solver={"complex_modulus": "shake91", "keep": "bulk"},
        output={"receivers": {"top": [6.0, 6.0], "edge": [12.0, 3.0], "inner": [4.3, 2.1]}},
    )
    agree(case, figure, f"section, {cell} degree {degree}, x and y")


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_block_with_all_sides_tied(cell, figure):
    case = scene(
        {
            "box": {"size": [3.0, 2.0, 4.0], "cells": [3, 2, 4], "cell": cell},
            "regions": [{"soil": "clay", "below": 2.0}, {"soil": "soft"}],
        },
        soil={"clay": DAMPED, "soft": SOFT},
        motion=[record("x"), record("z", 0.05)],
        boundary={side: "tied" for side in ("left", "right", "front", "back")},
        output={"receivers": {"top": [1.5, 1.0, 4.0], "node": [1.0, 1.0, 2.0]}},
    )
    agree(case, figure, f"block of {cell} cells")


def test_block_with_the_loop(figure):
    case = scene(
        {"box": {"size": [3.0, 3.0, 4.0], "cells": [3, 3, 4]}},
        soil={"clay": SOFT | {"curves": CURVES}},
        motion=[record("y", 0.4)],
        effects={"equivalent_linear": True},
        output={"receivers": {"top": [1.5, 1.5, 4.0]}},
    )
    agree(case, figure, "block, equivalent linear")


@pytest.mark.parametrize("order", [1, 2])
def test_mesh_file(order, shared_path, figure):
    file = shared_path / "section.msh"
    if WORLD.rank == 0:
        gmsh_section(file, order=order, quads=order == 2)
    WORLD.Barrier()
    case = scene(
        {"file": str(file), "degree": order},
        soil={"clay": DAMPED, "sand": SOFT},
        motion=[record("x"), record("y")],
        boundary={"left": "roller"},
        output={"receivers": {"top": [2.0, 2.0], "point": {"point": [1.0, 0.6]}}},
    )
    agree(case, figure, f"gmsh section of order {order}")


def test_mesh_file_in_space(shared_path, figure):
    file = shared_path / "block.msh"
    if WORLD.rank == 0:
        gmsh_block(file)
    WORLD.Barrier()
    case = scene(
        {"file": str(file)},
        soil={"sand": DAMPED},
        motion=[record("y")],
        output={"receivers": {"top": [1.0, 0.5, 1.0]}},
    )
    agree(case, figure, "gmsh block")


@pytest.mark.parametrize(
    ("continuity", "law"),
    [("steady", "hysteretic"), ("transient", "maxwell"), ("transient", "hysteretic")],
)
def test_lapses_with_convection(continuity, law, figure):
    """Every effect but degradation at once, over four lapses."""
    case = scene(
        {
            "box": {"size": [8.0, 4.0], "cells": [8, 4]},
            "regions": [{"soil": "clay", "below": 2.0}, {"soil": "soft"}],
        },
        soil={"clay": DAMPED | {"curves": CURVES}, "soft": SOFT | {"curves": CURVES}},
        motion=[record("x", 0.2), record("y", 0.05)],
        boundary={"left": "tied", "right": "tied"},
        lapses={"count": 4, "continuity": continuity},
        solver={"complex_modulus": law},
        effects={
            "equivalent_linear": True,
            "rayleigh": {"alpha": 0.05, "beta": 1e-3},
            "geometric_stiffness": True,
            "convection": True,
        },
        output={"receivers": {"top": [4.0, 4.0], "rider": {"point": [3.0, 2.5]}}},
    )
    result = agree(case, figure, f"four lapses, {continuity}, {law}")
    assert len(result.lapses) == 4


def test_a_slope_that_softens(figure):
    """Points migrate with the least modulus that their ground has had."""
    air = [[0, 6], [4, 6], [10, 2], [12, 2], [12, 7], [0, 7]]
    case = scene(
        {
            "box": {"size": [12.0, 7.0], "cells": [12, 7]},
            "regions": [{"soil": "air", "polygon": air}, {"soil": "soft"}],
            "empty": ["air"],
        },
        soil={"soft": SOFT | {"curves": CURVES}},
        motion=[record("x", 0.1)],
        boundary={"left": "roller", "right": "roller"},
        lapses={"count": 3},
        effects=dict.fromkeys(
            ("equivalent_linear", "gravity", "geometric_stiffness", "convection", "softening"), True
        ),
        output={"receivers": {"crest": [3.0, 6.0], "rider": {"point": [5.0, 4.0]}}},
    )
    result = agree(case, figure, "a slope that softens")
    assert result.lapses[-1].softening.largest > result.lapses[0].softening.largest > 1e-5


ROCK = {"density": 2300.0, "shear_wave_velocity": 700.0, "poisson": 0.25, "damping": 0.01}


def layered(cell, sides, directions, kinematics=None, **sections):
    """Layers on rock with an inclusion, between sides of a kind."""
    gdim = 2 if cell in ("quadrilateral", "triangle") else 3
    inclusion = {"soil": "soft", "polygon": [[3, 2], [6, 2], [6, 5], [3, 5]]}
    regions = [
        *([inclusion] if gdim == 2 else []),
        {"soil": "clay", "below": 4.0},
        {"soil": "soft"},
    ]
    mesh = {
        "box": {
            "size": [9.0, 6.0] if gdim == 2 else [4.0, 3.0, 6.0],
            "cells": [9, 6] if gdim == 2 else [3, 2, 4],
            "cell": cell,
        },
        "regions": regions,
    }
    names = ("left", "right", "front", "back")[: 2 * gdim - 2]
    return scene(
        mesh | ({"kinematics": kinematics} if kinematics else {}),
        soil={"clay": DAMPED | {"curves": CURVES}, "soft": SOFT | {"curves": CURVES}},
        motion=[record(d) | {"input": "outcrop"} for d in directions],
        boundary=dict.fromkeys(names, sides) | {"base": {"compliant": ROCK}},
        output={"receivers": {"top": [4.5, 6.0] if gdim == 2 else [1.5, 1.0, 6.0]}},
        **sections,
    )


@pytest.mark.parametrize(
    ("cell", "directions", "kinematics"),
    [("triangle", "xy", None), ("quadrilateral", "z", "antiplane"), ("hexahedron", "xz", None)],
)
@pytest.mark.parametrize("sides", ["free_field", "dashpot", "free"])
def test_sections_on_rock(sides, cell, directions, kinematics, figure):
    effects = {"rayleigh": {"alpha": 0.05, "beta": 1e-3}}
    if sides == "free":
        effects["calm"] = {"sides": ["left", "right"], "thickness": 1.0}
    case = layered(cell, sides, directions, kinematics, effects=effects)
    agree(case, figure, f"{cell} section on rock, sides {sides}, {directions}")


def test_free_field_with_the_loop(figure):
    case = layered("quadrilateral", "free_field", "x", effects={"equivalent_linear": True})
    agree(case, figure, "section on rock, free field, equivalent linear")


def test_a_snapshot_of_the_fields_does_not_depend_on_the_ranks(figure):
    case = scene(
        {"box": {"size": [6.0, 4.0], "cells": [6, 4], "cell": "triangle"}, "degree": 2},
        soil={"clay": DAMPED},
        motion=[record()],
        solver={"sweep": "direct"},
        output={"receivers": {"top": [3.0, 4.0]}, "fields": True},
    )
    taken = {}
    simulate(case, WORLD, snapshot=lambda s: taken.setdefault("mine", s))
    simulate(case, SELF, snapshot=lambda s: taken.setdefault("alone", s))
    mine, alone = taken["mine"], taken["alone"]
    worst = 0.0
    if WORLD.rank == 0:
        np.testing.assert_array_equal(mine.cells, alone.cells)
        pairs = [(mine.vertices, alone.vertices)]
        for name in ("points", "vertex_fields", "cell_fields"):
            found, expected = getattr(mine, name), getattr(alone, name)
            assert set(found) == set(expected)
            pairs += [(found[key], expected[key]) for key in expected]
        for a, b in pairs:
            largest = float(np.abs(b).max())
            worst = max(worst, float(np.abs(a - b).max()) / (largest or 1.0))
    else:
        assert mine.points is None
    figure(f"{WORLD.size} ranks against one, snapshot", worst, LIMIT)


@pytest.mark.parametrize("sides", ["free_field", "dashpot"])
def test_the_reduced_sweep_in_groups(sides, figure):
    """Each group brings expansion points of its own: other bases, the same tolerance."""
    effects = {"equivalent_linear": {"tolerance": 1e-8}}
    case = layered("quadrilateral", sides, "xy", effects=effects)
    tolerance = case.solver.tolerance
    alone = simulate(solved(case, "direct"), SELF)
    for size in (1, WORLD.size):
        mine = simulate(solved(case, "reduced"), WORLD, group_size=size)
        assert mine.lapses[0].worst_residual <= tolerance
        for name in HISTORIES[:-1]:
            found, expected = mine.history(name), alone.history(name)
            np.testing.assert_array_equal(found, WORLD.bcast(found))
            error = abs(found - expected).max() / abs(expected).max()
            figure(
                f"reduced in groups of {size} of {WORLD.size}, {sides}, {name}",
                error,
                10 * tolerance,
            )


def test_memory_asks_for_no_more_than_a_rank_a_group():
    case = layered("quadrilateral", "dashpot", "x")
    assert simulate(case, WORLD).group_size == 1
    with pytest.raises(ValueError, match=r"group size: found 5, with \d ranks; expected one of 1"):
        simulate(case, WORLD, group_size=5)


def test_no_more_groups_than_lines():
    wave = {"amplitude": 0.1, "frequency": 1.0, "cycles": 1, "samples": 8}
    case = layered("quadrilateral", "tied", "x")
    motion = [{"direction": "x", "harmonic": wave, "input": "outcrop"}]
    result = simulate(Scene.from_dict(case.data | {"motion": motion}), WORLD)
    assert result.lapses[0].solved_lines == 1 and result.group_size == WORLD.size


# ---------------------------------------------------------------- every rank stops alike


def test_a_receiver_outside_stops_every_rank():
    case = scene(
        {"box": {"size": [2.0, 2.0], "cells": [2, 2]}, "regions": [{"soil": "clay"}]},
        soil={"clay": DAMPED},
        output={"receivers": {"in": [1.0, 1.0]}},
    )
    case.output.receivers["in"] = case.output.receivers["in"].model_copy(
        update={"place": (9.0, 1.0)}
    )
    with pytest.raises(SceneError, match=r"output.receivers.in: found \[9.0, 1.0\] outside"):
        simulate(case, WORLD)


def test_a_loop_that_does_not_converge_stops_every_rank():
    layers = [{"thickness": 8.0, "soil": "clay", "cells": 6}]
    case = scene(
        {"column": {"width": 1.0, "layers": layers}},
        soil={"clay": SOFT | {"curves": CURVES}},
        motion=[record(pga=0.5)],
        boundary={"left": "tied", "right": "tied"},
        lapses={"count": 2},
        effects={"equivalent_linear": {"max_iterations": 2, "tolerance": 1e-6}},
        output={"receivers": {"top": [0.5, 8.0]}},
    )
    with pytest.raises(SimulationError, match="lapse 0: equivalent-linear loop") as caught:
        simulate(case, WORLD)
    assert isinstance(caught.value.__cause__, EquivalentLinearError)
    assert caught.value.partial is None
    texts = WORLD.allgather(str(caught.value))
    assert len(set(texts)) == 1
