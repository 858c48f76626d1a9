# SPDX-License-Identifier: MIT
"""Stability maps as figures: a mark a run, told apart by shape and by how dark it is.

What a scene refuses is shaded; where ``hytf check`` warns is dotted; what runs take by default is
named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from fenics_hytf.lapse import asked_residual
from fenics_hytf.results.figures.style import (
    COLOURS,
    DASHED,
    INK,
    QUIET,
    figure_style,
    save,
)
from fenics_hytf.scene import ABOVE_BAND, PERIODS
from fenics_hytf.simulation import margins
from fenics_hytf.study.stability.lapses import DEFAULT_DECAY
from fenics_hytf.study.stability.records import BLOCK, CONTRAST, FREQUENCY, LAPSES, StabilityRun
from fenics_hytf.study.stability.table import counted
from fenics_hytf.study.stability.verdicts import (
    GROWTH,
    LARGEST,
    SINGULAR,
    SMALL,
    SMALL_ENERGY,
    SMALL_RESPONSE,
    SMALL_SOLUTION,
    Verdict,
)

FIGURES = {
    LAPSES: "stability_lapses.png",
    FREQUENCY: "stability_max_frequency.png",
    BLOCK: "stability_cut_cells.png",
    CONTRAST: "stability_contrast.png",
}
_MARKS = {  # marker, colour, filled, size
    Verdict.CONVERGES: ("o", "#56B4E9", True, 5.0),
    Verdict.DRIFTS: ("^", "#D55E00", False, 6.0),
    Verdict.PUMPS: ("D", "#7B3294", False, 5.5),
    Verdict.BLOWS_UP: ("X", INK, True, 7.0),
    Verdict.STOPS: ("s", QUIET, False, 6.0),
}
_DOTTED = (0, (1, 2))
_DOT = "dotted: where hytf check begins to warn"

_LENGTH = "lapse_times_max_frequency"

_Kind = tuple[str, float, float]  # of a column: path of its moduli, damping, modulus left
_Where = Callable[[StabilityRun], tuple[float, float]]


def draw_stability(runs: Sequence[StabilityRun], folder: Path) -> list[str]:
    """Draw the maps that there are runs of.

    Args:
        runs: The runs.
        folder: Where the figures go.

    Returns:
        Names of the files.
    """
    ways = {
        LAPSES: lapse_map,
        FREQUENCY: frequency_map,
        BLOCK: block_map,
        CONTRAST: contrast_map,
    }
    drawn = []
    with figure_style():
        for name, way in ways.items():
            mine = [run for run in runs if run.map == name]
            if mine:
                save(way(mine), folder / FIGURES[name])
                drawn.append(FIGURES[name])
    return drawn


def lapse_map(runs: Sequence[StabilityRun]) -> Figure:
    """Length × ηT, a panel for each damping and each fraction of the moduli that is left."""
    lines = sorted({_kind(run)[:2] for run in runs})
    panels = [[kind for kind in _kinds(runs) if kind[:2] == line] for line in lines]
    figure, drawn = _column_map(runs, panels, "eta_lapse", "ηT of the contour [-]")
    for axes in drawn:
        axes.axhline(DEFAULT_DECAY, color=INK, linewidth=0.9, linestyle=DASHED, zorder=1)
    verdict = (
        f"converges: displacement within {100 * SMALL:g} % of the true peak, energy within "
        f"{100 * SMALL_ENERGY:g} %; blows up: {LARGEST:g} times as large as true, or growing "
        f"{GROWTH:g}-fold in still time\npumps: changes of moduli bring more than "
        f"{margins.PUMPED:g} times the energy that the shaking puts in, be the motion right or not"
    )
    text = f"A column in lapses, cut at twice the band of its motion\n{verdict}"
    return _finished(figure, runs, text, f"shaded: refused; {_DOT}; dashed: ηT of a run")


def frequency_map(runs: Sequence[StabilityRun]) -> Figure:
    """Length × highest frequency, a panel for each damping and fraction."""
    y = "max_frequency_over_band"
    figure, drawn = _column_map(runs, [_kinds(runs)], y, "Highest frequency over band [-]")
    for axes in drawn:
        axes.axhline(margins.NEAR_BAND, color=INK, linewidth=1.1, linestyle=_DOTTED, zorder=1)
        axes.axhspan(axes.get_ylim()[0], ABOVE_BAND * 0.97, color=QUIET, alpha=0.13, lw=0)
    text = (
        f"A column in lapses at the ηT of a run, {DEFAULT_DECAY:g}\nthe topmost row has all lines "
        "that samples hold, as a scene without solver.max_frequency"
    )
    return _finished(figure, runs, text, f"shaded: refused; {_DOT}")


def _kind(run: StabilityRun) -> _Kind:
    return str(run.axes["path"]), _number(run, "damping"), _number(run, "modulus_left")


def _kinds(runs: Sequence[StabilityRun]) -> list[_Kind]:
    """Kinds of columns: the path of the moduli, the damping, and fractions from large to small."""
    return sorted({_kind(run) for run in runs}, key=lambda kind: (*kind[:2], -kind[2]))


def _column_map(
    runs: Sequence[StabilityRun], panels: Sequence[Sequence[_Kind]], y: str, label: str
) -> tuple[Figure, list[Axes]]:
    """Length × what is on the other axis, a panel for each kind of column."""
    width = max(len(line) for line in panels)
    figure = Figure(figsize=(3.0 * width + 0.6, 2.35 * len(panels) + 1.95))
    grid, drawn = figure.subplots(len(panels), width, squeeze=False), []
    for row, line in zip(grid, panels, strict=True):
        for axes, (path, damping, left) in zip(row, line, strict=False):
            here = _of(runs, path=path, damping=damping, modulus_left=left)
            _scatter(axes, here, lambda r: (_number(r, _LENGTH), _number(r, y)))
            _rule(axes, PERIODS, margins.NEAR_PERIODS)
            _logarithmic(axes, "x", {_number(r, _LENGTH) for r in here})
            _logarithmic(axes, "y", {_number(r, y) for r in here})
            _leave_room(axes)
            axes.set_title(f"damping {100 * damping:g} %, {_fate(path, left)}", fontsize=9)
            drawn.append(axes)
        for axes in row[len(line) :]:
            axes.set_visible(False)
        row[0].set_ylabel(label)
    for axes in grid[-1]:
        axes.set_xlabel("Lapse × highest frequency [-]")
    return figure, drawn


def block_map(runs: Sequence[StabilityRun]) -> Figure:
    """Fill × frequency with the ghost term and without, and the condition number of both."""
    figure = Figure(figsize=(13.0, 5.4))
    panels = figure.subplots(1, 3)
    fills = sorted({_number(r, "fill") for r in runs}, reverse=True)
    for axes, ghost in zip(panels, ("yes", "no"), strict=False):
        here = _of(runs, ghost=ghost)
        _scatter(
            axes,
            here,
            lambda r: (fills.index(_number(r, "fill")), _number(r, "cells_a_wavelength")),
        )
        axes.set_title("with the ghost term, as runs have it" if ghost == "yes" else "without it")
        axes.axhline(margins.NEAR_WAVES, color=INK, linewidth=1.1, linestyle=_DOTTED, zorder=1)
        _logarithmic(axes, "y", {_number(r, "cells_a_wavelength") for r in here})
        _leave_room(axes)
        axes.set_xlim(-0.6, len(fills) - 0.4)
        axes.set_xticks(range(len(fills)), [f"{100 * fill:g}" for fill in fills], rotation=45)
        axes.invert_yaxis()
        axes.set_xlabel("Share of the last cells that is filled [%]")
        _conditions(panels[2], here, ghost == "yes")
    panels[0].set_ylabel("Cells in a shear wave's length [-]; frequency upwards")
    panels[2].set_xscale("log")
    panels[2].invert_xaxis()
    panels[2].set_xlabel("Share of the last cells that is filled [-]")
    panels[2].set_yscale("log")
    panels[2].axhline(SINGULAR, color=INK, linewidth=0.9, linestyle=DASHED)
    panels[2].annotate(
        "nothing but round-off",
        (0.02, SINGULAR),
        xycoords=("axes fraction", "data"),
        xytext=(0, 3),
        textcoords="offset points",
        fontsize=8.5,
    )
    panels[2].set_ylabel("Condition number of A(ω) [-]")
    panels[2].set_title("worst of all frequencies")
    panels[2].legend(loc="upper left", bbox_to_anchor=(0.0, 0.8))
    text = (
        "A block in cells that its points fill in part, against a fitted mesh of degree 2\n"
        f"converges: within {100 * SMALL_RESPONSE:g} % of the largest displacement at each "
        f"frequency, damped by 5 %; blows up: singular, or {LARGEST:g} times as large"
    )
    return _finished(figure, runs, text, _DOT)


def contrast_map(runs: Sequence[StabilityRun]) -> Figure:
    """Contrast × damping, a panel for each place of the stiff ground; and the residuals.

    A mark is the worst of its four runs.
    """
    places = list(dict.fromkeys(str(r.axes["place"]) for r in runs))
    figure = Figure(figsize=(3.4 * (len(places) + 1) + 0.4, 4.9))
    panels = figure.subplots(1, len(places) + 1, squeeze=False)[0]
    near = margins.near_contrast(margins.DEFAULT_TOLERANCE, True, "reduced")  # it asks for most
    drawn: list[StabilityRun] = []
    for axes, place in zip(panels, places, strict=False):
        here = _of(runs, place=place)
        dampings = sorted({_number(r, "damping") for r in here})
        number = {damping: i for i, damping in enumerate(dampings)}

        def where(run: StabilityRun, number: dict[float, int] = number) -> tuple[float, float]:
            return _number(run, "contrast"), number[_number(run, "damping")]

        worst = _worst(here, where)
        drawn += worst
        _scatter(axes, worst, where)
        axes.set_yticks(range(len(dampings)), [f"{100 * d:g} %" for d in dampings])
        axes.set_ylim(-0.6, len(dampings) - 0.4)
        axes.axvline(near, color=INK, linewidth=1.1, linestyle=_DOTTED, zorder=1)
        axes.set_title(place)
    panels[0].set_ylabel("Damping ratio")
    _residuals(panels[-1], runs, places)
    for axes in panels:
        axes.set_xscale("log")
        axes.set_xlabel("Contrast of shear moduli [-]")
    text = (
        "Stiff beside soft ground, 0.5 to 50 Hz: the worst sweep, direct or reduced, steady or "
        "transient\n"
        f"converges: the residual asked for is reached, and solutions are within "
        f"{100 * SMALL_SOLUTION:g} %; stops: the sweep refuses the line, exit code 3"
    )
    lines = f"{_DOT} of transient lapses with reduced sweeps, at the default tolerance"
    return _finished(figure, drawn, text, lines)


def _conditions(axes: Axes, runs: Sequence[StabilityRun], ghost: bool) -> None:
    fills = sorted({_number(r, "fill") for r in runs})
    worst = [max(r.figures["condition"] or np.inf for r in _of(runs, fill=fill)) for fill in fills]
    axes.plot(
        fills,
        worst,
        color=COLOURS[0] if ghost else COLOURS[1],
        marker="o" if ghost else "^",
        linestyle="-" if ghost else DASHED,
        label="with the ghost term" if ghost else "without",
    )


def _residuals(axes: Axes, runs: Sequence[StabilityRun], places: Sequence[str]) -> None:
    """The least residual that doubles allow, against what runs ask for."""
    for place, colour, marker in zip(places, COLOURS, "osD", strict=False):
        contrasts = sorted({_number(r, "contrast") for r in _of(runs, place=place)})
        floor = [
            max(r.figures["residual_floor"] or 0.0 for r in _of(runs, place=place, contrast=c))
            for c in contrasts
        ]
        axes.plot(contrasts, floor, color=colour, marker=marker, markersize=5, label=place)
    for transient, name in ((False, "asked of every sweep"), (True, "of transient, reduced ones")):
        asked = asked_residual(margins.DEFAULT_TOLERANCE, transient, "reduced")
        axes.axhline(asked, color=INK, linewidth=0.9, linestyle=DASHED)
        axes.annotate(
            name,
            (0.02, asked),
            xycoords=("axes fraction", "data"),
            xytext=(0, 3),
            textcoords="offset points",
            fontsize=8.5,
        )
    axes.set_yscale("log")
    axes.set_ylabel("Residual of true solutions in doubles [-]")
    axes.set_title("what no sweep can beat")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, 0.66))


def _scatter(axes: Axes, runs: Sequence[StabilityRun], where: _Where) -> None:
    for verdict in _MARKS:
        mine = [where(run) for run in runs if run.verdict == verdict]
        if mine:
            axes.plot(*zip(*mine, strict=True), zorder=4, **_mark(verdict))


def _mark(verdict: Verdict) -> dict[str, Any]:
    """How it is drawn."""
    marker, colour, filled, size = _MARKS[verdict]
    return {
        "linestyle": "none",
        "marker": marker,
        "color": colour,
        "markersize": size,
        "markerfacecolor": colour if filled else "white",
        "markeredgecolor": colour if verdict != Verdict.CONVERGES else COLOURS[0],
        "markeredgewidth": 0.7 if filled else 1.4,
    }


def _worst(runs: Sequence[StabilityRun], where: _Where) -> list[StabilityRun]:
    """Of runs at one place that with the worst verdict."""
    order = list(Verdict)
    found: dict[tuple[float, float], StabilityRun] = {}
    for run in runs:
        place = where(run)
        if place not in found or order.index(run.verdict) > order.index(found[place].verdict):
            found[place] = run
    return list(found.values())


def _rule(axes: Axes, refused: float, near: float) -> None:
    """Shade what is refused, up to just before the least that is not; dot where warnings end."""
    axes.axvspan(1e-3, 0.97 * refused, color=QUIET, alpha=0.13, linewidth=0)
    axes.axvline(near, color=INK, linewidth=1.1, linestyle=_DOTTED, zorder=1)


def _logarithmic(axes: Axes, name: Literal["x", "y"], values: Iterable[float]) -> None:
    """Make one of the axes logarithmic, with the values of the map on it."""
    axes.set(**{f"{name}scale": "log"})
    axis: Axis = axes.xaxis if name == "x" else axes.yaxis
    axis.set_major_locator(FixedLocator(sorted(values)))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))


def _leave_room(axes: Axes) -> None:
    """Limits a little beyond the marks of logarithmic axes, whatever lines are drawn."""
    points = np.concatenate(
        [line.get_xydata() for line in axes.lines if line.get_marker() != "None"]
    )
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    if x0 > 0:
        axes.set_xlim(x0 / 1.25, x1 * 1.25)
    axes.set_ylim(y0 / 1.25, y1 * 1.25)


def _finished(figure: Figure, runs: Sequence[StabilityRun], text: str, lines: str) -> Figure:
    """Title, and a legend with counts at the foot."""
    title, _, small = text.partition("\n")
    figure.suptitle(title, x=0.01, ha="left", fontsize=12, fontweight="bold")
    handles = []
    for verdict in _MARKS:
        for words in counted([run for run in runs if run.verdict == verdict]):
            handles += figure.axes[0].plot([], [], label=words, **_mark(verdict))
    figure.legend(
        handles=handles,
        loc="outside lower left",
        ncols=len(handles),
        fontsize=10,
        title=f"{small}\n{lines}",
        title_fontsize=9,
        alignment="left",
    )
    return figure


def _fate(path: str, fraction: float) -> str:
    if fraction == 1:
        return "moduli constant"
    return f"moduli {'fall' if path == 'falls' else 'swing'} to {fraction:g}"


def _of(runs: Sequence[StabilityRun], **axes: float | str) -> list[StabilityRun]:
    """The runs at some places of a map."""
    return [run for run in runs if all(run.axes[name] == value for name, value in axes.items())]


def _number(run: StabilityRun, name: str) -> float:
    value = run.axes[name]
    assert isinstance(value, float | int)
    return float(value)
