# SPDX-License-Identifier: MIT
"""Points in a flow that keeps its volume: a shift within cells against crowding.

A flow of linear quadrilaterals or hexahedra that keeps the volume of every cell still converges on
one side of it and diverges on the other. Points that ride it crowd together; over several cells of
run-out some cells are filled twice as far as others. With the rest of the divergence at X,

    d(X) = div u − mean = Σ_i g_i (X_i − ½),    δ = Σ_i ½ g_i X_i (1 − X_i) ∂x/∂X_i

is a shift whose divergence is −d, and which crosses no side of the cell: what flows from cell to
cell is the same, and within each the flow no longer converges. It is exact in parallelograms.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from fenics_hytf.particles.geometry import chunks, jacobians
from fenics_hytf.particles.points import Points
from fenics_hytf.particles.sites import Sites
from fenics_hytf.particles.transfer import gradient_matrices

RealArray = npt.NDArray[np.float64]


def even_shift(
    V: fem.FunctionSpace, flow: RealArray, points: Points
) -> tuple[RealArray, RealArray]:
    """The shift δ of points that ride a flow, and its gradient.

    Args:
        V: Space of the flow.
        flow: At this rank's nodes, ghosts included [m], shape ``(num_local_nodes, gdim)``.
        points: The points.

    Returns:
        δ [m], shape ``(len(points), gdim)``, and ∂δ_i/∂x_j [-], shape
        ``(len(points), gdim, gdim)``; nought in cells other than linear quadrilaterals and
        hexahedra.
    """
    mesh, gdim = V.mesh, V.mesh.geometry.dim
    shift, gradient = np.zeros((len(points), gdim)), np.zeros((len(points), gdim, gdim))
    linear = V.ufl_element().degree == 1
    if not linear or mesh.topology.cell_name() not in ("quadrilateral", "hexahedron"):
        return shift, gradient
    cells, number = np.unique(points.cell, return_inverse=True)
    slopes = np.stack([_rise(V, flow, cells, axis) for axis in range(gdim)], axis=1)
    for chunk in chunks(len(points)):
        X, rise = points.X[chunk], 0.5 * slopes[number[chunk]]
        J = jacobians(mesh, points.cell[chunk], X)
        shift[chunk] = np.einsum("pij,pj->pi", J, rise * X * (1 - X))
        along = rise * (1 - 2 * X)
        gradient[chunk] = np.einsum("pij,pj,pjk->pik", J, along, np.linalg.inv(J))
    return shift, gradient


def _rise(
    V: fem.FunctionSpace, flow: RealArray, cells: npt.NDArray[np.int32], axis: int
) -> RealArray:
    """Divergence in the middle of a cell's far side along an axis, less that of the near side."""
    gdim = V.mesh.geometry.dim
    found = []
    for place in (1.0, 0.0):
        X = np.full((len(cells), gdim), 0.5)
        X[:, axis] = place
        gradients = gradient_matrices(Sites(cells, X), V)
        found.append(sum((d @ flow[:, i] for i, d in enumerate(gradients)), np.zeros(len(cells))))
    return np.asarray(found[0] - found[1])
