# SPDX-License-Identifier: MIT
"""Hard case 33, the half of it that slides: guards what a mechanism carries along.

Naively what slips is stress, a block, or begins anew in every lapse, and a cell without a point is
a hole. Static u = λφ to round-off; a rigid block slips as Newmark's; slip is the same in 1 to 32
lapses, wherever their seams lie and however short they are; a march of 2e4 steps stays bounded; k_y
does not see the cell. Softening is in ``test_softening.py``.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import fftconvolve
from support.cells import empty_a_cell
from support.sliding import GRAVITY, column, in_file, open_energy, sine, slope, total
from support.two_masses import LIMIT, STEP, TwoMasses, burst, linear_driving

import fenics_hytf.simulation.run as steps
from fenics_hytf.motion import Segment, march, straight_lines
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import Result, simulate

PEAK = 0.5  # g


# ---------------------------------------------------------------- static slip


@pytest.mark.parametrize("kind", ["column", "slope"])
def test_33_what_has_slipped_has_no_stress(kind, tmp_path, figure):
    """After a quiet end all displacement is λφ, and stress and strain of w are gone."""
    wave = PEAK * GRAVITY * np.sin(2 * np.pi * 0.01 * np.arange(200))
    motion = in_file(tmp_path, np.concatenate([-wave, np.zeros(600)]), 0.01)
    viscous = {"beta": 0.03}  # half of critical damping, and more above the first mode
    if kind == "column":
        case = column(motion, 0.25, 200.0, height=10.0, cells=5, rayleigh=viscous, lapses=4)
    else:
        data = slope(lapses=4, rayleigh=viscous) | {"motion": [motion]}
        data["soil"]["clay"]["damping"] = 0.0
        case = Scene.from_dict(data)
    shown = []
    result = simulate(case, snapshot=shown.append)
    slip, points = total(result), shown[-1].points
    assert slip > 0.1
    end = np.linalg.norm(result.history("displacement")[..., -1], axis=1)
    if kind == "column":  # its top goes along with all of λ
        figure("static slip: u off λφ", abs(end[0] / slip - 1), 1e-10)
    strain = np.abs(points["dynamic_strain"]).max()
    figure("static slip: strain of w over λ", strain / slip, 1e-10)
    w = np.abs(points["dynamic_displacement"]).max()
    figure("static slip: w over λ", w / slip, 1e-10)


# ---------------------------------------------------------------- a rigid block


def newmark(k_y: float, cycles: int) -> float:
    """Slip of a rigid block under sines of 1 Hz, which comes to rest in each [m]."""
    w, a, limit = 2 * np.pi, PEAK * GRAVITY, k_y * GRAVITY
    start = np.arcsin(k_y / PEAK) / w

    def rate(t: float) -> float:
        return a / w * (np.cos(w * start) - np.cos(w * t)) - limit * (t - start)

    rest = brentq(rate, 0.5 - start, 1.0 + start)
    falls = a / w * np.cos(w * start) * (rest - start)
    falls -= a / w**2 * (np.sin(w * rest) - np.sin(w * start)) + limit * (rest - start) ** 2 / 2
    return float(cycles * falls)


def test_33_a_rigid_block_slips_as_newmarks(figure):
    """Flexible columns slip more by what goes with their period squared; with none, as Newmark."""
    assert newmark(0.25, 5) == pytest.approx(0.7863, abs=5e-5)
    excess = []
    for speed in (500.0, 1000.0, 2000.0):
        case = column(
            sine(5, 1000),
            0.25,
            speed,
            height=5.0,
            cells=3,
            weak=0.05,
            damping=0.05,
            sliding={"time_step": 0.005},
        )
        result = simulate(case)
        slip = result.lapses[0].slip
        # The search leaves 1e-4 of the dissipation, and what shears besides the weak cell.
        assert slip.yield_coefficient == pytest.approx(0.25, rel=1e-3)
        share = slip.mass / slip.modal_mass  # the weak cell moves in part
        exact = newmark(slip.yield_coefficient, 5)
        figure("rigid block, 0.7863 m", abs(slip.rigid / share / exact - 1), 1e-3)
        excess.append(total(result) / share / exact - 1)
    figure("column of 5 m, Vs 2000 m/s: slip off the block's", abs(excess[2]), 1e-3)
    rigid = (4 * excess[2] - excess[1]) / 3
    figure("infinitely stiff column: slip off the block's", abs(rigid), 1e-3)
    assert (excess[0] - rigid) / (excess[1] - rigid) == pytest.approx(4.0, abs=0.6)


# ---------------------------------------------------------------- a long march


def test_33_a_march_of_20000_steps_stays_bounded(figure):
    """Naively an impulse response is sampled: by plain collocation that explodes to 1e12.

    The slip is that of two masses on a seam marched in time, at the end of 100 s as in between.
    """
    system, num = TwoMasses(0.0), 20_000
    drive = np.where(np.arange(num) < 0.7 * num, burst(STEP, 101.0)[:num], 0.0)
    driving = linear_driving(system, drive, STEP)
    weights = system.weights(num, STEP)
    history = march(driving, LIMIT, weights, STEP)
    exact = system.elastoplastic(straight_lines(drive, 2), STEP / 2, LIMIT)
    assert exact > 10.0
    figure("20 000 steps: slip", abs(history.slip[-1] / exact - 1), 5e-3)
    # at rest once the shaking is over
    figure("20 000 steps: slip after the end", np.ptp(history.slip[int(0.8 * num) :]), 0.0, "m")
    force = driving - fftconvolve(weights, history.acceleration)[:num]
    figure("20 000 steps: largest force over Q_y, above 1", force.max() / LIMIT - 1, 1e-9)
    # what is left is free vibration, which fades
    fading = np.abs(force[int(0.75 * num) :].reshape(10, -1)).max(axis=1)
    figure("20 000 steps: growth of what rings", (fading[1:] / fading[:-1]).max(), 1.0)


# ---------------------------------------------------------------- lapses

LAWS = {"maxwell 5 %": {"damping": 0.05}, "viscous 1 %": {"rayleigh": {"beta": 1.9e-3}}}


@cache
def column_in(lapses: int, law: str) -> Result:
    """A column of 30 m, Vs 200 m/s, that slips more than two seconds out of five."""
    return simulate(column(sine(5, 1000), 0.17348, 200.0, lapses=lapses, **LAWS[law]))


@pytest.mark.parametrize(
    ("law", "lapses"),
    [*(("maxwell 5 %", n) for n in (2, 4, 8, 16, 32)), ("viscous 1 %", 4), ("viscous 1 %", 32)],
)
def test_33_a_column_slips_alike_in_any_lapses(law, lapses, figure):
    """Naively λ̇ is dropped at seams: 0.56 to 1.14 of the slip."""
    once, several = column_in(1, law), column_in(lapses, law)
    within = [lapse.slip.rate[-1] > 0 for lapse in several.lapses]
    assert lapses < 16 or sum(within) > lapses / 4  # seams while it slips
    figure(
        "column in 2 to 32 lapses: slip against one", abs(total(several) / total(once) - 1), 5e-3
    )
    figure("column in 2 to 32 lapses: energy left open", abs(open_energy(several)), 0.01)


@pytest.mark.parametrize("lapses", [4, 10])
def test_33_a_slope_slips_alike_in_any_lapses(lapses, figure):
    """The same in two dimensions, with a mechanism that is sought anew in every lapse."""
    once, several = (simulate(Scene.from_dict(slope(lapses=n))) for n in (1, lapses))
    figure(
        "slope in 4 and 10 lapses: slip against one", abs(total(several) / total(once) - 1), 5e-3
    )
    figure("slope in 4 and 10 lapses: energy left open", abs(open_energy(several)), 0.01)


@cache
def cut_at(*seams: int, cohesion: float = 16e3) -> Result:
    """The small slope with seams after so many samples of 200."""

    def segments(run):
        for index, (start, stop) in enumerate(pairwise((0, *seams, 200))):
            yield Segment(index, start, stop - start)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steps.Run, "segments", segments)
        return simulate(Scene.from_dict(slope(cohesion, lapses=2)))


@pytest.mark.parametrize("seam", [54, 58, 62, 70])
def test_33_a_seam_may_lie_anywhere(seam, figure):
    """It begins to slip at sample 53, moves fastest at 62, and rests at 72."""
    off = abs(total(cut_at(seam)) / total(cut_at(100)) - 1)
    figure("slope with a seam anywhere: slip", off, 5e-3)


@pytest.mark.parametrize("short", [2, 5, 15])
def test_33_a_short_lapse_is_not_felt(short, figure):
    """As is left where a new mechanism was due: what comes after must not be felt as an end."""
    expected, found = (
        cut_at(*seams, cohesion=1e6).history("displacement")
        for seams in ((100,), (60, 60 + short, 130))
    )
    off = np.abs(found - expected).max() / np.abs(expected).max()
    figure("a lapse of 2 to 15 samples: displacement", off, 2e-4)


# ---------------------------------------------------------------- cells


def test_33_a_cell_without_a_point_is_no_hole(monkeypatch, figure):
    """Its neighbours would fall into it, as a mechanism of its own, and end all other motion."""

    data = slope(convection=True, lapses=2)
    data["motion"][0]["harmonic"]["amplitude"] = 0.01
    whole = simulate(Scene.from_dict(data)).lapses[1]
    convect = steps.convect

    def left(domain, points, *arguments, **others):
        report = convect(domain, points, *arguments, **others)
        empty_a_cell(domain.mesh, points, [8.5, 2.5])  # in the slip surface
        return report

    monkeypatch.setattr(steps, "convect", left)
    gap = simulate(Scene.from_dict(data)).lapses[1]
    off = abs(gap.slip.yield_coefficient / whole.slip.yield_coefficient - 1)
    # What the points weigh is elsewhere by 0.4 m, of one cell in some 30 that slip. With a hole
    # there k_y falls by 11 %.
    figure("a cell without a point: k_y", off, 0.01)
    assert gap.cells.fill.max() < 1.01
