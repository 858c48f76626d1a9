# SPDX-License-Identifier: MIT
"""A section under a broken line, in quadrilaterals that follow the line.

Where the surface is level, the section is made of rows and columns, which lean with steep faces
beside them. Around flatter faces it is left to gmsh to fill layers and air: triangles of twice the
size are joined in pairs by a perfect matching (blossom; Remacle et al. 2012), and what comes of it
is divided into quadrilaterals. That needs an even number of cells along every line. Two ways of
drawing the triangles are tried, and that with the shorter longest side is taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import gmsh
import numpy as np
import numpy.typing as npt
from _file import draw
from _ground import ROUNDING, Ground, check_number, count, longest_sides, resolved

RealArray = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
Place = tuple[float, float]
Line = tuple[Place, Place]

_STEEP = 0.75  # run over rise
_TRIANGLES = (8, 6)  # gmsh's numbers of frontal Delaunay for quadrilaterals, and without that aim
_DIVIDED_BLOSSOM = 3


def draw_section(path: Path, ground: Ground, surface: Sequence[Place]) -> Path:
    """Write a section.

    Args:
        path: Where to.
        ground: Layers and cells.
        surface: Its bends from the left side to the right one [m], level at either end and without
            a valley; it may be vertical, but does not overhang.

    Returns:
        The path.

    Raises:
        ValueError: A layer or a seam without a cell, or too many cells.
    """

    def make(scale: float) -> tuple[RealArray, Numbers, npt.NDArray[np.bool_]]:
        points, cells = section_cells(ground, surface, scale)
        centre = points[cells].mean(axis=1)
        return points, cells, is_below(surface, centre[:, 0], centre[:, 1])

    return draw(path, ground, *resolved(ground, make))


def is_below(surface: Sequence[Place], x: RealArray, height: RealArray) -> npt.NDArray[np.bool_]:
    """Whether places [m] lie below a surface; none lies on a vertical part of it."""
    return height < np.interp(x, *np.transpose(surface))


def section_cells(
    ground: Ground, surface: Sequence[Place], scale: float, to_crest: bool = False
) -> tuple[RealArray, Numbers]:
    """Cells below the surface, and where there is air above it.

    Args:
        ground: Layers and cells.
        surface: See :func:`draw_section`.
        scale: Of the cells' sizes [-].
        to_crest: Whether cells above the surface end at the crest's level, with or without air;
            the crest is on the left then.

    Returns:
        Nodes [m], shape ``(num_nodes, 2)``, and counter-clockwise nodes of the cells, shape
        ``(num_cells, 4)``.

    Raises:
        ValueError: A layer that begins above the ground, or too many cells.
        RuntimeError: None of the ways gives sound quadrilaterals.
    """
    crest = max(height for _, height in surface)
    if ground.style == "grid":
        crest += ground.air or 0.0
        surface = [(surface[0][0], crest), (surface[-1][0], crest)]
        ground = Ground(size=ground.width)
    size = scale * ground.width
    check_number(count(surface[-1][0] - surface[0][0], size), count(crest, size))
    section = _Section(ground, surface, scale, to_crest)
    tried = [section.mesh(way) for way in _TRIANGLES[: 2 if section.patches else 1]]
    found = [mesh for mesh in tried if mesh is not None and _are_convex(*mesh)]
    if not found:
        raise RuntimeError(
            "found triangles or inverted cells around the face; expected none. Choose another "
            "size, layers that end farther from its ends, or the style 'grid'"
        )
    return min(found, key=lambda mesh: float(longest_sides(*mesh).max()))


def _are_convex(points: RealArray, cells: Numbers) -> bool:
    """Whether every corner of every quadrilateral is below 180 degrees."""
    corners = points[cells]
    x, y = np.moveaxis(np.roll(corners, -1, axis=1) - corners, -1, 0)
    return bool((np.roll(x, 1, axis=1) * y > np.roll(y, 1, axis=1) * x).all())


@dataclass(frozen=True)
class _Wall:
    """A line from the base to the roof that runs along a steep face, and straight up beside it.

    Attributes:
        low: Lower end of the face.
        high: Upper end; the same where there is no face.
    """

    low: Place
    high: Place

    def at(self, height: float) -> Place:
        """Its place at a height [m]."""
        (x, low), (beyond, high) = self.low, self.high
        part = min(max((height - low) / (high - low), 0.0), 1.0) if high > low else 0.0
        return x + part * (beyond - x), height


@dataclass(frozen=True)
class _Stretch:
    """A part of the section between two walls.

    Attributes:
        left: One wall.
        right: The other.
        surface: The surface between them.
    """

    left: _Wall
    right: _Wall
    surface: list[Place]

    @property
    def is_level(self) -> bool:
        """Whether the surface is."""
        return len({height for _, height in self.surface}) == 1


class _Section:
    """Parts of a section, and the number of cells along each line between them.

    A part is the ring of its corners, counter-clockwise. A line is named by its ends, the lower or
    left one first.
    """

    def __init__(
        self, ground: Ground, surface: Sequence[Place], scale: float, to_crest: bool
    ) -> None:
        self.ground = ground
        self.scale = scale
        self.to_crest = to_crest
        self.lines: dict[Line, int] = {}
        self.blocks: list[list[Place]] = []  # of rows and columns
        self.patches: list[list[Place]] = []  # for gmsh to fill
        stretches = list(_stretches(surface, 2 * ground.width))
        level = [part.surface[0][1] for part in stretches if part.is_level]
        self.parts = 1 if len(level) == len(stretches) else 2  # which divides the number of cells
        self.heights, self.tops = self._levels([height for _, height in surface], level)
        sizes = ground.sizes_between(self.heights)
        self.rows = [
            self._count(high - low, size)
            for (low, high), size in zip(pairwise(self.heights), sizes, strict=True)
        ]
        for part in stretches:
            top = min(self._snapped(height) for _, height in part.surface)
            if part.is_level:
                self._add_blocks(part, math.inf if ground.air or to_crest else top)
            else:
                floor = max([0.0, *(height for height in self.tops if height < top)])
                self._add_blocks(part, floor)
                self._add_patches(part, floor)

    def _levels(
        self, bends: Sequence[float], level: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        """Heights at which rows end [m], and those of them at which layers but the last do.

        Args:
            bends: Heights of the surface's bends [m].
            level: Heights of its level parts [m].
        """
        tops = self.ground.tops(bends)
        roof = max(bends) + (self.ground.air or 0.0)
        heights = [0.0]
        for height in sorted({*level, *tops, max(bends), roof}):
            if height - heights[-1] > ROUNDING * roof:
                heights.append(height)
        return heights, [min(heights, key=lambda known: abs(known - top)) for top in tops]

    def _snapped(self, height: float) -> float:
        """A height, or the end of a row that differs from it by rounding only."""
        nearest = min(self.heights, key=lambda known: abs(known - height))
        return nearest if abs(nearest - height) <= ROUNDING * self.heights[-1] else height

    def _add_blocks(self, part: _Stretch, top: float) -> None:
        """Rows of a stretch from the base to a height."""
        widths = [part.right.at(h)[0] - part.left.at(h)[0] for h in self.heights]
        columns = self._count(max(widths), self.ground.width)
        for (low, high), rows in zip(pairwise(self.heights), self.rows, strict=True):
            if high <= top:
                walls = part.left, part.right
                block = [*(wall.at(low) for wall in walls), *(w.at(high) for w in walls[::-1])]
                self.lines |= dict(zip(_lines(block), (columns, rows) * 2, strict=True))
                self.blocks.append(block)

    def _add_patches(self, part: _Stretch, floor: float) -> None:
        """Layers and air under and over a leaning surface, from a height on."""
        surface = _cut([(x, self._snapped(height)) for x, height in part.surface], self.tops)
        sides = surface[0][0], surface[-1][0]
        layers = zip(pairwise([0.0, *self.tops, math.inf]), self.ground.sizes, strict=True)
        patches = [(_layer(surface, *ends), size) for ends, size in layers if ends[0] >= floor]
        patches += [(ring, self.ground.sizes[-1]) for ring in self._above(surface)]
        for ring, size in patches:
            ring = self._with_rows(ring, sides)
            for line in _lines(ring):
                if _is_on(line, sides):
                    self.lines[line] = self.rows[self.heights.index(line[0][1])]
                else:
                    cells = self._count(math.dist(*line), size)
                    self.lines[line] = max(self.lines.get(line, 1), cells)
            self.patches += [ring] if ring else []

    def _above(self, surface: list[Place]) -> list[list[Place]]:
        """Rings of what is above a leaning surface and has cells."""
        (left, crest), (right, _) = surface[0], surface[-1]
        roof = self.heights[-1]
        if self.to_crest:
            edge = max(number for number, (_, height) in enumerate(surface) if height == crest)
            rings = [[*surface[edge:], (right, crest)]]
            surface = [*surface[: edge + 1], (right, crest)]
        else:
            rings = []
        return rings + ([[*surface, (right, roof), (left, roof)]] if self.ground.air else [])

    def _count(self, length: float, size: float) -> int:
        return self.parts * count(length, self.parts * self.scale * size)

    def _with_rows(self, ring: list[Place], sides: tuple[float, float]) -> list[Place]:
        """A ring with a corner at the end of each row on its sides, as the blocks beside it."""
        found = []
        for start, end in zip(ring, ring[1:] + ring[:1], strict=True):
            found.append(start)
            if _is_on((start, end), sides):
                low, high = sorted((start[1], end[1]))
                inner = [(start[0], height) for height in self.heights if low < height < high]
                found += inner if start[1] < end[1] else inner[::-1]
        return found

    def mesh(self, triangles: int) -> tuple[RealArray, Numbers] | None:
        """Nodes [m] and cells, made in one of the ways; ``None`` where it leaves triangles."""
        gmsh.initialize(interruptible=False)
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.option.setNumber("Mesh.Algorithm", triangles)
            gmsh.option.setNumber("Mesh.RecombinationAlgorithm", _DIVIDED_BLOSSOM)
            self._draw()
            mesh = gmsh.model.mesh
            try:
                mesh.generate(2)
            except Exception:  # the only kind that gmsh raises
                return None
            tags, places, _ = mesh.getNodes()
            number = np.zeros(int(tags.max()) + 1, np.int64)
            number[tags] = np.arange(len(tags))
            quads, left = (
                mesh.getElementsByType(mesh.getElementType(kind, 1))[1]
                for kind in ("Quadrangle", "Triangle")
            )
        finally:
            gmsh.finalize()
        if len(left):
            return None
        return places.reshape(-1, 3)[:, :2], number[quads].reshape(-1, 4)

    def _draw(self) -> None:
        geo, mesh = gmsh.model.geo, gmsh.model.mesh
        points = {place: geo.addPoint(*place, 0.0) for place in _places(self.lines)}
        tags = {line: geo.addLine(*(points[place] for place in line)) for line in self.lines}
        surfaces = []
        for ring in (*self.blocks, *self.patches):
            loop = geo.addCurveLoop([tags[line] for line in _lines(ring)], reorient=True)
            surfaces.append(geo.addPlaneSurface([loop]))
        geo.synchronize()
        for line, cells in self.lines.items():
            mesh.setTransfiniteCurve(tags[line], cells + 1)
        for surface in surfaces[: len(self.blocks)]:
            mesh.setTransfiniteSurface(surface)
        for surface in surfaces:
            mesh.setRecombine(2, surface)


def _lines(ring: Sequence[Place]) -> list[Line]:
    """The lines round a ring."""
    ends = zip(ring, [*ring[1:], *ring[:1]], strict=True)
    return [(min(start, end), max(start, end)) for start, end in ends]


def _places(lines: Iterable[Line]) -> list[Place]:
    return list(dict.fromkeys(place for line in lines for place in line))


def _is_on(line: Line, sides: tuple[float, float]) -> bool:
    """Whether a line lies on one of two verticals."""
    return line[0][0] == line[1][0] and line[0][0] in sides


def _stretches(surface: Sequence[Place], least: float) -> Iterator[_Stretch]:
    """The section in parts over which the surface is level, or leans somewhere.

    Args:
        surface: From left to right [m].
        least: Two that lean are one if they are nearer to each other [m].

    Yields:
        From left to right. Steep faces are walls. Level ground is let into parts that lean for half
        the height of the face, but not more than half of it.
    """
    leaning: list[list[float]] = []
    walls = [_Wall(surface[0], surface[0]), _Wall(surface[-1], surface[-1])]
    for number, (start, end) in enumerate(pairwise(surface)):
        run, rise = end[0] - start[0], abs(end[1] - start[1])
        if run <= _STEEP * rise:
            walls.append(_Wall(*sorted((start, end), key=lambda place: place[1])))
        elif rise:
            before = start[0] - surface[max(number - 1, 0)][0]
            after = surface[min(number + 2, len(surface) - 1)][0] - end[0]
            left, right = start[0] - min(rise, before) / 2, end[0] + min(rise, after) / 2
            if leaning and left - leaning[-1][1] < least:
                leaning[-1][1] = right
            else:
                leaning.append([left, right])
    walls += [_Wall((x, 0.0), (x, 0.0)) for part in leaning for x in part]
    walls.sort(key=lambda wall: wall.low[0])
    for left, right in pairwise(walls):
        start, end = max(left.low[0], left.high[0]), min(right.low[0], right.high[0])
        inner = [place for place in surface if start < place[0] < end]
        yield _Stretch(left, right, [_at(surface, start, 1), *inner, _at(surface, end, -1)])


def _at(surface: Sequence[Place], x: float, side: int) -> Place:
    """The surface just right (1) or left (-1) of a place, on level ground or at a bend."""
    for (left, height), (right, beyond) in pairwise(surface):
        if (left <= x < right) if side > 0 else (left < x <= right):
            return x, (beyond if x == right else height)
    raise AssertionError("a place on the surface")


def _cut(surface: Sequence[Place], heights: Sequence[float]) -> list[Place]:
    """A surface with bends also where it crosses heights [m]."""
    found = [surface[0]]
    for (x, height), (right, beyond) in pairwise(surface):
        low, high = sorted((height, beyond))
        crossed = sorted((h for h in heights if low < h < high), reverse=beyond < height)
        found += [(x + (h - height) / (beyond - height) * (right - x), h) for h in crossed]
        found.append((right, beyond))
    return found


def _layer(surface: Sequence[Place], low: float, high: float) -> list[Place]:
    """Ring of the ground between two heights [m]; empty where there is none."""
    above = [number for number, (_, height) in enumerate(surface) if height > low]
    if not above:
        return []
    first, last = max(above[0] - 1, 0), min(above[-1] + 1, len(surface) - 1)
    upper = list(surface[first : last + 1])
    ends = [(x, min(height, high)) for x, height in (upper[0], upper[-1])]
    inner = [place for place in upper[1:-1] if place[1] <= high]
    ring = [(ends[0][0], low), (ends[1][0], low), ends[1], *inner[::-1], ends[0]]
    return [place for place, after in zip(ring, ring[1:] + ring[:1], strict=True) if place != after]
