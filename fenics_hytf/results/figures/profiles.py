# SPDX-License-Identifier: MIT
"""Profiles over depth or height: of the peaks, and of the soil's state.

A column is drawn as steps, one a cell, against depth. Elsewhere cells of a region scatter at every
height: they are drawn as dots against elevation, with the median of each region in bins of height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fenics_hytf.motion import GRAVITY
from fenics_hytf.results.figures.style import COLOURS, MAX_LINES, QUIET, label, length_unit
from fenics_hytf.results.reader import StoredResult

RealArray = npt.NDArray[np.floating[Any]]

_BINS = 16  # of height, for the medians
_MOST_DOTS = 20_000  # more cells than this are thinned evenly


@dataclass(frozen=True)
class _Panel:
    title: str
    values: RealArray
    limit: float | None = None


def profiles(stored: StoredResult) -> Figure:
    """Peak acceleration and the soil's state: strain, G/Gmax and damping; stress where linear."""
    acceleration = envelope(stored, "peak_acceleration") / GRAVITY
    strain = 100.0 * envelope(stored, "peak_strain")
    panels = [
        _Panel("Peak total\nacceleration [g]", acceleration),
        _Panel("Peak shear\nstrain [%]", strain),
    ]
    if is_linear(stored):  # G/Gmax is 1 and damping as given everywhere
        return _draw(stored, [*panels, _stress(stored)])
    damping = 100.0 * envelope(stored, "damping")
    panels.append(_Panel("G/Gmax [-]\n", envelope(stored, "g_over_gmax"), limit=1.02))
    return _draw(stored, [*panels, _Panel("Damping\nratio [%]", damping)])


def peak_profiles(stored: StoredResult) -> Figure:
    """Peak velocity and displacement, relative to the base; shear stress and stress ratio."""
    displacement = envelope(stored, "peak_displacement")
    factor, unit = length_unit(float(np.nanmax(displacement, initial=0.0)))
    panels = [
        _Panel("Peak relative\nvelocity [m/s]", envelope(stored, "peak_velocity")),
        _Panel(f"Peak relative\ndisplacement [{unit}]", factor * displacement),
    ]
    if not is_linear(stored):
        panels.append(_stress(stored))
    ratio = envelope(stored, "stress_ratio")
    if not np.all(np.isnan(ratio)):
        effective = stored.summary["scene"]["water_table_m"] is not None
        below = "effective" if effective else "total"
        panels.append(_Panel(f"Peak shear stress over\n{below} vertical stress [-]", ratio))
    return _draw(stored, panels)


def caption(stored: StoredResult) -> str:
    """How to read the profiles."""
    text = " Values at cell centres."
    if len(stored.summary["lapses"]) > 1:
        text += " Over all lapses: the largest of each, of G/Gmax the smallest."
    if stored.summary["scene"]["mesh"]["kind"] != "column":
        text += " Dots: cells; lines: median of a region in bins of height."
    return text


def is_linear(stored: StoredResult) -> bool:
    """Whether the soil keeps its modulus and damping."""
    return stored.summary["scene"]["strain_ratio"] is None


def envelope(stored: StoredResult, name: str) -> RealArray:
    """Over the lapses the largest value of a column of ``cells.csv``; of G/Gmax the smallest.

    Args:
        stored: The result.
        name: The column.

    Returns:
        In the column's unit, shape ``(num_cells,)``.
    """
    extreme = np.fmin if name == "g_over_gmax" else np.fmax
    cells, column = np.unique(stored.cells["cell"], return_inverse=True)
    lapses, row = np.unique(stored.cells["lapse"], return_inverse=True)
    values = np.full((len(lapses), len(cells)), np.nan)  # a cell may be empty in a lapse
    values[row, column] = stored.cells[name]
    return np.asarray(extreme.reduce(values))


def cell_column(stored: StoredResult, name: str) -> npt.NDArray[Any]:
    """A column of ``cells.csv``, of each cell in its first lapse, shape ``(num_cells,)``."""
    _, first = np.unique(stored.cells["cell"], return_index=True)
    return np.asarray(stored.cells[name][first])


def _stress(stored: StoredResult) -> _Panel:
    return _Panel("Peak shear\nstress [kPa]", envelope(stored, "peak_stress") / 1e3)


