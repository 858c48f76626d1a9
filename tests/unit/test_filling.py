# SPDX-License-Identifier: MIT
"""How far points fill cells, what follows for unknowns and matrices, and what comes off.

The filling is held against a count on the grid written here; matrices of several ranks against
those of one.
"""

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from support.cells import empty_a_cell
from support.meshes import MOTION, SOIL, scene

from fenics_hytf.domain import build, side_column
from fenics_hytf.lapse import (
    DetachedError,
    Equations,
    FillingSurvey,
    material,
    seed_points,
    survey,
)
from fenics_hytf.operators import InternalForce, isotropic_stress
from fenics_hytf.particles import move
from fenics_hytf.scene import SceneError
from fenics_hytf.simulation import simulate

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
WIDTH, HEIGHT = 12, 8  # cells of 1 m
LEVEL = [{"soil": "clay", "below": 5.0}, {"soil": "air"}]
SLOPE = [
    {"soil": "clay", "polygon": [[0, 0], [12, 0], [12, 2], [7, 2], [3, 6], [0, 6]]},
    {"soil": "air"},
]
CLUMP = [[5, 6], [7, 6], [7, 7], [5, 7]]  # two cells with nothing round them
TIED = {"left": "tied", "right": "tied"}
# Near the first resonance of 5 m of this soil, 10 Hz.
RESONANT = {"amplitude": 1.0, "frequency": 9.0, "cycles": 1, "samples": 16}
ROLLERS = {"left": "roller", "right": "roller"}


def section(regions=LEVEL, boundary=TIED, mesh=None, **sections):
    """A scene of 12 m x 8 m with air in it."""
    grid = {
        "box": {"size": [12.0, 8.0], "cells": [WIDTH, HEIGHT]},
        "regions": regions,
        "empty": ["air"],
    }
    usual = {"boundary": boundary, "effects": {"convection": True}}
    return scene(grid | (mesh or {}), ("clay",), **(usual | sections))


def ground(case, comm=WORLD, moved=None):
    """Domain, points, which may have moved by a function of place, and how they fill the cells."""
    domain = build(case, comm)
    points = seed_points(case, domain)
    if moved is not None:
        move(domain.mesh, points, moved(points.x))
    survey_of = FillingSurvey(case, domain)
    return SimpleNamespace(domain=domain, points=points, filling=survey_of(points), again=survey_of)


def slid(x: np.ndarray) -> np.ndarray:
    """The upper ground moves to the right and settles, so that cells fill in part; sides stay."""
    inside = np.sin(np.pi * np.clip(x[:, 0] / 12, 0, 1)) * (x[:, 1] > 1)
    return np.column_stack([0.4 * inside, -0.35 * inside * x[:, 1] / 6])


def counted(points, comm) -> dict[str, np.ndarray]:
    """The filling of the grid, from the places and volumes of the points alone."""
    x, volume = (
        np.concatenate(part)
        for part in zip(*comm.allgather((points.x, points.volume)), strict=True)
    )
    share = np.zeros((HEIGHT, WIDTH))
    column, row = np.floor(x).astype(int).T
    np.add.at(share, (row, column), volume)
    filled = share > 0
    edge = np.zeros_like(filled)
    edge[:, 1:] |= filled[:, 1:] & ~filled[:, :-1]
    edge[:, :-1] |= filled[:, :-1] & ~filled[:, 1:]
    edge[1:] |= filled[1:] & ~filled[:-1]
    edge[:-1] |= filled[:-1] & ~filled[1:]
    return {"share": share.ravel(), "filled": filled.ravel(), "edge": edge.ravel()}


def emptied(case, middle, comm=WORLD):
    """Level ground, a cell's points moved to its neighbours, and its soil left where it was."""
    domain = build(case, comm)
    points = seed_points(case, domain)
    empty_a_cell(domain.mesh, points, middle)
    return SimpleNamespace(
        domain=domain, points=points, filling=FillingSurvey(case, domain)(points)
    )


# ---------------------------------------------------------------- filling


@pytest.mark.mpi
def test_level_ground_is_whole_but_for_its_surface():
    filling = ground(section()).filling
    rows = np.arange(WIDTH * HEIGHT) // WIDTH
    np.testing.assert_array_equal(filling.filled, rows < 5)
    np.testing.assert_array_equal(filling.edge, rows == 4)
    np.testing.assert_array_equal(filling.whole, rows < 4)
    np.testing.assert_allclose(filling.share, (rows < 5).astype(float), rtol=1e-15)
    np.testing.assert_allclose(filling.weight, filling.share, rtol=1e-15)
    assert not filling.loose.any()


