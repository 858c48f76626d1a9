# SPDX-License-Identifier: MIT
"""Vertical stress of level ground: the weight of what lies above, less the water's uplift.

σ_v(y) = ∫ ρ(y') g dy' from y to the surface, with g = 9.80665 m/s². Below a water table at y_w
the pore pressure γ_w (y_w - y), γ_w = 1000 kg/m³ · g, is taken off: effective stress (Terzaghi
1925).
Densities are total ones, of saturated soil below the table. Water above the surface weighs as much
on the total stress as on the pore pressure, so it cancels. Soil spreads no load sideways: of a box
with regions side by side each place carries what is straight above it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.motion import GRAVITY
from fenics_hytf.scene import Scene
from fenics_hytf.scene.mesh import Column, Mesh

RealArray = npt.NDArray[np.float64]

WATER_WEIGHT = 1000.0 * GRAVITY
"""Unit weight of water γ_w [N/m^3]."""


def vertical_stress(scene: Scene, x: RealArray) -> RealArray:
    """Vertical stress, effective where the scene states a water table.

    Args:
        scene: The scene.
        x: Places in a column or box [m], shape ``(n, gdim)``.

    Returns:
        [Pa], compression positive, shape ``(n,)``; NaN in a mesh from a file, whose surface need
        not be level.
    """
    mesh = scene.mesh
    if mesh.size is None:
        return np.full(len(x), np.nan)
    height = x[:, -1]
    stress = np.empty(len(x))
    for rows, x0 in _verticals(mesh, x):
        faces, density = _strata(scene, x0)
        # weight above each face, then linear in between
        weight = GRAVITY * np.append(np.cumsum((density * np.diff(faces))[::-1])[::-1], 0.0)
        stress[rows] = np.interp(height[rows], faces, weight)
    table = scene.output.water_table
    if table is not None:
        surface = mesh.size[-1]
        stress -= WATER_WEIGHT * np.maximum(min(table, surface) - height, 0.0)
    return stress


def _verticals(
    mesh: Mesh, x: RealArray
) -> list[tuple[npt.NDArray[np.intp] | slice, RealArray | None]]:
    """Rows of the places on each vertical line, and where it stands.

    Without polygons all verticals are alike, so all places are on one.
    """
    if all(region.polygon is None for region in mesh.regions):
        return [(slice(None), None)]
    stands, line = np.unique(np.round(x[:, 0], 9), return_inverse=True)  # centroids, rounded
    order = np.argsort(line, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(line))[:-1])
    return list(zip(parts, stands[:, None], strict=True))


def _strata(scene: Scene, x0: RealArray | None) -> tuple[RealArray, RealArray]:
    """Soil along a vertical.

    Args:
        scene: A column or box.
        x0: Where the vertical stands [m], shape ``(1,)``; anywhere if ``None``.

    Returns:
        Heights of the faces from the base up [m], shape ``(n + 1,)``, and the densities between
        them [kg/m^3], shape ``(n,)``.
    """
    mesh = scene.mesh
    if mesh.column is not None:
        return _layers(mesh.column, scene)
    assert mesh.size is not None
    surface = mesh.size[-1]
    cuts = {0.0, surface}
    for region in mesh.regions:
        if region.below is not None:
            cuts.add(region.below)
        if region.polygon is not None and x0 is not None:
            cuts.update(_crossings(np.array(region.polygon), float(x0[0])))
    faces = np.array(sorted(cut for cut in cuts if 0.0 <= cut <= surface))
    middle = 0.5 * (faces[1:] + faces[:-1])
    places = np.zeros((len(middle), len(mesh.size)))
    places[:, 0] = 0.0 if x0 is None else x0[0]
    places[:, -1] = middle
    names = [region.soil for region in mesh.regions] or list(scene.soil)
    density = np.array([_density(scene, name) for name in names])
    index = mesh.region_index(places)
    # a sliver that no region covers, between the centroids of cells: it has no soil, so no weight
    return faces, np.where(index >= 0, density[index], 0.0)


def _layers(column: Column, scene: Scene) -> tuple[RealArray, RealArray]:
    upwards = column.layers[::-1]
    faces = np.cumsum([0.0, *(layer.thickness for layer in upwards)])
    return faces, np.array([_density(scene, layer.soil) for layer in upwards])


def _density(scene: Scene, name: str) -> float:
    """Density of a region [kg/m^3], nought of one without soil."""
    return 0.0 if name in scene.mesh.empty else scene.soil[name].density


def _crossings(polygon: RealArray, x0: float) -> list[float]:
    """Heights at which a vertical crosses the edges of a polygon [m]."""
    start, end = np.roll(polygon, 1, axis=0), polygon
    crossed = (start[:, 0] <= x0) != (end[:, 0] <= x0)
    (xa, ya), (xb, yb) = start[crossed].T, end[crossed].T
    return list(ya + (yb - ya) * (x0 - xa) / (xb - xa))
