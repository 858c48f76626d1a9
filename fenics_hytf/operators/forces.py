# SPDX-License-Identifier: MIT
"""Nodal forces of a stress that is known at Gauss points, f = ∫ Bᵀσ dV.

The Gauss points are those of the stiffness, so that the force of the stress D B u is K u to
round-off. Strain and stress are Voigt columns in the order of :func:`strain_rows`, shear strain as
γ = 2ε; across a section they are the two shears.
"""

from __future__ import annotations

import basix
import numpy as np
import numpy.typing as npt

from fenics_hytf.domain import Domain
from fenics_hytf.operators.forms import quadrature_degree
from fenics_hytf.operators.rows import NORMAL_STRAINS, strain_rows
from fenics_hytf.particles import Sites, cell_grid, gradient_matrices

RealArray = npt.NDArray[np.float64]


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

    Attributes:
        sites: Gauss points of owned cells, cell by cell.
        volume: Of each, as far as its cell counts [m^3, in 2D m^2], shape ``(num_sites,)``.
    """

    def __init__(self, domain: Domain) -> None:
        mesh, owned = domain.mesh, domain.num_owned_cells
        cell_type = basix.CellType[mesh.topology.cell_name()]
        X, weight = basix.make_quadrature(cell_type, quadrature_degree(domain))
        cells = np.arange(owned, dtype=np.int32)
        self.sites = Sites(np.repeat(cells, len(X)), np.tile(X, (owned, 1)))
        _, det = cell_grid(mesh, cells, X)
        self._whole = (weight * det).ravel()
        self.volume = self._whole
        self._B = strain_rows(gradient_matrices(self.sites, domain.V), domain.num_components)

    def weigh(self, weight: RealArray | None) -> None:
        """Let cells count in part, as their stiffness does.

        Args:
            weight: Of each local cell [-], shape ``(num_local_cells,)``; ``None`` for whole cells.
        """
        self.volume = self._whole if weight is None else weight[self.sites.cell] * self._whole

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
        count = max(len(self.sites), 1)
        return np.asarray((self._B @ nodal.ravel()).reshape(-1, self._B.shape[0] // count))
