# SPDX-License-Identifier: MIT
"""Cells that have lost their points."""

import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh

from fenics_hytf.particles import Points, move


def empty_a_cell(mesh: Mesh, points: Points, middle: npt.ArrayLike) -> None:
    """Move the points of a cell to its neighbours along x; the soil stays where it was.

    Args:
        mesh: Squares of 1 m.
        points: Points with pieces, at least two across a cell.
        middle: Of the cell [m].
    """
    away = points.x - middle
    inside = np.abs(away).max(axis=1) < 0.5
    way = np.where(inside[:, None], 0.4 * np.sign(away), 0.0) * [1, 0]
    points["piece"][:, :, 2] -= way
    move(mesh, points, way)
