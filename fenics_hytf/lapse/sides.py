# SPDX-License-Identifier: MIT
"""What comes from the ground beyond the sides; see :mod:`fenics_hytf.lapse.free_field`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fenics_hytf.frequency import AffineLoads, Loads

RealArray = npt.NDArray[np.float64]


class SideForce(Protocol):
    """What the ground beyond a side does to it."""

    def fasten(self, normal: RealArray, tangential: RealArray) -> None:
        """Take the impedances of the section's cells [kg/(m² s)], shape ``(num_local_cells,)``."""

    def add_force(self, line: int, side: int, nodal: PETSc.Vec) -> None:
        """Add its nodal forces for a unit of a motion at a line, or for what it has carried."""

    def add_start(self, derivative: int, nodal: PETSc.Vec) -> None:
        """Add its nodal forces at the start of the lapse, or their rate."""


@dataclass(frozen=True)
class Sides:
    """All sides with ground beyond them.

    Attributes:
        forces: A force each; none where the scene calls for no free field.
    """

    forces: Sequence[SideForce]

    def fasten(self, normal: RealArray, tangential: RealArray) -> None:
        """Take the impedances of the section's cells; see :class:`SideForce`."""
        for force in self.forces:
            force.fasten(normal, tangential)

    def loads(
        self, loads: Sequence[PETSc.Vec] | AffineLoads, T: PETSc.Mat
    ) -> Sequence[PETSc.Vec] | Loads:
        """Right-hand sides with the forces from beyond the sides, which differ between lines.

        Args:
            loads: Those of the section.
            T: Its constraint matrix.

        Returns:
            The loads themselves where there are no such sides.
        """
        return _SideLoads(self, loads, T) if self.forces else loads

    def add_start(self, derivative: int, load: PETSc.Vec, T: PETSc.Mat) -> None:
        """Add what they do at the start of the lapse, or its rate, to a load on the unknowns."""
        self.add(lambda force, nodal: force.add_start(derivative, nodal), load, T)

    def add(
        self, act: Callable[[SideForce, PETSc.Vec], None], load: PETSc.Vec, T: PETSc.Mat
    ) -> None:
        """Add Tᵀ f to a load, f being what the forces add up to at the nodes."""
        if not self.forces:
            return
        nodal = T.createVecLeft()
        for force in self.forces:
            act(force, nodal)
        T.multTransposeAdd(nodal, load, load)
        nodal.destroy()


@dataclass(frozen=True)
class _SideLoads:
    """Right-hand sides with what comes from beyond the sides; made anew for each line."""

    sides: Sides
    given: Sequence[PETSc.Vec] | AffineLoads
    T: PETSc.Mat

    def __len__(self) -> int:
        return len(self.given)

    def __call__(self, line: int) -> Sequence[PETSc.Vec]:
        if isinstance(self.given, AffineLoads):
            loads = list(self.given(line))
        else:
            loads = [load.copy() for load in self.given]
        for side, load in enumerate(loads):
            self._add(line, side, load)
        return loads

    def _add(self, line: int, side: int, load: PETSc.Vec) -> None:
        self.sides.add(lambda force, nodal: force.add_force(line, side, nodal), load, self.T)
