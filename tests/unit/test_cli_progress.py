# SPDX-License-Identifier: MIT
"""Progress: what is said, how often, and that the fraction done never goes back."""

from __future__ import annotations

import io

import pytest

from fenics_hytf.cli.progress import Estimate, PlainLines, describe, duration, show_progress
from fenics_hytf.simulation import Progress


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


class Terminal(io.StringIO):
    def isatty(self):
        return True


def run_of(lapses, iterations, lines=4):
    for lapse in range(lapses):
        for iteration in range(1, iterations + 1):
            for done in range(1, lines + 1):
                yield Progress(lapse, lapses, "sweep", iteration, done, lines)
            yield Progress(lapse, lapses, "iteration", iteration, change=0.5**iteration)
        yield Progress(lapse, lapses, "lapse", residual=1e-12)


@pytest.mark.parametrize("iterations", [3, 10, 40])
def test_fraction_grows_to_one(iterations):
    estimate = Estimate(Clock())
    fractions = []
    for progress in run_of(3, iterations):
        estimate.update(progress)
        fractions.append(estimate.fraction)
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0 and max(fractions[:-1]) < 1.0


def test_without_a_loop_the_fraction_is_that_of_the_lines():
    clock = Clock()
    estimate = Estimate(clock)
    clock.now = 10.0
    estimate.update(Progress(0, 1, "sweep", 0, 25, 100))
    assert estimate.fraction == 0.25
    assert estimate.seconds_left == pytest.approx(30.0, rel=1e-15)  # one product


def test_too_early_to_say():
    estimate = Estimate(Clock())
    estimate.update(Progress(0, 1, "sweep", 0, 1, 100))
    assert estimate.seconds_left is None and duration(None) == ""


def test_at_most_a_line_a_second_or_an_iteration():
    clock, stream = Clock(), io.StringIO()
    lines = PlainLines(stream, clock)
    for progress in run_of(2, 3, lines=1000):
        clock.now += 0.01  # 10 s a sweep
        lines(progress)
    told = stream.getvalue().splitlines()
    assert sum("change" in line for line in told) == 6
    assert 55 <= len(told) <= 70
    assert "done" in told[-1] and "residual 1.0e-12" in told[-1] and "left" not in told[-1]
    assert any("left" in line for line in told)


def test_many_short_lapses_do_not_flood():
    stream = io.StringIO()
    lines = PlainLines(stream, Clock())
    for lapse in range(1000):
        lines(Progress(lapse, 1000, "lapse"))
    assert len(stream.getvalue().splitlines()) == 1


def test_words():
    assert describe(Progress(2, 7, "sweep", 3, 12, 80)) == (
        "lapse 2 (3 of 7), iteration 3, line 12/80"
    )
    assert describe(Progress(0, 1, "iteration", 3, change=0.0123)) == (
        "lapse 0 (1 of 1), iteration 3, change 1.2e-02"
    )
    assert duration(45) == "about 45 s left"
    assert duration(600) == "about 10 min left"
    assert duration(9000) == "about 2.5 h left"
    assert duration(0.3) == ""


def test_a_bar_on_a_terminal():
    stream = Terminal()
    with show_progress(False, stream) as callback:
        for progress in run_of(1, 2):
            callback(progress)
    assert "lapse 0" in stream.getvalue() and "\x1b[" in stream.getvalue()


def test_what_is_written_after_the_last_lapse_is_told():
    """Of a record of a million samples it takes minutes in which naively nothing is said."""
    stream, lines = Terminal(), io.StringIO()
    plain = PlainLines(lines, Clock())
    with show_progress(False, stream) as bar:
        for progress in (*run_of(1, 2), Progress(0, 1, "tables"), Progress(0, 1, "figures")):
            bar(progress)
            plain(progress)
    words = ["writing tables", "drawing figures and the report"]
    assert lines.getvalue().splitlines()[-2:] == words
    assert words[1] in stream.getvalue()  # the bar is drawn at most ten times a second


def test_quiet():
    stream = Terminal()
    with show_progress(True, stream) as callback:
        assert callback is None
    assert stream.getvalue() == ""
