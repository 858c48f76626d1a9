# SPDX-License-Identifier: MIT
"""The ``[mesh]`` section: a layered column, a box with regions, or a mesh file.

In 2D y is up, in 3D z is up, and the base of a column or box is at height 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from fenics_hytf.scene.axes import CELLS, raw_gdim
from fenics_hytf.scene.faults import Fault, SceneError, join_key, toml_text
from fenics_hytf.scene.files import unusable
from fenics_hytf.scene.quadrature import allowed_points_per_cell, default_points_per_cell
from fenics_hytf.scene.regions import RealArray, Region, polygon_rules
from fenics_hytf.scene.table import (
    Count,
    Name,
    Positive,
    Several,
    Table,
    as_list,
    as_number,
    exactly_one,
    number,
    read_table,
)

BOUNDARIES = {
    2: ("base", "top", "left", "right"),
    3: ("base", "top", "left", "right", "front", "back"),
}
MOST_CELLS = 10_000_000
"""Cells of a mesh: about a kilobyte each while it is made, before its memory can be foretold."""

_MOST_CELLS = 1_000_000  # along one direction; more is a slip of the pen
_MOST_CHECKED = 10_000_000  # cells of a box whose regions are checked here
_CHECKED_AT_ONCE = 1_000_000
_MOST_REFINED = 4  # times; 256 or 4096 cells of one

_CellCount = Annotated[int, Field(ge=1, le=_MOST_CELLS)]


class Layer(Table):
    """A layer of a column.

    Attributes:
        thickness: [m].
        soil: Name of its soil.
        cells: Cells over the thickness.
    """

    thickness: Positive = Field(description="a positive thickness [m]")
    soil: Name = Field(description="the name of a soil")
    cells: _CellCount = Field(description=f"a number of cells from 1 to {_MOST_CELLS}")


class Column(Table):
    """A 2D column one cell wide, its base at y = 0.

    Attributes:
        width: [m].
        layers: From the top down.
    """

    width: Positive = Field(description="a positive width [m]")
    layers: Several[Layer] = Field(min_length=1, description="at least one layer, top down")

    @property
    def height(self) -> float:
        """Sum of the thicknesses [m]."""
        return sum(layer.thickness for layer in self.layers)


class Box(Table):
    """A box with its lower corner at the origin, cut into equal cells.

    Attributes:
        size: [m], shape ``(gdim,)``.
        cells: Cells along each direction, shape ``(gdim,)``.
        cell: ``quadrilateral``, ``triangle``; ``hexahedron``, ``tetrahedron``.
    """

    size: Several[Positive] = Field(
        min_length=2, max_length=3, description="2 or 3 positive sizes [m]"
    )
    cells: Several[_CellCount] = Field(
        min_length=2,
        max_length=3,
        description=f"one number of cells from 1 to {_MOST_CELLS} a direction, as many as sizes",
    )
    cell: Literal["quadrilateral", "triangle", "hexahedron", "tetrahedron"] = Field(
        description="quadrilateral or triangle in 2D, hexahedron or tetrahedron in 3D"
    )

    @classmethod
    def rules(cls, raw: dict[str, Any], key: str) -> Iterator[Fault]:
        """As many cells as sizes; a cell type of that dimension."""
        size, cells, cell = raw.get("size"), raw.get("cells"), raw.get("cell")
        if not isinstance(size, list | tuple) or len(size) not in CELLS:
            return
        gdim = len(size)
        if isinstance(cells, list | tuple) and len(cells) != gdim:
            expected = f"{gdim} numbers of cells, one a size"
            yield Fault(join_key(key, "cells"), toml_text(cells), expected)
        if isinstance(cell, str) and cell not in CELLS[gdim]:
            expected = f"{' or '.join(CELLS[gdim])}, as the box has {gdim} sizes"
            yield Fault(join_key(key, "cell"), toml_text(cell), expected)

    @classmethod
    def prepare(cls, raw: dict[str, Any]) -> dict[str, Any]:
        """Choose the cell type by dimension where none is given."""
        size = raw.get("size")
        is_3d = isinstance(size, list | tuple) and len(size) == 3
        return {"cell": CELLS[3 if is_3d else 2][0], **raw}

    def grid(self, direction: int) -> RealArray:
        """Cell centres along a direction [m], shape ``(cells[direction],)``."""
        count = self.cells[direction]
        return (np.arange(count) + 0.5) * (self.size[direction] / count)


class Mesh(Table):
    """Exactly one of a column, a box or a file, and how it is discretised.

    Attributes:
        column: Layered column (2D).
        box: Box (2D or 3D).
        file: Mesh file, absolute path.
        refine: How many times each cell of a file is divided, every edge in two.
        regions: Which soil is where in a box.
        empty: Names of regions without soil, background for points to move into; where any is
            named, cells may be filled in part.
        degree: Degree of the displacement, 1 or 2.
        kinematics: ``plane_strain`` or ``antiplane`` (SH: motion across the plane, ``z``) in 2D,
            ``None`` in 3D and for a file that leaves it open.
        points_per_cell: Material points a cell, ``n**gdim`` for the Gauss rule with ``n`` points
            a direction; ``None`` for ``n = degree + 1``. Triangles and tetrahedra have rules of
            other sizes: by default, and for ``(degree + 1)**gdim``, the one that is exact to
            degree ``2 * degree``. See :mod:`fenics_hytf.scene.quadrature`.
    """

    column: Column | None = Field(None, description="a table with width and layers")
    box: Box | None = Field(None, description="a table with size and cells")
    file: Path | None = Field(None, description="the path of a mesh file")
    refine: Annotated[int, Field(ge=0, le=_MOST_REFINED)] = Field(
        0, description=f"a whole number from 0 to {_MOST_REFINED}"
    )
    regions: Several[Region] = Field((), description="an array of tables with soil and a place")
    empty: Several[Name] = Field((), description="names of regions without soil")
    degree: Literal[1, 2] = Field(1, description="1 or 2")
    kinematics: Literal["plane_strain", "antiplane"] | None = Field(
        None, description='"plane_strain" or "antiplane"'
    )
    points_per_cell: Count | None = Field(
        None, description="a whole number that the cells have a quadrature rule for"
    )

    @classmethod
    def rules(cls, raw: dict[str, Any], key: str) -> Iterator[Fault]:
        """One source; rules of the tables below; points a cell; kinematics."""
        yield from exactly_one(raw, key, "column", "box", "file")
        gdim = raw_gdim(raw)
        yield from _size_rules(raw, key)
        if isinstance(raw.get("box"), dict):
            yield from Box.rules(raw["box"], join_key(key, "box"))
        if "regions" in raw and "box" not in raw:
            yield Fault(
                join_key(key, "regions"), toml_text(raw["regions"]), "regions with box only"
            )
        if "refine" in raw and "file" not in raw:
            expected = "nothing without file: a box or a column has numbers of cells"
            yield Fault(join_key(key, "refine"), toml_text(raw["refine"]), expected)
        for i, region in enumerate(as_list(raw.get("regions"))):
            if isinstance(region, dict):
                where = join_key(key, "regions", i)
                yield from Region.rules(region, where)
                yield from polygon_rules(region, where, gdim)
        if gdim == 3 and raw.get("kinematics") is not None:
            yield Fault(join_key(key, "kinematics"), toml_text(raw["kinematics"]), "nothing in 3D")
        yield from _points_rules(raw, key)

    @classmethod
    def prepare(cls, raw: dict[str, Any]) -> dict[str, Any]:
        """Defaults that depend on the dimension."""
        raw = dict(raw)
        if raw_gdim(raw) == 2:
            raw.setdefault("kinematics", "plane_strain")
        if isinstance(raw.get("box"), dict):
            raw["box"] = Box.prepare(raw["box"])
        return raw

    @property
    def gdim(self) -> int | None:
        """Geometric dimension; ``None`` for a file, which says itself."""
        if self.column is not None:
            return 2
        return None if self.box is None else len(self.box.size)

    @property
    def size(self) -> tuple[float, ...] | None:
        """Extent of a column or box from the origin [m], or ``None`` for a file."""
        if self.column is not None:
            return (self.column.width, self.column.height)
        return None if self.box is None else self.box.size

    @property
    def boundaries(self) -> tuple[str, ...] | None:
        """Names of the boundaries of a column or box, or ``None`` for a file."""
        return None if self.gdim is None else BOUNDARIES[self.gdim]

    @property
    def soil_names(self) -> tuple[str, ...]:
        """Soils named by layers or regions, each once; empty for a lone soil or a file."""
        names = [layer.soil for layer in self.column.layers] if self.column is not None else []
        names += [region.soil for region in self.regions]
        return tuple(name for name in dict.fromkeys(names) if name not in self.empty)

    def points_in(self, cell_type: str) -> int:
        """Points a cell, once the mesh file too has told its cell type.

        Args:
            cell_type: ``triangle``, ``quadrilateral``, ``tetrahedron`` or ``hexahedron``.

        Returns:
            What the scene asks for, or the default.

        Raises:
            SceneError: If it asks for a number that such cells have no rule for.
        """
        if self.points_per_cell is None:
            return default_points_per_cell(cell_type, self.degree)
        faults = list(_points_faults(self.points_per_cell, self.degree, (cell_type,), "mesh"))
        if faults:
            raise SceneError(faults)
        return self.points_per_cell

    def region_index(self, x: RealArray) -> npt.NDArray[np.int32]:
        """Which region each place of a box belongs to; the first that matches wins.

        Args:
            x: Cell centroids [m], shape ``(n, gdim)``.

        Returns:
            Index into :attr:`regions`, -1 where none matches; all 0 without regions (a lone
            soil). Shape ``(n,)``.
        """
        if not self.regions:
            return np.zeros(len(x), dtype=np.int32)
        index = np.full(len(x), -1, dtype=np.int32)
        for i, region in enumerate(self.regions):
            index[(index < 0) & region.holds(x)] = i
        return index


def read_mesh(raw: object, folder: Path) -> tuple[Mesh | None, list[Fault]]:
    """Read the section.

    Args:
        raw: What stands in the file.
        folder: Where relative paths start.

    Returns:
        The mesh, or ``None`` if it has a fault; and its faults.
    """
    missing: list[Fault] = []
    if isinstance(raw, dict) and isinstance(raw.get("file"), str):
        path = Path(folder, raw["file"]).absolute()
        why = unusable(path)
        if why:
            found = f"{toml_text(raw['file'])}, {why}"
            missing.append(Fault("mesh.file", found, f"a mesh file; looked for {path}"))
        raw = {**raw, "file": path}
    mesh, faults = read_table(Mesh, raw, "mesh")
    faults += missing
    drawn = layout(raw)
    if drawn is not None:
        faults += _uncovered(drawn)
    return (None if faults else mesh), faults


def layout(raw: object) -> Mesh | None:
    """The column or box with its regions, whatever the rest of a raw ``[mesh]`` table holds."""
    if not isinstance(raw, dict):
        return None
    shape = {name: raw[name] for name in ("column", "box", "regions", "empty") if name in raw}
    return read_table(Mesh, shape, "mesh")[0]


def _size_rules(raw: dict[str, Any], key: str) -> Iterator[Fault]:
    """Not too many cells in all, where those along each direction or in each layer are in range."""
    box, column = raw.get("box"), raw.get("column")
    if isinstance(box, dict):
        where, cells = join_key(key, "box.cells"), as_list(box.get("cells"))
        total = prod(as_number(n) or 0.0 for n in cells)
    elif isinstance(column, dict):
        where = join_key(key, "column.layers")
        layers = [layer for layer in as_list(column.get("layers")) if isinstance(layer, dict)]
        cells = [layer.get("cells") for layer in layers]
        total = sum(as_number(n) or 0.0 for n in cells)
    else:
        return
    if total > MOST_CELLS and max(as_number(n) or 0.0 for n in cells) <= _MOST_CELLS:
        yield Fault(where, f"{total:g} cells", f"at most {MOST_CELLS} in all")


def _points_rules(raw: dict[str, Any], key: str) -> Iterator[Fault]:
    """Points a cell, as far as the cell type is known."""
    degree = raw["degree"] if raw.get("degree") in (1, 2) else 1
    if number(raw, "points_per_cell") is not None:
        yield from _points_faults(raw["points_per_cell"], degree, _raw_cells(raw), key)


def _raw_cells(raw: dict[str, Any]) -> tuple[str, ...]:
    """The cell types that a raw ``[mesh]`` table leaves open, one where it is known."""
    if raw.get("column") is not None:
        return CELLS[2][:1]
    gdim = raw_gdim(raw)
    if gdim is None:
        return CELLS[2] + CELLS[3]
    cell = raw["box"].get("cell", CELLS[gdim][0])
    return (cell,) if cell in CELLS[gdim] else CELLS[gdim]


def _points_faults(points: float, degree: int, cells: tuple[str, ...], key: str) -> Iterator[Fault]:
    """There is a rule of that size, and M is regular under it, for one of the cell types."""
    allowed = {cell: allowed_points_per_cell(cell, degree) for cell in cells}
    if not any(points in counts for counts in allowed.values()):
        text = "; ".join(f"{', '.join(map(str, n))} for a {cell}" for cell, n in allowed.items())
        expected = f"one of {text} (degree {degree})"
        yield Fault(join_key(key, "points_per_cell"), toml_text(points), expected)


def _uncovered(mesh: Mesh) -> Iterator[Fault]:
    """Cells of a box of quadrilaterals or hexahedra that no region covers, some rows at a time."""
    box = mesh.box
    if box is None or not mesh.regions or box.cell not in ("quadrilateral", "hexahedron"):
        return
    # without polygons only the height of a cell matters
    flat = all(region.polygon is None for region in mesh.regions)
    across = box.grid(0)[:1] if flat else box.grid(0)
    heights = box.grid(len(box.size) - 1)
    if len(across) * len(heights) > _MOST_CHECKED:
        return
    bare: list[RealArray] = []
    count = 0
    for rows in np.array_split(heights, -(-len(across) * len(heights) // _CHECKED_AT_ONCE)):
        x = np.column_stack([np.tile(across, len(rows)), np.repeat(rows, len(across))])
        found = x[mesh.region_index(x) < 0]
        count += len(found)
        bare += list(found[: 3 - len(bare)])
    if count:
        what = "layers of cells" if flat else "cells"
        places = ", ".join(f"{y:g}" if flat else f"({x:g}, {y:g})" for x, y in bare)
        more = " ..." if count > len(bare) else ""
        where = f"centred at {'height ' if flat else ''}{places} m{more}"
        text = f"{count} {what} without soil, {where}"
        yield Fault("mesh.regions", text, "a region for every cell")
