# SPDX-License-Identifier: MIT
"""Figure of the curves of soils: G/Gmax and damping ratio against shear strain, as a run uses them.

Where soils are limited by their shear strength, their shear stress is drawn beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import cycle, product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from fenics_hytf.results.figures import style
from fenics_hytf.results.figures.style import COLOURS, QUIET, label
from fenics_hytf.soil import Curve, LimitedCurve

if TYPE_CHECKING:
    from fenics_hytf.scene import Soil

RealArray = npt.NDArray[np.float64]

_DASHES = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (6, 1.5, 1, 1.5)))
_THIN = 0.6  # width of a line outside the soil's own table, where it is constant
_STRENGTH: dict[str, Any] = {"linewidth": 0.9, "linestyle": (0, (4, 2))}
_POINTS = 500
_ROWS = 20  # names in a column of the legend


def draw_curves(soils: Mapping[str, Soil], path: Path) -> None:
    """Draw the curves of soils into a PNG file.

    Args:
        soils: Soils by name; those without curves are left out, at least one has some.
        path: The file.

    Raises:
        OSError: If the file cannot be written.
    """
    with style.figure_style():
        style.save(curve_figure(soils), path)


def curve_figure(soils: Mapping[str, Soil]) -> Figure:
    """G/Gmax on the left, damping ratio [%] on the right, over the shear strain [%].

    Args:
        soils: Soils by name; those without curves are left out, at least one has some.

    Returns:
        The figure; with a panel of shear stress [kPa] where soils are limited by their strength.
    """
    curves = {name: soil.curve for name, soil in soils.items() if soil.curve is not None}
    ranges = {(float(curve.strain[0]), float(curve.strain[-1])) for curve in curves.values()}
    begin, end = min(first for first, _ in ranges), max(last for _, last in ranges)
    strain = np.asarray(np.geomspace(begin, end, _POINTS), dtype=np.float64)
    with_stress = any(isinstance(curve, LimitedCurve) for curve in curves.values())
    columns = -(-len(curves) // _ROWS)
    figure = Figure(figsize=(3.7 * (3 if with_stress else 2) + 1.6 * columns, 3.9))
    panels = figure.subplots(1, 3 if with_stress else 2)
    for (name, curve), look in zip(curves.items(), _looks(), strict=False):
        modulus, damping = curve.evaluate(strain)
        _line(panels[0], curve, strain, modulus, look, label(name))
        _line(panels[1], curve, strain, 1e2 * damping, look)
        if isinstance(curve, LimitedCurve):
            stiffness = 1e-3 * soils[name].elastic.shear_modulus
            _line(panels[2], curve, strain, stiffness * strain * modulus, look)
            panels[2].axhline(stiffness * curve.strength, color=look["color"], **_STRENGTH)
    titles = ("G/Gmax [-]", "Damping ratio [%]", "Shear stress [kPa]")
    for axes, title in zip(panels, titles, strict=False):
        axes.set_ylabel(title)
        axes.set_ylim(bottom=0.0)
        axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
        _strain_axis(axes, strain)
    panels[0].set_ylim(0.0, 1.03)
    if len(ranges) > 1:
        panels[1].plot([], [], color=QUIET, linewidth=_THIN, label="outside the table")
    if with_stress:
        panels[2].plot([], [], color=QUIET, **_STRENGTH, label="shear strength")
    figure.legend(loc="outside right upper", ncols=columns)
    return figure


def _looks() -> Iterator[dict[str, Any]]:
    """Colour and dashes of one soil after the other: all colours, then the next dashes."""
    for dashes, colour in cycle(product(_DASHES, COLOURS)):
        yield {"color": colour, "linestyle": dashes}


def _line(
    axes: Axes,
    curve: Curve,
    strain: RealArray,
    values: RealArray,
    look: dict[str, Any],
    name: str | None = None,
) -> None:
    """One curve: thin outside its table."""
    inside = (strain >= curve.strain[0]) & (strain <= curve.strain[-1])
    axes.plot(1e2 * strain, np.where(inside, np.nan, values), **look, linewidth=_THIN)
    axes.plot(1e2 * strain[inside], values[inside], **look, label=name)


def _strain_axis(axes: Axes, strain: RealArray) -> None:
    axes.set_xscale("log")
    axes.set_xlim(1e2 * strain[0], 1e2 * strain[-1])
    axes.xaxis.set_major_locator(LogLocator(numticks=12))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _position: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("Shear strain [%]")
