# SPDX-License-Identifier: MIT
"""Mesh of a trapezoidal embankment: quadrilaterals in rows from face to face.

    python3 embankment.py --height 30 --crest 10 --slope 2 --cells 24 12 -o embankment.msh

The base is at y = 0 and the middle of the crest at x = 0. The region is ``fill``; the boundaries
are ``base``, ``crest``, ``left_face`` and ``right_face``.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import gmsh


def embankment(
    path: Path,
    *,
    height: float = 30.0,
    crest: float = 10.0,
    slope: float = 2.0,
    right_slope: float | None = None,
    cells: tuple[int, int] = (24, 12),
) -> Path:
    """Write the mesh.

    Args:
        path: Where to.
        height: [m].
        crest: Width of the crest [m].
        slope: Run over rise of the left face [-].
        right_slope: Of the right face; the left one's if ``None``.
        cells: Cells across and over the height.

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
    feet = (-crest / 2 - slope * height, crest / 2 + right_slope * height)
    corners = [(feet[0], 0.0), (feet[1], 0.0), (crest / 2, height), (-crest / 2, height)]
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


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line.

    Args:
        arguments: Those of the process if ``None``.
    """
    parser = argparse.ArgumentParser(description="Mesh of a trapezoidal embankment.")
    parser.add_argument("--height", type=float, default=30.0, help="[m]")
    parser.add_argument("--crest", type=float, default=10.0, help="width [m]")
    parser.add_argument("--slope", type=float, default=2.0, help="run over rise")
    parser.add_argument("--right-slope", type=float, help="where it differs from the left one")
    parser.add_argument(
        "--cells", type=int, nargs=2, default=(24, 12), help="across, over the height"
    )
    parser.add_argument("-o", "--output", type=Path, default=Path("embankment.msh"))
    given = vars(parser.parse_args(arguments))
    given["cells"] = tuple(given["cells"])
    try:
        embankment(given.pop("output"), **given)
    except ValueError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
