# SPDX-License-Identifier: MIT
"""Surroundings that take waves, where points move and slopes slide.

Level ground between free fields goes on moving as the column does once its points have moved; what
reaches a side goes by the scene's policy; and slip on rock tends to that on a rigid base.
"""

import numpy as np
import pytest
from support.sliding import open_energy, slope, total

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import SimulationError, simulate

ROCK = {"density": 2200.0, "shear_wave_velocity": 760.0, "poisson": 0.25, "damping": 0.01}
SOIL = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3, "damping": 0.05}
BASES = {"rigid": "rigid", "rock": {"compliant": ROCK}}
HEIGHT, LEVELS = 24.0, 12
# Of 1 Hz: half a metre at the top, and a tenth of one left at the seams.
STRONG = {"synthetic": {"n": 200, "t1": 0.5, "t2": 1.0}, "pga": 6.0}


def ground(mesh: dict, side: str, base: str, **sections) -> Scene:
    """Level clay in two lapses under a motion too strong to be true."""
    motion = STRONG | {"direction": "x", "input": "within" if base == "rigid" else "outcrop"}
    data = {
        "mesh": mesh,
        "soil": {"clay": SOIL},
        "motion": [motion],
        "boundary": {"left": side, "right": side, "base": BASES[base]},
        "lapses": {"count": 2, "continuity": "transient"},
        "effects": {"convection": True},
        "solver": {"sweep": "direct"},
    }
    return Scene.from_dict(data | sections)


def section(width: float, cells: int) -> dict:
    """Level ground under two metres of air."""
    box = {"size": [width, HEIGHT + 2.0], "cells": [cells, LEVELS + 1]}
    regions = [{"soil": "clay", "below": HEIGHT}, {"soil": "air"}]
    return {"box": box, "regions": regions, "empty": ["air"]}


def column(base: str) -> Scene:
    layers = [{"thickness": HEIGHT, "soil": "clay", "cells": LEVELS}]
    mesh = {"column": {"width": 1.0, "layers": layers}}
    output = {"receivers": {"top": [0.5, HEIGHT]}}
    return ground(mesh, "tied", base, effects={}, output=output)


@pytest.mark.mpi
@pytest.mark.parametrize("base", BASES)
def test_level_ground_moves_on_as_one_between_free_fields(base, figure):
    """Points move by a twentieth of a cell; columns beyond the sides stay where they are."""
    shown = []
    output = {"receivers": {"top": [12.0, HEIGHT]}}
    case = ground(section(24.0, 6), "free_field", base, output=output)
    result = simulate(case, snapshot=shown.append)
    expected = simulate(column(base)).history("displacement")[0, 0]
    found = result.history("displacement")[0, 0]
    name = f"level ground between free fields on {base}, moving"
    peak = abs(expected).max()
    # The sides stay, and a strip beside each that is as wide as points have moved counts wrongly.
    figure(f"{name}: second lapse against the column", abs(found - expected).max() / peak, 2e-3)
    ledger = result.lapses[-1].ledger
    assert (ledger.num_points, ledger.imbalance) == (4 * 6 * LEVELS, 0.0)
    if not shown or not shown[-1].points:  # of all points, on the first rank alone
        return
    points = shown[0].points
    moved, level = points["displacement"][:, 0], np.round(points["position"][:, 1], 6)
    rows = [moved[level == y] for y in np.unique(level)]
    assert len(rows) == 2 * LEVELS and abs(moved).max() > 0.05
    uneven = max(np.ptp(row) for row in rows) / abs(moved).max()
    figure(f"{name}: points of a level after the first lapse", uneven, 1e-5)


@pytest.mark.parametrize("policy", ["error", "park", "delete"])
def test_what_reaches_a_free_field_goes_by_the_policy(policy, figure):
    """In narrow cells the ground moves out on one side, and away from the other."""
    points = {"outside": policy, "detached": policy}
    case = ground(section(6.0, 12), "free_field", "rigid", points=points)
    count, mass = 4 * 12 * LEVELS, 1800.0 * 6.0 * HEIGHT
    if policy == "error":
        with pytest.raises(SimulationError, match=r"lapse 0: Found that \d+ points left the mesh"):
            simulate(case)
        return
    shown = []
    result = simulate(case, snapshot=shown.append)
    ledger = result.lapses[-1].ledger
    gone = ledger.parked if policy == "park" else ledger.deleted
    assert 0 < gone < count / 10 and ledger.num_points == count - gone
    assert ledger.parked + ledger.deleted == gone
    kept = ledger.mass + ledger.parked_mass + ledger.deleted_mass
    figure(f"free field, points that {policy}: mass", abs(kept / mass - 1), 1e-14)
    assert all(np.isfinite(values).all() for values in shown[-1].points.values())


