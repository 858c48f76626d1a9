# SPDX-License-Identifier: MIT
"""The transfer matrix S between nodes and points, its gradients, and the mass M = S^T M_p S (4).

S evaluates shape functions at the material points: row p, column a holds N_a(X_p). It is used for
everything that passes between the two:

    nodes to points   u_p = S u           grad u at the points = (dS/dx_j) u
    points to nodes   M = S^T M_p S       M v_0 := S^T M_p v_p

A matrix here belongs to one rank: rows are its points, columns its nodes, owned ones first and
then ghosts. What the points give to the nodes is therefore summed over ranks when it is assembled.
A vector space uses the same matrix for each of its components.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy import sparse

from fenics_hytf.particles.geometry import RealArray, chunks, jacobians
from fenics_hytf.particles.sites import Located


def transfer_matrix(points: Located, V: fem.FunctionSpace) -> sparse.csr_matrix:
    """Shape functions of ``V`` at the points of this rank.

    Args:
        points: Points or sites: their cells and reference coordinates.
        V: Lagrange space, scalar or blocked.

    Returns:
        S [-], shape ``(len(points), nodes of this rank with ghosts)``.

    Raises:
        ValueError: If the shape functions of ``V`` depend on the orientation of cells.
    """
    element = _element(V)
    values = np.empty((len(points), element.dim))
    for chunk in chunks(len(points)):
        values[chunk] = element.tabulate(0, points.X[chunk])[0, :, :, 0]
    return _matrix(points, V, values)


def gradient_matrices(points: Located, V: fem.FunctionSpace) -> list[sparse.csr_matrix]:
    """Derivatives of the shape functions of ``V`` at the points of this rank.

    Args:
        points: Points or sites: their cells and reference coordinates.
        V: Lagrange space, scalar or blocked.

    Returns:
        One matrix per axis, dN_a/dx_j [1/m], each shaped like S.

    Raises:
        ValueError: If the shape functions of ``V`` depend on the orientation of cells.
    """
    element = _element(V)
    gdim = V.mesh.geometry.dim
    values = np.empty((gdim, len(points), element.dim))
    for chunk in chunks(len(points)):
        X = points.X[chunk]
        inverse = np.linalg.inv(jacobians(V.mesh, points.cell[chunk], X))
        derivatives = element.tabulate(1, X)[1:, :, :, 0]
        values[:, chunk] = np.einsum("kpa,pkj->jpa", derivatives, inverse)
    return [_matrix(points, V, axis) for axis in values]


def particle_mass_matrix(S: sparse.csr_matrix, mass: RealArray) -> sparse.csr_matrix:
    """The mass matrix M = S^T M_p S (4), this rank's part of it.

    Formed as a product of sqrt(M_p) S with its own transpose, so that it is symmetric to the bit.

    Args:
        S: Transfer matrix, shape ``(num_points, num_nodes)``.
        mass: Mass of the points [kg or kg/m], shape ``(num_points,)``.

    Returns:
        M [kg or kg/m] for one displacement component, shape ``(num_nodes, num_nodes)``.
    """
    scaled = sparse.csr_matrix(sparse.diags_array(np.sqrt(mass)) @ S)
    return sparse.csr_matrix(scaled.T.tocsr() @ scaled)


def _element(V: fem.FunctionSpace):  # type: ignore[no-untyped-def]  # basix's compiled class
    """The scalar basix element of ``V``."""
    if V.element.needs_dof_transformations:
        raise ValueError(
            f"Found the element {V.ufl_element()}, whose shape functions depend on the orientation "
            "of cells; expected a Lagrange element."
        )
    return V.element.basix_element


def _matrix(points: Located, V: fem.FunctionSpace, values: RealArray) -> sparse.csr_matrix:
    """One row a point, holding its values at the nodes of its cell."""
    nodes: npt.NDArray[np.int32] = V.dofmap.list[points.cell]
    num_points, width = values.shape
    size = num_points * width
    index_type = np.int32 if size < np.iinfo(np.int32).max else np.int64
    start = np.arange(0, size + 1, width, dtype=index_type)
    index_map = V.dofmap.index_map
    shape = (num_points, index_map.size_local + index_map.num_ghosts)
    return sparse.csr_matrix((values.reshape(-1), nodes.reshape(-1), start), shape=shape)
