# SPDX-License-Identifier: MIT
"""Figures over frequency and period: transfer functions, response spectra, Fourier amplitudes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from fenics_hytf.motion import GRAVITY, fourier_amplitude, smoothed
from fenics_hytf.results.figures.shown import (
    FEW_LINES,
    input_kind,
    shown_receivers,
    transfer_column,
)
from fenics_hytf.results.figures.style import COLOURS, DASHED, INK, QUIET, label, legend
from fenics_hytf.results.reader import StoredResult

RealArray = npt.NDArray[np.floating[Any]]

_CENTRES = 240  # frequencies at which Fourier amplitudes are smoothed
_BAND = (0.1, 25.0)  # [Hz]: what engineers look at of a record


def transfer_functions(stored: StoredResult, component: str, direction: str) -> Figure:
    """Amplitude |A/input| of every shown receiver over frequency, logarithmic in frequency.

    On a damped contour s = η + iω frequency is ω/2π.
    """
    figure = Figure(figsize=(9.0, 4.2))
    axes = figure.subplots()
    last = stored.summary["lapses"][-1]["index"]
    highest, ends = 0.0, []
    for i, name in enumerate(shown_receivers(stored)):
        column = transfer_column(stored, name, component, direction)
        frequency, amplitude = _above_zero(*stored.transfer_function(column, last))
        few = frequency.size <= FEW_LINES
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
    kind = input_kind(stored, direction)
    where = "" if stored.summary["scene"]["contour"] is None else ", at s = η + iω"
    axes.set_ylabel(f"|A$_{component}$ / {kind} input$_{direction}$|{where} [-]")
    legend(axes)
    return figure


def response_spectra(stored: StoredResult, component: str) -> Figure:
    """5 % damped pseudo-acceleration [g] over period, and below it the ratio to the input's."""
    kind = input_kind(stored, component)
    figure = Figure(figsize=(9.0, 6.6 if kind else 4.2))
    rows = figure.subplots(2 if kind else 1, 1, sharex=True, squeeze=False)[:, 0]
    period = stored.spectra["period_s"]
    given = None if kind is None else stored.spectra[f"{kind}.{component}"]
    if given is not None:
        rows[0].plot(
            period, given / GRAVITY, color=INK, linestyle=DASHED, label=f"input ({kind})", zorder=3
        )
    for colour, name in zip(COLOURS, shown_receivers(stored), strict=False):
        values = stored.spectra[f"{name}.PSA_{component}"]
        rows[0].plot(period, values / GRAVITY, color=colour, label=label(name))
        if given is not None and np.any(given > 0.0):
            ratio = values[given > 0.0] / given[given > 0.0]
            rows[1].plot(period[given > 0.0], ratio, color=colour, label=label(name))
    rows[0].set_ylabel(f"Spectral acceleration, {component}, 5 % damped [g]")
    if given is not None:
        rows[1].axhline(1.0, color=QUIET, linewidth=0.8, zorder=1)
        rows[1].set_ylabel("Amplification of spectral\nacceleration over the input [-]")
    for axes in rows:
        period_axis(axes, period, name=axes is rows[-1])
        axes.set_ylim(bottom=0.0)
    legend(rows[0])
    return figure


def fourier_amplitudes(stored: StoredResult, component: str, band: tuple[float, float]) -> Figure:
    """Smoothed Fourier amplitude [m/s] of the input and the receivers over frequency.

    Args:
        stored: The result.
        component: Component of the motion.
        band: Lowest and highest solved line [Hz].
    """
    figure = Figure(figsize=(9.0, 4.2))
    axes = figure.subplots()
    low, high = max(band[0], _BAND[0]), min(band[1], _BAND[1])
    if low >= high:
        low, high = band
    kind = input_kind(stored, component)
    dt = stored.summary["dt_s"]
    centres = _smoothing_centres(low, high, 1.0 / (dt * stored.receivers["time_s"].size))

    def draw(acceleration: RealArray, **look: Any) -> None:
        values = smoothed(*fourier_amplitude(acceleration, dt), centres)
        axes.plot(centres, np.where(values > 0.0, values, np.nan), **look)

    if kind is not None:
        look = {"color": INK, "linestyle": DASHED, "label": f"input ({kind})", "zorder": 3}
        draw(stored.base[f"{kind}.A_{component}"], **look)
    for colour, name in zip(COLOURS, shown_receivers(stored), strict=False):
        draw(stored.receivers[f"{name}.A_{component}"], color=colour, label=label(name))
    axes.set_yscale("log")
    _frequency_axis(axes, [low, high])
    axes.set_ylabel(f"Fourier amplitude of acceleration, {component} [m/s]")
    legend(axes)
    return figure


def _smoothing_centres(low: float, high: float, spacing: float) -> RealArray:
    """Frequencies at equal steps of an octave; where lines lie apart like that, the lines [Hz]."""
    sparse = 10.0 * spacing  # above, the smoothing window holds several lines
    lines = spacing * np.arange(1, 10)
    even = np.geomspace(low, high, _CENTRES)
    return np.concatenate([lines[(lines >= low) & (lines <= high)], even[even >= sparse]])


def period_axis(axes: Axes, period: RealArray, name: bool = True) -> None:
    """A logarithmic axis of period, with plain numbers.

    Args:
        axes: Where.
        period: First and last are its ends [s].
        name: Whether the axis is named.
    """
    axes.set_xscale("log")
    axes.set_xlim(period[0], period[-1])
    axes.margins(y=0.08)
    axes.xaxis.set_major_formatter(FuncFormatter(_plain_number))
    if name:
        axes.set_xlabel("Period [s]")


def _above_zero(frequency: RealArray, amplitude: RealArray) -> tuple[RealArray, RealArray]:
    """Without the line at zero frequency, which a logarithmic axis has no place for."""
    return frequency[frequency > 0], amplitude[frequency > 0]


def _frequency_axis(axes: Axes, ends: list[float]) -> None:
    axes.set_xscale("log")
    low, high = (min(ends), max(ends)) if ends else _BAND
    if high > 10.0 * _BAND[0] and low < _BAND[1]:
        low, high = max(low, _BAND[0]), min(high, _BAND[1])
    if high < 3.0 * low:  # one line, or a few side by side: room around them
        low, high = low / 10.0, high * 10.0
    axes.set_xlim(low, high)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_formatter(FuncFormatter(_plain_number))
    axes.set_xlabel("Frequency [Hz]")


def _plain_number(value: float, _position: int | None = None) -> str:
    return f"{value:g}"
