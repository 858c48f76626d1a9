# SPDX-License-Identifier: MIT
"""Writing cells with their regions and boundaries."""

from __future__ import annotations

from pathlib import Path

import gmsh
import numpy as np
import numpy.typing as npt
from _ground import ROUNDING, Ground

RealArray = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]

# Corners of a cell's facets, in gmsh's order.
_FACETS = {
    2: np.array([(0, 1), (1, 2), (2, 3), (3, 0)]),
    3: np.array(
        [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    ),
}


def draw(
    path: Path,
    ground: Ground,
    points: RealArray,
    cells: Numbers,
    inside: npt.NDArray[np.bool_],
) -> Path:
    """Write cells with their regions and boundaries.

    Args:
        path: Where to.
        ground: Layers, seam and air.
        points: Nodes [m], shape ``(num_nodes, dim)``.
        cells: Nodes of quadrilaterals or hexahedra in gmsh's order, shape ``(num_cells, 2**dim)``.
        inside: Whether each cell is in the ground, shape ``(num_cells,)``.

    Returns:
        The path.

    Raises:
        ValueError: A layer or a seam without a cell.
    """
    regions = ground.regions(points[cells].mean(axis=1), inside)
    kept = cells[regions != ""]
    used, numbered = np.unique(kept, return_inverse=True)
    points, kept, regions = points[used], numbered.reshape(kept.shape), regions[regions != ""]
    names = dict.fromkeys(regions.tolist())
    groups = {name: kept[regions == name] for name in names}
    _write(path, points, _boundaries(points, kept, ground.air is not None), groups)
    return path


def _boundaries(points: RealArray, cells: Numbers, roofed: bool) -> dict[str, Numbers]:
    """Nodes of the exterior facets on each side of the box, or of the ``surface``."""
    dim = points.shape[1]
    facets = cells[:, _FACETS[dim]].reshape(-1, 2 ** (dim - 1))
    _, first, times = np.unique(
        np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True
    )
    facets = facets[np.sort(first[times == 1])]
    low, high = points.min(axis=0), points.max(axis=0)
    sides = {"base": (dim - 1, low), "left": (0, low), "right": (0, high)}
    sides |= {"front": (1, low), "back": (1, high)} if dim == 3 else {}
    sides |= {"top": (dim - 1, high)} if roofed else {}
    found = {}
    rest = np.ones(len(facets), bool)
    for name, (axis, ends) in sides.items():
        off = np.abs(points[facets][..., axis] - ends[axis]).max(axis=1)
        on = off <= ROUNDING * (high - low).max()
        found[name] = facets[on]
        rest &= ~on
    return found | ({"surface": facets[rest]} if rest.any() else {})


def _write(
    path: Path, points: RealArray, boundaries: dict[str, Numbers], groups: dict[str, Numbers]
) -> None:
    dim = points.shape[1]
    places = np.pad(points, ((0, 0), (0, 3 - dim)))
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add(path.stem)
        mesh = gmsh.model.mesh
        home = gmsh.model.addDiscreteEntity(dim)  # of all nodes, and of the first group
        mesh.addNodes(dim, home, np.arange(1, len(points) + 1), places.ravel())
        for number, (of, name, nodes) in enumerate(
            [(dim, *group) for group in groups.items()]
            + [(dim - 1, *boundary) for boundary in boundaries.items()]
        ):
            entity = gmsh.model.addDiscreteEntity(of) if number else home
            kind = mesh.getElementType(("Line", "Quadrangle", "Hexahedron")[of - 1], 1)
            mesh.addElementsByType(entity, kind, [], nodes.ravel() + 1)
            gmsh.model.addPhysicalGroup(of, [entity], name=name)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
