# SPDX-License-Identifier: MIT
"""From points to places in their cells: the polynomial of each cell that fits its points best.

What points carry is known where they are; the stiffness is integrated at Gauss points, and strain
is looked at in the middle of cells. In each cell the values of the points are fitted, by volume, by
a polynomial of the displacement's degree and read elsewhere:

    values at places = R (values at points),    R = Φ (ΨᵀWΨ)⁺ ΨᵀW

Points that sit on the Gauss points are read back as they are, to round-off. Where a cell's points
do not tell a term of the polynomial, for they are too few or lie in a line, it is left out; a
constant always remains.
"""

from __future__ import annotations

import basix
import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh
from scipy import sparse

from fenics_hytf.particles.points import Points
from fenics_hytf.particles.sites import Sites

RealArray = npt.NDArray[np.float64]

# A term is told by the points if its mean square among them is this fraction of that in the cell.
# On Gauss points it is 1; where all points of a cell have moved by a fifth of it, 0.1 to 0.02 for
# the highest term in sections and less in solids, whose highest term no strain of theirs needs.
_TOLD = 0.02


def resample_matrix(mesh: Mesh, points: Points, degree: int, sites: Sites) -> sparse.csr_matrix:
    """The matrix R from the values of this rank's points to values at sites in its cells.

    Args:
        mesh: The mesh.
        points: The points.
        degree: Of the polynomials.
        sites: Places in owned cells; as many in each cell, cell by cell.

    Returns:
        R [-], shape ``(len(sites), len(points))``.
    """
    element = basix.create_element(
        basix.ElementFamily.P,
        basix.CellType[mesh.topology.cell_name()],
        degree,
        basix.LagrangeVariant.legendre,  # orthonormal on the reference cell
        discontinuous=True,
    )
    owned = mesh.topology.index_map(mesh.topology.dim).size_local
    psi, phi = _tabulate(element, points.X), _tabulate(element, sites.X)
    constant = psi[0, 0] if len(psi) else 1.0
    weight = points.volume / np.bincount(points.cell, points.volume, owned)[points.cell]
    mean = np.zeros((owned, psi.shape[1]))
    np.add.at(mean, points.cell, weight[:, None] * psi)
    # The mean of the values, and terms whose own mean over the points is nought.
    psi[:, 1:] -= mean[points.cell, 1:]
    phi[:, 1:] -= mean[sites.cell, 1:]
    gram = np.zeros((owned, psi.shape[1] - 1, psi.shape[1] - 1))
    np.add.at(gram, points.cell, weight[:, None, None] * psi[:, 1:, None] * psi[:, None, 1:])
    inverse = _pseudo_inverse(gram, _TOLD * constant**2)
    fit = np.empty_like(psi)
    fit[:, 0] = weight / constant
    fit[:, 1:] = weight[:, None] * np.einsum("pij,pj->pi", inverse[points.cell], psi[:, 1:])
    return _by_cell(sites.cell, phi, points.cell, fit, owned)


def _tabulate(element: basix.finite_element.FiniteElement, X: RealArray) -> RealArray:
    """Its functions at reference places, shape ``(n, element.dim)``."""
    if not len(X):  # at no place basix 0.9 ends the process
        return np.empty((0, element.dim))
    return np.asarray(element.tabulate(0, X)[0, :, :, 0])


def _pseudo_inverse(gram: RealArray, least: float) -> RealArray:
    """(ΨᵀWΨ)⁺ of every cell, without the terms that its points do not tell."""
    power, terms = np.linalg.eigh(gram)
    told = power > least
    inverse = np.where(told, 1.0 / np.where(told, power, 1.0), 0.0)
    return np.asarray(np.einsum("cij,cj,ckj->cik", terms, inverse, terms))


def _by_cell(
    site_cell: npt.NDArray[np.int32],
    phi: RealArray,
    point_cell: npt.NDArray[np.int32],
    fit: RealArray,
    owned: int,
) -> sparse.csr_matrix:
    """Φ of the sites times the fits of the points that share their cell."""
    terms = phi.shape[1]

    def spread(cell: npt.NDArray[np.int32], values: RealArray) -> sparse.csr_matrix:
        columns = (cell[:, None].astype(np.int64) * terms + np.arange(terms)).ravel()
        start = np.arange(0, values.size + 1, terms)
        shape = (len(values), owned * terms)
        return sparse.csr_matrix((values.ravel(), columns, start), shape=shape)

    return sparse.csr_matrix(spread(site_cell, phi) @ spread(point_cell, fit).T)
