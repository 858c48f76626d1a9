# SPDX-License-Identifier: MIT
"""The report on what came out: base, peaks and intensity of the receivers, layers, convergence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from fenics_hytf.motion import GRAVITY
from fenics_hytf.results.reader import StoredResult
from fenics_hytf.results.report.markup import NOTHING, number, power, span, table
from fenics_hytf.results.summary import moving_components

Summary = Mapping[str, Any]

_MEASURES = (
    ("PGA [g]", "pga_m_s2", 1.0 / GRAVITY),
    ("PGV [m/s]", "pgv_m_s", 1.0),
    ("PGD [mm]", "pgd_m", 1e3),
    ("Arias intensity [m/s]", "arias_m_s", 1.0),
    ("CAV [m/s]", "cav_m_s", 1.0),
    ("D5-95 [s]", "d5_95_s", 1.0),
)
_ROUNDING = 1e-9  # of the largest of a kind
_MOST_LAPSES = 6  # whose layers are listed


def what_slid(summary: Summary) -> str:
    """What the slope did, in one line."""
    told, lapse = summary["sliding"], summary["lapses"][-1]
    factor = told["factor_of_safety"]
    safety = "gravity alone does not shear it"
    if factor is not None:
        safety = f"its factor of safety at rest was {number(factor)}"
    if not told["slip_m"] > 0.0:
        ratio = told["yield_over_peak"]
        drive = (
            "nothing drove it"
            if ratio is None
            else (f"it was driven by {100 / ratio:.2g} % of the acceleration that it yields under")
        )
        return f"The slope did not slide: {safety}, and {drive}."
    first = lapse["slip"]
    way = f"{'+' if first['sense'] > 0 else '−'}{first['direction']}"
    slid = f"The slope slid by {number(told['slip_m'])} m towards {way}"
    if told["at_rest_s"] is None:
        end = lapse["start_time_s"] + lapse["samples"] * summary["dt_s"]
        return (
            f"{slid}, and was still sliding at {number(first['end_rate_m_s'])} m/s when the run "
            f"ended after {end:.3g} s; {safety}."
        )
    return f"{slid} and came to rest after {told['at_rest_s']:.3g} s; {safety}."


def base_table(summary: Summary) -> str:
    """Intensity of the motions of the base, within and outcrop."""
    given = {motion["direction"]: motion["input"] for motion in summary["motions"]}
    rows = [
        (
            kind + (" (the input)" if given.get(direction) == kind else ""),
            direction,
            *_measures(base[f"{kind}_intensity"]),
        )
        for direction, base in summary["base"].items()
        for kind in ("outcrop", "within")
        if base[f"{kind}_intensity"] is not None
    ]
    head = ("Motion of the base", "Direction", *(name for name, *_ in _MEASURES))
    note = "The input as far as its lines were solved."
    return table("Motion of the base.", head, rows, words=(0, 1), note=note)


def peaks_table(summary: Summary) -> str:
    """Peaks by receiver, and amplification over the input where there is one in the direction."""
    if not summary["peaks"]:
        return "<p>The scene has no receivers.</p>"
    summary = {**summary, "peaks": _without_rounding(summary["peaks"])}
    pga = {motion["direction"]: motion["pga_m_s2"] for motion in summary["motions"]}
    rows = []
    for name, place, component in _receivers(summary):
        peaks = summary["peaks"][name]
        total = peaks[f"A_{component}"]
        known = total is not None and pga.get(component)
        rows.append(
            (
                *((name, place) if place else ("", "")),
                component,
                _in_g(total),
                number(total / pga[component]) if known else NOTHING,
                _in_g(peaks[f"a_{component}"]),
                number(peaks[f"v_{component}"]),
                _scaled(peaks[f"u_{component}"], 1e3),
            )
        )
    head = (
        "Receiver",
        "Place [m]",
        "Direction",
        "Total acc. [g]",
        "over input [-]",
        "Relative acc. [g]",
        "Relative vel. [m/s]",
        "Relative disp. [mm]",
    )
    note = "Components that do not move are left out." if _still(summary) else ""
    return table("Peaks at the receivers.", head, rows, words=(0, 1, 2), note=note)


def _without_rounding(peaks: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Peaks, with nought for what rounding leaves where nothing moves (the base, relatively)."""
    largest: dict[str, float] = {}
    for of_one in peaks.values():
        for key, value in of_one.items():
            largest[key[0]] = max(largest.get(key[0], 0.0), value or 0.0)
    return {
        name: {
            key: 0.0 if value is not None and value < _ROUNDING * largest[key[0]] else value
            for key, value in of_one.items()
        }
        for name, of_one in peaks.items()
    }


