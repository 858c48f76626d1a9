# SPDX-License-Identifier: MIT
"""Knobs of a scene, what a study can afford and predicts, and the course of a whole study."""

import json

import numpy as np
import pytest

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import SimulationError, simulate
from fenics_hytf.study import BudgetSpent, StudyError, conduct, time_domain
from fenics_hytf.study.closed_form import closed_form
from fenics_hytf.study.figure import draw_study
from fenics_hytf.study.knobs import KNOBS, Knobs
from fenics_hytf.study.measures import Yardstick
from fenics_hytf.study.overrides import text_of
from fenics_hytf.study.plan import FINE, Costs, affordable, left_out
from fenics_hytf.study.prediction import Prediction
from fenics_hytf.study.runs import Cost, Outcome
from fenics_hytf.study.tables import table, twin_table, write_tables
from fenics_hytf.study.uncertainty import uncertainty

CURVES = {"strain": [1e-6, 1e-4, 1e-2], "modulus": [1.0, 0.8, 0.1], "damping": [0.02, 0.05, 0.2]}
SAND = {"density": 1800.0, "shear_wave_velocity": 150.0, "poisson": 0.3, "damping": 0.05}


def column(loop: bool = False, **sections) -> Scene:
    layers = [
        {"thickness": 6.0, "soil": "sand", "cells": 4},
        {"thickness": 6.0, "soil": "sand", "cells": 2},
    ]
    data = {
        "title": "A column",
        "mesh": {"column": {"width": 1.0, "layers": layers}, "degree": 1},
        "soil": {"sand": SAND | ({"curves": CURVES} if loop else {})},
        "motion": [{"direction": "x", "synthetic": {"n": 256, "dt": 0.02}, "pga": 0.1}],
        "boundary": {"left": "tied", "right": "tied"},
        "effects": {"equivalent_linear": {"tolerance": 1e-2}} if loop else {},
        "solver": {"sweep": "reduced", "max_frequency": 10.0},
        "output": {"receivers": {"top": [0.5, 12.0], "mid": {"point": [0.5, 6.0]}}},
    }
    return Scene.from_dict(data | sections)


def knobs(scene: Scene) -> Knobs:
    return Knobs(scene, "quadrilateral")


def steady_cost(job) -> float:
    """A cost that does not hang on the clock: cells × degree² × a sweep's digits."""
    solver, mesh = job.scene.solver, job.scene.mesh
    cells = sum(layer.cells for layer in mesh.column.layers)
    digits = -np.log10(solver.tolerance) if solver.sweep == "reduced" else 20.0
    return 1e-5 * cells * mesh.degree**2 * digits * (solver.max_frequency or 25.0)


def in_process(job, limit=None) -> Outcome:
    """A runner without processes."""
    if job.method != "simulate":
        return Outcome(None, None, "not marched here")
    try:
        result = simulate(job.scene)
    except SimulationError as error:
        return Outcome(None, None, str(error))
    seconds = steady_cost(job)
    cost = Cost(seconds, seconds, result.work.factorisations, result.work.solves, 2**20, 1, 1)
    return Outcome(cost, result.history("total_acceleration"))


@pytest.fixture
def no_twin(monkeypatch):
    monkeypatch.setattr(time_domain, "compare", lambda *_: time_domain.nothing("not here"))


def test_the_scenes_own_setting_changes_nothing():
    scene = column(loop=True)
    knob = knobs(scene)
    assert knob.overrides(knob.own) == {}
    assert knob.name(knob.own) == "the scene's own settings"
    assert knob.own.sweep == 1e-6 and knob.own.band == 10.0 and knob.own.loop == 1e-2


def test_overrides_set_what_they_say():
    scene = column(loop=True)
    knob = knobs(scene)
    setting = knob.own.turned("cells", 0.5).turned("degree", 2).turned("points", 1)
    setting = setting.turned("sweep", 0.0).turned("band", 5.0).turned("lapses", 2)
    turned = knob.scene_with(setting.turned("loop", 1e-3))
    assert [layer.cells for layer in turned.mesh.column.layers] == [2, 1]
    assert (turned.mesh.degree, turned.mesh.points_per_cell) == (2, 16)
    assert (turned.solver.sweep, turned.solver.max_frequency) == ("direct", 5.0)
    assert [s.num_samples for s in turned.segments] == [128, 128]
    assert turned.effects.equivalent_linear.tolerance == 1e-3
    assert not any(receiver.rides for receiver in turned.output.receivers.values())
    texts = text_of(knob.overrides(setting))
    assert "mesh.column.layers[1].cells=1" in texts and 'solver.sweep="direct"' in texts


def test_overrides_can_be_given_on_the_command_line(tmp_path):
    """Each text, applied as ``--set`` applies it, makes the same scene."""
    from fenics_hytf.scene.source import apply_override

    for raw in (column(), column(lapses={"duration": 5.12}), column(loop=True)):
        # no receiver that rides: those are the study's own affair
        receivers = {"receivers": {"top": [0.5, 12.0]}}
        scene = Scene.from_dict(raw.data | {"output": receivers})
        knob = knobs(scene)
        for name, values in knob.values.items():
            for value in values:
                setting = knob.own.turned(name, value)
                data = json.loads(json.dumps(scene.data))
                for text in text_of(knob.overrides(setting)):
                    assert apply_override(data, text) == []
                assert Scene.from_dict(data).hash == knob.scene_with(setting).hash


