# SPDX-License-Identifier: MIT
"""Single cells of any shape, and points in them.

Nodes are pushed forward by basix, which the mapping under test does not use, and read back.
"""

import basix
import basix.ufl
import numpy as np
from dolfinx.mesh import create_mesh
from mpi4py import MPI


def element(kind, degree):
    variant = basix.LagrangeVariant.gll_warped
    return basix.create_element(basix.ElementFamily.P, basix.CellType[kind], degree, variant)


def push_forward(kind, degree, nodes, X):
    """x of one reference point X a cell; nodes (n, N, d), X (n, d)."""
    return np.einsum("ni,nid->nd", element(kind, degree).tabulate(0, X)[0, :, :, 0], nodes)


def determinants(kind, degree, nodes, X):
    """det J of every cell at every point; nodes (n, N, d), X (m, d)."""
    gradients = element(kind, degree).tabulate(1, X)[1:, :, :, 0]
    return np.linalg.det(np.einsum("api,nid->npda", gradients, nodes))


def determinants_at_own_points(kind, degree, nodes, X):
    """det J of every cell at the point of its own; nodes (n, N, d), X (n, d)."""
    gradients = element(kind, degree).tabulate(1, X)[1:, :, :, 0]
    return np.linalg.det(np.einsum("ani,nid->nda", gradients, nodes))


def disjoint_cells(kind, degree, nodes):
    """A mesh of cells that share no node, and the local index of each."""
    n, N, d = nodes.shape
    shape = basix.ufl.element("Lagrange", kind, degree, shape=(d,))
    mesh = create_mesh(
        MPI.COMM_SELF, np.arange(n * N).reshape(n, N), nodes.reshape(-1, d).copy(), shape
    )
    return mesh, np.argsort(mesh.topology.original_cell_index)


def random_points(kind, n, rng):
    """Points of the reference cell, shape (n, d)."""
    d = 2 if kind in ("triangle", "quadrilateral") else 3
    if kind in ("triangle", "tetrahedron"):
        return rng.dirichlet(np.ones(d + 1), n)[:, :d]
    return rng.uniform(0, 1, (n, d))


def lattice(kind, n):
    return basix.create_lattice(basix.CellType[kind], n, basix.LatticeType.equispaced, True)


def random_cells(kind, degree, amplitude, count, seed):
    """Cells of size 1 with nodes moved at random, det J > 0 on a lattice that holds the nodes."""
    rng = np.random.default_rng(seed)
    reference = element(kind, degree).points
    found, total = [], 0
    while total < count:
        nodes = reference + rng.uniform(-amplitude, amplitude, (4 * count, *reference.shape))
        det = determinants(
            kind, degree, nodes, lattice(kind, 1 if kind == "quadrilateral" and degree == 1 else 4)
        )
        found.append(nodes[(det > 0).all(axis=1)])
        total += len(found[-1])
    return np.concatenate(found)[:count]


def newton_from_a_vertex(kind, nodes, x):
    """What the paper's scheme does when it starts at a vertex and takes full steps."""
    X = np.zeros(x.shape)
    for _ in range(50):
        table = element(kind, 1).tabulate(1, X)[:, :, :, 0]
        residual = np.einsum("ni,nid->nd", table[0], nodes) - x
        J = np.einsum("ani,nid->nda", table[1:], nodes)
        step = np.linalg.solve(J, -residual[:, :, None])[:, :, 0]
        X += step
    return X
