# SPDX-License-Identifier: MIT
"""All constraints in one sparse matrix: u = T q, and A_q = Tᵀ A T.

Every displacement is free (an unknown of q), held at zero (an empty row of T), or tied: equal to
that of a partner across the mesh.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from dolfinx.fem import FunctionSpace, locate_dofs_topological
from petsc4py import PETSc
from scipy.spatial import KDTree

from fenics_hytf.domain.domain import Domain
from fenics_hytf.scene import Fault, SceneError, default_kind

# Sides that tie to each other, and the axis across which they do.
_TIED = (("left", "right", 0), ("front", "back", 1))
_ALIKE = 1e-8  # of the length of a side: nodes that are not farther apart face each other


def constraint_matrix(
    domain: Domain,
    boundary: Mapping[str, str],
    shaken: Sequence[int] = (),
    bare: npt.NDArray[np.bool_] | None = None,
) -> PETSc.Mat:
    """Build T.

    Args:
        domain: The domain.
        boundary: Kind of each boundary: ``rigid`` and ``fixed`` hold every component, ``roller``
            the normal one, ``tied`` sides move alike; others and unnamed ones are free, except
            that ``base`` is rigid unless it is named.
        shaken: Components in which the base moves; something must be held in each, or stand on a
            compliant base.
        bare: Owned nodes that no soil moves, shape ``(num_owned_nodes,)``; ``None`` for none.

    Returns:
        Matrix of zeros and ones, rows distributed as the displacement space, columns the unknowns
        (the caller destroys it).

    Raises:
        SceneError: On every rank: tied sides whose nodes do not match, a roller that is not
            parallel to an axis, nothing that moves with the base, or nothing left to solve for.
    """
    kinds = {name: default_kind(name) for name in domain.boundaries} | dict(boundary)
    V = domain.V
    size = V.dofmap.index_map.size_local
    held = np.zeros((size + V.dofmap.index_map.num_ghosts, domain.num_components), bool)
    for name, kind in kinds.items():
        if kind in ("rigid", "fixed"):
            held[boundary_nodes(domain, name)] = True
        elif kind == "roller" and domain.num_components > 1:  # across the plane a roller is free
            held[boundary_nodes(domain, name), normal_axis(domain, name)] = True
    held = held[:size]
    if "compliant" not in kinds.values():
        _require_base(domain, held, shaken)
    image = _tied_nodes(domain, kinds)
    _share_holds(domain, held, image)
    if bare is not None:
        held |= _bare_families(domain, bare, image)[:, None]
    return _assemble(V, held, image)


def _require_base(domain: Domain, held: npt.NDArray[np.bool_], shaken: Sequence[int]) -> None:
    """Something moves with the base in every direction of the motion."""
    found = domain.comm.allreduce(held.any(axis=0).astype(int))
    loose = [domain.components[axis] for axis in shaken if not found[axis]]
    if loose:
        expected = "a boundary that is rigid, fixed, or on rollers across that direction"
        what = f"nothing that moves with the base in {', '.join(loose)}"
        raise SceneError([Fault("boundary", what, expected)])


def boundary_nodes(domain: Domain, name: str) -> npt.NDArray[np.int32]:
    """Local nodes of a boundary, owned ones and ghosts, shape ``(n,)``."""
    facets = domain.boundaries.get(name, np.empty(0, np.int32))
    return locate_dofs_topological(domain.V, domain.mesh.topology.dim - 1, facets)


def normal_axis(domain: Domain, name: str) -> int:
    """Axis normal to a plane boundary (collective).

    Args:
        domain: The domain.
        name: Name of the boundary.

    Returns:
        Number of the axis.

    Raises:
        SceneError: On every rank: there is no such boundary, or it is not parallel to an axis.
    """
    places = domain.V.tabulate_dof_coordinates()[boundary_nodes(domain, name), : domain.gdim]
    everyone = np.concatenate(domain.comm.allgather(places))
    if not len(everyone):
        known = ", ".join(domain.boundaries)
        raise SceneError([Fault(f"boundary.{name}", "no such boundary in the mesh", known)])
    extent = np.ptp(everyone, axis=0)
    axis = int(np.argmin(extent))
    if extent[axis] > 1e-9 * extent.max():
        expected = "a plane side, vertical or level, for this kind of boundary"
        raise SceneError(
            [Fault(f"boundary.{name}", "a side that is not parallel to an axis", expected)]
        )
    return axis


def _tied_nodes(domain: Domain, kinds: Mapping[str, str]) -> dict[int, int]:
    """Global node of each tied node's last partner, the same on every rank."""
    V, gdim = domain.V, domain.gdim
    size = V.dofmap.index_map.size_local
    image: dict[int, int] = {}
    for low, high, axis in _TIED:
        if not kinds.get(low) == kinds.get(high) == "tied":
            continue
        sides = []
        for name in (low, high):
            nodes = boundary_nodes(domain, name)
            nodes = nodes[nodes < size]
            numbers = V.dofmap.index_map.local_to_global(nodes)
            places = V.tabulate_dof_coordinates()[nodes, :gdim]
            sides.append(
                [
                    np.concatenate(part)
                    for part in zip(*domain.comm.allgather((numbers, places)), strict=True)
                ]
            )
        (low_number, low_place), (high_number, high_place) = sides
        across = [a for a in range(gdim) if a != axis]
        partner, lone_high = _match(low_place[:, across], high_place[:, across])
        _, lone_low = _match(high_place[:, across], low_place[:, across])
        lone = np.concatenate([high_place[lone_high], low_place[lone_low]])
        if len(lone):
            found = (
                f"{len(high_number)} nodes against {len(low_number)} on '{low}', {len(lone)} of "
                f"them without a partner (the first at {(lone[0].round(6) + 0.0).tolist()} m)"
            )
            expected = "the same nodes on both tied sides: mesh them alike"
            raise SceneError([Fault(f"boundary.{high}", found, expected)])
        image.update(zip(high_number.tolist(), low_number[partner].tolist(), strict=True))
    for node, target in image.items():
        for _ in _TIED:
            target = image.get(target, target)  # an edge between two tied pairs
        if target in image:
            found = "nodes that are tied to themselves in the end"
            expected = f"sides farther apart than {_ALIKE:g} of their length"
            raise SceneError([Fault("boundary", f"{found} (first: node {node})", expected)])
        image[node] = target
    return image


