# SPDX-License-Identifier: MIT
"""All points of all ranks as plain arrays, and back onto any number of ranks.

Cells are told by their input index, which does not depend on the ranks. A point goes to the rank
that owns its cell, and a rank's points are sorted by the input index of their cell, then by id: on
as many ranks as before each has its very arrays in their very order. The points that left the mesh,
and the account of mass, are kept by rank; on another number of ranks they are handed out anew, and
the ledger over all ranks is the same.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh

from fenics_hytf.particles.points import Arrays, IntArray, Points, agree, join, take

_HISTORY = "history/"
_PARKED = "parked/"
_RANK = "parked_by"
_COUNT = "deleted"
_MASSES = ("deleted_mass", "initial_mass")


def gather_points(points: Points, mesh: Mesh) -> Arrays | None:
    """Bring all points together on rank 0 (collective).

    Args:
        points: The points.
        mesh: Their mesh.

    Returns:
        ``None`` but on rank 0. There, by name and sorted by id, the arrays of
        :class:`~fenics_hytf.particles.Points`, ``cell`` being the input index; those of the history
        as ``history/NAME``; those of the parked as ``parked/NAME`` in the order they left, with the
        rank they left from as ``parked_by``; and of each rank ``deleted`` (points),
        ``deleted_mass`` and ``initial_mass`` (exact sums, in digits).
    """
    index = np.asarray(mesh.topology.original_cell_index, np.int64)
    mine = points.arrays() | {"cell": index[points.cell]}
    parked = points.parked | {"cell": _renumbered(points.parked["cell"], index)}
    account = (points.deleted, *(str(getattr(points, name)) for name in _MASSES))
    parts = mesh.comm.gather((mine, parked, account))
    if parts is None:
        return None
    everyone = join(part for part, _, _ in parts)
    everyone = take(everyone, np.argsort(everyone["id"]))
    kept = {_HISTORY + name if name in points.history else name: a for name, a in everyone.items()}
    kept |= {_PARKED + name: values for name, values in join(p for _, p, _ in parts).items()}
    sizes = [len(part["id"]) for _, part, _ in parts]
    kept[_RANK] = np.repeat(np.arange(len(parts)), sizes)
    deleted, *masses = zip(*(row for _, _, row in parts), strict=True)
    kept[_COUNT] = np.array(deleted, np.int64)
    return kept | {name: np.array(texts) for name, texts in zip(_MASSES, masses, strict=True)}


def scatter_points(arrays: Arrays, mesh: Mesh) -> Points:
    """Hand out points that were brought together (collective).

    Args:
        arrays: What :func:`gather_points` returned, the same on every rank.
        mesh: The same mesh as then, on any number of ranks.

    Returns:
        The points of this rank.

    Raises:
        ValueError: A point lies in a cell that the mesh has not; on every rank.
    """
    comm = mesh.comm
    cells = mesh.topology.index_map(mesh.topology.dim)
    index = np.asarray(mesh.topology.original_cell_index, np.int64)
    local = np.full(cells.size_global, -1, np.int32)
    local[index[: cells.size_local]] = np.arange(cells.size_local, dtype=np.int32)
    place = np.asarray(arrays["cell"], np.int64)
    strays = np.count_nonzero((place < 0) | (place >= cells.size_global))
    fault = f"Found {strays} points in cells that the mesh has not; expected the mesh they were in."
    agree(comm, ValueError, fault if strays else "")

    mine = np.flatnonzero(local[place] >= 0)
    mine = mine[np.lexsort((arrays["id"][mine], place[mine]))]
    names = [name for name in arrays if "/" not in name]
    history = [n.removeprefix(_HISTORY) for n in arrays if n.startswith(_HISTORY)]
    state = {n: arrays[n][mine] for n in names if n not in (_RANK, _COUNT, *_MASSES)}
    points = Points(**(state | {"cell": local[place[mine]]}))  # type: ignore[arg-type]
    points.history = {
        name: np.asarray(arrays[_HISTORY + name][mine], np.float64) for name in history
    }
    parked = {n.removeprefix(_PARKED): a for n, a in arrays.items() if n.startswith(_PARKED)}
    points.parked = take(parked, arrays[_RANK] % comm.size == comm.rank)
    points.parked["cell"] = _renumbered(points.parked["cell"], local)
    before = range(comm.rank, len(arrays[_COUNT]), comm.size)
    points.deleted = sum(int(arrays[_COUNT][rank]) for rank in before)
    points.deleted_mass, points.initial_mass = (
        sum(int(arrays[name][rank]) for rank in before) for name in _MASSES
    )
    return points


def _renumbered(cells: npt.NDArray[np.generic], numbers: npt.NDArray[np.generic]) -> IntArray:
    """Other numbers of cells; those of no cell, below zero, stay."""
    given = np.asarray(cells, np.int64)
    renumbered = given.astype(numbers.dtype)
    renumbered[given >= 0] = numbers[given[given >= 0]]
    return renumbered