def _draw(stored: StoredResult, panels: Sequence[_Panel]) -> Figure:
    """The panels side by side on one axis of depth or height."""
    height = cell_column(stored, "z" if "z" in stored.cells else "y")
    region = cell_column(stored, "region")
    figure = Figure(figsize=(max(2.3 * len(panels) + 0.8, 9.0), 5.2))
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    edges = _column_edges(stored, height)
    for axis, panel in zip(axes, panels, strict=True):
        if edges is not None:
            _steps(axis, edges, height, panel.values)
        else:
            _scatter(axis, height, region, panel.values)
        axis.set_xlabel(panel.title)
        axis.xaxis.set_major_locator(MaxNLocator(4, prune="upper"))
        axis.set_xlim(0.0, panel.limit or 1.08 * (np.nanmax(panel.values, initial=0.0) or 1.0))
    if edges is not None:
        axes[0].set_ylabel("Depth [m]")
        axes[0].set_ylim(edges[-1] - edges[0], 0.0)
        _layers(axes, edges, height, region)
    else:
        axes[0].set_ylabel("Elevation [m]")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 4) or 1)
    return figure


def _column_edges(stored: StoredResult, height: RealArray) -> RealArray | None:
    """Heights of the faces between the cells of a column, base at 0; ``None`` elsewhere.

    A centre is half-way between its faces, so each face follows from the one below.
    """
    if stored.summary["scene"]["mesh"]["kind"] != "column":
        return None
    edges = [0.0]
    for centre in np.sort(height):
        edges.append(2.0 * centre - edges[-1])
    return np.array(edges)


def _steps(axes: Axes, edges: RealArray, height: RealArray, values: RealArray) -> None:
    order = np.argsort(height)
    depth = edges[-1] - edges
    axes.plot(
        np.repeat(values[order], 2), np.repeat(depth, 2)[1:-1], color=COLOURS[0], linewidth=1.6
    )


def _layers(
    axes: Sequence[Axes], edges: RealArray, height: RealArray, region: npt.NDArray[np.object_]
) -> None:
    """Thin lines where the soil changes, and the soils' names in the last panel."""
    names = region[np.argsort(height)]
    changes = np.flatnonzero(names[1:] != names[:-1]) + 1
    bounds = [0, *changes, len(names)]
    depth = edges[-1] - edges
    for axis in axes:
        for change in changes:
            axis.axhline(depth[change], color=QUIET, linewidth=0.8, linestyle=(0, (2, 2)))
    thick = 0.04 * depth[0]  # a thinner layer has no room for a name
    for low, high in pairwise(bounds):
        if depth[low] - depth[high] >= thick:
            axes[-1].annotate(
                label(str(names[low])),
                (1.02, 0.5 * (depth[low] + depth[high])),
                xycoords=("axes fraction", "data"),
                va="center",
                color=QUIET,
                fontsize=9,
                annotation_clip=False,
            )


def _scatter(
    axes: Axes, height: RealArray, region: npt.NDArray[np.object_], values: RealArray
) -> None:
    names = sorted(dict.fromkeys(region), key=lambda name: -np.mean(height[region == name]))
    groups = (
        [(label(str(n)), region == n, c) for n, c in zip(names, COLOURS, strict=False)]
        if len(names) <= MAX_LINES
        else [("all soils", np.ones(len(region), dtype=bool), COLOURS[0])]
    )
    thin = -(-len(values) // _MOST_DOTS)
    for name, member, colour in groups:
        x, y = values[member], height[member]
        axes.plot(
            x[::thin], y[::thin], ".", color=colour, markersize=4, alpha=0.4, markeredgewidth=0
        )
        axes.plot(*_medians(x, y), "-", color=colour, linewidth=1.8, label=name)


def _medians(values: RealArray, height: RealArray) -> tuple[RealArray, RealArray]:
    """Median value and mean height of the cells in each bin of height that has any."""
    bins = np.linspace(height.min(), height.max(), min(_BINS, np.unique(height).size) + 1)
    index = np.clip(np.digitize(height, bins) - 1, 0, len(bins) - 2)
    there = [
        member for i in range(len(bins) - 1) if np.any(member := (index == i) & ~np.isnan(values))
    ]
    return (
        np.array([np.median(values[m]) for m in there]),
        np.array([np.mean(height[m]) for m in there]),
    )
