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


class SlipMarchError(LapseError):
    """The march of what slips has failed."""

    def __init__(self, found: str) -> None:
        super().__init__(
            f"march of the slip: {found}. The ground answers slip as none does that only takes "
            "energy: try a shorter effects.sliding.time_step or a smaller solver.tolerance"
        )


class EmptyCellError(LapseError):
    """The points have left a cell without any where the scene does not reckon with it.

    Attributes:
        cells: Input indices of the cells.
    """

    def __init__(self, cells: list[int]) -> None:
        self.cells = cells
        listed = ", ".join(str(cell) for cell in cells[:5])
        super().__init__(
            f"found {len(cells)} cells without material points, the first: {listed}; expected "
            "points in every cell: name the regions that points may move into in mesh.empty, and "
            "cells may be filled in part"
        )


class DetachedError(LapseError):
    """A body has come off the ground that is held.

    Attributes:
        cells: Input indices of its cells.
    """

    def __init__(self, cells: list[int]) -> None:
        self.cells = cells
        listed = ", ".join(str(cell) for cell in cells[:5])
        super().__init__(
            f"found {len(cells)} cells whose points no longer hang together with held ground, the "
            f"first: {listed}; expected ground that is held: where some of it is, let the scene "
            "park or delete what comes off ([points] detached)"
        )


class BalanceError(LapseError):
    """The stress of the points does not come into balance with their weight.

    Attributes:
        left: What is out of balance, of the weight [-].
    """

    def __init__(self, left: float, limit: float) -> None:
        self.left = left
        super().__init__(
            f"found {left:.3g} of the weight out of balance with the stress of the points; "
            f"expected at most {limit:.3g}: seed more points a cell, or hold the ground better"
        )


class GeometricInstability(LapseError):  # named for what was found
    """The stiffness is no longer definite: the stress that the ground carries makes it buckle.

    Attributes:
        negative: Modes without stiffness.
    """

    def __init__(self, negative: int) -> None:
        self.negative = negative
        super().__init__(
            f"found a stiffness with {negative} negative modes; expected none: the ground buckles "
            "under its own weight (a level layer does where ρgH/G nears 1); look at the modulus of "
            "the softest soil, or leave effects.geometric_stiffness out"
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


class PeakError(LapseError):
    """Peaks of cells are no numbers, or beyond what can be computed with.

    Attributes:
        cells: Their numbers in the input.
    """

    def __init__(self, cells: list[int]) -> None:
        self.cells = cells
        listed = ", ".join(str(cell) for cell in cells[:5])
        super().__init__(
            f"found peaks of {len(cells)} cells out of bounds, the first: {listed}; expected "
            "strains, stresses and motions below 1e18: look at the units of the motion, of lengths "
            "and of moduli"
        )
