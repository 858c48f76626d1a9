# SPDX-License-Identifier: MIT
"""The report on what slid: safety, slip beside simpler estimates, whether it came to rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fenics_hytf.results.ground import snapshot_lapses
from fenics_hytf.results.reader import StoredResult
from fenics_hytf.results.report.findings import what_slid
from fenics_hytf.results.report.markup import (
    NOTHING,
    count,
    definitions,
    number,
    paragraphs,
    section,
    table,
)

Summary = Mapping[str, Any]


def sliding_section(stored: StoredResult, figures: str) -> str:
    """The section on sliding.

    Args:
        stored: The result.
        figures: Its figures as HTML.

    Returns:
        HTML; nothing where the scene does not call for sliding.
    """
    summary = stored.summary
    if summary["sliding"] is None:
        return ""
    return section(
        "Sliding",
        paragraphs([what_slid(summary)]),
        definitions(_figures(summary)),
        paragraphs(_words(stored)),
        figures,
        _table(summary),
    )


def _figures(summary: Summary) -> Iterator[tuple[str, str]]:
    told = summary["sliding"]
    yield "Factor of safety at rest", number(told["factor_of_safety"])
    first, last = number(told["yield_coefficient"]), number(told["yield_coefficient_last"])
    yield "k_y, first and last lapse", f"{first} and {last}"
    yield "Least k_y/k_max of a lapse", number(told["yield_over_peak"])
    yield "Slip, coupled", f"{number(told['slip_m'])} m"
    yield "Slip, decoupled", f"{number(told['decoupled_m'])} m"
    yield "Slip, rigid block", f"{number(told['rigid_m'])} m"
    rest = told["at_rest_s"]
    yield "Came to rest", "no" if rest is None else f"after {rest:.3g} s" if rest else "never moved"


def _words(stored: StoredResult) -> Iterator[str]:
    summary = stored.summary
    told = summary["sliding"]
    if told["slip_m"] > 0.0:
        yield (
            "The rigid block slides under the motion of the base (Newmark, 1965), the decoupled "
            "one under the response of ground that does not slip; both yield as the mechanism "
            "does, lapse by lapse. What the slip takes from the vibration, and gives to it, is in "
            "the coupled slip alone."
            + (
                " The ground of a lapse vibrates with what slip in the lapses before has left: the "
                "decoupled block of a record in one lapse slides otherwise."
                if len(summary["lapses"]) > 1
                else ""
            )
        )
    if told["yield_coefficient"] < 0:
        yield (
            "The ground did not stand at rest. A block on it runs away for as long as k_y is below "
            "nought, and no change of the mechanism slows it down: the blocks are no estimates "
            "of its slip then."
        )
    if told["note"] is not None:
        ratio = number(told["yield_over_peak"])
        yield f"In no lapse is k_y/k_max less than {ratio}: {told['note']}."
    if summary["scene"]["mesh"]["kind"] != "column" and not snapshot_lapses(stored):
        lapses = count(len(summary["lapses"]), "lapse")
        yield (
            f"There are no pictures of the ground: output.every asked for none of its {lapses} to "
            "be written."
        )


def _table(summary: Summary) -> str:
    """A row a lapse, and the sums."""
    head = (
        "Lapse",
        "Start [s]",
        "k_y [-]",
        "Peak driving [g]",
        "k_y/k_max [-]",
        "Slip, coupled [m]",
        "Decoupled [m]",
        "Rigid block [m]",
        "Rate at end [m/s]",
        "Iterations [-]",
    )
    rows: list[tuple[object, ...]] = [
        (lapse["index"], f"{lapse['start_time_s']:.4g}", *_row(lapse["slip"]))
        for lapse in summary["lapses"]
    ]
    if len(rows) > 1:
        sums = (number(summary["sliding"][f"{name}_m"]) for name in ("slip", "decoupled", "rigid"))
        rows.append(("all", "", "", "", "", *sums, "", ""))
    marked = any(lapse["slip"]["note"] for lapse in summary["lapses"])
    note = f"* {_capital(_note(summary))}." if marked else ""
    return table("Slip, lapse by lapse.", head, rows, words=(), dense=True, note=note)


def _row(slip: Mapping[str, Any]) -> tuple[str, ...]:
    ratio = slip["yield_over_peak"]
    return (
        number(slip["yield_coefficient"]),
        number(slip["peak_driving_g"]),
        (NOTHING if ratio is None else number(ratio)) + ("*" if slip["note"] else ""),
        *(number(slip[f"{name}_m"]) for name in ("slip", "decoupled", "rigid")),
        number(slip["end_rate_m_s"]),
        str(slip["iterations"]),
    )


def _note(summary: Summary) -> str:
    return next(str(lapse["slip"]["note"]) for lapse in summary["lapses"] if lapse["slip"]["note"])


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
