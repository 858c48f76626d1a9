# SPDX-License-Identifier: MIT
"""Figures of a stored result: time histories, transfer functions, response spectra, convergence.

Each function draws one figure and returns it; :func:`draw_figures` writes all that apply.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from fenics_hytf.motion import GRAVITY
from fenics_hytf.results import profiles, style
from fenics_hytf.results.reader import StoredResult
from fenics_hytf.results.style import COLOURS, INK, MAX_LINES, QUIET, label
from fenics_hytf.results.summary import component_peaks

RealArray = npt.NDArray[np.floating[Any]]

_FEW_LINES = 5  # as many solved lines or fewer are shown as markers
_DRAWN = 0.1  # a component is drawn if its peak is at least this fraction of the largest
_SEAMS = 20  # as many lapses or fewer have their seams marked


@dataclass(frozen=True)
class Drawing:
    """A figure that was written.

    Attributes:
        file: Its name in the result folder.
        title: Heading.
        caption: What it shows, and how to read it.
    """

    file: str
    title: str
    caption: str


def draw_figures(stored: StoredResult) -> list[Drawing]:
    """Draw every figure that the result has data for, into its folder.

    Args:
        stored: The result.

    Returns:
        What was written, in reading order.
    """
    drawings = []
    with style.figure_style():
        for figure, drawing in _figures(stored):
            style.save(figure, stored.folder / drawing.file)
            drawings.append(drawing)
    return drawings


def _figures(stored: StoredResult) -> Iterator[tuple[Figure, Drawing]]:
    left_out = _left_out(stored)
    for component in _drawn_components(stored):
        yield (
            histories(stored, component),
            Drawing(
                f"histories_{component}.png",
                f"Time histories, {component}",
                "Left: total acceleration; right: displacement relative to the base. All panels of "
                "a column share one scale; a dot and a figure mark the peak. The input is shown as "
                f"far as its lines were solved.{_seams(stored)}{left_out}",
            ),
        )
    for component in _drawn_components(stored):
        for direction in stored.summary["directions"]:
            if _has_transfer(stored, component, direction):
                yield (
                    transfer_functions(stored, component, direction),
                    Drawing(
                        _transfer_file(stored, component, direction),
                        f"Transfer function, {component} over input {direction}",
                        "Amplitude of total acceleration over the input as given, on the lines "
                        f"that were solved.{_which_lapse(stored)}{left_out}",
                    ),
                )
    yield (
        profiles.profiles(stored),
        Drawing("profiles.png", "Profiles", profiles.caption(stored)),
    )
    for component in _drawn_components(stored):
        yield (
            response_spectra(stored, component),
            Drawing(
                f"spectra_{component}.png",
                f"Response spectra, {component}",
                f"Pseudo-acceleration of a 5 % damped oscillator.{left_out}",
            ),
        )
    if any(lapse["change"] for lapse in stored.summary["lapses"]):
        yield (
            convergence(stored),
            Drawing(
                "convergence.png",
                "Convergence of the equivalent-linear loop",
                "Largest change over all cells of the shear modulus or of the damping ratio from "
                "one iteration to the next, absolute and relative.",
            ),
        )


def histories(stored: StoredResult, component: str) -> Figure:
    """Input on top, then a row a receiver: total acceleration [g] and relative displacement."""
    names = shown_receivers(stored)
    time = stored.receivers["time_s"]
    inputs = _input_histories(stored)
    accelerations = [stored.receivers[f"{n}.A_{component}"] / GRAVITY for n in names]
    displacements = [stored.receivers[f"{n}.u_{component}"] for n in names]
    factor, unit = style.length_unit(max((np.max(np.abs(u)) for u in displacements), default=0.0))
    first = int(component in inputs)
    figure = Figure(figsize=(9.0, 0.8 + 1.3 * (len(names) + first)))
    left, right = figure.subfigures(1, 2)
    left.supylabel(f"Total acceleration, {component} [g]", fontsize=10)
    right.supylabel(f"Relative displacement, {component} [{unit}]", fontsize=10)
    columns = [
        part.subplots(len(names) + first, 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for part in (left, right)
    ]
    if first:
        motion = next(m for m in stored.summary["motions"] if m["direction"] == component)
        values = inputs[component] / GRAVITY
        _history(columns[0][0], time, values, INK, f"Input: {label(motion['name'])}", "g")
        columns[1][0].set_axis_off()
        columns[1][0].set_title(" ", fontsize=9)  # as high as its neighbour's: rows stay level
    for i, name in enumerate(names):
        colour, text = COLOURS[i], label(name)
        _history(columns[0][i + first], time, accelerations[i], colour, text, "g")
        _history(columns[1][i + first], time, factor * displacements[i], colour, text, unit)
    for axes in (*columns[0], *columns[1][first:]):
        _mark_seams(axes, stored)
        axes.margins(y=0.15)
        axes.yaxis.set_major_locator(MaxNLocator(4, symmetric=True))
    for column in columns:
        column[-1].set_xlabel("Time [s]")
        column[-1].set_xlim(time[0], time[-1])
    return figure


def transfer_functions(stored: StoredResult, component: str, direction: str) -> Figure:
    """Amplitude |A/input| of every shown receiver over frequency, logarithmic in frequency."""
    figure = Figure(figsize=(9.0, 4.2))
    axes = figure.subplots()
    last = stored.summary["lapses"][-1]["index"]
    highest, ends = 0.0, []
    for i, name in enumerate(shown_receivers(stored)):
        column = _transfer_column(stored, name, component, direction)
        frequency, amplitude = _above_zero(*stored.transfer_function(column, last))
        few = frequency.size <= _FEW_LINES
        # rings of several sizes: receivers that move alike all stay visible
        ring: dict[str, Any] = {"marker": "o", "markersize": 13 - 2 * i} if few else {}
        if frequency.size == 1:
            ring["linestyle"] = "none"
        axes.plot(frequency, amplitude, color=COLOURS[i], label=label(name), **ring)
        highest = max(highest, amplitude.max(initial=0.0))
        ends += [*frequency[:1], *frequency[-1:]]
    if highest > 60.0:  # undamped resonances would flatten everything else
        axes.set_yscale("log")
    else:
        axes.set_ylim(0.0, 1.15 * highest if highest > 0 else 1.0)
        axes.axhline(1.0, color=QUIET, linewidth=0.8, zorder=1)
    _frequency_axis(axes, ends)
    axes.set_ylabel(f"|A$_{component}$ / input$_{direction}$| [-]")
    _legend(axes)
    return figure


def response_spectra(stored: StoredResult, component: str) -> Figure:
    """5 % damped pseudo-acceleration [g] of the shown receivers and the input over period."""
    figure = Figure(figsize=(9.0, 4.2))
    axes = figure.subplots()
    period = stored.spectra["period_s"]
    if f"input.{component}" in stored.spectra:
        values = stored.spectra[f"input.{component}"] / GRAVITY
        axes.plot(period, values, color=INK, linestyle=(0, (4, 2)), label="input", zorder=3)
    for colour, name in zip(COLOURS, shown_receivers(stored), strict=False):
        values = stored.spectra[f"{name}.PSA_{component}"] / GRAVITY
        axes.plot(period, values, color=colour, label=label(name))
    axes.set_xscale("log")
    axes.set_xlim(period[0], period[-1])
    axes.margins(y=0.08)
    axes.set_ylim(bottom=0.0)
    axes.xaxis.set_major_formatter(FuncFormatter(_plain_number))
    axes.set_xlabel("Period [s]")
    axes.set_ylabel(f"Spectral acceleration, {component}, 5 % damped [g]")
    _legend(axes)
    return figure


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
        axes.axhline(tolerance, color=INK, linewidth=1.0, linestyle=(0, (4, 2)))
        axes.annotate(
            f"tolerance {tolerance:g}",
            (0.01, tolerance),
            xycoords=("axes fraction", "data"),
            xytext=(0, 4),
            textcoords="offset points",
        )
    axes.set_yscale("log")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set_xlabel("Iteration")
    axes.set_ylabel("Largest change [-]")
    if 1 < len(lapses) <= MAX_LINES:
        _legend(axes)
    return figure


def shown_receivers(stored: StoredResult) -> list[str]:
    """Receivers that figures show, highest first."""
    receivers = stored.summary["receivers"]
    names = list(receivers)
    return [names[i] for i in style.chosen(names, [receivers[n]["place_m"][-1] for n in names])]


def _history(
    axes: Axes, time: RealArray, values: RealArray, colour: str, name: str, unit: str
) -> None:
    axes.plot(time, values, color=colour, linewidth=0.9)
    peak = int(np.argmax(np.abs(values)))
    axes.plot(time[peak], values[peak], "o", color=colour, markersize=4)
    axes.set_title(name, color=colour, fontsize=9)
    digits = f"{abs(values[peak]):#.3g}".rstrip(".")
    axes.set_title(f"{digits} {unit}", loc="right", color=colour, fontsize=9, fontweight="normal")


def _mark_seams(axes: Axes, stored: StoredResult) -> None:
    lapses = stored.summary["lapses"]
    if len(lapses) <= _SEAMS:
        for lapse in lapses[1:]:
            axes.axvline(lapse["start_time_s"], color=QUIET, linewidth=0.7, zorder=0.5)


def _input_histories(stored: StoredResult) -> dict[str, RealArray]:
    """Input acceleration by direction [m/s^2]: what total and relative acceleration differ by."""
    names = list(stored.summary["receivers"])
    if not names:
        return {}
    first = names[0]
    return {
        direction: stored.receivers[f"{first}.A_{direction}"]
        - stored.receivers[f"{first}.a_{direction}"]
        for direction in stored.summary["directions"]
    }


def _drawn_components(stored: StoredResult) -> list[str]:
    """Components that move enough to be drawn: within a tenth of the largest."""
    peaks = component_peaks(stored.summary)
    largest = max(peaks.values(), default=0.0)
    return [c for c, peak in peaks.items() if peak > 0.0 and peak >= _DRAWN * largest]


def _transfer_column(stored: StoredResult, name: str, component: str, direction: str) -> str:
    several = len(stored.summary["directions"]) > 1
    return f"{name}.A_{component}" + (f"/{direction}" if several else "")


def _transfer_file(stored: StoredResult, component: str, direction: str) -> str:
    several = len(stored.summary["directions"]) > 1
    return f"transfer_{component}{'_' + direction if several else ''}.png"


def _has_transfer(stored: StoredResult, component: str, direction: str) -> bool:
    """Whether the input in a direction moves a component at all."""
    return any(
        np.any(stored.transfer[_transfer_column(stored, n, component, direction) + f".{part}"])
        for n in stored.summary["receivers"]
        for part in ("re", "im")
    )


def _above_zero(frequency: RealArray, amplitude: RealArray) -> tuple[RealArray, RealArray]:
    """Without the line at zero frequency, which a logarithmic axis has no place for."""
    return frequency[frequency > 0], amplitude[frequency > 0]


def _frequency_axis(axes: Axes, ends: list[float]) -> None:
    axes.set_xscale("log")
    low, high = (min(ends), max(ends)) if ends else (0.1, 25.0)
    if high > 10.0 * 0.1 and low < 25.0:  # a record: the band that engineers look at
        low, high = max(low, 0.1), min(high, 25.0)
    if high < 3.0 * low:  # one line, or a few side by side: room around them
        low, high = low / 10.0, high * 10.0
    axes.set_xlim(low, high)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_formatter(FuncFormatter(_plain_number))
    axes.set_xlabel("Frequency [Hz]")


def _plain_number(value: float, _position: int | None = None) -> str:
    return f"{value:g}"


def _legend(axes: Axes) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)


def _left_out(stored: StoredResult) -> str:
    count = len(stored.summary["receivers"])
    return f" {MAX_LINES} of {count} receivers are shown." if count > MAX_LINES else ""


def _seams(stored: StoredResult) -> str:
    if not 1 < len(stored.summary["lapses"]) <= _SEAMS:
        return ""
    text = " Vertical lines mark the seams between lapses."
    if stored.summary["scene"]["continuity"] == "steady":
        text += " Each lapse is a periodic state of its own, so curves may jump there."
    return text


def _which_lapse(stored: StoredResult) -> str:
    count = len(stored.summary["lapses"])
    return f" The last of {count} lapses is shown." if count > 1 else ""
