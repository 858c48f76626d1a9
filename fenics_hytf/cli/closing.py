# SPDX-License-Identifier: MIT
"""The few lines that end a run on standard output."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fenics_hytf.motion import GRAVITY
from fenics_hytf.results import moving_components

_MOST = 12  # receivers listed
_ROUNDING = 1e-9  # of the largest peak of its kind


def closing_words(summary: Mapping[str, Any], folder: Path, plots: bool) -> str:
    """What a run was and what came out.

    Args:
        summary: ``summary.json``.
        folder: Where the result is.
        plots: Whether there is a report.

    Returns:
        Lines of text.
    """
    lapses = summary["lapses"]
    iterations = [lapse["iterations"] for lapse in lapses]
    residuals = [lapse["worst_residual"] or 0.0 for lapse in lapses]
    lines = (
        f"{sum(lapse['solved_lines'] for lapse in lapses)} solved of "
        f"{summary['work']['excited_lines']} excited, {summary['work']['factorisations']} "
        f"factorisations, worst residual {max(residuals, default=0.0):.1e}"
    )
    rows = [("effects", ", ".join(summary["effects"]) or "none"), ("lines", lines)]
    if any(iterations):
        change = lapses[-1]["final_change"]
        last = "" if change is None else f", last change {change:.1e}"
        rows.append(("iterations", f"{sum(iterations)}{last}"))
    rows += _slip(summary)
    rows += _softening(summary)
    rows += _seams(summary)
    rows += _base(summary)
    rows += _peaks(summary)
    rows += [("warning", text) for text in summary["warnings"]]
    rows.append(("results", f"{folder / 'report.html' if plots else folder}"))
    return "\n".join([summary["title"], *(f"  {name:11s} {text}" for name, text in rows)])


def _slip(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What slid, beside what sliding blocks say."""
    told = summary["sliding"]
    if told is None:
        return []
    rest, safety = told["at_rest_s"], told["factor_of_safety"]
    words = "" if safety is None else f"factor of safety {safety:.3g}, "
    words += (
        f"k_y {told['yield_coefficient']:.3g}; "
        f"slip {told['slip_m']:.3g} m (decoupled {told['decoupled_m']:.3g}, rigid "
        f"{told['rigid_m']:.3g}), "
    )
    return [("sliding", words + ("still moving" if rest is None else f"at rest at {rest:.3g} s"))]


def _softening(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """How far softened ground has given way."""
    told = summary["softening"]
    if told is None:
        return []
    words = (
        f"permanent displacement up to {told['largest_m']:.3g} m, G/Gmax down to "
        f"{told['softest']:.3g} (stiffness-reduction estimate)"
    )
    return [("softening", words)]


def _seams(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """How well lapses join, and the balance of energy."""
    error, energy = summary["worst_seam_error"], summary["energy"]
    words = [] if error is None else [f"error of a seam at most {error:.1e} (estimate)"]
    if energy is not None and energy["worst_imbalance"] is not None:
        words.append(f"energy of a lapse off by at most {energy['worst_imbalance']:.1e} of input")
    return [("seams", ", ".join(words))] if words else []


def _base(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Peaks of the base as within and outcrop motions, where both are known."""
    return [
        (
            "base",
            f"{direction}: outcrop {motions['outcrop_pga_g']:.3g} g, "
            f"within {motions['within_pga_g']:.3g} g",
        )
        for direction, motions in summary["base"].items()
        if motions["outcrop_pga_g"] is not None
    ]


def _peaks(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Peaks of the components that move, one row a receiver."""
    rows: list[tuple[str, str]] = []
    everything = [
        (key, value or 0.0) for p in summary["peaks"].values() for key, value in p.items()
    ]
    # of displacement and acceleration each: what is less than this is rounding
    least = {
        letter: _ROUNDING * max((v for key, v in everything if key[0] == letter), default=0.0)
        for letter in "Au"
    }
    for name, peaks in list(summary["peaks"].items())[:_MOST]:
        text = "; ".join(
            f"{c}: total acceleration {_figure(peaks[f'A_{c}'], 1 / GRAVITY, least['A'])} g, "
            f"displacement {_figure(peaks[f'u_{c}'], 1e3, least['u'])} mm"
            for c in moving_components(summary, name)
        )
        rows.append(("peaks" if not rows else "", f"{name}  {text}"))
    left_out = len(summary["peaks"]) - len(rows)
    if left_out:
        rows.append(("", f"and {left_out} more receivers"))
    return rows


def _figure(value: float | None, factor: float, least: float) -> str:
    """A figure in other units; a receiver whose point has left the mesh has none."""
    if value is None:
        return "-"
    return f"{factor * value:.3g}" if value > least else "0"
