# SPDX-License-Identifier: MIT
"""Sweeps over frequencies of an affine complex symmetric system."""

from fenics_hytf.frequency.columns import Columns
from fenics_hytf.frequency.direct import SymmetricFactorisation, direct_sweep
from fenics_hytf.frequency.errors import (
    FactorisationError,
    ReductionError,
    ResidualError,
    ResonanceError,
    SweepError,
)
from fenics_hytf.frequency.groups import share
from fenics_hytf.frequency.inertia import negative_eigenvalues
from fenics_hytf.frequency.loads import AffineLoads, Loads
from fenics_hytf.frequency.products import multiply, real_rows
from fenics_hytf.frequency.reduced import ReducedSweep, reduced_sweep
from fenics_hytf.frequency.sweep import JoinedSweep, Sweep
from fenics_hytf.frequency.system import (
    DynamicSystem,
    ScalarFunction,
    constant,
    hysteretic,
    radiation,
)

__all__ = [
    "AffineLoads",
    "Columns",
    "DynamicSystem",
    "FactorisationError",
    "JoinedSweep",
    "Loads",
    "ReducedSweep",
    "ReductionError",
    "ResidualError",
    "ResonanceError",
    "ScalarFunction",
    "Sweep",
    "SweepError",
    "SymmetricFactorisation",
    "constant",
    "direct_sweep",
    "hysteretic",
    "multiply",
    "negative_eigenvalues",
    "radiation",
    "real_rows",
    "reduced_sweep",
    "share",
]
