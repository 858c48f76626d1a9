# SPDX-License-Identifier: MIT
"""Runs of stability maps, done and to be done."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from fenics_hytf.study.stability.verdicts import Verdict

LAPSES, FREQUENCY, BLOCK, CONTRAST = "lapses", "max_frequency", "cut_cells", "contrast"
"""Names of the maps; that of lapses has a figure of its own for the highest frequency."""

MapValues = Mapping[str, float | str]
"""Where in a map a run lies: values on its axes, by column of the table."""
Figures = Mapping[str, float | None]
"""What was measured, by column of the table; a figure that does not exist is ``None``."""
Row = tuple[MapValues, Figures, Verdict]


class Job(NamedTuple):
    """Runs that share a reference.

    Attributes:
        map: Name of the map.
        text: What they are.
        planned: How many there are.
        runs: Makes the reference, and then a run whenever it is asked for the next.
    """

    map: str
    text: str
    planned: int
    runs: Callable[[], Iterator[Row]]


@dataclass(frozen=True)
class StabilityRun:
    """A run of a map.

    Attributes:
        map: Name of the map.
        axes: Where in the map it lies.
        figures: What was measured.
        verdict: What that means.
        cpu_s: CPU time, references aside [s].
    """

    map: str
    axes: MapValues
    figures: Figures
    verdict: Verdict
    cpu_s: float
