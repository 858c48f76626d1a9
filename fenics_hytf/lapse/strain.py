# SPDX-License-Identifier: MIT
"""Shear strain measures: the largest difference of principal strains.

In plane strain QUAD4M's in-plane convention √((ε_x − ε_y)² + γ_xy²) is the default; ``3d`` takes
ε_z = 0 as the third principal strain. In three dimensions all three principal strains count.
Across a plane (SH) the two shears make one, √(γ_xz² + γ_yz²).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

RealArray = npt.NDArray[np.float64]


def shear_strain(strain: RealArray, convention: str = "plane") -> RealArray:
    """Largest difference of principal strains at every instant.

    Args:
        strain: Voigt components xx, yy, [zz, yz, xz,] xy with shear as γ = 2ε [-], or xz, yz of a
            section that moves across its plane, shape ``(n, 2, 3 or 6, num_samples)``.
        convention: ``"plane"`` or ``"3d"``, for three components.

    Returns:
        Shape ``(n, num_samples)``, not negative.
    """
    if strain.shape[1] == 6:
        return _spatial(strain)
    if strain.shape[1] == 2:
        return np.hypot(strain[:, 0], strain[:, 1])
    xx, yy, xy = strain[:, 0], strain[:, 1], strain[:, 2]
    in_plane = np.hypot(xx - yy, xy)
    if convention == "plane":
        return in_plane
    mean = (xx + yy) / 2
    top, bottom = mean + in_plane / 2, mean - in_plane / 2
    return np.maximum(top, 0.0) - np.minimum(bottom, 0.0)


def _spatial(strain: RealArray) -> RealArray:
    tensor = np.empty((strain.shape[0], strain.shape[2], 3, 3))
    for component, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]):
        value = strain[:, component] if i == j else strain[:, component] / 2
        tensor[:, :, i, j] = tensor[:, :, j, i] = value
    principal = np.linalg.eigvalsh(tensor)
    return principal[:, :, 2] - principal[:, :, 0]
