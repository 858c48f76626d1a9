# SPDX-License-Identifier: MIT
"""The particle-weighted mass M = Sᵀ M_p S (4) and Rayleigh damping, on the stiffness's pattern."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from fenics_hytf.domain import Domain


def assemble_mass(domain: Domain, nodal: csr_matrix, pattern: PETSc.Mat) -> PETSc.Mat:
    """Assemble the mass of all ranks' points.

    Args:
        domain: The domain.
        nodal: This rank's SᵀM_pS for one component [kg, in 2D kg/m], shape
            ``(num_local_nodes, num_local_nodes)``, ghost nodes included.
        pattern: Stiffness matrix whose sparsity pattern the mass takes.

    Returns:
        The mass matrix on all components; the caller destroys it.
    """
    M = pattern.duplicate(copy=False)
    M.zeroEntries()
    count = domain.num_components
    blocks = np.zeros((nodal.nnz, count, count), PETSc.ScalarType)
    blocks[:, range(count), range(count)] = nodal.data[:, None]
    M.setValuesBlockedLocalIJV(
        nodal.indptr.astype(PETSc.IntType),
        nodal.indices.astype(PETSc.IntType),
        blocks,
        addv=PETSc.InsertMode.ADD_VALUES,
    )
    M.assemble()
    return M


def rayleigh_damping(M: PETSc.Mat, K: PETSc.Mat, alpha: float, beta: float) -> PETSc.Mat:
    """Rayleigh damping C = αM + βK.

    Args:
        M: Mass [kg].
        K: Elastic stiffness [N/m], of the same pattern.
        alpha: [1/s].
        beta: [s].

    Returns:
        C [N s/m]; the caller destroys it.
    """
    C = M.copy()
    C.scale(alpha)
    C.axpy(beta, K, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    return C
