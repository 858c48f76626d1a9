# SPDX-License-Identifier: MIT
"""Mesh of a half-space section with a semi-circular canyon in its surface, in quadrilaterals.

    python3 canyon.py --radius 1 --half-width 8 --depth 8 --wavelength 2 -o canyon.msh

The base is at y = 0, the surface at y = depth, and the canyon's centre at x = 0 in the surface.
Rays lead from the canyon to the sides of a block of twice its radius; rectangles of equal cells
lead on from there, so that nodes of the left and right sides stand at equal heights. The region is
``rock``; the boundaries are ``base``, ``left``, ``right`` and ``top``, the canyon included.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import gmsh

sys.path.append(str(Path(__file__).parent))  # where it is not run as a script
from _command import draw_as_asked

# Blocks by their corners, counter-clockwise; see _corners. The first three lie at the canyon.
_BLOCKS = (
    ("a", "A", "B", "b"),
    ("b", "B", "C", "c"),
    ("c", "C", "D", "d"),
    ("F", "B", "A", "E"),
    ("C", "G", "H", "D"),
    ("I", "J", "B", "F"),
    ("J", "K", "C", "B"),
    ("K", "L", "G", "C"),
)
_BOUNDARIES = {
    "base": ("IJ", "JK", "KL"),
    "left": ("EF", "FI"),
    "right": ("GH", "LG"),
    "top": ("AE", "aA", "ab", "bc", "cd", "Dd", "HD"),
}


def canyon(
    path: Path,
    *,
    radius: float = 1.0,
    half_width: float = 8.0,
    depth: float = 8.0,
    wavelength: float = 2.0,
    cells_per_wavelength: float = 6.0,
    order: int = 2,
) -> Path:
    """Write the mesh.

    Args:
        path: Where to.
        radius: Of the canyon [m].
        half_width: From the canyon's centre to either side, more than twice the radius [m].
        depth: From the surface to the base, more than twice the radius [m].
        wavelength: The shortest one [m].
        cells_per_wavelength: No side of a cell is longer than the wavelength over this.
        order: Of the cells' geometry; 2 follows the circle.

    Returns:
        The path.

    Raises:
        ValueError: Sizes that do not leave room, or are not positive.
    """
    if not (radius > 0 and min(half_width, depth) > 2 * radius):
        raise ValueError(
            f"found radius {radius}, half-width {half_width} and depth {depth} m; expected a "
            "positive radius and more than twice as much to the sides and the base"
        )
    if not (wavelength > 0 and cells_per_wavelength > 0 and order in (1, 2)):
        raise ValueError(
            f"found {cells_per_wavelength} cells to a wavelength of {wavelength} m, of order "
            f"{order}; expected positive numbers, and order 1 or 2"
        )
    longest = wavelength / cells_per_wavelength
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        _draw(_corners(radius, half_width, depth), longest)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    return path


def _corners(radius: float, half_width: float, depth: float) -> dict[str, tuple[float, float]]:
    """Corners of the blocks [m]: small letters on the canyon, large ones around it."""
    diagonal, edge = radius / math.sqrt(2), 2 * radius
    across = {"a": -radius, "b": -diagonal, "c": diagonal, "d": radius}
    across |= {"A": -edge, "B": -edge, "C": edge, "D": edge, "J": -edge, "K": edge}
    across |= dict.fromkeys("EFI", -half_width) | dict.fromkeys("GHL", half_width)
    below = dict.fromkeys("adADEH", 0.0) | dict.fromkeys("bc", diagonal)
    below |= dict.fromkeys("BCFG", edge) | dict.fromkeys("IJKL", depth)
    return {name: (across[name], depth - below[name]) for name in across}


def _draw(corners: dict[str, tuple[float, float]], longest: float) -> None:
    """Draw the blocks, each with as many cells as its longest lines take."""
    geo, mesh = gmsh.model.geo, gmsh.model.mesh
    points = {name: geo.addPoint(x, y, 0.0) for name, (x, y) in corners.items()}
    centre = geo.addPoint(0.0, corners["a"][1], 0.0)
    lines: dict[str, int] = {}
    surfaces = []
    for block in _BLOCKS:
        loop = []
        for start, end in zip(block, block[1:] + block[:1], strict=True):
            if end + start in lines:
                loop.append(-lines[end + start])
                continue
            ends = points[start], points[end]
            on_circle = (start + end).islower()
            line = geo.addCircleArc(ends[0], centre, ends[1]) if on_circle else geo.addLine(*ends)
            lines[start + end] = line
            loop.append(line)
        surfaces.append(geo.addPlaneSurface([geo.addCurveLoop(loop)]))
    geo.synchronize()
    for name, count in _counts(corners, longest, lines).items():
        mesh.setTransfiniteCurve(lines[name], count + 1)
    for surface, block in zip(surfaces, _BLOCKS, strict=True):
        mesh.setTransfiniteSurface(surface, cornerTags=[points[name] for name in block])
        mesh.setRecombine(2, surface)
    gmsh.model.addPhysicalGroup(2, surfaces, name="rock")
    for boundary, names in _BOUNDARIES.items():
        found = [lines[n] if n in lines else lines[n[::-1]] for n in names]
        gmsh.model.addPhysicalGroup(1, found, name=boundary)


def _counts(
    corners: dict[str, tuple[float, float]], longest: float, lines: dict[str, int]
) -> dict[str, int]:
    """Cells along every line: alike on opposite sides of a block, enough for the longest."""
    group = {name: name for name in lines}

    def root(name: str) -> str:
        name = name if name in group else name[::-1]
        while group[name] != name:
            name = group[name]
        return name

    for block in _BLOCKS:
        sides = [a + b for a, b in zip(block, block[1:] + block[:1], strict=True)]
        for one, opposite in ((0, 2), (1, 3)):
            group[root(sides[one])] = root(sides[opposite])
    needed = {}
    for name in lines:
        length = math.dist(corners[name[0]], corners[name[1]])  # an arc's is below its outer side's
        count = math.ceil(length / longest - 1e-9)
        needed[root(name)] = max(needed.get(root(name), 1), count)
    return {name: needed[root(name)] for name in lines}


def parser() -> argparse.ArgumentParser:
    """Options, of the names of the arguments of :func:`canyon`."""
    options = argparse.ArgumentParser(description="Mesh of a semi-circular canyon.")
    options.add_argument("--radius", type=float, default=1.0, help="[m]")
    options.add_argument("--half-width", type=float, default=8.0, help="[m]")
    options.add_argument("--depth", type=float, default=8.0, help="[m]")
    options.add_argument("--wavelength", type=float, default=2.0, help="the shortest one [m]")
    options.add_argument("--cells-per-wavelength", type=float, default=6.0)
    options.add_argument("--order", type=int, default=2, help="of the cells' geometry, 1 or 2")
    options.add_argument("-o", "--output", type=Path, default=Path("canyon.msh"))
    return options


if __name__ == "__main__":
    draw_as_asked(canyon, parser())
