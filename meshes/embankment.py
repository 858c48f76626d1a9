# SPDX-License-Identifier: MIT
"""Mesh of a trapezoidal embankment: quadrilaterals in rows from face to face.

    python3 embankment.py --height 30 --crest 10 --slope 2 --cells 24 12 -o embankment.msh
    python3 embankment.py --air 5 --beside 20 -o embankment.msh

The base is at y = 0 and the middle of the crest at x = 0. The region is ``fill``; the boundaries
are ``base``, ``crest``, ``left_face`` and ``right_face``. With air the embankment stands in a box
of background cells, the region ``air``; the boundaries are the box's: ``base``, ``left``, ``right``
and ``top``.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path

import gmsh

sys.path.append(str(Path(__file__).parent))  # where it is not run as a script
from _command import draw_as_asked
from _ground import Ground, positive
from _section import draw_section


def embankment(
    path: Path,
    *,
    height: float = 30.0,
    crest: float = 10.0,
    slope: float = 2.0,
    right_slope: float | None = None,
    cells: Sequence[int] = (24, 12),
    air: float | None = None,
    beside: float | None = None,
) -> Path:
    """Write the mesh.

    Args:
        path: Where to.
        height: [m].
        crest: Width of the crest [m].
        slope: Run over rise of the left face [-].
        right_slope: Of the right face; the left one's if ``None``.
        cells: Cells across and over the height. With air there are no rows from face to face, and
            only the second counts: cells are about as wide as high.
        air: Height of background cells above the crest [m]; none if ``None``.
        beside: How far they reach beyond the feet [m]; the height if ``None``.

    Returns:
        The path.

    Raises:
        ValueError: A length that is not positive, or no cells.
    """
    right_slope = slope if right_slope is None else right_slope
    if min(height, crest) <= 0 or min(slope, right_slope) < 0 or min(cells) < 1:
        raise ValueError(
            f"found height {height} m, crest {crest} m, slopes {slope} and {right_slope}, cells "
            f"{cells}; expected positive lengths, slopes from 0, and at least one cell a direction"
        )
    if air is None and beside is not None:
        raise ValueError("found a width of air and no height; expected both")
    feet = (-crest / 2 - slope * height, crest / 2 + right_slope * height)
    corners = [(feet[0], 0.0), (feet[1], 0.0), (crest / 2, height), (-crest / 2, height)]
    if air is not None:
        beside = height if beside is None else beside
        positive(beside=beside)
        ends = [(feet[0] - beside, 0.0), (feet[1] + beside, 0.0)]
        surface = [ends[0], corners[0], corners[3], corners[2], corners[1], ends[1]]
        ground = Ground(layers=(("fill", math.inf),), size=height / cells[1], air=air)
        return draw_section(path, ground, surface)
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        geo, mesh = gmsh.model.geo, gmsh.model.mesh
        points = [geo.addPoint(x, y, 0.0) for x, y in corners]
        lines = [geo.addLine(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
        section = geo.addPlaneSurface([geo.addCurveLoop(lines)])
        geo.synchronize()
        for line, count in zip(lines, (*cells, *cells), strict=True):
            mesh.setTransfiniteCurve(line, count + 1)
        mesh.setTransfiniteSurface(section, cornerTags=points)
        mesh.setRecombine(2, section)
        gmsh.model.addPhysicalGroup(2, [section], name="fill")
        names = ("base", "right_face", "crest", "left_face")
        for name, line in zip(names, lines, strict=True):
            gmsh.model.addPhysicalGroup(1, [line], name=name)
        mesh.generate(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


def parser() -> argparse.ArgumentParser:
    """Options, of the names of the arguments of :func:`embankment`."""
    options = argparse.ArgumentParser(description="Mesh of a trapezoidal embankment.")
    options.add_argument("--height", type=float, default=30.0, help="[m]")
    options.add_argument("--crest", type=float, default=10.0, help="width [m]")
    options.add_argument("--slope", type=float, default=2.0, help="run over rise")
    options.add_argument("--right-slope", type=float, help="where it differs from the left one")
    options.add_argument(
        "--cells", type=int, nargs=2, default=(24, 12), help="across, over the height"
    )
    options.add_argument("--air", type=float, help="height of background cells above the crest [m]")
    options.add_argument("--beside", type=float, help="how far they reach beyond the feet [m]")
    options.add_argument("-o", "--output", type=Path, default=Path("embankment.msh"))
    return options


if __name__ == "__main__":
    draw_as_asked(embankment, parser())
