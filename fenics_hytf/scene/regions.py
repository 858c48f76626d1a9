# SPDX-License-Identifier: MIT
"""Regions of a box: which cells are of which soil, by cell centroid."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import Field, Strict

from fenics_hytf.scene.faults import Fault, join_key, toml_text
from fenics_hytf.scene.table import Name, Several, Table, as_list, as_number, at_most_one

RealArray = npt.NDArray[np.float64]
_Vertex = Annotated[tuple[float, float], Strict(False)]


class Region(Table):
    """Cells of a box made of one soil, by cell centroid; the first region that matches wins.

    Attributes:
        soil: Name of the soil.
        below: Cells whose centroid is below this height [m], or ``None``.
        polygon: Cells whose centroid is in this polygon [m] (2D), shape ``(n, 2)``, or ``None``.
            With neither, every cell that is left.
    """

    soil: Name = Field(description="the name of a soil")
    below: float | None = Field(None, description="a height [m]")
    polygon: Several[_Vertex] | None = Field(
        None, min_length=3, description="at least three vertices [x, y] [m]"
    )

    @classmethod
    def rules(cls, raw: dict[str, Any], key: str) -> Iterator[Fault]:
        """``below`` and ``polygon`` exclude each other."""
        yield from at_most_one(raw, key, "below", "polygon")

    def holds(self, x: RealArray) -> npt.NDArray[np.bool_]:
        """Which places belong to it.

        Args:
            x: Places [m], shape ``(n, gdim)``.

        Returns:
            Shape ``(n,)``.
        """
        if self.below is not None:
            return np.asarray(x[:, -1] < self.below)
        if self.polygon is not None:
            return in_polygon(x, np.array(self.polygon))
        return np.ones(len(x), dtype=np.bool_)


def in_polygon(x: RealArray, polygon: RealArray) -> npt.NDArray[np.bool_]:
    """Which places are inside a polygon, by the parity of crossings of a horizontal ray.

    Args:
        x: Places [m], shape ``(n, 2)``.
        polygon: Vertices in order [m], shape ``(m, 2)``.

    Returns:
        Shape ``(n,)``.
    """
    inside = np.zeros(len(x), dtype=np.bool_)
    for i in range(len(polygon)):
        (x0, y0), (x1, y1) = polygon[i - 1], polygon[i]
        spans = (y0 <= x[:, 1]) != (y1 <= x[:, 1])
        if y0 != y1:
            at = x0 + (x[:, 1] - y0) * ((x1 - x0) / (y1 - y0))
            inside ^= spans & (x[:, 0] < at)
    return inside


def polygon_rules(raw: dict[str, Any], key: str, gdim: int | None) -> Iterator[Fault]:
    """A polygon is for 2D and encloses an area."""
    polygon = raw.get("polygon")
    if polygon is None:
        return
    where = join_key(key, "polygon")
    if gdim == 3:
        yield Fault(where, toml_text(polygon), "no polygon in 3D; below is")
        return
    pairs = [[as_number(c) for c in as_list(vertex)] for vertex in as_list(polygon)]
    if len(pairs) < 3 or any(len(pair) != 2 or None in pair for pair in pairs):
        return
    x = np.array(pairs, dtype=np.float64)
    x = x - x[0]
    x /= np.abs(x).max() or 1.0
    ahead = np.roll(x, -1, axis=0)
    area = 0.5 * abs(float(np.sum(x[:, 0] * ahead[:, 1] - x[:, 1] * ahead[:, 0])))
    if not area > 1e-12:  # of the bounding square: the rounding of the sum above
        yield Fault(where, toml_text(polygon), "vertices that enclose an area")
