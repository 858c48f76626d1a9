# SPDX-License-Identifier: MIT
"""Ghost stabilisation of cells that are filled in part (Burman 2010; Sticko and Kreiss 2016).

A cell that points fill by a fraction ε has nodes whose stiffness is ε times that of others, and the
condition of K grows as ε falls; a single point, three strains, leaves it a mechanism. On facets
between such a cell and any filled one the jump of the normal derivative is penalised,

    K_G = Σ_F ∫ a_K Ē (h/3) [[∂u/∂n]]·[[∂v/∂n]] dS

with Ē the mean of Young's moduli of both cells (across a section of shear moduli) and h the mean of
their sizes normal to the facet. Linear displacement has no such jump, so ground that strains
evenly does not feel it. There is no ghost mass: it would put a false resonance at √(γ_K/γ_M).
"""

from __future__ import annotations

import basix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx.fem import Constant, Function, form, functionspace
from dolfinx.fem.petsc import assemble_matrix, create_matrix
from dolfinx.mesh import meshtags
from petsc4py import PETSc
from ufl.geometry import FacetJacobianDeterminant

from fenics_hytf.domain import Domain

STRENGTH = 0.05
"""a_K; from 0.03 to 0.1 the condition of K hardly depends on it."""


class GhostForm:
    """K_G on some facets.

    Args:
        domain: The domain.
        facets: Inner facets of this rank, ghosts included, shape ``(n,)``.
        strength: a_K [-].
    """

    def __init__(
        self, domain: Domain, facets: npt.NDArray[np.int32], strength: float = STRENGTH
    ) -> None:
        mesh = domain.mesh
        self._modulus = Function(functionspace(mesh, ("DG", 0)))
        u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
        n = ufl.FacetNormal(mesh)
        h = ufl.avg(_depth(domain))
        ones = np.ones(len(facets), np.int32)
        tags = meshtags(mesh, mesh.topology.dim - 1, np.sort(facets), ones)
        degree = 2 * domain.V.ufl_element().degree
        dS = ufl.Measure(
            "dS",
            domain=mesh,
            subdomain_data=tags,
            subdomain_id=1,
            metadata={"quadrature_degree": degree},
        )
        factor = Constant(mesh, PETSc.ScalarType(strength / 3))
        jump = ufl.inner(_normal_jump(u, n), _normal_jump(v, n))
        # The cells' own entries, of nought, so that the pattern is that of all matrices.
        nothing = Constant(mesh, PETSc.ScalarType(0.0)) * ufl.inner(u, v) * ufl.dx
        self._form = form(factor * ufl.avg(self._modulus) * h * jump * dS + nothing)

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix with the pattern of cells and facets; the caller destroys it."""
        return create_matrix(self._form)

    def assemble(self, matrix: PETSc.Mat, modulus: npt.NDArray[np.float64]) -> None:
        """Assemble into a matrix.

        Args:
            matrix: From :meth:`create_matrix`, overwritten.
            modulus: E of each local cell, ghosts included [Pa], shape ``(num_local_cells,)``.
        """
        matrix.zeroEntries()
        self.add(matrix, modulus)

    def add(self, matrix: PETSc.Mat, modulus: npt.NDArray[np.float64]) -> None:
        """Add to a matrix that has been assembled.

        Args:
            matrix: From :meth:`create_matrix`.
            modulus: As for :meth:`assemble`.
        """
        self._modulus.x.array[:] = modulus
        assemble_matrix(matrix, self._form)
        matrix.assemble()


def _depth(domain: Domain) -> ufl.core.expr.Expr:
    """Size of a cell normal to its facet: the volume over the facet's area."""
    mesh = domain.mesh
    reference = mesh.basix_cell()
    facet = basix.cell.facet_reference_volumes(reference)[0]
    scale = basix.cell.volume(reference) / facet
    return scale * abs(ufl.JacobianDeterminant(mesh)) / abs(FacetJacobianDeterminant(mesh))


def _normal_jump(u: ufl.core.expr.Expr, n: ufl.FacetNormal) -> ufl.core.expr.Expr:
    """∂u/∂n⁺ + ∂u/∂n⁻ with outward normals."""
    return ufl.dot(ufl.grad(u)("+"), n("+")) + ufl.dot(ufl.grad(u)("-"), n("-"))
