# SPDX-License-Identifier: MIT
"""The work-precision figure: error against core-seconds, the scene left, its viscous twin right.

Of a scene that slides the error of its slip stands between them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from fenics_hytf.results.figures.style import (
    COLOURS,
    DASHED,
    INK,
    QUIET,
    figure_style,
    label,
    save,
)
from fenics_hytf.study.knobs import LABELS, MESH
from fenics_hytf.study.records import (
    TARGETS,
    Comparison,
    Point,
    Study,
    core_s,
    error_of,
    measured,
    pareto,
)
from fenics_hytf.study.time_domain import METHODS, SWEEPS

_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "p")
_KNOBS = {knob: ((*COLOURS, QUIET, INK)[i], _MARKERS[i]) for i, knob in enumerate(LABELS)}
_METHODS = {
    "direct": (COLOURS[0], "D"),
    "reduced": (COLOURS[0], "o"),
    "newmark": (COLOURS[1], "s"),
    "hht": (COLOURS[3], "^"),
}
_OF_ACCELERATION = "Relative L2 error of total acceleration [%]"
_FLOOR = 1e-10  # %: rounding; smaller errors are drawn there
_TWIN_FLOOR = 1e-4  # %: smaller differences from the direct sweep are drawn there
_BESIDE = {"newmark": (-11, -12), "hht": (6, 4)}  # where steps are named
_BELOW_DOUBT = 0.1  # of the reference's uncertainty: smaller errors are drawn there
_SHORT = 200.0  # an axis from low to high that spans less has numbers within decades too
_ROOM = 3.0  # below the smallest error drawn, and above the largest


def draw_study(study: Study, path: Path) -> None:
    """Draw a study into a PNG file."""
    with figure_style():
        save(work_precision(study), path)


def work_precision(study: Study) -> Figure:
    """The figure, to be drawn in the package's style.

    Args:
        study: The study.

    Returns:
        The figure.
    """
    slip, both = study.of_slip(), bool(study.twin.points)
    count = 1 + (slip is not None) + both
    figure = Figure(figsize=(7.5 if count == 1 else 6.5 * count, 6.6))
    panels = figure.subplots(1, count, squeeze=False)[0]
    figure.suptitle(label(study.title, 90), x=0.01, ha="left", fontsize=12)
    _scene(panels[0], study, "Error", _OF_ACCELERATION)
    if slip is not None:
        _scene(panels[1], slip, "Error of the slip", "Relative error of the slip [%]")
    if both:
        _twin(panels[-1], study.twin)
    for axes in panels:
        axes.legend(
            loc="upper left",
            bbox_to_anchor=(0.0, -0.11),
            ncols=2,
            borderaxespad=0.0,
            columnspacing=1.4,
        )
    return figure


def _scene(axes: Axes, study: Study, what: str, quantity: str) -> None:
    """What each knob does alone, candidates, the front and the scene as it is."""
    floor = _lowest(study.points, study.reference.uncertainty)
    for knob, text in LABELS.items():
        mine = [p for p in study.points if knob in p.families]
        if any("fine" not in point.families for point in measured(mine)):
            colour, marker = _KNOBS[knob]
            # Both families of the mesh are sizes, each at a degree of its own.
            mesh = f"{LABELS['cells']}, {mine[0].words['degree']}"
            name = mesh if knob in MESH else f"{text} alone"
            _series(axes, mine, colour, marker, name, floor)
    rays = False
    for point in measured(study.points):
        if "from own" in point.families and len(point.turned) == 1:
            _ray(axes, study.own, point, floor)
            rays = True
    if rays:
        text = "one knob, from the scene as it is"
        axes.plot([], [], color=INK, linewidth=1.0, linestyle=DASHED, label=text)
    tried = [p for p in study.points if "candidate" in p.families]
    _series(axes, tried, INK, "h", "sought for a target", floor, joined=False)
    _front(axes, study.points, floor)
    if study.own != study.finest:
        _star(axes, study.own, floor)
    if study.reference.uncertainty > 0:
        _doubt(axes, study)
    reference = study.reference.text.split(":")[0].split(" (")[0]  # without the details
    _dress(axes, f"{what} against the {reference}", quantity, floor)


def _star(axes: Axes, own: Point, floor: float) -> None:
    """The scene as it is."""
    axes.plot(
        *_place(own, floor),
        marker="*",
        color=INK,
        markersize=15,
        markerfacecolor="white",
        linestyle="none",
        label="the scene as it is",
        zorder=6,
    )


def _doubt(axes: Axes, study: Study) -> None:
    """The errors that the reference cannot tell."""
    doubt = 100 * study.reference.uncertainty
    if any(not point.resolved for point in measured(study.points)):
        text = "hollow: within the uncertainty"
        axes.plot(
            [], [], color=INK, marker="o", markerfacecolor="white", linestyle="none", label=text
        )
    axes.axhspan(0.0, doubt, color=QUIET, alpha=0.15, linewidth=0)
    axes.annotate(
        "uncertainty of the reference",
        (0.01, doubt),
        xycoords=("axes fraction", "data"),
        xytext=(0, -3),
        textcoords="offset points",
        va="top",
        color=QUIET,
        fontsize=8.5,
    )


def _ray(axes: Axes, own: Point, point: Point, floor: float) -> None:
    """From the scene as it is to what one knob alone makes of it."""
    colour, marker = _KNOBS[point.turned[0]]
    (x, y), (own_x, own_y) = _place(point, floor), _place(own, floor)
    axes.plot([own_x, x], [own_y, y], color=colour, linewidth=1.0, linestyle=DASHED, zorder=2)
    known = axes.get_legend_handles_labels()[1]
    text = LABELS[point.turned[0]]
    axes.plot(
        x,
        y,
        color=colour,
        marker=marker,
        markersize=4,
        linestyle="none",
        label=None if any(name.startswith(text) for name in known) else text,
        zorder=5,
    )


def _place(point: Point, floor: float) -> tuple[float, float]:
    """Where a point is drawn: core-seconds and error [%]."""
    return core_s(point), max(100 * error_of(point), floor)


def _twin(axes: Axes, twin: Comparison) -> None:
    """Methods on one problem; the exact one is a line: its cost."""
    floor = max(_lowest(twin.points, 0.0), _TWIN_FLOOR)
    names = {**SWEEPS, **METHODS}
    for method, (colour, marker) in _METHODS.items():
        mine = [p for p in twin.points if p.families[0] == method]
        if method == "direct":
            for point in (p for p in mine if p.cost):
                assert point.cost is not None
                axes.axvline(point.cost.core_s, color=colour, linestyle=DASHED, label=names[method])
            continue
        steps = " (steps a sample)" if method in METHODS else ""
        _series(axes, mine, colour, marker, names[method] + steps, floor)
        if method in METHODS:
            _name_steps(axes, mine, floor, _BESIDE[method])
    _front(axes, twin.points, floor)
    _dress(axes, "Viscous twin: frequency domain and time domain", _OF_ACCELERATION, floor)


def _series(
    axes: Axes,
    points: Sequence[Point],
    colour: str,
    marker: str,
    text: str,
    floor: float,
    joined: bool = True,
) -> None:
    """Points of one kind; hollow where the error is not told from the reference's."""
    drawn = sorted(measured(points), key=error_of, reverse=True)
    if not drawn:
        return
    x, y = zip(*(_place(point, floor) for point in drawn), strict=True)
    resolved = [point.resolved for point in drawn]
    if joined:
        axes.plot(x, y, color=colour, linewidth=0.9, alpha=0.55)
    for told, face in ((True, colour), (False, "white")):
        here = [i for i, is_told in enumerate(resolved) if is_told is told]
        axes.plot(
            [x[i] for i in here],
            [y[i] for i in here],
            linestyle="none",
            marker=marker,
            markersize=6,
            color=colour,
            markerfacecolor=face,
            label=text if told is any(resolved) else None,
            zorder=4,
        )


