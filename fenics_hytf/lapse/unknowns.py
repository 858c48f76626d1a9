# SPDX-License-Identifier: MIT
"""The unknowns q of u = T q, and what passes between them, the nodes, and cells or points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from dolfinx import la
from dolfinx.fem import Function
from petsc4py import PETSc

from fenics_hytf.domain import Domain, constraint_matrix
from fenics_hytf.operators import evaluate

RealArray = npt.NDArray[np.float64]


class Unknowns:
    """A constraint matrix T, and products with it.

    Args:
        domain: The domain.
        supports: Kind of each boundary, see :func:`~fenics_hytf.domain.constraint_matrix`.
        shaken: Components in which the base moves.
        bare: Owned nodes that no soil moves, or ``None``.

    Attributes:
        T: The matrix; rows are displacements of nodes, columns the unknowns.
    """

    def __init__(
        self,
        domain: Domain,
        supports: Mapping[str, str],
        shaken: Sequence[int] = (),
        bare: npt.NDArray[np.bool_] | None = None,
    ) -> None:
        self._domain = domain
        self.T = constraint_matrix(domain, supports, shaken, bare)

    def __len__(self) -> int:
        """Unknowns of all ranks."""
        return int(self.T.getSize()[1])

    @property
    def num_local(self) -> int:
        """Unknowns of this rank."""
        return int(self.T.getLocalSize()[1])

    def destroy(self) -> None:
        """Destroy the matrix."""
        self.T.destroy()

    def collect(self, nodal: RealArray) -> PETSc.Vec:
        """Force on the unknowns of what all ranks' cells or points do to their nodes (collective).

        Args:
            nodal: This rank's, at its local nodes, ghosts included, components fastest, shape
                ``(num_local_nodes·num_components,)``.

        Returns:
            Tᵀ of their sum; the caller destroys it.
        """
        sums = Function(self._domain.V)
        sums.x.array[:] = nodal
        sums.x.scatter_reverse(la.InsertMode.add)
        force, nodes = self.T.createVecs()
        nodes.array[:] = sums.x.array[: nodes.getLocalSize()]
        self.T.multTranspose(nodes, force)
        nodes.destroy()
        return force

    def expand(self, q: RealArray) -> RealArray:
        """Nodal field u = T q (collective).

        Args:
            q: This rank's unknowns, shape ``(num_local_unknowns,)``.

        Returns:
            At the local nodes, ghosts included, shape
            ``(num_local_nodes, num_components)``.
        """
        owned = evaluate(self.T, q)
        u = Function(self._domain.V)
        u.x.array[: len(owned)] = owned
        u.x.scatter_forward()
        return u.x.array.real.reshape(-1, self._domain.num_components).copy()

    def restrict(self, u: RealArray) -> RealArray:
        """Unknowns of a nodal field that keeps the constraints (collective).

        Args:
            u: At the local nodes, ghosts are ignored, shape ``(num_local_nodes, num_components)``.

        Returns:
            This rank's, shape ``(num_local_unknowns,)``; of tied nodes their mean.
        """
        total, nodes = self.T.createVecs()
        count = total.duplicate()
        nodes.array[:] = u.ravel()[: nodes.getLocalSize()]
        self.T.multTranspose(nodes, total)
        nodes.set(1.0)
        self.T.multTranspose(nodes, count)
        q = total.array_r.real / count.array_r.real
        for vector in (total, nodes, count):
            vector.destroy()
        return np.asarray(q)
