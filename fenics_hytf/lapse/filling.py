# SPDX-License-Identifier: MIT
"""Cells that points fill in part, or not at all: what counts of each, and what has come off.

A cell with points is *filled*; one that has an empty neighbour is at the *edge*. Inside, the points
of a cell come and go without the ground being any thinner, so a cell there counts whole, even a
*gap*: a cell that holds no point, but what points round it stand for. (As a hole it would yield as
a mechanism of its own.) A cell at the edge counts as far as its points fill it, and is integrated
at the points, stiffness and stress alike. One that has lost a part of its points is *loose*: its
stiffness may be next to nothing, or leave it a mechanism, and a ghost term holds it by its
neighbours. Nodes of empty cells alone are no unknowns. Edge cells are weighed, and found loose, by
the volumes of the points in them, for over these M, K and forces are summed; gaps, and the fill
that results tell, are those of the pieces of soil that points stand for.

Filled cells that hang together over facets are a body. One that is not held in every direction in
which the boundaries hold anything has come off, and what becomes of its points is the scene's
policy. Cells that touch at a corner do not hang together: one would turn about it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import (
    Domain,
    bare_nodes,
    cells_at,
    facet_cells,
    neighbours,
    normal_axis,
)
from fenics_hytf.lapse.errors import DetachedError
from fenics_hytf.operators import ElasticForm, GhostForm, InternalForce, gauss_sites
from fenics_hytf.particles import Points, piece_integrals, take_out
from fenics_hytf.scene import Fault, Scene, SceneError, default_kind

RealArray = npt.NDArray[np.float64]
Cells = npt.NDArray[np.bool_]

_SOUND = 0.9
"""Share of a cell at the edge that makes it as good as full: ghost terms, which cost accuracy, are
left to those that have lost a point or more."""


@dataclass(frozen=True, eq=False)
class Filling:
    """What counts of each cell, in the order of the input.

    Attributes:
        weight: 0 in empty cells, 1 inside, the share that points fill at the edge [-], shape
            ``(num_cells,)``.
        edge: Cells at the edge, shape ``(num_cells,)``.
        share: Volume of the points over that of the cell [-], shape ``(num_cells,)``.
        fill: The same of their pieces, where they have any; nought in empty cells alone, elsewhere
            the machine epsilon or more.
        gap: Cells without a point that pieces fill, shape ``(num_cells,)``.
    """

    weight: RealArray
    edge: Cells
    share: RealArray
    fill: RealArray
    gap: Cells

    @property
    def filled(self) -> Cells:
        """Cells with points, and gaps, shape ``(num_cells,)``."""
        return self.weight > 0

    @property
    def whole(self) -> Cells:
        """Cells that count whole, shape ``(num_cells,)``."""
        return self.filled & ~self.edge

    @property
    def loose(self) -> Cells:
        """Cells at the edge that have lost a part of their points, shape ``(num_cells,)``."""
        return self.edge & (self.share < _SOUND)

    def same_cells(self, other: Filling) -> bool:
        """Whether the same cells are filled, and the same ones loose."""
        same = np.array_equal(self.filled, other.filled)
        return same and np.array_equal(self.loose, other.loose)

    def bare_nodes(self, domain: Domain) -> Cells:
        """Owned nodes that no filled cell has; see :func:`~fenics_hytf.domain.bare_nodes`."""
        return bare_nodes(domain, self.filled)

    def ghost_facets(self, domain: Domain) -> npt.NDArray[np.int32]:
        """Local facets between a loose cell and any filled one, shape ``(n,)``."""
        facets, cells = facet_cells(domain.mesh)
        both = domain.input_cells[cells]
        return facets[self.filled[both].all(axis=1) & self.loose[both].any(axis=1)]

    def ghost(self, domain: Domain, strength: float | None = None) -> GhostForm | None:
        """What holds loose cells; ``None`` where there are none."""
        if not self.loose.any():
            return None
        ghost = GhostForm(domain, self.ghost_facets(domain), strength)
        self.loosen(ghost, domain)
        return ghost

    def loosen(self, ghost: GhostForm, domain: Domain) -> None:
        """Let loose cells be held: in space by the square of what they have lost."""
        lost = 1.0 if domain.gdim == 2 else (1.0 - self.share) ** 2
        ghost.loosen(np.where(self.loose, lost, 0.0)[domain.input_cells])

    def integrate(self, force: InternalForce, domain: Domain, points: Points) -> None:
        """Let forces be integrated over what is filled."""
        local = domain.input_cells
        force.occupy(points, self.whole[local], self.edge[local])


def assemble_stiffness(
    domain: Domain,
    matrix: PETSc.Mat,
    elastic: ElasticForm,
    force: InternalForce | None,
    filling: Filling | None,
    lame_lambda: RealArray,
    shear_modulus: RealArray,
) -> None:
    """Assemble the elastic stiffness of what is filled (collective).

    Args:
        domain: The domain.
        matrix: On the nodes, with the pattern of the cells; overwritten.
        elastic: The form of whole cells.
        force: Integrates over cells that are filled in part, as it was last told which.
        filling: How far points fill the cells; ``None`` where all are full.
        lame_lambda: λ of each local cell [Pa], shape ``(num_local_cells,)``.
        shear_modulus: G likewise.
    """
    if filling is None or force is None:
        elastic.assemble(matrix, lame_lambda, shear_modulus)
        return
    whole = filling.whole[domain.input_cells]
    elastic.assemble(matrix, whole * lame_lambda, whole * shear_modulus)
    force.add_stiffness(matrix, lame_lambda, shear_modulus)


def cell_integrals(
    domain: Domain, points: Points, values: RealArray, filling: Filling | None
) -> RealArray:
    """Values of points times their volumes, summed in each cell; in gaps of pieces (collective).

    Args:
        domain: The domain.
        points: The points.
        values: Shape ``(len(points), k)``.
        filling: How far the points fill the cells; ``None`` where no cell may be empty.

    Returns:
        Of all cells in the order of the input, shape ``(num_cells, k)``.
    """
    sums = np.zeros((domain.num_owned_cells, values.shape[1]))
    np.add.at(sums, points.cell, points.volume[:, None] * values)
    if filling is not None and filling.gap.any():
        gap = filling.gap[domain.input_cells[: len(sums)]]
        sums[gap] = piece_integrals(domain.mesh, points, values)[gap]
    return domain.gather_cells(sums)


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
        holding: dict[int, list[str]] = {}
        for name in domain.boundaries:
            for axis in _held_axes(domain, name, kinds[name]):
                holding.setdefault(axis, []).append(name)
        # Of each direction that anything is held in, the cells at the boundaries that do.
        self._held = [cells_at(domain, names) for names in holding.values()]
        self._volume = domain.gather_cells(gauss_sites(domain)[1].sum(axis=1))

    def __call__(self, points: Points) -> Filling:
        """See how the points fill the cells; those of a body that came off are taken out.

        Args:
            points: The points, changed in place.

        Returns:
            The filling, the same on every rank.

        Raises:
            DetachedError: A body has come off and the policy is ``error``, or nothing else is left.
        """
        share = self._share(points)
        body = self._bodies(share > 0)
        attached = share > 0
        for held in self._held:
            attached &= np.isin(body, body[held])
        off = (share > 0) & ~attached
        if (self._policy == "error" and off.any()) or not attached.any():
            raise DetachedError([int(cell) for cell in np.flatnonzero(off)])
        if self._policy != "error" and off.any():
            take_out(points, off[self._domain.input_cells[points.cell]], self._policy)
            share = np.where(off, 0.0, share)
        return self._weigh(share, self._fill(points, share))

    def at_first(self, points: Points) -> Filling:
        """Likewise before anything has happened: what comes off is a fault of the scene.

        Args:
            points: The points, changed in place.

        Returns:
            The filling.

        Raises:
            SceneError: Soil does not hang together with held ground and the policy is ``error``, or
                none does.
        """
        try:
            return self(points)
        except DetachedError as error:
            found = (
                f"soil in {len(error.cells)} cells that hangs together with nothing held, "
                f"the first: {', '.join(map(str, error.cells[:5]))}"
            )
            expected = 'soil on held ground, or points.detached = "park" or "delete"'
            raise SceneError([Fault("mesh", found, expected)]) from error

    def _share(self, points: Points) -> RealArray:
        filled = np.bincount(points.cell, points.volume, self._domain.num_owned_cells)
        return self._domain.gather_cells(filled) / self._volume

    def _fill(self, points: Points, share: RealArray) -> RealArray:
        if "piece" not in points.history:
            return share
        if not self._domain.comm.allreduce(bool(np.any(points.displacement)), MPI.LOR):
            return share  # pieces lie in the cells that they were made for
        pieces = piece_integrals(self._domain.mesh, points, np.ones((len(points), 1)))[:, 0]
        return self._domain.gather_cells(pieces) / self._volume

    def _gaps(self, counted: Cells, fill: RealArray) -> Cells:
        """Cells without a point that pieces fill by more than half, away from empty cells."""
        gap = ~counted & (fill > 0.5)
        while gap.any():
            exposed = gap & self._beside_empty(counted | gap)
            if not exposed.any():
                break
            gap &= ~exposed
        return gap

    def _beside_empty(self, filled: Cells) -> Cells:
        """Filled cells with an empty neighbour."""
        beside = np.zeros(len(filled), bool)
        beside[self._pairs[filled[self._pairs].sum(axis=1) == 1]] = True
        return beside & filled

    def _bodies(self, filled: Cells) -> npt.NDArray[np.int32]:
        """Number of the body that each cell belongs to, -1 for an empty one."""
        joined = self._pairs[filled[self._pairs].all(axis=1)]
        size = (len(filled), len(filled))
        links = sparse.coo_array((np.ones(len(joined), bool), joined.T), shape=size)
        _, number = sparse.csgraph.connected_components(links, directed=False)
        return np.where(filled, number, -1)

    def _weigh(self, share: RealArray, fill: RealArray) -> Filling:
        gap = self._gaps(share > 0, fill)
        filled = gap | (share > 0)
        edge = self._beside_empty(filled)
        weight = np.where(edge, np.minimum(share, 1.0), filled.astype(float))
        # A long piece may leave next to nothing in the very cell of its point.
        fill = np.where(filled, np.maximum(fill, np.finfo(float).eps), 0.0)
        return Filling(weight, edge, share, fill, gap)


def _held_axes(domain: Domain, name: str, kind: str) -> tuple[int, ...]:
    """Components in which a boundary holds the ground in the long run (collective)."""
    every = tuple(range(domain.num_components))
    if kind in ("free", "tied"):
        return ()
    if kind in ("rigid", "fixed", "compliant"):
        return every
    if domain.num_components == 1:  # across the plane a roller is free
        return () if kind == "roller" else every
    try:
        return (normal_axis(domain, name),)
    except SceneError:  # dashpots on what is no plane
        return every
