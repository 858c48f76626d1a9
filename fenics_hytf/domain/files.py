# SPDX-License-Identifier: MIT
"""Meshes from files: gmsh's ``.msh``, or anything meshio reads, with named regions and boundaries.

Physical groups (gmsh) or cell sets (Abaqus, MED ...) of the mesh's dimension are regions and carry
the names of soils; those one dimension lower are boundaries.
"""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import numpy.typing as npt

from fenics_hytf import _compat
from fenics_hytf.domain.grids import MeshData
from fenics_hytf.scene import Fault, SceneError

# meshio's name: dolfinx's name, dimension, degree, type of its facets
_CELLS = {
    "triangle": ("triangle", 2, 1, "line"),
    "triangle6": ("triangle", 2, 2, "line3"),
    "quad": ("quadrilateral", 2, 1, "line"),
    "quad9": ("quadrilateral", 2, 2, "line3"),
    "tetra": ("tetrahedron", 3, 1, "triangle"),
    "tetra10": ("tetrahedron", 3, 2, "triangle6"),
    "hexahedron": ("hexahedron", 3, 1, "quad"),
    "hexahedron27": ("hexahedron", 3, 2, "quad9"),
}
_FACETS = {"line": "interval", "line3": "interval"} | {k: v[0] for k, v in _CELLS.items()}
_IGNORED = {"vertex", "line", "line3", "triangle", "triangle6", "quad", "quad9"}


def read_mesh(path: Path, soils: tuple[str, ...]) -> MeshData:
    """Read a mesh file.

    Args:
        path: The file; its ending tells the format.
        soils: Names of the scene's soils; a mesh without any region takes the only one.

    Returns:
        The mesh, its unused nodes dropped.

    Raises:
        SceneError: The file cannot be read, holds no cells or several types of them, or has cells
            outside every region.
    """
    try:
        raw = meshio.read(path)
    except SystemExit as error:  # meshio's way of refusing an unknown ending
        raise _fault(path.name, "a format that meshio reads") from error
    except Exception as error:  # meshio raises many kinds
        found = f"{path.name}, not readable ({type(error).__name__}: {error})"
        raise _fault(found, "a gmsh .msh file or another format that meshio reads") from error
    kind = _cell_kind(raw, path)
    name, gdim, degree, facet_kind = _CELLS[kind]
    cells = np.concatenate([b.data for b in raw.cells if b.type == kind]).astype(np.int64)
    points = np.asarray(raw.points, float)
    if gdim == 2 and points.shape[1] == 3:
        if np.ptp(points[np.unique(cells), 2]) > 1e-9 * np.ptp(points):
            raise _fault(
                f"cells of {path.name} out of the plane z = const", "a 2D mesh in x and y, y up"
            )
        points = points[:, :2]
    region, names = _regions(raw, kind, gdim, len(cells), soils, path)
    used, inverse = np.unique(cells, return_inverse=True)
    number = np.full(len(points), -1, np.int64)
    number[used] = np.arange(len(used))
    order = _compat.vtk_permutation(name, cells.shape[1])
    facets = {
        boundary: number[nodes][:, _compat.vtk_permutation(_FACETS[facet_kind], nodes.shape[1])]
        for boundary, nodes in _groups(raw, facet_kind, gdim - 1).items()
    }
    facets = {k: f[(f >= 0).all(axis=1)] for k, f in facets.items()}
    return MeshData(
        points[used],
        inverse.reshape(cells.shape)[:, order],
        name,
        degree,
        region,
        names,
        {},
        facets,
    )


def _fault(found: str, expected: str) -> SceneError:
    return SceneError([Fault("mesh.file", found, expected)])


def _cell_kind(raw: meshio.Mesh, path: Path) -> str:
    found = {block.type for block in raw.cells if len(block.data)}
    unknown = found - _CELLS.keys() - _IGNORED
    if unknown:
        raise _fault(
            f"cells of type {', '.join(sorted(unknown))} in {path.name}",
            f"{', '.join(_CELLS)} (of second order the complete ones, not serendipity)",
        )
    dims = {kind: _CELLS[kind][1] for kind in found if kind in _CELLS}
    top = {kind for kind, dim in dims.items() if dim == max(dims.values(), default=0)}
    if len(top) != 1:
        kinds = ", ".join(sorted(top)) or "no cells"
        raise _fault(f"{kinds} in {path.name}", "cells of one type")
    return top.pop()


def _groups(raw: meshio.Mesh, kind: str, dim: int) -> dict[str, npt.NDArray[np.int64]]:
    """Nodes of the entities of each named group, by the group's name."""
    found: dict[str, list[npt.NDArray[np.int64]]] = {}
    tags = raw.cell_data.get("gmsh:physical")
    for number, block in enumerate(raw.cells):
        if block.type != kind:
            continue
        if tags is not None:
            for name, (tag, group_dim) in raw.field_data.items():
                if group_dim == dim:
                    found.setdefault(name, []).append(block.data[tags[number] == tag])
        else:
            for name, sets in raw.cell_sets.items():
                if sets[number] is not None and len(sets[number]):
                    found.setdefault(name, []).append(block.data[np.asarray(sets[number], int)])
    return {name: np.concatenate(parts).astype(np.int64) for name, parts in found.items()}


def _regions(
    raw: meshio.Mesh, kind: str, dim: int, num_cells: int, soils: tuple[str, ...], path: Path
) -> tuple[npt.NDArray[np.int32], tuple[str, ...]]:
    """Region of each cell, in the order of the cells."""
    tags = raw.cell_data.get("gmsh:physical")
    region = np.full(num_cells, -1, np.int32)
    names: list[str] = []
    offset = 0
    for number, block in enumerate(raw.cells):
        if block.type != kind:
            continue
        part = region[offset : offset + len(block.data)]
        offset += len(block.data)
        if tags is not None:
            groups = {
                name: np.flatnonzero(tags[number] == tag)
                for name, (tag, group_dim) in raw.field_data.items()
                if group_dim == dim
            }
        else:
            groups = {
                name: np.asarray(sets[number], int)
                for name, sets in raw.cell_sets.items()
                if sets[number] is not None
            }
        for name, members in groups.items():
            if len(members):
                if name not in names:
                    names.append(name)
                part[members] = names.index(name)
    if not names and len(soils) == 1:
        return np.zeros(num_cells, np.int32), soils
    bare = np.flatnonzero(region < 0)
    if len(bare):
        raise _fault(
            f"{len(bare)} cells of {path.name} in no named region, the first cell {bare[0]}",
            "a physical group named as a soil around every cell",
        )
    return region, tuple(names)
