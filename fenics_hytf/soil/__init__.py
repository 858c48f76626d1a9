# SPDX-License-Identifier: MIT
"""Soil: elastic constants, complex modulus, equivalent-linear curves. Knows no mesh and no MPI."""

from fenics_hytf.soil.complex_modulus import COMPLEX_MODULUS, complex_factor
from fenics_hytf.soil.curves import Curve
from fenics_hytf.soil.darendeli import darendeli
from fenics_hytf.soil.elastic import Elastic
from fenics_hytf.soil.models import CURVE_MODELS, curve_from_model
from fenics_hytf.soil.published import seed_idriss_1970, vucetic_dobry_1991

__all__ = [
    "COMPLEX_MODULUS",
    "CURVE_MODELS",
    "Curve",
    "Elastic",
    "complex_factor",
    "curve_from_model",
    "darendeli",
    "seed_idriss_1970",
    "vucetic_dobry_1991",
]
