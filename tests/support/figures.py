# SPDX-License-Identifier: MIT
"""A figure that a test measures, beside the limit that it has to keep."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """What was measured, and the limit.

    Attributes:
        name: What was measured.
        measured: The figure.
        limit: The largest that is good; the smallest where ``at_least``.
        unit: Of both.
        at_least: Whether the limit is the smallest that is good.
    """

    name: str
    measured: float
    limit: float
    unit: str = ""
    at_least: bool = False

    @property
    def good(self) -> bool:
        """Whether the limit is kept; not where the figure is no number."""
        return self.measured >= self.limit if self.at_least else self.measured <= self.limit

    @property
    def sign(self) -> str:
        return ">=" if self.at_least else "<="

    @property
    def margin(self) -> float:
        """How many times the limit could be tighter; infinite where the figure is exact."""
        if self.measured != self.measured:
            return 0.0
        small, large = sorted((self.measured, self.limit))
        if small == large:
            return 1.0 if large else float("inf")
        ratio = large / small if small > 0 else float("inf")
        return ratio if self.good else 1 / ratio

    def require(self) -> None:
        """Fail with the figure and the limit unless it is kept."""
        said = f"{self.name}: measured {self.measured:.4g}, wanted {self.sign} {self.limit:.4g}"
        assert self.good, f"{said} {self.unit}".rstrip()


def kept_and_required(keep: Callable[[Figure], None]) -> Callable[..., None]:
    """What the fixtures ``figure`` give: keeps a figure, good or not, and requires it."""

    def require(
        name: str, measured: float, limit: float, unit: str = "", at_least: bool = False
    ) -> None:
        found = Figure(name, float(measured), float(limit), unit, at_least)
        keep(found)
        found.require()

    return require
