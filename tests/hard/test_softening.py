# SPDX-License-Identifier: MIT
"""Hard case 33, the half of it that softens: guards what moduli that fall leave behind.

Naively stress falls with every fluctuation of G, and the slope ratchets. With the running minimum
of G an infinite slope shears by γ = τ₀(1/G_min − 1/G₀), in as many lapses as one likes, and
earthquakes that bring no new minimum move nothing. Sliding is in ``test_sliding.py``.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.sliding import GRAVITY, in_file

from fenics_hytf.lapse import Statics
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import Result, simulate

ROUND_OFF = 1e-10
ANGLE = np.radians(20.0)
CURVES = {"model": "darendeli", "plasticity_index": 15, "mean_stress": 60e3, "ocr": 1}
SOILS = {
    "clay": {"density": 1800.0, "shear_wave_velocity": 150.0, "poisson": 0.3, "curves": CURVES},
    "gravel": {"density": 2000.0, "shear_wave_velocity": 250.0, "poisson": 0.25, "damping": 0.02},
}
LAYERS = [
    {"thickness": 4.0, "soil": "clay", "cells": 4},
    {"thickness": 2.0, "soil": "gravel", "cells": 1},
    {"thickness": 6.0, "soil": "clay", "cells": 3},
]
EDGES = np.array([0.0, 2.0, 4.0, 6.0, 8.0, 9.0, 10.0, 11.0, 12.0])
SAMPLES, DT = 640, 0.01


def shaking() -> np.ndarray:
    """A burst of 1 to 4 Hz that swells, and fades to a quiet end [m/s2]."""
    t = DT * np.arange(SAMPLES)
    waves = sum(np.sin(2 * np.pi * f * t + f**2) for f in (1.1, 1.7, 2.3, 3.9))
    return 2.0 * waves * t**2 * np.exp(-2.0 * t)


def slope(folder: Path, lapses: int, earthquakes: tuple[float, ...] = (1.0,)) -> Result:
    """A slope without end, of layers, after so many times the shaking, each in so many lapses.

    It is seen along itself: a column between tied sides, whose gravity pulls along x besides.
    """
    level = Statics.weight_of

    def weight_of(self: Statics, points) -> np.ndarray:
        weight = level(self, points).reshape(-1, 2)
        weight[:, 0] = -np.tan(ANGLE) * weight[:, 1]
        return weight.ravel()

    motion = np.concatenate([scale * shaking() for scale in earthquakes])
    case = Scene.from_dict(
        {
            "mesh": {"column": {"width": 1.0, "layers": LAYERS}},
            "soil": SOILS,
            "motion": [in_file(folder, motion, DT)],
            "boundary": {"left": "tied", "right": "tied"},
            "lapses": {"count": lapses * len(earthquakes), "continuity": "transient"},
            "effects": {
                "equivalent_linear": True,
                "gravity": {"acceleration": GRAVITY * np.cos(ANGLE), "initial_stress": "elastic"},
                "softening": True,
            },
            "solver": {"complex_modulus": "maxwell"},
            "output": {"receivers": {f"at{h:g}": [0.5, h] for h in EDGES}},
        }
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Statics, "weight_of", weight_of)
        return simulate(case)


def moduli(result: Result) -> tuple[np.ndarray, np.ndarray]:
    """G of every cell in every lapse, the first row at small strain, from the bottom up [Pa]."""
    cells = result.lapses[0].cells
    order = np.argsort(cells.centroid[:, 1])
    small = cells.shear_modulus / cells.g_over_gmax
    return np.stack([small, *(i.cells.shear_modulus for i in result.lapses)])[:, order], order


def at_edges(strain: np.ndarray) -> np.ndarray:
    """Displacement at the edges of cells of so much mean strain [m]."""
    return np.concatenate([[0.0], np.cumsum(strain * np.diff(EDGES))])


def bearing() -> np.ndarray:
    """Weight above the middle of every cell along gravity [Pa], from the bottom up."""
    density = np.where((EDGES[1:] <= 6.0) | (EDGES[:-1] >= 8.0), 1800.0, 2000.0)
    weight = GRAVITY * density * np.diff(EDGES)
    return np.cumsum(weight[::-1])[::-1] - weight / 2


def falls(G: np.ndarray) -> np.ndarray:
    """What a stress that falls with every fall of G, and never rises, makes of it [1/Pa]."""
    return sum(np.maximum(1 / b - 1 / a, 0) for a, b in pairwise(G))


@pytest.mark.parametrize("lapses", [1, 4, 32])
def test_33_an_infinite_slope_shears_by_its_softest(lapses, tmp_path, figure):
    """γ = τ₀(1/G_min − 1/G₀) in 1 to 32 lapses; naively stress falls with every fall of G."""
    result = slope(tmp_path, lapses)
    G, order = moduli(result)
    small, least = G[0], G.min(axis=0)
    assert (least[0] < 0.7 * small[0]) and least[3] == small[3]  # gravel has no curves
    told = result.lapses[-1].softening
    np.testing.assert_allclose(told.softest[order], least / small, rtol=1e-14)

    shear = bearing() * np.sin(ANGLE) * (1 / least - 1 / small)
    bulk = np.array([13 / 6] * 3 + [5 / 3] + [13 / 6] * 4) * small  # of ν = 0.3 and 0.25
    stiff = [bulk + 4 / 3 * modulus for modulus in (least, small)]
    settled = -bearing() * np.cos(ANGLE) * (1 / stiff[0] - 1 / stiff[1])
    for name, strain, found in zip(
        ("shear", "settlement"), (shear, settled), told.displacement.T, strict=True
    ):
        expected = at_edges(strain)
        off = np.abs(found - expected).max() / np.abs(expected).max()
        figure(f"softening of an infinite slope: {name}", off, ROUND_OFF)
    if lapses == 32:
        ratchet = at_edges(bearing() * np.sin(ANGLE) * falls(G))[-1] / told.displacement[-1, 0]
        figure("naive, falls only, 32 lapses: times the shear", ratchet, 1.1, at_least=True)


def test_33_earthquakes_that_bring_no_new_minimum(tmp_path, figure):
    """Three of them move the slope as the first has; every rise and fall adds up to more."""
    result = slope(tmp_path, 4, (1.0, 0.8, 0.6))
    G, _ = moduli(result)
    assert (G[5:].min(axis=0) >= G[:5].min(axis=0)).all()
    first, last = (result.lapses[n].softening.displacement for n in (3, 11))
    assert np.abs(last).max() > 1e-3
    figure("softening without a new minimum", np.abs(last - first).max(), 0, "m")
    ratchet = at_edges(bearing() * np.sin(ANGLE) * falls(G))[-1] / last[-1, 0]
    figure("naive, falls only, three earthquakes: against one", ratchet, 2.0, at_least=True)
