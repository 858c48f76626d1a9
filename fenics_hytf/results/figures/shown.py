# SPDX-License-Identifier: MIT
"""What figures show of a stored result: which receivers, components, inputs and lines."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from fenics_hytf.results.figures.style import MAX_LINES, chosen
from fenics_hytf.results.reader import StoredResult
from fenics_hytf.results.summary import component_peaks

_ROUNDING = 1e-6  # of the input: less is not a motion

RealArray = npt.NDArray[np.floating[Any]]

FEW_LINES = 5
"""As many solved lines or fewer are no spectrum: they are shown as markers, or not at all."""

_DRAWN = 0.1  # a component is drawn if its peak is at least this fraction of the largest
_SEAMS = 20  # as many lapses or fewer have their seams marked


def shown_receivers(stored: StoredResult) -> list[str]:
    """Receivers that figures show, highest first."""
    receivers = stored.summary["receivers"]
    names = list(receivers)
    return [names[i] for i in chosen(names, [receivers[n]["place_m"][-1] for n in names])]


def shown_components(stored: StoredResult) -> list[str]:
    """Components that move enough to be drawn: within a tenth of the largest."""
    peaks = component_peaks(stored.summary)
    largest = max(peaks.values(), default=0.0)
    return [c for c, peak in peaks.items() if peak > 0.0 and peak >= _DRAWN * largest]


def input_kind(stored: StoredResult, direction: str) -> str | None:
    """``within`` or ``outcrop``: how the input of a direction is given; ``None`` without one."""
    motions = stored.summary["motions"]
    return next((str(m["input"]) for m in motions if m["direction"] == direction), None)


def has_outcrop(stored: StoredResult) -> bool:
    """Whether the rock is known, and so the base has a within and an outcrop motion."""
    return any(base["outcrop_pga_g"] is not None for base in stored.summary["base"].values())


def transfer_column(stored: StoredResult, name: str, component: str, direction: str) -> str:
    """Name of a transfer function's column, without ``.re`` and ``.im``."""
    several = len(stored.summary["directions"]) > 1
    return f"{name}.A_{component}" + (f"/{direction}" if several else "")


def has_transfer(stored: StoredResult, component: str, direction: str) -> bool:
    """Whether the input in a direction moves a component by more than rounding."""
    columns = [
        stored.transfer[transfer_column(stored, name, component, direction) + f".{part}"]
        for name in stored.summary["receivers"]
        for part in ("re", "im")
    ]
    return any(np.nanmax(np.abs(column), initial=0.0) > _ROUNDING for column in columns)


def solved_band(stored: StoredResult) -> tuple[float, float] | None:
    """Lowest (above zero) and highest solved line [Hz]; ``None`` where there are but a few."""
    frequency = stored.transfer["frequency_hz"]
    above = np.unique(frequency[frequency > 0.0])
    return (float(above[0]), float(above[-1])) if above.size > FEW_LINES else None


def seams(stored: StoredResult) -> list[float]:
    """Where lapses meet [s]; none if they are too many to be marked."""
    lapses = stored.summary["lapses"]
    return [lapse["start_time_s"] for lapse in lapses[1:]] if len(lapses) <= _SEAMS else []


def left_out(stored: StoredResult) -> str:
    """Words for a caption where not all receivers are shown."""
    count = len(stored.summary["receivers"])
    return f" {MAX_LINES} of {count} receivers are shown." if count > MAX_LINES else ""


def without_slip(stored: StoredResult) -> str:
    """Words for a caption of strain where ground slides."""
    if stored.slip is None:
        return ""
    return " Strain is that of the vibration; what slips strains the ground besides."


def on_contour(stored: StoredResult) -> str:
    """Words for a caption where lines lie on a damped contour."""
    contour = stored.summary["scene"]["contour"]
    if contour is None:
        return ""
    return (
        f", which lie on the damped contour s = η + iω, η = {contour['eta_1_s']:.3g} 1/s: peaks "
        "are lower and wider than those of a steady motion"
    )
