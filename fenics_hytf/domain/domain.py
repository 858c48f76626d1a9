# SPDX-License-Identifier: MIT
"""The domain: a distributed mesh with named regions and boundaries, and its displacement space."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import basix
import basix.ufl
import numpy as np
import numpy.typing as npt
from dolfinx.fem import FunctionSpace, functionspace
from dolfinx.mesh import Mesh, create_mesh, entities_to_geometry, locate_entities_boundary
from mpi4py import MPI

from fenics_hytf import _compat
from fenics_hytf.domain.checks import (
    jacobian_determinants,
    loose_cells,
    refuse_inverted_cells,
)
from fenics_hytf.domain.files import read_mesh
from fenics_hytf.domain.grids import MeshData, box_mesh, column_mesh, emptied
from fenics_hytf.domain.refine import refined
from fenics_hytf.scene import (
    MOST_CELLS,
    Fault,
    Scene,
    SceneError,
    Sections,
    components_of,
    default_kind,
    direction_fault,
)

Scalar = TypeVar("Scalar", np.float64, np.int64)


@dataclass(frozen=True)
class Domain:
    """A mesh and what is named on it.

    Attributes:
        mesh: Distributed mesh; ranks see the cells across their facets as ghosts.
        V: Continuous vector-valued Lagrange space of the displacement.
        region_names: Names of the regions, which are names of soils.
        regions: Region of each local cell, ghosts included, -1 where there is no soil at the start,
            shape ``(num_local_cells,)``.
        boundaries: Local exterior facets by the name of the boundary.
        across: Communicator of the ranks that hold the same part of the mesh, one of each group of
            ranks that shares one.
    """

    mesh: Mesh
    V: FunctionSpace
    region_names: tuple[str, ...]
    regions: npt.NDArray[np.int32]
    boundaries: dict[str, npt.NDArray[np.int32]]
    across: MPI.Comm = field(default_factory=lambda: MPI.COMM_SELF)

    @property
    def comm(self) -> MPI.Comm:
        """Communicator of the mesh."""
        return self.mesh.comm

    @property
    def gdim(self) -> int:
        """Space dimension."""
        return self.mesh.geometry.dim

    @property
    def num_components(self) -> int:
        """Displacement components of a node: one where the section moves across its plane."""
        return int(self.V.dofmap.index_map_bs)

    @property
    def components(self) -> tuple[str, ...]:
        """Names of the displacement components."""
        return components_of(self.gdim, "antiplane" if self.num_components == 1 else None)

    @property
    def num_owned_cells(self) -> int:
        """Cells this rank owns; they come first among the local ones."""
        return self.mesh.topology.index_map(self.mesh.topology.dim).size_local

    @property
    def num_cells(self) -> int:
        """Cells of the whole mesh."""
        return self.mesh.topology.index_map(self.mesh.topology.dim).size_global

    @property
    def input_cells(self) -> npt.NDArray[np.int64]:
        """Input number of each local cell, ghosts included, shape ``(num_local_cells,)``."""
        return np.asarray(self.mesh.topology.original_cell_index, np.int64)

    def gather_cells(self, values: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
        """Bring values of owned cells into the order of the input, on every rank.

        Args:
            values: Shape ``(num_owned_cells, ...)``; more rows (ghosts) are ignored.

        Returns:
            Shape ``(num_cells, ...)``.
        """
        owned = self.num_owned_cells
        parts = self.comm.allgather((self.input_cells[:owned], values[:owned]))
        everything = np.empty((self.num_cells, *values.shape[1:]), values.dtype)
        for cells, part in parts:
            everything[cells] = part
        return everything

    def cell_sizes(self) -> npt.NDArray[np.float64]:
        """Side of a square or cube of each local cell's volume [m], ghosts included."""
        reference = self.mesh.basix_cell()
        middle = basix.geometry(reference).mean(axis=0, keepdims=True)
        volume = basix.cell.volume(reference) * jacobian_determinants(self.mesh, middle)[:, 0]
        return np.asarray(np.abs(volume) ** (1 / self.gdim))

    def shortest_edge(self) -> float:
        """Length of the shortest edge of all cells [m] (collective)."""
        mesh = self.mesh
        mesh.topology.create_entities(1)
        mesh.topology.create_connectivity(1, mesh.topology.dim)
        edges = np.arange(mesh.topology.index_map(1).size_local, dtype=np.int32)
        ends = mesh.geometry.x[entities_to_geometry(mesh, 1, edges)]
        mine = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).min(initial=np.inf)
        return float(self.comm.allreduce(float(mine), MPI.MIN))

    def centroids(self) -> npt.NDArray[np.float64]:
        """Mean of the geometry nodes of every cell, in the order of the input (collective).

        Returns:
            [m], shape ``(num_cells, gdim)``.
        """
        nodes = _compat.geometry_dofmap(self.mesh)[: self.num_owned_cells]
        return self.gather_cells(self.mesh.geometry.x[nodes].mean(axis=1)[:, : self.gdim])


