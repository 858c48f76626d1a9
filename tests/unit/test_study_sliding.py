# SPDX-License-Identifier: MIT
"""What accuracy costs where the ground slides: its knobs, what is measured, a whole study."""

import csv
import json

import numpy as np
import pytest
from support.sliding import column, slope

from fenics_hytf.cli.accuracy import closing_words
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import SimulationError, simulate
from fenics_hytf.study import BudgetSpent, Processes, Study, StudyError, conduct, time_domain
from fenics_hytf.study.figure import draw_study
from fenics_hytf.study.knobs import Knobs
from fenics_hytf.study.overrides import text_of
from fenics_hytf.study.plan import Costs
from fenics_hytf.study.runs import Cost, Job, Outcome
from fenics_hytf.study.slip_measures import MEASURES, slip_errors, slip_measures
from fenics_hytf.study.tables import slip_table, write_tables
from fenics_hytf.study.uncertainty import uncertainty

# It dies away: a motion that is cut off leaves vibration that may slip on, or not, as the last
# sample happens to find it.
WAVES = {"pga_g": 0.4, "dt": 0.02, "n": 125, "f1": 0.8, "f2": 5.0, "t1": 0.5, "t2": 0.8, "c": 3.5}


def small_column(convection: bool = False, **options) -> Scene:
    """Twelve metres in two cells above a weak one, which slip some centimetres."""
    motion = {"direction": "x", "synthetic": WAVES}
    scene = column(motion, 0.1, 150.0, height=12.0, cells=2, damping=0.05, **options)
    effects = scene.data["effects"] | {"convection": convection}
    return Scene.from_dict(scene.data | {"effects": effects})


def knobs(scene: Scene) -> Knobs:
    return Knobs(scene, "quadrilateral")


# ---------------------------------------------------------------- knobs


@pytest.mark.parametrize(
    ("sliding", "steps", "set_to"),
    [
        (True, (0.005, 0.0025, 0.00125, 0.000625), "={ time_step = 0.000625 }"),
        ({"time_step": 0.02}, (0.02, 0.01), ".time_step=0.01"),  # longer ones are a sample as well
        # three steps are not divided by two
        ({"time_step": 0.007}, (0.007, 0.02 / 6), f".time_step={0.02 / 6}"),
    ],
)
def test_time_steps_of_the_slip(sliding, steps, set_to):
    """A sample, 20 ms here, is a whole number of them."""
    scene = small_column(sliding=sliding)
    knob = knobs(scene)
    assert knob.values["step"] == pytest.approx(steps)
    assert knob.own.step == scene.effects.sliding.time_step
    for step in steps:
        turned = knob.scene_with(knob.own.turned("step", step))
        assert turned.effects.sliding.time_step == pytest.approx(step)
    assert knob.overrides(knob.own) == {}
    finest = knob.own.turned("step", knob.values["step"][-1])
    assert text_of(knob.overrides(finest)) == [f"effects.sliding{set_to}"]


def test_a_scene_that_does_not_slide_has_no_such_knob():
    data = small_column().data
    still = Scene.from_dict(data | {"effects": {"gravity": True}})
    assert "step" not in knobs(still).values and knobs(still).own.step == 0.0
    assert 0.0 in knobs(still).values["sweep"]
    # a direct sweep of the kernel is a factorisation for each step
    assert 0.0 not in knobs(small_column()).values["sweep"]


def test_cells_of_a_file_are_divided():
    data = slope()
    data["mesh"] = {"file": "meshes/slope.msh", "empty": ["air"], "refine": 1}
    data["soil"] = {"soil": data["soil"]["clay"]}
    from pathlib import Path

    scene = Scene.from_dict(data, Path(__file__).parents[2])
    knob = knobs(scene)
    assert knob.values["cells"] == (0.5, 1.0, 2.0, 4.0)
    for factor, times in ((0.5, 0), (2.0, 2), (4.0, 3)):
        turned = knob.scene_with(knob.own.turned("cells", factor))
        assert turned.mesh.refine == times
    assert knob.dimension == 2
    still = Scene.from_dict(data | {"effects": {"gravity": True}}, scene.folder)
    assert "cells" not in knobs(still).values
    costs = Costs(knob, 1.0)
    assert 2.0 < costs.predict(knob.own.turned("cells", 2.0)) < 4.0  # four times the cells


def test_what_a_step_leaves():
    """Of the first order, as a march from rest is, and of the second: Richardson is exact."""
    knob = knobs(small_column())
    fine = knob.own.turned("step", 0.00125)
    finest = fine.turned("step", 0.000625)
    for order in (1, 2):
        error = {step: (step / 0.00125) ** order for step in knob.values["step"]}
        distance = {fine.turned("step", h): e - 1.0 for h, e in error.items() if h > 0.00125}
        found = uncertainty(knob, fine, finest, distance)
        assert found == {"step": pytest.approx(error[0.000625])}


# ---------------------------------------------------------------- measures


