# SPDX-License-Identifier: MIT
"""What a study leaves: its points, what they are measured against, and what follows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from fenics_hytf.study.measures import Error
from fenics_hytf.study.runs import Cost
from fenics_hytf.study.slip_measures import SLIP

TARGETS = (0.05, 0.01, 0.001)
"""Errors that a cheapest setting is sought for, relative L2 [-]."""

RESOLVED = 3.0
"""Times the reference's own uncertainty: a smaller error is not told from it."""

SAME = 1.1
"""Errors within this ratio are called the same."""

WORTH = 0.9
"""A cost below this ratio is worth having."""

_LESS, _MUCH_LESS = 0.99, 0.9  # ratios of errors in a front; see :func:`pareto`


@dataclass(frozen=True)
class Point:
    """One run: what was run, what it cost, how far it is from the reference.

    Attributes:
        name: Setting in words.
        families: Why it was run: the knobs turned alone from the fine setting that it shows;
            ``own``, ``either sweep``, ``fine``, ``from own`` or ``candidate``; of the twin, the
            method.
        overrides: What it changes in the scene, as after ``--set``.
        cost: ``None`` if it failed.
        error: ``None`` if it failed.
        failure: Why it failed.
        doubt: What the reference is uncertain by, relative L2 [-].
        turned: Knobs that differ from the scene's own.
        values: Value of each knob.
        words: The same in words.
        substeps: Time steps per sample, of a march.
        slid: What slid, by the keys of ``slip_measures.MEASURES``.
    """

    name: str
    families: tuple[str, ...]
    overrides: tuple[str, ...]
    cost: Cost | None
    error: Error | None
    failure: str = ""
    doubt: float = 0.0
    turned: tuple[str, ...] = ()
    values: Mapping[str, float | str] = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)
    substeps: int = 0
    slid: Mapping[str, float] = field(default_factory=dict)

    @property
    def resolved(self) -> bool:
        """Whether the error is told from what the reference itself is uncertain by."""
        return self.error is None or self.error.relative_l2 > RESOLVED * self.doubt

    @property
    def at_most(self) -> float:
        """Error with what the reference is uncertain by; infinite if the run failed [-]."""
        return float("inf") if self.error is None else self.error.relative_l2 + self.doubt


@dataclass(frozen=True)
class Reference:
    """What errors are measured against.

    Attributes:
        text: What it is, in words.
        uncertainty: Estimate of its own error, relative L2 [-]; 0 while it is pending.
        parts: What each knob has in that.
        pending: Whether the runs that the estimate takes are still to be made.
    """

    text: str
    uncertainty: float
    parts: Mapping[str, float] = field(default_factory=dict)
    pending: bool = False


@dataclass(frozen=True)
class Comparison:
    """The scene with viscous damping: in the frequency domain and marched in time.

    Attributes:
        points: Runs; the family is the method.
        reference: What errors are measured against.
        reason: Why there is none, where there is none.
    """

    points: tuple[Point, ...]
    reference: Reference | None
    reason: str = ""


@dataclass(frozen=True)
class Study:
    """A study of one scene.

    Attributes:
        title: Of the scene.
        points: Every run of the scene but the reference.
        own: The scene as it is.
        finest: The reference, where it is a run.
        reference: What errors are measured against.
        slip_reference: The same with what its slip is uncertain by; ``None`` where nothing slides.
        twin: Frequency domain and time domain on one problem.
        sentences: What follows, in words.
        notes: What was left out, and why.
        complete: Whether nothing is missing for want of time.
    """

    title: str
    points: tuple[Point, ...]
    own: Point
    finest: Point | None
    reference: Reference
    twin: Comparison
    sentences: tuple[str, ...]
    notes: tuple[str, ...]
    complete: bool
    slip_reference: Reference | None = None

    def saying(self, sentences: Iterable[str]) -> Self:
        """The same with what follows."""
        return replace(self, sentences=tuple(sentences))

    def of_slip(self) -> Self | None:
        """The same with the error of the slip in place of that of the acceleration.

        ``None`` where nothing slides.
        """
        reference = self.slip_reference
        if reference is None:
            return None

        def seen(point: Point) -> Point:
            error = point.error and replace(point.error, relative_l2=point.error.slides[SLIP])
            return replace(point, error=error, doubt=reference.uncertainty)

        return replace(
            self,
            points=tuple(seen(point) for point in self.points),
            own=seen(self.own),
            finest=self.finest and seen(self.finest),
            reference=reference,
        )


@dataclass(frozen=True)
class StudyProgress:
    """One report of progress.

    Attributes:
        done: Runs done or found.
        planned: Runs of the study, as far as they are known.
        text: What runs now.
    """

    done: int
    planned: int
    text: str


StudyCallback = Callable[[StudyProgress], None]


class StudyError(RuntimeError):
    """The study cannot go on; says why."""


class BudgetSpent(StudyError):
    """No time is left to start another run."""


def pareto(points: Iterable[Point]) -> list[Point]:
    """The points that no other one beats in both cost and error, cheapest first.

    The error counts with what the reference is uncertain by. It has to become smaller by a
    hundredth, and by a tenth where it is not told from that.
    """
    front: list[Point] = []
    for point in sorted(measured(points), key=lambda p: (core_s(p), p.at_most)):
        before = front[-1] if front else None
        less = _LESS if before is None or before.resolved else _MUCH_LESS
        if before is None or point.at_most < less * before.at_most:
            front.append(point)
    return front


def cheapest(points: Iterable[Point], target: float) -> Point | None:
    """The cheapest point with at most an error, the reference's included, or ``None``."""
    good = [point for point in measured(points) if point.at_most <= target]
    return min(good, key=core_s) if good else None


def measured(points: Iterable[Point]) -> list[Point]:
    """Points with a cost and an error."""
    return [point for point in points if point.cost is not None and point.error is not None]


def core_s(point: Point) -> float:
    """Cost of a point [s]; infinite if it failed."""
    return point.cost.core_s if point.cost is not None else float("inf")


def error_of(point: Point) -> float:
    """Relative L2 error of a point [-]; infinite if it failed."""
    return point.error.relative_l2 if point.error is not None else float("inf")
