# SPDX-License-Identifier: MIT
"""Curves by depth from the practice of the United States, for cohesionless and alluvial soils.

- GEI (1983): Geotechnical Engineers Inc., sands and gravels.
- GeoMatrix (1990): Geomatrix Consultants. The modulus of the two deepest ranges is one curve.
- Imperial Valley and Peninsular Range: W. J. Silva, N. Abrahamson, G. Toro, C. Costantino,
  Description and validation of the stochastic ground motion model, Pacific Engineering and
  Analysis for Brookhaven National Laboratory, 1996; soils of two regions of California that are
  more linear than the curves of EPRI (1993).

The readings are those of the site-response program Strata (Kottke and Rathje), where both columns
of a depth range are there. One of its readings, G/G_max = 0.999 of GeoMatrix at 50 to 150 ft and
a strain of 1e-5, stands above the 0.998 before it and is taken as that.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from fenics_hytf.soil.curves import Curve

_STRAIN = (1e-6, 3.162e-6, 1e-5, 3.162e-5, 1e-4, 3.162e-4, 1e-3, 3.162e-3, 1e-2, 3.162e-2, 1e-1)

_GEOMATRIX_DEEP = (1.000, 1.000, 1.000, 0.999, 0.939, 0.826, 0.620, 0.381, 0.162, 0.052, 0.052)

_TABLES = {
    "gei_1983_0_50ft": (
        (1.000, 0.990, 0.980, 0.910, 0.780, 0.560, 0.330, 0.160, 0.065, 0.040, 0.040),
        (0.0150, 0.0150, 0.0150, 0.0175, 0.0385, 0.0775, 0.1310, 0.1875, 0.2300, 0.2600, 0.2600),
    ),
    "gei_1983_50_100ft": (
        (1.000, 0.990, 0.980, 0.935, 0.816, 0.610, 0.360, 0.175, 0.065, 0.040, 0.040),
        (0.0150, 0.0150, 0.0150, 0.0160, 0.0315, 0.0650, 0.1175, 0.1775, 0.2250, 0.2560, 0.2560),
    ),
    "gei_1983_100_250ft": (
        (1.000, 0.990, 0.980, 0.947, 0.852, 0.670, 0.425, 0.200, 0.065, 0.040, 0.040),
        (0.0150, 0.0150, 0.0150, 0.0150, 0.0250, 0.0500, 0.1000, 0.1650, 0.2200, 0.2540, 0.2540),
    ),
    "gei_1983_250_500ft": (
        (1.000, 0.995, 0.990, 0.965, 0.890, 0.725, 0.495, 0.240, 0.080, 0.040, 0.040),
        (0.0150, 0.0150, 0.0150, 0.0150, 0.0210, 0.0375, 0.0825, 0.1475, 0.2050, 0.2425, 0.2425),
    ),
    "gei_1983_below_500ft": (
        (1.000, 1.000, 1.000, 0.985, 0.925, 0.775, 0.565, 0.300, 0.100, 0.040, 0.040),
        (0.0150, 0.0150, 0.0150, 0.0150, 0.0175, 0.0250, 0.0625, 0.1300, 0.1900, 0.2310, 0.2310),
    ),
    "geomatrix_1990_0_50ft": (
        (1.000, 0.991, 0.985, 0.943, 0.854, 0.688, 0.454, 0.259, 0.100, 0.052, 0.052),
        (0.0210, 0.0210, 0.0250, 0.0250, 0.0373, 0.0656, 0.1123, 0.1598, 0.2109, 0.2411, 0.2411),
    ),
    "geomatrix_1990_50_150ft": (
        (1.000, 0.998, 0.998, 0.975, 0.900, 0.767, 0.536, 0.319, 0.134, 0.052, 0.052),
        (0.0150, 0.0150, 0.0152, 0.0195, 0.0295, 0.0473, 0.0857, 0.1307, 0.1859, 0.2411, 0.2411),
    ),
    "geomatrix_1990_150_300ft": (
        _GEOMATRIX_DEEP,
        (0.0150, 0.0150, 0.0152, 0.0168, 0.0225, 0.0322, 0.0619, 0.1027, 0.1566, 0.2411, 0.2411),
    ),
    "geomatrix_1990_below_300ft": (
        _GEOMATRIX_DEEP,
        (0.0096, 0.0098, 0.0101, 0.0101, 0.0107, 0.0156, 0.0415, 0.0784, 0.1208, 0.1784, 0.1784),
    ),
    "imperial_valley_0_300ft": (
        (1.000, 1.000, 1.000, 1.000, 0.973, 0.904, 0.699, 0.459, 0.247),
        (0.0095, 0.0095, 0.0095, 0.0095, 0.0122, 0.0203, 0.0406, 0.0798, 0.1204),
    ),
    "imperial_valley_below_300ft": (
        (1.000, 1.000, 1.000, 1.000, 0.986, 0.952, 0.767, 0.541, 0.329),
        (0.0054, 0.0054, 0.0054, 0.0054, 0.0054, 0.0095, 0.0271, 0.0595, 0.0987),
    ),
    "peninsular_range_0_50ft": (
        (1.000, 1.000, 1.000, 0.963, 0.868, 0.677, 0.427, 0.221, 0.088),
        (0.0106, 0.0106, 0.0121, 0.0166, 0.0288, 0.0560, 0.1059, 0.1665, 0.2300),
    ),
    "peninsular_range_50_500ft": (
        (1.000, 1.000, 1.000, 0.985, 0.941, 0.846, 0.647, 0.404, 0.191),
        (0.0060, 0.0060, 0.0060, 0.0091, 0.0121, 0.0258, 0.0545, 0.1059, 0.1665),
    ),
}

REGIONAL: Mapping[str, Curve] = MappingProxyType(
    {
        name: Curve(np.array(_STRAIN[: len(modulus)]), np.array(modulus), np.array(damping))
        for name, (modulus, damping) in _TABLES.items()
    }
)
"""Curves by name; depths as published (1 ft = 0.3048 m)."""
