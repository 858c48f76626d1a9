# SPDX-License-Identifier: MIT
"""Figures and report from a result folder alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fenics_hytf.motion.files import replace_file, replacing
from fenics_hytf.results.reader import read_result

REPORT = "report.html"


def publish(folder: Path, summary: dict[str, Any] | None = None) -> list[str]:
    """Draw the figures of a result and write ``report.html``, all into its folder.

    They are put there once all are drawn: those of before stay where one cannot be.

    Args:
        folder: Holds the tables, and ``summary.json`` unless the summary is given.
        summary: The summary of a result that is about to be finished.

    Returns:
        Names of the files written.

    Raises:
        ResultError: If the folder holds no finished result, or one that cannot be read.
    """
    # matplotlib takes half a second to load; runs without figures do without
    from fenics_hytf.results.figures.drawing import draw_figures
    from fenics_hytf.results.report.document import report

    stored = read_result(folder, summary)
    drawings = draw_figures(stored)
    page = report(stored, drawings)
    for drawing in drawings:
        with replacing(folder / drawing.file) as part:
            part.write_bytes(drawing.picture)
    replace_file(folder / REPORT, page)
    return [*(drawing.file for drawing in drawings), REPORT]
