# SPDX-License-Identifier: MIT
"""The mesh with its named regions and boundaries, its checks, and the constraint matrix T."""

from fenics_hytf.domain.checks import jacobian_determinants, refuse_inverted_cells
from fenics_hytf.domain.constraints import constraint_matrix
from fenics_hytf.domain.domain import Domain, build, examine
from fenics_hytf.domain.grids import MeshData

__all__ = [
    "Domain",
    "MeshData",
    "build",
    "constraint_matrix",
    "examine",
    "jacobian_determinants",
    "refuse_inverted_cells",
]
