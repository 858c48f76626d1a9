# SPDX-License-Identifier: MIT
"""Meshes from files: gmsh's ``.msh``, or anything meshio reads, with named regions and boundaries.

Physical groups (gmsh), sets (Abaqus ...) or families (MED) of the mesh's dimension are regions and
carry the names of soils; those one dimension lower are boundaries. A file that names no boundary
has those of a box: the sides of the box around the mesh.

A mesh is read as numbers, never run: scripts of gmsh (``.geo``) are refused. Formats that keep
their numbers in other files (XDMF, links of HDF5) are followed to where they lead.
"""

from __future__ import annotations

import io
import logging
import re
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import meshio
import numpy as np
import numpy.typing as npt
from scipy.spatial import KDTree

from fenics_hytf import _compat
from fenics_hytf.domain.checks import refuse_tangled_cells
from fenics_hytf.domain.grids import MeshData, box_sides
from fenics_hytf.scene import Fault, SceneError

_logger = logging.getLogger(__name__)

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
_FARTHEST = 1e30  # m; squares of such coordinates are numbers too
_APART = 1e-9  # of the size of a mesh: nodes that are not farther apart are at one place
_IGNORED = {"vertex", "line", "line3", "triangle", "triangle6", "quad", "quad9"}


def read_mesh(path: Path, soils: tuple[str, ...]) -> MeshData:
    """Read a mesh file.

    Args:
        path: The file; its ending tells the format.
        soils: Names of the scene's soils; a mesh without any region takes the only one.

    Returns:
        The mesh, its unused nodes dropped.

    Raises:
        SceneError: The file cannot be read, names groups alike or only some of them, holds no
            cells, several types of them or such as do not make a mesh, or has cells outside every
            region.
    """
    raw = _read(path)
    _refuse_equal_names(path)
    kind = _cell_kind(raw, path)
    name, gdim, degree, facet_kind = _CELLS[kind]
    _refuse_nameless(raw, {kind: gdim, facet_kind: gdim - 1}, path)
    blocks = [b.data for b in raw.cells if b.type == kind]
    if len({block.shape[1:] for block in blocks}) > 1:
        raise _fault(f"cells of {path.name} that lack nodes", "a whole mesh")
    cells = np.concatenate(blocks).astype(np.int64)
    used, inverse = np.unique(cells, return_inverse=True)
    points = _points(raw, used, gdim, path)
    number = np.full(len(raw.points), -1, np.int64)
    number[used] = np.arange(len(used))
    order = _compat.vtk_permutation(name, cells.shape[1])
    facets = {
        boundary: number[nodes][:, _compat.vtk_permutation(_FACETS[facet_kind], nodes.shape[1])]
        for boundary, nodes in _boundaries(raw, facet_kind, gdim - 1).items()
    }
    facets = {k: f[(f >= 0).all(axis=1)] for k, f in facets.items()}
    region, names = _regions(raw, kind, gdim, soils, path)
    data = MeshData(
        points=points,
        cells=inverse.reshape(cells.shape)[:, order],
        cell_type=name,
        degree=degree,
        region=region,
        region_names=names,
        planes={} if facets else _box_around(points, path),
        facets=facets,
    )
    refuse_tangled_cells(data)
    _refuse_split_nodes(points, path)
    return data


def count_cells(path: Path) -> tuple[str, int, int, int]:
    """What a mesh file holds, without a look at whether it makes a mesh.

    Args:
        path: The file.

    Returns:
        dolfinx's name of its cells, their dimension, how many there are, and the number of nodes.

    Raises:
        SceneError: The file cannot be read, or its cells are not such as make a mesh.
    """
    raw = _read(path)
    kind = _cell_kind(raw, path)
    name, gdim, *_ = _CELLS[kind]
    return name, gdim, sum(len(b.data) for b in raw.cells if b.type == kind), len(raw.points)