def _front(axes: Axes, points: Iterable[Point], floor: float) -> None:
    front = pareto(points)
    axes.plot(
        *zip(*(_place(point, floor) for point in front), strict=True),
        color=INK,
        linewidth=2.2,
        alpha=0.8,
        drawstyle="steps-post",
        label="Pareto front",
        zorder=3,
    )


def _name_steps(axes: Axes, points: Iterable[Point], floor: float, beside: tuple[int, int]) -> None:
    for point in measured(points):
        axes.annotate(
            f"{point.substeps}",
            _place(point, floor),
            xytext=beside,
            textcoords="offset points",
            fontsize=8.5,
            color=QUIET,
        )


def _lowest(points: Iterable[Point], doubt: float) -> float:
    """Smallest error that is drawn [%]: rounding, or well below what the reference is good for."""
    errors = [100 * p.error.relative_l2 for p in points if p.error]
    least = min((e for e in errors if e > _FLOOR), default=_FLOOR)
    return max(min(least, 100 * doubt) if doubt else least, _BELOW_DOUBT * 100 * doubt, _FLOOR)


def _dress(axes: Axes, title: str, quantity: str, floor: float) -> None:
    """Scales, names, and the levels that settings are sought for."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(bottom=floor / _ROOM)
    lowest = axes.get_ylim()[0]
    for target in (each for each in TARGETS if 100 * each > lowest):
        axes.axhline(100 * target, color=QUIET, linewidth=0.9, linestyle=(0, (1, 2)), zorder=1)
        axes.annotate(
            f"{100 * target:g} %",
            (1.0, 100 * target),
            xycoords=("axes fraction", "data"),
            xytext=(3, 0),
            textcoords="offset points",
            va="center",
            color=QUIET,
            fontsize=8.5,
        )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    low, high = axes.get_xlim()
    if high < _SHORT * low:  # a decade at most would have but one number
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("Cost [core-s]")
    axes.set_ylabel(quantity)
    axes.set_title(title)
