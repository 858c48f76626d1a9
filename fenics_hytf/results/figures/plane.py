# SPDX-License-Identifier: MIT
"""The upright plane in which pictures show the ground, and the mesh's cells in it.

Of a plane mesh it is the section. A solid is cut in the middle, along the direction in which it
slides; cells are shown as the plane cuts them, and points that started within half a cell of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, PolyCollection

from fenics_hytf.results.ground import StoredMesh, StoredPoints, read_mesh
from fenics_hytf.results.reader import StoredResult

RealArray = npt.NDArray[np.float64]

# Edges of cells in VTK's order of their corners.
_EDGES = {
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "hexahedron": (
        *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6)),
        *((6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
    ),
}
_ASIDE = 1e-3  # of a cell: the plane's distance from faces in the middle of the mesh
_MOST_CELLS = 20_000  # more have no lines that could be told apart
_FAINT = "#dcdcdc"
_WIDTH, _NARROWEST = 7.4, 2.5  # of a picture [inch]


@dataclass(frozen=True)
class Plane:
    """A plane and the cells in it.

    Attributes:
        axes: Components along and up.
        sense: Of the slide along the first of them, 1 or -1.
        across: Component across, ``None`` in two dimensions.
        middle: Where the plane stands along it [m].
        reach: Half the width of a cell [m].
        numbers: Numbers of the cells, shape ``(n,)``.
        outlines: Their corners in the plane [m], each of shape ``(num_corners, 2)``.
    """

    axes: tuple[int, int]
    sense: int
    across: int | None
    middle: float
    reach: float
    numbers: npt.NDArray[np.int64]
    outlines: list[RealArray]

    def shown(self, points: StoredPoints) -> npt.NDArray[np.bool_]:
        """Points that started in or close by the plane, shape ``(num_points,)``."""
        if self.across is None:
            return np.ones(len(points.id), bool)
        start = points.position[:, self.across] - points.displacement[:, self.across]
        return np.abs(start - self.middle) <= self.reach

    def project(self, vectors: RealArray) -> RealArray:
        """Components along and up, shape ``(n, 2)``."""
        return vectors[:, list(self.axes)]


def plane_of(stored: StoredResult) -> Plane | None:
    """The plane in which a result's ground is shown.

    Args:
        stored: The result.

    Returns:
        The plane; ``None`` without sliding, of a column, or where no snapshot left the mesh.
    """
    if stored.slip is None or stored.summary["scene"]["mesh"]["kind"] == "column":
        return None
    mesh = read_mesh(stored)
    if mesh is None:
        return None
    slip = stored.summary["lapses"][0]["slip"]
    along, up = "xyz".index(slip["direction"]), mesh.vertices.shape[1] - 1
    if up == 1:
        outlines: list[RealArray] = list(mesh.vertices[mesh.cells])
        return Plane((along, up), slip["sense"], None, 0.0, 0.0, np.arange(len(outlines)), outlines)
    across = 1 - along
    there = mesh.vertices[:, across]
    corners = there[mesh.cells]
    width = float(np.median(np.ptp(corners, axis=1)))
    middle = 0.5 * float(there.min() + there.max()) + _ASIDE * width
    numbers, outlines = _cut(mesh, across, middle, (along, up))
    return Plane((along, up), slip["sense"], across, middle, 0.5 * width, numbers, outlines)


def _cut(
    mesh: StoredMesh, across: int, middle: float, axes: tuple[int, int]
) -> tuple[npt.NDArray[np.int64], list[RealArray]]:
    """Cells that the plane cuts, and the corners of the cuts: where it crosses edges."""
    edges = np.array(_EDGES[mesh.cell_type])
    side = mesh.vertices[:, across] - middle
    ends = mesh.cells[:, edges]
    crossed = (side[ends[..., 0]] < 0) != (side[ends[..., 1]] < 0)
    numbers = np.flatnonzero(crossed.any(axis=1))
    outlines = []
    for number in numbers:
        first, second = ends[number][crossed[number]].T
        share = side[first] / (side[first] - side[second])
        a, b = (mesh.vertices[ends_of][:, list(axes)] for ends_of in (first, second))
        corners = a + share[:, None] * (b - a)
        x, y = (corners - corners.mean(axis=0)).T
        outlines.append(corners[np.argsort(np.arctan2(y, x))])
    return numbers, outlines


def draw_mesh(axes: Axes, plane: Plane) -> None:
    """Draw the mesh faintly, and fit the axes to it."""
    low, high = extent(plane)
    if len(plane.outlines) <= _MOST_CELLS:
        lines = PolyCollection(plane.outlines, facecolors="none", edgecolors=_FAINT)
        lines.set(linewidth=0.4, zorder=0.6)
        axes.add_collection(lines)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.grid(visible=False)


def extent(plane: Plane) -> tuple[RealArray, RealArray]:
    """The lowest and the highest place of the mesh along and up [m]."""
    corners = np.concatenate(plane.outlines)
    return corners.min(axis=0), corners.max(axis=0)


def picture_size(plane: Plane, highest: float) -> tuple[float, float]:
    """Width and height that a picture of the ground takes, both in inches.

    Args:
        plane: The plane.
        highest: The most that its height may be [inch].
    """
    low, high = extent(plane)
    width, height = high - low
    scale = min(_WIDTH / width, highest / height)
    return max(scale * width, _NARROWEST), scale * height


def discs(
    axes: Axes,
    plane: Plane,
    points: StoredPoints,
    values: RealArray,
    scale: tuple[float, float],
    most: int = 20_000,
) -> EllipseCollection:
    """Draw points as discs of their own area, coloured by a value each.

    Args:
        axes: Where.
        plane: The plane.
        points: The points.
        values: Of every point, shape ``(num_points,)``.
        scale: Values at the ends of the colours.
        most: More points than these are thinned evenly, and drawn larger.

    Returns:
        The discs, of those points that the plane shows.
    """
    chosen = np.flatnonzero(plane.shown(points))
    thin = max(1, -(-len(chosen) // most))
    chosen = chosen[::thin]
    size = points.volume[chosen] ** (1 / points.position.shape[1])
    diameter = 2.0 / np.sqrt(np.pi) * np.sqrt(thin) * size
    drawn = EllipseCollection(
        diameter,
        diameter,
        np.zeros(len(chosen)),
        units="xy",
        offsets=plane.project(points.position)[chosen],
        offset_transform=axes.transData,
        array=values[chosen],
        linewidths=0.0,
        cmap="viridis",
        clim=scale,
    )
    axes.add_collection(drawn)
    return drawn
