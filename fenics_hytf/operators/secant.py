# SPDX-License-Identifier: MIT
"""Stiffness of soil that flows at constant volume, with a secant modulus at every Gauss point.

    K_s = ∫ 2 G_s dev ε(v) : dev ε(u) dV + ∫ κ tr ε(v) tr ε(u) dV,   κ = 1e4 mean G_s of the cell

dev is the deviator in three dimensions, also in plane strain. With the shear strain γ = √(2 e:e) of
e = dev ε(u), and θ² the cell's mean of (tr ε)²,

    u·K_s u = ∫ G_s (γ² + 1e4 θ²) dV

to round-off: the volume-weighted arithmetic mean of G_s is the one that makes it so. The second
integral has one Gauss point a direction fewer than the first, a single one in quadrilaterals and
hexahedra of degree 1, which lets cells that keep their volume flow (selective reduced integration;
Malkus and Hughes 1978). In simplices of degree 1 there is nothing to take away: they lock.
"""

from __future__ import annotations

import basix
import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx.fem import Function, form, functionspace
from dolfinx.fem.petsc import assemble_matrix, create_matrix
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain
from fenics_hytf.operators.quadrature import quadrature_degree
from fenics_hytf.operators.rows import NORMAL_STRAINS, strain_rows
from fenics_hytf.particles import Sites, cell_grid, gradient_matrices

RealArray = npt.NDArray[np.float64]

BULK_OVER_SHEAR = 1e4
"""κ over the mean G_s. With it k_y is the same on any number of ranks to 2e-9, with 1e6 to 4e-7."""


class SecantForm:
    """K_s, and the strains that its moduli follow from.

    Args:
        domain: The domain: a section in plane strain, or a body.

    Attributes:
        volume: Of the Gauss points of owned cells [m^3, in 2D m^2], shape
            ``(num_owned_cells, num_gauss_points)``.

    Raises:
        ValueError: The section moves across its plane.
    """

    def __init__(self, domain: Domain) -> None:
        if domain.num_components != domain.gdim:
            raise ValueError(
                f"found a displacement of {domain.num_components} component in {domain.gdim} "
                "dimensions; expected plane strain or a body"
            )
        degree = quadrature_degree(domain)
        strain, self.volume = _strain_rows(domain, degree)
        reduced, reduced_volume = _strain_rows(domain, degree - 2)
        deviator = _deviator(domain.gdim)
        self._num_components = len(deviator)
        self._deviator = _per_site(strain, deviator)
        self._trace = _per_site(reduced, _trace(domain.gdim))
        # √ of each reduced point's part of its cell: the norm of all of them is then θ.
        self._part = np.sqrt(reduced_volume / reduced_volume.sum(axis=1, keepdims=True))

        gauss = basix.ufl.quadrature_element(domain.mesh.basix_cell(), degree=degree)
        self._shear_modulus = Function(functionspace(domain.mesh, gauss))
        self._bulk_modulus = Function(functionspace(domain.mesh, ("DG", 0)))
        u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
        strains, traces = ufl.inner(_sym(u), _sym(v)), ufl.inner(ufl.div(u), ufl.div(v))
        deviatoric = 2 * self._shear_modulus * (strains - traces / 3)
        self._form = form(
            deviatoric * _dx(domain, degree) + self._bulk_modulus * traces * _dx(domain, degree - 2)
        )

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix with the form's pattern; the caller destroys it."""
        return create_matrix(self._form)

    def assemble(self, matrix: PETSc.Mat, shear_modulus: RealArray, weight: RealArray) -> None:
        """Assemble into a matrix.

        Args:
            matrix: From :meth:`create_matrix`, overwritten.
            shear_modulus: G_s at the Gauss points of owned cells [Pa], shape
                ``(num_owned_cells, num_gauss_points)``.
            weight: Part of each local cell that is filled, 0 to 1, shape ``(num_local_cells,)``;
                it multiplies both integrals.
        """
        owned = len(shear_modulus)
        filled = shear_modulus * weight[:owned, None]
        mean = (filled * self.volume).sum(axis=1) / self.volume.sum(axis=1)
        _set(self._shear_modulus, filled)
        _set(self._bulk_modulus, BULK_OVER_SHEAR * mean[:, None])
        matrix.zeroEntries()
        assemble_matrix(matrix, self._form)
        matrix.assemble()

    def strain(self, nodal: RealArray) -> RealArray:
        """Components whose sum of squares is γ² + 1e4 θ², at the Gauss points of owned cells.

        Args:
            nodal: Displacement at this rank's nodes, ghosts included [m], shape
                ``(num_local_nodes, num_components)``.

        Returns:
            The deviator's come first [-], shape
            ``(num_owned_cells, num_gauss_points, num_strain_components)``.
        """
        deviator = self._deviator_of(nodal)
        dilation = (self._trace @ nodal.ravel()).reshape(self._part.shape) * self._part
        shape = (*self.volume.shape, self._part.shape[1])
        dilation = np.broadcast_to(np.sqrt(BULK_OVER_SHEAR) * dilation[:, None, :], shape)
        return np.concatenate([deviator, dilation], axis=2)

    def shear_strain(self, nodal: RealArray) -> RealArray:
        """γ = √(2 e:e) at the Gauss points of owned cells.

        Args:
            nodal: As for :meth:`strain`.

        Returns:
            [-], shape ``(num_owned_cells, num_gauss_points)``.
        """
        return np.asarray(np.linalg.norm(self._deviator_of(nodal), axis=2))

    def _deviator_of(self, nodal: RealArray) -> RealArray:
        return np.asarray(self._deviator @ nodal.ravel()).reshape(
            *self.volume.shape, self._num_components
        )