@pytest.mark.mpi
def test_a_cell_without_a_point_is_a_gap_where_soil_fills_it():
    found = emptied(section(), [5.5, 2.5]).filling
    cells = np.arange(WIDTH * HEIGHT)
    np.testing.assert_array_equal(found.gap, cells == 2 * WIDTH + 5)
    assert found.share[found.gap] == 0 and found.whole[found.gap]
    np.testing.assert_array_equal(found.edge, cells // WIDTH == 4)
    np.testing.assert_array_equal(found.filled, cells // WIDTH < 5)
    np.testing.assert_allclose(found.fill, found.filled.astype(float), atol=1e-13)


@pytest.mark.mpi
def test_there_is_no_gap_at_the_surface():
    found = emptied(section(), [5.5, 4.5]).filling
    assert not found.gap.any() and not found.filled[4 * WIDTH + 5]


@pytest.mark.mpi
def test_a_gap_has_the_soil_that_fills_it():
    both = [{"soil": "sand", "below": 2.0}, *LEVEL]
    grid = {"box": {"size": [12.0, 8.0], "cells": [WIDTH, HEIGHT]}, "regions": both}
    soils = {"boundary": TIED, "effects": {"convection": True}}
    case = scene(grid | {"empty": ["air"]}, ("sand", "clay"), **soils)
    for height, soil in ((1.5, "sand"), (2.5, "clay")):
        found = emptied(case, [5.5, height])
        ground = survey(case, found.domain, found.points, found.filling)
        gap = np.flatnonzero(found.filling.gap)
        assert found.domain.region_names[ground.region[gap[0]]] == soil
        assert ground.shear_modulus[gap[0]] == case.soil[soil].elastic.shear_modulus


@pytest.mark.mpi
def test_the_filling_is_the_count_of_points_on_any_ranks():
    case = section(SLOPE, ROLLERS)
    found, alone = ground(case, moved=slid), ground(case, SELF, slid)
    expected = counted(found.points, WORLD)
    for name, values in expected.items():
        np.testing.assert_allclose(getattr(found.filling, name), values, rtol=1e-14, err_msg=name)
        np.testing.assert_array_equal(getattr(found.filling, name), getattr(alone.filling, name))
    weight = np.where(expected["edge"], np.minimum(expected["share"], 1), expected["filled"])
    np.testing.assert_allclose(found.filling.weight, weight, rtol=1e-14)
    loose = expected["edge"] & (expected["share"] < 0.9)
    np.testing.assert_array_equal(found.filling.loose, loose)
    assert loose.any() and (expected["edge"] & ~loose).any()  # both kinds are there


@pytest.mark.mpi
def test_ghost_facets_are_those_between_loose_and_filled_cells():
    found = ground(section(SLOPE, ROLLERS), moved=slid)
    domain, filling = found.domain, found.filling
    grid = lambda cells: cells.reshape(HEIGHT, WIDTH)  # noqa: E731
    filled, loose = grid(filling.filled), grid(filling.loose)
    expected = 0
    for a, b in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        expected += (filled[a] & filled[b] & (loose[a] | loose[b])).sum()
    facets = filling.ghost_facets(domain)
    mine = facets < domain.mesh.topology.index_map(domain.mesh.topology.dim - 1).size_local
    assert WORLD.allreduce(int(mine.sum())) == expected > 0
    assert filling.ghost(domain) is not None
    assert ground(section(SLOPE, ROLLERS)).filling.ghost(domain) is None  # as it was seeded


def test_same_cells_tells_whether_matrices_have_other_entries():
    case = section(SLOPE, ROLLERS)
    whole, moved = ground(case, SELF).filling, ground(case, SELF, slid).filling
    shaken = ground(case, SELF, lambda x: 1e-3 * slid(x)).filling
    assert whole.same_cells(whole) and whole.same_cells(shaken)
    assert not whole.same_cells(moved)


# ---------------------------------------------------------------- unknowns


def rows_of(T: PETSc.Mat, domain) -> tuple[np.ndarray, np.ndarray]:
    """Places of this rank's nodes, and whether T has an entry in their rows, ``(n, gdim)``."""
    start, _, _ = T.getValuesCSR()
    x = domain.V.tabulate_dof_coordinates()[: (len(start) - 1) // domain.gdim, : domain.gdim]
    return x, (np.diff(start) > 0).reshape(len(x), -1)


def touched(x: np.ndarray, filled: np.ndarray) -> np.ndarray:
    """Whether a place touches a filled cell of the grid."""
    cells = np.argwhere(filled.reshape(HEIGHT, WIDTH))[:, ::-1]
    inside = np.abs(x[:, None] - cells - 0.5) <= 0.5 + 1e-9
    return inside.all(axis=2).any(axis=1)


@pytest.mark.mpi
@pytest.mark.parametrize("degree", [1, 2])
def test_nodes_of_empty_cells_are_no_unknowns(degree):
    case = section(SLOPE, ROLLERS, {"degree": degree})
    found = ground(case, moved=slid)
    equations = Equations(case, found.domain, Counter())
    assert equations.occupy(found.filling)
    x, moves = rows_of(equations.T, found.domain)
    free = touched(x, found.filling.filled) & (x[:, 1] > 1e-9)
    at_side = (x[:, 0] < 1e-9) | (x[:, 0] > 12 - 1e-9)
    np.testing.assert_array_equal(moves[:, 0], free & ~at_side)
    np.testing.assert_array_equal(moves[:, 1], free)
    assert equations.num_unknowns == WORLD.allreduce(int(moves.sum()))
    # A row picks one unknown; a field that keeps the constraints comes back as it was.
    _, _, values = equations.T.getValuesCSR()
    assert np.all(values == 1.0)
    u = np.zeros((len(found.domain.V.tabulate_dof_coordinates()), 2))
    u[: len(x)] = np.sin(3 * x + [0.0, 1.0]) * moves
    back = equations.unknowns.expand(equations.unknowns.restrict(u))
    np.testing.assert_allclose(back[: len(x)], u[: len(x)], atol=1e-15)
    equations.destroy()


@pytest.mark.mpi
def test_tied_nodes_beside_air_move_with_their_partners():
    """Left of the slope is air at heights where there is ground on the right."""
    regions = [{"soil": "clay", "polygon": [[0, 0], [12, 0], [12, 6], [8, 6], [0, 2]]}, LEVEL[1]]
    case = section(regions)
    found = ground(case)
    equations = Equations(case, found.domain, Counter())
    equations.occupy(found.filling)
    x, moves = rows_of(equations.T, found.domain)
    place = x.copy()
    width = np.array([12.0, 0.0])
    images = [place, place + width, place - width]  # a place and those tied to it
    at_side = (x[:, 0] < 1e-9) | (x[:, 0] > 12 - 1e-9)
    here = touched(images[0], found.filling.filled)
    beyond = [touched(there, found.filling.filled) for there in images[1:]]
    free = (here | (at_side & (beyond[0] | beyond[1]))) & (x[:, 1] > 1e-9)
    np.testing.assert_array_equal(moves, np.stack([free, free], axis=1))
    assert WORLD.allreduce(int((free & ~here).sum())) == 4  # at 3 to 6 m on the left
    equations.destroy()


@pytest.mark.mpi
def test_level_ground_below_air_moves_as_without_it(figure):
    """No ghost, no unknown, no dashpot of the air: a receiver sees the same, beside any sides."""
    rock = {"density": 2243.0, "shear_wave_velocity": 760.0, "poisson": 0.25, "damping": 0.01}
    # With dashpots of the air in it, a free field moves the ground 23 % off.
    for kind in ("tied", "dashpot", "free_field"):
        seen = []
        for regions, size, cells in ((LEVEL, 8.0, 8), ([], 5.0, 5)):
            mesh = {"box": {"size": [12.0, size], "cells": [6, cells]}}
            air = {"regions": regions, "empty": ["air"]} if regions else {}
            case = scene(
                mesh | air,
                ("clay",),
                soil={"clay": SOIL | {"damping": 0.05}},
                motion=[{"direction": "x", "harmonic": RESONANT, "input": "outcrop"}],
                boundary={"left": kind, "right": kind, "base": {"compliant": rock}},
                output={"receivers": {"top": [6.0, 5.0], "corner": [0.0, 5.0]}},
            )
            seen.append(simulate(case, WORLD).lapses[0].acceleration)
        error = np.abs(seen[0] - seen[1]).max() / np.abs(seen[1]).max()
        figure(f"level ground below air, {kind} sides, {WORLD.size} ranks", error, 1e-12)


# ---------------------------------------------------------------- matrices


def matrices(comm) -> list[complex]:
    """Numbers of unknowns, and uᵀAv of stiffness, ghost and mass for fields of place."""
    case = section(SLOPE, ROLLERS, soil={"clay": SOIL | {"damping": 0.05}})
    found = ground(case, comm, slid)
    domain, filling = found.domain, found.filling
    equations = Equations(case, domain, Counter())
    equations.occupy(filling)
    equations.weigh(found.points)
    soil = survey(case, domain, found.points, filling)
    law = material(soil, soil.secant(np.zeros(domain.num_cells)), case.solver)
    lapse = equations.assemble(soil, law)
    parts = [matrix for matrix, _ in lapse.system.terms]
    assert len(parts) == 3  # real, imaginary, mass
    x = domain.V.tabulate_dof_coordinates()[:, :2]
    q = []
    for phase in (0.0, 1.0):
        vector = parts[0].createVecRight()
        vector.array[:] = equations.unknowns.restrict(np.sin(x + phase) + x[:, ::-1] ** 2)
        q.append(vector)
    found_values = [equations.num_unknowns]
    for matrix in parts:
        force = matrix @ q[0]
        found_values += [force.tDot(q[0]), force.tDot(q[1])]
    found_values.append(lapse.loads[0].tDot(q[1]))
    equations.destroy()
    return found_values


@pytest.mark.mpi
def test_unknowns_and_matrices_are_the_same_on_any_ranks():
    found, alone = matrices(WORLD), matrices(SELF)
    np.testing.assert_allclose(found, alone, rtol=1e-12)


@pytest.mark.mpi
@pytest.mark.parametrize("locking", [False, True])
@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron"])
def test_the_stiffness_is_that_of_the_force(cell, locking, figure):
    """K u is the force of the stress D B u, at Gauss points or at points, and of the ghost."""
    gdim = 2 if cell == "quadrilateral" else 3
    size, cells = [4.0] * (gdim - 1) + [5.0], [4] * (gdim - 1) + [5]
    case = scene(
        {
            "box": {"size": size, "cells": cells, "cell": cell},
            "regions": [{"soil": "clay", "below": 3.0}, {"soil": "air"}],
            "empty": ["air"],
        },
        ("clay",),
        effects={"convection": True, "locking": locking},
    )

    def up(x):
        return 0.4 * (x[:, [-1]] > 2) * np.eye(gdim)[-1] * (0.5 + x[:, [0]] / 8)

    found = ground(case, moved=up)
    domain, filling = found.domain, found.filling
    equations = Equations(case, domain, Counter())
    equations.occupy(filling)
    equations.weigh(found.points)
    soil = survey(case, domain, found.points, filling)
    law = material(soil, soil.secant(np.zeros(domain.num_cells)), case.solver)
    K = equations.assemble(soil, law).system.terms[0][0]
    force = InternalForce(domain, locking)
    filling.integrate(force, domain, found.points)
    # Points know their own stress, and cells inside read it at Gauss points: the same there.
    x = domain.V.tabulate_dof_coordinates()[:, :gdim]
    q = equations.unknowns.restrict(np.cos(x + x[:, ::-1] ** 2))
    vector = K.createVecRight()
    vector.array[:] = q
    constants = law.real.at(domain.input_cells[force.sites.cell])
    stress = isotropic_stress(force.strain(equations.unknowns.expand(q)), *constants)
    expected = equations.unknowns.collect(force(stress))
    ghost = filling.ghost(domain)
    held = ghost.create_matrix()
    ghost.assemble(held, law.real.youngs_modulus[domain.input_cells])
    expected.axpy(1.0, held.ptap(equations.T) @ vector)
    actual = K @ vector
    scale = actual.norm()
    actual.axpy(-1.0, expected)
    name = f"K u against the force, {cell}{', locking' if locking else ''}, {WORLD.size} ranks"
    figure(name, actual.norm() / scale, 1e-13)
    volume = WORLD.allreduce(force.volume.sum())
    inside = filling.whole.sum() + WORLD.allreduce(
        found.points.volume[filling.edge[domain.input_cells][found.points.cell]].sum()
    )
    assert volume == pytest.approx(inside, rel=1e-13)  # cells of a cubic metre
    equations.destroy()


def test_points_are_read_where_they_are_at_the_edge():
    """Values of points pass to Gauss points inside, and unchanged to the points at the edge."""
    found = ground(section(SLOPE, ROLLERS), SELF, slid)
    force = InternalForce(found.domain)
    found.filling.integrate(force, found.domain, found.points)
    R = force.resampling(found.points)
    assert R.shape == (len(force.sites), len(found.points))
    values = found.points.x @ [2.0, -1.0] + 3.0
    at_edge = found.filling.edge[found.domain.input_cells][found.points.cell]
    np.testing.assert_array_equal((R @ values)[-at_edge.sum() :], values[at_edge])
    assert sparse.issparse(R) and np.allclose(R @ np.ones(len(values)), 1.0, rtol=1e-13)


# ---------------------------------------------------------------- sides beside air


@pytest.mark.mpi
def test_the_column_beyond_a_side_ends_where_the_soil_does():
    domain = ground(section(SLOPE, ROLLERS)).domain
    for name, height in (("left", 6.0), ("right", 2.0)):
        side = side_column(domain, name)
        levels = np.unique(side.domain.mesh.geometry.x[:, 1])
        np.testing.assert_allclose(levels, np.arange(height + 1), atol=1e-15)
        places = domain.V.tabulate_dof_coordinates()[side.nodes]
        assert np.all(places[:, 1] <= height + 1e-9)
        assert WORLD.allreduce(len(side.nodes)) == height + 1
        count = (side.cell[: domain.num_owned_cells] >= 0).sum()
        assert WORLD.allreduce(int(count)) == height


@pytest.mark.mpi
def test_the_column_of_ground_that_lies_below_the_datum():
    """A surface at height 0 and below is above no air."""
    domain = ground(section()).domain
    domain.mesh.geometry.x[:, 1] -= 5.0
    side = side_column(domain, "left")
    assert WORLD.allreduce(len(side.nodes)) == 6
    assert np.all(side.places[:, 1] <= 1e-9)


@pytest.mark.mpi
def test_a_free_field_of_air():
    regions = [{"soil": "clay", "polygon": [[2, 0], [12, 0], [12, 5], [2, 5]]}, {"soil": "air"}]
    domain = build(section(regions, ROLLERS), WORLD)
    with pytest.raises(SceneError, match=r"boundary.left: found no soil; expected soil beside"):
        side_column(domain, "left")


# ---------------------------------------------------------------- what comes off


def detached(policy: str, regions=None, boundary=TIED, **sections):
    regions = regions or [{"soil": "clay", "polygon": CLUMP}, *LEVEL]
    return section(regions, boundary, points={"detached": policy}, **sections)


@pytest.mark.mpi
@pytest.mark.parametrize("policy", ["park", "delete"])
def test_a_clump_is_taken_out(policy):
    found = ground(detached(policy))
    np.testing.assert_array_equal(found.filling.filled, ground(section(), SELF).filling.filled)
    ledger = found.points.ledger(WORLD)
    gone = {"park": (8, 0), "delete": (0, 8)}[policy]  # four points a cell
    assert (ledger.parked, ledger.deleted) == gone
    mass = 2 * SOIL["density"]
    assert ledger.parked_mass + ledger.deleted_mass == pytest.approx(mass, rel=1e-15)
    assert ledger.num_points == 4 * 5 * WIDTH
    assert ledger.initial_mass == pytest.approx(62 * SOIL["density"], rel=1e-14)
    assert ledger.imbalance <= 1e-14
    # It is seen once; nothing is left of it to come off again.
    assert found.again(found.points).same_cells(found.filling)
    assert found.points.ledger(WORLD) == ledger


@pytest.mark.mpi
def test_a_clump_is_an_error_on_every_rank():
    with pytest.raises(DetachedError, match=r"found 2 cells .* first: 77, 78;") as caught:
        ground(detached("error"))
    assert caught.value.cells == [6 * WIDTH + 5, 6 * WIDTH + 6]


@pytest.mark.mpi
def test_cells_that_touch_at_a_corner_do_not_hang_together():
    # The second cell stands on the corner of the first, which stands on the ground.
    corner = [[[4, 5], [5, 5], [5, 6], [4, 6]], [[5, 6], [6, 6], [6, 7], [5, 7]]]
    regions = [*({"soil": "clay", "polygon": p} for p in corner), *LEVEL]
    found = ground(detached("park", regions))
    assert found.points.ledger(WORLD).parked == 4
    assert found.filling.filled[5 * WIDTH + 4] and not found.filling.filled[6 * WIDTH + 5]


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("boundary", "held"),
    [
        (ROLLERS, False),  # it would fall along the wall
        (TIED, False),
        ({"left": "free_field", "right": "free_field"}, False),
        ({"left": "dashpot", "right": "dashpot"}, False),
        ({"left": "fixed", "right": "fixed"}, True),
    ],
    ids=str,
)
def test_what_holds_a_body_at_a_side(boundary, held):
    regions = [{"soil": "clay", "polygon": [[0, 6], [2, 6], [2, 7], [0, 7]]}, *LEVEL]
    found = ground(detached("park", regions, boundary))
    assert found.points.ledger(WORLD).parked == (0 if held else 8)


def test_ground_on_rollers_below_and_beside_is_held():
    boundary = ROLLERS | {"base": "roller"}
    assert ground(detached("error", LEVEL, boundary), SELF).filling.filled.sum() == 5 * WIDTH
    # Nothing holds level ground sideways when it is shaken upwards: what rests on the base is held.
    upwards = [MOTION | {"direction": "y"}]
    case = detached("error", LEVEL, TIED | {"base": "roller"}, motion=upwards)
    assert ground(case, SELF).filling.filled.sum() == 5 * WIDTH


@pytest.mark.mpi
@pytest.mark.parametrize("policy", ["park", "error"])
def test_nothing_that_is_held_is_left(policy):
    case = detached(policy, LEVEL)
    with pytest.raises(DetachedError, match=r"found 72 cells .*; expected ground that is held"):
        ground(case, moved=lambda x: np.tile([0.0, 1.5], (len(x), 1)))


@pytest.mark.mpi
def test_a_run_books_what_comes_off():
    result = simulate(detached("park"), WORLD)
    ledger = result.lapses[0].ledger
    assert (ledger.num_points, ledger.parked) == (240, 8)
    assert ledger.imbalance <= 1e-14
    assert np.isfinite(result.lapses[0].cells.peak_acceleration).all()
    # known before anything is shaken: a fault of the scene
    with pytest.raises(SceneError, match=r"with nothing held.*expected soil on held"):
        simulate(detached("error"), WORLD)


# ---------------------------------------------------------------- mesh.empty


@pytest.mark.parametrize(
    ("mesh", "fault"),
    [
        ({"empty": ["clay"]}, r"mesh.empty\[0\]: found \"clay\", a soil; expected the name of a"),
        ({"empty": ["air", "fog"]}, r"mesh.empty\[1\]: found 'fog', no region of the mesh"),
        ({"empty": []}, r"mesh.regions\[1\].soil: found \"air\"; expected one of the soils clay"),
        ({"empty": "air"}, r"mesh.empty: found \"air\"; expected names of regions"),
        ({"empty": [["air"]]}, r"mesh.empty\[0\]: found \[\"air\"\]; expected names of regions"),
        ({"regions": LEVEL[1:]}, r"mesh.empty: found every region of the mesh; expected one with"),
    ],
    ids=str,
)
def test_faults_of_empty_regions(mesh, fault):
    with pytest.raises(SceneError, match=fault):
        build(section(mesh=mesh), SELF)


def test_layers_of_a_column_can_be_empty():
    layers = [
        {"thickness": 2.0, "soil": "air", "cells": 2},
        {"thickness": 3.0, "soil": "clay", "cells": 3},
    ]
    mesh = {"column": {"width": 1.0, "layers": layers}, "empty": ["air"]}
    found = ground(scene(mesh, ("clay",), boundary=TIED), SELF)
    np.testing.assert_array_equal(found.filling.filled, [False, False, True, True, True])
    mesh["empty"] = ["air", "water"]
    with pytest.raises(SceneError, match=r"mesh.empty\[1\]: found 'water', no region of the mesh"):
        build(scene(mesh, ("clay",), boundary=TIED), SELF)
