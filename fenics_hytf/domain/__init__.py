# SPDX-License-Identifier: MIT
"""The mesh with its named regions and boundaries, its checks, and the constraint matrix T."""

from fenics_hytf.domain.adjacency import bare_nodes, cells_at, facet_cells, neighbours
from fenics_hytf.domain.checks import jacobian_determinants, refuse_inverted_cells
from fenics_hytf.domain.constraints import boundary_nodes, constraint_matrix, normal_axis
from fenics_hytf.domain.domain import Domain, build, examine, make_domain
from fenics_hytf.domain.files import count_cells
from fenics_hytf.domain.grids import MeshData
from fenics_hytf.domain.side import distance_to_sides, side_column

__all__ = [
    "Domain",
    "MeshData",
    "bare_nodes",
    "boundary_nodes",
    "build",
    "cells_at",
    "constraint_matrix",
    "count_cells",
    "distance_to_sides",
    "examine",
    "facet_cells",
    "jacobian_determinants",
    "make_domain",
    "neighbours",
    "normal_axis",
    "refuse_inverted_cells",
    "side_column",
]
