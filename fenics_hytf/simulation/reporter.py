# SPDX-License-Identifier: MIT
"""Tells a callback how far a run is, and keeps it from harm by one that fails."""

from __future__ import annotations

import logging

from fenics_hytf.lapse import Observer
from fenics_hytf.simulation.clock import Clock
from fenics_hytf.simulation.records import Progress, ProgressCallback

logger = logging.getLogger(__name__)


class Reporter:
    """Calls the callback of a run.

    Args:
        callback: The callback, or ``None`` where nobody listens.
        num_lapses: Lapses that are planned.
        clock: The clock of the run.
    """

    def __init__(self, callback: ProgressCallback | None, num_lapses: int, clock: Clock) -> None:
        self._callback, self._num_lapses, self._clock = callback, num_lapses, clock

    def __call__(self, index: int, phase: str, **values: float | str) -> None:
        """Report; see :class:`Progress`."""
        if self._callback is None:
            return
        report = Progress(index, max(self._num_lapses, index + 1), phase, **values)  # type: ignore[arg-type]
        try:
            self._callback(report)
        except Exception:  # rank 0 alone must not leave a run that others wait in
            logger.warning("the progress callback failed and is not called again", exc_info=True)
            self._callback = None

    def observer(self, index: int, side: str = "") -> Observer:
        """What a lapse reports to.

        Args:
            index: Of the lapse.
            side: The side whose free field it is of, or nothing.
        """
        return Observer(
            lambda iteration, done, total: self(
                index, "sweep", iteration=iteration, done=done, total=total, side=side
            ),
            lambda iteration, change: self(
                index, "iteration", iteration=iteration, change=change, side=side
            ),
            self._clock.phase,
        )
