# SPDX-License-Identifier: MIT
"""Progress on standard error: a bar on a terminal, plain lines elsewhere.

How long a lapse takes is known once its equivalent-linear loop has ended, not before. The fraction
done assumes as many iterations as the lapse before took, ten for the first, and never goes back.
After the last lapse it is said what is written, without a time left.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

from fenics_hytf.cli.outcome import say

if TYPE_CHECKING:
    from fenics_hytf.simulation import Progress, ProgressCallback

AFTERWARDS = {"tables": "writing tables", "figures": "drawing figures and the report"}
"""Phases after the last lapse, and how they are told; how long they take is not estimated."""

_FIRST_GUESS = 10  # iterations of the first lapse
_SLOWER = 1.5  # a loop that takes longer is taken to need half as much again
_STEADY = 0.05  # fraction done from which a time left is worth saying


class Estimate:
    """Fraction of a run that is done, and the time left."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.fraction = 0.0
        self._clock = clock
        self._start = clock()
        self._before: float | None = None  # fraction that an earlier run had done
        self._expected = float(_FIRST_GUESS)
        self._iterations = 0

    def update(self, progress: Progress) -> None:
        """Take in a report; the free field of a side takes next to no time."""
        if self._before is None:
            self._before = progress.lapse / progress.num_lapses
        if progress.side or progress.phase in AFTERWARDS:
            return
        within = progress.done / progress.total if progress.total else 0.0
        if progress.phase == "lapse":
            within = 1.0
            self._expected = float(max(self._iterations, 1))
            self._iterations = 0
        elif progress.iteration:
            self._iterations = progress.iteration
            done = progress.iteration - 1 + (within if progress.phase == "sweep" else 1.0)
            within = done / max(self._expected, _SLOWER * done, done + 1.0)
        self.fraction = max(self.fraction, (progress.lapse + within) / progress.num_lapses)

    @property
    def seconds_left(self) -> float | None:
        """Time left if the rest goes as what is done [s]; ``None`` where it is too early to say."""
        done = self.fraction - (self._before or 0.0)
        if done < _STEADY:
            return None
        return (self._clock() - self._start) * (1.0 - self.fraction) / done


def describe(progress: Progress) -> str:
    """A report in words."""
    if progress.phase in AFTERWARDS:
        return AFTERWARDS[progress.phase]
    parts = [f"lapse {progress.lapse} ({progress.lapse + 1} of {progress.num_lapses})"]
    if progress.side:
        parts.append(f"free field at {progress.side}")
    if progress.phase == "lapse":
        parts.append("done")
    elif progress.iteration:
        parts.append(f"iteration {progress.iteration}")
    if progress.phase == "sweep" and progress.total:
        parts.append(f"line {progress.done}/{progress.total}")
    if math.isfinite(progress.change):
        parts.append(f"change {progress.change:.1e}")
    if math.isfinite(progress.residual):
        parts.append(f"residual {progress.residual:.1e}")
    return ", ".join(parts)


def duration(seconds: float | None) -> str:
    """A time left, as coarse as it is known; empty if it is not, or next to nothing."""
    if seconds is None or seconds < 1.0:
        return ""
    if seconds < 90:
        return f"about {seconds:.0f} s left"
    if seconds < 5400:
        return f"about {seconds / 60:.0f} min left"
    return f"about {seconds / 3600:.1f} h left"


class PlainLines:
    """One line an iteration; otherwise at most one a second.

    The end of the last lapse is said, and what follows it.
    """

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream = stream
        self._clock = clock
        self._estimate = Estimate(clock)
        self._last = clock()

    def __call__(self, progress: Progress) -> None:
        """Take in a report."""
        self._estimate.update(progress)
        now = self._clock()
        ends = progress.phase in AFTERWARDS or (
            progress.phase == "lapse" and progress.lapse + 1 == progress.num_lapses
        )
        iterated = progress.phase == "iteration" and not progress.side
        if iterated or ends or now - self._last >= 1.0:
            self._last = now
            left = "" if ends else duration(self._estimate.seconds_left)
            text = ", ".join(part for part in (describe(progress), left) if part)
            say(text, self._stream)


@contextmanager
def show_progress(quiet: bool, stream: TextIO | None = None) -> Iterator[ProgressCallback | None]:
    """What to hand to ``simulate``.

    Args:
        quiet: Whether to show nothing.
        stream: Where to; standard error if ``None``.

    Yields:
        The callback, or ``None``.
    """
    stream = sys.stderr if stream is None else stream
    if quiet or stream is None:  # closed before the program began
        yield None
    elif stream.isatty():
        with _bar(stream) as callback:
            yield callback
    else:
        yield PlainLines(stream)


@contextmanager
def _bar(stream: TextIO) -> Iterator[ProgressCallback]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (
        BarColumn(bar_width=24),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
        TextColumn("{task.description}", markup=False),
    )
    estimate = Estimate()
    with Bar(*columns, console=Console(file=stream), transient=True) as bar:
        task = bar.add_task("setting up", total=1.0, left="")
        seen: dict[str, float] = {}

        def callback(progress: Progress) -> None:
            estimate.update(progress)
            if progress.phase == "iteration":  # the sweeps that follow show it as well
                seen["change"] = progress.change
            elif progress.phase == "lapse":
                seen.clear()
            text = describe(progress)
            if "change" in seen and progress.phase == "sweep":
                text += f", change {seen['change']:.1e}"
            left = duration(estimate.seconds_left)
            bar.update(task, completed=estimate.fraction, description=text, left=left)

        yield callback