def build(scene: Scene, comm: MPI.Comm) -> Domain:
    """Make the scene's mesh and space.

    Args:
        scene: The scene.
        comm: Communicator; the mesh is read or made on rank 0 and distributed.

    Returns:
        The domain.

    Raises:
        SceneError: On every rank: an unreadable file, a region without a soil of its name, a
            boundary that the scene names and the mesh lacks, a motion along an axis that it lacks,
            a part that hangs on nothing, or a cell with a non-positive Jacobian.
    """
    domain, faults = examine(scene, comm)
    if domain is None or faults:
        raise SceneError(faults)
    return domain


def examine(scene: Scene | Sections, comm: MPI.Comm) -> tuple[Domain | None, list[Fault]]:
    """Make the mesh and space, and collect what is wrong with them instead of raising.

    Args:
        scene: The scene, or its valid sections; one with ``mesh`` at least.
        comm: Communicator.

    Returns:
        The domain, or ``None`` where there is no mesh to compute on; and the faults, the same on
        every rank.
    """
    try:
        data, faults = _on_rank_zero(comm, lambda: _mesh_data(scene))
        degree, kinematics = (scene.mesh.degree, scene.mesh.kinematics) if scene.mesh else (1, None)
        gdim = comm.bcast(data.points.shape[1] if data else None)
        domain = make_domain(data, comm, degree, len(components_of(gdim, kinematics)))
    except SceneError as error:
        return None, error.faults
    kinds = scene.boundary.kinds if scene.boundary else {}
    faults += _bare_boundaries(domain.boundaries, ("base", *kinds), comm)
    return domain, faults


def make_domain(data: MeshData | None, comm: MPI.Comm, degree: int, num_components: int) -> Domain:
    """Distribute a mesh and make its displacement space (collective).

    Args:
        data: The mesh on rank 0, ``None`` elsewhere.
        comm: Communicator.
        degree: Degree of the displacement.
        num_components: Displacement components of a node.

    Returns:
        The domain.

    Raises:
        SceneError: A cell with a non-positive Jacobian; on every rank.
    """
    mesh = _distribute(data, comm)
    refuse_inverted_cells(mesh)
    mesh.topology.create_connectivity(mesh.topology.dim - 1, mesh.topology.dim)
    names, region = comm.bcast((data.region_names, data.region) if data else None)
    local = region[np.asarray(mesh.topology.original_cell_index, np.int64)]
    shape = (num_components,) if num_components > 1 else None
    element = basix.ufl.element("Lagrange", mesh.basix_cell(), degree, shape=shape)
    return Domain(mesh, functionspace(mesh, element), names, local, _boundaries(mesh, data, comm))


def _on_rank_zero(
    comm: MPI.Comm, make: Callable[[], tuple[MeshData, list[Fault]]]
) -> tuple[MeshData | None, list[Fault]]:
    """Run on rank 0 only; its error is raised, and its faults are known, on every rank."""
    made, error = None, None
    if comm.rank == 0:
        try:
            made = make()
        except Exception as caught:  # whatever it is, the other ranks are waiting
            error = caught
    if isinstance(error, SceneError):
        comm.bcast(("faults", error.faults))
        raise error
    if error is not None:
        comm.bcast(("error", f"{type(error).__name__}: {error}"))
        raise error
    kind, content = comm.bcast(("made", made[1]) if made else None)
    if kind == "faults":
        raise SceneError(content)
    if kind == "error":
        raise RuntimeError(f"the mesh could not be made on rank 0: {content}")
    return (made[0] if made else None), list(content)


def _mesh_data(scene: Scene | Sections) -> tuple[MeshData, list[Fault]]:
    mesh, soils = scene.mesh, tuple(scene.soil)
    if mesh is None:
        raise SceneError([])
    if mesh.column is not None:
        data = column_mesh(mesh.column)
    elif mesh.box is not None:
        data = box_mesh(mesh.box, mesh, soils)
    else:
        data = read_mesh(Path(mesh.file or ""), (*soils, *mesh.empty))
        _require_few(len(data.cells) * 2 ** (data.points.shape[1] * mesh.refine), mesh.refine)
        for _ in range(mesh.refine):
            data = refined(data)
    faults = _unknown_regions(mesh.empty, data)
    misnamed = len(faults)
    data = emptied(data, mesh.empty)
    if not data.region_names:
        faults.append(Fault("mesh.empty", "every region of the mesh", "one with soil"))
    return data, faults if mesh.file is None else [*faults, *_file_faults(scene, data, misnamed)]


