# SPDX-License-Identifier: MIT
"""Mesh of a slope in space, in hexahedra: the section of slope.py along y, or a cut of some width.

    python3 slope3d.py --height 10 --slope 1.5 --width 20 --size 2.5 --air 2.5 -o slope3d.msh
    python3 slope3d.py --width 60 --cut 20 40 --bulge -3 --size 2.5 -o bay.msh

The slope falls along x, z is up. The base is at z = 0, the toe's level at z = depth, the left side
at x = 0, the front at y = 0. With a cut, the ground beside it stays at the crest's level, and the
ends of the cut lean like its face. Regions are the layers (``soil``), the ``seam`` and the ``air``;
the boundaries ``base``, ``left``, ``right``, ``front``, ``back``, and with air ``top``, else
``surface``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

sys.path.append(str(Path(__file__).parent))  # where it is not run as a script
from _command import draw_as_asked
from _file import draw
from _ground import (
    Ground,
    add_ground_options,
    add_slope_options,
    check_number,
    count,
    positive,
    resolved,
    run_over_rise,
)
from _section import section_cells

RealArray = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]


def slope3d(
    path: Path,
    *,
    height: float = 10.0,
    depth: float = 5.0,
    slope: float | None = None,
    angle: float | None = None,
    behind: float | None = None,
    before: float | None = None,
    width: float = 20.0,
    cut: Sequence[float] | None = None,
    bulge: float = 0.0,
    **ground: Any,
) -> Path:
    """Write the mesh.

    Args:
        path: Where to.
        height: From toe to crest [m].
        depth: From the toe to the base [m].
        slope: Run over rise [-]; 1.5 if it is not given by the angle.
        angle: From the horizontal [degrees].
        behind: From the left side to the crest [m]; twice the height if ``None``.
        before: From the toe to the right side [m]; two and a half times the height if ``None``.
        width: Along y [m].
        cut: Between which places along y the toe lies [m]; all the width if ``None``.
        bulge: How far the middle of the face stands before its ends [m], along a parabola; a
            hollow if negative.
        ground: Layers, cells and air, see ``Ground`` in ``_ground.py``.

    Returns:
        The path.

    Raises:
        ValueError: What makes no slope, or no mesh.
    """
    behind = 2 * height if behind is None else behind
    before = 2.5 * height if before is None else before
    positive(height=height, depth=depth, behind=behind, before=before, width=width)
    run = run_over_rise(slope, angle)
    toe, crest = behind + run * height, depth + height
    ends = (0.0, width) if cut is None else (cut[0], cut[1])
    reach = 0.0 if cut is None else run * height
    if not (ends[0] < ends[1] and (cut is None or (reach < ends[0] and ends[1] + reach < width))):
        raise ValueError(
            f"found a cut from {ends[0]} to {ends[1]} m of a width of {width} m; expected room for "
            f"its ends, which lean over {reach} m"
        )
    if not -behind / 2 <= bulge <= before / 2:
        raise ValueError(f"found a bulge of {bulge} m; expected {-behind / 2} to {before / 2}")
    plan = _Plan(toe, depth, crest, run, ends, cut is not None, bulge)
    made = Ground(**ground)
    surface = [(0.0, crest), (behind, crest), (toe, depth), (toe + before, depth)]
    fits = made.style == "fitted"
    to_crest = cut is not None  # as ground stands beside it

    def make(scale: float) -> tuple[RealArray, Numbers, npt.NDArray[np.bool_]]:
        section, quads = section_cells(made, surface, scale, to_crest)
        size = scale * made.width
        y = plan.across(section[:, 1], width, size) if fits else _even(width, size, len(section))
        check_number(len(quads), y.shape[1] - 1)
        x, z = (np.broadcast_to(axis[:, None], y.shape) for axis in section.T)
        if fits:
            x = plan.bent(x, y, z, toe + before)
        points = np.stack([x, y, z], axis=-1)
        lines = y.shape[1]
        first = quads[:, None, :] * lines + np.arange(lines - 1)[:, None]
        # x, y, z are right-handed, x, z, y are not: the far side comes first
        cells = np.concatenate([first + 1, first], axis=-1).reshape(-1, 8)
        points = points.reshape(-1, 3)
        return points, cells, plan.inside(*points[cells].mean(axis=1).T)

    return draw(path, made, *resolved(made, make))


def _even(width: float, size: float, lines: int) -> RealArray:
    """Nodes along lines across, all evenly [m]."""
    return np.tile(np.linspace(0.0, width, count(width, size) + 1), (lines, 1))


@dataclass(frozen=True)
class _Plan:
    """Where the face is, and the ends of a cut.

    Attributes:
        toe: Place of the toe along x, without its bulge [m].
        low: Height of the toe above the base [m].
        high: Height of the crest above the base [m].
        run: Run over rise [-].
        ends: Of the toe along y [m].
        closed: Whether faces rise at the ends.
        bulge: How far its middle stands before its ends [m].
    """

    toe: float
    low: float
    high: float
    run: float
    ends: tuple[float, float]
    closed: bool
    bulge: float

    def set_back(self, z: RealArray) -> RealArray:
        """Distance of a face from the toe, in plan, at heights [m]."""
        return self.run * (np.clip(z, self.low, self.high) - self.low)

    def sides(self, z: RealArray) -> tuple[RealArray, RealArray]:
        """Places of the ends along y at heights [m]."""
        back = self.set_back(z) if self.closed else np.zeros_like(z)
        return self.ends[0] - back, self.ends[1] + back

    def shift(self, y: RealArray, z: RealArray) -> RealArray:
        """Of the face by the bulge [m]."""
        start, end = self.sides(z)
        return self.bulge * np.maximum(0.0, 1 - ((2 * y - start - end) / (end - start)) ** 2)

    def inside(self, x: RealArray, y: RealArray, z: RealArray) -> npt.NDArray[np.bool_]:
        """Whether places are in the ground."""
        start, end = self.sides(z)
        behind = x - self.shift(y, z) < self.toe - self.set_back(z)
        return (z < self.high) & ((z < self.low) | behind | (y < start) | (y > end))

    def across(self, z: RealArray, width: float, size: float) -> RealArray:
        """Nodes along y at heights, so that the ends of a cut are among them.

        Args:
            z: Heights [m], shape ``(num_lines,)``.
            width: [m].
            size: Largest distance of nodes [m].

        Returns:
            [m], shape ``(num_lines, num_nodes)``.
        """
        start, end = self.sides(z)
        walls = [np.zeros_like(z), start, end, np.full_like(z, width)]
        parts = []
        for low, high in pairwise(walls if self.closed else walls[::3]):
            part = np.linspace(0.0, 1.0, count(float((high - low).max()), size) + 1)[:-1]
            parts.append(low[:, None] * (1 - part) + high[:, None] * part)
        return np.concatenate([*parts, walls[-1][:, None]], axis=1)

    def bent(self, x: RealArray, y: RealArray, z: RealArray, length: float) -> RealArray:
        """Places along x of nodes that follow the bulge, less and less towards the sides [m]."""
        face = self.toe - self.set_back(z)
        return x + self.shift(y, z) * np.minimum(x / face, (length - x) / (length - face))


def parser() -> argparse.ArgumentParser:
    """Options, of the names of the arguments of :func:`slope3d`."""
    options = argparse.ArgumentParser(description="Mesh of a slope in space, in hexahedra.")
    add = options.add_argument
    add_slope_options(options)
    add("--width", type=float, default=20.0, help="along y [m]")
    add("--cut", type=float, nargs=2, metavar=("Y1", "Y2"), help="ends of the toe along y [m]")
    add("--bulge", type=float, default=0.0, help="of the middle of the face before its ends [m]")
    add_ground_options(options)
    add("-o", "--output", type=Path, default=Path("slope3d.msh"))
    return options


if __name__ == "__main__":
    draw_as_asked(slope3d, parser())