def intensity_table(summary: Summary) -> str:
    """Intensity measures of the receivers' total motion."""
    rows = [
        (name if place else "", component, *_measures(summary["intensity"][name][component]))
        for name, place, component in _receivers(summary)
    ]
    head = ("Receiver", "Direction", *(name for name, *_ in _MEASURES))
    return table("Intensity of the total motion at the receivers.", head, rows, words=(0, 1))


def layers_table(summary: Summary) -> str:
    """The state of every layer or region, and whether it converged."""
    lapses = summary["lapses"]
    count = min(len(lapses), _MOST_LAPSES)
    chosen = [lapses[int(i)] for i in np.linspace(0, len(lapses) - 1, count).round()]
    column = any("depth_m" in layer for lapse in lapses for layer in lapse["layers"])
    several = len(lapses) > 1
    degrades = any(layer["degradation"] is not None for i in lapses for layer in i["layers"])
    rows = [
        (
            *((lapse["index"] if i == 0 else "",) if several else ()),
            layer["soil"],
            _reach(layer["depth_m"] if column else layer["elevation_m"]),
            layer["cells"],
            span(layer["effective_strain"], 100.0),
            span(layer["g_over_gmax"]),
            *((span(layer["degradation"]),) if degrades else ()),
            span(layer["damping"], 100.0),
            power(layer["change"]),
            {True: "yes", False: "NO", None: NOTHING}[layer["converged"]],
        )
        for lapse in chosen
        for i, layer in enumerate(lapse["layers"])
    ]
    head = (
        *(("Lapse",) if several else ()),
        "Layer" if column else "Region",
        "Depth [m]" if column else "Cell centres at elevation [m]",
        "Cells [-]",
        "Effective strain [%]",
        "G/Gmax [-]",
        *(("Degradation index [-]",) if degrades else ()),
        "Damping [%]",
        "Final change [-]",
        "Converged",
    )
    note = f"{count} of {len(lapses)} lapses." if count < len(lapses) else ""
    caption = "Convergence by layer." if column else "Convergence by region."
    words = {head.index(name) for name in head if name in ("Layer", "Region", "Converged")}
    return table(caption, head, rows, words, dense=True, note=note)


def iterations_table(stored: StoredResult) -> str:
    """Largest change of every iteration, and the cell it was in; of the longest loop."""
    lapse = max(stored.summary["lapses"], key=lambda lapse: lapse["iterations"])
    here = stored.cells["lapse"] == lapse["index"]
    cells = {name: column[here] for name, column in stored.cells.items()}
    height = cells["z" if "z" in cells else "y"]
    rows_of = np.searchsorted(cells["cell"], lapse["worst_cell"])
    layers = stored.summary["scene"]["mesh"].get("layers")
    if layers is not None:
        height = sum(layer["thickness_m"] for layer in layers) - height
    rows = [
        (i, power(change), cell, f"{height[row]:g}", cells["region"][row])
        for i, (change, cell, row) in enumerate(
            zip(lapse["change"], lapse["worst_cell"], rows_of, strict=True), 1
        )
    ]
    which = f" of lapse {lapse['index']}" if len(stored.summary["lapses"]) > 1 else ""
    where = "at elevation [m]" if layers is None else "at depth [m]"
    head = ("Iteration", "Largest change [-]", "in cell", where, "of soil")
    return table(f"Iterations{which}.", head, rows, words=(4,), dense=True)


def _receivers(summary: Summary) -> Iterator[tuple[str, str, str]]:
    """Receiver, its place with its first component and nothing with the others, component."""
    for name, receiver in summary["receivers"].items():
        place = ", ".join(f"{x:g}" for x in receiver["place_m"])
        place += " (rides a point)" if receiver["rides"] else ""
        for i, component in enumerate(moving_components(summary, name)):
            yield name, place if i == 0 else "", component


def _still(summary: Summary) -> bool:
    """Whether a component of a receiver does not move."""
    every = len(summary["components"])
    return any(len(moving_components(summary, name)) < every for name in summary["receivers"])


def _measures(measures: Mapping[str, float | None]) -> list[str]:
    return [_scaled(measures[key], factor) for _, key, factor in _MEASURES]


def _reach(ends: Sequence[float]) -> str:
    """From where to where a layer reaches [m]."""
    low, high = (f"{end:g}" for end in ends)
    return low if low == high else f"{low} to {high}"


def _in_g(value: float | None) -> str:
    return _scaled(value, 1.0 / GRAVITY)


def _scaled(value: float | None, factor: float) -> str:
    return number(None if value is None else factor * value)
