# SPDX-License-Identifier: MIT
"""Strength with friction, frozen from the static stress: what factor of safety follows from it.

In an infinite slope of angle β stress across it is σ_y = γz cos β, along it σ_x = K σ_y, and the
shear stress γz sin β. With p = ½(σ_x + σ_y) the strength is c cos φ + p sin φ, and

    FS = ½(1 + K) sin φ / tan β + c cos φ / (γz sin β)

with K = ν/(1 − ν) in elastic ground. Limit equilibrium has tan φ / tan β for the first term: there
σ_x is what failure makes of it, and what slips is not the plane of the largest shear stress.
"""

import numpy as np
import pytest
from support.sliding import DENSITY, GRAVITY, sine

from fenics_hytf.lapse import Statics
from fenics_hytf.particles import transfer_matrix
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import factor_of_safety

HEIGHT, CELLS = 10.0, 10
SETTLED = 1e-4  # of the dissipation: what a search leaves to be gained


@pytest.fixture
def tilted(monkeypatch):
    """Gravity along the slope and across it, of a column whose axes are."""

    def tilt(slope: float) -> None:
        def weight(self, points):
            pull = np.zeros((len(points), points.x.shape[1]))
            pull[:, 0], pull[:, -1] = np.sin(slope), -np.cos(slope)
            force = GRAVITY * points.mass[:, None] * pull
            return np.asarray(transfer_matrix(points, self._domain.V).T @ force).ravel()

        monkeypatch.setattr(Statics, "weight_of", weight)

    return tilt


def infinite_slope(soil: dict, initial_stress: str, dim: int = 2) -> Scene:
    across = [2.0] * (dim - 1)
    cells = [1] * (dim - 1) + [CELLS]
    sides = ("left", "right", "front", "back")[: 2 * dim - 2]
    usual = {"density": DENSITY, "shear_wave_velocity": 200.0, "damping": 0.05}
    gravity = {"acceleration": GRAVITY, "initial_stress": initial_stress}
    return Scene.from_dict(
        {
            "mesh": {"box": {"size": [*across, HEIGHT], "cells": cells}},
            "soil": {"sand": usual | soil},
            "motion": [sine(1, 40, 0.01)],
            "boundary": dict.fromkeys(sides, "tied"),
            "effects": {"gravity": gravity, "sliding": {"unstable_at_rest": True}},
        }
    )


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(
    ("poisson", "k0", "angle"),
    [(0.3, None, 30.0), (0.45, None, 20.0), (0.49, None, 35.0), (0.3, 0.5, 30.0), (0.3, 1.3, 30.0)],
)
def test_of_an_infinite_slope_without_cohesion(poisson, k0, angle, dim, tilted, figure):
    """In elastic ground 0.6 to 0.9 of tan φ / tan β, the less the larger φ and the smaller ν."""
    slope, phi = np.radians(15.0), np.radians(angle)
    soil = {"poisson": poisson, "friction_angle": angle}
    case = infinite_slope(soil | ({} if k0 is None else {"k0": k0}), "k0" if k0 else "elastic", dim)
    tilted(slope)
    K = k0 or poisson / (1 - poisson)
    if dim == 3:  # the third principal stress, K σ_y, lies between the others
        stress = np.array([[K, 0, np.tan(slope)], [0, K, 0], [np.tan(slope), 0, 1.0]])
        mean = np.linalg.eigvalsh(stress)[[0, -1]].mean()
        assert mean == pytest.approx((1 + K) / 2)
    expected = 0.5 * (1 + K) * np.sin(phi) / np.tan(slope)
    found = factor_of_safety(case)
    name = f"infinite slope, {dim}D, ν {poisson:g}, φ {angle:g}°, K {K:.2f}: FS"
    figure(f"{name} against the closed form", abs(found / expected - 1), SETTLED)
    ratio = found * np.tan(slope) / np.tan(phi)
    assert ratio == pytest.approx(0.5 * (1 + K) * np.cos(phi), rel=SETTLED)


def test_of_an_infinite_slope_with_cohesion(tilted, figure):
    """The deepest layer yields first: its cells of degree 1 shear about their middle.

    The limit is for what the layers above it, not much stronger, shear besides.
    """
    slope, phi, cohesion = np.radians(20.0), np.radians(25.0), 8e3
    soil = {"poisson": 0.3, "friction_angle": 25.0, "cohesion": cohesion}
    tilted(slope)
    depth = HEIGHT * (1 - 0.5 / CELLS)
    expected = 0.5 / 0.7 * np.sin(phi) / np.tan(slope)
    expected += cohesion * np.cos(phi) / (DENSITY * GRAVITY * depth * np.sin(slope))
    found = factor_of_safety(infinite_slope(soil, "elastic"))
    figure("infinite slope with cohesion: FS", abs(found / expected - 1), 1e-3)
