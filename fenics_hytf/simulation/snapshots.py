# SPDX-License-Identifier: MIT
"""Points and nodal fields of a lapse, brought together on rank 0 for whoever writes them."""

from __future__ import annotations

from collections.abc import Callable

import basix
import numpy as np
import numpy.typing as npt

from fenics_hytf import _compat
from fenics_hytf.domain import Domain
from fenics_hytf.lapse import CellState, LapseResult, Moduli
from fenics_hytf.particles import Points
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.records import Snapshot

_INTERNAL = ("X", "memory_strain", "piece")

_MESHIO = {
    "triangle": "triangle",
    "quadrilateral": "quad",
    "tetrahedron": "tetra",
    "hexahedron": "hexahedron",
}


def take_snapshot(
    scene: Scene,
    domain: Domain,
    points: Points,
    displacement: Callable[[float], npt.NDArray[np.float64]],
    moduli: Moduli,
    lapse: LapseResult,
    time: float,
) -> Snapshot:
    """Gather points, and fields where the scene asks for them (collective).

    The displacement field is that of the instant at which a receiver moves farthest (the middle of
    the lapse where there is none). The memory of Maxwell branches is the solver's own state and is
    left out. Points have the moduli of the cell they are in; where that was empty in the lapse,
    those of their own soil at small strain.

    Args:
        scene: The scene.
        domain: The domain.
        points: The points after the lapse.
        displacement: Displacement of the local nodes at a time of the lapse [m], shape
            ``(num_local_nodes, num_components)``.
        moduli: Moduli of the lapse.
        lapse: The lapse's result.
        time: End of the lapse [s].

    Returns:
        The snapshot, filled on rank 0 only.
    """
    arrays = {name: values for name, values in points.arrays().items() if name not in _INTERNAL}
    arrays["position"] = arrays.pop("x")
    cells = domain.input_cells[points.cell]
    arrays["cell"] = cells
    arrays |= _stiffness(scene, domain, points, moduli, lapse.cells)
    gathered = domain.comm.gather(arrays)
    everyone = None
    if gathered is not None:
        everyone = {name: np.concatenate([part[name] for part in gathered]) for name in arrays}
        order = np.argsort(everyone["id"])
        everyone = {name: values[order] for name, values in everyone.items()}
    slides = scene.effects.sliding is not None
    if not scene.output.fields and not slides:
        return Snapshot(lapse.index, time, everyone)
    u = displacement(_instant_of_peak(lapse)) if scene.output.fields else None
    vertices, connectivity, fields = _vertex_fields(domain, u)
    return Snapshot(
        lapse.index,
        time,
        everyone,
        vertices=vertices,
        cells=connectivity,
        cell_type=_MESHIO[domain.mesh.topology.cell_name()],
        vertex_fields=fields,
        cell_fields=_cell_fields(lapse) if scene.output.fields else {},
        with_mesh=slides,
    )


def _stiffness(
    scene: Scene, domain: Domain, points: Points, moduli: Moduli, state: CellState
) -> dict[str, npt.NDArray[np.float64]]:
    """Secant shear modulus [Pa] and its part of the small-strain one [-] at the points."""
    cells = domain.input_cells[points.cell]
    modulus, ratio = moduli.shear_modulus[cells], state.g_over_gmax[cells]
    if state.fill is not None:
        small = [scene.soil[name].elastic.shear_modulus for name in domain.region_names]
        empty = state.fill[cells] == 0
        modulus = np.where(empty, np.array(small)[points.region], modulus)
        ratio = np.where(empty, 1.0, ratio)
    return {"shear_modulus": modulus, "g_over_gmax": ratio}


def _cell_fields(lapse: LapseResult) -> dict[str, npt.NDArray[np.float64]]:
    """What of the state of cells is shown."""
    state = lapse.cells
    names = (
        *("shear_modulus", "g_over_gmax", "damping", "effective_strain", "peak_stress"),
        *("peak_acceleration", "degradation", "fill"),
    )
    fields = {name: getattr(state, name) for name in names if getattr(state, name) is not None}
    if lapse.slip is not None:
        fields["mechanism_strain"] = lapse.slip.shear_strain
    if lapse.softening is not None:
        fields["softest"] = lapse.softening.softest
    return fields


def _instant_of_peak(lapse: LapseResult) -> float:
    if not lapse.displacement.size:
        return lapse.num_samples // 2 * lapse.dt
    distance = np.nan_to_num(np.linalg.norm(lapse.displacement, axis=1))
    return int(np.argmax(distance.max(axis=0))) * lapse.dt


def _vertex_fields(
    domain: Domain, u: npt.NDArray[np.float64] | None
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64], dict[str, npt.NDArray[np.float64]]]:
    """Corners of all cells in VTK order, cells in the order of the input, and u there if given.

    Corners are numbered by the input's nodes, so that the file does not depend on the ranks.
    """
    mesh, owned = domain.mesh, domain.num_owned_cells
    num_corners = len(basix.geometry(getattr(basix.CellType, mesh.topology.cell_name())))
    vtk = np.argsort(_compat.vtk_permutation(mesh.topology.cell_name(), num_corners))
    dofs = domain.V.dofmap.list[:owned, :num_corners][:, vtk]
    nodes = _compat.geometry_dofmap(mesh)[:owned, :num_corners][:, vtk]
    numbers = np.asarray(mesh.geometry.input_global_indices, np.int64)[nodes]
    corners = domain.gather_cells(numbers)
    places = domain.gather_cells(mesh.geometry.x[nodes][:, :, : domain.gdim])
    _, first, inverse = np.unique(corners, return_index=True, return_inverse=True)
    fields = {}
    if u is not None:
        values = domain.gather_cells(u[dofs])
        if domain.num_components == 1:  # across the section
            values = np.pad(values, ((0, 0), (0, 0), (2, 0)))
        fields["displacement"] = values.reshape(-1, values.shape[-1])[first]
    return (
        places.reshape(-1, domain.gdim)[first],
        inverse.reshape(corners.shape).astype(np.int64),
        fields,
    )
