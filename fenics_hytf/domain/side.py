# SPDX-License-Identifier: MIT
"""Vertical sides: the ground beyond one as a column of its soils, and distances from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx.mesh import entities_to_geometry, locate_entities_boundary
from mpi4py import MPI

from fenics_hytf.domain.constraints import boundary_nodes, normal_axis
from fenics_hytf.domain.domain import Domain, make_domain
from fenics_hytf.domain.grids import stack_mesh
from fenics_hytf.scene import Fault, SceneError

RealArray = npt.NDArray[np.float64]

_SAME = 1e-9  # of the height: levels closer than this are one


@dataclass(frozen=True)
class SideColumn:
    """A column of the soil at a side, whole on every rank.

    Attributes:
        domain: The column, its cells numbered from the bottom up.
        cell: For each local cell of the section, ghosts included, the column's cell that lies
            beyond it; -1 away from the side. Shape ``(num_local_cells,)``.
        nodes: Nodes of the section on the side that this rank owns, shape ``(n,)``.
        places: Where they are in the column [m], shape ``(n, gdim)``.
    """

    domain: Domain
    cell: npt.NDArray[np.int64]
    nodes: npt.NDArray[np.int32]
    places: RealArray


def side_column(domain: Domain, name: str) -> SideColumn:
    """Make the column beyond a side (collective).

    Args:
        domain: The domain.
        name: Name of the side.

    Returns:
        The column.

    Raises:
        SceneError: On every rank: the side is not vertical, only part of the mesh's side there, or
            its soils do not lie in level layers.
    """
    up = domain.gdim - 1
    if normal_axis(domain, name) == up:
        raise SceneError([Fault(f"boundary.{name}", "a level boundary", "a vertical side")])
    _require_whole_side(domain, name)
    cells, low, high = _facets(domain, name)
    levels, regions = _layers(domain, name, cells, low, high)
    width = float(np.diff(levels).max())
    names = tuple(domain.region_names[r] for r in regions)
    data = stack_mesh(levels, names, width, domain.gdim)
    degree = domain.V.ufl_element().degree
    column = make_domain(data, MPI.COMM_SELF, degree, domain.num_components)
    beyond = np.full(len(domain.regions), -1, np.int64)
    beyond[cells] = np.searchsorted(levels, (low + high) / 2) - 1
    nodes = boundary_nodes(domain, name)
    nodes = nodes[nodes < domain.V.dofmap.index_map.size_local]
    height = domain.V.tabulate_dof_coordinates()[nodes, up]
    slack = _SAME * (levels[-1] - levels[0])
    nodes = nodes[(height >= levels[0] - slack) & (height <= levels[-1] + slack)]
    places = np.full((len(nodes), domain.gdim), width / 2)
    places[:, up] = domain.V.tabulate_dof_coordinates()[nodes, up]
    return SideColumn(column, beyond, nodes, places)


def distance_to_sides(domain: Domain, names: Sequence[str], x: RealArray) -> RealArray:
    """How far places are from the nearest of some plane sides (collective).

    Args:
        domain: The domain.
        names: Names of the sides.
        x: Places, the same on every rank [m], shape ``(n, gdim)``.

    Returns:
        [m], shape ``(n,)``.

    Raises:
        SceneError: On every rank: a side is not parallel to an axis.
    """
    distance = np.full(len(x), np.inf)
    for name in names:
        axis = normal_axis(domain, name)
        places = domain.V.tabulate_dof_coordinates()[boundary_nodes(domain, name), axis]
        plane = domain.comm.allreduce(float(places.min(initial=np.inf)), MPI.MIN)
        distance = np.minimum(distance, np.abs(x[:, axis] - plane))
    return distance


def _require_whole_side(domain: Domain, name: str) -> None:
    """Nothing of the mesh's side in the plane of a boundary has another name, or none."""
    mesh, fdim = domain.mesh, domain.mesh.topology.dim - 1
    axis = normal_axis(domain, name)
    nodes = domain.V.tabulate_dof_coordinates()[boundary_nodes(domain, name), axis]
    plane = domain.comm.allreduce(float(nodes.min(initial=np.inf)), MPI.MIN)
    extent = domain.comm.allreduce(float(np.abs(mesh.geometry.x).max(initial=0.0)), MPI.MAX)
    everything = locate_entities_boundary(
        mesh, fdim, lambda x: np.abs(x[axis] - plane) <= 1e-9 * extent
    )
    others = np.setdiff1d(everything, domain.boundaries[name])
    up = domain.gdim - 1
    height = np.empty(0)
    if len(others):
        corners = entities_to_geometry(mesh, fdim, others)
        height = mesh.geometry.x[corners, up].mean(axis=1)
    heights = np.concatenate(domain.comm.allgather(height))
    if len(heights):
        reach = f"height {heights.min():g} to {heights.max():g} m"
        found = f"only a part of the mesh's side at {'xyz'[axis]} = {plane:g} m, not round {reach}"
        expected = "the whole side, from the base to the surface, under one name"
        raise SceneError([Fault(f"boundary.{name}", found, expected)])


def _facets(domain: Domain, name: str) -> tuple[npt.NDArray[np.int32], RealArray, RealArray]:
    """Local cells with soil at a side, and the lowest and highest point of their facet on it."""
    mesh, fdim = domain.mesh, domain.mesh.topology.dim - 1
    facets = domain.boundaries[name]
    mesh.topology.create_connectivity(fdim, fdim + 1)
    links = mesh.topology.connectivity(fdim, fdim + 1)
    cells = np.array([links.links(f)[0] for f in facets], np.int32)
    soil = domain.regions[cells] >= 0
    facets, cells = facets[soil], cells[soil]
    # dolfinx 0.9 divides by the number of facets
    nodes = entities_to_geometry(mesh, fdim, facets) if len(facets) else np.empty((0, 1), np.int32)
    height = mesh.geometry.x[nodes, domain.gdim - 1]
    return cells, height.min(axis=1, initial=np.inf), height.max(axis=1, initial=-np.inf)


def _layers(
    domain: Domain, name: str, cells: npt.NDArray[np.int32], low: RealArray, high: RealArray
) -> tuple[RealArray, npt.NDArray[np.int32]]:
    """Levels of the side from the bottom up, and the region between each two."""
    mine = (low, high, domain.regions[cells])
    bottom, top, region = (
        np.concatenate(part) for part in zip(*domain.comm.allgather(mine), strict=True)
    )
    every = np.unique(np.concatenate([bottom, top]))
    if not len(every):
        expected = "soil beside a side that is free_field"
        raise SceneError([Fault(f"boundary.{name}", "no soil", expected)])
    slack = _SAME * (every[-1] - every[0])
    levels = every[np.concatenate([[True], np.diff(every) > slack])]
    middle = (levels[1:] + levels[:-1]) / 2
    regions = np.empty(len(middle), np.int32)
    for layer, height in enumerate(middle):
        here = np.unique(region[(bottom < height) & (height < top)])
        if len(here) != 1:
            soils = " and ".join(domain.region_names[r] for r in here) or "no soil"
            found = f"{soils} at height {height:g} m"
            expected = "level layers along a side that is free_field"
            raise SceneError([Fault(f"boundary.{name}", found, expected)])
        regions[layer] = here[0]
    return levels, regions
