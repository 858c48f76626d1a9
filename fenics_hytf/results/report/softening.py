# SPDX-License-Identifier: MIT
"""The report on what softened ground has given way by: an estimate, and said to be one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fenics_hytf.results.report.markup import number, paragraphs, section, table

Summary = Mapping[str, Any]


def softening_section(summary: Summary) -> str:
    """The section on softening.

    Args:
        summary: ``summary.json``.

    Returns:
        HTML; nothing where the scene does not call for softening.
    """
    told = summary["softening"]
    if told is None:
        return ""
    words = (
        f"The ground has given way by {number(told['largest_m'])} m where it has moved farthest; "
        f"its modulus has come down to {number(told['softest'])} of the small-strain one where it "
        f"is softest. This is {told['note']}. Displacements elsewhere in this report are those of "
        "the vibration."
    )
    head = ("Receiver", *(f"Along {component} [m]" for component in summary["components"]))
    rows = [(name, *map(number, moved)) for name, moved in told["receivers_m"].items()]
    caption = "Permanent displacement of the receivers, estimated."
    return section("Permanent displacement", paragraphs([words]), table(caption, head, rows))
