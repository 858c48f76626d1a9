# SPDX-License-Identifier: MIT
"""Hard case 23: a level layer that buckles under its own weight, near ρgH/G = 1.

Waves of the surface lose their stiffness first, the shorter the sooner, so the threshold falls with
the size of cells towards 1. Naively the sweep goes on with a stiffness that is no longer definite,
and what it finds grows without bound in time.
"""

import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse
from scipy.sparse.linalg import eigsh
from support.meshes import scene

from fenics_hytf.domain import build
from fenics_hytf.frequency import negative_eigenvalues
from fenics_hytf.lapse import (
    Equations,
    GeometricInstability,
    Statics,
    cell_stress,
    material,
    seed_points,
    survey,
)
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import SimulationError, inspect, simulate

DENSITY, GRAVITY, HEIGHT = 1800.0, 9.80665, 10.0
FINE, COARSE = (80, 40), (20, 10)
WORLD = MPI.COMM_WORLD


def layer(load: float, cells: tuple[int, ...], **sections) -> Scene:
    """A layer of ρgH/G = load, twice as long as it is high, between rollers.

    Given three numbers of cells it is as deep as these make it.
    """
    modulus = DENSITY * GRAVITY * HEIGHT / load
    depth = [2 * HEIGHT / cells[0] * count for count in cells[1:-1]]
    sides = ("left", "right", "front", "back")[: 2 + 2 * len(depth)]
    return scene(
        {"box": {"size": [2 * HEIGHT, *depth, HEIGHT], "cells": list(cells)}},
        ("clay",),
        **{
            "soil": {
                "clay": {
                    "density": DENSITY,
                    "shear_modulus": modulus,
                    "poisson": 0.3,
                    "damping": 0.02,
                }
            },
            "boundary": dict.fromkeys(sides, "roller"),
            "effects": {"gravity": True, "geometric_stiffness": True},
            "solver": {"sweep": "direct", "max_frequency": 2.0},
        }
        | sections,
    )


def stiffness(case: Scene) -> tuple:
    """K_L and K_NL of the layer at rest under its weight."""
    domain = build(case, MPI.COMM_SELF)
    equations, statics = Equations(case, domain, Counter()), Statics(case, domain)
    points = seed_points(case, domain)
    ground = survey(case, domain, points)
    equations.weigh(points)
    statics.settle(points, ground)
    equations.stiffen(cell_stress(domain, points))
    law = material(ground, ground.secant(np.zeros(domain.num_cells)), case.solver)
    (real, one), (imaginary, nought), (geometric, share) = equations.assemble(ground, law).lasting
    assert (one, nought, share) == (1.0, 0.0, 1.0) and imaginary.norm() > 0
    statics.destroy()
    return equations, real, geometric


def csc(matrix) -> sparse.csc_matrix:
    start, columns, values = matrix.getValuesCSR()
    assert not values.imag.any()
    return sparse.csr_matrix((values.real.copy(), columns, start)).tocsc()


def threshold(K_L, K_NL) -> tuple[float, float]:
    """ρgH/G from which the count finds a negative eigenvalue, and that by −K_NL x = μ K_L x."""
    definite, indefinite = 0.9, 1.2
    for load, negative in ((definite, False), (indefinite, True)):
        assert (negative_eigenvalues([(K_L, 1 / load), (K_NL, 1.0)]) > 0) == negative
    for _ in range(12):
        load = (definite + indefinite) / 2
        if negative_eigenvalues([(K_L, 1 / load), (K_NL, 1.0)]):
            indefinite = load
        else:
            definite = load
    largest = eigsh(-csc(K_NL), 1, csc(K_L), which="LA", return_eigenvectors=False, tol=1e-6)[0]
    return indefinite, 1 / largest


@pytest.mark.parametrize(("cells", "expected"), [((40, 20), 1.047), (FINE, 1.021)])
def test_23_threshold_of_the_stiffness(cells, expected, figure):
    """By bisection with the count, beside the largest eigenvalue of −K_NL x = μ K_L x."""
    equations, K_L, K_NL = stiffness(layer(1.0, cells))
    found, exact = threshold(K_L, K_NL)
    equations.destroy()
    if cells == FINE:  # the case's own
        figure("threshold of ρgH/G off 1.02, 80 x 40 cells", abs(found - 1.02), 0.02)
    figure("threshold off what it converges by", abs(found - expected), 1e-3)
    # twelve bisections of 0.3
    figure("threshold off the eigenvalue", abs(found - exact), 1e-4)


