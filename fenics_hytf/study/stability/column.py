# SPDX-License-Identifier: MIT
"""Columns for the stability map of lapses: any length, cut, contour, and moduli that change.

The column is marched lapse by lapse with the very hand-over of a run. What a scene refuses, lapses
too short and lines cut too low, is computed here all the same, for lapses are cut, and contours
made, without asking the rules. Moduli are imposed, lapse by lapse, so that the true motion is known
(:mod:`fenics_hytf.study.stability.reference`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fenics_hytf.frequency import Loads, Sweep, direct_sweep
from fenics_hytf.lapse import (
    HANDOVER,
    Energy,
    Excitation,
    Handover,
    Material,
    Response,
    scheme_of,
)
from fenics_hytf.motion import Contour, Segment, energy_band, synthetic
from fenics_hytf.scene import Scene
from fenics_hytf.study.stability.ground import Site

RealArray = npt.NDArray[np.float64]

HEIGHT, CELLS, SPEED = 24.0, 12, 170.0  # m, -, m/s: f₁ is 1.8 Hz, the highest mode 47 Hz
STILL = 4.5
"""Time at the end in which nothing acts but 5e-4 of the motion's peak, and no modulus changes [s].
"""
_DT, _SAMPLES = 0.01, 1200
_BEYOND = 1e12  # m: what has moved so far in a lapse has blown up, and squares stay finite
_TOLERANCE = 1e-6  # of a direct sweep, whose residuals are next to round-off
_MOTION: dict[str, Any] = {  # 0.5 to 6 Hz, strong from 1.5 to 5 s
    "pga_g": 0.1,
    "n": _SAMPLES,
    "dt": _DT,
    "f1": 0.5,
    "f2": 6.0,
    "nf": 24,
    "t1": 1.5,
    "t2": 5.0,
    "c": 3.0,
}


@cache
def _motion_band() -> float:
    """Frequency below which the motion has 99 % of its energy [Hz]."""
    return energy_band(synthetic(**_MOTION).acceleration[None], _DT)


@dataclass(frozen=True)
class ColumnCase:
    """A column of the map.

    Attributes:
        periods: Length of a lapse times the highest frequency solved [-].
        damping: Damping ratio of the soil [-]; 0 is elastic.
        fraction: Of the shear modulus that is left [-].
        path: ``falls``: by equal factors from lapse to lapse until nothing acts any more;
            ``swings``: to the fraction and back in every other lapse until then.
        above_band: Highest frequency solved over that below which the motion has 99 % of its
            energy [-]; ``None`` for all lines.
    """

    periods: float
    damping: float
    fraction: float = 1.0
    path: str = "falls"
    above_band: float | None = 2.0

    @cached_property
    def scene(self) -> Scene:
        """The column as a scene of one lapse, which no rule on lapses forbids."""
        ground = {"density": 1800.0, "shear_wave_velocity": SPEED, "poisson": 0.3}
        law = {"complex_modulus": "maxwell", "reference_frequency": 2.0}
        cut = {} if self.above_band is None else {"max_frequency": self.above_band * _motion_band()}
        heights = np.linspace(0.0, HEIGHT, CELLS + 1)
        layer = {"thickness": HEIGHT, "soil": "soil", "cells": CELLS}
        return Scene.from_dict(
            {
                "mesh": {"column": {"width": HEIGHT / CELLS, "layers": [layer]}},
                "soil": {"soil": ground | {"damping": self.damping}},
                "motion": [{"direction": "x", "synthetic": _MOTION}],
                "boundary": {"left": "tied", "right": "tied"},
                "lapses": {"count": 1, "continuity": "transient"},
                "solver": {"sweep": "direct"} | law | cut,
                "output": {"receivers": {f"n{i}": [1.0, float(y)] for i, y in enumerate(heights)}},
            }
        )

    @property
    def max_frequency(self) -> float:
        """Highest frequency solved [Hz]."""
        return self.scene.solver.max_frequency or 0.5 / _DT

    @property
    def cut_above_band(self) -> float:
        """It over the frequency below which the motion has 99 % of its energy [-]."""
        return self.max_frequency / _motion_band()

    @property
    def length(self) -> int:
        """Samples of a lapse."""
        return max(2, round(self.periods / self.max_frequency / _DT))

    @property
    def segments(self) -> list[Segment]:
        """The lapses; the last one ends at or after the end of the motion."""
        count = -(-_SAMPLES // self.length)
        return [Segment(i, i * self.length, self.length) for i in range(count)]

    @property
    def ratios(self) -> RealArray:
        """Shear modulus of each lapse over the first one's [-]."""
        starts = np.array([segment.start for segment in self.segments])
        changing = int((starts < _SAMPLES - STILL / _DT).sum())
        number = np.arange(len(starts))
        if self.path == "swings":
            return np.where((number < changing) & (number % 2 == 1), self.fraction, 1.0)
        return np.asarray(self.fraction ** np.minimum(number / max(changing - 1, 1), 1.0))

    @property
    def still(self) -> int:
        """Samples at the end in which nothing acts."""
        return self.segments[-1].stop - _SAMPLES + round(STILL / _DT)

    def march(self, decay: float) -> tuple[RealArray, list[Energy]]:
        """Run the column lapse by lapse.

        Args:
            decay: ηT of the contour [-].

        Returns:
            Displacement of the nodes relative to the base [m], shape ``(num_nodes, num_samples)``,
            and the energy ledger of each lapse.
        """
        times, _ = HANDOVER
        contour = Contour.over(self.length, _DT, times, decay * times)
        scheme = replace(scheme_of(self.scene, ("soil",)), contour=contour)
        after = self.segments[-1].stop - _SAMPLES
        with Site(self.scene, scheme.carried(2)) as site:
            continuity = Handover(self.scene, site.domain, site.equations, scheme, None, after)
            try:
                return self._march(site, continuity)
            finally:
                continuity.destroy()

    def _march(self, site: Site, continuity: Handover) -> tuple[RealArray, list[Energy]]:
        rows = site.receiver_rows()
        motion = np.full((rows.getSize()[0], self.segments[-1].stop + 1), np.inf)
        motion[:, 0] = 0.0
        ledgers: list[Energy] = []
        for segment, ratio in zip(self.segments, self.ratios, strict=True):
            excitation = continuity.excite(segment)
            continuity.begin(site.points, excitation)
            response, law = _solve(site, continuity, excitation, ratio)
            increment = response.between(response.spectra(rows), 0, 1)
            here = slice(segment.start, segment.stop + 1)
            motion[:, here] = motion[:, [segment.start]] + increment
            if not np.abs(increment).max() < _BEYOND:
                break
            ledger = continuity.energy(response, law, ledgers[-1].stored[1] if ledgers else None)
            assert ledger is not None  # the law is causal
            ledgers.append(ledger)
            continuity.finish(site.points, response, law)
        rows.destroy()
        return motion[::2, :-1], ledgers


def _solve(
    site: Site, continuity: Handover, excitation: Excitation, ratio: float
) -> tuple[Response, Material]:
    """One lapse with a ratio of the shear modulus."""
    equations, law = site.assemble(ratio)

    def sweep(loads: Sequence[PETSc.Vec] | Loads) -> Sweep:
        return direct_sweep(equations.system, loads, excitation.s, _TOLERANCE)

    return continuity.respond(sweep, equations, law), law
