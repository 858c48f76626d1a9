# SPDX-License-Identifier: MIT
"""The stability map of cut cells: a block whose last cells are filled in part, at many frequencies.

A block of eight by eight cells stands on a rigid base with air beside and above. The points of its
last column and row are squeezed into a fraction of their cells: the block is as much smaller, and
the mesh does not fit it. It is held against a mesh that does, of degree 2; with the ghost term, and
without.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh

from fenics_hytf.domain import Domain
from fenics_hytf.lapse import Filling, FillingSurvey
from fenics_hytf.operators import GhostForm
from fenics_hytf.particles import Points, move
from fenics_hytf.scene import Scene
from fenics_hytf.study.stability_ground import Response, Site

ComplexArray = npt.NDArray[np.complex128]

SIDE, CELL, SPEED = 8, 1.0, 100.0  # cells, m, m/s
_AIR = 1  # cells of it beside and above
_SOIL = {"density": 1800.0, "shear_wave_velocity": SPEED, "poisson": 0.3, "damping": 0.05}
_MOTION = {
    "direction": "x",
    "harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 16},
}


@dataclass(frozen=True)
class BlockFigures:
    """A cut block at one frequency.

    Attributes:
        error: Largest difference of displacement from the fitted mesh over the largest there [-].
        amplitude: Largest displacement over the largest there [-].
        condition: Condition number of A [-].
    """

    error: float
    amplitude: float
    condition: float


@dataclass(frozen=True, eq=False)
class Unheld(Filling):
    """Loose cells without a ghost term."""

    def ghost(self, domain: Domain, strength: float | None = None) -> GhostForm | None:
        """None."""
        return None


def first_frequency() -> float:
    """Lowest natural frequency of the whole block [Hz]."""
    with Site(_scene(SIDE * CELL)) as site:
        response = Response(site)
        K, M = (response.part(i).toarray().real for i in (0, -1))
    return float(np.sqrt(eigh(K, M, eigvals_only=True)[0]) / (2 * np.pi))


def cut_block(fraction: float, waves: tuple[float, ...], ghost: bool) -> list[BlockFigures]:
    """Hold a cut block against one that its mesh fits.

    Args:
        fraction: Of the last cells that is filled [-].
        waves: Frequencies, as cells in a shear wave's length [-].
        ghost: Whether there is a ghost term.

    Returns:
        The figures at each.
    """
    size = (SIDE - 1 + fraction) * CELL
    with Site(_scene(size)) as fitted, Site(_scene(None), fill=_squeeze(fraction, ghost)) as cut:
        true, found = Response(fitted), Response(cut)
    figures = []
    for number in waves:
        s = 2j * np.pi * SPEED / (CELL * number)
        expected, condition = true.at_receivers(s), np.linalg.cond(found.matrix(s).toarray())
        u, largest = found.at_receivers(s), float(np.abs(expected).max())
        off, amplitude = float(np.abs(u - expected).max()), float(np.abs(u).max())
        figures.append(BlockFigures(off / largest, amplitude / largest, float(condition)))
    return figures


def _scene(size: float | None) -> Scene:
    """A block of its own [m], of degree 2; or, without a size, whole cells in air."""
    shift = 0.0 if size is not None else _AIR * CELL
    whole = range(SIDE)  # nodes of the cells that stay whole
    places = {f"r{i}_{j}": [shift + i * CELL, j * CELL] for i in whole for j in whole if j > 0}
    usual = {
        "soil": {"clay": _SOIL},
        "motion": [_MOTION],
        "output": {"receivers": places},
    }
    if size is not None:
        box = {"box": {"size": [size, size], "cells": [SIDE, SIDE]}, "degree": 2}
        return Scene.from_dict(usual | {"mesh": box})
    cells = [SIDE + 2 * _AIR, SIDE + _AIR]
    mesh = {
        "box": {"size": [n * CELL for n in cells], "cells": cells},
        "regions": [{"soil": "clay", "below": SIDE * CELL}, {"soil": "air"}],
        "empty": ["air"],
    }
    return Scene.from_dict(usual | {"mesh": mesh, "effects": {"convection": True}})


def _squeeze(fraction: float, ghost: bool) -> Callable[[Domain, Points], Filling]:
    """Soil of the block alone, that of its last column and row in a fraction of their cells."""
    low, last, high = _AIR * CELL, (_AIR + SIDE - 1) * CELL, (_AIR + SIDE) * CELL

    def fill(domain: Domain, points: Points) -> Filling:
        x = points.x
        soil = (x[:, 0] > low) & (x[:, 0] < high) & (x[:, 1] < SIDE * CELL)
        points.assign({name: values[soil] for name, values in points.arrays().items()})
        by = np.zeros_like(points.x)
        for axis, start in ((0, last), (1, (SIDE - 1) * CELL)):
            inside = points.x[:, axis] - start
            there = inside > 0
            by[there, axis] = (fraction - 1) * inside[there]
            points.volume[there] *= fraction
            points.mass[there] *= fraction
        move(domain.mesh, points, by)
        found = FillingSurvey(_scene(None), domain)(points)
        if ghost:
            return found
        return Unheld(found.weight, found.edge, found.share, found.fill, found.gap)

    return fill
