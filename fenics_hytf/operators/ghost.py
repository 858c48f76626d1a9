# SPDX-License-Identifier: MIT
"""Ghost stabilisation of cells that are filled in part (Burman 2010; Sticko and Kreiss 2016).

A cell that points fill by a fraction ε has nodes whose stiffness is ε times that of others, and the
condition of K grows as ε falls; a single point, three strains in a section and six in space, leaves
it a mechanism. On facets between such a cell and any filled one the jumps of the normal derivatives
are penalised, up to the degree of displacement,

    K_G = Σ_F ∫ a_K Ē ((h/3) [[∂u/∂n]]·[[∂v/∂n]] + (h³/20) [[∂²u/∂n²]]·[[∂²v/∂n²]]) dS

with Ē the mean of Young's moduli of both cells (across a section of shear moduli) and h the mean of
their sizes normal to the facet. Without the second a point left three zero modes to a cell of
degree 2 in a section, and 21 in space; with it cond₁ of K is up to 7.3 and 13 times that of whole
cells. A polynomial of that degree all over has no such jump, so ground that strains evenly does not
feel it. There is no ghost mass in the sweep: it would put a false resonance at √(γ_K/γ_M).
Momenta are brought to nodes with one.

Facets of hexahedra are integrated at their nodes (Gauss and Lobatto). That changes nothing where
the jump is the same all over a facet. A cell that twists about the facet, whose jump changes its
sign, an exact integral would hold by a ninth of that: with a_K as in a section the condition of K
was 1.7e4 where one point was in a cell of a solid, and at the nodes it is 3.8e3. There a point also
leaves six modes of its cell to the term, not one as in a section, which takes a larger a_K. Where a
cell is half full that would cost accuracy, so that a_K falls as the cell fills, and the condition
is 1.9e3; of whole cells it is 1.1e3.
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

# Second derivatives in hexahedra are long: gcc takes a minute of -O2, and 12 s of -O1.
_JIT = {"cffi_extra_compile_args": ["-O1", "-g0"]}

STRENGTH = {2: 0.05, 3: 0.22}
"""a_K by the dimensions of space: in a section the condition of K hardly depends on it from 0.03 to
0.1; in space a_K is that of a cell with next to nothing in it, and 0.17 at an eighth. Cells of
degree 2 take twice as much, or a point far out in one swings three times as far as a whole cell
would; it shifts a pillar by a quarter of what the term costs at degree 1."""


class GhostForm:
    """K_G on some facets.

    Args:
        domain: The domain.
        facets: Inner facets of this rank, ghosts included, shape ``(n,)``.
        strength: a_K of cells that are as loose as can be [-]; by dimension and degree if ``None``.
    """

    def __init__(
        self, domain: Domain, facets: npt.NDArray[np.int32], strength: float | None = None
    ) -> None:
        mesh = domain.mesh
        self._modulus, self._loose = (Function(functionspace(mesh, ("DG", 0))) for _ in range(2))
        self.loosen(np.ones(len(domain.regions)))
        u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
        n = ufl.FacetNormal(mesh)
        h = ufl.avg(_depth(domain))
        ones = np.ones(len(facets), np.int32)
        tags = meshtags(mesh, mesh.topology.dim - 1, np.sort(facets), ones)
        dS = ufl.Measure(
            "dS",
            domain=mesh,
            subdomain_data=tags,
            subdomain_id=1,
            metadata=_rule(domain),
        )
        degree = domain.V.ufl_element().degree
        strength = STRENGTH[domain.gdim] * degree if strength is None else strength
        factor = Constant(mesh, PETSc.ScalarType(strength))
        jumps = h / 3 * ufl.inner(_normal_jump(u, n), _normal_jump(v, n))
        if degree == 2:
            jumps += h**3 / 20 * ufl.inner(_curvature_jump(u, n), _curvature_jump(v, n))
        # The cells' own entries, of nought, so that the pattern is that of all matrices.
        nothing = Constant(mesh, PETSc.ScalarType(0.0)) * ufl.inner(u, v) * ufl.dx
        one, other = self._loose("+"), self._loose("-")
        a_K = factor * (one + other - one * other)  # nearly the larger; of 1 and anything 1
        total = a_K * ufl.avg(self._modulus) * jumps * dS + nothing
        self._form = form(total, jit_options=_JIT if degree == 2 else None)

    def loosen(self, looseness: npt.NDArray[np.float64]) -> None:
        """Tell what each cell needs of a_K; before, all of it.

        Args:
            looseness: Share of a_K of each local cell, ghosts included, 0 to 1 [-], shape
                ``(num_local_cells,)``.
        """
        self._loose.x.array[:] = looseness

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


def _rule(domain: Domain) -> dict[str, str | int]:
    """The rule of facets: on the nodes of those of hexahedra."""
    degree = domain.V.ufl_element().degree
    if domain.mesh.topology.cell_name() != "hexahedron":
        return {"quadrature_degree": 2 * degree}
    return {"quadrature_rule": "GLL", "quadrature_degree": 2 * degree - 1}


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


def _curvature_jump(u: ufl.core.expr.Expr, n: ufl.FacetNormal) -> ufl.core.expr.Expr:
    """∂²u/∂n² on one side less that on the other."""
    one, other = (
        ufl.dot(ufl.dot(ufl.grad(ufl.grad(u))(side), n(side)), n(side)) for side in ("+", "-")
    )
    return one - other
