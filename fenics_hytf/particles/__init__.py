# SPDX-License-Identifier: MIT
"""Material points: the store, search and inverse mapping, the transfer matrix S, movement.

The soil's mass is carried by points that weigh on the nodes through M = S^T M_p S (4). Between
lapses they move through the mesh, which stays, and are found again by Newton's method (7)-(9).
"""

from fenics_hytf.particles.flow import even_shift
from fenics_hytf.particles.geometry import cell_grid
from fenics_hytf.particles.kinematics import (
    to_components,
    to_tensor,
    update_kinematics,
    update_stress,
)
from fenics_hytf.particles.ledger import MassLedger
from fenics_hytf.particles.mapping import inverse_map
from fenics_hytf.particles.move import (
    MoveReport,
    PointsNotFinite,
    PointsOutside,
    move,
    take_out,
)
from fenics_hytf.particles.pieces import carry_pieces, first_pieces, piece_integrals
from fenics_hytf.particles.points import Points, quadrature_rule, seed
from fenics_hytf.particles.resample import resample_matrix
from fenics_hytf.particles.search import locate, resolve_owners
from fenics_hytf.particles.sites import Located, Sites, cell_centres
from fenics_hytf.particles.store import gather_points, scatter_points
from fenics_hytf.particles.transfer import (
    gradient_matrices,
    particle_mass_matrix,
    transfer_matrix,
)
from fenics_hytf.scene import default_points_per_cell

__all__ = [
    "Located",
    "MassLedger",
    "MoveReport",
    "Points",
    "PointsNotFinite",
    "PointsOutside",
    "Sites",
    "carry_pieces",
    "cell_centres",
    "cell_grid",
    "default_points_per_cell",
    "even_shift",
    "first_pieces",
    "gather_points",
    "gradient_matrices",
    "inverse_map",
    "locate",
    "move",
    "particle_mass_matrix",
    "piece_integrals",
    "quadrature_rule",
    "resample_matrix",
    "resolve_owners",
    "scatter_points",
    "seed",
    "take_out",
    "to_components",
    "to_tensor",
    "transfer_matrix",
    "update_kinematics",
    "update_stress",
]
