# SPDX-License-Identifier: MIT
"""The stability map of contrast and damping: soft soil beside stiff rock, to 50 Hz.

What the sweeps make of it, on the imaginary axis as steady lapses do and on a damped contour as
transient ones do, with the residual that runs ask for; held against solutions whose residuals are
summed in long doubles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.linalg import splu

from fenics_hytf.frequency import Sweep, SweepError, direct_sweep, reduced_sweep
from fenics_hytf.lapse import HANDOVER, asked_residual
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.margins import DEFAULT_TOLERANCE
from fenics_hytf.study.stability.ground import ScipySystem, Site
from fenics_hytf.study.stability.records import CONTRAST, Job, MapValues, Row
from fenics_hytf.study.stability.verdicts import judge_solution

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
class Refined:
    """A solution that is good to the last digits of a double.

    Attributes:
        x: The solution, shape ``(n,)``.
        ratio: Of the second correction to the first when factors in doubles are refined: below 1
            refining converges [-].
        floor: Relative residual that it leaves, rounded to doubles: no sweep leaves less [-].
    """

    x: ComplexArray
    ratio: float
    floor: float


def refined(A: sparse.csr_matrix, b: ComplexArray) -> Refined:
    """Solve by refinement, with residuals in long doubles that add no round-off of their own.

    Args:
        A: The matrix, shape ``(n, n)``.
        b: The right-hand side, shape ``(n,)``.

    Returns:
        The solution.
    """
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
    return Refined(rounded, corrections[1] / corrections[0], floor)


def contrast_jobs(
    places: Sequence[str] = tuple(PLACES),
    contrast: Sequence[float] = (1.0, 1e2, 1e4, 1e5, 1e6, 1e7, 1e8, 1e10),
    damping: Sequence[float] = (0.0, 0.01, 0.05, 0.1, 0.2),
) -> Iterator[Job]:
    """Contrast × damping, for both continuities and both sweeps.

    Args:
        places: Where stiff ground lies, of :data:`PLACES`.
        contrast: Shear modulus of the stiff over that of the soft ground [-].
        damping: Damping ratio of both [-].

    Yields:
        The runs of a section.
    """
    for place, ratio, damped in product(places, contrast, damping):
        text = f"{place}, contrast {ratio:g}, damping {damped:g}"
        count = len(LINES) * len(SWEEPS)
        yield Job(CONTRAST, text, count, partial(_runs, place, ratio, damped))


def _runs(place: str, contrast: float, damping: float) -> Iterator[Row]:
    scene = _scene(place, contrast, damping)
    with Site(scene) as site:
        system = ScipySystem(site)
    true = {name: [refined(system.matrix(z), system.load) for z in s] for name, s in LINES.items()}
    return _swept({"place": place, "contrast": contrast, "damping": damping}, scene, true)


def _swept(
    section: MapValues, scene: Scene, true: Mapping[str, Sequence[Refined]]
) -> Iterator[Row]:
    with Site(scene) as site:
        equations, _ = site.assemble()
        for continuity, sweep in product(LINES, SWEEPS):
            asked = asked_residual(DEFAULT_TOLERANCE, continuity == "transient", sweep)
            axes = {**section, "continuity": continuity, "sweep": sweep}
            exact, s = true[continuity], LINES[continuity]
            residual, error = None, None
            try:
                found = SWEEPS[sweep](equations.system, equations.loads, s, asked)
            except SweepError:
                pass  # it has refused the lines, which is what the map tells
            else:
                residual = float(found.residuals.max())
                error = max(
                    float(np.linalg.norm(found.solution(k)[:, 0] - t.x) / np.linalg.norm(t.x))
                    for k, t in enumerate(exact)
                )
            figures = {
                "error": error,
                "residual": residual,
                "refinement": max(t.ratio for t in exact),
                "residual_floor": max(t.floor for t in exact),
            }
            yield axes, figures, judge_solution(error)


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
