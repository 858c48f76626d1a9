# SPDX-License-Identifier: MIT
"""What a study can afford: how fine its finest runs are, before they are run.

Costs are extrapolated from the scene's own run with exponents of nested dissection: a factorisation
takes n^1.5 operations in 2D and n^2 in 3D, and one of a column n; what is not factorised grows like
n, or, in a small system, less. The exponents lie in between.
"""

from __future__ import annotations

import math

from fenics_hytf.study.knobs import LABELS, Knobs, Setting

_EXPONENTS = {1: 0.9, 2: 1.2, 3: 1.6}  # of n, by the number of directions that are refined
_REDUCED_LINES = 0.5  # exponent of the number of lines: more of them share a factorisation
_SLIDING = 0.6  # of these exponents where ground slides: most is the kernel, in the sweep's basis
_STEPS = 0.5  # exponent of the number of time steps of the slip: of a run, the kernel is a part
# which gives way first, a value at a time; then each as far as the scene's own value
_ORDER = ("sweep", "cells", "band", "loop", "step", "sweep", "cells", "degree")
_REST = ("band", "loop", "step", "sweep", "cells", "degree", "points")
_DIGITS = 2.0  # what a sweep or loop costs before its first digit, in digits
OTHER_SWEEP = 1e-6
"""Tolerance of a reduced sweep where the scene's own is direct."""
FINEST = (25.0, 60.0)
"""What the finest run may cost: so many runs of the scene itself, or core-seconds."""
FINE = (4.0, 15.0)
"""The same for the run that knobs are turned from; there are some 25 of its kind."""


class Costs:
    """Predicts what settings cost before they are run.

    Args:
        knobs: The knobs.
        own_cost: Core-seconds of the scene itself.
        direct_ratio: Cost of a direct sweep over a reduced one, both otherwise as the scene.
    """

    def __init__(self, knobs: Knobs, own_cost: float, direct_ratio: float = 1.0) -> None:
        self._knobs, self._own_cost, self._direct_ratio = knobs, own_cost, direct_ratio

    def predict(self, setting: Setting) -> float:
        """Core-seconds of a setting."""
        return self._own_cost * self._weight(setting) / self._weight(self._knobs.own)

    def _weight(self, setting: Setting) -> float:
        dim = self._knobs.dimension
        exponent = dim * _EXPONENTS[dim] * (_SLIDING if setting.step else 1.0)
        size = (setting.cells * setting.degree) ** exponent
        lines = max(self._knobs.lines_up_to(setting.band), 1)
        swept = lines**_REDUCED_LINES
        if setting.sweep:
            swept *= _DIGITS - math.log10(setting.sweep)
        else:
            own_lines = max(self._knobs.lines_up_to(self._knobs.own.band), 1)
            digits = _DIGITS - math.log10(self._knobs.own.sweep or OTHER_SWEEP)
            swept = self._direct_ratio * digits * own_lines**_REDUCED_LINES * lines / own_lines
        iterations = _DIGITS - math.log10(setting.loop) if setting.loop else 1.0
        steps = setting.step**-_STEPS if setting.step else 1.0
        return size * swept * iterations * steps


def affordable(knobs: Knobs, costs: Costs, own_cost: float, most: tuple[float, float]) -> Setting:
    """The finest setting whose predicted cost is within bounds.

    Args:
        knobs: The knobs.
        costs: Predicts costs.
        own_cost: Core-seconds of the scene itself.
        most: Runs of the scene itself, and core-seconds; the larger of the two holds.

    Returns:
        The setting; no knob of it is coarser than the scene's own but for the sweep, which is
        reduced to its smallest tolerance where a direct one is too dear.
    """
    limit = max(most[0] * own_cost, most[1])
    setting = knobs.own
    for knob in knobs.values:
        setting = setting.turned(knob, knobs.best(knob))
    further = [knob for knob in _REST for _ in knobs.values.get(knob, ())]
    for name in (*_ORDER, *further):
        coarser = _coarser(knobs, setting, name)
        if costs.predict(setting) > limit and coarser is not None:
            setting = coarser
    return setting


def left_out(knobs: Knobs, setting: Setting) -> list[str]:
    """What is finer than the finest run, in words."""
    notes = []
    for knob in knobs.values:
        best = knobs.best(knob)
        if getattr(setting, knob) != best:
            finer = knobs.describe(knob, setting.turned(knob, best))
            notes.append(
                f"{LABELS[knob]}: the finest run has {knobs.describe(knob, setting)}; with "
                f"{finer} it would cost too many runs of the scene"
            )
    return notes


def _coarser(knobs: Knobs, setting: Setting, knob: str) -> Setting | None:
    """One value down, but not below the scene's own."""
    values = knobs.values.get(knob, ())
    here = getattr(setting, knob)
    if here not in values:
        return None
    index = values.index(here)
    own = values.index(getattr(knobs.own, knob))
    if knob == "sweep" and not knobs.own.sweep:
        own -= 1  # where the scene's own is direct, a reduced one will do
    return setting.turned(knob, values[index - 1]) if index > own else None
