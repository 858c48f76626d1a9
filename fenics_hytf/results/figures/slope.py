# SPDX-License-Identifier: MIT
"""Pictures of ground that slides: its mechanism, the points where they came to, and the run-out."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fenics_hytf.results.figures.plane import Plane, discs, draw_mesh, extent, picture_size
from fenics_hytf.results.figures.style import COLOURS, DASHED, QUIET, legend, length_unit, spread
from fenics_hytf.results.ground import read_points, snapshot_lapses
from fenics_hytf.results.reader import StoredResult

RealArray = npt.NDArray[np.float64]

PANELS = 3
"""Lapses whose points are shown."""

_HIGHEST = 8.0  # of all panels together [inch]
_BODY = 0.5  # of the farthest point's displacement: the front of the slide is of those that go on
_MOVED = 0.1  # of it: the crest is the highest of those


def moves(stored: StoredResult) -> bool:
    """Whether points moved with what slid, and were written."""
    slid = stored.summary["sliding"]["slip_m"] > 0.0
    return slid and "convection" in stored.summary["effects"] and bool(snapshot_lapses(stored))


def mechanism(stored: StoredResult, plane: Plane) -> Figure:
    """Shear strain of a metre of slip in the first and the last lapse that slid."""
    shown = _mechanism_lapses(stored)
    figure, rows = _panels(plane, len(shown))
    outlines = dict(zip(map(int, plane.numbers), plane.outlines, strict=True))
    drawn, largest = [], 0.0
    for axes, lapse in zip(rows, shown, strict=True):
        here = stored.cells["lapse"] == lapse["index"]
        numbers, strain = stored.cells["cell"][here], stored.cells["mechanism_strain"][here]
        seen = [i for i, number in enumerate(numbers) if number in outlines]
        cells = PolyCollection([outlines[numbers[i]] for i in seen], array=strain[seen])
        cells.set(cmap="viridis", edgecolor="face", linewidth=0.3)
        largest = max(largest, float(strain[seen].max(initial=0.0)))
        axes.add_collection(cells)
        draw_mesh(axes, plane)
        axes.set_title(_mechanism_title(stored, lapse))
        drawn.append(cells)
    for cells in drawn:
        cells.set_clim(0.0, largest or 1.0)
    _bar(figure, drawn[0], rows, "Shear strain of a metre of slip [1/m]")
    return figure


def mechanism_caption(stored: StoredResult) -> str:
    """How to read the figure."""
    which = "of the first lapse"
    if any(lapse["slip"]["slip_m"] > 0.0 for lapse in stored.summary["lapses"]):
        two = len(_mechanism_lapses(stored)) > 1
        which = "of the first and the last lapse that slid" if two else "of the lapse that slid"
    return (
        f"The mechanism {which}: shear strain in the middle of cells for a slip of one metre. "
        "What is dark moves as a block, or stays. White cells hold no soil."
    )


def deformed(stored: StoredResult, plane: Plane) -> Figure:
    """The points after the first, a middle and the last lapse, coloured by displacement."""
    every = [read_points(stored, lapse) for lapse in panel_lapses(stored)]
    lengths = [np.linalg.norm(points.displacement, axis=1) for points in every]
    largest = max(float(length.max(initial=0.0)) for length in lengths)
    factor, unit = length_unit(largest)
    scale = (0.0, factor * largest or 1.0)
    figure, rows = _panels(plane, len(every))
    drawn = []
    for axes, points, length in zip(rows, every, lengths, strict=True):
        draw_mesh(axes, plane)
        drawn.append(discs(axes, plane, points, factor * length, scale))
        axes.set_title(f"After {points.time:.3g} s")
    _bar(figure, drawn[0], rows, f"Displacement [{unit}]")
    return figure


def panel_lapses(stored: StoredResult) -> list[int]:
    """The first, a middle and the last of the lapses whose points were written."""
    written = snapshot_lapses(stored)
    return [written[i] for i in spread(len(written), PANELS)]


def run_out(stored: StoredResult, plane: Plane) -> Figure:
    """How far toe and crest have come over time, beside the slip of the mechanism."""
    assert stored.slip is not None
    time, toe, crest, settled = _advance(stored, plane)
    slip = stored.slip["slip_m"]
    factor, unit = length_unit(float(np.max([toe.max(), crest.max(), settled.max(), slip.max()])))
    figure = Figure(figsize=(9.0, 3.6))
    axes = figure.subplots()
    axes.plot(stored.slip["time_s"], factor * slip, color=QUIET, linewidth=1.0, label="slip")
    lines = (
        (toe, COLOURS[1], "-", "o", "toe, forward"),
        (crest, COLOURS[0], "-", "s", "crest, forward"),
        (settled, COLOURS[0], DASHED, "v", "crest, down"),
    )
    for values, colour, dashes, marker, text in lines:
        [line] = axes.plot(time, factor * values, color=colour, marker=marker, label=text)
        line.set(linestyle=dashes, markersize=4)
    axes.axhline(0.0, color=QUIET, linewidth=0.7, zorder=1)
    axes.set_xlabel("Time [s]")
    axes.set_ylabel(f"Displacement [{unit}]")
    axes.set_xlim(0.0, 1.01 * max(float(time[-1]), float(stored.slip["time_s"][-1])))
    axes.yaxis.set_major_locator(MaxNLocator(6))
    legend(axes)
    return figure


RUN_OUT_CAPTION = (
    "Toe: how far the front has come of the points that move at least half as far as the farthest. "
    "Crest: the highest of the points that move at least a tenth as far. Marks: ends of lapses "
    "whose points were written. Slip: λ, summed over the lapses."
)


def _advance(
    stored: StoredResult, plane: Plane
) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """Times [s], how far the toe and the crest came forward, and how far this came down [m]."""
    written = snapshot_lapses(stored)
    last = read_points(stored, written[-1])
    length = np.linalg.norm(last.displacement, axis=1)
    start = plane.project(last.position - last.displacement)
    moved = length >= _MOVED * length.max()
    highest = start[moved, 1].max()
    tall = float(np.ptp([corner[1] for corner in extent(plane)]))
    crest = moved & (start[:, 1] >= highest - 1e-9 * tall)
    front = length >= _BODY * length.max()
    origin = (plane.sense * start[front, 0]).max()
    rows = [np.zeros(4)]
    for lapse in written:
        points = read_points(stored, lapse)
        here = np.searchsorted(points.id, last.id)  # those there at the end were there before
        there = plane.project(points.position)[here]
        came = (there - start)[crest].mean(axis=0)
        toe = (plane.sense * there[front, 0]).max() - origin
        rows.append(np.array([points.time, toe, plane.sense * came[0], -came[1]]))
    time, toes, crests, settled = np.array(rows).T
    return time, toes, crests, settled


def _mechanism_lapses(stored: StoredResult) -> list[dict[str, Any]]:
    """The first and the last lapse that slid; the first one where none did."""
    lapses = stored.summary["lapses"]
    slid = [lapse for lapse in lapses if lapse["slip"]["slip_m"] > 0.0]
    if not slid:
        return [lapses[0]]
    return [slid[0]] if len(slid) == 1 else [slid[0], slid[-1]]


def _mechanism_title(stored: StoredResult, lapse: dict[str, Any]) -> str:
    slip, start = lapse["slip"], lapse["start_time_s"]
    end = start + lapse["samples"] * stored.summary["dt_s"]
    factor, unit = length_unit(slip["slip_m"])
    slid = f"slip {factor * slip['slip_m']:.3g} {unit}" if slip["slip_m"] > 0.0 else "no slip"
    coefficient = f"{slip['yield_coefficient']:.3g}".replace("-", "−")
    return f"Lapse {lapse['index']}, {start:.3g} to {end:.3g} s: $k_y$ = {coefficient}, {slid}"


def _panels(plane: Plane, count: int) -> tuple[Figure, list[Axes]]:
    """Axes below each other, as high as the ground is for its width."""
    width, height = picture_size(plane, _HIGHEST / count)
    figure = Figure(figsize=(width + 1.6, (height + 0.45) * count + 0.35))
    rows = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    for axes in rows:
        axes.set_ylabel("Elevation [m]")
    rows[-1].set_xlabel("Distance [m]")
    return figure, rows


def _bar(figure: Figure, drawn: Any, rows: list[Axes], title: str) -> None:
    bar = figure.colorbar(drawn, ax=rows, shrink=0.85, pad=0.02, aspect=30)
    bar.set_label(title)
    bar.outline.set_linewidth(0.0)  # type: ignore[operator]
    figure.draw_without_rendering()  # the layout settles in a second round
