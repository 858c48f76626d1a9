# SPDX-License-Identifier: MIT
"""Stiffness as UFL forms with cell-wise coefficients.

    K_L  = ∫ ε(v) : D : ε(u) dV                       (3), linear
    K_NL = ∫ σ_ij u_k,i v_k,j dV                      (3), geometric, σ the Cauchy stress carried

A form is compiled once a run and assembled again with other coefficients; a form that a scene does
not call for is never made.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx.fem import Function, form, functionspace
from dolfinx.fem.petsc import assemble_matrix, create_matrix
from petsc4py import PETSc

from fenics_hytf.domain import Domain
from fenics_hytf.operators.dilation import Dilation
from fenics_hytf.operators.quadrature import quadrature_degree


class ElasticForm:
    """K_L of an isotropic linear material; in 2D plane strain, or shear across the plane.

    Args:
        domain: The domain.
        locking: Whether the volumetric strain is that of :mod:`.dilation`, against locking;
            shear across the plane has none.
    """

    def __init__(self, domain: Domain, locking: bool = False) -> None:
        cells = functionspace(domain.mesh, ("DG", 0))
        self._lame_lambda, self._shear_modulus = Function(cells), Function(cells)
        u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
        self._gdim = domain.gdim
        self._dilation = Dilation(domain) if locking and domain.num_components > 1 else None

        if domain.num_components == 1:
            density = self._shear_modulus * ufl.inner(ufl.grad(u), ufl.grad(v))
        else:
            strain_u, strain_v = ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))
            if self._dilation is None:
                stress = self._lame_lambda * ufl.tr(strain_u) * ufl.Identity(domain.gdim)
                stress += 2 * self._shear_modulus * strain_u
            else:
                stress = 2 * self._shear_modulus * ufl.dev(strain_u)
            density = ufl.inner(stress, strain_v)
        self._form = form(density * _dx(domain))

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix with the form's pattern; the caller destroys it."""
        return create_matrix(self._form)

    def assemble(
        self,
        matrix: PETSc.Mat,
        lame_lambda: npt.NDArray[np.float64],
        shear_modulus: npt.NDArray[np.float64],
    ) -> None:
        """Assemble into a matrix.

        Args:
            matrix: From :meth:`create_matrix`, overwritten.
            lame_lambda: λ of each local cell, ghosts included [Pa], shape ``(num_local_cells,)``.
            shear_modulus: G of each local cell [Pa], same shape.
        """
        self._lame_lambda.x.array[:] = lame_lambda
        self._shear_modulus.x.array[:] = shear_modulus
        matrix.zeroEntries()
        assemble_matrix(matrix, self._form)
        if self._dilation is not None:
            self._dilation.add_stiffness(matrix, lame_lambda + 2 / self._gdim * shear_modulus)
        matrix.assemble()


class GeometricForm:
    """K_NL of a cell-wise stress.

    Args:
        domain: The domain.
    """

    def __init__(self, domain: Domain) -> None:
        gdim = domain.gdim
        self._stress = Function(functionspace(domain.mesh, ("DG", 0, (gdim, gdim))))
        u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
        self._form = form(ufl.inner(ufl.dot(ufl.grad(u), self._stress), ufl.grad(v)) * _dx(domain))

    def assemble(self, matrix: PETSc.Mat, stress: npt.NDArray[np.float64]) -> None:
        """Assemble into a matrix of the elastic form's pattern.

        Args:
            matrix: Overwritten.
            stress: Cauchy stress of each local cell, tension positive [Pa], shape
                ``(num_local_cells, gdim, gdim)``.
        """
        self._stress.x.array[:] = stress.ravel()
        matrix.zeroEntries()
        assemble_matrix(matrix, self._form)
        matrix.assemble()


def _dx(domain: Domain) -> ufl.Measure:
    return ufl.dx(domain.mesh, metadata={"quadrature_degree": quadrature_degree(domain)})