def on_rock(sides: str, speed: float | None, margin: float = 0.0) -> dict:
    """The small slope, moving, with more level ground beside it; on a rigid base without speed."""
    data = slope(lapses=2, convection=True, sliding={"time_step": 0.005})
    width = 24.0 + 2 * margin
    surface = [[0.0, 6.0], [8.0 + margin, 6.0], [14.0 + margin, 2.0], [width, 2.0]]
    data["mesh"]["box"] = {"size": [width, 7.0], "cells": [round(width), 7]}
    data["mesh"]["regions"][0]["polygon"] = [*surface, [width, 7.0], [0.0, 7.0]]
    data["boundary"] = {"left": sides, "right": sides}
    data["solver"]["sweep"] = "direct"
    if speed is not None:
        data["boundary"]["base"] = {"compliant": ROCK | {"shear_wave_velocity": speed}}
        data["motion"][0]["input"] = "outcrop"
    return data


def test_slip_on_rock_is_that_on_a_rigid_base_but_for_what_radiates(figure):
    """The stiffer the rock the more: short of the rigid base by what goes as its impedance."""
    speeds = (1e7, 1e5, 1e4, 3e3, 760.0, 250.0)
    rigid = simulate(Scene.from_dict(on_rock("dashpot", None)))
    rocks = [simulate(Scene.from_dict(on_rock("dashpot", speed))) for speed in speeds]
    slip = np.array([total(result) for result in rocks])
    assert (np.diff(slip) < 0).all() and slip[0] < total(rigid)
    # In the second lapse each search begins elsewhere, and is good to 1e-4 of the dissipation.
    figure("slope on rock of 1e7 m/s: slip against a rigid base", 1 - slip[0] / total(rigid), 5e-4)
    order = np.log10((slip[0] - slip[2]) / (slip[0] - slip[1]))
    figure("slope on stiff rock: order of what radiates, off 1", abs(order - 1), 0.1)
    radiated = 1 - slip[-1] / slip[0]
    figure("slope on rock of 250 m/s: slip that is lost", radiated, 0.05, at_least=True)
    for result in (rigid, *rocks):
        assert abs(open_energy(result)) < 0.01  # as for slopes in lapses
        ledger = result.lapses[-1].ledger
        assert (ledger.imbalance, ledger.parked, ledger.deleted) == (0.0, 0, 0)


def test_a_slope_that_slides_hardly_feels_free_fields(figure):
    """Sides 20 m from the slope against sides three times as far."""
    far = total(simulate(Scene.from_dict(on_rock("free_field", 760.0, 36.0))))
    off = {
        side: abs(total(simulate(Scene.from_dict(on_rock(side, 760.0, 12.0)))) / far - 1)
        for side in ("free_field", "dashpot")
    }
    figure("slope between near sides, free field: slip", off["free_field"], 0.01)
    worse = off["dashpot"] / off["free_field"]
    figure("the same with dashpots, times as much", worse, 3.0, at_least=True)


def test_what_slides_on_after_the_motion_has_level_ground_beside_it(figure):
    """A motion that is cut short while the slope moves: its free fields go on with it to rest."""
    results = []
    for side in ("free_field", "dashpot"):
        data = slope(9e3, convection=True, sliding={"time_step": 0.005, "unstable_at_rest": True})
        data["motion"][0]["harmonic"] |= {"cycles": 1, "samples": 100}
        data["boundary"] = {"left": side, "right": side}
        results.append(simulate(Scene.from_dict(data)))
    beside, without = results
    motion = beside.scene.base_acceleration.shape[1]
    assert sum(lapse.num_samples for lapse in beside.lapses) > motion
    assert beside.lapses[-1].slip.rate[-1] == 0.0
    # what is left of the vibration at the sides by then is little
    figure("slip after the motion, free field", abs(total(beside) / total(without) - 1), 0.01)
    assert total(beside) > 0.1
