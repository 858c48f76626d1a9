# SPDX-License-Identifier: MIT
"""What the mass of a million moved points costs: seconds on one core, and bytes a point."""

import time

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import CellType, GhostMode, create_rectangle
from mpi4py import MPI

from fenics_hytf.particles import move, particle_mass_matrix, seed, transfer_matrix


@pytest.mark.benchmark
@pytest.mark.parametrize("degree", [1, 2])
def test_mass_of_a_million_points(degree):
    mesh = create_rectangle(
        MPI.COMM_SELF,
        [[0.0, 0.0], [4.0, 1.0]],
        [400, 100],
        CellType.quadrilateral,
        ghost_mode=GhostMode.shared_facet,
    )
    x = mesh.geometry.x
    bump = np.sin(np.pi * x[:, 0] / 4) * np.sin(np.pi * x[:, 1])
    x[:, 0] += 0.05 * bump * np.sin(40 * x[:, 1])
    x[:, 1] += 0.02 * bump * np.cos(30 * x[:, 0])
    points = seed(mesh, np.zeros(40_000, np.int32), [1835.0], 25)
    rng = np.random.default_rng(0)
    inwards = np.array([2.0, 0.5]) - points.x
    started = time.perf_counter()
    report = move(mesh, points, 0.02 * rng.random(points.x.shape) * inwards)
    moved = time.perf_counter() - started
    assert report.ledger.num_points == 1_000_000 and report.ledger.imbalance == 0.0

    V = fem.functionspace(mesh, ("Lagrange", degree, (2,)))
    seconds = []
    for _ in range(3):
        started = time.perf_counter()
        S = transfer_matrix(points, V)
        built = time.perf_counter()
        M = particle_mass_matrix(S, points.mass)
        seconds.append((built - started, time.perf_counter() - built))
    # 1 = sum of the shape functions: all entries together weigh what the points weigh
    assert M.sum() == pytest.approx(report.ledger.mass, rel=1e-12)

    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    dx = ufl.dx(metadata={"quadrature_degree": 9})  # 25 Gauss points a cell as well
    form = fem.form(ufl.inner(u, v) * dx)
    matrix = fem.create_matrix(form)
    started = time.perf_counter()
    fem.assemble_matrix(matrix, form)
    by_ufl = time.perf_counter() - started
    s, m = min(seconds, key=sum)
    print(
        f"\n1e6 points on 400 x 100 quadrilaterals, degree {degree}: S {s:.2f} s + S^T M_p S "
        f"{m:.2f} s = {s + m:.2f} s, {(s + m) / by_ufl:.1f} times dolfinx's assembly of the vector "
        f"mass at 25 points a cell ({by_ufl:.2f} s); moving and finding them {moved:.2f} s; "
        f"{points.bytes_per_point} bytes a point without history"
    )
