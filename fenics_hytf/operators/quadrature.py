# SPDX-License-Identifier: MIT
"""The Gauss rule of the stiffness, and its points as sites."""

from __future__ import annotations

import basix
import numpy as np
import numpy.typing as npt

from fenics_hytf.domain import Domain
from fenics_hytf.particles import Sites, cell_grid


def quadrature_degree(domain: Domain) -> int:
    """Of the rule that the stiffness is integrated with: degree + 1 Gauss points a direction.

    It integrates the stiffness of a parallelogram exactly.
    """
    return int(2 * domain.V.ufl_element().degree)


def gauss_sites(domain: Domain) -> tuple[Sites, npt.NDArray[np.float64]]:
    """The rule's points in the cells that this rank owns.

    Args:
        domain: The domain.

    Returns:
        Sites, cell by cell, and the volume of each [m^3, in 2D m^2], shape
        ``(num_owned_cells, num_gauss_points)``.
    """
    cell_type = basix.CellType[domain.mesh.topology.cell_name()]
    X, weight = basix.make_quadrature(cell_type, quadrature_degree(domain))
    cells = np.arange(domain.num_owned_cells, dtype=np.int32)
    _, det = cell_grid(domain.mesh, cells, X)
    return Sites(np.repeat(cells, len(X)), np.tile(X, (len(cells), 1))), weight * det