def _read(path: Path) -> meshio.Mesh:
    said = io.StringIO()
    expected = (
        "a gmsh .msh file, every cell in a physical group or none, or another format that meshio "
        "reads"
    )
    try:
        with redirect_stdout(said), redirect_stderr(said):  # meshio prints
            raw = meshio.read(path)
    except SystemExit as error:  # meshio's way of refusing a file
        reason = " ".join(said.getvalue().split())
        raise _fault(f"{path.name}, not readable ({reason})", expected) from error
    except Exception as error:  # meshio raises many kinds
        found = f"{path.name}, not readable ({type(error).__name__}: {error})"
        raise _fault(found, expected) from error
    if said.getvalue().strip():
        _logger.info("%s: %s", path.name, said.getvalue().strip())
    return raw


def _refuse_equal_names(path: Path) -> None:
    """Raise where gmsh's physical groups share a name: meshio keeps only the last of them."""
    if path.suffix != ".msh":
        return
    groups: dict[str, list[str]] = {}
    with path.open("rb") as file:  # this section is text in binary files too
        for line in file:
            found = re.match(rb'\s*(\d)\s+\d+\s+"(.*)"', line)
            if found:
                groups.setdefault(found[2].decode(errors="replace"), []).append(found[1].decode())
            elif line.startswith((b"$EndPhysicalNames", b"$Nodes")):
                break
    for name, dims in groups.items():
        if len(dims) > 1:
            listed = " and ".join(dims)
            raise _fault(
                f"groups of dimension {listed} in {path.name} that are all named {name!r}",
                "a name of its own for each physical group; one group holds any number of entities",
            )


def _refuse_nameless(raw: meshio.Mesh, dims: dict[str, int], path: Path) -> None:
    """Raise where some of gmsh's groups of a dimension have names and others have none."""
    tags = raw.cell_data.get("gmsh:physical")
    for number, block in enumerate(raw.cells if tags is not None else []):
        dim = dims.get(block.type, -1)
        named = [tag for tag, of in raw.field_data.values() if of == dim]
        nameless = np.setdiff1d(tags[number], [0, *named])  # 0: in no group
        if named and len(nameless):
            raise _fault(
                f"group {nameless[0]} of dimension {dim} in {path.name}, which has no name",
                "a name of its own for each physical group; gmsh drops one that is used twice",
            )


def _points(
    raw: meshio.Mesh, used: npt.NDArray[np.int64], gdim: int, path: Path
) -> npt.NDArray[np.float64]:
    """Coordinates of the nodes that cells use [m], shape ``(len(used), gdim)``."""
    if used[0] < 0 or used[-1] >= len(raw.points):
        raise _fault(f"cells of {path.name} with nodes that it does not hold", "a whole mesh")
    points = np.asarray(raw.points, float)[used]
    sound = (np.abs(points) <= _FARTHEST).all(axis=1)
    if not sound.all():
        bad = used[np.flatnonzero(~sound)[0]]
        found = f"node {bad} of {path.name} at {raw.points[bad]}"
        raise _fault(found, f"finite coordinates, up to {_FARTHEST:g} [m]")
    if points.shape[1] > gdim and np.ptp(points[:, 2]) > 1e-9 * np.ptp(points):
        found = f"cells of {path.name} out of the plane z = const"
        raise _fault(found, "a 2D mesh in x and y, y up, or the cells of a volume")
    return points[:, :gdim]


def _refuse_split_nodes(points: npt.NDArray[np.float64], path: Path) -> None:
    """Raise where parts touch without hanging together."""
    pairs = KDTree(points).query_pairs(_APART * np.ptp(points, axis=0).max(), output_type="ndarray")
    if len(pairs):
        where = ", ".join(f"{x:.6g}" for x in points[pairs[0, 0]])
        raise _fault(
            f"{len(pairs)} pairs of nodes of {path.name} in one place, the first at ({where})",
            "parts that share the nodes where they touch, or they do not hold each other; in gmsh: "
            "Coherence, or gmsh.model.mesh.removeDuplicateNodes()",
        )


def _fault(found: str, expected: str) -> SceneError:
    return SceneError([Fault("mesh.file", found, expected)])


