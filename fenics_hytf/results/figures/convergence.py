# SPDX-License-Identifier: MIT
"""Figure of the equivalent-linear loop: how the change of the moduli falls to the tolerance."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fenics_hytf.results.figures.style import COLOURS, DASHED, INK, MAX_LINES, QUIET, legend
from fenics_hytf.results.reader import StoredResult


def convergence(stored: StoredResult) -> Figure:
    """Largest change an iteration, one line a lapse, and the tolerance."""
    figure = Figure(figsize=(9.0, 3.6))
    axes = figure.subplots()
    lapses = [lapse for lapse in stored.summary["lapses"] if lapse["change"]]
    for i, lapse in enumerate(lapses):
        change = np.array([np.nan if c is None else c for c in lapse["change"]])
        many = len(lapses) > MAX_LINES
        axes.plot(
            np.arange(1, change.size + 1),
            np.where(change > 0, change, np.nan),
            color=QUIET if many else COLOURS[i],
            marker="o",
            markersize=4,
            label=None if many else f"lapse {lapse['index']}",
        )
    tolerance = stored.summary["scene"]["loop_tolerance"]
    if tolerance is not None:
        axes.axhline(tolerance, color=INK, linewidth=1.0, linestyle=DASHED)
        axes.annotate(
            f"tolerance {tolerance:g}",
            (0.01, tolerance),
            xycoords=("axes fraction", "data"),
            xytext=(0, 4),
            textcoords="offset points",
        )
    axes.set_yscale("log")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set_xlabel("Iteration [-]")
    axes.set_ylabel("Largest change [-]")
    if 1 < len(lapses) <= MAX_LINES:
        legend(axes)
    return figure
