# SPDX-License-Identifier: MIT
"""The constraint matrix T against counts by hand, and against its meaning, node by node.

Columns of T are numbered differently on different ranks. T Tᵀ is not: its entry is 1 where two
displacements are the same unknown, 0 elsewhere.
"""

import meshio
import numpy as np
import pytest
from mpi4py import MPI
from support.meshes import gmsh_section, scene

from fenics_hytf.domain import build, constraint_matrix
from fenics_hytf.scene import SceneError

pytestmark = pytest.mark.mpi

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF


def box(size, cells, cell, degree=1, boundary=None, comm=WORLD):
    mesh = {"box": {"size": size, "cells": cells, "cell": cell}, "degree": degree}
    return build(scene(mesh, ("clay",), boundary=boundary or {}), comm)


def on_rank_zero(write, path):
    if WORLD.rank == 0:
        write(path)
    WORLD.Barrier()
    return {"file": str(path)}


def constrained(domain, boundary) -> tuple[np.ndarray, np.ndarray]:
    """Places of all nodes, and T with rows in their order.

    Returns:
        Shapes ``(num_nodes, gdim)`` and ``(num_nodes, gdim, num_unknowns)``.
    """
    T = constraint_matrix(domain, boundary)
    indptr, indices, values = T.getValuesCSR()
    mine = np.zeros((len(indptr) - 1, T.getSize()[1]))
    row = np.repeat(np.arange(len(mine)), np.diff(indptr))
    assert np.all(values == 1.0)
    mine[row, indices] = values.real
    T.destroy()
    nodes = len(mine) // domain.gdim
    x = domain.V.tabulate_dof_coordinates()[:nodes, : domain.gdim]
    parts = domain.comm.allgather((x, mine.reshape(nodes, domain.gdim, -1)))
    x, whole = (np.concatenate(part) for part in zip(*parts, strict=True))
    x = x.round(9)
    order = np.lexsort(x.T)
    return x[order], whole[order]


def unknowns(domain, boundary) -> int:
    T = constraint_matrix(domain, boundary)
    count = T.getSize()[1]
    T.destroy()
    return count


# Nodes a direction: n + 1 of degree 1, 2 n + 1 of degree 2, whatever the cell.
PLANE = [("quadrilateral", 1), ("quadrilateral", 2), ("triangle", 1), ("triangle", 2)]
SPACE = [("hexahedron", 1), ("hexahedron", 2), ("tetrahedron", 1), ("tetrahedron", 2)]


@pytest.mark.parametrize(("cell", "degree"), PLANE)
def test_unknowns_in_the_plane(cell, degree):
    nx, ny = 4 * degree, 3 * degree  # intervals between nodes
    domain = box([4.0, 3.0], [4, 3], cell, degree)
    assert unknowns(domain, {}) == 2 * (nx + 1) * ny
    assert unknowns(domain, {"base": "fixed"}) == 2 * (nx + 1) * ny
    assert unknowns(domain, {"base": "roller"}) == 2 * (nx + 1) * (ny + 1) - (nx + 1)
    assert unknowns(domain, {"left": "roller", "right": "roller"}) == 2 * (nx + 1) * ny - 2 * ny
    assert unknowns(domain, {"left": "fixed"}) == 2 * nx * ny
    assert unknowns(domain, {"top": "roller"}) == 2 * (nx + 1) * ny - (nx + 1)
    tied = {"left": "tied", "right": "tied"}
    assert unknowns(domain, tied) == 2 * nx * ny
    assert unknowns(domain, {**tied, "top": "fixed"}) == 2 * nx * (ny - 1)
    assert unknowns(domain, {**tied, "base": "roller"}) == 2 * nx * (ny + 1) - nx
    assert unknowns(domain, {"base": "free", "left": "fixed"}) == 2 * nx * (ny + 1)


@pytest.mark.parametrize(("cell", "degree"), SPACE)
def test_unknowns_in_space(cell, degree):
    nx, ny, nz = 3 * degree, 2 * degree, 2 * degree
    domain = box([3.0, 2.0, 2.0], [3, 2, 2], cell, degree)
    sides, ends = {"left": "tied", "right": "tied"}, {"front": "tied", "back": "tied"}
    assert unknowns(domain, {}) == 3 * (nx + 1) * (ny + 1) * nz
    assert unknowns(domain, sides) == 3 * nx * (ny + 1) * nz
    assert unknowns(domain, ends) == 3 * (nx + 1) * ny * nz
    assert unknowns(domain, sides | ends) == 3 * nx * ny * nz
    assert unknowns(domain, sides | ends | {"base": "roller"}) == nx * ny * (3 * nz + 2)
    rollers = {"front": "roller", "back": "roller"}
    assert unknowns(domain, sides | rollers) == nx * nz * (3 * (ny + 1) - 2)


