# SPDX-License-Identifier: MIT
"""The stability map of cut cells: a block whose last cells are filled in part, at many frequencies.

A block of eight by eight cells stands on a rigid base with air beside and above. The points of its
last column and row are squeezed into a fraction of their cells: the block is as much smaller, and
the mesh does not fit it. It is held against a mesh that does, of degree 2; with the ghost term, and
without.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
import numpy.typing as npt

from fenics_hytf.domain import Domain
from fenics_hytf.lapse import Filling, FillingSurvey
from fenics_hytf.operators import GhostForm
from fenics_hytf.particles import Points, move
from fenics_hytf.scene import Scene
from fenics_hytf.study.stability.ground import ScipySystem, Site
from fenics_hytf.study.stability.records import BLOCK, Job, MapValues, Row
from fenics_hytf.study.stability.verdicts import judge_response

ComplexArray = npt.NDArray[np.complex128]

SIDE, CELL, SPEED = 8, 1.0, 100.0  # cells, m, m/s
_AIR = 1  # cells of it beside and above
_SOIL = {"density": 1800.0, "shear_wave_velocity": SPEED, "poisson": 0.3, "damping": 0.05}
_MOTION = {
    "direction": "x",
    "harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 16},
}


def block_jobs(
    fill: Sequence[float] = (1.0, 0.9, 0.75, 0.5, 0.25, 0.1, 0.03, 0.01, 1e-3, 1e-4, 1e-6),
    waves: Sequence[float] = (120.0, 80.0, 50.0, 30.0, 20.0, 15.0, 12.0, 10.0, 8.0, 6.0),
) -> Iterator[Job]:
    """Fill × frequency, with the ghost term and without.

    Args:
        fill: Share of the last cells that is filled [-].
        waves: Cells in the length of a shear wave [-].

    Yields:
        The runs that differ in frequency alone.
    """
    for share, ghost in product(fill, (True, False)):
        text = f"cut cells, {100 * share:g} % filled, {'with' if ghost else 'without'} ghost term"
        yield Job(BLOCK, text, len(waves), partial(_runs, share, waves, ghost))


def _runs(fill: float, waves: Sequence[float], ghost: bool) -> Iterator[Row]:
    with Site(_scene((SIDE - 1 + fill) * CELL)) as site:
        fitted = ScipySystem(site)
    true = [fitted.at_receivers(_frequency(number)) for number in waves]
    return _cut(fill, waves, ghost, true)


def _cut(
    fill: float, waves: Sequence[float], ghost: bool, true: Sequence[ComplexArray]
) -> Iterator[Row]:
    """The block at every frequency, against the displacement on the mesh that fits it."""
    with Site(_scene(None), fill=_squeeze(fill, ghost)) as site:
        cut = ScipySystem(site)
    for number, expected in zip(waves, true, strict=True):
        s = _frequency(number)
        u, largest = cut.at_receivers(s), float(np.abs(expected).max())
        error = float(np.abs(u - expected).max()) / largest
        amplitude = float(np.abs(u).max()) / largest
        condition = float(np.linalg.cond(cut.matrix(s).toarray()))
        axes: MapValues = {
            "ghost": "yes" if ghost else "no",
            "fill": fill,
            "cells_a_wavelength": number,
            "frequency_hz": s.imag / (2 * np.pi),
        }
        figures = {"error": error, "amplitude_over_true": amplitude, "condition": condition}
        yield axes, figures, judge_response(error, amplitude, condition)


def _frequency(waves: float) -> complex:
    """The complex frequency at so many cells in a shear wave's length [rad/s]."""
    return 2j * np.pi * SPEED / (CELL * waves)


@dataclass(frozen=True, eq=False)
class Unheld(Filling):
    """Loose cells without a ghost term."""

    def ghost(self, domain: Domain, strength: float | None = None) -> GhostForm | None:
        """No ghost form, whatever the strength."""
        return None


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
