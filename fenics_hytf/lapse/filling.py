# SPDX-License-Identifier: MIT
"""Cells that points fill in part, or not at all: what counts of each, and what has come off.

A cell with points is *filled*; one that has an empty neighbour is at the *edge*. Inside, the points
of a cell come and go without the ground being any thinner, so a cell there counts whole; at the
edge it counts by the share that its points fill. Nodes of empty cells alone are no unknowns.

Filled cells that hang together over facets are a body; one that reaches no boundary which holds it
has come off, and what becomes of its points is the scene's policy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import sparse

from fenics_hytf.domain import Domain, bare_nodes, cells_at, facet_cells, neighbours
from fenics_hytf.lapse.errors import DetachedError, EmptyCellError
from fenics_hytf.operators import InternalForce
from fenics_hytf.particles import Points, take_out
from fenics_hytf.scene import Scene, default_kind

RealArray = npt.NDArray[np.float64]
Cells = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Filling:
    """What counts of each cell, in the order of the input.

    Attributes:
        weight: 0 in empty cells, 1 inside, the share that points fill at the edge [-], shape
            ``(num_cells,)``.
        edge: Cells at the edge, shape ``(num_cells,)``.
        share: Volume of the points over that of the cell [-], shape ``(num_cells,)``.
    """

    weight: RealArray
    edge: Cells
    share: RealArray

    @property
    def filled(self) -> Cells:
        """Cells with points, shape ``(num_cells,)``."""
        return self.weight > 0

    def same_cells(self, other: Filling) -> bool:
        """Whether the same cells are filled, and the same ones at the edge."""
        same = np.array_equal(self.filled, other.filled)
        return same and np.array_equal(self.edge, other.edge)

    def bare_nodes(self, domain: Domain) -> Cells:
        """Owned nodes that no filled cell has; see :func:`~fenics_hytf.domain.bare_nodes`."""
        return bare_nodes(domain, self.filled)

    def ghost_facets(self, domain: Domain) -> npt.NDArray[np.int32]:
        """Local facets between a cell at the edge and any filled one, shape ``(n,)``."""
        facets, cells = facet_cells(domain.mesh)
        both = domain.input_cells[cells]
        return facets[self.filled[both].all(axis=1) & self.edge[both].any(axis=1)]


class FillingSurvey:
    """Looks at how points fill the cells of a mesh that they may leave.

    Args:
        scene: The scene: what holds the boundaries, and the policy for what comes off.
        domain: The domain.
    """

    def __init__(self, scene: Scene, domain: Domain) -> None:
        self._domain, self._policy = domain, scene.points.detached
        self._pairs = neighbours(domain)
        kinds = {name: default_kind(name) for name in domain.boundaries} | scene.supports
        holding = [name for name in domain.boundaries if kinds[name] != "free"]
        self._held = cells_at(domain, holding)
        force = InternalForce(domain)
        volume = np.bincount(force.sites.cell, force.volume, domain.num_owned_cells)
        self._volume = domain.gather_cells(volume)

    def __call__(self, points: Points) -> Filling:
        """See how the points fill the cells; those of a body that came off are taken out.

        Args:
            points: The points, changed in place.

        Returns:
            The filling, the same on every rank.

        Raises:
            DetachedError: A body has come off and the policy is ``error``.
            EmptyCellError: No cell that is held has any points.
        """
        share = self._share(points)
        body = self._bodies(share > 0)
        attached = np.isin(body, np.unique(body[self._held])) & (body >= 0)
        off = (share > 0) & ~attached
        if off.any():
            gone = off[self._domain.input_cells[points.cell]]
            if self._policy == "error":
                raise DetachedError([int(cell) for cell in np.flatnonzero(off)])
            take_out(points, gone, self._policy)
            share = self._share(points)
        if not share.any():
            raise EmptyCellError([int(cell) for cell in self._held])
        return self._weigh(share)

    def _share(self, points: Points) -> RealArray:
        filled = np.bincount(points.cell, points.volume, self._domain.num_owned_cells)
        return self._domain.gather_cells(filled) / self._volume

    def _bodies(self, filled: Cells) -> npt.NDArray[np.int32]:
        """Number of the body that each cell belongs to, -1 for an empty one."""
        joined = self._pairs[filled[self._pairs].all(axis=1)]
        size = (len(filled), len(filled))
        links = sparse.coo_array((np.ones(len(joined), bool), joined.T), shape=size)
        _, number = sparse.csgraph.connected_components(links, directed=False)
        return np.where(filled, number, -1)

    def _weigh(self, share: RealArray) -> Filling:
        filled = share > 0
        edge = np.zeros(len(share), bool)
        mixed = self._pairs[filled[self._pairs].sum(axis=1) == 1]
        edge[mixed] = True
        edge &= filled
        weight = np.where(edge, np.minimum(share, 1.0), filled.astype(float))
        return Filling(weight, edge, share)
