# SPDX-License-Identifier: MIT
"""The report on what lapses handed over to each other: seam errors and energy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fenics_hytf.results.report.markup import NOTHING, number, paragraphs, power, section, table
from fenics_hytf.simulation.margins import PUMPED, kept_map

Summary = Mapping[str, Any]

_ROUNDING = 1e-9  # of the largest energy


def seams_section(summary: Summary, figure: str) -> str:
    """The section on seams and energy.

    Args:
        summary: ``summary.json``.
        figure: The figure of the energy as HTML, or nothing.

    Returns:
        HTML; nothing where nothing was handed over and there is no energy to tell.
    """
    return section("Seams and energy", paragraphs(_words(summary)), figure, _table(summary))


def _words(summary: Summary) -> Iterator[str]:
    error, energy = summary["worst_seam_error"], summary["energy"]
    if error is not None:
        errors = [lapse["seam_error"] or 0.0 for lapse in summary["lapses"]]
        worst = max(range(len(errors)), key=errors.__getitem__)
        yield (
            f"The seam error is estimated at {_percent(error)} % or less: at the start of a lapse "
            "no point's displacement or velocity is farther off what it carried over than that "
            f"part of the largest one in the lapse. The worst is lapse {worst}. Lines that are "
            "left out above the highest one, and lapses that are short for them, make it larger."
        )
    if energy is None:
        return
    text = (
        f"{number(energy['input'])} {energy['unit']} came in at the base, "
        f"{_share(energy, 'damping')} of it was lost in the ground and in dashpots"
    )
    if energy["slip"]:
        text = _slide_words(energy)
    elif len(summary["lapses"]) > 1:
        text += (
            f", {_share(energy, 'rest')} went into stress that faded after the moduli had changed, "
            f"and jumps at the seams brought {_share(energy, 'seam')}"
        )
        if energy["seam"] - energy["rest"] > PUMPED * abs(energy["input"]):
            text += (
                ". That moduli changed from lapse to lapse has brought far more energy than "
                "the shaking: moduli that swing so far pump the ground up, beyond the edge of the "
                f"stability map ({kept_map('lapses')}). Compare with fewer, longer lapses"
            )
    worst = energy["worst_imbalance"]
    balanced = NOTHING if worst is None else power(worst)
    yield f"{text}. The balance of no lapse is off by more than {balanced} of the input."
    yield (
        "The balance is that of the motion relative to the one that is given: input is "
        "−∫ a rᵀMv dt, with a the given acceleration in the direction r, v the relative velocity "
        "and M the mass. It is computed beside the response and does not close by itself."
    )


def _slide_words(energy: Mapping[str, Any]) -> str:
    """Where the energy went of ground that slid; gravity may have brought most of it."""
    largest = max(abs(energy[name]) for name in ("input", "damping", "slip", "seam"))

    def amount(name: str) -> str:
        value = energy[name] if abs(energy[name]) > _ROUNDING * largest else 0.0
        return f"{number(abs(value) if name == 'slip' else value)} {energy['unit']}"

    fell = energy["slip"] < 0
    return (
        f"{amount('input')} came in at the base; "
        + (
            f"gravity brought {amount('slip')} more than sliding took"
            if fell
            else f"{amount('slip')} went into sliding, beyond what gravity brought"
        )
        + f"; {amount('damping')} was lost in the ground and in dashpots, {amount('rest')} went "
        f"into stress that faded, and jumps at the seams brought {amount('seam')}"
    )


def _table(summary: Summary) -> str:
    """A row a lapse, and the sums."""
    lapses, energy = summary["lapses"], summary["energy"]
    if energy is None and summary["worst_seam_error"] is None:
        return ""
    head = ["Lapse", "Start [s]", "Seam error [-]"]
    rows: list[list[object]] = [
        [lapse["index"], f"{lapse['start_time_s']:g}", power(lapse["seam_error"])]
        for lapse in lapses
    ]
    if energy is not None:
        unit = energy["unit"]
        slides = summary["sliding"] is not None
        names = (
            *("Input", "Lost in damping", "Into fading stress"),
            *(("Into sliding",) if slides else ()),
            *("In motion, end", "In strain, end", "Jump at seam", "Imbalance"),
        )
        head += [f"{name} [{unit}]" for name in names]
        for row, lapse in zip(rows, lapses, strict=True):
            row += _energies(lapse["energy"], slides)
        if len(lapses) > 1:
            sums = ("input", "damping", "rest", *(("slip",) if slides else ()), None, None, "seam")
            values = [NOTHING if name is None else number(energy[name]) for name in sums]
            rows.append(["all", "", "", *values, power(energy["imbalance"])])
    title = "Seam errors." if energy is None else "Seams and energy, lapse by lapse."
    return table(title, head, rows, words=(), dense=True)


def _energies(energy: Mapping[str, Any], slides: bool) -> list[str]:
    names = ("input", "damping", "rest", *(("slip",) if slides else ()))
    ends = energy["kinetic"][1], energy["strain"][1]
    values = (*(energy[name] for name in names), *ends, energy["seam"])
    return [*(number(value) for value in values), power(energy["imbalance"])]


def _share(energy: Mapping[str, Any], name: str) -> str:
    """Part of the input."""
    return f"{_percent(energy[name] / energy['input'])} %" if energy["input"] else NOTHING


def _percent(part: float) -> str:
    """Two digits."""
    return f"{100 * part:.2g}"
