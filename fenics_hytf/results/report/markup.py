# SPDX-License-Identifier: MIT
"""Pieces of HTML: tables, definitions, and numbers as a person reads them.

Every text passes through ``html.escape`` here; what calls these gives plain text.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from html import escape

NOTHING = "—"
"""Stands where a figure does not exist."""

Cell = object
Row = Sequence[Cell]


def table(
    caption: str,
    head: Row,
    rows: Iterable[Row],
    words: Collection[int] = (0,),
    dense: bool = False,
    note: str = "",
) -> str:
    """A table with its caption above.

    Args:
        caption: What it holds.
        head: Names of the columns, with units.
        rows: Its rows.
        words: Columns that are words; the others are figures, set to the right.
        dense: Whether it is set small, for many columns.
        note: A line below it.

    Returns:
        HTML; nothing where there are no rows.
    """

    def cells(row: Row, tag: str) -> str:
        return "".join(
            f"<{tag}{'' if i in words else ' class=n'}>{text(cell)}</{tag}>"
            for i, cell in enumerate(row)
        )

    lines = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in rows)
    if not lines:
        return ""
    kind = ' class="dense"' if dense else ""
    below = f'<p class="quiet">{text(note)}</p>' if note else ""
    return (
        f'<div class="wide"><table{kind}><caption>{text(caption)}</caption>'
        f"<thead><tr>{cells(head, 'th')}</tr></thead><tbody>{lines}</tbody></table>{below}</div>"
    )


def section(heading: str, *parts: str) -> str:
    """A section with its heading; nothing where no part holds anything."""
    body = "\n".join(part for part in parts if part)
    return f"<section><h2>{text(heading)}</h2>\n{body}</section>" if body else ""


def paragraphs(lines: Iterable[str]) -> str:
    """Paragraphs of plain text."""
    return "".join(f"<p>{text(line)}</p>" for line in lines)


def definitions(pairs: Iterable[tuple[str, str]]) -> str:
    """A list of names and what they stand for."""
    items = "".join(f"<dt>{text(name)}</dt><dd>{text(value)}</dd>" for name, value in pairs)
    return f"<dl>{items}</dl>"


def text(value: Cell) -> str:
    """Any value as text that HTML shows as it is."""
    return escape(str(value))


def number(value: float | None, digits: int = 3) -> str:
    """A figure a person reads: significant digits, no exponent where it can be avoided."""
    if value is None:
        return NOTHING
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 10**digits:
        return f"{value:#.{digits}g}".rstrip(".")
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e6 else f"{value:.{digits - 1}e}"


def span(ends: Sequence[float | None], factor: float = 1.0) -> str:
    """A range; one number where its ends are alike.

    Args:
        ends: The smallest value and the largest.
        factor: What they are multiplied by.
    """
    smallest, largest = (NOTHING if end is None else number(factor * end) for end in ends)
    return smallest if smallest == largest else f"{smallest} to {largest}"


def power(value: float | None) -> str:
    """A small figure of which the order counts."""
    return NOTHING if value is None else "0" if value == 0 else f"{value:.1e}"


def thousands(value: int) -> str:
    """A count with narrow spaces between its thousands."""
    return f"{value:,}".replace(",", "\u202f")


def seconds(value: float) -> str:
    """A time that something took."""
    if value >= 120:
        return f"{value / 60:.1f} min"
    return f"{value:.2f} s" if value < 10 else f"{value:.0f} s"


def count(value: int, noun: str) -> str:
    """A number of things."""
    return f"{value} {noun}" + ("" if value == 1 else "s")


def listed(words: Sequence[str]) -> str:
    """Words as a sentence lists them: ``a, b and c``."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
