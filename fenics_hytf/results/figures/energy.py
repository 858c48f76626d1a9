# SPDX-License-Identifier: MIT
"""Figure of the energy: what came in, where it is, and what the seams do to it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fenics_hytf.results.figures.style import COLOURS, DASHED, INK, QUIET, legend
from fenics_hytf.results.reader import StoredResult

RealArray = npt.NDArray[np.floating[Any]]

_UNITS = ((1e9, "GJ"), (1e6, "MJ"), (1e3, "kJ"), (1.0, "J"), (1e-3, "mJ"))
_MARKED = 40  # as many lapses or fewer have their ends marked


def energy_balance(stored: StoredResult) -> Figure:
    """Above: input, and what was lost and is stored, so far; below: what closes it at seams."""
    lapses = stored.summary["lapses"]
    ledgers = [lapse["energy"] for lapse in lapses]
    several = len(lapses) > 1
    figure = Figure(figsize=(9.0, 6.0 if several else 3.8))
    rows = figure.subplots(
        1 + several, 1, sharex=True, squeeze=False, height_ratios=[2.2, 1.0] if several else None
    )[:, 0]
    ends = [lapse["start_time_s"] + lapse["samples"] * stored.summary["dt_s"] for lapse in lapses]
    time = np.array([lapses[0]["start_time_s"], *ends])
    factor, unit = _energy_unit(stored, float(np.abs(_so_far(ledgers, "input")).max()))
    _course(rows[0], time, ledgers, factor)
    rows[0].set_ylabel(f"Energy so far [{unit}]")
    if several:
        _seams(rows[1], np.array([lapse["start_time_s"] for lapse in lapses]), ledgers, factor)
        rows[1].set_ylabel(f"In one lapse [{unit}]")
    rows[-1].set_xlabel("Time [s]")
    rows[-1].set_xlim(time[0], time[-1])
    return figure


def _course(axes: Axes, time: RealArray, ledgers: list[dict[str, Any]], factor: float) -> None:
    """Sums up to the end of each lapse; stored energy as it is there."""
    lost, slipped = (_so_far(ledgers, name) for name in ("damping", "slip"))
    strain, kinetic = (
        np.array([ledgers[0][name][0], *(energy[name][1] for energy in ledgers)])
        for name in ("strain", "kinetic")
    )
    parts = [
        (lost, "lost in damping", COLOURS[4]),
        (np.maximum(slipped, 0.0), "lost in sliding", COLOURS[3]),
        (strain, "stored as strain", COLOURS[5]),
        (kinetic, "stored in motion", COLOURS[2]),
    ]
    if not np.any(slipped > 0.0):
        del parts[1]
    values, labels, colours = zip(*parts, strict=True)
    scaled = [factor * part for part in values]
    axes.stackplot(time, *scaled, labels=labels, colors=colours, alpha=0.75, linewidth=0.0)
    come = factor * _so_far(ledgers, "input")
    marker = "o" if len(ledgers) <= _MARKED else "none"
    [line] = axes.plot(time, come, color=INK, marker=marker, markersize=3.5, label="input")
    line.set_clip_on(False)
    fallen = np.maximum(-slipped, 0.0)  # what gravity brings beyond what the mechanism takes
    besides = factor * (_so_far(ledgers, "seam") - _so_far(ledgers, "rest") + fallen)
    if np.any(besides):
        text = "input, seams\nand gravity" if np.any(fallen) else "input and seams"
        axes.plot(time, come + besides, color=COLOURS[1], linestyle=DASHED, label=text)
    axes.set_ylim(bottom=min(0.0, 1.05 * come.min()))
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(
        handles[::-1], labels[::-1], loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0
    )


def _seams(axes: Axes, start: RealArray, ledgers: list[dict[str, Any]], factor: float) -> None:
    """What each seam and the stress that fades after it put in or take, and what does not close."""
    looks = (
        ("seam", 1.0, COLOURS[0], "s", "jump at the seam"),
        ("rest", -1.0, COLOURS[3], "D", "from fading stress"),
        ("imbalance", 1.0, INK, "x", "imbalance"),
    )
    for name, sign, colour, marker, text in looks:
        values = sign * factor * np.array([energy[name] for energy in ledgers])
        axes.vlines(start[1:], 0.0, values[1:], color=colour, linewidth=1.2, clip_on=False)
        first = name != "imbalance"  # nothing precedes the first lapse
        [marks] = axes.plot(start[first:], values[first:], marker, color=colour, label=text)
        marks.set(markersize=4.5, clip_on=False, zorder=3)
    axes.axhline(0.0, color=QUIET, linewidth=0.8, zorder=1)
    axes.margins(y=0.15)
    axes.yaxis.set_major_locator(MaxNLocator(5))
    legend(axes)


def _so_far(ledgers: list[dict[str, Any]], name: str) -> RealArray:
    """Sums from the start to the end of each lapse, shape ``(num_lapses + 1,)``."""
    return np.concatenate([[0.0], np.cumsum([energy[name] for energy in ledgers])])


def _energy_unit(stored: StoredResult, peak: float) -> tuple[float, str]:
    """The unit that suits a peak [J or J/m]: units in a joule, and the unit's name."""
    per = stored.summary["energy"]["unit"].removeprefix("J")
    scale, name = next((u for u in _UNITS if peak >= u[0]), _UNITS[3 if peak == 0.0 else -1])
    return 1.0 / scale, name + per
