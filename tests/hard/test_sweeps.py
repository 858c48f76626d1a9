# SPDX-License-Identifier: MIT
"""Hard cases 15 and 21: resonances hit exactly, and the reduced sweep where it is hardest.

Naively what is found at an undamped resonance is round-off that looks like a solution, and a basis
that fits at a few frequencies is taken to fit at all of them.
"""

from collections import Counter

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse.linalg import eigsh
from support.meshes import SOIL, scene

from fenics_hytf.domain import build
from fenics_hytf.frequency import ReductionError, SweepError, direct_sweep, reduced_sweep
from fenics_hytf.lapse import Equations, Moduli, material, seed_points, survey

MOTION = {"harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 8}}
TOLERANCE = 1e-6


BOXES = {  # 200 modes below 11 Hz in the section
    2: {"size": [60.0, 20.0], "cells": [60, 20], "cell": "quadrilateral"},
    3: {"size": [30.0, 20.0, 20.0], "cells": [6, 4, 6], "cell": "hexahedron"},
}


class Body:
    """Soft ground of random stiffness."""

    def __init__(self, damping: float, sides: str, directions: str = "x", dim: int = 2):
        case = scene(
            {"box": BOXES[dim]},
            ("clay",),
            soil={"clay": SOIL | {"shear_wave_velocity": 100.0, "damping": damping}},
            motion=[MOTION | {"direction": d} for d in directions],
            boundary=dict.fromkeys(("left", "right", "front", "back")[: 2 * (dim - 1)], sides),
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


def hit(K: sparse.csr_matrix, M: sparse.csr_matrix, resonance: float) -> float:
    """How far a frequency is off the natural one next to it, relative."""
    nearest = eigsh(K, 1, M, sigma=resonance**2, return_eigenvectors=False)[0]
    return float(abs(np.sqrt(nearest) / resonance - 1))


@pytest.mark.parametrize("sweep", [direct_sweep, reduced_sweep])
@pytest.mark.parametrize(("dim", "mode"), [(2, 0), (2, 5), (2, 40), (3, 0), (3, 7)])
def test_15_an_undamped_resonance_is_an_error_or_damped(sweep, dim, mode, figure):
    """Typed on the real axis, whose solution there is round-off; solved on the damped contour."""
    body = Body(0.0, "tied", dim=dim)
    resonance = body.frequencies(mode + 1)[mode]
    K, M = (_csr(matrix) for matrix in (body.system.terms[0][0], body.system.mass))
    figure("resonance off its eigenvalue, hit to", hit(K, M, resonance), 1e-12)
    with pytest.raises(SweepError):
        sweep(body.system, body.loads, [1j * resonance], TOLERANCE)
    # eta T_p = 9.2 over 20 s
    found = sweep(body.system, body.loads, [0.46 + 1j * resonance], 1e-8)
    figure("residual on the damped contour", float(found.residuals.max()), 1e-8)


@pytest.mark.parametrize(
    ("name", "dim", "damping", "sides", "directions", "shift"),
    [
        ("5 % damping", 2, 0.05, "tied", "x", 0.0),
        ("dashpots, two sides", 2, 0.02, "dashpot", "xy", 0.0),
        ("undamped, damped contour", 2, 0.0, "tied", "x", 0.46),
        ("block, dashpots, three sides", 3, 0.02, "dashpot", "xyz", 0.0),
    ],
)
def test_21_the_reduced_sweep_at_200_modes(name, dim, damping, sides, directions, shift, figure):
    """On resonances and between; naively a basis that fits between them misses them."""
    body = Body(damping, sides, directions, dim)
    modes = body.frequencies(200)
    grid = np.linspace(0.1, modes[-1], 200 if dim == 2 else 40)
    lines = shift + 1j * np.sort(np.concatenate([grid, modes[:: 10 if dim == 2 else 20]]))
    found = reduced_sweep(body.system, body.loads, lines, TOLERANCE)
    assert found.residuals.shape[1] == len(directions)
    figure(f"{name}: error", body.error(found, lines), 10 * TOLERANCE)
    figure(f"{name}: residual", float(found.residuals.max()), TOLERANCE)
    figure(f"{name}: factorisations over lines", found.factorisations / len(lines), 0.5)


def test_21_it_says_so_when_it_cannot(figure):
    """Naively it ends with the best it has: here with two factorisations for 200 modes."""
    body = Body(0.05, "tied")
    lines = 1j * np.linspace(0.1, body.frequencies(200)[-1], 200)
    with pytest.raises(ReductionError, match="budget") as caught:
        reduced_sweep(body.system, body.loads, lines, TOLERANCE, budget=2)
    figure("lines that an error names", len(caught.value.lines), 1, at_least=True)
    figure("lines named that were not asked for", len(set(caught.value.lines) - set(lines)), 0)
