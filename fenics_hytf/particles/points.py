# SPDX-License-Identifier: MIT
"""The material points: a structure of arrays, and how it is seeded.

Points sit on each cell's own grid: at the points X_q of a quadrature rule with weights w_q,

    volume = w_q |det J(X_q)|,    mass = density * volume,

so that at the start S^T M_p S is the consistent mass matrix under that very rule. A rank holds the
points in the cells it owns. What a scene does not call for has no array.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import basix
import numpy as np
import numpy.typing as npt
from dolfinx.mesh import Mesh
from mpi4py import MPI

from fenics_hytf.particles.geometry import RealArray, cell_grid
from fenics_hytf.particles.ledger import MassLedger, exact_sum
from fenics_hytf.scene import rule_degrees

IntArray = npt.NDArray[np.int32]
Arrays = dict[str, npt.NDArray[np.generic]]

_STATE = ("id", "cell", "X", "x", "mass", "volume", "region", "displacement")
_VECTORS = ("velocity", "acceleration")  # shape (n, gdim)
_TENSORS = ("strain", "stress")  # shape (n, 3) in two dimensions, (n, 6) in three


@dataclass(eq=False, repr=False)
class Points:
    """The points of one rank, sorted by the input index of their cell, then by id.

    Attributes:
        id: Identity over all ranks and at any number of ranks, shape ``(n,)``.
        cell: Local index of the owned cell that holds the point, shape ``(n,)``.
        X: Reference coordinates in that cell [-], shape ``(n, tdim)``.
        x: Position [m], shape ``(n, gdim)``.
        mass: [kg], per metre of thickness [kg/m] in two dimensions, shape ``(n,)``.
        volume: [m^3], area [m^2] in two dimensions, shape ``(n,)``.
        region: Region whose soil the point is made of, shape ``(n,)``.
        displacement: Since the point was seeded [m], shape ``(n, gdim)``.
        history: Further arrays by name, see ``add``; ``points["stress"]`` reads one.
        parked: Arrays of the points that left the mesh from this rank and are kept aside, by name.
        deleted: Points that left the mesh from this rank and were removed.
        deleted_mass: Their mass, as an exact sum (see ``ledger.exact_sum``).
        initial_mass: Mass seeded on this rank, as an exact sum.
    """

    id: npt.NDArray[np.int64]
    cell: IntArray
    X: RealArray
    x: RealArray
    mass: RealArray
    volume: RealArray
    region: IntArray
    displacement: RealArray
    history: dict[str, RealArray] = field(default_factory=dict)
    parked: Arrays = field(init=False)
    deleted: int = field(init=False, default=0)
    deleted_mass: int = field(init=False, default=0)
    initial_mass: int = field(init=False)

    def __post_init__(self) -> None:
        """Open the account of mass."""
        self.parked = {name: values[:0] for name, values in self.arrays().items()}
        self.initial_mass = exact_sum(self.mass)

    def __repr__(self) -> str:
        names = ", ".join(self.history) or "no history"
        return f"Points({len(self)} on this rank, {names})"

    def __len__(self) -> int:
        """Number of points on this rank."""
        return self.id.size

    def __getitem__(self, name: str) -> RealArray:
        """One array of the history.

        Raises:
            KeyError: If it was not called for.
        """
        if name not in self.history:
            raise KeyError(
                f"Found no array '{name}' on the points, there are {sorted(self.history)}: name it "
                "in the 'fields' the points are seeded with, or add() it."
            )
        return self.history[name]

    def __setitem__(self, name: str, values: RealArray) -> None:
        """Overwrite one array of the history; the shape is kept."""
        self[name][...] = values

    def add(self, name: str, shape: tuple[int, ...] | None = None) -> None:
        """Add an array of zeros to the history, which moves and migrates with the points.

        ``velocity`` [m/s], ``acceleration`` [m/s^2], ``strain`` [-] and ``stress`` [Pa] know their
        shapes. Strain and stress hold the tensor's own components (``eps_xy``, half of
        ``gamma_xy``): xx, yy, xy in two dimensions, xx, yy, zz, yz, xz, xy in three.

        Args:
            name: Name of the array.
            shape: Shape of one point's entry; needed for other names.

        Raises:
            ValueError: If the name is taken, or the shape is neither given nor known.
        """
        gdim = self.x.shape[1]
        known = dict.fromkeys(_VECTORS, (gdim,)) | dict.fromkeys(_TENSORS, (3 * gdim - 3,))
        if name in self.arrays():
            raise ValueError(f"Found a second array '{name}' on the points; expected it once.")
        if shape is None and name not in known:
            raise ValueError(
                f"Found an array '{name}' of no known shape; expected one of {sorted(known)}, or "
                "give the shape of one point's entry."
            )
        self.history[name] = np.zeros((len(self), *(known[name] if shape is None else shape)))
        self.parked[name] = np.zeros((len(self.parked["id"]), *self.history[name].shape[1:]))

    def arrays(self) -> Arrays:
        """All arrays by name, not copied."""
        return {name: getattr(self, name) for name in _STATE} | self.history

    def assign(self, arrays: Mapping[str, npt.NDArray[np.generic]]) -> None:
        """Replace all arrays at once, as when points come, go or change their order.

        Args:
            arrays: As ``arrays`` returns them, of equal length.
        """
        for name in _STATE:
            setattr(self, name, arrays[name])
        self.history = {name: np.asarray(arrays[name], np.float64) for name in self.history}

    def sort(self, mesh: Mesh) -> None:
        """Order the points by the input index of their cell, then by id."""
        order = np.lexsort((self.id, mesh.topology.original_cell_index[self.cell]))
        if np.any(order[1:] < order[:-1]):
            self.assign(take(self.arrays(), order))

    @property
    def bytes_per_point(self) -> int:
        """Memory of one point, history included [bytes]."""
        return sum(a.itemsize * math.prod(a.shape[1:]) for a in self.arrays().values())

    def ledger(self, comm: MPI.Comm, migrated: int = 0) -> MassLedger:
        """Draw up the mass ledger over all ranks (collective).

        Args:
            comm: Communicator of the mesh.
            migrated: Points that left this rank for another.
        """
        counts = (len(self), len(self.parked["id"]), self.deleted)
        parked_mass = exact_sum(np.asarray(self.parked["mass"], np.float64))
        masses = (exact_sum(self.mass), parked_mass, self.deleted_mass)
        return MassLedger.balance(comm, counts, masses, self.initial_mass, migrated)


def take(arrays: Arrays, index: npt.NDArray[np.generic]) -> Arrays:
    """Rows of every array: by number, or by a mask."""
    return {name: values[index] for name, values in arrays.items()}


def join(parts: Iterable[Arrays]) -> Arrays:
    """Rows of several sets of arrays of the same names, one set after the other."""
    sets = list(parts)
    return {name: np.concatenate([part[name] for part in sets]) for name in sets[0]}


def agree(comm: MPI.Comm, kind: type[Exception], message: str) -> None:
    """Raise on every rank if one rank found a fault (collective).

    Args:
        comm: Communicator.
        kind: Type of the exception.
        message: What is wrong on this rank, empty if nothing is.
    """
    found = [text for text in comm.allgather(message) if text]
    if found:
        raise kind(found[0])


def quadrature_rule(cell_type: str, points_per_cell: int) -> tuple[RealArray, RealArray]:
    """The rule that a cell's points are seeded on: basix's default one of that size.

    Args:
        cell_type: Name of the cell.
        points_per_cell: How many points, see :func:`fenics_hytf.scene.rule_degrees`.

    Returns:
        Points on the reference cell, shape ``(q, tdim)``, and weights, shape ``(q,)``.

    Raises:
        ValueError: If there is no rule of that size.
    """
    degrees = rule_degrees(cell_type)
    if points_per_cell not in degrees:
        raise ValueError(
            f"points_per_cell: found {points_per_cell}; expected one of "
            f"{', '.join(map(str, degrees))} for a {cell_type}"
        )
    X, w = basix.make_quadrature(basix.CellType[cell_type], degrees[points_per_cell])
    return np.asarray(X), np.asarray(w)


def seed(
    mesh: Mesh,
    regions: IntArray,
    density: npt.ArrayLike,
    points_per_cell: int,
    fields: Iterable[str] = (),
) -> Points:
    """Fill the cells of a mesh with points at rest (collective).

    Args:
        mesh: Mesh whose dimension is that of its space.
        regions: Region of every local cell, ghosts may be left out, shape ``(num_cells,)``.
        density: Of each region [kg/m^3], shape ``(num_regions,)``; a region of density 0 stays
            empty.
        points_per_cell: How many, see ``quadrature_rule``.
        fields: Names of further arrays, see ``Points.add``.

    Returns:
        The points of this rank.

    Raises:
        ValueError: If a density is negative or not finite, a region has none, or there is no rule
            of that size; on every rank.
    """
    tdim, gdim = mesh.topology.dim, mesh.geometry.dim
    owned = mesh.topology.index_map(tdim).size_local
    rho = np.asarray(density, dtype=np.float64)
    agree(mesh.comm, ValueError, _fault(rho, regions, owned, tdim, gdim))
    X, w = quadrature_rule(mesh.basix_cell().name, points_per_cell)
    cells = np.flatnonzero(rho[regions[:owned]] > 0).astype(np.int32)
    index = mesh.topology.original_cell_index
    cells = cells[np.argsort(index[cells])]
    x, det = cell_grid(mesh, cells, X)
    volume = (w * det).reshape(-1)
    region = np.repeat(np.asarray(regions, dtype=np.int32)[cells], w.size)
    points = Points(
        id=(index[cells, None] * w.size + np.arange(w.size)).astype(np.int64).reshape(-1),
        cell=np.repeat(cells, w.size),
        X=np.tile(X, (cells.size, 1)),
        x=x.reshape(-1, gdim),
        mass=rho[region] * volume,
        volume=volume,
        region=region,
        displacement=np.zeros((volume.size, gdim)),
    )
    for name in fields:
        points.add(name)
    return points


def _fault(rho: RealArray, regions: IntArray, owned: int, tdim: int, gdim: int) -> str:
    """What is wrong with the arguments of ``seed``; empty if nothing is."""
    if tdim != gdim:
        return f"Found cells of dimension {tdim} in {gdim} dimensions; expected the same."
    if not np.all(np.isfinite(rho)) or np.any(rho < 0):
        return f"Found densities {rho.tolist()} kg/m3; expected finite numbers, none negative."
    if regions.shape[0] < owned:
        return f"Found regions of {regions.shape[0]} cells; expected all {owned} of this rank."
    used = np.unique(regions[:owned])
    if used.size and (used[0] < 0 or used[-1] >= rho.size):
        return f"Found regions {used.tolist()}; expected numbers from 0 to {rho.size - 1}."
    return ""
