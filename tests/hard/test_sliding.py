# SPDX-License-Identifier: MIT
"""Hard case 33, the half of it that slides: guards what a mechanism carries along.

Naively what slips is stress, a block, or begins anew in every lapse, and a cell without a point is
a hole. Static u = λφ to round-off; a rigid block slips as Newmark's; slip is the same in 1 to 32
lapses, wherever their seams lie and however short they are; k_y does not see the cell. That a march
of 2e4 steps stays bounded is seen in the tests of its room. Softening is in ``test_softening.py``.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq
from support.cells import empty_a_cell
from support.sliding import GRAVITY, column, in_file, open_energy, sine, slope, total

import fenics_hytf.simulation.run as steps
from fenics_hytf.motion import Segment
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
        figure("case 33, static slip of a column: u off λφ", abs(end[0] / slip - 1), 1e-10)
    strain = np.abs(points["dynamic_strain"]).max()
    figure(f"case 33, static slip of a {kind}: strain over λ", strain / slip, 1e-10)
    w = np.abs(points["dynamic_displacement"]).max()
    figure(f"case 33, static slip of a {kind}: w over λ", w / slip, 1e-10)


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


def test_33_a_rigid_block(figure):
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
        figure("case 33, rigid block beside", abs(slip.rigid / share / exact - 1), 1e-3)
        excess.append(total(result) / share / exact - 1)
    figure("case 33, column of 5 m, Vs 2000 m/s: slip off Newmark's", abs(excess[2]), 1e-3)
    rigid = (4 * excess[2] - excess[1]) / 3
    figure("case 33, slip of an infinitely stiff one", abs(rigid), 1e-3)
    assert (excess[0] - rigid) / (excess[1] - rigid) == pytest.approx(4.0, abs=0.6)


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
def test_33_a_column_in_lapses(law, lapses, figure):
    """Naively λ̇ is dropped at seams: 0.56 to 1.14 of the slip."""
    once, several = column_in(1, law), column_in(lapses, law)
    within = [lapse.slip.rate[-1] > 0 for lapse in several.lapses]
    assert lapses < 16 or sum(within) > lapses / 4  # seams while it slips
    said = f"case 33, column, {law}, {lapses} lapses"
    figure(f"{said}: slip against one", abs(total(several) / total(once) - 1), 5e-3)
    figure(f"{said}: energy left open", abs(open_energy(several)), 0.01)


@pytest.mark.parametrize("lapses", [4, 10])
def test_33_a_slope_in_lapses(lapses, figure):
    once, several = (simulate(Scene.from_dict(slope(lapses=n))) for n in (1, lapses))
    said = f"case 33, slope in {lapses} lapses"
    figure(f"{said}: slip against one", abs(total(several) / total(once) - 1), 5e-3)
    figure(f"{said}: energy left open", abs(open_energy(several)), 0.01)


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
def test_33_a_seam_anywhere(seam, figure):
    """It begins to slip at sample 53, moves fastest at 62, and rests at 72."""
    off = abs(total(cut_at(seam)) / total(cut_at(100)) - 1)
    figure(f"case 33, slope, seam at sample {seam}: slip", off, 5e-3)


@pytest.mark.parametrize("short", [2, 5, 15])
def test_33_a_short_lapse(short, figure):
    """As is left where a new mechanism was due: what comes after must not be felt as an end."""
    expected, found = (
        cut_at(*seams, cohesion=1e6).history("displacement")
        for seams in ((100,), (60, 60 + short, 130))
    )
    off = np.abs(found - expected).max() / np.abs(expected).max()
    figure(f"case 33, a lapse of {short} samples: displacement", off, 2e-4)


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
    figure("case 33, a cell without a point: k_y", off, 0.01)
    assert gap.cells.fill.max() < 1.01
