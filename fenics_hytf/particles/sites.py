# SPDX-License-Identifier: MIT
"""Sites: places in cells that are looked at but weigh nothing, such as receivers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import basix
import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh


class Located(Protocol):
    """Anything with cells and reference coordinates: points or sites."""

    @property
    def cell(self) -> npt.NDArray[np.int32]:
        """Local cell of each, shape ``(n,)``."""

    @property
    def X(self) -> npt.NDArray[np.float64]:
        """Reference coordinates, shape ``(n, tdim)``."""

    def __len__(self) -> int:
        """How many."""


@dataclass(frozen=True)
class Sites:
    """Places in cells of this rank.

    Attributes:
        cell: Local cell of each site, shape ``(n,)``.
        X: Reference coordinates in it [-], shape ``(n, tdim)``.
    """

    cell: npt.NDArray[np.int32]
    X: npt.NDArray[np.float64]

    def __len__(self) -> int:
        """Number of sites on this rank."""
        return len(self.cell)


def cell_centres(mesh: Mesh, first: int, stop: int) -> Sites:
    """The reference midpoints of a range of local cells.

    Args:
        mesh: The mesh.
        first: First local cell.
        stop: One after the last.

    Returns:
        One site a cell.
    """
    corners = basix.geometry(getattr(basix.CellType, mesh.topology.cell_name()))
    cells = np.arange(first, stop, dtype=np.int32)
    return Sites(cells, np.tile(corners.mean(axis=0), (len(cells), 1)))
