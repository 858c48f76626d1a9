# SPDX-License-Identifier: MIT
"""Mesh of a terraced slope that falls to the right in steps, in quadrilaterals, as slope.py's.

    python3 terraces.py --steps 3 --rise 3 --tread 5 --riser-slope 0.3 --air 2 -o terraces.msh

The base is at y = 0, the lowest toe's level at y = depth, the left side at x = 0. Regions are the
layers (``soil``), the ``seam`` and the ``air``; the boundaries ``base``, ``left``, ``right``, and
with air ``top``, else ``surface``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parent))  # where it is not run as a script
from _command import draw_as_asked
from _ground import Ground, add_ground_options, positive, run_over_rise
from _section import draw_section


def terraces(
    path: Path,
    *,
    steps: int = 3,
    rise: float = 3.0,
    tread: float = 5.0,
    riser_slope: float = 0.0,
    depth: float = 5.0,
    behind: float | None = None,
    before: float | None = None,
    **ground: Any,
) -> Path:
    """Write the mesh.

    Args:
        path: Where to.
        steps: Number of risers.
        rise: Height of each [m].
        tread: Level ground between two risers [m].
        riser_slope: Run over rise of the risers [-]; 0 is vertical.
        depth: From the lowest toe to the base [m].
        behind: From the left side to the crest [m]; twice the height of all if ``None``.
        before: From the lowest toe to the right side [m]; as much if ``None``.
        ground: Layers, cells and air, see ``Ground`` in ``_ground.py``.

    Returns:
        The path.

    Raises:
        ValueError: What makes no steps, or no mesh.
    """
    if steps < 1:
        raise ValueError(f"found {steps} steps; expected at least one")
    behind = 2 * steps * rise if behind is None else behind
    before = 2 * steps * rise if before is None else before
    positive(rise=rise, tread=tread, depth=depth, behind=behind, before=before)
    run = run_over_rise(riser_slope, None) * rise
    surface = [(0.0, depth + steps * rise)]
    for step in range(steps):
        crest, height = behind + step * (run + tread), depth + (steps - step) * rise
        surface += [(crest, height), (crest + run, height - rise)]
    return draw_section(path, Ground(**ground), [*surface, (surface[-1][0] + before, depth)])


def parser() -> argparse.ArgumentParser:
    """Options, of the names of the arguments of :func:`terraces`."""
    options = argparse.ArgumentParser(description="Mesh of a slope that falls in steps.")
    options.add_argument("--steps", type=int, default=3, help="number of risers")
    options.add_argument("--rise", type=float, default=3.0, help="height of a riser [m]")
    options.add_argument("--tread", type=float, default=5.0, help="between two risers [m]")
    options.add_argument("--riser-slope", type=float, default=0.0, help="run over rise")
    options.add_argument("--depth", type=float, default=5.0, help="from the toe to the base [m]")
    options.add_argument("--behind", type=float, help="left of the crest [m]; 2 heights if absent")
    options.add_argument("--before", type=float, help="right of the toe [m]; 2 heights if absent")
    add_ground_options(options)
    options.add_argument("-o", "--output", type=Path, default=Path("terraces.msh"))
    return options


if __name__ == "__main__":
    draw_as_asked(terraces, parser())
