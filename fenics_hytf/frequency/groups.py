# SPDX-License-Identifier: MIT
"""Lines shared out among groups of ranks, each of which holds the whole mesh.

Ranks with the same part of the mesh are joined by a second communicator, ``across``. Frequencies
are independent of one another, so groups share them out at hardly any cost, where ranks that share
a mesh wait for each other in every factorisation. What one group meets, all of them are told.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

from mpi4py import MPI

from fenics_hytf.frequency.errors import SweepError


def share(count: int, across: MPI.Comm) -> slice:
    """This group's share of so many things: neighbours, as many in each group as in the others.

    Args:
        count: How many there are.
        across: Communicator of the ranks that hold the same part of the mesh.

    Returns:
        Their numbers.
    """
    return shares(count, across)[across.rank]


def shares(count: int, across: MPI.Comm) -> list[slice]:
    """The shares of all groups; see :func:`share`."""
    bounds = (count * group // across.size for group in range(across.size + 1))
    return [slice(*pair) for pair in pairwise(bounds)]


@contextmanager
def together(across: MPI.Comm) -> Iterator[None]:
    """Work that groups do apart; an error of one of them is raised in all (collective).

    Args:
        across: Communicator of the ranks that hold the same part of the mesh.

    Raises:
        SweepError: What the first of the groups that failed has met.
    """
    failure: SweepError | None = None
    try:
        yield
    except SweepError as error:
        failure = error
    for met in across.allgather(failure) if across.size > 1 else [failure]:
        if met is not None:
            raise met
