# SPDX-License-Identifier: MIT
"""What can go wrong in a lapse."""

from __future__ import annotations


class LapseError(RuntimeError):
    """The numerics of a lapse stopped."""


class EquivalentLinearError(LapseError):
    """The equivalent-linear loop reached its limit without converging.

    Attributes:
        worst_cell: Input index of the cell that changes most.
        change: Its last change [-].
    """

    def __init__(self, iterations: int, change: float, tolerance: float, worst_cell: int) -> None:
        self.worst_cell = worst_cell
        self.change = change
        super().__init__(
            f"equivalent-linear loop, iteration {iterations}: found cell {worst_cell} still "
            f"changing by {change:.3g}; expected at most {tolerance:.3g}: allow more "
            "effects.equivalent_linear.max_iterations, or check that cell's curves and mesh"
        )


class EmptyCellError(LapseError):
    """The points have left a cell without any, which this version cannot compute with."""

    def __init__(self, cells: list[int]) -> None:
        self.cells = cells
        listed = ", ".join(str(cell) for cell in cells[:5])
        super().__init__(
            f"found {len(cells)} cells without material points, the first: {listed}; expected "
            "points in every cell: partially filled meshes are not in this version"
        )


class VolumeError(LapseError):
    """Points have been squeezed to nothing, or blown up.

    Attributes:
        points: Their identities.
    """

    def __init__(self, points: list[int], ratio: float) -> None:
        self.points = points
        listed = ", ".join(str(point) for point in points[:5])
        super().__init__(
            f"found {len(points)} material points whose volume has become {ratio:.3g} times that "
            f"at the start, the first: {listed}; expected 0.1 to 10 times: the response is not to "
            "be trusted; use shorter lapses, or look at the stiffness there"
        )
