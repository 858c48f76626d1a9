# SPDX-License-Identifier: MIT
"""Hard cases 15 and 21: resonances hit exactly, and the reduced sweep where it is hardest."""

from collections import Counter

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse.linalg import eigsh
from support.meshes import SOIL, scene

from fenics_hytf.domain import build
from fenics_hytf.frequency import SweepError, direct_sweep, reduced_sweep
from fenics_hytf.lapse import Equations, Moduli, material, seed_points, survey

MOTION = {"harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 8}}
TOLERANCE = 1e-6


class Section:
    """A soft section 60 m x 20 m of random stiffness: 200 modes below 11 Hz."""

    def __init__(self, damping: float, sides: str, directions: str = "x"):
        case = scene(
            {"box": {"size": [60.0, 20.0], "cells": [60, 20]}},
            ("clay",),
            soil={"clay": SOIL | {"shear_wave_velocity": 100.0, "damping": damping}},
            motion=[MOTION | {"direction": d} for d in directions],
            boundary={"left": sides, "right": sides},
        )
        domain = build(case, MPI.COMM_SELF)
        self.equations = Equations(case, domain, Counter())
        points = seed_points(case, domain)
        self.equations.weigh(points)
        ground = survey(case, domain, points)
        spread = np.exp(0.4 * np.random.default_rng(7).normal(size=domain.num_cells))
        moduli = Moduli(spread * ground.shear_modulus, ground.damping)
        lapse = self.equations.assemble(ground, material(ground, moduli, case.solver))
        self.system, self.loads = lapse.system, lapse.loads

    def frequencies(self, count: int) -> np.ndarray:
        """Lowest undamped natural frequencies [rad/s]."""
        K, M = (_csr(matrix) for matrix in (self.system.terms[0][0], self.system.mass))
        return np.sqrt(np.sort(eigsh(K, count, M, sigma=0.0, return_eigenvectors=False)))

    def error(self, found, lines) -> float:
        """Largest error of a line against the direct sweep, over its solution."""
        direct = direct_sweep(self.system, self.loads, lines, 1e-9)
        norm = np.linalg.norm
        pairs = [(found.solution(k), direct.solution(k)) for k in range(len(lines))]
        return max(norm(a - b) / norm(b) for a, b in pairs)


def _csr(matrix: PETSc.Mat) -> sparse.csr_matrix:
    start, columns, values = matrix.getValuesCSR()
    return sparse.csr_matrix((values.real.copy(), columns, start), shape=matrix.getSize())


@pytest.mark.parametrize("sweep", [direct_sweep, reduced_sweep])
@pytest.mark.parametrize("mode", [0, 5, 40])
def test_15_an_undamped_resonance(sweep, mode, figure):
    """Naively the response there is round-off that looks like a solution."""
    section = Section(0.0, "tied")
    resonance = section.frequencies(mode + 1)[mode]
    with pytest.raises(SweepError):
        sweep(section.system, section.loads, [1j * resonance], TOLERANCE)
    # eta T_p = 9.2 over 20 s
    found = sweep(section.system, section.loads, [0.46 + 1j * resonance], 1e-8)
    name = f"case 15, mode {mode} hit, {sweep.__name__}: residual on the damped contour"
    figure(name, float(found.residuals.max()), 1e-8)


@pytest.mark.parametrize(
    ("name", "damping", "sides", "directions", "shift"),
    [
        ("5 % damping", 0.05, "tied", "x", 0.0),
        ("2 %, dashpots, two right-hand sides", 0.02, "dashpot", "xy", 0.0),
        ("undamped on the damped contour", 0.0, "tied", "x", 0.46),
    ],
)
def test_21_the_reduced_sweep_at_200_modes(name, damping, sides, directions, shift, figure):
    """Naively a basis that fits between the resonances misses them."""
    section = Section(damping, sides, directions)
    modes = section.frequencies(200)
    grid = np.linspace(0.1, modes[-1], 200)
    lines = shift + 1j * np.sort(np.concatenate([grid, modes[::10]]))
    found = reduced_sweep(section.system, section.loads, lines, TOLERANCE)
    figure(f"case 21, {name}: error", section.error(found, lines), 10 * TOLERANCE)
    figure(f"case 21, {name}: residual", float(found.residuals.max()), TOLERANCE)
    figure(f"case 21, {name}: factorisations over lines", found.factorisations / len(lines), 0.5)
