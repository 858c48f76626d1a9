# SPDX-License-Identifier: MIT
"""What goes on from lapse to lapse and is kept in a checkpoint."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, get_type_hints

import numpy as np
import numpy.typing as npt

from fenics_hytf.lapse import FreeFieldState, LapseResult, SlipState
from fenics_hytf.particles import MassLedger
from fenics_hytf.simulation.checkpoint import Checkpoint
from fenics_hytf.simulation.records import Work
from fenics_hytf.soil import CyclicState

RealArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class RunState:
    """What a checkpoint holds; see :class:`~fenics_hytf.simulation.run.Run`."""

    lapses: tuple[LapseResult, ...]
    work: Work
    ledger: MassLedger
    points: dict[str, npt.NDArray[Any]]
    carried: RealArray
    base_carried: RealArray
    effective_strain: RealArray | None
    free_fields: tuple[FreeFieldState, ...]
    cycles: CyclicState | None
    sliding: SlipState | None

    @classmethod
    def load(cls, found: Checkpoint) -> RunState:
        """Read it from a checkpoint."""
        kinds = get_type_hints(cls)
        return cls(**{name: found.load(name, kind) for name, kind in kinds.items()})

    def parts(self) -> dict[str, Any]:
        """Its parts by name, for a checkpoint to hold."""
        return {each.name: getattr(self, each.name) for each in fields(self)}