def _sym(u: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
    return ufl.sym(ufl.grad(u))


def _dx(domain: Domain, degree: int) -> ufl.Measure:
    return ufl.dx(domain.mesh, metadata={"quadrature_degree": degree})


def _set(coefficient: Function, values: RealArray) -> None:
    """Values of owned cells, shape ``(num_owned_cells, points)``; no form looks at a ghost's."""
    coefficient.x.array[coefficient.function_space.dofmap.list[: len(values)]] = values


def _strain_rows(domain: Domain, degree: int) -> tuple[sparse.csr_matrix, RealArray]:
    """Strain at the Gauss points of owned cells, and their volumes, a row a cell."""
    owned = domain.num_owned_cells
    X, weight = basix.make_quadrature(basix.CellType[domain.mesh.topology.cell_name()], degree)
    cells = np.arange(owned, dtype=np.int32)
    sites = Sites(np.repeat(cells, len(X)), np.tile(X, (owned, 1)))
    _, det = cell_grid(domain.mesh, cells, X)
    return strain_rows(gradient_matrices(sites, domain.V), domain.num_components), weight * det


def _deviator(gdim: int) -> RealArray:
    """From Voigt strain to components of the deviator whose sum of squares is 2 e:e."""
    num_strains = 3 * (gdim - 1)
    normal = NORMAL_STRAINS[num_strains]
    # three normal components, also of a section
    rows = np.zeros((3 + num_strains - normal, num_strains))
    rows[:3, :normal] = np.sqrt(2) * (np.eye(3, normal) - 1 / 3)
    rows[3:, normal:] = np.eye(num_strains - normal)
    return rows


def _trace(gdim: int) -> RealArray:
    """From Voigt strain to its trace, shape ``(1, num_strains)``."""
    num_strains = 3 * (gdim - 1)
    return (np.arange(num_strains) < NORMAL_STRAINS[num_strains]).astype(float)[None, :]


def _per_site(B: sparse.csr_matrix, rows: RealArray) -> sparse.csr_matrix:
    """Apply rows over the strain components at every site."""
    sites = sparse.identity(B.shape[0] // rows.shape[1])
    return sparse.csr_matrix(sparse.kron(sites, rows) @ B)
