# SPDX-License-Identifier: MIT
"""The course of a study: which runs, in which order, and what is made of them.

1. The scene as it is; its sweep the other way as well.
2. The finest run that can be afforded: the reference, unless a closed form is.
3. Knobs turned one at a time from a fine setting: what each alone costs and gains.
4. Knobs turned one at a time from the scene's own: which of them holds it back.
5. Settings predicted to be the cheapest for an error, run to see; what fails corrects the
   prediction and the next is tried.
6. Frequency domain and time domain on the scene's viscous twin.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.study import time_domain
from fenics_hytf.study.closed_form import NoClosedForm, closed_form
from fenics_hytf.study.knobs import KNOBS, MESH, Knobs, Setting
from fenics_hytf.study.measures import Error, Yardstick
from fenics_hytf.study.overrides import text_of
from fenics_hytf.study.plan import FINE, FINEST, OTHER_SWEEP, Costs, affordable, left_out
from fenics_hytf.study.prediction import Forecast, Prediction
from fenics_hytf.study.records import (
    SAME,
    TARGETS,
    WORTH,
    BudgetSpent,
    Point,
    Reference,
    Study,
    StudyCallback,
    StudyError,
    StudyProgress,
    cheapest,
    core_s,
)
from fenics_hytf.study.runs import Job, Outcome, Runner
from fenics_hytf.study.slip_measures import SLIP, slip_errors
from fenics_hytf.study.uncertainty import uncertainty
from fenics_hytf.study.verdict import sentences

RealArray = npt.NDArray[np.float64]

logger = logging.getLogger(__name__)

_PATIENCE = 120.0  # s of wall time that any run may take,
_LONGEST = 40.0  # or so many times what the scene itself takes, where that is more
_USUAL = 45  # runs of a study, before more is known
_TRIES = 4  # settings run for one target
_NOTHING = 1e-9  # relative L2: rounding
_OFF = 10.0  # times its tolerance, what the response of a reduced sweep may be off by


def conduct(
    scene: Scene, cell_type: str, run: Runner, progress: StudyCallback | None = None
) -> Study:
    """Study one scene.

    Args:
        scene: The scene; it has receivers.
        cell_type: Of its mesh.
        run: Runs jobs.
        progress: Called before each run.

    Returns:
        The study; not complete where the runner had no time left.

    Raises:
        StudyError: If the scene itself cannot be run, or nothing can be measured.
    """
    course = _Course(scene, cell_type, run, progress)
    complete = True
    try:
        course.go()
    except BudgetSpent as spent:
        course.knobs.notes.append(f"not complete: {spent}")
        complete = False
    return course.study(complete)


class _Course:
    """State of a study under way."""

    def __init__(
        self, scene: Scene, cell_type: str, run: Runner, progress: StudyCallback | None
    ) -> None:
        self.knobs = Knobs(scene, cell_type)
        self._scene, self._run, self._progress = scene, run, progress
        self._outcomes: dict[Setting, Outcome] = {}
        self._families: dict[Setting, list[str]] = {}
        self._errors: dict[Setting, Error] = {}
        self._yardstick: Yardstick | None = None
        self._reference = Reference("", 0.0)
        self._slip_reference: Reference | None = None
        self._finest: Setting | None = None
        self._twin = time_domain.nothing("there was no time left for it")
        self._limit: float | None = None
        self._started, self._planned = 0, _USUAL

    def go(self) -> None:
        """All steps."""
        knobs = self.knobs
        try:
            response = closed_form(self._scene)
            self._refer("closed form: vertical waves through level layers", response, {})
        except NoClosedForm as no:
            knobs.notes.append(f"no closed form: {no}")
        own_cost = self._own()
        costs = Costs(knobs, own_cost, self._direct_ratio())
        self._settle_points()
        fine = self._first_that_runs(affordable(knobs, costs, own_cost, FINE), knobs.own)
        if self._yardstick is None:
            finest = self._first_that_runs(affordable(knobs, costs, own_cost, FINEST), fine)
            found = self._outcomes[finest]
            assert found.response is not None  # it ran
            self._finest = finest
            self._refer(f"finest run ({knobs.name(finest)})", found.response, found.slid)
        knobs.notes += left_out(knobs, self._finest or fine)
        turned = self._turned_from(fine)
        held = [knobs.own.turned(knob, getattr(fine, knob)) for knob in fine.differing(knobs.own)]
        self._planned = self._started + time_domain.PLANNED + 2 * len(TARGETS)
        self._planned += len({setting for setting, _ in turned} | {*held} - {*self._outcomes})
        for setting, knob in turned:
            self._try_out(setting, knob)
        self._doubt(fine)
        for setting in held:
            self._try_out(setting, "from own")
        prediction = Prediction(fine, self._good(), self._measure)
        self._seek(prediction)
        self._find_idle(prediction)
        self._planned = self._started + time_domain.PLANNED
        self._twin = time_domain.compare(self._scene, self._start, self._limit)

    @property
    def _measure(self) -> Yardstick:
        assert self._yardstick is not None
        return self._yardstick

    def _start(self, job: Job, text: str, limit: float | None) -> Outcome:
        """Run a job, and say so."""
        self._started += 1
        if self._progress is not None:
            planned = max(self._planned, self._started)
            self._progress(StudyProgress(self._started - 1, planned, text))
        outcome = self._run(job, limit)
        if outcome.failure:
            logger.info("%s: %s", text, outcome.failure)
        return outcome

    def _try_out(self, setting: Setting, family: str) -> Outcome:
        """Run a setting, once; it belongs to every family it is asked for in."""
        families = self._families.setdefault(setting, [])
        if family not in families:
            families.append(family)
        if setting not in self._outcomes:
            try:
                scene = self.knobs.scene_with(setting)
            except SceneError as error:  # a mesh too coarse for its regions, say
                faults = "; ".join(str(fault) for fault in error.faults)
                self._outcomes[setting] = Outcome(None, None, faults)
            else:
                name = self.knobs.name(setting)
                self._outcomes[setting] = self._start(Job(scene), name, self._limit)
        return self._outcomes[setting]

    def _good(self) -> dict[Setting, Outcome]:
        return {setting: found for setting, found in self._outcomes.items() if not found.failure}

    def _own(self) -> float:
        """Run the scene as it is; its core-seconds."""
        outcome = self._try_out(self.knobs.own, "own")
        if outcome.cost is None:
            raise StudyError(f"the scene itself cannot be run: {outcome.failure}")
        self._limit = max(_PATIENCE, _LONGEST * outcome.cost.wall_s)
        return outcome.cost.core_s

    def _direct_ratio(self) -> float:
        """What a direct sweep costs over a reduced one; it is left out where it does not end."""
        own = self.knobs.own
        if 0.0 not in self.knobs.values["sweep"]:
            return 1.0
        reduced = own if own.sweep else own.turned("sweep", OTHER_SWEEP)
        direct = own.turned("sweep", 0.0)
        costs = [self._try_out(each, "either sweep").cost for each in (reduced, direct)]
        if costs[1] is None:
            self.knobs.leave_out("sweep", direct.sweep)
        if costs[0] is None or costs[1] is None:
            return 1.0
        return costs[1].core_s / costs[0].core_s

    def _settle_points(self) -> None:
        """Leave the points as they are where more of them, or fewer, change nothing.

        So it is on cells that are parallelograms of one soil: every rule that is allowed
        integrates their mass exactly.
        """
        own = self.knobs.own
        fewest, *_, most = self.knobs.values["points"]
        nothing = max(_NOTHING, _OFF * own.sweep)
        base = self._outcomes[own].response
        assert base is not None
        measure = self._against(base, {})
        for points in (fewest, most):
            response = self._try_out(own.turned("points", points), "from own").response
            if response is None or measure.distance(response, base) > nothing:
                return
        self.knobs.settle("points")

    def _against(self, response: RealArray, slid: Mapping[str, float]) -> Yardstick:
        """What measures against a response, and what slid in it."""
        return Yardstick(response, self._scene.dt, tuple(self._scene.output.receivers), slid)

    def _refer(self, text: str, response: RealArray, slid: Mapping[str, float]) -> None:
        """Measure from here on against a response, and what slid in it."""
        self._yardstick = self._against(response, slid)
        pending = self._finest is not None  # a run itself; a closed form is exact
        self._reference = Reference(text, 0.0, pending=pending)
        if slid.get(SLIP):
            self._slip_reference = Reference(text, 0.0, pending=pending)
        elif slid:
            self.knobs.notes.append("slip: nothing slides in the reference")

    def _first_that_runs(self, setting: Setting, last: Setting) -> Setting:
        """A fine setting; with one knob after the other as in the last resort, until it runs."""
        attempts = [setting]
        for knob in ("loop", "step", "cells", "degree", "band", "sweep", "points", "lapses"):
            attempts.append(attempts[-1].turned(knob, getattr(last, knob)))
        return next(s for s in dict.fromkeys(attempts) if not self._try_out(s, "fine").failure)

    def _turned_from(self, fine: Setting) -> list[tuple[Setting, str]]:
        """Settings that differ from a fine one in one knob, or in mesh size and degree."""
        values = self.knobs.values
        turned = [
            (
                fine.turned("degree", degree).turned("cells", size),
                "cells" if degree == fine.degree else "degree",
            )
            for degree in values["degree"]
            if degree <= fine.degree
            for size in values.get("cells", (fine.cells,))
            if size <= fine.cells
        ]
        turned += [
            (fine.turned(knob, value), knob)
            for knob in values
            if knob not in MESH
            for value in self.knobs.up_to(knob, fine)
        ]
        return turned

    def _doubt(self, fine: Setting) -> None:
        """Estimate the error of a reference that is a run itself."""
        if self._finest is None:
            return
        base = self._outcomes[fine]
        assert base.response is not None
        distance, slips = {}, {}
        for setting, found in self._good().items():
            assert found.response is not None  # it ran
            distance[setting] = self._measure.distance(found.response, base.response)
            slips[setting] = slip_errors(found.slid, base.slid).get(SLIP, 0.0)
        self._reference = self._doubted(self._reference, fine, distance)
        if self._slip_reference is not None:
            self._slip_reference = self._doubted(self._slip_reference, fine, slips)

    def _doubted(
        self, reference: Reference, fine: Setting, distance: Mapping[Setting, float]
    ) -> Reference:
        """A run as the reference, with what it is uncertain by."""
        assert self._finest is not None
        parts = uncertainty(self.knobs, fine, self._finest, distance)
        return Reference(reference.text, sum(parts.values()), parts)

    def _seek(self, prediction: Prediction) -> None:
        """Run the settings that are predicted to be the cheapest for each target."""
        forecasts = sorted(prediction.everything(), key=lambda forecast: forecast.core_s)
        for target in TARGETS:
            error_off = cost_off = 1.0  # measured over predicted, of what was tried
            for _ in range(_TRIES):
                found = self._promising(
                    forecasts, (target - self._reference.uncertainty) / error_off
                )
                best = cheapest(self._points(), target)
                least = float("inf") if best is None else core_s(best)
                if found is None or found.core_s * cost_off >= WORTH * least:
                    break
                outcome = self._try_out(found.setting, "candidate")
                error = self._error(found.setting)
                if outcome.cost is None or error is None:
                    continue
                cost_off = max(cost_off, outcome.cost.core_s / found.core_s)
                foretold = max(found.relative_l2, _NOTHING)
                error_off = max(error_off, error.relative_l2 / foretold)

    def _promising(self, forecasts: list[Forecast], target: float) -> Forecast | None:
        """The cheapest of forecasts within a target that has not been run."""
        within = (f for f in forecasts if f.relative_l2 <= target)
        return next((f for f in within if f.setting not in self._outcomes), None)

    def _find_idle(self, prediction: Prediction) -> None:
        """Find the knob whose coarser value saves most and changes next to nothing; run it."""
        own = self.knobs.own
        here, error = prediction.forecast(own), self._error(own)
        if here is None or error is None:
            return
        turned = [
            prediction.forecast(own.turned(knob, value))
            for knob, values in self.knobs.values.items()
            for value in values
        ]
        least = min(
            (f for f in turned if f is not None and f.relative_l2 <= SAME * here.relative_l2),
            key=lambda forecast: forecast.core_s,
            default=here,
        )
        if least.core_s < WORTH * here.core_s:
            self._try_out(least.setting, "from own")

    def _error(self, setting: Setting) -> Error | None:
        """Error of a setting, measured once; ``None`` if it failed."""
        found = self._outcomes[setting]
        if found.response is None or self._yardstick is None:
            return None
        if setting not in self._errors:
            self._errors[setting] = self._yardstick.error(found.response, found.slid)
        return self._errors[setting]

    def _points(self) -> list[Point]:
        """Everything that was run but the reference, which against itself is no measurement."""
        return [self._point(setting) for setting in self._outcomes if setting != self._finest]

    def _point(self, setting: Setting) -> Point:
        found, error = self._outcomes[setting], self._error(setting)
        return Point(
            name=self.knobs.name(setting),
            families=tuple(self._families[setting]),
            overrides=tuple(text_of(self.knobs.overrides(setting))),
            cost=found.cost,
            error=error,
            failure=found.failure,
            doubt=self._reference.uncertainty,
            turned=tuple(setting.differing(self.knobs.own)),
            values={knob: self.knobs.value(knob, setting) for knob in KNOBS},
            words={knob: self.knobs.describe(knob, setting) for knob in KNOBS},
            slid=found.slid,
        )

    def study(self, complete: bool) -> Study:
        """What there is so far."""
        if self._yardstick is None or self.knobs.own not in self._outcomes:
            raise StudyError(f"nothing is measured yet; {self.knobs.notes[-1]}")
        study = Study(
            title=self._scene.title,
            points=tuple(self._points()),
            own=self._point(self.knobs.own),
            finest=None if self._finest is None else self._point(self._finest),
            reference=self._reference,
            slip_reference=self._slip_reference,
            twin=self._twin,
            sentences=(),
            notes=tuple(self.knobs.notes),
            complete=complete,
        )
        return study.saying(sentences(study))
