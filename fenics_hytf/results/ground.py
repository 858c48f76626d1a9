# SPDX-License-Identifier: MIT
"""The ground as snapshots hold it: the mesh, and the points after lapses, read from VTU files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import numpy.typing as npt
from meshio import vtu

from fenics_hytf.results.paraview import MESH
from fenics_hytf.results.reader import StoredResult, readable

RealArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class StoredMesh:
    """The mesh.

    Attributes:
        vertices: [m], shape ``(num_vertices, gdim)``.
        cells: Vertices of each cell in VTK order, cells in the order of the input, shape
            ``(num_cells, n)``.
        cell_type: meshio's name of the cell type.
    """

    vertices: RealArray
    cells: npt.NDArray[np.int64]
    cell_type: str


@dataclass(frozen=True)
class StoredPoints:
    """The material points after a lapse, sorted by identity.

    Attributes:
        time: End of the lapse [s].
        id: Identity, shape ``(num_points,)``.
        position: [m], shape ``(num_points, gdim)``.
        displacement: Since the start [m], same shape.
        volume: [m^3], in 2D [m^2], shape ``(num_points,)``.
    """

    time: float
    id: npt.NDArray[np.int64]
    position: RealArray
    displacement: RealArray
    volume: RealArray


def read_mesh(stored: StoredResult) -> StoredMesh | None:
    """Read the mesh.

    Args:
        stored: The result.

    Returns:
        The mesh; ``None`` where no snapshot left it.

    Raises:
        ResultError: If its file is broken.
    """
    path = stored.folder / MESH
    if not path.exists():
        return None
    mesh = _read(stored.folder, path)
    [block] = mesh.cells
    vertices = np.asarray(mesh.points[:, : _gdim(stored)], np.float64)
    return StoredMesh(vertices, np.asarray(block.data, np.int64), block.type)


def snapshot_lapses(stored: StoredResult) -> list[int]:
    """Lapses after which the points were written, in their order."""
    indices = (lapse["index"] for lapse in stored.summary["lapses"])
    return [i for i in indices if _points_file(stored, i).exists()]


def read_points(stored: StoredResult, lapse: int) -> StoredPoints:
    """Read the points after a lapse.

    Args:
        stored: The result.
        lapse: Number of the lapse, one of :func:`snapshot_lapses`.

    Returns:
        The points.

    Raises:
        ResultError: If their file is missing or broken.
    """
    read = _read(stored.folder, _points_file(stored, lapse))
    arrays: Mapping[str, npt.NDArray[Any]] = read.point_data
    told = stored.summary["lapses"][lapse]
    gdim = _gdim(stored)
    return StoredPoints(
        told["start_time_s"] + told["samples"] * stored.summary["dt_s"],
        np.asarray(arrays["id"], np.int64),
        np.asarray(read.points[:, :gdim], np.float64),
        np.asarray(arrays["displacement"][:, :gdim], np.float64),
        np.asarray(arrays["volume"], np.float64),
    )


def _points_file(stored: StoredResult, lapse: int) -> Path:
    return stored.folder / f"points_{lapse:04d}.vtu"


def _gdim(stored: StoredResult) -> int:
    return 3 if "z" in stored.cells else 2


def _read(folder: Path, path: Path) -> meshio.Mesh:
    with readable(folder):
        try:
            return vtu.read(path)  # meshio.read would end the program over a broken file
        except (meshio.ReadError, KeyError, SyntaxError) as error:
            raise ValueError(f"{path.name} is no VTU file: {error}") from error
