# SPDX-License-Identifier: MIT
"""Uniform refinement: every cell is divided into cells of its own type, every edge in two.

A new node is the mean of the corners of the edge, face or cell that it is the middle of. Squares
and cubes become 4 and 8, and so do triangles and tetrahedra; of the octahedron that is left inside
a tetrahedron four more are made round the diagonal that keeps shapes from getting worse however
often it is done (Bey 1995, Computing 55).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import numpy.typing as npt

from fenics_hytf.domain.grids import MeshData
from fenics_hytf.scene import Fault, SceneError

Numbers = npt.NDArray[np.int64]
_Parents = tuple[int, ...]

_FACETS = {
    "triangle": "interval",
    "quadrilateral": "interval",
    "tetrahedron": "triangle",
    "hexahedron": "quadrilateral",
}


def _of_cube(dim: int) -> list[list[_Parents]]:
    """Cells of a divided interval, square or cube, corners in tensor order (x fastest).

    Each corner is told by the corners of the whole that it is the mean of.
    """
    corners = [place[::-1] for place in product((0, 1), repeat=dim)]

    def parents(place: Sequence[int]) -> _Parents:
        """Of a place in halves of an edge: 1 is the middle, between 0 and 2."""
        return tuple(
            number
            for number, corner in enumerate(corners)
            if all(x == 1 or x == 2 * end for x, end in zip(place, corner, strict=True))
        )

    return [
        [parents([a + b for a, b in zip(low, corner, strict=True)]) for corner in corners]
        for low in corners
    ]


def _of_simplex(*cells: str) -> list[list[_Parents]]:
    """Cells of a divided simplex, from the corners whose means are theirs: ``"0 01 02"``."""
    return [[tuple(map(int, corner)) for corner in cell.split()] for cell in cells]


_CHILDREN = {
    "interval": _of_cube(1),
    "quadrilateral": _of_cube(2),
    "hexahedron": _of_cube(3),
    "triangle": _of_simplex("0 01 02", "01 1 12", "02 12 2", "12 02 01"),
    "tetrahedron": _of_simplex(
        *("0 01 02 03", "01 1 12 13", "02 12 2 23", "03 13 23 3"),
        *("01 02 03 13", "01 02 12 13", "02 03 13 23", "02 12 13 23"),
    ),
}


def refined(data: MeshData) -> MeshData:
    """A mesh with every cell divided.

    Args:
        data: The mesh, of degree 1.

    Returns:
        The mesh; the parts of a cell follow each other and are of its region, parts of a facet of
        its boundary.

    Raises:
        SceneError: The cells are curved.
    """
    if data.degree != 1:
        found = "cells with curved edges"
        raise SceneError([Fault("mesh.refine", found, "straight ones, which can be divided")])
    width = 2 ** data.points.shape[1]  # corners of which a node is the mean, at most
    facet = _FACETS[data.cell_type]
    parts = [_parts(data.cell_type, data.cells, width)]
    parts += [_parts(facet, nodes, width) for nodes in data.facets.values()]
    parents, number = np.unique(
        np.concatenate([part.reshape(-1, width) for part in parts]), axis=0, return_inverse=True
    )
    corners = np.vstack([data.points, np.zeros(data.points.shape[1])])  # the last one is no corner
    points = corners[parents].sum(axis=1) / (parents >= 0).sum(axis=1)[:, None]
    ends = np.cumsum([part[..., 0].size for part in parts])
    cells, *facets = (
        nodes.reshape(-1, part.shape[1])
        for nodes, part in zip(np.split(number.ravel(), ends[:-1]), parts, strict=True)
    )
    return replace(
        data,
        points=points,
        cells=cells,
        region=np.repeat(data.region, len(_CHILDREN[data.cell_type])),
        facets=dict(zip(data.facets, facets, strict=True)),
    )


def _parts(kind: str, nodes: Numbers, width: int) -> Numbers:
    """Corners of the parts of cells, each by the sorted nodes that it is the mean of.

    Args:
        kind: Type of the cells.
        nodes: Their corners, shape ``(n, num_corners)``.
        width: Most nodes of a mean.

    Returns:
        Padded with -1, shape ``(n·num_parts, num_corners, width)``.
    """
    pattern = [[corner + (-1,) * (width - len(corner)) for corner in c] for c in _CHILDREN[kind]]
    with_none = np.pad(nodes, ((0, 0), (0, 1)), constant_values=-1)
    parents = np.sort(with_none[:, np.array(pattern)], axis=-1)
    return parents.reshape(-1, *parents.shape[2:])
