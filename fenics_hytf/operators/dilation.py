# SPDX-License-Identifier: MIT
"""The volumetric strain θ̄ of a cell that does not lock, and the strain B̄u made with it.

As ν nears 0.5, cells that may not change their volume anywhere cannot shear either. So the trace of
strain is replaced, cell by cell, by its L² projection on polynomials of one degree less than the
displacement: in quadrilaterals and hexahedra of degree 1 by the mean of the cell (Nagtegaal, Parks
and Rice 1974; Hughes 1980),

    θ̄ = Π tr ε(u),    B̄u = dev ε(u) + θ̄/d I

with the deviator in the d dimensions of the mesh. Stiffness and forces follow from B̄ alone,

    K = ∫ B̄ᵀ D B̄ dV = ∫ 2G dev ε : dev ε dV + ∫ (λ + 2G/d) θ̄² dV,    f = ∫ B̄ᵀ σ dV,

so that a uniform stress has the forces that it has with B, on cells of any shape. In parallelograms
it is the reduced integration of the volumetric part with one Gauss point a direction fewer; a
single point in cells of degree 2 would leave bending without stiffness. In straight triangles
and tetrahedra the trace is of one degree less already, and Π changes nothing: those of degree 1
lock.
"""

from __future__ import annotations

import basix
import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain
from fenics_hytf.operators.quadrature import gauss_sites, quadrature_degree
from fenics_hytf.operators.rows import divergence_rows, strain_rows
from fenics_hytf.particles import Located, gradient_matrices

RealArray = npt.NDArray[np.float64]


class Dilation:
    """Π of the cells that this rank owns.

    Args:
        domain: The domain, whose displacement has as many components as there are dimensions.
    """

    def __init__(self, domain: Domain) -> None:
        self._domain = domain
        cell_type = basix.CellType[domain.mesh.topology.cell_name()]
        self._polynomials = basix.create_element(
            basix.ElementFamily.P,
            cell_type,
            domain.V.ufl_element().degree - 1,
            basix.LagrangeVariant.gll_warped,
            discontinuous=True,
        )
        X, _ = basix.make_quadrature(cell_type, quadrature_degree(domain))
        sites, volume = gauss_sites(domain)
        L = self._tabulate(X)
        gram = np.einsum("cg,gi,gj->cij", volume, L, L)
        # Factors that make the polynomials orthonormal over each cell.
        self._factors = np.linalg.inv(np.linalg.cholesky(gram))
        weights = np.einsum("cij,gj,cg->cig", self._factors, L, volume)
        trace = divergence_rows(gradient_matrices(sites, domain.V))
        self._rows = sparse.csr_matrix(_block_diagonal(weights) @ trace)

    def _tabulate(self, X: RealArray) -> RealArray:
        """The polynomials at reference places, shape ``(n, num_polynomials)``."""
        if not len(X):  # for a constant at no place basix 0.9 ends the process
            return np.empty((0, self._polynomials.dim))
        return np.asarray(self._polynomials.tabulate(0, X)[0, :, :, 0])

    def trace_rows(self, sites: Located) -> sparse.csr_matrix:
        """Rows that evaluate θ̄.

        Args:
            sites: Points or sites in owned cells.

        Returns:
            [1/m], shape ``(num_sites, num_local_nodes·gdim)``.
        """
        count = self._factors.shape[1]
        values = np.einsum("pj,pij->pi", self._tabulate(sites.X), self._factors[sites.cell])
        columns = count * sites.cell[:, None] + np.arange(count)
        start = count * np.arange(len(sites) + 1)
        shape = (len(sites), self._rows.shape[0])
        return sparse.csr_matrix(
            sparse.csr_matrix((values.ravel(), columns.ravel(), start), shape=shape) @ self._rows
        )

    def strain_rows(self, sites: Located) -> sparse.csr_matrix:
        """Rows of B̄, in the order of :func:`~fenics_hytf.operators.strain_rows`.

        Args:
            sites: Points or sites in owned cells.

        Returns:
            Shape ``(num_sites·num_strains, num_local_nodes·gdim)``, strain components fastest.
        """
        gdim = self._domain.gdim
        gradients = gradient_matrices(sites, self._domain.V)
        excess = self.trace_rows(sites) - divergence_rows(gradients)
        normal = np.zeros((3 * (gdim - 1), 1))
        normal[:gdim] = 1 / gdim
        return sparse.csr_matrix(strain_rows(gradients, gdim) + sparse.kron(excess, normal))

    def add_stiffness(self, matrix: PETSc.Mat, modulus: RealArray) -> None:
        """Add ∫ κ θ̄² dV to a matrix whose values are not yet put together.

        Args:
            matrix: Matrix on the nodes, with the pattern of the cells.
            modulus: κ of each local cell [Pa], shape ``(num_local_cells,)``; ghosts do not count.
        """
        count, gdim = self._factors.shape[1], self._domain.gdim
        weight = sparse.diags_array(np.repeat(modulus[: len(self._factors)], count))
        product = sparse.csr_matrix(self._rows.T @ weight @ self._rows)
        blocks = product.tobsr((gdim, gdim))
        matrix.setValuesBlockedLocalIJV(
            blocks.indptr.astype(PETSc.IntType),
            blocks.indices.astype(PETSc.IntType),
            blocks.data.astype(PETSc.ScalarType),
            addv=PETSc.InsertMode.ADD_VALUES,
        )


def _block_diagonal(blocks: RealArray) -> sparse.bsr_matrix:
    """One block a cell, shape ``(num_cells, rows, columns)``."""
    count, rows, columns = blocks.shape
    return sparse.bsr_matrix(
        (blocks, np.arange(count), np.arange(count + 1)), shape=(count * rows, count * columns)
    )