@pytest.mark.parametrize(
    ("lapses", "continuity", "law"),
    [({"count": 1}, "steady", "hysteretic"), ({"count": 2}, "transient", "maxwell")],
)
def test_another_number_of_lapses_is_not_another_law(lapses, continuity, law):
    knob = knobs(column(lapses=lapses, solver={}))
    for count in knob.values["lapses"]:
        turned = knob.scene_with(knob.own.turned("lapses", count))
        assert len(turned.segments) == count
        assert (turned.lapses.continuity, turned.solver.complex_modulus) == (continuity, law)
    named = {"lapses": {"continuity": continuity}, "solver": {"complex_modulus": law}}
    knob = knobs(column(lapses=lapses | named["lapses"], solver=named["solver"]))
    assert knob.overrides(knob.own.turned("lapses", 4)) == {("lapses", "count"): 4}


def test_only_knobs_that_the_scene_has():
    linear, looped = knobs(column()), knobs(column(loop=True))
    assert "loop" not in linear.values and set(looped.values) == {*KNOBS} - {"step"}
    assert linear.best("lapses") == 1 and looped.best("lapses") == looped.own.lapses
    sine = {"amplitude": 1.0, "frequency": 2.0, "cycles": 1, "samples": 64}
    one_line = knobs(column(motion=[{"direction": "x", "harmonic": sine}]))
    assert "band" not in one_line.values  # no band is without its line, or has another


def test_coarse_meshes_that_are_the_same_count_once():
    layers = [{"thickness": 6.0, "soil": "sand", "cells": 1}]
    mesh = {"column": {"width": 1.0, "layers": layers}}
    receivers = {"receivers": {"top": [0.5, 6.0]}}
    assert knobs(column(mesh=mesh, output=receivers)).values["cells"] == (1.0, 2.0, 4.0)


def test_a_finer_run_that_costs_too_much_is_left_out():
    knob = knobs(column())
    cheap, dear = 1e-3, 1e3
    assert affordable(knob, Costs(knob, cheap), cheap, FINE).cells == 4.0
    fine = affordable(knob, Costs(knob, dear), dear, FINE)
    assert Costs(knob, dear).predict(fine) <= FINE[0] * dear
    assert fine != affordable(knob, Costs(knob, cheap), cheap, FINE)
    assert all(
        knob.values[k].index(getattr(fine, k)) >= knob.values[k].index(getattr(knob.own, k))
        for k in knob.values
    )
    assert left_out(knob, fine) and not left_out(
        knob, affordable(knob, Costs(knob, cheap), cheap, FINE)
    )


def test_no_knob_is_coarser_than_the_scenes_own_where_direct_sweeps_fail():
    knob = knobs(column(solver={"sweep": "reduced", "tolerance": 1e-8}))
    knob.leave_out("sweep", 0.0)
    dear = 1e3
    assert affordable(knob, Costs(knob, dear), dear, (0.5, 15.0)).sweep == 1e-8


def test_prediction_of_what_acts_alone_is_exact():
    """Responses made of additive parts and costs made of factors are foretold to rounding."""
    knob = knobs(column())
    rng = np.random.default_rng(0)
    base = rng.normal(size=(1, 1, 300))
    parts = {
        (k, v): 0.05 * rng.normal(size=base.shape) for k in knob.values for v in knob.values[k]
    }
    factor = {key: float(rng.uniform(0.5, 2)) for key in parts}
    fine = knob.own

    def outcome(setting):
        turned = [(k, getattr(setting, k)) for k in setting.differing(fine)]
        seconds = float(np.prod([factor[key] for key in turned]))
        response = base + sum((parts[key] for key in turned), np.zeros_like(base))
        return Outcome(Cost(seconds, seconds, 1, 1, 1, 1, 1), response)

    run = [fine, *(fine.turned(k, v) for k in knob.values for v in knob.values[k])]
    measure = Yardstick(base + 0.01, 0.01, ["top"])
    prediction = Prediction(fine, {s: outcome(s) for s in run}, measure)
    both = fine.turned("sweep", 1e-2).turned("band", knob.values["band"][0])
    forecast = prediction.forecast(both)
    assert forecast.core_s == pytest.approx(outcome(both).cost.core_s)
    assert forecast.relative_l2 == pytest.approx(measure.error(outcome(both).response).relative_l2)
    assert prediction.forecast(fine.turned("degree", 2).turned("cells", 4.0)) is None
    assert both in {forecast.setting for forecast in prediction.everything()}


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0])
def test_richardson_finds_what_is_left(order):
    knob = knobs(column())
    fine = knob.own.turned("cells", 2.0).turned("degree", 2)
    error = {size: 0.01 * (2.0 / size) ** order for size in knob.values["cells"]}
    distance = {fine.turned("cells", h): error[h] - error[2.0] for h in (0.25, 0.5, 1.0, 2.0)}
    assert uncertainty(knob, fine, fine, distance)["cells"] == pytest.approx(error[2.0])
    finer = uncertainty(knob, fine, fine.turned("cells", 4.0), distance)
    assert finer["cells"] == pytest.approx(error[4.0])


