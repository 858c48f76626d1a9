# SPDX-License-Identifier: MIT
"""Frequency domain against time domain on one problem: the scene's viscous twin.

The twin is linear, on the same mesh, and its damping is viscous, so that both domains solve the
same equations M ü + C u̇ + K u = −M r ü_b. Everything counts on both sides: mesh, assembly,
solution, response and output. Errors are measured against the direct sweep; how far that is from
the marches with the finest steps, extrapolated to none, says how much the two agree at all.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fenics_hytf.scene import Scene
from fenics_hytf.study.measures import Yardstick
from fenics_hytf.study.records import Comparison, Point, Reference
from fenics_hytf.study.runs import Job, Outcome
from fenics_hytf.study.twin import viscous_twin

RealArray = npt.NDArray[np.float64]
Start = Callable[[Job, str, float | None], Outcome]

TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)
SUBSTEPS = (1, 2, 4, 8)
METHODS = {"newmark": "Newmark, average acceleration", "hht": "HHT-α"}
SWEEPS = {"reduced": "reduced sweep", "direct": "direct sweep"}
PLANNED = 1 + len(TOLERANCES) + len(METHODS) * len(SUBSTEPS)
"""Runs of a comparison."""

_EXACT = 1e-10  # residual of the direct sweep


@dataclass(frozen=True)
class _Run:
    """A run of the twin: its method, what is told of it, steps a sample of a march, outcome."""

    method: str
    text: str
    substeps: int
    outcome: Outcome


def nothing(reason: str) -> Comparison:
    """No comparison, and why."""
    return Comparison((), None, reason)


def compare(scene: Scene, start: Start, limit: float | None = None) -> Comparison:
    """Run the twin in the frequency domain and in the time domain.

    Args:
        scene: The scene.
        start: Runs a job that has a name, within a limit of wall time [s].
        limit: Wall time that each run may take [s]; a march that takes longer is not made finer.

    Returns:
        The comparison; without points where there is no twin.
    """
    try:
        twin = viscous_twin(scene)
    except ValueError as no:
        return nothing(str(no))
    runs: list[_Run] = []

    def attempt(job: Job, method: str, text: str) -> Outcome:
        outcome = start(job, f"viscous twin: {text}", limit)
        runs.append(_Run(method, text, job.substeps if method in METHODS else 0, outcome))
        return outcome

    exact = attempt(Job(_swept(twin, "direct", _EXACT)), "direct", SWEEPS["direct"])
    if exact.response is None:
        return nothing(f"its direct sweep failed: {exact.failure}")
    for tolerance in TOLERANCES:
        text = f"{SWEEPS['reduced']} to {tolerance:g}"
        attempt(Job(_swept(twin, "reduced", tolerance)), "reduced", text)
    for method, name in METHODS.items():
        for substeps in SUBSTEPS:
            text = f"{name}, {substeps} step{'s' if substeps > 1 else ''} a sample"
            if attempt(Job(twin, method, substeps), method, text).failure:
                break
    num_samples = max(motion.record.num_samples for motion in twin.motion)  # without the padding
    reference = exact.response[:, :, :num_samples]
    yardstick = Yardstick(reference, twin.dt, tuple(twin.output.receivers))
    checked = _reference(runs, yardstick)
    return Comparison(tuple(_point(run, yardstick, checked) for run in runs), checked)


def _swept(twin: Scene, sweep: str, tolerance: float) -> Scene:
    data = copy.deepcopy(twin.data)
    data["solver"] = data.get("solver", {}) | {"sweep": sweep, "tolerance": tolerance}
    return Scene.from_dict(data, twin.folder)


def _reference(runs: list[_Run], yardstick: Yardstick) -> Reference:
    """The direct sweep; how far marches, whose error falls with the square of a step, are."""
    marched = {
        run.substeps: yardstick.fitted(run.outcome.response)
        for run in runs
        if run.method == "newmark" and run.outcome.response is not None
    }
    text = "the direct sweep"
    finest = max(marched, default=0)
    if finest // 2 not in marched:
        return Reference(f"{text}, not checked by a march", 0.0)
    # of the second order, a step half as long leaves a quarter: a third of the change is left
    extrapolated = marched[finest] + (marched[finest] - marched[finest // 2]) / 3
    apart = yardstick.distance(extrapolated, yardstick.reference)
    return Reference(
        f"{text}; the march, extrapolated to no step from {finest // 2} and {finest} steps a "
        f"sample, is {apart:.2g} away",
        apart,
    )


def _point(run: _Run, yardstick: Yardstick, reference: Reference) -> Point:
    outcome, error = run.outcome, None
    if outcome.response is not None and run.method != "direct":  # which is what is measured against
        error = yardstick.error(outcome.response)
    return Point(
        name=run.text,
        families=(run.method,),
        overrides=(),
        cost=outcome.cost,
        error=error,
        failure=outcome.failure,
        # a reduced sweep tends to the direct one, a march to what the direct one may differ from
        doubt=reference.uncertainty if run.method in METHODS else 0.0,
        substeps=run.substeps,
    )
