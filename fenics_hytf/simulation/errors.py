# SPDX-License-Identifier: MIT
"""How a simulation stops before its end."""

from __future__ import annotations

from fenics_hytf.simulation.records import Result


class SimulationError(RuntimeError):
    """The numerics stopped; the message names the lapse.

    Attributes:
        lapse: Number of the lapse.
        partial: Results of the lapses before, or ``None`` where there are none.
    """

    def __init__(self, lapse: int, reason: str, partial: Result | None) -> None:
        self.lapse = lapse
        self.partial = partial
        super().__init__(f"lapse {lapse}: {reason}")


class CheckpointError(RuntimeError):
    """A checkpoint could not be written or read; ``str()`` says which, why, and what to do."""
