# SPDX-License-Identifier: MIT
"""``report.html``: one self-contained page for a person. No script, no file beside it.

Every text that is not this module's own passes through ``html.escape``.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from fenics_hytf.motion import GRAVITY
from fenics_hytf.results.figures import Drawing
from fenics_hytf.results.folder import replace_file
from fenics_hytf.results.page import STYLE
from fenics_hytf.results.reader import StoredResult
from fenics_hytf.results.summary import component_peaks

NOTHING = "—"
"""Stands where a figure does not exist."""

_ROUNDING = 1e-9  # of the largest peak: below, a component does not move

Cell = object
Row = Sequence[Cell]


def write_report(stored: StoredResult, drawings: Sequence[Drawing]) -> None:
    """Write the report into the result's folder.

    Args:
        stored: The result.
        drawings: Figures in the folder, in the order to show them.
    """
    replace_file(stored.folder / "report.html", report(stored, drawings))


def report(stored: StoredResult, drawings: Sequence[Drawing]) -> str:
    """The report as HTML.

    Args:
        stored: The result.
        drawings: Figures in the folder, in the order to show them.

    Returns:
        The page, figures included.
    """
    summary = stored.summary
    title = summary["title"] or "Ground response"
    body = [
        f"<header><h1>{escape(title)}</h1>{_byline(summary)}</header>",
        _key_figures(summary),
        _warnings(summary["warnings"]),
        _peaks(summary),
        *(_figure(stored, drawing) for drawing in drawings),
        _scene(summary),
        _lapses(summary),
        _work(summary),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(part for part in body if part)
        + "\n</body>\n</html>\n"
    )


def _byline(summary: Mapping[str, Any]) -> str:
    version = summary["versions"]["fenics_hytf"] or "(version unknown)"
    ranks = _count(summary["ranks"], "rank")
    written = summary["written"].replace("T", " ").replace("+00:00", " UTC")
    return f'<p class="quiet">fenics_hytf {_text(version)} · {_text(written)} · {ranks}</p>'


def _key_figures(summary: Mapping[str, Any]) -> str:
    lapses = summary["lapses"]
    iterations = sum(lapse["iterations"] for lapse in lapses)
    residuals = [r for lapse in lapses if (r := lapse["worst_residual"]) is not None]
    figures = [
        *((f"input {m['direction']}", f"{_number(m['pga_g'])} g") for m in summary["motions"]),
        ("cells", _thousands(summary["sizes"]["cells"])),
        ("unknowns", _thousands(summary["sizes"]["unknowns"])),
        ("material points", _thousands(summary["sizes"]["points"])),
        ("lines solved", _thousands(sum(lapse["solved_lines"] for lapse in lapses))),
        ("factorisations", _thousands(summary["work"]["factorisations"])),
    ]
    if iterations:
        figures.append(("iterations", _thousands(iterations)))
    if residuals:
        figures.append(("worst residual", f"{max(residuals):.1e}"))
    figures.append(("wall time", _seconds(sum(summary["wall_s"].values()))))
    items = "".join(
        f"<div><strong>{_text(value)}</strong><span>{_text(name)}</span></div>"
        for name, value in figures
    )
    return f'<section class="figures">{items}</section>'


def _warnings(warnings: Sequence[str]) -> str:
    if not warnings:
        return ""
    items = "".join(f"<li>{escape(text)}</li>" for text in warnings)
    return (
        f'<section class="warnings"><h2>Before using these results</h2><ul>{items}</ul></section>'
    )


def _peaks(summary: Mapping[str, Any]) -> str:
    """Peaks by receiver, and amplification over the input where there is one in the direction."""
    pga = {motion["direction"]: motion["pga_m_s2"] for motion in summary["motions"]}
    rows = []
    moving = _moving(summary)
    for name, peaks in summary["peaks"].items():
        place = ", ".join(f"{x:g}" for x in summary["receivers"][name]["place_m"])
        rides = " (rides a point)" if summary["receivers"][name]["rides"] else ""
        for i, component in enumerate(moving):
            total = peaks[f"A_{component}"]
            scaled = _number(total / pga[component]) if pga.get(component) else NOTHING
            rows.append(
                (
                    name if i == 0 else "",
                    place + rides if i == 0 else "",
                    component,
                    _number(total / GRAVITY),
                    scaled,
                    _number(peaks[f"a_{component}"] / GRAVITY),
                    _number(peaks[f"v_{component}"]),
                    _number(1e3 * peaks[f"u_{component}"]),
                )
            )
    if not rows:
        return "<section><h2>Peaks</h2><p>The scene has no receivers.</p></section>"
    head = (
        "Receiver",
        "Place [m]",
        "Direction",
        "Total acc. [g]",
        "over input",
        "Relative acc. [g]",
        "Relative vel. [m/s]",
        "Relative disp. [mm]",
    )
    still = [c for c in summary["components"] if c not in moving]
    note = f"<p class=quiet>No motion in {_text(', '.join(still))}.</p>" if still else ""
    return f"<section><h2>Peaks</h2>{_table(head, rows, text=3)}{note}</section>"


def _moving(summary: Mapping[str, Any]) -> list[str]:
    """Components that move by more than rounding."""
    peaks = component_peaks(summary)
    largest = max(peaks.values(), default=0.0)
    return [c for c, peak in peaks.items() if peak > _ROUNDING * largest]


def _figure(stored: StoredResult, drawing: Drawing) -> str:
    data = base64.b64encode((stored.folder / drawing.file).read_bytes()).decode("ascii")
    return (
        f"<section><h2>{escape(drawing.title)}</h2><figure>"
        f'<img alt="{escape(drawing.title)}" src="data:image/png;base64,{data}">'
        f"<figcaption>{escape(drawing.caption)}</figcaption></figure></section>"
    )


def _scene(summary: Mapping[str, Any]) -> str:
    settings = _definitions(_settings(summary))
    tables = _layers(summary) + _soils(summary) + _motions(summary)
    return f"<section><h2>What was run</h2>{settings}{tables}</section>"


def _layers(summary: Mapping[str, Any]) -> str:
    layers = summary["scene"]["mesh"].get("layers")
    if not layers:
        return ""
    head = ("Layer, top down", "Thickness [m]", "Cells")
    rows = [(i["soil"], f"{i['thickness_m']:g}", i["cells"]) for i in layers]
    return "<h3>Layers</h3>" + _table(head, rows)


def _soils(summary: Mapping[str, Any]) -> str:
    head = (
        "Soil",
        "Density [kg/m³]",
        "Vs [m/s]",
        "G [MPa]",
        "Poisson [-]",
        "Small-strain damping [%]",
    )
    rows = [
        (
            name,
            _number(soil["density_kg_m3"], 5),
            _number(soil["shear_wave_velocity_m_s"], 4),
            _number(soil["shear_modulus_pa"] / 1e6, 4),
            f"{soil['poisson']:g}",
            _number(100 * soil["damping"]),
            soil["curves"] or NOTHING,
        )
        for name, soil in summary["scene"]["soils"].items()
    ]
    return "<h3>Soils, at small strain</h3>" + _table((*head, "Curves"), rows)


def _motions(summary: Mapping[str, Any]) -> str:
    head = ("Motion", "Direction", "PGA [g]", "Time step [s]", "Samples", "Given as")
    rows = [
        (
            motion["name"],
            motion["direction"],
            _number(motion["pga_g"]),
            f"{motion['dt_s']:g}",
            motion["samples"],
            motion["input"],
        )
        for motion in summary["motions"]
    ]
    return "<h3>Motion</h3>" + _table(head, rows)


def _settings(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    scene = summary["scene"]
    effects = ", ".join(name.replace("_", " ") for name in summary["effects"]) or "none"
    boundary = ", ".join(f"{name} {kind}" for name, kind in scene["boundary"].items())
    solver = scene["solver"]
    limit = solver["max_frequency"]
    settings = [
        ("Scene", f"hash {summary['scene_hash'][:12]}"),
        ("Effects", effects),
        ("Mesh", scene["mesh"]["text"]),
        (
            "Boundaries",
            (boundary + "; " if boundary else "") + "if not named, base rigid, others free",
        ),
        ("Complex modulus", f"{solver['complex_modulus']}, {solver['keep']} kept"),
        (
            "Sweep",
            f"{solver['sweep']}, tolerance {solver['tolerance']:g}, "
            + ("to the Nyquist frequency" if limit is None else f"to {limit:g} Hz"),
        ),
        ("Lapses", f"{len(summary['lapses'])}, {scene['continuity']}"),
    ]
    if scene["loop_tolerance"] is not None:
        text = f"strain ratio {scene['strain_ratio']:g}, tolerance {scene['loop_tolerance']:g}"
        settings.insert(2, ("Equivalent linear", text))
    if scene["rayleigh"] is not None:
        text = f"alpha {scene['rayleigh']['alpha']:g} 1/s, beta {scene['rayleigh']['beta']:g} s"
        settings.insert(2, ("Rayleigh damping", text))
    return settings


def _lapses(summary: Mapping[str, Any]) -> str:
    head = (
        "Lapse",
        "Start [s]",
        "Samples",
        "Lines excited",
        "Lines solved",
        "Factori\u00adsations",
        "Solves",
        "Itera\u00adtions",
        "Final change",
        "Worst residual",
        "Points parked",
        "Points lost",
        "Mass im\u00adbalance",
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
            _power(lapse["final_change"]),
            _power(lapse["worst_residual"]),
            lapse["points_parked"],
            lapse["points_lost"],
            _power(lapse["mass_ledger"]["imbalance"]),
        )
        for lapse in summary["lapses"]
    ]
    return f"<section><h2>Lapses</h2>{_table(head, rows, text=0, dense=True)}</section>"


def _work(summary: Mapping[str, Any]) -> str:
    work, wall = summary["work"], summary["wall_s"]
    total = sum(wall.values()) or 1.0
    phases = [(name, _seconds(s), f"{100 * s / total:.0f} %") for name, s in wall.items()]
    counts = [
        ("factorisations", _thousands(work["factorisations"])),
        ("solves", _thousands(work["solves"])),
        ("excited lines", _thousands(work["excited_lines"])),
        ("inverse mappings", _thousands(work["inverse_mappings"])),
        *((f"assemblies, {name}", _thousands(n)) for name, n in work["assemblies"].items()),
    ]
    versions = [(name, value) for name, value in summary["versions"].items() if value]
    memory = _number(summary["peak_memory_bytes"] / 2**20)
    return (
        '<section><h2>Work</h2><div class="columns">'
        + _table(("Phase", "Wall time", "Share"), phases)
        + _table(("Count", ""), counts)
        + _table(("Program", "Version"), versions, text=2)
        + f"</div><p>Peak memory of a rank: {memory} MiB.</p></section>"
    )


def _table(head: Row, rows: Iterable[Row], text: int = 1, dense: bool = False) -> str:
    """A table whose first ``text`` columns are words and whose others are figures."""

    def cells(row: Row, tag: str) -> str:
        return "".join(
            f"<{tag}{'' if i < text else ' class=n'}>{_text(cell)}</{tag}>"
            for i, cell in enumerate(row)
        )

    lines = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in rows)
    kind = ' class="dense"' if dense else ""
    return (
        f'<div class="wide"><table{kind}><thead><tr>{cells(head, "th")}</tr></thead>'
        f"<tbody>{lines}</tbody></table></div>"
    )


def _definitions(pairs: Iterable[tuple[str, str]]) -> str:
    items = "".join(f"<dt>{_text(name)}</dt><dd>{_text(text)}</dd>" for name, text in pairs)
    return f"<dl>{items}</dl>"


def _text(value: Cell) -> str:
    return escape(str(value))


def _number(value: float | None, digits: int = 3) -> str:
    """A figure a person reads: significant digits, no exponent where it can be avoided."""
    if value is None:
        return NOTHING
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 10**digits:
        return f"{value:#.{digits}g}".rstrip(".")
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e6 else f"{value:.{digits - 1}e}"


def _power(value: float | None) -> str:
    return NOTHING if value is None else "0" if value == 0 else f"{value:.1e}"


def _thousands(value: int) -> str:
    return f"{value:,}".replace(",", "\u202f")


def _seconds(value: float) -> str:
    if value >= 120:
        return f"{value / 60:.1f} min"
    return f"{value:.2f} s" if value < 10 else f"{value:.0f} s"


def _count(value: int, noun: str) -> str:
    return f"{value} {noun}" + ("" if value == 1 else "s")
