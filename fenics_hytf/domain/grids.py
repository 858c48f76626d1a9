# SPDX-License-Identifier: MIT
"""Structured meshes as plain arrays: the layered column and the box.

A mesh travels as :class:`MeshData` from here, or from a file, to the one place that hands it to
dolfinx. Cells and their numbers in it are the *input cells* that results and messages speak of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from fenics_hytf.scene import Box, Column, Fault, Mesh, SceneError

# Corners of a unit square or cube by their number in tensor order (x fastest), and its division
# into simplices of positive orientation (the cube's is Kuhn's: six tetrahedra round a diagonal).
_TRIANGLES = ((0, 1, 3), (0, 3, 2))
_TETRAHEDRA = ((0, 1, 3, 7), (0, 1, 7, 5), (0, 5, 7, 4), (0, 3, 2, 7), (0, 6, 4, 7), (0, 2, 6, 7))


@dataclass(frozen=True)
class MeshData:
    """A mesh as arrays.

    Attributes:
        points: Nodes [m], shape ``(num_nodes, gdim)``.
        cells: Nodes of each cell in dolfinx's order, shape ``(num_cells, nodes_per_cell)``.
        cell_type: ``triangle``, ``quadrilateral``, ``tetrahedron`` or ``hexahedron``.
        degree: Degree of the geometry, 1 or 2.
        region: Index into ``region_names``, -1 for a cell without soil, shape ``(num_cells,)``.
        region_names: Names of the regions, which are names of soils.
        planes: Boundaries that lie in a coordinate plane: name, axis and place [m].
        facets: Boundaries given by facets: name and nodes, shape ``(num_facets, n)``, in dolfinx's
            order of the facet's nodes.
    """

    points: npt.NDArray[np.float64]
    cells: npt.NDArray[np.int64]
    cell_type: str
    degree: int
    region: npt.NDArray[np.int32]
    region_names: tuple[str, ...]
    planes: dict[str, tuple[int, float]] = field(default_factory=dict)
    facets: dict[str, npt.NDArray[np.int64]] = field(default_factory=dict)


def emptied(data: MeshData, empty: Sequence[str]) -> MeshData:
    """A mesh whose regions of some names have no soil.

    Args:
        data: The mesh.
        empty: Names of those regions.

    Returns:
        The mesh, with -1 as the region of their cells.
    """
    kept = [name for name in data.region_names if name not in empty]
    number = [kept.index(name) if name in kept else -1 for name in data.region_names]
    return replace(data, region=np.array(number, np.int32)[data.region], region_names=tuple(kept))


def column_mesh(column: Column) -> MeshData:
    """Mesh a layered column, one cell wide, cells numbered from the top down.

    Args:
        column: Width [m] and layers, top down; the base is at y = 0.

    Returns:
        Quadrilaterals with the boundaries ``base``, ``top``, ``left`` and ``right``.
    """
    thickness = np.concatenate(
        [np.full(layer.cells, layer.thickness / layer.cells) for layer in column.layers]
    )
    depth = np.concatenate([[0.0], np.cumsum(thickness)])
    levels = column.height - depth[::-1]
    levels[0] = 0.0
    points, cells = _grid([np.array([0.0, column.width]), levels])
    names = tuple(dict.fromkeys(layer.soil for layer in column.layers))
    region = np.concatenate(
        [np.full(layer.cells, names.index(layer.soil), np.int32) for layer in column.layers]
    )
    return MeshData(
        points=points,
        cells=cells[::-1].copy(),
        cell_type="quadrilateral",
        degree=1,
        region=region,
        region_names=names,
        planes=box_sides(np.zeros(2), np.array([column.width, column.height])),
    )


def stack_mesh(
    levels: npt.NDArray[np.float64], soils: Sequence[str], width: float, gdim: int
) -> MeshData:
    """Mesh a stack of single cells, numbered from the bottom up.

    Args:
        levels: Heights of their faces, ascending [m], shape ``(num_cells + 1,)``.
        soils: Soil of each cell.
        width: Of the stack [m].
        gdim: Space dimension.

    Returns:
        Quadrilaterals or hexahedra with the boundaries of a box.
    """
    across = [np.array([0.0, width])] * (gdim - 1)
    points, cells = _grid([*across, levels])
    names = tuple(dict.fromkeys(soils))
    region = np.array([names.index(soil) for soil in soils], np.int32)
    low, high = np.zeros(gdim), np.full(gdim, width)
    low[-1], high[-1] = levels[0], levels[-1]
    cell_type = "quadrilateral" if gdim == 2 else "hexahedron"
    return MeshData(
        points=points,
        cells=cells,
        cell_type=cell_type,
        degree=1,
        region=region,
        region_names=names,
        planes=box_sides(low, high),
    )


def box_mesh(box: Box, mesh: Mesh, soils: Sequence[str]) -> MeshData:
    """Mesh a box with equal cells.

    Args:
        box: Size [m], number of cells along each axis, and cell type.
        mesh: The section with the regions; without any, one soil fills the box.
        soils: Names of the scene's soils.

    Returns:
        The mesh with the boundaries ``base``, ``top``, ``left``, ``right`` and in 3D ``front``,
        ``back``.

    Raises:
        SceneError: A cell's centroid lies in no region.
    """
    axes = [
        np.asarray(np.linspace(0.0, size, n + 1))
        for size, n in zip(box.size, box.cells, strict=True)
    ]
    points, cells = _grid(axes)
    if box.cell == "triangle":
        cells = cells[:, np.array(_TRIANGLES)].reshape(-1, 3)
    elif box.cell == "tetrahedron":
        cells = cells[:, np.array(_TETRAHEDRA)].reshape(-1, 4)
    region, names = _regions(points[cells].mean(axis=1), mesh, soils)
    return MeshData(
        points=points,
        cells=cells,
        cell_type=box.cell,
        degree=1,
        region=region,
        region_names=names,
        planes=box_sides(np.zeros(len(box.size)), np.array(box.size)),
    )


def box_sides(
    low: npt.NDArray[np.float64], high: npt.NDArray[np.float64]
) -> dict[str, tuple[int, float]]:
    """Name the sides of a box; the last axis is up.

    Args:
        low: Its lowest corner [m], shape ``(gdim,)``.
        high: Its highest corner [m], shape ``(gdim,)``.

    Returns:
        Axis and place [m] by name.
    """
    up = len(low) - 1
    sides = {"base": (up, float(low[up])), "top": (up, float(high[up]))}
    pairs = (("left", "right"), ("front", "back"))
    for axis, (lower, upper) in zip(range(up), pairs, strict=False):
        sides |= {lower: (axis, float(low[axis])), upper: (axis, float(high[axis]))}
    return sides


def _grid(
    axes: Sequence[npt.NDArray[np.float64]],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Tensor grid, x fastest, cells in tensor order of their corners."""
    mesh = np.meshgrid(*axes, indexing="ij")
    points = np.stack([m.ravel(order="F") for m in mesh], axis=1)
    counts = [len(axis) for axis in axes]
    number = np.arange(len(points), dtype=np.int64).reshape(counts, order="F")
    corners = []
    for corner in range(2 ** len(axes)):
        cut = tuple(
            slice(1, None) if corner >> axis & 1 else slice(None, -1) for axis in range(len(axes))
        )
        corners.append(number[cut].ravel(order="F"))
    return points, np.stack(corners, axis=1)


def _regions(
    centroids: npt.NDArray[np.float64], mesh: Mesh, soils: Sequence[str]
) -> tuple[npt.NDArray[np.int32], tuple[str, ...]]:
    owner = mesh.region_index(centroids)
    bare = np.flatnonzero(owner < 0)
    if len(bare):
        found = f"{len(bare)} cells in no region, the first round {centroids[bare[0]].tolist()} m"
        expected = "a region for every cell: add a last one without 'below' and 'polygon'"
        raise SceneError([Fault("mesh.regions", found, expected)])
    # Without a soil, which is a fault of its own, the rest of the mesh is looked at all the same.
    soil_of = [region.soil for region in mesh.regions] or [*soils, ""][:1]
    names = tuple(dict.fromkeys(soil_of))
    return np.array([names.index(soil) for soil in soil_of], np.int32)[owner], names
