# SPDX-License-Identifier: MIT
"""What the mass of the points does to motions and momenta: M r, −TᵀM r, and M⁻¹."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

RealArray = npt.NDArray[np.float64]

_TOLERANCE = 1e-14  # residual: what starts a lapse is known as well as it can be
_STEPS = 200  # a consistent mass takes 20 to 40


class Inertia:
    """The mass as motions and momenta see it.

    Args:
        axes: Component in which each motion acts.
        num_components: Components of the displacement.

    Attributes:
        influence: M r of each motion at the nodes [kg], borrowed until the points are weighed
            again.
        forces: −TᵀM r of each motion [kg], likewise.
    """

    def __init__(self, axes: Sequence[int], num_components: int) -> None:
        self._axes, self._num_components = axes, num_components
        self.influence: list[PETSc.Vec] = []
        self.forces: list[PETSc.Vec] = []
        self._held: PETSc.Mat
        self._solver: PETSc.KSP | None = None

    def destroy(self) -> None:
        """Destroy all PETSc objects, to weigh other unknowns or none."""
        for vector in (*self.influence, *self.forces):
            vector.destroy()
        self.influence, self.forces = [], []
        if self._solver is not None:
            self._solver.destroy()
        self._solver = None

    def weigh(self, M: PETSc.Mat, T: PETSc.Mat, held: PETSc.Mat) -> None:
        """Take another mass (collective).

        Args:
            M: Mass of all nodes; held ones pull on their neighbours too.
            T: Constraint matrix.
            held: TᵀMT, with a ghost where cells have lost points; borrowed.
        """
        for vector in (*self.influence, *self.forces):
            vector.destroy()
        self.influence = [self._weighed(M, axis) for axis in self._axes]
        self.forces = [_constrained(T, Mr) for Mr in self.influence]
        self._held = held

    def _weighed(self, M: PETSc.Mat, axis: int) -> PETSc.Vec:
        r, Mr = M.createVecs()
        r.array[axis :: self._num_components] = 1.0
        M.mult(r, Mr)
        r.destroy()
        return Mr

    def accelerate(self, force: PETSc.Vec) -> RealArray:
        """M⁻¹ f on this rank's unknowns (collective), by conjugate gradients.

        Points weigh a well-conditioned mass as long as each cell has as many as it was seeded with;
        where cells have lost points M is held by a ghost.

        Args:
            force: f, such as the momentum SᵀM_p v of the points.

        Returns:
            Shape ``(num_local_unknowns,)``.
        """
        if self._solver is None:
            self._solver = PETSc.KSP().create(force.comm)
            self._solver.setOptionsPrefix("hytf_mass_")
            self._solver.setType(PETSc.KSP.Type.CG)
            self._solver.getPC().setType(PETSc.PC.Type.JACOBI)
            self._solver.setTolerances(rtol=_TOLERANCE, atol=0.0, max_it=_STEPS)
        self._solver.setOperators(self._held)
        x = force.duplicate()
        self._solver.solve(force, x)
        values = x.array_r.real.copy()
        x.destroy()
        return np.asarray(values)


def _constrained(T: PETSc.Mat, Mr: PETSc.Vec) -> PETSc.Vec:
    force = T.createVecRight()
    T.multTranspose(Mr, force)
    force.scale(-1.0)
    return force
