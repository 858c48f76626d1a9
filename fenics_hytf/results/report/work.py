# SPDX-License-Identifier: MIT
"""The report on the computation: lapses, counts, wall time, versions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fenics_hytf.results.report.markup import (
    NOTHING,
    count,
    number,
    power,
    seconds,
    section,
    table,
    thousands,
)

Summary = Mapping[str, Any]


def work_section(summary: Summary) -> str:
    """The section on the computation.

    Args:
        summary: ``summary.json``.

    Returns:
        HTML.
    """
    memory = number(summary["peak_memory_bytes"] / 2**20)
    ranks = count(summary["ranks"], "rank")
    return section(
        "Computation",
        _lapses(summary),
        f'<div class="columns">{_phases(summary)}{_counts(summary)}{_versions(summary)}</div>',
        f"<p>{ranks}; peak memory of a rank {memory} MiB.</p>",
    )


def _lapses(summary: Summary) -> str:
    head = (
        "Lapse",
        "Start [s]",
        "Samples [-]",
        "Lines excited [-]",
        "Lines solved [-]",
        "Factori\u00adsations [-]",
        "Solves [-]",
        "Itera\u00adtions [-]",
        "Final change [-]",
        "Worst residual [-]",
        "Points parked [-]",
        "Points lost [-]",
        "Mass im\u00adbalance [-]",
    )
    rows = [
        (
            lapse["index"],
            f"{lapse['start_time_s']:g}",
            lapse["samples"],
            lapse["excited_lines"],
            lapse["solved_lines"],
            lapse["factorisations"],
            lapse["solves"],
            lapse["iterations"] or NOTHING,
            power(lapse["final_change"]),
            power(lapse["worst_residual"]),
            lapse["points_parked"],
            lapse["points_lost"],
            power(lapse["mass_ledger"]["imbalance"]),
        )
        for lapse in summary["lapses"]
    ]
    return table("Lapses.", head, rows, words=(), dense=True)


def _phases(summary: Summary) -> str:
    wall = summary["wall_s"]
    total = sum(wall.values()) or 1.0
    rows = [(name, seconds(s), f"{100 * s / total:.0f}") for name, s in wall.items()]
    return table("Wall time.", ("Phase", "Time", "Share [%]"), rows)


def _counts(summary: Summary) -> str:
    work, sizes = summary["work"], summary["sizes"]
    rows = [
        *((name, thousands(n)) for name, n in sizes.items()),
        ("factorisations", thousands(work["factorisations"])),
        ("solves", thousands(work["solves"])),
        ("inverse mappings", thousands(work["inverse_mappings"])),
        *((f"assemblies, {name}", thousands(n)) for name, n in work["assemblies"].items()),
    ]
    return table("Sizes and counts.", ("Of", "Number [-]"), rows)


def _versions(summary: Summary) -> str:
    rows = [(name, value) for name, value in summary["versions"].items() if value]
    return table("Programs.", ("Program", "Version"), rows, words=(0, 1))
