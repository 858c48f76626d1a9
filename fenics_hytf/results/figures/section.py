# SPDX-License-Identifier: MIT
"""Maps over a plane section: peak acceleration, peak strain, and G/Gmax where it follows strain.

The cells' values are contoured between their centres, on Delaunay's triangles. Triangles much
longer than their neighbours bridge what is no ground (the air above a slope) and are left out; the
outermost half cells are not drawn.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator
from matplotlib.tri import Triangulation
from scipy.spatial import Delaunay, QhullError

from fenics_hytf.motion import GRAVITY
from fenics_hytf.results.figures.profiles import cell_column, envelope, is_linear
from fenics_hytf.results.reader import StoredResult

RealArray = npt.NDArray[np.floating[Any]]

_BRIDGE = 2.0  # times the usual edge around its corners: a longer one spans what is no ground
_DECADES = 30.0  # largest over smallest value above which a logarithmic scale is used
_WIDE = 1.2  # width over height above which maps stand below each other


def section(stored: StoredResult) -> Figure | None:
    """Draw the maps.

    Args:
        stored: The result.

    Returns:
        The figure; ``None`` for a column, a solid, or too few cells.
    """
    if stored.summary["scene"]["mesh"]["kind"] == "column" or "z" in stored.cells:
        return None
    x, y = cell_column(stored, "x"), cell_column(stored, "y")
    triangles = _triangles(np.column_stack([x, y]))
    if triangles is None:
        return None
    maps = [
        ("Peak total acceleration [g]", envelope(stored, "peak_acceleration") / GRAVITY),
        ("Peak shear strain [%]", 100.0 * envelope(stored, "peak_strain")),
    ]
    if not is_linear(stored):
        maps.append(("G/Gmax [-]", envelope(stored, "g_over_gmax")))
    wide = np.ptp(x) > _WIDE * np.ptp(y)
    if wide:
        height = np.clip(7.6 * np.ptp(y) / np.ptp(x), 0.8, 2.5) + 0.6
        figure = Figure(figsize=(9.0, height * len(maps)))
        rows = figure.subplots(len(maps), 1, sharex=True, squeeze=False)[:, 0]
    else:
        height = np.clip(2.5 * np.ptp(y) / np.ptp(x), 2.5, 6.0) + 1.2
        figure = Figure(figsize=(9.0, height))
        rows = figure.subplots(1, len(maps), sharey=True, squeeze=False)[0]
    figure.get_layout_engine().set(w_pad=0.12)  # type: ignore[union-attr, call-arg]
    for axes, (title, values) in zip(rows, maps, strict=True):
        _map(axes, x, y, triangles, values, title, beside=wide)
        axes.set_aspect("equal")
        axes.grid(visible=False)
        if wide or axes is rows[0]:
            axes.set_ylabel("Elevation [m]")
        if not wide or axes is rows[-1]:
            axes.set_xlabel("Distance [m]")
    return figure


def _map(
    axes: Axes,
    x: RealArray,
    y: RealArray,
    triangles: npt.NDArray[np.intp],
    values: RealArray,
    title: str,
    beside: bool,
) -> None:
    """One map, with its scale beside or below it."""
    there = np.isfinite(values)
    kept = triangles[there[triangles].all(axis=1)]
    if not len(kept):
        axes.set_title(f"{title}: none")
        return
    low, high = float(values[there].min()), float(values[there].max())
    look: dict[str, Any] = {"cmap": "viridis"}
    if low > 0.0 and high > _DECADES * low:
        count = max(9, int(8 * np.log10(high / low)))
        look |= {"levels": np.geomspace(low, high, count), "norm": LogNorm()}
    else:
        room = 1e-3 * (high or 1.0) if high - low <= 1e-3 * abs(high) else 0.0  # a flat map
        look["levels"] = MaxNLocator(12).tick_values(low - room, high + room)
    drawn = axes.tricontourf(
        Triangulation(x, y, kept), np.where(there, values, low), extend="neither", **look
    )
    parts = (1.0, 2.0, 5.0) if beside else (1.0, 3.0)  # numbers side by side need more room
    locator = LogLocator(subs=parts) if "norm" in look else MaxNLocator(5)
    place = axes.inset_axes((1.02, 0.0, 0.02, 1.0) if beside else (0.0, -0.18, 1.0, 0.03))
    direction = "vertical" if beside else "horizontal"
    bar = axes.figure.colorbar(drawn, cax=place, ticks=locator, format="%g", orientation=direction)
    bar.outline.set_linewidth(0.0)  # type: ignore[operator]
    axes.set_title(title)


def _triangles(centres: RealArray) -> npt.NDArray[np.intp] | None:
    """Triangles between cell centres that lie in the ground, shape ``(n, 3)``."""
    try:
        corners = Delaunay(centres).simplices
    except QhullError:  # fewer than three cells, or all in a row
        return None
    edges = np.stack([centres[corners[:, i]] - centres[corners[:, i - 1]] for i in range(3)])
    longest = np.linalg.norm(edges, axis=2).max(axis=0)
    # usual at each centre: the lower quartile of the longest edges, as bridges may be most of them
    at, length = corners.ravel(), np.repeat(longest, 3)
    order = np.lexsort((length, at))
    count = np.bincount(at, minlength=len(centres))
    first = np.cumsum(count) - count
    usual = np.full(len(centres), np.inf)
    held = count > 0
    usual[held] = length[order][(first + count // 4)[held]]
    return np.asarray(corners[longest <= _BRIDGE * usual[corners].min(axis=1)], np.intp)
