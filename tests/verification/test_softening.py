# SPDX-License-Identifier: MIT
"""A slope that gives way as it softens, with points that move and a free surface that does."""

import numpy as np
import pytest
from support.sliding import slope

import fenics_hytf.simulation.run as steps
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate

CURVES = {"model": "darendeli", "plasticity_index": 15, "mean_stress": 60e3, "ocr": 1}
OFF = {"sliding": False}


def softening_slope(lapses: int, **effects) -> Scene:
    loop = {"tolerance": 3e-3}
    data = slope(lapses=lapses, equivalent_linear=loop, softening=True, **OFF, **effects)
    data["soil"]["clay"]["curves"] = CURVES
    data["motion"][0]["harmonic"]["amplitude"] *= 0.3  # an equivalent-linear loop's worth
    return Scene.from_dict(data)


def test_points_move_by_what_the_slope_gives_way(figure, monkeypatch):
    """Its surface goes along, and what moved ground leaves out of balance is no worse for it."""
    off_balance = []
    soften = steps.Run.soften

    def watched(run, solved):
        statics = run.statics

        def imbalance() -> np.ndarray:
            return statics.unknowns.collect(statics.imbalance(run.points)).array_r.real.copy()

        before = imbalance()
        given_way = soften(run, solved)
        weight = statics.unknowns.collect(statics.weight_of(run.points)).norm()
        off_balance.append(np.linalg.norm(imbalance() - before) / weight)
        return given_way

    still = simulate(softening_slope(4)).lapses[-1].softening
    monkeypatch.setattr(steps.Run, "soften", watched)
    shown = []
    moves = {"convection": True, "geometric_stiffness": True}
    result = simulate(softening_slope(4, **moves), snapshot=shown.append)
    told, points = result.lapses[-1].softening, shown[-1].points

    figure("softening slope: change of imbalance, of weight", max(off_balance), 1e-10)
    permanent, vibration = points["permanent_displacement"], points["dynamic_displacement"]
    assert np.linalg.norm(permanent, axis=1).max() == pytest.approx(told.largest, rel=1e-12)
    crest, toe = told.displacement
    assert crest[0] > 0 > crest[1] and toe[0] > 0  # downslope, down at the crest
    # What vibration leaves out at seams is 2e-5 of it.
    off = np.abs(points["displacement"] - vibration - permanent).max() / told.largest
    figure("softening slope: points off vibration and permanent displacement", off, 1e-4)
    # Points that move 0.5 mm and a K_NL of ρgH/G = 0.002 change little.
    off = np.abs(told.displacement - still.displacement).max() / still.largest
    figure("softening slope: against points that stay", off, 0.01)
    filled = result.lapses[-1].cells.fill > 0
    assert (told.softest[filled] < 1).all() and (told.softest[~filled] == 1).all()


def test_the_number_of_lapses_hardly_matters(figure):
    """Seams of ten cut the strongest swing, and moduli follow the strain of a lapse."""
    one, ten = (simulate(softening_slope(n)).lapses[-1].softening for n in (1, 10))
    off = np.abs(ten.displacement - one.displacement).max() / one.largest
    figure("softening slope: ten lapses against one", off, 0.05)