def _box_around(points: npt.NDArray[np.float64], path: Path) -> dict[str, tuple[int, float]]:
    """Boundaries of a mesh whose file names none: the sides of the box around it."""
    low, high = points.min(axis=0), points.max(axis=0)
    floor = points[points[:, -1] <= low[-1] + 1e-12 * np.abs(points).max()][:, :-1]
    if (floor.min(axis=0) > low[:-1]).any() or (floor.max(axis=0) < high[:-1]).any():
        found = f"no named boundary in {path.name}, whose lowest side is not level"
        raise _fault(found, "facets named 'base'")
    return box_sides(low, high)


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
    if not top:
        only = f", only {', '.join(sorted(found))}" if found else ""
        raise _fault(f"no cells in {path.name}{only}", "cells of an area or of a volume")
    if len(top) > 1:
        raise _fault(f"{', '.join(sorted(top))} in {path.name}", "cells of one type")
    return top.pop()


def _members(raw: meshio.Mesh, number: int, dim: int) -> dict[str, npt.NDArray[np.int64]]:
    """Entities of one block of a dimension, by the name of each group that holds some of them."""
    found: dict[str, list[npt.NDArray[np.intp]]] = {}
    # Sets of gmsh's version 4, Abaqus ...; meshio adds one of its own to gmsh's.
    for name, sets in raw.cell_sets.items():
        if not name.startswith("gmsh:") and sets[number] is not None:
            found[name] = [np.asarray(sets[number], np.intp)]
    tags = raw.cell_data.get("gmsh:physical")
    if tags is not None:  # gmsh's version 2 has no sets
        for name, (tag, group_dim) in raw.field_data.items():
            if group_dim == dim and name not in found:
                found[name] = [np.flatnonzero(tags[number] == tag)]
    families = raw.cell_data.get("cell_tags")
    if families is not None:  # MED: each family belongs to any number of groups
        for family, names in getattr(raw, "cell_tags", {}).items():
            for name in names:
                found.setdefault(name, []).append(np.flatnonzero(families[number] == family))
    joined = {name: np.concatenate(parts).astype(np.int64) for name, parts in found.items()}
    return {name: members for name, members in joined.items() if len(members)}


def _boundaries(raw: meshio.Mesh, kind: str, dim: int) -> dict[str, npt.NDArray[np.int64]]:
    """Nodes of the facets of each boundary."""
    found: dict[str, list[npt.NDArray[np.int64]]] = {}
    for number, block in enumerate(raw.cells):
        if block.type == kind:
            for name, members in _members(raw, number, dim).items():
                found.setdefault(name, []).append(block.data[members])
    return {name: np.concatenate(parts).astype(np.int64) for name, parts in found.items()}


def _regions(
    raw: meshio.Mesh, kind: str, dim: int, soils: tuple[str, ...], path: Path
) -> tuple[npt.NDArray[np.int32], tuple[str, ...]]:
    """Region of each cell, in the order of the cells: its group that is named as a soil."""
    groups: dict[str, list[npt.NDArray[np.int64]]] = {}
    num_cells = 0
    for number, block in enumerate(raw.cells):
        if block.type == kind:
            for name, members in _members(raw, number, dim).items():
                groups.setdefault(name, []).append(members + num_cells)
            num_cells += len(block.data)
    if not groups and len(soils) == 1:
        return np.zeros(num_cells, np.int32), soils
    names = sorted(groups, key=lambda name: name in soils)  # soils last: they win
    region = np.full(num_cells, -1, np.int32)
    for index, name in enumerate(names):
        members = np.concatenate(groups[name])
        if name in soils:
            others = [n for n in names[:index] if n in soils]
            both = members[np.isin(region[members], [names.index(n) for n in others])]
            if len(both):
                found = f"cell {both[0]} of {path.name} in the groups of two soils, {name} the last"
                raise _fault(found, "one soil a cell")
        region[members] = index
    bare = np.flatnonzero(region < 0)
    if len(bare):
        raise _fault(
            f"{len(bare)} cells of {path.name} in no named region, the first cell {bare[0]}",
            "a physical group named as a soil around every cell",
        )
    kept, numbered = np.unique(region, return_inverse=True)
    return numbered.astype(np.int32), tuple(names[index] for index in kept)