@pytest.mark.parametrize("boundary", [{}, {"left": "tied", "right": "tied"}])
def test_each_row_picks_one_unknown_and_held_ones_none(boundary):
    domain = box([4.0, 3.0], [4, 3], "quadrilateral", 2)
    x, T = constrained(domain, boundary)
    # T takes all ones to one wherever nothing is held: rigid translations are representable.
    np.testing.assert_array_equal(T.sum(axis=2), np.where(x[:, 1] == 0, 0, 1)[:, None] * [1, 1])
    # Each unknown moves one node, or two that are tied: 7 nodes a side, one of them held.
    values, counts = np.unique(T.sum(axis=(0, 1)), return_counts=True)
    tied = 2 * 6 if boundary else 0
    expected = {1.0: 2 * 9 * 6 - 2 * tied} | ({2.0: tied} if boundary else {})
    assert dict(zip(values.tolist(), counts.tolist(), strict=True)) == expected


def expected_families(x, boundary, size) -> np.ndarray:
    """T Tᵀ from the meaning of the boundaries, written without looking at any mesh."""
    gdim = x.shape[1]
    place = x.copy()
    held = np.zeros(x.shape, bool)
    names = {"left": (0, 0.0), "right": (0, size[0])}
    if gdim == 3:
        names |= {"front": (1, 0.0), "back": (1, size[1])}
    names |= {"base": (gdim - 1, 0.0), "top": (gdim - 1, size[-1])}
    for name, (axis, at) in names.items():
        kind = boundary.get(name, "rigid" if name == "base" else "free")
        here = np.isclose(x[:, axis], at)
        if kind in ("rigid", "fixed"):
            held[here] = True
        elif kind == "roller":
            held[here, axis] = True
        elif kind == "tied" and at:
            place[here, axis] = 0.0
    same = np.isclose(place[:, None], place[None]).all(axis=2)
    # A tied family is held where one of it is.
    held = (same @ held.astype(float)) > 0
    free = ~held.ravel()
    whole = np.kron(same, np.eye(gdim))
    return whole * free[:, None] * free[None, :]


TIED = {"left": "tied", "right": "tied"}


@pytest.mark.parametrize(
    "boundary",
    [
        {},
        {"left": "roller", "right": "roller"},
        {"left": "fixed", "top": "roller"},
        TIED,
        {**TIED, "base": "roller", "top": "fixed"},
    ],
    ids=str,
)
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_meaning_in_the_plane(cell, boundary):
    size = [3.0, 2.0]
    x, T = constrained(box(size, [3, 2], cell, 2), boundary)
    T = T.reshape(-1, T.shape[2])
    np.testing.assert_array_equal(T @ T.T, expected_families(x, boundary, size))


@pytest.mark.parametrize(
    "boundary",
    [
        {},
        TIED,
        {**TIED, "front": "tied", "back": "tied"},
        {**TIED, "front": "roller", "back": "fixed"},
        {**TIED, "front": "tied", "back": "tied", "base": "roller"},
    ],
    ids=str,
)
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_meaning_in_space(cell, boundary):
    size = [2.0, 3.0, 1.0]
    x, T = constrained(box(size, [2, 2, 1], cell, 1), boundary)
    T = T.reshape(-1, T.shape[2])
    np.testing.assert_array_equal(T @ T.T, expected_families(x, boundary, size))


def test_edges_shared_by_two_tied_pairs_are_one_family():
    boundary = {**TIED, "front": "tied", "back": "tied"}
    x, T = constrained(box([2.0, 3.0, 1.0], [2, 2, 1], "hexahedron"), boundary)
    corners = np.flatnonzero(
        np.isin(x[:, 0], [0.0, 2.0]) & np.isin(x[:, 1], [0.0, 3.0]) & (x[:, 2] == 1.0)
    )
    assert len(corners) == 4
    assert np.all(T[corners] == T[corners[0]])
    assert T[corners[0]].sum() == 3


@pytest.mark.parametrize("pinned", [4, 2], ids=["left", "right"])
def test_a_node_tied_to_a_held_one_is_held(pinned, shared_path):
    # The lower half of one side only is fixed: its partners on the other side are as well.
    groups = {
        "clay": (2, [1]),
        "sand": (2, [2]),
        "base": (1, [1]),
        "left": (1, [4, 7]),
        "right": (1, [2, 5]),
        "pin": (1, [pinned]),
    }
    mesh = on_rank_zero(lambda path: gmsh_section(path, groups=groups), shared_path / "a.msh")
    x, T = constrained(build(scene(mesh), WORLD), {**TIED, "pin": "fixed"})
    sides = np.isclose(x[:, 0], 0.0) | np.isclose(x[:, 0], 4.0)
    held = (sides & (x[:, 1] <= 1.0)) | (x[:, 1] == 0.0)
    np.testing.assert_array_equal(T.any(axis=2), np.tile(~held[:, None], 2))


# ---------------------------------------------------------------- what cannot be constrained


