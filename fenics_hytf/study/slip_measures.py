# SPDX-License-Identifier: MIT
"""What slid in a run, in a few numbers, and how far they are from those of another run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fenics_hytf.results.sliding import slide
from fenics_hytf.simulation import Result, Snapshot

SLIP = "slip_m"
"""The number that runs are compared by."""

MEASURES = {
    SLIP: "slip",
    "run_out_m": "run-out",
    "yield_coefficient": "k_y",
    "decoupled_m": "decoupled",
    "rigid_m": "rigid",
}
"""Names of the numbers: the slip of all lapses, coupled, and by a decoupled and a rigid block; how
far the farthest point has come, where points move; the yield coefficient of the first lapse."""


def slip_measures(result: Result, last: Snapshot | None) -> dict[str, float]:
    """What slid in a run.

    Args:
        result: The run.
        last: The points where they came to; ``None`` where they do not move.

    Returns:
        By the keys of ``MEASURES`` [m or -]; empty where the scene does not call for sliding.
    """
    told = slide(result)
    if told is None:
        return {}
    found = {name: float(told[name]) for name in MEASURES if name in told}
    if last is not None and last.points is not None:
        moved = np.linalg.norm(np.asarray(last.points["displacement"], np.float64), axis=1)
        found["run_out_m"] = float(moved.max(initial=0.0))
    return found


def slip_errors(found: Mapping[str, float], reference: Mapping[str, float]) -> dict[str, float]:
    """Relative difference of each number that two runs share [-]; infinite from nought."""
    return {
        name: _difference(found[name], value) for name, value in reference.items() if name in found
    }


def _difference(found: float, reference: float) -> float:
    if found == reference:
        return 0.0
    return abs(found / reference - 1) if reference else float("inf")
