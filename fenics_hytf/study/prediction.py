# SPDX-License-Identifier: MIT
"""From knobs turned one at a time to settings never run: errors add as vectors, costs multiply.

With u the response of the fine setting and u_k that with knob k turned, a setting that turns
several has about the error u − u_ref + Σ (u_k − u), to first order, phases and all; and the cost
c Π (c_k/c). Mesh size and degree do not act one by one: every pair of them is a knob of its own.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fenics_hytf.study.knobs import KNOBS, MESH, Setting
from fenics_hytf.study.measures import Yardstick
from fenics_hytf.study.runs import Outcome

RealArray = npt.NDArray[np.float64]

GROUPS = (MESH, *((knob,) for knob in KNOBS if knob not in MESH))
"""Knobs that are turned together."""


@dataclass(frozen=True)
class Forecast:
    """What is expected of a setting.

    Attributes:
        setting: The setting.
        core_s: Cost [s].
        relative_l2: Of the worst receiver [-].
    """

    setting: Setting
    core_s: float
    relative_l2: float


class Prediction:
    """Predicts errors and costs around a fine setting.

    Args:
        fine: The fine setting.
        outcomes: Of the fine setting, and of settings that differ from it in one group of knobs;
            none of them failed.
        yardstick: Measures errors.
    """

    def __init__(
        self, fine: Setting, outcomes: Mapping[Setting, Outcome], yardstick: Yardstick
    ) -> None:
        self._fine = fine
        base = outcomes[fine]
        assert base.response is not None and base.cost is not None
        at = yardstick.fitted(base.response)
        self._cost = base.cost.core_s
        self._ratios: list[dict[tuple[float, ...], float]] = [{} for _ in GROUPS]
        self._rows: list[dict[tuple[float, ...], int]] = [{} for _ in GROUPS]
        vectors = [at - yardstick.reference]
        for number, group in enumerate(GROUPS):
            self._ratios[number][_values(fine, group)] = 1.0
            for setting, outcome in outcomes.items():
                turned = setting.differing(fine)
                if not turned or not set(turned) <= set(group):
                    continue
                assert outcome.response is not None and outcome.cost is not None
                self._rows[number][_values(setting, group)] = len(vectors)
                self._ratios[number][_values(setting, group)] = outcome.cost.core_s / self._cost
                vectors.append(yardstick.fitted(outcome.response) - at)
        self._gram = yardstick.products(vectors)

    def forecast(self, setting: Setting) -> Forecast | None:
        """What is expected of a setting; ``None`` if one of its values was never run."""
        rows, cost = [0], self._cost
        for number, group in enumerate(GROUPS):
            values = _values(setting, group)
            if values not in self._ratios[number]:
                return None
            cost *= self._ratios[number][values]
            if values in self._rows[number]:
                rows.append(self._rows[number][values])
        squares = self._gram[:, rows][:, :, rows].sum(axis=(1, 2))
        return Forecast(setting, cost, float(np.sqrt(max(squares.max(), 0.0))))

    def everything(self) -> Iterator[Forecast]:
        """Every combination of the values that were run."""
        for combination in itertools.product(*self._ratios):
            setting = self._fine
            for group, values in zip(GROUPS, combination, strict=True):
                for knob, value in zip(group, values, strict=True):
                    setting = setting.turned(knob, value)
            forecast = self.forecast(setting)
            assert forecast is not None  # its values were run
            yield forecast


def _values(setting: Setting, group: tuple[str, ...]) -> tuple[float, ...]:
    return tuple(getattr(setting, knob) for knob in group)