def refused(domain, boundary, shaken=()) -> dict[str, str]:
    with pytest.raises(SceneError) as caught:
        constraint_matrix(domain, boundary, shaken)
    return {fault.key: f"{fault.found}; {fault.expected}" for fault in caught.value.faults}


def test_tied_sides_of_unlike_meshes(shared_path):
    mesh = on_rank_zero(lambda path: gmsh_section(path, right=3), shared_path / "a.msh")
    for degree, nodes in ((1, 7), (2, 13)):
        domain = build(scene(mesh | {"degree": degree}, boundary=TIED), WORLD)
        found = refused(domain, TIED)
        assert list(found) == ["boundary.right"]
        assert f"{nodes} nodes against {2 * (nodes // 3) + 1} on" in found["boundary.right"]
        assert "mesh them alike" in found["boundary.right"]


def test_tied_sides_of_which_one_is_finer(shared_path):
    # Every node on the right has a partner on the left, but not the other way round.
    def write(path):
        x = np.array([[0, 0], [0, 1], [0, 2], [1, 0], [1, 2], [0.5, 1]], float)
        cells = [[0, 3, 5], [3, 4, 5], [4, 2, 5], [2, 1, 5], [1, 0, 5]]
        meshio.Mesh(np.column_stack([x, 0 * x[:, :1]]), [("triangle", cells)]).write(path)

    domain = build(scene(on_rank_zero(write, shared_path / "a.vtu"), ("clay",)), WORLD)
    found = refused(domain, TIED)["boundary.right"]
    assert found.startswith("2 nodes against 3 on 'left', 1 of them without a partner")
    assert "[0.0, 1.0]" in found


def moved_strip(path, shift):
    """Two by two squares of which the middle node on the right is elsewhere."""
    x = np.array([[i, j, 0] for j in range(3) for i in range(3)], float)
    x[5, 1] += shift
    cells = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]]
    meshio.Mesh(x, [("quad", np.array(cells))]).write(path)


def test_tied_sides_whose_nodes_do_not_face(shared_path):
    mesh = on_rank_zero(lambda path: moved_strip(path, 1e-3), shared_path / "a.vtu")
    found = refused(build(scene(mesh, ("clay",)), WORLD), TIED)["boundary.right"]
    assert "3 nodes against 3 on 'left', 2 of them without a partner" in found
    assert "[2.0, 1.001]" in found


def test_tied_sides_that_face_but_for_round_off(shared_path):
    mesh = on_rank_zero(lambda path: moved_strip(path, 1e-12), shared_path / "a.vtu")
    assert unknowns(build(scene(mesh, ("clay",)), WORLD), TIED) == 2 * 2 * 2


def test_tied_sides_that_touch_are_refused():
    """Sides thinner than round-off: each node faces more than one."""
    domain = box([4.0, 1e-12, 2.0], [1, 1, 1], "tetrahedron", comm=SELF)
    tied = dict.fromkeys(("left", "right", "front", "back"), "tied")
    with pytest.raises(SceneError, match="found nodes that are tied to themselves"):
        constraint_matrix(domain, tied)


def test_a_roller_on_a_slope(shared_path):
    mesh = on_rank_zero(gmsh_section, shared_path / "a.msh")
    domain = build(scene(mesh), WORLD)
    domain.boundaries["bent"] = np.unique(
        np.concatenate([domain.boundaries["left"], domain.boundaries["base"]])
    )
    found = refused(domain, {"bent": "roller"})["boundary.bent"]
    assert found.startswith("a side that is not parallel to an axis; a plane side")


def test_nothing_moves_with_the_base():
    domain = box([2.0, 1.0], [2, 1], "quadrilateral")
    rollers = {"base": "roller"}
    assert "in x;" in refused(domain, rollers, [0])["boundary"]
    assert "in x;" in refused(domain, rollers, [0, 1])["boundary"]
    assert "in x, y;" in refused(domain, {"base": "free"}, [0, 1])["boundary"]
    for boundary, shaken in (({}, [0, 1]), (rollers, [1]), ({**rollers, "left": "roller"}, [0, 1])):
        constraint_matrix(domain, boundary, shaken).destroy()


def test_a_file_without_base_holds_what_it_is_told(shared_path):
    groups = {"clay": (2, [1]), "sand": (2, [2]), "left": (1, [4, 7])}
    mesh = on_rank_zero(lambda path: gmsh_section(path, groups=groups), shared_path / "a.msh")
    domain = build(scene(mesh), WORLD)
    assert "nothing that moves with the base" in refused(domain, {}, [0])["boundary"]
    constraint_matrix(domain, {"left": "fixed"}, [0]).destroy()


def test_nothing_left_to_solve_for():
    domain = box([1.0, 1.0], [2, 1], "quadrilateral")
    assert list(refused(domain, {"top": "fixed"})) == ["boundary"]


def test_a_mesh_of_fewer_cells_than_ranks():
    domain = box([1.0, 1.0], [1, 1], "quadrilateral")
    assert unknowns(domain, {}) == 4
    assert unknowns(domain, TIED) == 2
