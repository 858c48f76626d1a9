# SPDX-License-Identifier: MIT
"""Figure of the slip over time: λ beside what simpler analyses give, and what drives it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fenics_hytf.motion import GRAVITY
from fenics_hytf.results.figures.shown import seams
from fenics_hytf.results.figures.style import COLOURS, DASHED, QUIET, legend, length_unit
from fenics_hytf.results.reader import StoredResult

RealArray = npt.NDArray[np.floating[Any]]

_ROOM = 0.01  # of the time, for the last mark
_MARKED = 40  # as many lapses or fewer have their ends marked


def slip_history(stored: StoredResult) -> Figure:
    """Above: slip, and a rigid and a decoupled block; below: driving and yield acceleration."""
    assert stored.slip is not None
    figure = Figure(figsize=(9.0, 5.4))
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[1.3, 1.0])
    _slips(above, stored)
    _driving(below, stored)
    for axes in (above, below):
        for start in seams(stored):
            axes.axvline(start, color=QUIET, linewidth=0.6, alpha=0.5, zorder=0.5)
        legend(axes)
    below.set_xlabel("Time [s]")
    time = stored.slip["time_s"]
    below.set_xlim(time[0], time[-1] + _ROOM * (time[-1] - time[0]))
    return figure


def slip_caption(stored: StoredResult) -> str:
    """How to read the figure."""
    text = (
        "Above: slip of the mechanism, coupled with the vibration; beside it a rigid block under "
        "the base's motion (Newmark) and a block under the response without slip (decoupled), "
        "summed up to the end of each lapse. Below: the acceleration that drives the mechanism in "
        "the response without slip, and the one that it yields under, g k_y. It slips one way; "
        "where it does, the time is shaded."
    )
    return text + (" Vertical lines mark the seams between lapses." if seams(stored) else "")


def _slips(axes: Axes, stored: StoredResult) -> None:
    assert stored.slip is not None
    lapses = stored.summary["lapses"]
    ends = [lapse["start_time_s"] + lapse["samples"] * stored.summary["dt_s"] for lapse in lapses]
    time = np.array([lapses[0]["start_time_s"], *ends])
    blocks = {
        name: np.concatenate([[0.0], np.cumsum([lapse["slip"][name] for lapse in lapses])])
        for name in ("decoupled_m", "rigid_m")
    }
    slip = stored.slip["slip_m"]
    factor, unit = length_unit(max(float(np.max(s)) for s in (slip, *blocks.values())))
    axes.plot(
        stored.slip["time_s"], factor * slip, color=COLOURS[0], linewidth=1.8, label="coupled"
    )
    marker = "none" if len(lapses) > _MARKED else "o"
    looks = (("decoupled_m", COLOURS[1], "decoupled"), ("rigid_m", COLOURS[2], "rigid block"))
    for name, colour, text in looks:
        [line] = axes.plot(time, factor * blocks[name], color=colour, linestyle=DASHED, label=text)
        line.set(linewidth=1.0, marker=marker, markersize=3.5)
    axes.set_ylabel(f"Slip so far [{unit}]")
    axes.set_ylim(bottom=0.0)


def _driving(axes: Axes, stored: StoredResult) -> None:
    assert stored.slip is not None
    time, moving = stored.slip["time_s"], stored.slip["rate_m_s"] > 0.0
    driving, limit = (stored.slip[f"{name}_m_s2"] / GRAVITY for name in ("driving", "yield"))
    axes.plot(time, driving, color=COLOURS[0], linewidth=0.8, label="driving")
    axes.plot(time, limit, color=COLOURS[1], drawstyle="steps-post", label="yield")
    if np.any(moving):
        look: dict[str, Any] = {"color": COLOURS[4], "alpha": 0.25, "linewidth": 0.0}
        look |= {"transform": axes.get_xaxis_transform(), "label": "slips"}
        axes.fill_between(time, 0.0, 1.0, where=[bool(m) for m in moving], **look)
    axes.axhline(0.0, color=QUIET, linewidth=0.7, zorder=1)
    axes.set_ylabel("Acceleration [g]")
    axes.margins(y=0.1)
    axes.yaxis.set_major_locator(MaxNLocator(5))
