# SPDX-License-Identifier: MIT
"""The equivalent-linear loop alone: peak strains are functions of the moduli, without a sweep."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fenics_hytf.lapse import Ground, LoopHistory, Moduli, iterate
from fenics_hytf.scene import EquivalentLinear
from fenics_hytf.soil import Curve

STRAIN = np.array([1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
SOFTENING = np.array([1.0, 0.97, 0.75, 0.3, 0.06])
RISING = np.array([0.01, 0.015, 0.05, 0.14, 0.24])
GMAX = 50e6


def ground(*curves: Curve | None, cells: tuple[int, ...] = (0,)) -> Ground:
    """Cells of soils with given curves."""
    region = np.array(cells, np.int32)
    full = np.ones(len(region))
    return Ground(region, 2000.0 * full, GMAX * full, 0.3 * full, 0.02 * full, curves)


def settings(**changes: float) -> EquivalentLinear:
    """Of the loop, with 1e-4 asked for."""
    return EquivalentLinear(**{"tolerance": 1e-4, "strain_ratio": 0.65, **changes})


def run(
    soil: Ground,
    peak: Callable[[Moduli], np.ndarray],
    start: float,
    strain_from: np.ndarray | None = None,
    **changes: float,
) -> tuple[Moduli, np.ndarray, LoopHistory]:
    """The loop's results: the moduli, the strain that they caused, and how it went."""
    solved, reported = [], []

    def peak_strain(moduli, iteration):
        solved.append(moduli)
        assert iteration == len(solved)
        return peak(moduli)

    moduli, effective, history = iterate(
        soil,
        settings(**changes),
        np.broadcast_to(start, soil.region.shape).astype(float),
        peak_strain,
        lambda iteration, change: reported.append((iteration, change)),
        strain_from,
    )
    assert reported == [(i + 1, c) for i, c in enumerate(history.change)]
    assert moduli is solved[-1]
    return moduli, effective, history


def misfit(soil: Ground, moduli: Moduli, effective: np.ndarray) -> float:
    """How far the moduli are off those of the strain that they caused, relative."""
    caused = soil.secant(effective)
    off = [moduli.shear_modulus / caused.shear_modulus, moduli.damping / caused.damping]
    return float(np.abs(np.array(off) - 1).max())