def _match(
    low: npt.NDArray[np.float64], high: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Nearest node of the low side for each of the high side, and those that have none."""
    if not len(low) or not len(high):
        return np.empty(0, np.int64), np.arange(len(high))
    distance, partner = KDTree(low).query(high)
    tolerance = _ALIKE * max(float(np.ptp(low, axis=0).max()), np.finfo(float).tiny)
    return partner, np.flatnonzero(distance > tolerance)


def _share_holds(domain: Domain, held: npt.NDArray[np.bool_], image: dict[int, int]) -> None:
    """Where one node of a tied family is held, hold them all."""
    if not image:
        return
    first = domain.V.dofmap.index_map.local_range[0]
    family = np.array(sorted(set(image) | set(image.values())), np.int64)
    mine = family[(family >= first) & (family < first + len(held))]
    flags: dict[int, npt.NDArray[np.bool_]] = {}
    for numbers, part in domain.comm.allgather((mine, held[mine - first])):
        for number, flag in zip(numbers.tolist(), part, strict=True):
            root = image.get(number, number)
            flags[root] = flags[root] | flag if root in flags else flag
    for number in mine.tolist():
        held[number - first] |= flags[image.get(number, number)]


def _bare_families(
    domain: Domain, bare: npt.NDArray[np.bool_], image: dict[int, int]
) -> npt.NDArray[np.bool_]:
    """Bare nodes; of those that are tied the ones whose whole family is bare."""
    bare = bare.copy()
    first = domain.V.dofmap.index_map.local_range[0]
    family = np.array(sorted(set(image) | set(image.values())), np.int64)
    mine = family[(family >= first) & (family < first + len(bare))]
    moved = [image.get(int(n), int(n)) for n in mine[~bare[mine - first]]]
    moving = {root for part in domain.comm.allgather(moved) for root in part}
    for number in mine.tolist():
        bare[number - first] = image.get(number, number) not in moving
    return bare


def _assemble(V: FunctionSpace, held: npt.NDArray[np.bool_], image: dict[int, int]) -> PETSc.Mat:
    comm = V.mesh.comm
    num_nodes = len(held)
    first = V.dofmap.index_map.local_range[0]
    node = np.arange(first, first + num_nodes)
    slave = np.isin(node, np.fromiter(image, np.int64, len(image)))
    free = ~held & ~slave[:, None]
    offset = comm.exscan(int(free.sum())) or 0
    if comm.allreduce(int(free.sum())) == 0:
        raise SceneError([Fault("boundary", "every displacement held", "some that are free")])
    unknown = np.full(held.shape, -1, np.int64)
    unknown[free] = offset + np.arange(free.sum())
    roots = np.array(sorted(set(image.values())), np.int64)
    mine = roots[(roots >= first) & (roots < first + num_nodes)]
    numbers: dict[int, npt.NDArray[np.int64]] = {}
    for part in comm.allgather(dict(zip(mine.tolist(), unknown[mine - first], strict=True))):
        numbers.update(part)
    for number in map(int, node[slave]):
        unknown[number - first] = numbers[image[number]]
    column = unknown.ravel()
    filled = column >= 0
    indptr = np.concatenate([[0], np.cumsum(filled)]).astype(PETSc.IntType)
    T = PETSc.Mat().createAIJ(
        ((held.size, None), (int(free.sum()), None)),
        csr=(indptr, column[filled].astype(PETSc.IntType), np.ones(filled.sum(), PETSc.ScalarType)),
        comm=comm,
    )
    T.assemble()
    return T
