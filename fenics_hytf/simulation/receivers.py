# SPDX-License-Identifier: MIT
"""Where the receivers are: at fixed places, or riding the material point nearest at the start."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf._compat import geometry_dofmap
from fenics_hytf.domain import Domain
from fenics_hytf.particles import (
    Points,
    Sites,
    inverse_map,
    locate,
    resolve_owners,
    transfer_matrix,
)
from fenics_hytf.scene import Fault, Receiver

RealArray = npt.NDArray[np.float64]

# Of a cell, by which a place on the surface may miss it: coordinates are written rounded.
_BESIDE = 1e-3


def find_places(
    domain: Domain, places: RealArray
) -> tuple[npt.NDArray[np.int32], RealArray, npt.NDArray[np.bool_]]:
    """Find the cell of each place; the rank that owns it has it (collective).

    Args:
        domain: The domain.
        places: The same on every rank [m], shape ``(n, gdim)``.

    Returns:
        Local cell where this rank owns it, else -1, shape ``(n,)``; reference coordinates, shape
        ``(n, tdim)``; and whether the place is in the mesh, shape ``(n,)``.
    """
    cells, X = locate(domain.mesh, places)
    found = cells >= 0
    claims = np.full(len(cells), -1, np.int64)
    claims[found] = domain.input_cells[cells[found]]
    _, owner = resolve_owners(domain.comm, claims)
    return np.where(owner == domain.comm.rank, cells, -1).astype(np.int32), X, owner >= 0


def receiver_faults(domain: Domain, receivers: dict[str, Receiver]) -> list[Fault]:
    """Receivers of another dimension, or outside the mesh (collective).

    Args:
        domain: The domain.
        receivers: Receivers by name.

    Returns:
        The faults, the same on every rank.
    """
    gdim = domain.gdim
    faults = [
        Fault(f"output.receivers.{name}", f"{len(r.place)} coordinates", f"{gdim} of them")
        for name, r in receivers.items()
        if len(r.place) != gdim
    ]
    placed = {name: r.place for name, r in receivers.items() if len(r.place) == gdim}
    *_, inside = find_places(domain, np.array(list(placed.values())).reshape(-1, gdim))
    faults += [
        Fault(
            f"output.receivers.{name}", f"{list(place)} outside the mesh", "a place in the mesh [m]"
        )
        for (name, place), is_inside in zip(placed.items(), inside, strict=True)
        if not is_inside
    ]
    return faults


def without_soil(domain: Domain, receivers: dict[str, Receiver]) -> list[str]:
    """Fixed receivers that stand where no soil is at the start (collective).

    Args:
        domain: The domain.
        receivers: Receivers by name, inside the mesh.

    Returns:
        Their names, the same on every rank; none of those on the surface of the ground, which
        stands in cells of either kind.
    """
    fixed = {name: r.place for name, r in receivers.items() if not r.rides}
    ground = np.flatnonzero(domain.regions[: domain.num_owned_cells] >= 0)
    nodes = domain.mesh.geometry.x[geometry_dofmap(domain.mesh)[ground], : domain.gdim]
    lowest, highest = nodes.min(axis=1), nodes.max(axis=1)
    slack = _BESIDE * (highest - lowest).max(axis=1, keepdims=True)
    stand = np.zeros(len(fixed), bool)
    for number, place in enumerate(fixed.values()):
        near = ((lowest - slack <= place) & (place <= highest + slack)).all(axis=1)
        cells = ground[near]
        X, _ = inverse_map(domain.mesh, np.tile(place, (len(cells), 1)), cells)
        stand[number] = bool((_outside(domain, X) <= _BESIDE).any())
    on_ground = domain.comm.allreduce(stand.astype(int)) > 0
    return [name for name, stands in zip(fixed, on_ground, strict=True) if not stands]


def _outside(domain: Domain, X: RealArray) -> RealArray:
    """How far reference coordinates are outside their cell, of its size, shape ``(n,)``."""
    simplex = domain.mesh.topology.cell_name() in ("triangle", "tetrahedron")
    beyond = X.sum(axis=1) if simplex else X.max(axis=1)
    return np.asarray(np.maximum((-X).max(axis=1), beyond - 1.0))


class Receivers:
    """The receivers of a scene (collective).

    Args:
        domain: The domain.
        points: The material points at the start.
        receivers: Receivers by name.

    All places are in the mesh: :func:`receiver_faults` has been asked.
    """

    def __init__(self, domain: Domain, points: Points, receivers: dict[str, Receiver]) -> None:
        self._domain = domain
        self.names = tuple(receivers)
        self.places = np.array([r.place for r in receivers.values()]).reshape(-1, domain.gdim)
        rides = np.array([r.rides for r in receivers.values()], bool)
        self._riders = np.flatnonzero(rides)
        self._fixed = np.flatnonzero(~rides)
        cells, X, _ = find_places(domain, self.places)
        self._cells, self._X = cells[self._fixed], X[self._fixed]
        self._ids = np.array([self._nearest(points, self.places[r]) for r in self._riders], int)

    def _nearest(self, points: Points, place: RealArray) -> int:
        """Identity of the point nearest to a place; of equally near ones the lowest."""
        best = (np.inf, -1)
        if len(points):
            distance = np.linalg.norm(points.x - place, axis=1)
            # Equal but for round-off is equal: the choice must not depend on the ranks.
            near = distance <= distance.min() * (1 + 1e-9)
            best = (float(distance.min()), int(points.id[near].min()))
        everyone = self._domain.comm.allgather(best)
        closest = min(distance for distance, _ in everyone)
        return min(i for distance, i in everyone if distance <= closest * (1 + 1e-9))

    def sites(self, points: Points) -> tuple[Sites, npt.NDArray[np.intp]]:
        """Receivers in this rank's cells as they are now.

        Args:
            points: The points, for those that ride them.

        Returns:
            Their sites, and their numbers among all receivers.
        """
        here = self._cells >= 0
        cells, X, numbers = self._cells[here], self._X[here], self._fixed[here]
        rows = {int(i): row for row, i in enumerate(points.id)} if len(self._ids) else {}
        mine = [(rows[i], r) for i, r in zip(self._ids, self._riders, strict=True) if i in rows]
        carried = np.array([row for row, _ in mine], int)
        riders = np.array([r for _, r in mine], int)
        sites = Sites(
            np.concatenate([cells, points.cell[carried]]), np.concatenate([X, points.X[carried]])
        )
        return sites, np.concatenate([numbers, riders])

    def at(self, points: Points, nodal: RealArray) -> RealArray:
        """A nodal field at the receivers as they are now (collective).

        Args:
            points: The points, for those that ride them.
            nodal: At this rank's nodes, ghosts included, shape
                ``(num_local_nodes, num_components)``.

        Returns:
            Shape ``(num_receivers, num_components)``; nought where a point has left the mesh.
        """
        sites, numbers = self.sites(points)
        mine = np.zeros((len(self.names), nodal.shape[1]))
        mine[numbers] = transfer_matrix(sites, self._domain.V) @ nodal
        return np.asarray(self._domain.comm.allreduce(mine))
