# SPDX-License-Identifier: MIT
"""Uniform refinement: what is divided fills the same space, without gaps, and keeps its names."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from support.meshes import gmsh_section, scene

from fenics_hytf.domain import build
from fenics_hytf.domain.files import read_mesh
from fenics_hytf.domain.grids import MeshData, box_mesh
from fenics_hytf.domain.refine import refined
from fenics_hytf.results import describe_scene
from fenics_hytf.scene import Box, Mesh, Scene, SceneError

# A corner's edges, by its number: the vectors whose determinant is the size of a cell of equal
# angles, times what a simplex is of a box.
_EDGES = {
    "triangle": (1, 2),
    "quadrilateral": (1, 2),
    "tetrahedron": (1, 2, 3),
    "hexahedron": (1, 2, 4),
}
_PART = {"triangle": 2, "quadrilateral": 1, "tetrahedron": 6, "hexahedron": 1}


def box(cell: str, times: int) -> MeshData:
    gdim = 2 if cell in ("triangle", "quadrilateral") else 3
    table = Box(size=(3.0, 2.0, 1.0)[:gdim], cells=(3 * times, 2 * times, times)[:gdim], cell=cell)
    mesh = box_mesh(table, Mesh(box=table), ["clay"])
    rows = mesh.points[mesh.cells].mean(axis=1)[:, 0] > 1.0
    return replace(mesh, region=rows.astype(np.int32), region_names=("clay", "sand"))


def sizes(mesh: MeshData) -> np.ndarray:
    corners = mesh.points[mesh.cells]
    edges = corners[:, _EDGES[mesh.cell_type]] - corners[:, :1]
    return np.linalg.det(edges) / _PART[mesh.cell_type]


@pytest.mark.parametrize("cell", list(_EDGES))
def test_a_box_is_the_box_of_twice_the_cells(cell):
    given, expected = box(cell, 1), box(cell, 2)
    found = refined(given)
    assert found.cells.shape == expected.cells.shape
    # the same nodes: none is there twice, and none is missing
    assert {*map(tuple, found.points)} == {*map(tuple, expected.points)}
    assert len(found.points) == len(expected.points)
    # equal sizes, to rounding: nothing overlaps, nothing is inside out in a box of one sense
    parts = len(found.cells) // len(given.cells)
    np.testing.assert_allclose(
        np.abs(sizes(found)), np.repeat(np.abs(sizes(given)), parts) / parts, rtol=1e-13
    )
    centre = found.points[found.cells].mean(axis=1)
    np.testing.assert_array_equal(found.region, centre[:, 0] > 1.0)
    assert found.planes == given.planes


@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron"])
def test_parts_of_facets_are_facets_of_parts(cell):
    given = box(cell, 1)
    left = np.flatnonzero(given.points[:, 0] == 0.0)
    on_left = (given.points[given.cells][:, :, 0] == 0.0).any(axis=1)
    facets = given.cells[on_left][:, ::2]  # corners with x = 0, in tensor order
    assert np.isin(facets, left).all()
    found = refined(replace(given, facets={"left": facets}))
    divided = found.facets["left"]
    assert len(divided) == 2 ** (given.points.shape[1] - 1) * len(facets)
    cells = found.cells[(found.points[found.cells][:, :, 0] == 0.0).any(axis=1)]
    assert {*map(frozenset, divided)} == {*map(frozenset, cells[:, ::2])}


def measures(mesh: MeshData) -> tuple[list[float], dict[str, float]]:
    """Area of each region, and length of each boundary."""
    x, y = np.moveaxis(mesh.points[mesh.cells], -1, 0)
    if mesh.cells.shape[1] == 4:  # round the cell, not in tensor order
        x, y = x[:, [0, 1, 3, 2]], y[:, [0, 1, 3, 2]]
    area = np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)) / 2
    ends = {name: mesh.points[nodes] for name, nodes in mesh.facets.items()}
    lengths = {
        name: float(np.linalg.norm(x[:, 1] - x[:, 0], axis=1).sum()) for name, x in ends.items()
    }
    return list(np.bincount(mesh.region, area)), lengths


@pytest.mark.parametrize("quads", [False, True])
def test_a_file_divided_twice(tmp_path, quads):
    """Areas of soils and lengths of boundaries stay; cells are sixteen times as many."""
    file = gmsh_section(tmp_path / "a.msh", quads=quads)
    given = read_mesh(file, ("clay", "sand"))
    found = refined(refined(given))
    for before, after in zip(measures(given), measures(found), strict=True):
        assert after == pytest.approx(before, rel=1e-13)  # rounding
    domain = build(scene({"file": str(file), "refine": 2}), MPI.COMM_SELF)
    assert domain.num_cells == len(found.cells) == 16 * len(given.cells)


def test_curved_cells_are_refused(tmp_path):
    file = str(gmsh_section(tmp_path / "a.msh", order=2))
    with pytest.raises(SceneError, match=r"mesh\.refine: found cells with curved edges"):
        build(scene({"file": file, "refine": 1}), MPI.COMM_SELF)


@pytest.mark.parametrize("times", [-1, 5, 0.5])
def test_numbers_that_are_refused(tmp_path, times):
    file = str(gmsh_section(tmp_path / "a.msh"))
    with pytest.raises(SceneError, match=r"mesh\.refine: found .* expected a whole number"):
        scene({"file": file, "refine": times})


def test_more_cells_than_can_be_made(tmp_path, monkeypatch):
    file = str(gmsh_section(tmp_path / "a.msh"))
    monkeypatch.setattr("fenics_hytf.domain.domain.MOST_CELLS", 1000)
    with pytest.raises(SceneError, match=r"mesh\.refine: found 4, which makes \d+ cells"):
        build(scene({"file": file, "refine": 4}), MPI.COMM_SELF)


def test_a_box_has_numbers_of_cells():
    mesh = {"box": {"size": [1.0, 1.0], "cells": [1, 1]}, "refine": 1}
    with pytest.raises(SceneError, match=r"mesh\.refine: found 1; expected nothing without file"):
        Scene.from_dict(scene({"box": mesh["box"]}, ("clay",)).data | {"mesh": mesh})


@pytest.mark.mpi
def test_a_file_divided_on_several_ranks(shared_path):
    file = shared_path / "a.msh"
    if MPI.COMM_WORLD.rank == 0:
        gmsh_section(file, quads=True)
    MPI.COMM_WORLD.Barrier()
    fine = scene({"file": str(file), "refine": 1})
    mine, alone = build(fine, MPI.COMM_WORLD), build(fine, MPI.COMM_SELF)
    assert mine.num_cells == alone.num_cells
    np.testing.assert_array_equal(
        mine.gather_cells(mine.regions), alone.gather_cells(alone.regions)
    )
    for name, facets in alone.boundaries.items():
        assert MPI.COMM_WORLD.allreduce(len(mine.boundaries[name])) >= len(facets)  # some by both


def test_it_is_told(tmp_path):
    file = str(gmsh_section(tmp_path / "a.msh"))
    told = describe_scene(scene({"file": file, "refine": 2}), ("clay", "sand"))
    assert told["mesh"]["text"].startswith("a.msh, every edge in 4, degree 1")
