# SPDX-License-Identifier: MIT
"""Stiffness, mass and damping matrices, and evaluation at sites as matrices."""

from fenics_hytf.operators.dilation import Dilation
from fenics_hytf.operators.facets import DashpotForm, TractionForm, boundary_area, mean_rows
from fenics_hytf.operators.forces import InternalForce, isotropic_stress
from fenics_hytf.operators.forms import ElasticForm, GeometricForm
from fenics_hytf.operators.ghost import STRENGTH, GhostForm
from fenics_hytf.operators.mass import assemble_mass, rayleigh_damping
from fenics_hytf.operators.quadrature import gauss_sites
from fenics_hytf.operators.rows import (
    NORMAL_STRAINS,
    constrained_rows,
    displacement_rows,
    evaluate,
    split_rows,
    strain_rows,
)
from fenics_hytf.operators.secant import BULK_OVER_SHEAR, SecantForm

__all__ = [
    "BULK_OVER_SHEAR",
    "NORMAL_STRAINS",
    "STRENGTH",
    "DashpotForm",
    "Dilation",
    "ElasticForm",
    "GeometricForm",
    "GhostForm",
    "InternalForce",
    "SecantForm",
    "TractionForm",
    "assemble_mass",
    "boundary_area",
    "constrained_rows",
    "displacement_rows",
    "evaluate",
    "gauss_sites",
    "isotropic_stress",
    "mean_rows",
    "rayleigh_damping",
    "split_rows",
    "strain_rows",
]
