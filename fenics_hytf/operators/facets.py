# SPDX-License-Identifier: MIT
"""Forms on boundaries: dashpots that let waves out, and the traction of level ground beyond a side.

C = ∫ (ρV_p u_n v_n + ρV_s u_t·v_t) dS            Lysmer and Kuhlemeyer (1969)
P = ∫ σ(∂u/∂h)n · v dS                            free field, which varies with height h only
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx.fem import Constant, Function, assemble_scalar, form, functionspace
from dolfinx.fem.petsc import assemble_matrix, assemble_vector, create_matrix
from dolfinx.mesh import meshtags
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain

RealArray = npt.NDArray[np.float64]


class DashpotForm:
    """C of dashpots on some boundaries.

    Args:
        domain: The domain.
        names: Names of the boundaries.
    """

    def __init__(self, domain: Domain, names: Sequence[str]) -> None:
        cells = functionspace(domain.mesh, ("DG", 0))
        self._normal, self._tangential = Function(cells), Function(cells)
        u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
        if domain.num_components == 1:
            density = self._tangential * ufl.inner(u, v)
        else:
            n = ufl.FacetNormal(domain.mesh)
            across = ufl.inner(ufl.dot(u, n), ufl.dot(v, n))
            density = self._normal * across + self._tangential * (ufl.inner(u, v) - across)
        self._form = form(density * _ds(domain, names))

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix of the cells at the boundaries alone; the caller destroys it."""
        return create_matrix(self._form)

    def assemble(self, matrix: PETSc.Mat, normal: RealArray, tangential: RealArray) -> None:
        """Assemble into a matrix.

        Args:
            matrix: Of the elastic form's pattern, or from :meth:`create_matrix`; overwritten.
            normal: Impedance ρV_p of each local cell, ghosts included [kg/(m² s)], shape
                ``(num_local_cells,)``; not used across a section.
            tangential: Impedance ρV_s of each local cell, same shape.
        """
        self._normal.x.array[:] = normal
        self._tangential.x.array[:] = tangential
        _assemble(matrix, self._form)


class TractionForm:
    """P, the traction on a vertical side of ground whose motion varies with height only.

    It takes nodal values on the side to forces there; what other nodes hold does not matter.

    Args:
        domain: The domain.
        name: Name of the side.
    """

    def __init__(self, domain: Domain, name: str) -> None:
        cells = functionspace(domain.mesh, ("DG", 0))
        self._lame_lambda, self._shear_modulus = Function(cells), Function(cells)
        u, v = ufl.TrialFunction(domain.V), ufl.TestFunction(domain.V)
        n, up = ufl.FacetNormal(domain.mesh), domain.gdim - 1
        upwards = ufl.as_vector([float(axis == up) for axis in range(domain.gdim)])
        if domain.num_components == 1:
            traction = self._shear_modulus * u.dx(up) * ufl.dot(upwards, n)
        else:
            i, j = ufl.indices(2)
            strain = ufl.sym(ufl.as_tensor(u.dx(up)[i] * upwards[j], (i, j)))
            stress = self._lame_lambda * ufl.tr(strain) * ufl.Identity(domain.gdim)
            traction = ufl.dot(stress + 2 * self._shear_modulus * strain, n)
        self._form = form(ufl.inner(traction, v) * _ds(domain, [name]))

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix of the cells at the side alone; the caller destroys it."""
        return create_matrix(self._form)

    def assemble(self, matrix: PETSc.Mat, lame_lambda: RealArray, shear_modulus: RealArray) -> None:
        """Assemble into a matrix.

        Args:
            matrix: From :meth:`create_matrix`, overwritten.
            lame_lambda: λ of the ground beyond each local cell [Pa], shape ``(num_local_cells,)``.
            shear_modulus: G likewise.
        """
        self._lame_lambda.x.array[:] = lame_lambda
        self._shear_modulus.x.array[:] = shear_modulus
        _assemble(matrix, self._form)


def mean_rows(domain: Domain, name: str) -> sparse.csr_matrix:
    """Rows that average the displacement over a boundary (collective).

    Args:
        domain: The domain.
        name: Name of the boundary.

    Returns:
        This rank's part of the average, to be summed over the ranks, shape
        ``(num_components, num_local_nodes·num_components)``.
    """
    ds, count = _ds(domain, [name]), domain.num_components
    one = Constant(domain.mesh, PETSc.ScalarType(np.ones(count) if count > 1 else 1.0))
    weights = assemble_vector(form(ufl.inner(one, ufl.TestFunction(domain.V)) * ds))
    weights.ghostUpdate(PETSc.InsertMode.ADD_VALUES, PETSc.ScatterMode.REVERSE)
    owned = weights.array.real.copy()
    weights.destroy()
    index_map = domain.V.dofmap.index_map
    dofs = np.arange(len(owned))
    shape = (count, (index_map.size_local + index_map.num_ghosts) * count)
    area = boundary_area(domain, name)
    return sparse.csr_matrix((owned / area, (dofs % count, dofs)), shape=shape)


def boundary_area(domain: Domain, name: str) -> float:
    """Area of a boundary [m²], of a section its length [m] (collective)."""
    one = Constant(domain.mesh, PETSc.ScalarType(1.0))
    mine = assemble_scalar(form(one * _ds(domain, [name])))
    return float(domain.comm.allreduce(mine.real))


def _ds(domain: Domain, names: Sequence[str]) -> ufl.Measure:
    fdim = domain.mesh.topology.dim - 1
    facets = np.unique(np.concatenate([domain.boundaries[name] for name in names]))
    tags = meshtags(domain.mesh, fdim, facets.astype(np.int32), np.ones(len(facets), np.int32))
    degree = 2 * domain.V.ufl_element().degree
    return ufl.Measure(
        "ds",
        domain=domain.mesh,
        subdomain_data=tags,
        subdomain_id=1,
        metadata={"quadrature_degree": degree},
    )


def _assemble(matrix: PETSc.Mat, compiled: object) -> None:
    matrix.zeroEntries()
    assemble_matrix(matrix, compiled)
    matrix.assemble()
