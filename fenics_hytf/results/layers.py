# SPDX-License-Identifier: MIT
"""The state of each layer after a lapse, and whether the equivalent-linear loop converged there.

Layers are those of a column, from the top down; elsewhere each soil's region is one, the one that
lies highest first.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from fenics_hytf.lapse import LapseResult
    from fenics_hytf.lapse.records import CellState
    from fenics_hytf.scene import Scene

RealArray = npt.NDArray[np.float64]
_Members = npt.NDArray[np.bool_]


def layer_states(
    scene: Scene, region_names: tuple[str, ...], lapse: LapseResult
) -> list[dict[str, Any]]:
    """What the cells of each layer came to.

    Args:
        scene: The scene.
        region_names: Names of the mesh's regions.
        lapse: The lapse.

    Returns:
        A record a layer: ``soil``; ``cells``; ``depth_m`` (top and bottom of a column's layer) or
        ``elevation_m`` (lowest and highest cell centre); the smallest and largest
        ``effective_strain``, ``g_over_gmax``, ``damping``, ``peak_acceleration_m_s2``; ``change``,
        the largest final change of the loop, and whether it ``converged``, both ``None`` without a
        loop; the smallest and largest ``degradation`` index, ``None`` where nothing degrades.
    """
    cells, loop = lapse.cells, scene.effects.equivalent_linear
    index = cells.degradation
    found = (
        _column(scene, cells) if scene.mesh.column is not None else _regions(region_names, cells)
    )
    states = []
    for place, member in found:
        change = float(np.nanmax(cells.change[member], initial=0.0))
        states.append(
            {
                **place,
                "cells": int(np.count_nonzero(member)),
                "effective_strain": _range(cells.effective_strain[member]),
                "g_over_gmax": _range(cells.g_over_gmax[member]),
                "damping": _range(cells.damping[member]),
                "peak_acceleration_m_s2": _range(cells.peak_acceleration[member]),
                "change": None if loop is None else change,
                "converged": None if loop is None else change <= loop.tolerance,
                "degradation": None if index is None else _range(index[member]),
            }
        )
    return states


def _column(scene: Scene, cells: CellState) -> Iterator[tuple[dict[str, Any], _Members]]:
    """The layers of a column, top down, with the cells whose centres lie in them."""
    assert scene.mesh.column is not None
    layers = scene.mesh.column.layers
    faces = np.cumsum([0.0, *(layer.thickness for layer in layers)])
    number = np.searchsorted(faces, faces[-1] - cells.centroid[:, -1]) - 1
    for i, layer in enumerate(layers):
        place = {"soil": layer.soil, "depth_m": [float(faces[i]), float(faces[i + 1])]}
        yield place, number == i


def _regions(
    region_names: tuple[str, ...], cells: CellState
) -> Iterator[tuple[dict[str, Any], _Members]]:
    """The regions, highest first; empty cells are in none."""
    height = cells.centroid[:, -1]
    filled = np.ones(len(height), bool) if cells.fill is None else cells.fill > 0
    members = [(name, filled & (cells.region == i)) for i, name in enumerate(region_names)]
    there = [(name, member) for name, member in members if member.any()]
    for name, member in sorted(there, key=lambda pair: -float(height[pair[1]].mean())):
        yield {"soil": name, "elevation_m": _range(height[member])}, member


def _range(values: RealArray) -> list[float]:
    """Smallest and largest of those that are numbers."""
    real = values[~np.isnan(values)]
    return [float(real.min()), float(real.max())] if real.size else [float("nan")] * 2
