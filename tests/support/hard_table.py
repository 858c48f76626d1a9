# SPDX-License-Identifier: MIT
"""The table of the hard cases: what each guards, what was measured, and the limit.

Figures of one name are one row of their case, which shows the one nearest to its limit. Rows of
runs on other numbers of ranks come from a file that those have written.
"""

import csv
import math
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from support.figures import Figure

TITLES = {
    1: "Inverse mapping of badly shaped cells",
    2: "The quadrilateral in which Newton from a vertex finds the wrong root",
    3: "Aspect ratios, near triangles, sizes of cells, far origins",
    4: "Points outside, and coordinates that are no numbers",
    5: "Points on vertices, edges and facets have one owner",
    6: "Curved cells are found in, concave and inverted ones refused",
    7: "Long jumps across ranks, and points that leave the mesh",
    8: "Ranks without points, and a crowd in one cell",
    9: "One point in a cell that hangs on a side, or on a node",
    10: "A block that moves through the grid, and cells cut to slivers",
    11: "Units of length",
    12: "A ghost term neither rings nor shifts a pillar",
    13: "Void beside stiff ground",
    14: "A clump that has come off",
    15: "Undamped resonances, hit exactly",
    16: "The line at rest, and an acceleration with a mean",
    17: "A pulse at the end of a lapse is not felt before it",
    18: "Many lapses do as one",
    19: "Ground a million times as stiff beside soft ground",
    20: "Real results from complex algebra",
    21: "The reduced sweep where it is hardest",
    22: "Soil that keeps its volume does not lock",
    23: "Ground that buckles under its own weight stops the run",
    24: "Ground at rest stays at rest",
    25: "Points that cross cells under stress",
    26: "Velocities of points that no node sees",
    27: "Convection applies increments, not totals",
    28: "Rotation makes neither volume nor stress",
    29: "An equivalent-linear loop that would chatter",
    30: "Volumes that collapse; every joule accounted for",
    31: "A restart is the run that was not stopped",
    32: "Killed, or out of room, while a checkpoint is written",
    33: "What slides and softens, whatever the number of lapses",
}
MOST_EXPECTED_FAILURES = 2
WIDTH = 100
_NAME = 58


@dataclass(frozen=True)
class Row:
    """A figure of a test.

    Attributes:
        case: Number of the hard case; 0 beside the cases.
        test: That has measured it, with its parameters.
        ranks: It ran on.
        figure: The figure.
        expected_failure: Why the limit is not kept; empty where it has to be.
    """

    case: int
    test: str
    ranks: int
    figure: Figure
    expected_failure: str = ""


def write(path: Path, rows: Iterable[Row]) -> None:
    """Add rows to a CSV file."""
    new = not path.exists() or not path.stat().st_size
    with path.open("a", newline="") as file:
        writer = csv.writer(file)
        if new:
            names = "name", "measured", "limit", "unit", "at_least"
            writer.writerow(["case", "test", "ranks", "expected_failure", *names])
        for row in rows:
            values = asdict(row.figure).values()
            writer.writerow([row.case, row.test, row.ranks, row.expected_failure, *values])


def read(path: Path) -> list[Row]:
    """Rows of such a file; none without one."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return [
            Row(
                int(line["case"]),
                line["test"],
                int(line["ranks"]),
                Figure(
                    line["name"],
                    float(line["measured"]),
                    float(line["limit"]),
                    line["unit"],
                    line["at_least"] == "True",
                ),
                line["expected_failure"],
            )
            for line in csv.DictReader(file)
        ]


def lines(rows: Iterable[Row]) -> Iterator[tuple[str, dict[str, bool]]]:
    """The table line by line, each with its markup."""
    by_case: dict[int, dict[str, list[Row]]] = {}
    for row in rows:
        by_case.setdefault(row.case, {}).setdefault(row.figure.name, []).append(row)
    head = (
        f"{'case, what it guards':<{_NAME}} {'figure':>10}    {'limit':<9} {'margin':>7} {'of':>4}"
    )
    yield head, {"bold": True}
    for case in sorted(by_case, key=lambda number: number or math.inf):
        title = f"{case:2}  {TITLES[case]}" if case else "    Beside the cases"
        yield title, {"bold": True}
        for group in by_case[case].values():
            yield from _line(group)


def _line(group: list[Row]) -> Iterator[tuple[str, dict[str, bool]]]:
    """The figure nearest to its limit, its margin, and of how many it is the worst."""
    worst = min(group, key=lambda row: row.figure.margin)
    found = worst.figure
    ranks = sorted({row.ranks for row in group})
    name = found.name + (f" [{found.unit}]" if found.unit else "")
    if len(ranks) > 1:
        name += f", {ranks[0]} to {ranks[-1]} ranks"
    numbers = f"{found.measured:10.3g} {found.sign} {found.limit:<9.3g} {_margin(found):>7}"
    naive = found.name.startswith("naive")
    markup = {"yellow": True} if worst.expected_failure else {"light": True} if naive else {}
    if not found.good and not worst.expected_failure:
        markup = {"red": True}
    *before, last = textwrap.wrap(name, _NAME - 4, subsequent_indent="  ")
    for part in before:
        yield f"    {part}", markup
    yield f"    {last:<{_NAME - 4}} {numbers} {len(group):>4}", markup
    if worst.expected_failure:
        said = f"expected failure: {worst.expected_failure}"
        for part in textwrap.wrap(said, WIDTH - 6, subsequent_indent="  "):
            yield f"      {part}", markup


def _margin(found: Figure) -> str:
    if math.isinf(found.margin):
        return "exact"
    return f"x {found.margin:.3g}" if 0.01 < found.margin < 1000 else f"x {found.margin:.0e}"


def faults(
    rows: Iterable[Row], wanted: Iterable[int], expected: Iterable[tuple[str, bool]]
) -> list[str]:
    """What makes a run of the hard cases fail besides its tests.

    Args:
        rows: Of the table.
        wanted: Numbers of the cases that had to be there.
        expected: Tests that are marked as expected failures, and whether strictly.
    """
    lacking = sorted(set(wanted) - {row.case for row in rows})
    found = [f"case {case}: no figure was measured ({TITLES[case]})" for case in lacking]
    tests = list(expected)
    found += [
        f"{test}: an expected failure has to be strict" for test, strict in tests if not strict
    ]
    if len(tests) > MOST_EXPECTED_FAILURES:
        found.append(
            f"{len(tests)} expected failures, at most {MOST_EXPECTED_FAILURES} are allowed: "
            + ", ".join(test for test, _ in tests)
        )
    return found
