# SPDX-License-Identifier: MIT
"""The two-layer column of the paper, shaken along itself, against its closed form."""

import numpy as np
import pytest
from support.reference import two_layer_transfer

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate

DENSITY = (7800.0, 1560.0)
YOUNG = (2.0e9, 4.432e9)
POISSON = 0.3
HEIGHT = (50.0, 50.0)


def column(cells: int, degree: int, damping: float, frequency: float) -> Scene:
    """A harmonic along a column held sideways; ``cells`` over the whole height."""
    layers = [
        {"thickness": h, "soil": name, "cells": cells // 2}
        for h, name in zip(HEIGHT, ("upper", "lower"), strict=True)
    ]
    soil = {
        name: {"density": rho, "youngs_modulus": E, "poisson": POISSON, "damping": damping}
        for name, rho, E in zip(("upper", "lower"), DENSITY, YOUNG, strict=True)
    }
    harmonic = {"amplitude": 1.0, "frequency": frequency, "cycles": 4, "samples": 1024}
    return Scene.from_dict(
        {
            "mesh": {"column": {"width": 4.0, "layers": layers}, "degree": degree},
            "soil": soil,
            "motion": [{"direction": "y", "harmonic": harmonic}],
            "boundary": {"left": "roller", "right": "roller"},
            "output": {"receivers": {"top": [2.0, 100.0], "middle": [2.0, 50.0]}},
        }
    )


def closed_form(damping: float, frequency: float) -> complex:
    factor = (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON)) * (1 + 2j * damping)
    modulus = tuple(E * factor for E in YOUNG)
    return complex(two_layer_transfer(2 * np.pi * frequency, HEIGHT, DENSITY, modulus))


@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize("frequency", [0.01, 0.5])
def test_amplitude(damping, frequency, figure):
    # The first mode is at 0.86 Hz: one frequency far below it, one where the response is dynamic.
    lapse = simulate(column(20, 1, damping, frequency)).lapses[0]
    assert lapse.solved_lines == 1
    exact = closed_form(damping, frequency)
    amplitude = np.abs(lapse.total_acceleration[0, 1]).max()
    # The history touches its amplitude only near a sample: of 256 a cycle it misses at most
    # (pi/256)**2 / 2 = 8e-5, which the limit includes.
    figure(
        f"column y, {frequency} Hz, D = {damping}: amplitude of the transfer function",
        abs(abs(lapse.transfer[0, 1, 0, 0]) / abs(exact) - 1),
        1e-3,
    )
    assert amplitude == pytest.approx(abs(exact), rel=1e-3)
    relative = np.abs(lapse.displacement[0, 1]).max()
    expected = abs(exact - 1) / (2 * np.pi * frequency) ** 2
    # u = (T - 1) / omega^2 amplifies the error of T where T is near 1; the mesh's error of the
    # static part is zero, so the same bound holds.
    figure(
        f"column y, {frequency} Hz, D = {damping}: amplitude of the displacement",
        abs(relative / expected - 1),
        1e-3,
    )


@pytest.mark.parametrize(("degree", "asked"), [(1, 1.9), (2, 3.8)])
def test_order_of_convergence(degree, asked, figure):
    frequency, damping = 1.6, 0.05
    exact = closed_form(damping, frequency)
    sizes = (8, 16, 32) if degree == 1 else (4, 8, 16)
    error = []
    for cells in sizes:
        lapse = simulate(column(cells, degree, damping, frequency)).lapses[0]
        error.append(abs(lapse.transfer[0, 1, 0, 0] - exact))
    order = np.log2(error[-2] / error[-1])
    figure(f"degree {degree}: order of the transfer function in h", order, asked, at_least=True)
