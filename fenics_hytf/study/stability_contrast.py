# SPDX-License-Identifier: MIT
"""The stability map of contrast and damping: soft soil beside stiff rock, to 50 Hz.

What the sweeps make of it, on the imaginary axis as steady lapses do and on a damped contour as
transient ones do, with the residual that runs ask for; held against solutions whose residuals are
summed in long doubles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.linalg import splu

from fenics_hytf.frequency import Sweep, SweepError, direct_sweep, reduced_sweep
from fenics_hytf.lapse import HANDOVER, asked_residual
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.margins import DEFAULT_TOLERANCE
from fenics_hytf.study.stability_ground import Response, Site

ComplexArray = npt.NDArray[np.complex128]

_MIDDLE = [[13.0, 5.0], [27.0, 5.0], [27.0, 15.0], [13.0, 15.0]]
PLACES = {
    "soil on rock": [{"soil": "rock", "below": 10.0}, {"soil": "soil"}],
    "rock on soil": [{"soil": "soil", "below": 10.0}, {"soil": "rock"}],
    "boulder in soil": [{"soil": "rock", "polygon": _MIDDLE}, {"soil": "soil"}],
}
SWEEPS: dict[str, Callable[..., Sweep]] = {"direct": direct_sweep, "reduced": reduced_sweep}
_FREQUENCIES = np.array([0.5, 2.0, 5.0, 10.0, 20.0, 35.0, 50.0])  # Hz
LINES = {  # continuity: s of the lines
    "steady": 2j * np.pi * _FREQUENCIES,
    "transient": HANDOVER[1] / HANDOVER[0] / 2.0 + 2j * np.pi * _FREQUENCIES,  # of a lapse of 2 s
}
_REFINED = 8  # corrections: each leaves 5e-3 of the error before or less, up to a contrast of 1e10


@dataclass(frozen=True)
class ContrastFigures:
    """What a sweep makes of the lines.

    Attributes:
        residual: Worst relative residual [-], ``None`` where the sweep stopped.
        error: Worst error of a solution over its length [-], ``None`` where the sweep stopped.
        refinement: Worst ratio of the second correction to the first when factors in doubles are
            refined: below 1 refining converges [-].
        floor: Worst residual of true solutions rounded to doubles: no sweep leaves less [-].
    """

    residual: float | None
    error: float | None
    refinement: float
    floor: float


def contrast_section(
    place: str, contrast: float, damping: float
) -> dict[tuple[str, str], ContrastFigures]:
    """What all sweeps make of a section.

    Args:
        place: One of :data:`PLACES`.
        contrast: Shear modulus of the rock over that of the soil [-].
        damping: Damping ratio of both [-].

    Returns:
        The figures by continuity and sweep.
    """
    figures = {}
    with Site(_scene(place, contrast, damping)) as site:
        response = Response(site)
        equations, _ = site.assemble()
        for continuity, s in LINES.items():
            true = [_refined(response.matrix(z), response.load) for z in s]
            refinement, floor = max(t.ratio for t in true), max(t.floor for t in true)
            for name, sweep in SWEEPS.items():
                residual, error = None, None
                tolerance = asked_residual(DEFAULT_TOLERANCE, continuity == "transient", name)
                try:
                    found = sweep(equations.system, equations.loads, s, tolerance)
                except SweepError:
                    pass  # it has refused the lines, which is what the map tells
                else:
                    residual = float(found.residuals.max())
                    error = max(
                        float(np.linalg.norm(found.solution(k)[:, 0] - t.x) / np.linalg.norm(t.x))
                        for k, t in enumerate(true)
                    )
                figures[continuity, name] = ContrastFigures(residual, error, refinement, floor)
    return figures


def _scene(place: str, contrast: float, damping: float) -> Scene:
    soil = {"density": 1800.0, "shear_modulus": 2e7, "poisson": 0.3, "damping": damping}
    rock = soil | {"shear_modulus": 2e7 * contrast}
    motion = {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 16}
    return Scene.from_dict(
        {
            "mesh": {"box": {"size": [40.0, 20.0], "cells": [20, 10]}, "regions": PLACES[place]},
            "soil": {"soil": soil, "rock": rock},
            "motion": [{"direction": "x", "harmonic": motion}],
            "boundary": {"left": "tied", "right": "tied"},
        }
    )


@dataclass(frozen=True)
class _True:
    """A solution in doubles, good to the last digits; ratio and floor as in the figures."""

    x: ComplexArray
    ratio: float
    floor: float


def _refined(A: sparse.csr_matrix, b: ComplexArray) -> _True:
    """Solve by refinement, with residuals that add no round-off of their own."""
    columns, values = A.indices, A.data.astype(np.clongdouble)

    def left(x: npt.NDArray[Any]) -> ComplexArray:
        products = np.add.reduceat(values * x[columns], A.indptr[:-1])  # every row has a diagonal
        return (b.astype(np.clongdouble) - products).astype(np.complex128)

    scale = 1.0 / np.sqrt(np.abs(A.diagonal()))
    factors = splu(sparse.csc_matrix(sparse.diags(scale) @ A @ sparse.diags(scale)))
    x: npt.NDArray[Any] = np.zeros(len(b), np.clongdouble)
    corrections = []
    for _ in range(_REFINED):
        correction = scale * factors.solve(scale * left(x))
        corrections.append(float(np.linalg.norm(correction)))
        x = x + correction
    rounded = x.astype(np.complex128)
    floor = float(np.linalg.norm(left(rounded)) / np.linalg.norm(b))
    return _True(rounded, corrections[1] / corrections[0], floor)
