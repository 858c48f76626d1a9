# SPDX-License-Identifier: MIT
"""Where the receivers are: at fixed places, or riding the material point nearest at the start."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.domain import Domain
from fenics_hytf.particles import Points, Sites, locate, resolve_owners
from fenics_hytf.scene import Fault, Receiver, SceneError

RealArray = npt.NDArray[np.float64]


class Receivers:
    """The receivers of a scene (collective).

    Args:
        domain: The domain.
        points: The material points at the start.
        receivers: Receivers by name.

    Raises:
        SceneError: On every rank: receivers outside the mesh, or of another dimension.
    """

    def __init__(self, domain: Domain, points: Points, receivers: dict[str, Receiver]) -> None:
        self._domain = domain
        self.names = tuple(receivers)
        self._require_dimension(receivers)
        self.places = np.array([r.place for r in receivers.values()]).reshape(-1, domain.gdim)
        rides = np.array([r.rides for r in receivers.values()], bool)
        self._riders = np.flatnonzero(rides)
        self._fixed = np.flatnonzero(~rides)
        self._cells, self._X = self._find()
        self._ids = np.array([self._nearest(points, self.places[r]) for r in self._riders], int)

    def _require_dimension(self, receivers: dict[str, Receiver]) -> None:
        faults = [
            Fault(f"output.receivers.{name}", f"{len(r.place)} coordinates", f"{self._domain.gdim}")
            for name, r in receivers.items()
            if len(r.place) != self._domain.gdim
        ]
        if faults:
            raise SceneError(faults)

    def _find(self) -> tuple[npt.NDArray[np.int32], RealArray]:
        """Cell of each fixed receiver where this rank owns it, else -1."""
        domain = self._domain
        cells, X = locate(domain.mesh, self.places[self._fixed])
        found = cells >= 0
        claims = np.full(len(cells), -1, np.int64)
        claims[found] = domain.input_cells[cells[found]]
        _, owner = resolve_owners(domain.comm, claims)
        faults = [
            Fault(
                f"output.receivers.{self.names[self._fixed[lost]]}",
                f"{self.places[self._fixed[lost]].tolist()} outside the mesh",
                "a place in the mesh [m]",
            )
            for lost in np.flatnonzero(owner < 0)
        ]
        if faults:
            raise SceneError(faults)
        return np.where(owner == domain.comm.rank, cells, -1).astype(np.int32), X

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

    def carried(self, points: Points) -> RealArray:
        """How far each receiver has been carried by its point.

        Args:
            points: The points.

        Returns:
            [m], zero for fixed places and for points that have left the mesh, shape
            ``(num_receivers, gdim)``, the same on every rank.
        """
        offset = np.zeros((len(self.names), self._domain.gdim))
        if len(self._ids):
            for rider, identity in zip(self._riders, self._ids, strict=True):
                offset[rider] = points.displacement[points.id == identity].sum(axis=0)
            offset = self._domain.comm.allreduce(offset)
        return offset
