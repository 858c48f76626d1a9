# SPDX-License-Identifier: MIT
"""Ranks in groups: each holds the whole mesh, its ranks share it, and groups share out the lines.

Frequencies do not depend on one another, so many small groups are the quickest; a group is as large
as the memory of a factorisation asks for. Groups are neighbours, so that those who share a mesh
share a node as well.
"""

from __future__ import annotations

from dataclasses import dataclass

from mpi4py import MPI

from fenics_hytf.domain import Domain
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.inspection import inspect
from fenics_hytf.simulation.memory import free_memory

_SHARE = 0.8  # of a node's free memory that may be planned with: estimates are rough


@dataclass(frozen=True)
class Groups:
    """What a rank belongs to.

    Attributes:
        within: Communicator of the ranks that share a mesh.
        across: Communicator of the ranks with the same part of it, one of each group.
    """

    within: MPI.Comm
    across: MPI.Comm

    def free(self) -> None:
        """Free the communicators (collective); not those that were not made here."""
        if self.across.size > 1:
            self.within.Free()
            self.across.Free()


def group_faults(size: int | None, ranks: int) -> list[str]:
    """What is wrong with the size of the groups.

    Args:
        size: Ranks of a group, or ``None``.
        ranks: Ranks there are.

    Returns:
        Messages.
    """
    if size is None or (size > 0 and ranks % size == 0):
        return []
    divisors = ", ".join(str(k) for k in _divisors(ranks))
    among = f"{ranks} rank" + "s" * (ranks > 1)
    return [f"group size: found {size}, with {among}; expected one of {divisors}"]


def form_groups(scene: Scene, comm: MPI.Comm, size: int | None = None) -> Groups:
    """Put ranks in groups (collective).

    Args:
        scene: The scene, whose size tells what a group has to hold.
        comm: All ranks.
        size: Ranks of a group; from memory if ``None``.

    Returns:
        The groups.

    Raises:
        ValueError: The size does not divide the number of ranks.
        SceneError: A fault that only the mesh shows.
    """
    faults = group_faults(size, comm.size)
    if faults:
        raise ValueError(faults[0])
    size = size or _fitting_size(scene, comm)
    if size == comm.size:
        return Groups(comm, MPI.COMM_SELF)
    return Groups(comm.Split(comm.rank // size, comm.rank), comm.Split(comm.rank % size, comm.rank))


def require_same_parts(domain: Domain) -> None:
    """Make sure that ranks which are to hold the same part of the mesh do (collective).

    Args:
        domain: The domain.

    Raises:
        RuntimeError: The mesh was parted otherwise in another group.
    """
    parts = domain.across.allgather(domain.input_cells.tobytes())
    if domain.comm.allreduce(any(part != parts[0] for part in parts), MPI.LOR):
        raise RuntimeError(
            "found groups of ranks that part the mesh in different ways; expected the same parts: "
            "choose a group size of 1, or of all ranks"
        )


def _fitting_size(scene: Scene, comm: MPI.Comm) -> int:
    """The fewest ranks whose memory holds a factorisation, and no more groups than lines."""
    if comm.size == 1:
        return 1
    asked = inspect(scene, comm)
    available, on_node = _memory_of_node(comm)
    for size in _divisors(comm.size):
        groups = comm.size // size
        planned = asked.memory_of(size) * on_node / size
        if groups <= max(asked.lines, default=1) and planned <= _SHARE * available:
            return size
    return comm.size


def _divisors(number: int) -> list[int]:
    return [k for k in range(1, number + 1) if number % k == 0]


def _memory_of_node(comm: MPI.Comm) -> tuple[int, int]:
    """Free memory of the poorest node [bytes], and the most ranks a node has (collective)."""
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    ranks = node.size
    node.Free()
    return comm.allreduce(free_memory(), MPI.MIN), comm.allreduce(ranks, MPI.MAX)
