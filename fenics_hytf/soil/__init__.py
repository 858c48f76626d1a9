# SPDX-License-Identifier: MIT
"""Soil: elastic constants, complex modulus, equivalent-linear curves. Knows no mesh and no MPI."""

from fenics_hytf.soil.complex_modulus import COMPLEX_MODULUS, complex_factor, wave_factors
from fenics_hytf.soil.curves import Curve
from fenics_hytf.soil.darendeli import darendeli
from fenics_hytf.soil.degradation import (
    CyclicState,
    DegradationLaw,
    continue_count,
    open_cycles,
)
from fenics_hytf.soil.elastic import Elastic
from fenics_hytf.soil.epri import epri_1993_pi
from fenics_hytf.soil.files import CurveFileError, read_curve_file
from fenics_hytf.soil.hyperbolic import hardin_drnevich, mkz
from fenics_hytf.soil.ishibashi_zhang import ishibashi_zhang
from fenics_hytf.soil.maxwell import (
    HELD_DAMPING,
    RELAXATION_TIMES,
    branch_weights,
    branches,
    maxwell_factor,
    relaxed_factor,
)
from fenics_hytf.soil.menq import menq
from fenics_hytf.soil.models import CURVE_MODELS, curve_from_model
from fenics_hytf.soil.mohr_coulomb import shear_strength
from fenics_hytf.soil.published import seed_idriss_1970, vucetic_dobry_1991
from fenics_hytf.soil.strength import LimitedCurve, limit_strength

__all__ = [
    "COMPLEX_MODULUS",
    "CURVE_MODELS",
    "HELD_DAMPING",
    "RELAXATION_TIMES",
    "Curve",
    "CurveFileError",
    "CyclicState",
    "DegradationLaw",
    "Elastic",
    "LimitedCurve",
    "branch_weights",
    "branches",
    "complex_factor",
    "continue_count",
    "curve_from_model",
    "darendeli",
    "epri_1993_pi",
    "hardin_drnevich",
    "ishibashi_zhang",
    "limit_strength",
    "maxwell_factor",
    "menq",
    "mkz",
    "open_cycles",
    "read_curve_file",
    "relaxed_factor",
    "seed_idriss_1970",
    "shear_strength",
    "vucetic_dobry_1991",
    "wave_factors",
]
