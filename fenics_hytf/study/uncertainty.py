# SPDX-License-Identifier: MIT
"""How far the finest run may itself be from the truth, knob by knob, where no closed form tells.

- mesh size: Richardson. With D₁ and D₂ the distances of the mesh twice and four times as coarse
  from the fine one, D₂/D₁ = 2^p + 1 gives the order p, kept between 1 and 2·degree + 2, and
  D₁/(2^p − 1) is left, less in the p-th power of what the finest mesh is finer by;
- time step of the slip: the same with the steps, the order between 1 and 2 (a march that starts
  from rest is of the first order, one that goes on of the second);
- sweep: what a looser tolerance is off by, times the ratio of the two; a direct one is exact;
- equivalent-linear loop: a third of what the next looser tolerance is off by, for it falls in
  steps of whole iterations; times the ratio of the finest tolerance to the fine one;
- points per cell, and a band that ends below the record's: all that the next coarser value is off
  by, for no law says how it falls.

Lapses are no approximation of each other where moduli change between them, and one lapse is what is
approximated elsewhere: they leave nothing. The parts add.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from fenics_hytf.study.knobs import Knobs, Setting

_LOOP_LEFT = 1 / 3
_RATIO = 2.0  # of the mesh sizes, and of the steps


def uncertainty(
    knobs: Knobs, fine: Setting, finest: Setting, distance: Mapping[Setting, float]
) -> dict[str, float]:
    """Estimated error of the finest run.

    Args:
        knobs: The knobs.
        fine: The setting that knobs were turned from.
        finest: The setting of the finest run, no knob of it coarser.
        distance: Of settings from the fine one, relative L2 [-].

    Returns:
        By knob [-], those that leave nothing not among them.
    """
    parts = {}
    for knob in knobs.values:
        coarser = _coarser(knobs, fine, knob, distance)
        if not coarser:
            continue
        value, off = coarser[0]
        away = [d for _, d in coarser]
        if knob == "cells":
            parts[knob] = _left(away, 2 * fine.degree + 2, fine.cells / finest.cells)
        elif knob == "step":
            parts[knob] = _left(away, 2, finest.step / fine.step)
        elif knob == "sweep" and finest.sweep:
            parts[knob] = off * finest.sweep / value
        elif knob == "loop":
            parts[knob] = off * _LOOP_LEFT * finest.loop / fine.loop
        elif knob == "points":
            parts[knob] = off
        elif knob == "band" and finest.band < knobs.values[knob][-1]:
            parts[knob] = off
    return parts


def _coarser(
    knobs: Knobs, fine: Setting, knob: str, distance: Mapping[Setting, float]
) -> list[tuple[float, float]]:
    """Values of a knob below the fine one that were run, the next one first, and their distance."""
    values = knobs.values[knob]
    below = values[: values.index(getattr(fine, knob))][::-1]
    turned = [(value, fine.turned(knob, value)) for value in below]
    return [(value, distance[setting]) for value, setting in turned if setting in distance]


def _left(off: list[float], highest: int, finer: float) -> float:
    """What Richardson leaves of the distance of the next coarser mesh, or time step.

    Args:
        off: Distances of those that are 2, 4 … times as coarse from the fine one.
        highest: Order at most.
        finer: Size, or step, of the finest run over that of the fine one.
    """
    order = 1.0
    if len(off) > 1 and off[0] > 0 and off[1] / off[0] > _RATIO + 1:
        order = min(math.log2(off[1] / off[0] - 1), highest)
    return off[0] / (_RATIO**order - 1) * finer**order
