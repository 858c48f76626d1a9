# SPDX-License-Identifier: MIT
"""What points carry over a seam, and the stress that a law makes of it.

Each part of a law acts on a strain of its own: the springs on γ, a Maxwell branch on its memory
ζ_m. What of the stress none of them explains is left to fade.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import sparse

from fenics_hytf.lapse.material import Material, Part
from fenics_hytf.operators import NORMAL_STRAINS, isotropic_stress
from fenics_hytf.particles import Points
from fenics_hytf.soil import RELAXATION_TIMES

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

FADING = 0.5
"""τ_q, with which a rest of stress fades after the moduli have changed [s]."""


@dataclass(frozen=True)
class State:
    """What points carry, at the points themselves or elsewhere.

    Attributes:
        displacement: Shape ``(n, num_components)``.
        strain: γ, shape ``(n, num_strains)``.
        stress: σ, same shape.
        memory: ζ, shape ``(n, 4, num_strains)``, or ``None`` where nothing is remembered.
    """

    displacement: RealArray
    strain: RealArray
    stress: RealArray
    memory: RealArray | None

    @classmethod
    def of(cls, points: Points, R: sparse.csr_matrix | None = None) -> State:
        """That of the points, or what a resampling matrix makes of it."""

        def read(name: str) -> RealArray:
            values = points[name]
            if R is None:
                return values
            flat = values.reshape(len(values), -1)
            return np.asarray(R @ flat).reshape(R.shape[0], *values.shape[1:])

        return cls(
            read("dynamic_displacement"),
            read("dynamic_strain"),
            read("dynamic_stress"),
            read("memory_strain") if "memory_strain" in points.history else None,
        )

    def strain_of(self, part: Part) -> RealArray:
        """The strain that a part of the law acts on."""
        if part.relaxation_time is None:
            return self.strain
        assert self.memory is not None
        return self.memory[:, RELAXATION_TIMES.index(part.relaxation_time)]


def stress_of(state: State, material: Material, cells: npt.NDArray[np.int64]) -> RealArray:
    """Σ_j D_j of the strains that the parts act on.

    Args:
        state: What points carry.
        material: The law of every cell.
        cells: Cell of each point in the order of the input, shape ``(n,)``.

    Returns:
        Stress [Pa], shape ``(n, num_strains)``.
    """
    total = np.zeros_like(state.strain)
    for part in material.parts:
        total += isotropic_stress(state.strain_of(part), *part.constants.at(cells))
    return total


def fading(relaxation_time: float | None, s: ComplexArray) -> ComplexArray:
    """Transform of e^{−t/τ}, or of 1."""
    return 1 / s if relaxation_time is None else relaxation_time / (1 + s * relaxation_time)


def half_of_normal(stress: RealArray) -> RealArray:
    """Stress in the measure of G times Voigt strain: half the normal deviator, and shear.

    Args:
        stress: Voigt components [Pa], shape ``(n, num_strains)``.

    Returns:
        [Pa], shaped like ``stress``.
    """
    normal = NORMAL_STRAINS[stress.shape[1]]
    measure = stress.copy()
    if normal:
        measure[:, :normal] -= stress[:, :normal].mean(axis=1, keepdims=True)
        measure[:, :normal] /= 2
    return measure
