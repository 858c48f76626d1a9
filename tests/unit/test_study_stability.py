# SPDX-License-Identifier: MIT
"""Stability maps: how runs are judged, what against, and what the kept maps bear out."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from support.stability import read_runs

from fenics_hytf.lapse import HANDOVER, Energy
from fenics_hytf.scene import ABOVE_BAND, PERIODS
from fenics_hytf.simulation import margins, simulate
from fenics_hytf.study.stability.block import block_jobs
from fenics_hytf.study.stability.column import ColumnCase
from fenics_hytf.study.stability.conduct import conduct_stability, plan
from fenics_hytf.study.stability.contrast import contrast_jobs
from fenics_hytf.study.stability.figures import FIGURES, draw_stability
from fenics_hytf.study.stability.lapses import DEFAULT_DECAY, frequency_jobs, lapse_jobs
from fenics_hytf.study.stability.records import BLOCK, CONTRAST, FREQUENCY, LAPSES, StabilityRun
from fenics_hytf.study.stability.reference import true_motion
from fenics_hytf.study.stability.table import TABLE, summary, write_runs
from fenics_hytf.study.stability.verdicts import (
    SINGULAR,
    SMALL,
    SMALL_RESPONSE,
    Verdict,
    judge_history,
    judge_response,
    judge_solution,
    measure_history,
)

DEMOS = Path(__file__).parents[2] / "demos"

# ---------------------------------------------------------------- verdicts

TIME = np.linspace(0.0, 12.0, 1201)
STILL = 400
TRUE = (np.exp(-0.4 * TIME) * np.sin(9.0 * TIME))[None]


def balance(lacking: float, pumped: float = 0.0) -> list[Energy]:
    """Two lapses into each of which 1 J comes, a part lacking, another brought by moduli."""
    return [Energy(1.0, 1.0 - lacking, 0.0, (0.0, 0.0), (0.0, 0.0), pumped)] * 2


HISTORIES = {
    "exact": (TRUE, 0.0, Verdict.CONVERGES),
    "half a per cent off": (1.005 * TRUE, 0.0, Verdict.CONVERGES),
    "three per cent off": (1.03 * TRUE, 0.0, Verdict.DRIFTS),
    "late by half a period": (-TRUE, 0.0, Verdict.DRIFTS),
    "of lost energy": (TRUE, 0.03, Verdict.DRIFTS),
    "three times as large": (3.0 * TRUE, 0.0, Verdict.BLOWS_UP),
    "smaller, but growing by itself": (
        TRUE + 1e-4 * np.exp(0.7 * TIME) * np.sin(50.0 * TIME),
        0.0,
        Verdict.BLOWS_UP,
    ),
    "growing below what counts": (TRUE + 1e-6 * np.exp(0.7 * TIME), 0.0, Verdict.CONVERGES),
    "no number": (np.where(TIME > 11.0, np.nan, TRUE), 0.0, Verdict.BLOWS_UP),
    "beyond numbers": (np.where(TIME > 11.0, np.inf, TRUE), 0.0, Verdict.BLOWS_UP),
}


@pytest.mark.parametrize("name", HISTORIES)
def test_a_history_is_judged_by_its_error_its_energy_and_its_growth(name):
    found, lacking, verdict = HISTORIES[name]
    figures = measure_history(found, TRUE, STILL, balance(lacking))
    assert judge_history(figures) == verdict


def test_the_figures_of_a_history_are_what_they_are_called():
    found = 1.03 * TRUE
    figures = measure_history(found, TRUE, STILL, balance(0.01, 0.5))
    assert figures["error"] == pytest.approx(0.03)
    assert figures["amplitude_over_true"] == pytest.approx(1.03)
    assert figures["energy_of_changes"] == pytest.approx(0.5)
    # Both fade below what counts in still time, by 3 % apart.
    assert figures["growth_over_true"] == pytest.approx(1.0, abs=0.03)
    assert figures["energy_imbalance"] == pytest.approx(0.01)


def test_a_motion_that_moduli_pump_up_is_told_from_one_that_blows_up():
    """It is right, but no longer what the shaking does."""
    figures = measure_history(TRUE, TRUE, STILL, balance(0.0, 2.1))
    assert figures["error"] == 0.0 and judge_history(figures) == Verdict.PUMPS
    wrong = measure_history(3.0 * TRUE, TRUE, STILL, balance(0.0, 2.1))
    assert judge_history(wrong) == Verdict.BLOWS_UP
    fallen = measure_history(TRUE, TRUE, STILL, balance(0.0, -2.1))
    assert judge_history(fallen) == Verdict.CONVERGES


@pytest.mark.parametrize(
    ("error", "amplitude", "condition", "verdict"),
    [
        (0.05, 1.0, 1e3, Verdict.CONVERGES),
        (0.2, 1.0, 1e3, Verdict.DRIFTS),
        (0.2, 2.5, 1e3, Verdict.BLOWS_UP),
        (0.05, 1.0, 10 * SINGULAR, Verdict.BLOWS_UP),
        (0.05, 1.0, np.nan, Verdict.BLOWS_UP),
    ],
)
def test_a_response_is_judged_by_error_amplitude_and_condition(
    error, amplitude, condition, verdict
):
    assert judge_response(error, amplitude, condition) == verdict


def test_a_sweep_that_refuses_stops_and_one_that_is_wrong_unawares_drifts():
    found = [judge_solution(error) for error in (None, 1e-9, 0.1, np.nan)]
    assert found == [Verdict.STOPS, Verdict.CONVERGES, Verdict.DRIFTS, Verdict.BLOWS_UP]


# ---------------------------------------------------------------- columns


def test_the_true_motion_is_that_of_one_lapse(figure):
    """The integration in time knows nothing of contours; one lapse knows nothing of seams."""
    case = ColumnCase(10.0, 0.05)
    one = simulate(case.scene, MPI.COMM_SELF).history("displacement")[:, 0]
    true = true_motion(case)[:, : one.shape[1]]
    error = np.abs(one - true).max() / np.abs(true).max()
    figure("true motion of a column against one lapse: displacement", error, 1e-4)


def test_moduli_fall_while_the_ground_shakes_and_then_stay():
    case = ColumnCase(10.0, 0.05, 0.1)
    ratios, starts = case.ratios, np.array([segment.start for segment in case.segments])
    still = starts >= case.segments[-1].stop - case.still
    assert ratios[0] == 1.0 and np.all(ratios[still] == pytest.approx(0.1))
    assert np.all(np.diff(ratios) <= 0)
    steps = ratios[1:][~still[1:]] / ratios[:-1][~still[1:]]
    assert steps == pytest.approx(steps[0])


def test_moduli_swing_while_the_ground_shakes_and_end_as_they_began():
    case = ColumnCase(10.0, 0.05, 0.1, "swings")
    assert list(case.ratios[:4]) == [1.0, 0.1, 1.0, 0.1] and case.ratios[-1] == 1.0


def test_a_column_is_cut_where_a_scene_may_not_be():
    """The map goes beyond the rules, which a scene is held to."""
    case = ColumnCase(5.0, 0.05, above_band=1.0)
    assert case.max_frequency * case.length * case.scene.dt < PERIODS
    assert case.cut_above_band < ABOVE_BAND
    motion, ledgers = case.march(DEFAULT_DECAY)
    assert np.isfinite(motion).all() and len(ledgers) == len(case.segments) > 1


def test_the_rule_is_met_by_a_column_and_a_contour_too_damped_blows_up(figure):
    case = ColumnCase(PERIODS, 0.05)
    true = true_motion(case)
    judged = []
    for decay in (DEFAULT_DECAY, 3 * DEFAULT_DECAY):
        motion, ledgers = case.march(decay)
        judged.append(measure_history(motion, true, case.still, ledgers))
    assert [judge_history(f) for f in judged] == [Verdict.CONVERGES, Verdict.BLOWS_UP]
    figure("a column at the rule of ten periods: displacement", judged[0]["error"], SMALL / 10)


def test_marching_ends_where_nothing_is_left_to_see():
    """Squares of what has blown up would be beyond numbers, and the ledger a warning."""
    case = ColumnCase(2.5, 0.0, 0.01, "swings")
    motion, ledgers = case.march(3 * DEFAULT_DECAY)
    assert len(ledgers) < len(case.segments) and np.isinf(motion[:, -1]).any()


# ---------------------------------------------------------------- a small map

SMALL_MAP = [
    *lapse_jobs((10.0,), (0.05,), falls=(0.1,), swings=(0.3, 0.01), decay=(DEFAULT_DECAY, 6.9)),
    *frequency_jobs((10.0,), (0.05,), falls=(1.0,), above_band=(2.0,)),
    *block_jobs(fill=(1.0, 1e-4), waves=(30.0, 8.0)),
    *contrast_jobs(("rock on soil",), contrast=(1.0, 1e8), damping=(0.05,)),
]


@pytest.fixture(scope="module")
def small() -> list[StabilityRun]:
    said = []
    jobs = list(conduct_stability(lambda p: said.append((p.done, p.planned)), SMALL_MAP))
    done = np.cumsum([0, *(len(job) for job in jobs)])
    assert said == [(before, done[-1]) for before in done[:-1]]
    return [run for job in jobs for run in job]


def test_a_small_map_has_every_verdict_where_it_belongs(small):
    def verdicts(name, **axes):
        mine = [r for r in small if r.map == name]
        return {r.verdict for r in mine if all(r.axes[k] == v for k, v in axes.items())}

    own = {"eta_lapse": DEFAULT_DECAY}
    assert verdicts(LAPSES, modulus_left=0.1, **own) == {Verdict.CONVERGES}
    assert verdicts(LAPSES, modulus_left=0.3, **own) == {Verdict.CONVERGES}
    assert verdicts(LAPSES, modulus_left=0.01, **own) == {Verdict.PUMPS}
    assert verdicts(LAPSES, eta_lapse=6.9, path="swings") == {Verdict.BLOWS_UP}
    assert verdicts(FREQUENCY) == {Verdict.CONVERGES}
    assert verdicts(BLOCK, cells_a_wavelength=30.0, ghost="yes") == {Verdict.CONVERGES}
    assert verdicts(BLOCK, fill=1e-4, ghost="no") == {Verdict.BLOWS_UP}
    assert verdicts(BLOCK, fill=1e-4, cells_a_wavelength=8.0, ghost="yes") == {Verdict.DRIFTS}
    assert verdicts(CONTRAST, contrast=1.0) == {Verdict.CONVERGES}
    assert verdicts(CONTRAST, contrast=1e8) == {Verdict.STOPS}


def test_a_map_is_written_read_and_drawn(small, tmp_path):
    write_runs(tmp_path / TABLE, small)
    back = read_runs(tmp_path / TABLE)
    assert [(r.map, r.verdict) for r in back] == [(r.map, r.verdict) for r in small]
    for read, written in zip(back, small, strict=True):
        for name, value in written.axes.items():
            expected = value if isinstance(value, str) else pytest.approx(value, rel=1e-5)
            assert read.axes[name] == expected
    assert draw_stability(back, tmp_path) == list(FIGURES.values())
    for name in FIGURES.values():
        assert (tmp_path / name).read_bytes()[:4] == b"\x89PNG"
    told = summary(back)
    assert "fill × frequency: 8 runs" in told and "stop with an error" in told


# ---------------------------------------------------------------- the kept maps


@pytest.fixture(scope="module")
def kept() -> list[StabilityRun]:
    return read_runs(DEMOS / TABLE)


def of(runs: list[StabilityRun], name: str, **axes) -> list[StabilityRun]:
    mine = [run for run in runs if run.map == name]
    return [r for r in mine if all(r.axes[key] == value for key, value in axes.items())]


def worst(runs: list[StabilityRun], name: str = "error") -> float:
    return max(float(run.figures[name] or 0.0) for run in runs)


def test_the_kept_maps_are_whole(kept, figure):
    assert len(kept) == sum(job.planned for job in plan())
    assert all((DEMOS / name).exists() for name in FIGURES.values())
    figure("runs of a column in the kept map", len(of(kept, LAPSES)), 200, at_least=True)
    seconds = sum(run.cpu_s for run in kept)
    figure("CPU time of all maps but for references", seconds, 900.0, "s")


@pytest.mark.parametrize(
    ("periods", "fraction", "decay"), [(10.0, 1.0, 2.3), (20.0, 0.1, 2.3), (7.0, 0.01, 4.6)]
)
def test_the_kept_map_is_what_columns_do(periods, fraction, decay, kept):
    case = ColumnCase(periods, 0.05, fraction)
    motion, ledgers = case.march(decay)
    found = measure_history(motion, true_motion(case), case.still, ledgers)
    where = {"damping": 0.05, "modulus_left": fraction, "eta_lapse": decay, "path": "falls"}
    (run,) = of(kept, LAPSES, lapse_times_max_frequency=periods, **where)
    assert run.verdict == judge_history(found)
    # Errors are small differences, that other versions of LAPACK move in their third digit.
    assert run.figures["error"] == pytest.approx(found["error"], rel=0.05)


def test_lapses_within_the_rule_converge_whatever_falls(kept, figure):
    """The rule lies inside the edge: at half its length columns drift."""
    default = of(kept, LAPSES, eta_lapse=DEFAULT_DECAY, path="falls")
    within = [r for r in default if float(r.axes["lapse_times_max_frequency"]) >= PERIODS]
    assert {r.verdict for r in within} == {Verdict.CONVERGES}
    figure("kept map, lapses within the rule: displacement", worst(within), SMALL / 3)
    half = [r for r in default if r.axes["lapse_times_max_frequency"] == PERIODS / 2]
    assert Verdict.DRIFTS in {r.verdict for r in half}


def test_the_default_contour_lies_well_inside(kept, figure):
    """A third more or less of ηT changes no verdict; from twice of it on lapses blow up."""
    safe = [
        r
        for r in of(kept, LAPSES, path="falls")
        if float(r.axes["lapse_times_max_frequency"]) >= margins.NEAR_PERIODS
    ]
    near = [r for r in safe if 0.69 <= float(r.axes["eta_lapse"]) / DEFAULT_DECAY <= 1.4]
    assert len({r.axes["eta_lapse"] for r in near}) == 3
    assert {r.verdict for r in near} == {Verdict.CONVERGES}
    own = [r for r in near if r.axes["eta_lapse"] == DEFAULT_DECAY]
    figure("kept map, default contour, safe lapses: displacement", worst(own), SMALL / 5)
    beyond = [r for r in of(kept, LAPSES) if float(r.axes["eta_lapse"]) >= 2 * DEFAULT_DECAY]
    assert Verdict.BLOWS_UP in {r.verdict for r in beyond}
    assert HANDOVER[1] / HANDOVER[0] == pytest.approx(DEFAULT_DECAY)


def test_swings_to_a_fraction_that_is_warned_of_pump_and_others_do_not(kept, figure):
    default = of(kept, LAPSES, eta_lapse=DEFAULT_DECAY, path="swings")
    allowed = [r for r in default if float(r.axes["lapse_times_max_frequency"]) >= PERIODS]
    sound = [r for r in allowed if float(r.axes["modulus_left"]) >= margins.NEAR_FRACTION]
    assert {r.verdict for r in sound} == {Verdict.CONVERGES}
    figure("kept map, swings to a tenth: energy of changes", worst(sound, "energy_of_changes"), 1.0)
    others = [r for r in allowed if float(r.axes["modulus_left"]) < margins.NEAR_FRACTION]
    assert {r.verdict for r in others} == {Verdict.PUMPS}
    # Though what they move the ground by is right, the more so the longer lapses are.
    longest = [r for r in others if r.axes["lapse_times_max_frequency"] == 40]
    figure("kept map, swings to a hundredth: displacement", worst(longest), SMALL)


def test_maximum_frequencies_within_the_rule_converge(kept, figure):
    allowed = [
        r
        for r in of(kept, FREQUENCY)
        if float(r.axes["lapse_times_max_frequency"]) >= PERIODS
        and float(r.axes["max_frequency_over_band"]) >= ABOVE_BAND
    ]
    assert {r.verdict for r in allowed} == {Verdict.CONVERGES}
    safe = [
        r
        for r in allowed
        if float(r.axes["lapse_times_max_frequency"]) >= margins.NEAR_PERIODS
        and float(r.axes["max_frequency_over_band"]) >= margins.NEAR_BAND
    ]
    figure("kept map, safe maximum frequencies: displacement", worst(safe), SMALL / 5)


def test_cut_cells_with_a_ghost_term_are_sound_at_any_fill(kept, figure):
    held = of(kept, BLOCK, ghost="yes")
    figure("kept map, cut cells with ghost: condition", worst(held, "condition"), 1e4)
    assert Verdict.BLOWS_UP not in {r.verdict for r in held}
    # At its own resonance, 50 cells a wave, the block in whole cells is off by a little more.
    whole = {
        r.axes["cells_a_wavelength"]: float(r.figures["error"] or 0.0)
        for r in held
        if r.axes["fill"] == 1
    }
    safe = [r for r in held if float(r.axes["cells_a_wavelength"]) >= margins.NEAR_WAVES]
    excess = max(float(r.figures["error"] or 0) - whole[r.axes["cells_a_wavelength"]] for r in safe)
    figure("kept map, cut cells: error over that of whole ones", excess, 0.05)
    assert {r.verdict for r in safe if whole[r.axes["cells_a_wavelength"]] <= SMALL_RESPONSE} == {
        Verdict.CONVERGES
    }
    assert Verdict.BLOWS_UP in {r.verdict for r in of(kept, BLOCK, ghost="no")}


def test_contrasts_short_of_the_warning_are_solved_by_every_sweep(kept, figure):
    for continuity, sweep in product(("steady", "transient"), ("direct", "reduced")):
        mine = of(kept, CONTRAST, continuity=continuity, sweep=sweep)
        near = margins.near_contrast(margins.DEFAULT_TOLERANCE, continuity == "transient", sweep)
        safe = [r for r in mine if float(r.axes["contrast"]) < near]
        assert {r.verdict for r in safe} == {Verdict.CONVERGES}
        figure(f"kept map, {continuity}, {sweep}, safe contrasts: error", worst(safe), 1e-6)
        beyond = [r for r in mine if float(r.axes["contrast"]) >= 100 * near]
        assert Verdict.STOPS in {r.verdict for r in beyond}
    # The edge goes with the tolerance, as the residual that doubles leave goes with the contrast.
    near = margins.near_contrast
    assert near(1e-5, False, "direct") == pytest.approx(10 * near(1e-6, False, "direct"))
    on_soil = of(kept, CONTRAST, place="rock on soil", damping=0.05)
    floors = {float(r.axes["contrast"]): float(r.figures["residual_floor"] or 0) for r in on_soil}
    assert floors[1e8] / floors[1e4] == pytest.approx(1e4, rel=0.5)


def test_no_sweep_calls_a_wrong_solution_good(kept):
    """Where contrast is too much runs stop, and say so."""
    assert {r.verdict for r in of(kept, CONTRAST)} == {Verdict.CONVERGES, Verdict.STOPS}