def test_23_in_space(figure):
    """Hexahedra find what quadrilaterals of their size do, and a run is told."""
    thresholds = []
    for cells in ((20, 10), (20, 2, 10)):
        equations, K_L, K_NL = stiffness(layer(1.0, cells))
        found, exact = threshold(K_L, K_NL)
        thresholds.append(found)
        equations.destroy()
    figure("3D: threshold off the eigenvalue", abs(found - exact), 1e-4)
    figure("3D: threshold above that of the section", found - thresholds[0], 1e-4)
    with pytest.raises(SimulationError, match=r"^lapse 0: found a stiffness with \d+ negative"):
        simulate(layer(1.02 * found, (20, 2, 10)))


def test_23_the_count_is_that_of_all_eigenvalues(figure):
    """Beyond the threshold, waves of one length after the other."""
    equations, K_L, K_NL = stiffness(layer(1.0, COARSE))
    left, right = (csc(matrix).toarray() for matrix in (K_L, K_NL))
    counts = []
    for load in (0.9, 1.2, 1.5, 3.0):
        exact = np.count_nonzero(np.linalg.eigvalsh(left / load + right) < 0)
        counts.append(exact)
        found = negative_eigenvalues([(K_L, 1 / load), (K_NL, 1.0)])
        figure("negative eigenvalues not counted", abs(found - exact), 0)
    equations.destroy()
    assert counts[0] == 0 and all(np.diff(counts) > 0)


def test_23_a_layer_below_the_threshold_is_shaken(figure):
    """At ρgH/G = 0.9; the count is one factorisation on top of those of the lines."""
    with_it, without = (
        simulate(layer(0.9, FINE, effects={"gravity": True, "geometric_stiffness": on}))
        for on in (True, False)
    )
    extra = with_it.work.factorisations - without.work.factorisations
    figure("factorisations for the count", extra, 1)
    assert with_it.work.factorisations == inspect(with_it.scene).factorisations
    assert with_it.lapses[0].factorisations == with_it.work.factorisations


@pytest.mark.parametrize("sweep", ["direct", "reduced"])
def test_23_a_layer_above_it_stops_the_run(sweep, figure):
    """Naively the sweep finds displacements as ever, of ground that has fallen."""
    case = layer(1.05, FINE, solver={"sweep": sweep, "max_frequency": 2.0})
    with pytest.raises(
        SimulationError, match=r"^lapse 0: found a stiffness with \d+ negative"
    ) as e:
        simulate(case)
    cause = e.value.__cause__
    assert isinstance(cause, GeometricInstability)
    figure("negative eigenvalues that the error tells, ρgH/G = 1.05", cause.negative, 1, "", True)
    assert e.value.lapse == 0


@pytest.mark.mpi
@pytest.mark.parametrize("continuity", ["steady", "transient"])
def test_23_it_stops_on_every_rank(continuity, figure):
    """Ranks that share a mesh count alike; under the causal law of transient lapses it is G."""
    harmonic = {"amplitude": 1.0, "frequency": 1.0, "cycles": 8, "samples": 128}
    sections = {
        "motion": [{"direction": "x", "harmonic": harmonic}],
        "lapses": {"count": 2, "continuity": continuity},
        "solver": {"sweep": "reduced", "max_frequency": 3.0},
    }
    simulate(layer(1.05, COARSE, **sections), WORLD, group_size=WORLD.size)
    with pytest.raises(SimulationError, match=r"^lapse 0: found a stiffness with") as caught:
        simulate(layer(1.2, COARSE, **sections), WORLD, group_size=WORLD.size)
    counts = WORLD.allgather(caught.value.__cause__.negative)
    figure("ranks that count otherwise", len(set(counts)) - 1, 0)


def test_23_the_command_ends_with_3(tmp_path, figure):
    """And a sentence, without a traceback."""
    path = tmp_path / "layer.toml"
    path.write_text(
        f"""
[mesh]
box = {{ size = [20.0, 10.0], cells = [20, 10], cell = "quadrilateral" }}
[soil.clay]
density = {DENSITY}
shear_modulus = {DENSITY * GRAVITY * HEIGHT / 1.2}
poisson = 0.3
[[motion]]
direction = "x"
harmonic = {{ amplitude = 1.0, frequency = 1.0, cycles = 1, samples = 16 }}
[boundary]
left = "roller"
right = "roller"
[effects]
gravity = true
geometric_stiffness = true
"""
    )
    command = [sys.executable, "-m", "fenics_hytf.cli", "run", str(path), "--no-plots"]
    ran = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    figure("exit code off 3", abs(ran.returncode - 3), 0)
    assert "lapse 0: found a stiffness with" in ran.stderr and "Traceback" not in ran.stderr