def test_relative_differences():
    assert slip_errors(
        {"slip_m": 0.9, "rigid_m": 0.0}, {"slip_m": 1.0, "rigid_m": 0.0, "run_out_m": 1}
    ) == {
        "slip_m": pytest.approx(0.1),
        "rigid_m": 0.0,
    }
    assert slip_errors({"slip_m": 0.1}, {"slip_m": 0.0}) == {"slip_m": np.inf}


def test_a_run_tells_what_slid(tmp_path):
    """In a process of its own: the slip of the summary, and where the farthest point came to."""
    scene = small_column(convection=True)
    seen = []
    result = simulate(scene, snapshot=seen.append)
    outcome = Processes(tmp_path)(Job(scene))
    assert outcome.failure == "" and set(outcome.slid) == set(MEASURES)
    expected = sum(lapse.slip.slip[-1] for lapse in result.lapses)
    assert expected > 0.01
    assert outcome.slid["slip_m"] == pytest.approx(expected, rel=1e-12)
    moved = np.linalg.norm(seen[-1].points["displacement"], axis=1).max()
    assert outcome.slid["run_out_m"] == pytest.approx(moved, rel=1e-12)
    # the place that the mechanism moves farthest moves with it, but for what still vibrates
    assert 0.8 < moved / expected < 1.2
    again = Processes(tmp_path)(Job(scene))
    assert again.kept and again.slid == outcome.slid


# ---------------------------------------------------------------- a study


def in_process(job, limit=None) -> Outcome:
    """A runner without processes, at costs that do not hang on the clock."""
    if job.method != "simulate":
        return Outcome(None, None, "not marched here")
    try:
        result = simulate(job.scene)
    except SimulationError as error:
        return Outcome(None, None, str(error))
    cells = sum(layer.cells for layer in job.scene.mesh.column.layers)
    seconds = 1e-3 * cells * job.scene.mesh.degree / job.scene.effects.sliding.time_step**0.5
    cost = Cost(seconds, seconds, result.work.factorisations, result.work.solves, 2**20, 1, cells)
    return Outcome(cost, result.history("total_acceleration"), slid=slip_measures(result, None))


def test_a_column_that_slides(monkeypatch, tmp_path, figure):
    monkeypatch.setattr(time_domain, "compare", lambda *_: time_domain.nothing("not here"))
    scene, outcomes = small_column(sliding={"time_step": 0.005}), []

    def noted(job, limit=None):
        outcomes.append(in_process(job, limit))
        return outcomes[-1]

    study = conduct(scene, "quadrilateral", noted)
    assert study.complete and study.finest is not None
    families = {name for point in study.points for name in point.families}
    assert {"cells", "points", "step", "lapses", "sweep"} - families <= {"points"}
    slip = study.of_slip()
    assert slip is not None and slip.reference.uncertainty > 0
    finest = study.finest.slid["slip_m"]
    for point in (p for p in study.points if p.error):
        assert point.error.slides["slip_m"] == abs(point.slid["slip_m"] / finest - 1)
    # longer steps alone: the error of the slip falls with them
    steps = {
        p.values["step"]: p.error.slides["slip_m"] for p in study.points if "step" in p.families
    }
    longest, *_, shortest = sorted(steps, reverse=True)
    assert steps[longest] > 2 * steps[shortest]
    # 5 ms are short enough for 5 % of a sliding column's slip
    figure("sliding column: slip at steps of 5 ms, off", steps[0.005], 0.05)
    # and half of them leaves, at the first order, as much as it changes
    doubt = slip.reference.uncertainty
    figure("sliding column: what the slip of the reference is uncertain by", doubt, 0.05)
    assert any(sentence.startswith("Slip, 5 %: cheapest is") for sentence in study.sentences)
    write_tables(tmp_path, study)
    draw_study(study, tmp_path / "accuracy.png")
    rows = list(csv.DictReader((tmp_path / "accuracy.csv").read_text().splitlines()))
    own = next(row for row in rows if "own" in row["why"].split())
    assert float(own["slip_m"]) == study.own.slid["slip_m"] and float(own["slip_time_step_s"])
    assert float(own["slip_m_error_percent"]) == 100 * study.own.error.slides["slip_m"]
    record = json.loads((tmp_path / "accuracy.json").read_text())
    assert record["slip_reference"]["uncertainty"] == slip.reference.uncertainty
    words = closing_words(study, tmp_path)
    assert slip_table(study) in words and "time step of the slip alone" in slip_table(study)
    assert "not known yet" not in words
    # stopped as soon as there is a reference: what that is uncertain by takes further runs
    stopped = next(filter(None, (stopped_after(scene, outcomes, n) for n in range(len(outcomes)))))
    words = closing_words(stopped, tmp_path)
    assert "how uncertain itself is not known yet" in words and "± 0 %" not in words
    assert "off; the uncertainty of the reference is not known yet." in words


def stopped_after(scene: Scene, outcomes: list[Outcome], count: int) -> Study | None:
    """The study of so many outcomes, or nothing where it measures nothing."""
    left = iter(outcomes[:count])

    def run(job, limit=None):
        outcome = next(left, None)
        if outcome is None:
            raise BudgetSpent("spent")
        return outcome

    try:
        return conduct(scene, "quadrilateral", run)
    except StudyError:
        return None
