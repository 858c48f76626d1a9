# SPDX-License-Identifier: MIT
"""Nodal forces of a stress that is known at Gauss points, f = ∫ Bᵀσ dV.

The Gauss points are those of the stiffness, so that the force of the stress D B u is K u to
round-off. Cells that are filled in part are integrated at the material points instead, stiffness
and forces alike,

    K = Σ_p V_p B_pᵀ D B_p,   f = Σ_p V_p B_pᵀ σ_p,

for only the points tell which part it is. Strain and stress are Voigt columns in the order of
:func:`strain_rows`, shear strain as γ = 2ε; across a section they are the two shears.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain
from fenics_hytf.operators.dilation import Dilation
from fenics_hytf.operators.quadrature import gauss_sites
from fenics_hytf.operators.rows import NORMAL_STRAINS, strain_rows
from fenics_hytf.particles import Located, Points, Sites, gradient_matrices, resample_matrix

RealArray = npt.NDArray[np.float64]
Cells = npt.NDArray[np.bool_]


def isotropic_stress(
    strain: RealArray, lame_lambda: RealArray, shear_modulus: RealArray
) -> RealArray:
    """Stress of an isotropic elastic material: λ tr(ε) I + 2Gε.

    Args:
        strain: xx, yy, xy; or xx, yy, zz, yz, xz, xy; or xz, yz, shear as γ [-], shape
            ``(n, num_strains)``.
        lame_lambda: λ [Pa], shape ``(n,)``.
        shear_modulus: G [Pa], shape ``(n,)``.

    Returns:
        Stress in the same order [Pa], shape ``(n, num_strains)``.
    """
    stress = shear_modulus[:, None] * strain
    normal = NORMAL_STRAINS[strain.shape[1]]
    stress[:, :normal] *= 2.0
    stress[:, :normal] += (lame_lambda * strain[:, :normal].sum(axis=1))[:, None]
    return stress


class InternalForce:
    """Integrates Bᵀσ over this rank's cells.

    Args:
        domain: The domain.
        locking: Whether B is B̄ of :mod:`.dilation`, as in the stiffness.

    Attributes:
        sites: Gauss points of owned cells, cell by cell; behind them the points of cells that are
            filled in part.
        volume: Of each [m^3, in 2D m^2], shape ``(num_sites,)``.
    """

    def __init__(self, domain: Domain, locking: bool = False) -> None:
        self._domain = domain
        self._dilation = Dilation(domain) if locking and domain.num_components > 1 else None
        self._num_strains = 3 * domain.gdim - 3 if domain.num_components > 1 else domain.gdim
        sites, volume = gauss_sites(domain)
        self._gauss = sites, volume.ravel(), self.strain_rows(sites)
        self.sites = sites
        self.volume: RealArray = self._gauss[1]
        self._B = self._gauss[2]
        # Points that are sites themselves, and their rows of B.
        self._own: npt.NDArray[np.intp] = np.empty(0, np.intp)
        self._own_rows = self._B[:0]

    def strain_rows(self, sites: Located) -> sparse.csr_matrix:
        """Rows that evaluate the strain whose stress is integrated.

        Args:
            sites: Points or sites in cells of this rank.

        Returns:
            Shape ``(num_sites·num_strains, num_local_nodes·num_components)``.
        """
        if self._dilation is not None:
            return self._dilation.strain_rows(sites)
        return strain_rows(gradient_matrices(sites, self._domain.V), self._domain.num_components)

    def occupy(self, points: Points, whole: Cells, in_part: Cells) -> None:
        """Integrate over cells as far as points fill them.

        Args:
            points: The points.
            whole: Local cells that count whole, shape ``(num_local_cells,)``.
            in_part: Local cells that are filled in part, same shape; others are empty.
        """
        sites, volume, rows = self._gauss
        gauss = np.flatnonzero(whole[sites.cell])
        self._own = np.flatnonzero(in_part[points.cell])
        cells, X = points.cell[self._own], points.X[self._own]
        self._own_rows = self.strain_rows(Sites(cells, X))
        count = self._num_strains
        kept = rows[(count * gauss[:, None] + np.arange(count)).ravel()]
        self._B = sparse.csr_matrix(sparse.vstack([kept, self._own_rows]))
        self.volume = np.concatenate([volume[gauss], points.volume[self._own]])
        self.sites = Sites(
            np.concatenate([sites.cell[gauss], cells]), np.concatenate([sites.X[gauss], X])
        )

    def resampling(self, points: Points) -> sparse.csr_matrix:
        """The matrix from values of this rank's points to values at :attr:`sites`.

        Args:
            points: The points; those that were last taken note of, if any were.

        Returns:
            Shape ``(num_sites, num_points)``; see :func:`~fenics_hytf.particles.resample_matrix`.
        """
        stop = len(self.sites) - len(self._own)
        gauss = Sites(self.sites.cell[:stop], self.sites.X[:stop])
        degree = self._domain.V.ufl_element().degree
        R = resample_matrix(self._domain.mesh, points, degree, gauss)
        ones, start = np.ones(len(self._own)), np.arange(len(self._own) + 1)
        own = sparse.csr_matrix((ones, self._own, start), shape=(len(self._own), len(points)))
        return sparse.csr_matrix(sparse.vstack([R, own]))

    def add_stiffness(
        self, matrix: PETSc.Mat, lame_lambda: RealArray, shear_modulus: RealArray
    ) -> None:
        """Add the stiffness of cells that are filled in part, Σ_p V_p B_pᵀ D B_p (collective).

        Args:
            matrix: Matrix on the nodes, with the pattern of the cells and values of others.
            lame_lambda: λ of each local cell [Pa], shape ``(num_local_cells,)``.
            shear_modulus: G likewise.
        """
        stop, normal = len(self.sites) - len(self._own), NORMAL_STRAINS[self._num_strains]
        cells, volume = self.sites.cell[stop:], self.volume[stop:]
        B, twice = self._own_rows, np.ones(self._num_strains)
        twice[:normal] = 2.0
        K = B.T @ sparse.diags_array(np.outer(volume * shear_modulus[cells], twice).ravel()) @ B
        if normal:
            sums = sparse.kron(sparse.identity(len(cells)), (twice > 1).astype(float)[None, :])
            trace = sparse.csr_matrix(sums @ B)
            K = K + trace.T @ sparse.diags_array(volume * lame_lambda[cells]) @ trace
        K = sparse.csr_matrix(K)
        matrix.setValuesLocalIJV(
            K.indptr.astype(PETSc.IntType),
            K.indices.astype(PETSc.IntType),
            K.data.astype(PETSc.ScalarType),
            addv=PETSc.InsertMode.ADD_VALUES,
        )
        matrix.assemble()

    def __call__(self, stress: RealArray) -> RealArray:
        """The force of a stress.

        Args:
            stress: At :attr:`sites` [Pa], shape ``(num_sites, num_strains)``.

        Returns:
            Of this rank's cells at its nodes, ghosts included, components fastest [N, in 2D N/m],
            shape ``(num_local_nodes·num_components,)``.
        """
        return np.asarray(self._B.T @ (self.volume[:, None] * stress).ravel())

    def strain(self, nodal: RealArray) -> RealArray:
        """Strain of a nodal field at :attr:`sites`.

        Args:
            nodal: At this rank's nodes, ghosts included, shape
                ``(num_local_nodes, num_components)``.

        Returns:
            Shape ``(num_sites, num_strains)``.
        """
        return np.asarray((self._B @ nodal.ravel()).reshape(-1, self._num_strains))
