# SPDX-License-Identifier: MIT
"""Figures over time: the receivers' motion, and the two motions of a compliant base."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fenics_hytf.motion import GRAVITY
from fenics_hytf.results.figures import style
from fenics_hytf.results.figures.shown import input_kind, seams, shown_receivers
from fenics_hytf.results.figures.spectra import period_axis
from fenics_hytf.results.figures.style import COLOURS, INK, QUIET, label
from fenics_hytf.results.reader import StoredResult

RealArray = npt.NDArray[np.floating[Any]]

_ROUNDING = 1e-9  # of the largest: a smaller displacement is none


def histories(stored: StoredResult, component: str) -> Figure:
    """Input on top, then a row a receiver: total acceleration [g] and relative displacement."""
    names = shown_receivers(stored)
    time = stored.receivers["time_s"]
    accelerations = [stored.receivers[f"{n}.A_{component}"] / GRAVITY for n in names]
    displacements = [stored.receivers[f"{n}.u_{component}"] for n in names]
    largest = max((float(np.max(np.abs(u))) for u in displacements), default=0.0)
    factor, unit = style.length_unit(largest)
    nothing = _ROUNDING * factor * largest
    kind = input_kind(stored, component)
    first = int(kind is not None)
    figure = Figure(figsize=(9.0, 0.8 + 1.3 * (len(names) + first)))
    left, right = figure.subfigures(1, 2)
    left.supylabel(f"Total acceleration, {component} [g]", fontsize=10)
    right.supylabel(f"Relative displacement, {component} [{unit}]", fontsize=10)
    columns = [
        part.subplots(len(names) + first, 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for part in (left, right)
    ]
    if kind is not None:
        motion = next(m for m in stored.summary["motions"] if m["direction"] == component)
        values = stored.base[f"{kind}.A_{component}"] / GRAVITY
        _history(columns[0][0], time, values, INK, f"Input ({kind}): {label(motion['name'])}", "g")
        columns[1][0].set_axis_off()
        columns[1][0].set_title(" ", fontsize=9)  # as high as its neighbour's: rows stay level
    for i, name in enumerate(names):
        colour, text = COLOURS[i], label(name)
        _history(columns[0][i + first], time, accelerations[i], colour, text, "g")
        _history(
            columns[1][i + first], time, factor * displacements[i], colour, text, unit, nothing
        )
    for axes in (*columns[0], *columns[1][first:]):
        _finish(axes, stored)
    for column in columns:
        column[-1].set_xlabel("Time [s]")
        column[-1].set_xlim(time[0], time[-1])
    return figure


def base_motions(stored: StoredResult, direction: str) -> Figure:
    """Outcrop and within motion of the base: histories [g], and response spectra [g]."""
    figure = Figure(figsize=(9.0, 3.6))
    left, right = figure.subfigures(1, 2)
    left.supylabel(f"Acceleration, {direction} [g]", fontsize=10)
    axes = left.subplots(2, 1, sharex=True, sharey=True)
    spectrum = right.subplots()
    time = stored.base["time_s"]
    given = input_kind(stored, direction)
    looks = (("outcrop", INK), ("within", COLOURS[0]))
    for axis, (kind, colour) in zip(axes, looks, strict=True):
        values = stored.base[f"{kind}.A_{direction}"] / GRAVITY
        text = kind.capitalize() + (" (the input)" if kind == given else "")
        _history(axis, time, values, colour, text, "g")
        _finish(axis, stored)
        psa = stored.spectra[f"{kind}.{direction}"] / GRAVITY
        spectrum.plot(stored.spectra["period_s"], psa, color=colour, label=kind)
    axes[-1].set_xlabel("Time [s]")
    axes[-1].set_xlim(time[0], time[-1])
    period_axis(spectrum, stored.spectra["period_s"])
    spectrum.set_ylim(bottom=0.0)
    spectrum.set_ylabel("Spectral acceleration, 5 % damped [g]")
    spectrum.legend(loc="upper right")
    return figure


def _history(
    axes: Axes,
    time: RealArray,
    values: RealArray,
    colour: str,
    name: str,
    unit: str,
    nothing: float = 0.0,
) -> None:
    """A history with its peak; one of at most ``nothing`` is what rounding leaves of rest."""
    axes.plot(time, values, color=colour, linewidth=0.9)
    peak = int(np.argmax(np.abs(values)))
    axes.plot(time[peak], values[peak], "o", color=colour, markersize=4)
    axes.set_title(name, color=colour, fontsize=9)
    digits = f"{abs(values[peak]):#.3g}".rstrip(".") if abs(values[peak]) > nothing else "0"
    axes.set_title(f"{digits} {unit}", loc="right", color=colour, fontsize=9, fontweight="normal")


def _finish(axes: Axes, stored: StoredResult) -> None:
    for start in seams(stored):
        axes.axvline(start, color=QUIET, linewidth=0.7, zorder=0.5)
    axes.margins(y=0.15)
    axes.yaxis.set_major_locator(MaxNLocator(4, symmetric=True))
