# SPDX-License-Identifier: MIT
"""Points move, are found again in the mesh that stayed, and change ranks (the convective phase).

    x <- x + du,    displacement <- displacement + du

Each rank looks for its points in its own cells, from the cell they were in. Those it does not find
are shown to all ranks, of which exactly one claims a point of the mesh; they migrate there with
all they carry. The rest has left the mesh: the scene's policy says what becomes of it, and the
ledger where its mass is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh
from mpi4py import MPI

from fenics_hytf.particles.geometry import RealArray
from fenics_hytf.particles.ledger import MassLedger, exact_sum
from fenics_hytf.particles.points import Arrays, IntArray, Points, agree, join, take
from fenics_hytf.particles.search import cell_search, locate, resolve_owners

Outside = Literal["error", "park", "delete"]

_SHOWN = 5  # points an error message names


class PointsOutside(RuntimeError):  # named for what was found
    """Points left the mesh where the scene does not allow it."""


class PointsNotFinite(RuntimeError):  # named for what was found
    """Points were given a displacement that is NaN or infinite."""


@dataclass(frozen=True)
class MoveReport:
    """What a move did, over all ranks; the same on every rank.

    Attributes:
        ledger: Points and their mass after the move.
        inverse_mappings: Points whose reference coordinates were searched: those that moved.
    """

    ledger: MassLedger
    inverse_mappings: int


def move(
    mesh: Mesh, points: Points, displacement: RealArray, outside: Outside = "error"
) -> MoveReport:
    """Move points through the mesh and find them again (collective).

    Args:
        mesh: Mesh, which stays where it is.
        points: Points, changed in place: position, displacement, cell, reference coordinates, and
            which rank holds them. They are sorted anew.
        displacement: Of each point of this rank [m], shape ``(len(points), gdim)``.
        outside: What happens to a point that leaves the mesh: ``error``, ``park`` (kept aside with
            its mass, it weighs no longer) or ``delete``.

    Returns:
        The ledger after the move, and the work done.

    Raises:
        ValueError: If ``outside`` is none of the three, or ``displacement`` has another shape.
        PointsNotFinite: If a displacement is NaN or infinite; names the points.
        PointsOutside: If a point left the mesh and ``outside`` is ``error``; names the points.
            Each is raised on every rank, and leaves the points as they were.
    """
    comm = mesh.comm
    _check(comm, points, displacement, outside)
    x = points.x + displacement
    moved = np.flatnonzero(np.any(x != points.x, axis=1))
    cells, X = points.cell.copy(), points.X.copy()
    cell_search(mesh)
    cells[moved], X[moved] = locate(mesh, x[moved], points.cell[moved])
    lost = np.flatnonzero(cells < 0)
    owner, claimed, claimed_X, own = show_to_all(mesh, x[lost])
    mine, owner = owner == comm.rank, owner[own]
    gone, leaving = lost[owner < 0], lost[owner >= 0]
    if outside == "error":
        agree_on_points(
            comm,
            PointsOutside,
            "points left the mesh",
            "Enlarge the mesh, or let the scene park or delete such points ([points] outside)",
            points.id[gone],
            x[gone],
        )

    arrays = points.arrays() | {
        "x": x,
        "cell": cells,
        "X": X,
        "displacement": points.displacement + displacement,
    }
    _book(points, take(arrays, gone), outside)
    arrived = _exchange(comm, take(arrays, leaving), owner[owner >= 0])
    arrived |= {"cell": claimed[mine], "X": claimed_X[mine]}
    points.assign(join([take(arrays, cells >= 0), arrived]))
    points.sort(mesh)
    ledger = points.ledger(comm, leaving.size)
    return MoveReport(ledger, comm.allreduce(moved.size))


def take_out(
    points: Points, gone: npt.NDArray[np.bool_], policy: Literal["park", "delete"]
) -> None:
    """Take points out of the mesh: they weigh no longer, and the ledger tells where they are.

    Args:
        points: Points, changed in place.
        gone: Which of them, shape ``(len(points),)``.
        policy: ``park`` or ``delete``.
    """
    _book(points, take(points.arrays(), gone), policy)
    points.assign(take(points.arrays(), ~gone))


def _book(points: Points, left: Arrays, policy: str) -> None:
    """Enter points that leave into the account of mass."""
    if policy == "park":
        points.parked = join([points.parked, left])
    elif policy == "delete":
        points.deleted += len(left["id"])
        points.deleted_mass += exact_sum(np.asarray(left["mass"], np.float64))


def agree_on_points(
    comm: MPI.Comm,
    kind: type[RuntimeError],
    fault: str,
    advice: str,
    ids: npt.NDArray[np.int64],
    x: RealArray,
) -> None:
    """Raise on every rank if points of any rank are at fault (collective).

    Args:
        comm: Communicator.
        kind: Type of the exception.
        fault: What is wrong with them, after their number.
        advice: What to do.
        ids: Identities of the points of this rank that are at fault, shape ``(n,)``.
        x: What to show of each, in m, shape ``(n, gdim)``.
    """
    order = np.argsort(ids)[:_SHOWN]
    first = [(int(ids[i]), tuple(float(value) for value in x[i])) for i in order]
    shares = comm.allgather((ids.size, first))
    total = sum(size for size, _ in shares)
    if total:
        shown = sorted(entry for _, entries in shares for entry in entries)[:_SHOWN]
        named = "; ".join(f"point {i} ({', '.join(f'{v:g}' for v in at)}) m" for i, at in shown)
        raise kind(f"Found that {total} {fault}, first {named}; expected none. {advice}.")


def _check(comm: MPI.Comm, points: Points, displacement: RealArray, outside: str) -> None:
    """Refuse arguments that no move can be made with, on every rank."""
    message = ""
    if outside not in get_args(Outside):
        message = f"Found outside = '{outside}'; expected one of {', '.join(get_args(Outside))}."
    elif displacement.shape != points.x.shape:
        message = (
            f"Found displacements of shape {displacement.shape}; expected {points.x.shape}, one a "
            "point."
        )
    agree(comm, ValueError, message)
    bad = np.flatnonzero(~np.all(np.isfinite(points.x + displacement), axis=1))
    agree_on_points(
        comm,
        PointsNotFinite,
        "points moved by what is not a finite number",
        "The response is not to be trusted: look at the lapse before",
        points.id[bad],
        displacement[bad],
    )


def show_to_all(
    mesh: Mesh, x: RealArray
) -> tuple[npt.NDArray[np.int32], IntArray, RealArray, slice]:
    """Find the owners of places that their own ranks do not find (collective).

    Args:
        mesh: Mesh.
        x: Places that this rank has lost [m], shape ``(n, gdim)``.

    Returns:
        Of the places that any rank has lost, in the order of the ranks: the rank that owns each,
        -1 if none does, shape ``(m,)``; the local cell and the reference coordinates of those that
        this rank owns, shapes ``(m,)`` and ``(m, tdim)``; and which of them are this rank's.
    """
    comm = mesh.comm
    shares = comm.allgather(x)
    cells, X = locate(mesh, np.concatenate(shares))
    index = mesh.topology.original_cell_index
    candidates = np.full(cells.size, -1, np.int64)
    candidates[cells >= 0] = index[cells[cells >= 0]]
    _, owner = resolve_owners(comm, candidates)
    start = sum(len(share) for share in shares[: comm.rank])
    return owner, cells, X, slice(start, start + len(x))


def _exchange(comm: MPI.Comm, arrays: Arrays, destination: IntArray) -> Arrays:
    """Send points to other ranks (collective).

    Args:
        comm: Communicator.
        arrays: Arrays of the points that leave, by name.
        destination: Rank of each, shape ``(n,)``.

    Returns:
        Arrays of the points that arrive, in the order of the ranks they come from.
    """
    parcels = [take(arrays, destination == rank) for rank in range(comm.size)]
    return join(comm.alltoall(parcels))
