# SPDX-License-Identifier: MIT
"""Mesh of a slope that falls to the right, in quadrilaterals, with layers, a weak seam and air.

    python3 slope.py --height 10 --slope 1.5 --depth 5 --air 2 -o slope.msh
    python3 slope.py --layers rock:3 clay --seam 0 12 40 4 1.5 --max-frequency 10 --vs 700 200

The base is at y = 0, the toe's level at y = depth, the left side at x = 0. Regions are the layers
(``soil``), the ``seam`` and the ``air``; the boundaries ``base``, ``left``, ``right``, and with air
``top``, else ``surface``. Rows of cells are level and end at layers; columns lean with the face.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parent))  # where it is not run as a script
from _command import draw_as_asked
from _ground import Ground, add_ground_options, add_slope_options, positive, run_over_rise
from _section import draw_section


def slope(
    path: Path,
    *,
    height: float = 10.0,
    depth: float = 5.0,
    slope: float | None = None,
    angle: float | None = None,
    behind: float | None = None,
    before: float | None = None,
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
        ground: Layers, cells and air, see ``Ground`` in ``_ground.py``.

    Returns:
        The path.

    Raises:
        ValueError: What makes no slope, or no mesh.
    """
    behind = 2 * height if behind is None else behind
    before = 2.5 * height if before is None else before
    positive(height=height, depth=depth, behind=behind, before=before)
    run = run_over_rise(slope, angle)
    toe = behind + run * height
    surface = [(0.0, depth + height), (behind, depth + height), (toe, depth), (toe + before, depth)]
    return draw_section(path, Ground(**ground), surface)


def parser() -> argparse.ArgumentParser:
    """Options, of the names of the arguments of :func:`slope`."""
    options = argparse.ArgumentParser(description="Mesh of a slope that falls to the right.")
    add_slope_options(options)
    add_ground_options(options)
    options.add_argument("-o", "--output", type=Path, default=Path("slope.msh"))
    return options


if __name__ == "__main__":
    draw_as_asked(slope, parser())
