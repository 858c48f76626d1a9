# SPDX-License-Identifier: MIT
"""The mass ledger: what the points weigh, and where the mass of those that left has gone.

Mass is neither made nor lost: at any time, over all ranks,

    initial mass = mass of the points + mass of the parked + mass of the deleted.

Sums of floating-point numbers depend on their order, so on the number of ranks. Every double is an
integer multiple of 2^-1074, the smallest one; the sums here are taken in these integers, exactly,
and rounded once at the end. A ledger is therefore the same on 1, 2 and 3 ranks to the last bit.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

_SMALLEST = -1074  # binary exponent of the smallest double
_LOW_BITS = 26  # mantissas are summed in two halves: 64-bit sums hold 2^36 of them


def exact_sum(values: npt.NDArray[np.float64]) -> int:
    """Sum doubles without rounding.

    Args:
        values: Finite numbers, any unit, shape ``(n,)``.

    Returns:
        The sum as an integer, in units of 2^-1074 times the unit of ``values``.

    Raises:
        ValueError: If a value is NaN or infinite.
    """
    if not np.all(np.isfinite(values)):
        raise ValueError("Found NaN or infinity in an exact sum; expected finite numbers.")
    fraction, exponent = np.frexp(np.asarray(values, dtype=np.float64))
    mantissa = (fraction * 2.0**53).astype(np.int64)
    total = 0
    for power in np.unique(exponent[mantissa != 0]):
        chosen = mantissa[exponent == power]
        high = int(np.sum(chosen >> _LOW_BITS))
        low = int(np.sum(chosen & ((1 << _LOW_BITS) - 1)))
        shift = int(power) - 53 - _SMALLEST
        part = (high << _LOW_BITS) + low
        total += part << shift if shift >= 0 else part >> -shift
    return total


def rounded(total: int) -> float:
    """The double nearest to a sum of ``exact_sum``, in the unit of the values summed."""
    return total / (1 << -_SMALLEST)


@dataclass(frozen=True)
class MassLedger:
    """Points and their mass over all ranks; the same on every rank.

    Masses are in kg, per metre of thickness [kg/m] in two dimensions.

    Attributes:
        num_points: Points that weigh.
        mass: Their mass.
        parked: Points that left the mesh and are kept aside.
        parked_mass: Their mass.
        deleted: Points that left the mesh and were removed.
        deleted_mass: Their mass.
        migrated: Points that changed ranks in this move.
        initial_mass: Mass of all points when they were seeded.
        imbalance: Absolute value of mass + parked + deleted - initial, over initial [-], of the
            exact sums.
    """

    num_points: int
    mass: float
    parked: int
    parked_mass: float
    deleted: int
    deleted_mass: float
    migrated: int
    initial_mass: float
    imbalance: float

    @classmethod
    def balance(
        cls,
        comm: MPI.Comm,
        counts: tuple[int, int, int],
        masses: tuple[int, int, int],
        initial: int,
        migrated: int = 0,
    ) -> MassLedger:
        """Draw up the ledger over all ranks (collective).

        Args:
            comm: Communicator of the mesh.
            counts: Points here, parked and deleted by this rank.
            masses: Their masses as exact sums of this rank (see ``exact_sum``).
            initial: Mass this rank seeded, as an exact sum.
            migrated: Points that left this rank for another.

        Returns:
            The ledger.
        """
        rows = comm.allgather((*counts, *masses, initial, migrated))
        here, parked, deleted, *sums, moved = (sum(column) for column in zip(*rows, strict=True))
        mass, parked_mass, deleted_mass, seeded = sums
        difference = abs(mass + parked_mass + deleted_mass - seeded)
        return cls(
            num_points=here,
            mass=rounded(mass),
            parked=parked,
            parked_mass=rounded(parked_mass),
            deleted=deleted,
            deleted_mass=rounded(deleted_mass),
            migrated=moved,
            initial_mass=rounded(seeded),
            imbalance=difference / seeded if seeded else float(difference != 0),
        )

    def as_dict(self) -> dict[str, int | float]:
        """The ledger as plain numbers by name."""
        return asdict(self)