def _require_few(num_cells: int, refine: int) -> None:
    """Raise where a refined mesh would have more cells than can be made."""
    if num_cells > MOST_CELLS:
        found = f"{refine}, which makes {num_cells} cells"
        raise SceneError([Fault("mesh.refine", found, f"at most {MOST_CELLS} in all")])


def _unknown_regions(empty: tuple[str, ...], data: MeshData) -> list[Fault]:
    known = ", ".join(data.region_names)
    return [
        Fault(f"mesh.empty[{i}]", f"'{name}', no region of the mesh", f"one of {known}")
        for i, name in enumerate(empty)
        if name not in data.region_names
    ]


def _file_faults(scene: Scene | Sections, data: MeshData, misnamed: int) -> Iterator[Fault]:
    """What the scene says of a mesh file that the file does not hold.

    Regions without soil are no fault of their own where as many names in ``mesh.empty`` are
    wrong: they are the ones that were meant.
    """
    soils = tuple(scene.soil)
    missing = [name for name in data.region_names if name not in soils]
    if len(missing) > misnamed:
        yield Fault("mesh.file", f"regions {', '.join(missing)}", "a soil for each")
    names = (*data.planes, *data.facets)
    known = ", ".join(names)
    kinds = scene.boundary.kinds if scene.boundary else {}
    for name in kinds:
        if name not in names:
            yield Fault(f"boundary.{name}", "no such boundary in the mesh", known)
    held = [name for name in names if kinds.get(name, default_kind(name)) != "free"]
    loose = loose_cells(data, held)
    if held and len(loose):
        found = f"{len(loose)} cells, the first {loose[0]}, that hang together with nothing held"
        expected = "parts that share nodes: join them in the mesh generator (gmsh: fragment)"
        yield Fault("mesh.file", found, expected)
    gdim = data.points.shape[1]
    if scene.mesh and scene.mesh.kinematics and gdim == 3:
        yield Fault("mesh.kinematics", scene.mesh.kinematics, "nothing for a 3D mesh")
    components = components_of(gdim, scene.mesh.kinematics if scene.mesh else None)
    for number, motion in enumerate(scene.motion):
        if motion is not None and motion.direction not in components:
            yield direction_fault(f"motion[{number}].direction", motion.direction, components)


def _distribute(data: MeshData | None, comm: MPI.Comm) -> Mesh:
    shape = None
    if data:
        shape = (data.cell_type, data.degree, data.points.shape[1], data.cells.shape[1])
    cell_type, degree, gdim, width = comm.bcast(shape)
    cells = data.cells if data else np.empty((0, width), np.int64)
    points = data.points if data else np.empty((0, gdim))
    element = basix.ufl.element("Lagrange", cell_type, degree, shape=(gdim,))
    return create_mesh(comm, cells, points, element, _compat.shared_facet_partitioner())


def _boundaries(
    mesh: Mesh, data: MeshData | None, comm: MPI.Comm
) -> dict[str, npt.NDArray[np.int32]]:
    """Local exterior facets of each named boundary."""
    fdim = mesh.topology.dim - 1
    mesh.topology.create_entities(fdim)
    planes, facets = comm.bcast((data.planes, tuple(data.facets)) if data else None)
    found: dict[str, npt.NDArray[np.int32]] = {}
    size = comm.allreduce(float(np.abs(mesh.geometry.x).max(initial=0.0)), MPI.MAX)
    for name, (axis, place) in planes.items():

        def on_plane(
            x: npt.NDArray[np.float64], axis: int = axis, place: float = place
        ) -> npt.NDArray[np.bool_]:
            return np.abs(x[axis] - place) <= 1e-12 * size  # round-off of the coordinates

        found[name] = locate_entities_boundary(mesh, fdim, on_plane)
    for name in facets:
        nodes = data.facets[name] if data else np.empty((0, 0), np.int64)
        width = comm.bcast(nodes.shape[1])
        found[name] = _compat.find_entities(mesh, fdim, nodes.reshape(-1, width))
    return found


def _bare_boundaries(
    boundaries: dict[str, npt.NDArray[np.int32]], names: tuple[str, ...], comm: MPI.Comm
) -> list[Fault]:
    """Faults of boundaries that count and have no facet of the mesh (collective)."""
    bare = [n for n in boundaries if n in names and not comm.allreduce(len(boundaries[n]))]
    expected = "a boundary made of sides of the mesh's cells"
    return [Fault(f"boundary.{name}", "no side of a cell", expected) for name in bare]
