# SPDX-License-Identifier: MIT
"""Figure of the stiffness from lapse to lapse: G/Gmax and the degradation index of each layer."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from fenics_hytf.results.figures.style import COLOURS, MAX_LINES, chosen, label, legend
from fenics_hytf.results.reader import StoredResult

RealArray = npt.NDArray[np.floating[Any]]

_CHANGE = 1e-6  # of the value: less is round-off
_PANELS = {"g_over_gmax": "G/Gmax [-]", "degradation": "Degradation index [-]"}


def stiffness(stored: StoredResult) -> Figure | None:
    """The smallest value in each layer, lapse by lapse, over time.

    Args:
        stored: The result.

    Returns:
        The figure; ``None`` where there is one lapse, or nothing changes.
    """
    lapses = stored.summary["lapses"]
    found = {name: _softest(stored, name) for name in _PANELS}
    panels = {name: values for name, values in found.items() if _changes(values)}
    linear = stored.summary["scene"]["strain_ratio"] is None
    if linear and len(panels) == 2:  # of linear soil both are the same
        del panels["g_over_gmax"]
    if len(lapses) == 1 or not panels:
        return None
    ends = [lapse["start_time_s"] + lapse["samples"] * stored.summary["dt_s"] for lapse in lapses]
    edges = np.array([lapses[0]["start_time_s"], *ends])
    layers = lapses[0]["layers"]
    shown = chosen([layer["soil"] for layer in layers], [-i for i in range(len(layers))])
    figure = Figure(figsize=(9.0, 0.8 + 2.7 * len(panels)))
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, values) in zip(rows, panels.items(), strict=True):
        for colour, layer in zip(COLOURS, shown, strict=False):
            steps = np.append(values[:, layer], values[-1, layer])
            name_of_layer = _name(layers[layer])
            axes.step(edges, steps, where="post", color=colour, linewidth=1.6, label=name_of_layer)
        axes.set_ylabel(_PANELS[name])
        span = 1.0 - float(np.nanmin(values))
        axes.set_ylim(1.0 - 1.1 * span, 1.0 + 0.05 * span)
    rows[-1].set_xlim(edges[0], edges[-1])
    rows[-1].set_xlabel("Time [s]")
    legend(rows[0])
    return figure


def stiffness_caption(stored: StoredResult) -> str:
    """How to read the figure."""
    layers = len(stored.summary["lapses"][0]["layers"])
    text = "The softest cell of each layer, a step a lapse."
    if layers > MAX_LINES:
        text += f" {MAX_LINES} of {layers} layers are shown."
    if stored.summary["scene"]["degradation"] is not None:
        text += " The degradation index is what counted cycles have left of the modulus."
    return text


def _softest(stored: StoredResult, name: str) -> RealArray:
    """Smallest value of each layer, NaN where it has none, shape ``(num_lapses, num_layers)``."""
    lapses = [
        {_name(layer): (layer[name] or [None])[0] for layer in lapse["layers"]}
        for lapse in stored.summary["lapses"]
    ]
    # where soil moves, regions come in another order, or come to fill most of no cell
    values = [[lapse.get(layer) for layer in lapses[0]] for lapse in lapses]
    return np.array(values, dtype=np.float64)


def _changes(values: RealArray) -> bool:
    """Whether a value differs from lapse to lapse."""
    span = np.fmax.reduce(values, axis=0) - np.fmin.reduce(values, axis=0)
    return bool(np.any(span > _CHANGE))


def _name(layer: dict[str, Any]) -> str:
    name = label(str(layer["soil"]), 18)
    if "depth_m" not in layer:
        return name
    top, bottom = layer["depth_m"]
    return f"{name}, {top:g}–{bottom:g} m"
