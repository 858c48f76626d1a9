# SPDX-License-Identifier: MIT
"""Soil: elastic constants, complex modulus, equivalent-linear curves. Knows no mesh and no MPI."""

from fenics_hytf.soil.complex_modulus import COMPLEX_MODULUS, complex_factor, wave_factors
from fenics_hytf.soil.curves import Curve
from fenics_hytf.soil.darendeli import darendeli
from fenics_hytf.soil.elastic import Elastic
from fenics_hytf.soil.epri import epri_1993_pi
from fenics_hytf.soil.files import CurveFileError, read_curve_file
from fenics_hytf.soil.hyperbolic import hardin_drnevich, mkz
from fenics_hytf.soil.ishibashi_zhang import ishibashi_zhang
from fenics_hytf.soil.menq import menq
from fenics_hytf.soil.models import CURVE_MODELS, curve_from_model
from fenics_hytf.soil.published import seed_idriss_1970, vucetic_dobry_1991
from fenics_hytf.soil.strength import LimitedCurve, limit_strength

__all__ = [
    "COMPLEX_MODULUS",
    "CURVE_MODELS",
    "Curve",
    "CurveFileError",
    "Elastic",
    "LimitedCurve",
    "complex_factor",
    "curve_from_model",
    "darendeli",
    "epri_1993_pi",
    "hardin_drnevich",
    "ishibashi_zhang",
    "limit_strength",
    "menq",
    "mkz",
    "read_curve_file",
    "seed_idriss_1970",
    "vucetic_dobry_1991",
    "wave_factors",
]
