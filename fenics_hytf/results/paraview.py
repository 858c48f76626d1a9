# SPDX-License-Identifier: MIT
"""Material points and nodal fields of a lapse as VTU files for ParaView.

``points_NNNN.vtu`` and ``fields_NNNN.vtu``, NNNN the number of the lapse from 0; where soil slides,
``mesh.vtu``, the mesh that its points move over. Empty cells are in the mesh, not in the fields.
Places and vectors of plane problems get a third component, zero. Of static stress and of strain
every component is an array of its own, ``stress_xx`` [Pa] and so on, strain as the tensor's, ε.
What points carry over seams is called ``dynamic_...``: relative to the motion that is given, strain
and stress as Voigt columns, shear strain as γ = 2ε. A number that does not exist is written as 0
and marked by a 0 in an array ``has_NAME``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import meshio
import numpy as np
import numpy.typing as npt

from fenics_hytf.motion.files import replacing

if TYPE_CHECKING:
    from fenics_hytf.simulation import Snapshot

Arrays = dict[str, npt.NDArray[Any]]

MESH = "mesh.vtu"

# Components of tensors as points carry them, by their number; programs that show files know some by
# other orders.
_COMPONENTS = {3: ("xx", "yy", "xy"), 6: ("xx", "yy", "zz", "yz", "xz", "xy")}


def write_snapshot(folder: Path, snapshot: Snapshot) -> None:
    """Write the points and, where there are any, the fields of a lapse; once the mesh as well.

    Args:
        folder: Where.
        snapshot: Points and fields after the lapse.
    """
    if snapshot.points is not None:
        data = _by_component(snapshot.points)
        place = _three(data.pop("position"))
        vertices = [("vertex", np.arange(len(place))[:, None])]
        mesh = meshio.Mesh(place, vertices, point_data=_clean(data))
        _write(folder / f"points_{snapshot.index:04d}.vtu", mesh)
    if snapshot.vertices is None or snapshot.cells is None:
        return
    if snapshot.with_mesh and not (folder / MESH).exists():
        block = [(snapshot.cell_type, snapshot.cells)]
        _write(folder / MESH, meshio.Mesh(_three(snapshot.vertices), block))
    if snapshot.vertex_fields or snapshot.cell_fields:
        _write(folder / f"fields_{snapshot.index:04d}.vtu", _fields(snapshot))


def _fields(snapshot: Snapshot) -> meshio.Mesh:
    """The fields on the cells that hold soil."""
    assert snapshot.vertices is not None and snapshot.cells is not None
    filled = snapshot.cell_fields.get("fill", np.ones(len(snapshot.cells))) > 0
    used, corners = np.unique(snapshot.cells[filled], return_inverse=True)
    cells = [(snapshot.cell_type, corners.reshape(-1, snapshot.cells.shape[1]))]
    at_vertices = {name: values[used] for name, values in snapshot.vertex_fields.items()}
    in_cells = {name: values[filled] for name, values in snapshot.cell_fields.items()}
    return meshio.Mesh(
        _three(snapshot.vertices[used]),
        cells,
        point_data=_clean(at_vertices),
        cell_data={name: [v] for name, v in _clean(in_cells).items()},
    )


def _by_component(points: Mapping[str, npt.NDArray[np.generic]]) -> Arrays:
    """Arrays of the points, stress and strain taken apart."""
    arrays: Arrays = {}
    for name, values in points.items():
        if name in ("stress", "strain"):
            names = _COMPONENTS[values.shape[1]]
            arrays |= {f"{name}_{of}": values[:, i] for i, of in enumerate(names)}
        else:
            arrays[name] = values
    return arrays


def _write(path: Path, mesh: meshio.Mesh) -> None:
    with replacing(path) as part:
        mesh.write(part, file_format="vtu")


def _three(vectors: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Vectors with a zero third component where they have two, shape ``(n, 3)``."""
    padded = np.zeros((len(vectors), 3))
    padded[:, : vectors.shape[1]] = vectors
    return padded


def _clean(data: Arrays | dict[str, npt.NDArray[np.float64]]) -> Arrays:
    clean: Arrays = {}
    for name, values in data.items():
        array = np.asarray(values)
        if np.issubdtype(array.dtype, np.floating):
            exists = np.isfinite(array)
            if not np.all(exists):
                array = np.where(exists, array, 0.0)
                flat = exists.reshape(len(array), -1)
                clean[f"has_{name}"] = np.all(flat, axis=1).astype(np.uint8)
        if array.ndim == 2 and array.shape[1] == 2:
            array = _three(array)
        elif array.dtype == bool:
            array = array.astype(np.uint8)
        clean[name] = array
    return clean