def test_a_linear_column_against_its_closed_form(no_twin, tmp_path, figure):
    scene = column()
    told = []
    study = conduct(scene, "quadrilateral", in_process, told.append)
    assert study.complete and study.finest is None
    assert study.reference.text.startswith("closed form") and study.reference.uncertainty == 0
    # its error is the one against the closed form, of the scene as it is
    measure = Yardstick(closed_form(scene), scene.dt, list(scene.output.receivers))
    data = scene.data | {"output": {"receivers": {"top": [0.5, 12.0], "mid": [0.5, 6.0]}}}
    found = measure.error(simulate(Scene.from_dict(data)).history("total_acceleration"))
    assert study.own.error == found
    best = min(p.error.relative_l2 for p in study.points)
    figure("linear column: finest setting against the closed form", best, 1e-4)
    families = {name for point in study.points for name in point.families}
    assert {"cells", "degree", "sweep", "band", "lapses", "from own", "candidate"} <= families
    assert [report.done for report in told] == sorted(report.done for report in told)
    assert all(report.done < report.planned for report in told)
    write_tables(tmp_path, study)
    draw_study(study, tmp_path / "accuracy.png")
    rows = (tmp_path / "accuracy.csv").read_text().splitlines()
    assert len(rows) == len(study.points) + 1
    record = json.loads((tmp_path / "accuracy.json").read_text())
    assert record["sentences"][0].startswith("5 %: cheapest is")
    assert "mesh size alone" in table(study) and twin_table(study) == ""


def test_a_target_is_met_by_the_cheapest_that_was_run(no_twin):
    study = conduct(column(), "quadrilateral", in_process)
    for sentence, target in zip(study.sentences, (0.05, 0.01, 0.001), strict=False):
        good = [p for p in study.points if p.error and p.error.relative_l2 <= target]
        assert min(good, key=lambda p: p.cost.core_s).name in sentence
    assert sum("bottleneck" in sentence for sentence in study.sentences) == 1


def test_without_a_closed_form_the_finest_run_and_its_doubt(no_twin, figure):
    study = conduct(column(loop=True), "quadrilateral", in_process)
    assert study.finest is not None and study.finest not in study.points
    assert study.reference.text.startswith("finest run")
    assert set(study.reference.parts) == {"cells", "loop"}
    # A mesh twice as fine as the finest: the reference is off by about what it says it is.
    knob = knobs(column(loop=True))
    finer = knob.own.turned("cells", 8.0).turned("degree", 2).turned("sweep", 0.0)
    finer = finer.turned("band", knob.nyquist).turned("loop", 1e-6)
    scene = knob.scene_with(finer)
    measure = Yardstick(simulate(scene).history("total_acceleration"), scene.dt, ["top", "mid"])
    finest = knob.own.turned("cells", 4.0).turned("degree", 2).turned("sweep", 0.0)
    finest = finest.turned("band", knob.nyquist).turned("loop", 1e-5)
    off = measure.error(simulate(knob.scene_with(finest)).history("total_acceleration"))
    ratio = off.relative_l2 / study.reference.uncertainty
    # of the second order, three quarters of the error show between it and a mesh twice as fine
    figure(
        "equivalent-linear column: reference's error over its estimate, at least",
        ratio,
        0.4,
        at_least=True,
    )
    figure("equivalent-linear column: reference's error over its estimate, at most", ratio, 1.5)


def test_a_point_that_fails_loses_nothing_else(no_twin):
    def failing(job, limit=None):
        if job.scene.mesh.degree == 2:
            return Outcome(None, None, "no memory")
        return in_process(job, limit)

    study = conduct(column(), "quadrilateral", failing)
    failed = [p for p in study.points if p.failure]
    assert failed and all(p.words["degree"] == "degree 2" for p in failed)
    assert any("cells" in p.families and p.error for p in study.points)
    assert study.sentences[0].startswith("5 %")


def test_a_scene_that_cannot_be_run_is_no_study():
    with pytest.raises(StudyError, match="the scene itself cannot be run: no luck"):
        conduct(column(), "quadrilateral", lambda job, limit=None: Outcome(None, None, "no luck"))


def test_what_is_measured_when_the_budget_ends_is_told(no_twin):
    left = [12]

    def spending(job, limit=None):
        left[0] -= 1
        if left[0] < 0:
            raise BudgetSpent("spent")
        return in_process(job, limit)

    study = conduct(column(), "quadrilateral", spending)
    assert not study.complete and "not complete: spent" in study.notes
    assert len(study.points) == 12 and study.sentences


def test_a_budget_that_is_spent_at_once_measures_nothing():
    def spent(job, limit=None):
        raise BudgetSpent("spent")

    with pytest.raises(StudyError, match="nothing is measured yet; not complete: spent"):
        conduct(column(), "quadrilateral", spent)
