# SPDX-License-Identifier: MIT
"""Largest values of histories: of the shear strain, and of the length of a vector.

Shear strain is the largest difference of principal strains. In plane strain QUAD4M's in-plane
convention √((ε_x − ε_y)² + γ_xy²) is the default; ``3d`` takes ε_z = 0 as the third principal
strain. In three dimensions all three principal strains count. Across a plane (SH) the two shears
make one, √(γ_xz² + γ_yz²).

Histories are many (cells times samples) and are looked at once, so the loops are compiled.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

RealArray = npt.NDArray[np.float64]
Histories = npt.NDArray[np.float64] | npt.NDArray[np.float32]


def peak_shear_strain(strain: Histories, convention: str = "plane") -> RealArray:
    """Largest shear strain over all instants.

    Args:
        strain: Voigt components xx, yy, [zz, yz, xz,] xy with shear as γ = 2ε [-], or xz, yz of a
            section that moves across its plane, shape ``(n, 2, 3 or 6, num_samples)``.
        convention: ``"plane"`` or ``"3d"``, for three components.

    Returns:
        Shape ``(n,)``, not negative; nought without a sample.
    """
    if strain.shape[1] == 6:
        return np.asarray(_spatial(strain))
    if strain.shape[1] == 2:
        return peak_length(strain)
    return np.asarray(_in_plane(strain, convention == "3d"))


def peak_length(vector: Histories) -> RealArray:
    """Largest length of a vector over all instants.

    Args:
        vector: Shape ``(n, num_components, num_samples)``.

    Returns:
        Shape ``(n,)``; nought without a sample.
    """
    return np.sqrt(_largest_square(vector))


# Histories are numbers, none of them NaN: said to the compiler, it takes many samples at a time.
_VECTORISED = {"nnan", "nsz", "reassoc"}


@njit(cache=True, fastmath=_VECTORISED)
def _largest_square(vector: Histories) -> RealArray:
    count, components, samples = vector.shape
    peak = np.zeros(count)
    square = np.empty(samples, vector.dtype)
    for i in range(count):
        for t in range(samples):
            square[t] = vector[i, 0, t] * vector[i, 0, t]
        for c in range(1, components):
            for t in range(samples):
                square[t] += vector[i, c, t] * vector[i, c, t]
        peak[i] = _largest(square)
    return peak


@njit(cache=True, fastmath=_VECTORISED)
def _largest(values: Histories) -> np.floating:
    largest = values.dtype.type(0)
    for t in range(len(values)):
        largest = max(largest, values[t])
    return largest


@njit(cache=True, fastmath=_VECTORISED)
def _in_plane(strain: Histories, third: bool) -> RealArray:
    """In a plane, with the third principal strain of nought where it counts."""
    count, _, samples = strain.shape
    peak = np.zeros(count)
    value = np.empty(samples, strain.dtype)
    for i in range(count):
        for t in range(samples):
            across = strain[i, 0, t] - strain[i, 1, t]
            value[t] = across * across + strain[i, 2, t] * strain[i, 2, t]
        if third:  # top over nought minus bottom under nought
            for t in range(samples):
                difference = np.sqrt(value[t])
                both = abs(strain[i, 0, t] + strain[i, 1, t])
                value[t] = max(difference, (both + difference) / 2)
        peak[i] = _largest(value) if third else np.sqrt(_largest(value))
    return peak


@njit(cache=True)
def _spatial(strain: Histories) -> RealArray:
    """In space. Principal strains are found only where they may differ by more than so far.

    Three numbers of a given variance J₂·2/3 differ by 2√J₂ at the most.
    """
    count, _, samples = strain.shape
    peak = np.zeros(count)
    tensor = np.empty((3, 3))
    for i in range(count):
        largest = 0.0
        for t in range(samples):
            for c in range(3):
                tensor[c, c] = strain[i, c, t]
            tensor[1, 2] = tensor[2, 1] = strain[i, 3, t] / 2
            tensor[0, 2] = tensor[2, 0] = strain[i, 4, t] / 2
            tensor[0, 1] = tensor[1, 0] = strain[i, 5, t] / 2
            xx, yy, zz = tensor[0, 0], tensor[1, 1], tensor[2, 2]
            square = ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 6
            square += tensor[1, 2] ** 2 + tensor[0, 2] ** 2 + tensor[0, 1] ** 2
            if 2 * np.sqrt(square) * (1 + 1e-12) > largest:
                principal = np.linalg.eigvalsh(tensor)
                largest = max(largest, principal[2] - principal[0])
        peak[i] = largest
    return peak
