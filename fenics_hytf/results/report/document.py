# SPDX-License-Identifier: MIT
"""``report.html``: one self-contained page for a person. No script, no file beside it.

Every text that is not this package's own passes through ``html.escape``.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from fenics_hytf.motion import GRAVITY
from fenics_hytf.results.figures.drawing import Drawing
from fenics_hytf.results.reader import StoredResult
from fenics_hytf.results.report.conventions import method
from fenics_hytf.results.report.findings import (
    base_table,
    intensity_table,
    iterations_table,
    layers_table,
    peaks_table,
)
from fenics_hytf.results.report.input import input_section
from fenics_hytf.results.report.markup import number, paragraphs, section, text
from fenics_hytf.results.report.seams import seams_section
from fenics_hytf.results.report.sliding import sliding_section
from fenics_hytf.results.report.softening import softening_section
from fenics_hytf.results.report.style import STYLE
from fenics_hytf.results.report.work import work_section
from fenics_hytf.results.summary import component_peaks

Summary = Mapping[str, Any]


def report(stored: StoredResult, drawings: Sequence[Drawing]) -> str:
    """The report as HTML.

    Args:
        stored: The result.
        drawings: Its figures, in the order to show them.

    Returns:
        The page, figures included.
    """
    summary = stored.summary
    title = summary["title"] or "Ground response"
    figures = {
        part: "\n".join(_figure(drawing) for drawing in drawings if drawing.part == part)
        for part in ("base", "motion", "sliding", "ground", "seams", "loop")
    }
    body = [
        f"<header><h1>{escape(title)}</h1>{_byline(summary)}</header>",
        _key_figures(summary),
        _warnings(summary["warnings"]),
        section("Method and conventions", paragraphs(method(summary))),
        input_section(summary),
        section("Motion of the base", base_table(summary), figures["base"]),
        section(
            "Motion of the ground",
            peaks_table(summary),
            intensity_table(summary),
            figures["motion"],
        ),
        sliding_section(stored, figures["sliding"]),
        softening_section(summary),
        section("Strain, stress and stiffness", figures["ground"]),
        seams_section(summary, figures["seams"]),
        _convergence(stored, figures["loop"]),
        work_section(summary),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(part for part in body if part)
        + "\n</body>\n</html>\n"
    )


def _convergence(stored: StoredResult, figure: str) -> str:
    """The equivalent-linear loop; nothing where there was none."""
    summary = stored.summary
    if not any(lapse["iterations"] for lapse in summary["lapses"]):
        return ""
    return section("Convergence", layers_table(summary), figure, iterations_table(stored))


def _byline(summary: Summary) -> str:
    version = summary["versions"]["fenics_hytf"] or "(version unknown)"
    written = summary["written"].replace("T", " ").replace("+00:00", " UTC")
    return f'<p class="quiet">Ground response · fenics_hytf {text(version)} · {text(written)}</p>'


def _key_figures(summary: Summary) -> str:
    """What is asked for first: input, largest response, slip, base."""
    figures = [
        (f"input {m['direction']}, {m['input']}, PGA", f"{number(m['pga_g'])} g")
        for m in summary["motions"]
    ]
    figures += [
        (f"largest PGA of a receiver, {component}", f"{number(peak / GRAVITY)} g")
        for component, peak in component_peaks(summary).items()
        if component in summary["directions"] and peak > 0.0
    ]
    sliding = summary["sliding"]
    if sliding is not None:
        figures.append(("slip", f"{number(sliding['slip_m'])} m"))
        figures.append(("factor of safety at rest", number(sliding["factor_of_safety"])))
    if summary["softening"] is not None:
        moved = f"{number(summary['softening']['largest_m'])} m"
        figures.append(("largest permanent displacement, estimated", moved))
    layers = [layer for lapse in summary["lapses"] for layer in lapse["layers"]]
    strain = max((i["effective_strain"][1] or 0.0 for i in layers), default=0.0)
    stiffness = min((i["g_over_gmax"][0] or 1.0 for i in layers), default=1.0)
    if summary["scene"]["strain_ratio"] is None:
        name = "largest shear strain" + ("" if sliding is None else ", without slip")
        figures.append((name, f"{number(100 * strain)} %"))
    else:
        figures.append(("largest effective strain", f"{number(100 * strain)} %"))
        figures.append(("smallest G/Gmax", number(stiffness)))
    figures.append(("base", str(summary["scene"]["boundary"].get("base", "rigid"))))
    items = "".join(
        f"<div><strong>{text(value)}</strong><span>{text(name)}</span></div>"
        for name, value in figures
    )
    return f'<div class="figures">{items}</div>'


def _warnings(warnings: Sequence[str]) -> str:
    if not warnings:
        return ""
    items = "".join(f"<li>{text(warning)}</li>" for warning in warnings)
    heading = "<strong>Before using these results</strong>"
    return f'<div class="warnings">{heading}<ul>{items}</ul></div>'


def _figure(drawing: Drawing) -> str:
    ending = drawing.file.rpartition(".")[2]
    data = base64.b64encode(drawing.picture).decode("ascii")
    lazy = ' loading="lazy"' if ending == "gif" else ""
    source = f"data:image/{ending};base64,{data}"
    return (
        f'<figure><img alt="{text(drawing.title)}"{lazy} src="{source}">'
        f"<figcaption><strong>{text(drawing.title)}.</strong> {text(drawing.caption)}</figcaption>"
        "</figure>"
    )
