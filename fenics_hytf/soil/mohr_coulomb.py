# SPDX-License-Identifier: MIT
"""Shear strength after Mohr and Coulomb, from the mean stress.

    τ_f = c cos φ + p sin φ

is the radius of the largest circle that a failing soil has about the mean p of its major and minor
principal stress, compression positive; of an undrained soil, φ = 0, it is the cohesion.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def shear_strength(
    cohesion: npt.ArrayLike, friction_angle: npt.ArrayLike, mean_pressure: npt.ArrayLike
) -> npt.NDArray[np.float64]:
    """Radius of the circle at failure.

    Args:
        cohesion: c [Pa], any shape.
        friction_angle: φ [degrees], likewise.
        mean_pressure: p [Pa]; soil in tension has that of none.

    Returns:
        τ_f [Pa], of the shape that the arguments make together.
    """
    angle = np.radians(np.asarray(friction_angle, np.float64))
    pressure = np.maximum(np.asarray(mean_pressure, np.float64), 0.0)
    return np.asarray(np.asarray(cohesion) * np.cos(angle) + pressure * np.sin(angle))
