# SPDX-License-Identifier: MIT
"""The table of the hard cases: worst figures, what is missing, what may fail."""

import math

import pytest
from support.figures import Figure
from support.hard_table import TITLES, WIDTH, Row, faults, lines, read, write


def row(case: int, measured: float, limit: float = 1.0, name: str = "error", **fields) -> Row:
    figure = Figure(name, measured, limit, at_least=fields.pop("at_least", False))
    return Row(case, "test", fields.pop("ranks", 1), figure, **fields)


ALL = [row(case, 0.5) for case in TITLES]


@pytest.mark.parametrize(
    ("measured", "limit", "at_least", "margin"),
    [
        (0.5, 1.0, False, 2.0),
        (4.0, 1.0, False, 0.25),
        (0.0, 0.0, False, math.inf),
        (1.0, 1.0, False, 1.0),
        (1.0, 0.0, False, 0.0),
        (math.nan, 1.0, False, 0.0),
        (6.0, 3.0, True, 2.0),
        (1.0, 4.0, True, 0.25),
    ],
)
def test_a_margin_says_how_much_tighter_a_limit_could_be(measured, limit, at_least, margin):
    found = Figure("error", measured, limit, at_least=at_least)
    assert found.margin == margin
    assert found.good == (margin >= 1)


def test_a_row_is_the_figure_nearest_to_its_limit():
    rows = [row(7, 0.5), row(7, 0.8, ranks=3), row(7, 0.1), row(0, 0.2, name="other")]
    _, case, worst, beside, other = (line for line, _ in lines(rows))
    assert case.startswith(" 7  ") and TITLES[7] in case
    assert "error, 1 to 3 ranks" in worst and " 0.8 <= 1 " in worst and worst.endswith(" 3")
    assert beside.strip() == "Beside the cases" and "other" in other


def test_lines_fit_and_tell_of_expected_failures():
    long = "a figure with a name that is a good deal longer than there is room for it"
    rows = [row(1, 2.0, name=long, expected_failure="because " * 20), row(2, 2.0)]
    table = list(lines(rows))
    assert max(len(line) for line, _ in table) <= WIDTH
    assert any("expected failure: because" in line for line, _ in table)
    assert [markup for line, markup in table if "error" in line] == [{"red": True}]


def test_all_cases_and_no_more_than_two_expected_failures_are_a_good_run():
    assert faults(ALL, TITLES, [("a", True), ("b", True)]) == []
    assert len(faults(ALL, TITLES, [("a", True), ("b", True), ("c", True)])) == 1
    (loose,) = faults(ALL, TITLES, [("a", False)])
    assert "strict" in loose
    (lacking,) = faults([r for r in ALL if r.case != 29], TITLES, [])
    assert lacking.startswith("case 29: no figure")
    assert faults([row(23, 0.5)], {23}, []) == []


def test_rows_survive_a_file(tmp_path):
    rows = [row(7, 1 / 3, ranks=2), row(0, 2.0, at_least=True, expected_failure="why")]
    for part in rows:
        write(tmp_path / "rows.csv", [part])
    assert read(tmp_path / "rows.csv") == rows
    assert read(tmp_path / "none.csv") == []
