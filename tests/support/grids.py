# SPDX-License-Identifier: MIT
"""Grids of masses and springs: systems small enough for dense algebra."""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.frequency import DynamicSystem, constant, hysteretic

SELF = MPI.COMM_SELF


def split(size: int, comm: MPI.Comm) -> slice:
    return slice(size * comm.rank // comm.size, size * (comm.rank + 1) // comm.size)


def matrix(whole, comm: MPI.Comm = SELF) -> PETSc.Mat:
    """A PETSc matrix of a sparse one, explicit zeros included, rows spread over the ranks."""
    whole = sparse.csr_matrix(whole)
    rows = split(whole.shape[0], comm)
    mine = whole[rows]
    local = mine.shape[0]
    types = mine.indptr.astype(PETSc.IntType), mine.indices.astype(PETSc.IntType)
    A = PETSc.Mat().createAIJ(
        ((local, None), (local, None)), csr=(*types, mine.data.astype(complex)), comm=comm
    )
    A.assemble()
    return A


def vector(values, comm: MPI.Comm = SELF) -> PETSc.Vec:
    mine = np.asarray(values)[split(len(values), comm)]
    b = PETSc.Vec().createMPI((len(mine), None), comm=comm)
    b.array[:] = mine
    return b


def together(values, comm: MPI.Comm) -> np.ndarray:
    return np.concatenate(comm.allgather(np.asarray(values)))


def springs(n: int, m: int, seed: int = 0) -> dict[str, sparse.csr_matrix]:
    """Masses on an n x m grid, springs of random stiffness to neighbours and ground, one pattern.

    Stiffness near 1e3 and mass near 1, so frequencies up to about 100 rad/s.
    """
    rng = np.random.default_rng(seed)
    size = n * m
    number = np.arange(size).reshape(n, m)
    pairs = np.concatenate(
        [
            np.stack([number[:-1].ravel(), number[1:].ravel()], axis=1),
            np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1),
        ]
    )

    def laplacian(weights, ground):
        i, j = pairs.T
        rows = np.concatenate([i, j, i, j, np.arange(size)])
        columns = np.concatenate([i, j, j, i, np.arange(size)])
        values = np.concatenate([weights, weights, -weights, -weights, ground])
        return sparse.csr_matrix((values, (rows, columns)), (size, size))

    links, ones = len(pairs), np.ones(size)
    mass = laplacian(-rng.uniform(0.01, 0.05, links), 1.0 * ones)  # consistent: it couples
    return {
        "K": laplacian(rng.uniform(500, 2000, links), 10.0 * ones),
        "K2": laplacian(rng.uniform(20, 100, links), 1.0 * ones),
        "M": mass,
        "C": laplacian(rng.uniform(0.1, 1.0, links), 0.3 * ones),
    }


def damped(parts, comm=SELF) -> DynamicSystem:
    """Stiffness with a hysteretic part, mass and dashpots; the matrices live with the system."""
    K, K2, M, C = (matrix(parts[name], comm) for name in ("K", "K2", "M", "C"))
    return DynamicSystem([(K, constant), (K2, hysteretic)], M, C)


def dynamic_stiffness(parts, s: complex) -> np.ndarray:
    """A(s) written out, dense."""
    K, K2, M, C = (parts[name].toarray() for name in ("K", "K2", "M", "C"))
    return K + 1j * np.sign(np.imag(s)) * K2 + s * C + s**2 * M


def dense(A) -> np.ndarray:
    indptr, indices, values = A.getValuesCSR()
    return sparse.csr_matrix((values, indices, indptr), A.getSize()).toarray()
