# SPDX-License-Identifier: MIT
"""Sliding through whole simulations against independent references.

Columns that are marched in time as ground that yields; closed forms; and the same slope in a
mirror, on several ranks, stopped and gone on with, or too strong to slide.
"""

import dataclasses
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from mpi4py import MPI
from support.reference import load_sliding
from support.sliding import DENSITY, GRAVITY, column, in_file, open_energy, sine, slope, total

from fenics_hytf.motion import recorded, straight_lines
from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import CheckpointFolder, Result, simulate

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF

with_records = pytest.mark.skipif(
    find_spec("pyslammer") is None, reason="pyslammer, an optional extra, is not installed"
)


# ---------------------------------------------------------------- columns that yield

RECORDS = {
    "Northridge": "Northridge_1994_PAC-175",
    "Kobe": "Kobe_1995_TAK-090",
    "Loma Prieta": "Loma_Prieta_1989_HSP-000",
}
MODULUS = DENSITY * 200.0**2  # [Pa]
WEIGHTLESS = 1e-3  # [kg/m3], of the weak cell


def viscosity(speed: float) -> float:
    """β of 5 % at the period of 30 m [s]."""
    return 0.05 * 4 * 30.0 / speed / np.pi


def column_drive(case: dict) -> np.ndarray:
    """Acceleration of its inertia at steps of 5 ms, on straight lines as it is in the file."""
    time = case["dt_s"] * np.arange(case["samples"])
    if case["motion"] == "sine 1Hz x5":
        given = np.where(time < 5.0, np.sin(2 * np.pi * time), 0.0)
    else:
        record = recorded(RECORDS[case["motion"]])
        given = record.acceleration[:: 2 if record.dt < 0.01 else 1][: case["samples"]]
        given = given / given[np.argmax(np.abs(given))]
    return case["pga_g"] * GRAVITY * straight_lines(given, round(case["dt_s"] / 5e-3))


@with_records
@pytest.mark.parametrize("motion", ["sine 1Hz x5", "Northridge"])
def test_columns(motion, tmp_path, figure):
    """Up to k_y/k_max .4: above, slips are small and hang on the tips of peaks."""
    cases = [case for case in load_sliding("columns")["cases"] if case["motion"] == motion]
    cases = [case for case in cases if case["ky_over_kmax"] in (0.2, 0.4)]
    assert len(cases) == 6
    ratio = []
    for case in cases:
        scene = column(
            in_file(tmp_path, -column_drive(case), 5e-3),
            case["ky_g"],
            case["Vs"],
            weak_density=WEIGHTLESS,
            rayleigh={"beta": viscosity(case["Vs"])},
        )
        ratio.append(total(simulate(scene)) / case["slip_elastoplastic_m"])
    off = max(abs(np.array(ratio) - 1))
    figure(f"columns, {motion}: {min(ratio):.3f} to {max(ratio):.3f} of the file", off, 0.05)


ROCK = {"density": 2200.0, "shear_wave_velocity": 760.0, "poisson": 0.25}


def marched(drive: np.ndarray, dt: float, k_y: float, alpha: float, rock: float) -> float:
    """Slip of a column, Vs 200 m/s, with C = αM + βK and dashpots at its base [m].

    Fifteen cells of lumped mass on a weak spring between them and the base, which the rock moves.
    The average acceleration method with return mapping, as in ``study.sliding_column``, where there
    are no dashpots.

    Args:
        drive: Minus the acceleration of the rock [m/s2].
        dt: Its step [s].
        k_y: Of the spring.
        alpha: α [1/s].
        rock: ρV of the rock [kg/(m2 s)]; 0 for a rigid base.
    """
    cells, spring = 15, MODULUS / 0.5
    M = np.full(cells + 2, DENSITY * 2.0)
    M[[1, -1]] /= 2
    M[0] = 1.0  # the base, as good as weightless
    ends = np.diff(np.eye(cells + 2), axis=0)
    K = MODULUS / 2.0 * ends[1:].T @ ends[1:]
    C = alpha * np.diag(M) + viscosity(200.0) * K
    C[0, 0] += rock if rock else 1e15
    e, h, limit = ends[0], dt / 8, k_y * GRAVITY * M[1:].sum()
    inverse = np.linalg.inv(K + spring * np.outer(e, e) + 2 / h * C + np.diag(4 / h**2 * M))
    fine = straight_lines(drive, 8)
    u, v = np.zeros((2, len(M)))
    acceleration, slip = np.full(len(M), fine[0]), 0.0
    for a in fine[1:]:
        right = M * (a + acceleration + 4 / h * v + 4 / h**2 * u) + C @ (v + 2 / h * u)
        new = inverse @ (right + spring * slip * e)
        excess = spring * (e @ new - slip) - limit
        more = max(excess, 0.0) / (spring * (1 - spring * (e @ inverse @ e)))
        slip, new = slip + more, new + more * spring * (inverse @ e)
        before, v = v, 2 / h * (new - u) - v
        acceleration, u = 2 / h * (v - before) - acceleration, new
    return float(slip)


@pytest.mark.parametrize("lapses", [1, 8])
@pytest.mark.parametrize(("alpha", "base"), [(2.0, None), (0.0, ROCK)])
def test_dashpots(alpha, base, lapses, tmp_path, figure):
    """αM resists the mechanism as well, in a lapse and from one to the next; the rock radiates."""
    time = 0.01 * np.arange(1000)
    drive = 0.5 * GRAVITY * np.where(time < 5.0, np.sin(2 * np.pi * time), 0.0)
    rock = 0.0 if base is None else base["density"] * base["shear_wave_velocity"]
    expected = marched(drive, 0.01, 0.15, alpha, rock)
    scene = column(
        in_file(tmp_path, -drive, 0.01),
        0.15,
        200.0,
        weak_density=WEIGHTLESS,
        rayleigh={"alpha": alpha, "beta": viscosity(200.0)},
        lapses=lapses,
        base=base,
    )
    name = "on rock" if base else "damped by its mass"
    off = abs(total(simulate(scene)) / expected - 1)
    figure(f"column {name}, {lapses} lapses: slip", off, 5e-3)


@with_records
def test_the_energy_of_a_record_of_long_steps(tmp_path, figure):
    """20 ms: the march sees between samples what the lines see, not straight lines."""
    record = recorded(RECORDS["Northridge"])
    acceleration = record.scaled(pga_g=0.5).acceleration[:450]
    result = simulate(column(in_file(tmp_path, acceleration, record.dt), 0.05, 100.0, damping=0.05))
    assert total(result) > 0.1
    figure("column, Northridge at 20 ms: energy left open", abs(open_energy(result)), 0.02)


# ---------------------------------------------------------------- strength


def level(soils: dict[str, dict], layers: list[tuple[float, str, int]], **effects) -> Scene:
    """A level column under a shake too weak to move it."""
    usual = {"density": DENSITY, "shear_wave_velocity": 200.0, "poisson": 0.3, "damping": 0.05}
    names = ("thickness", "soil", "cells")
    return Scene.from_dict(
        {
            "mesh": {
                "column": {
                    "width": 1.0,
                    "layers": [dict(zip(names, la, strict=True)) for la in layers],
                }
            },
            "soil": {name: usual | soil for name, soil in soils.items()},
            "motion": [sine(1, 40, 0.01)],
            "boundary": {"left": "tied", "right": "tied"},
            "effects": {"gravity": {"acceleration": GRAVITY}, "sliding": True, **effects},
        }
    )


@pytest.mark.parametrize(("cohesion", "angle", "k0"), [(0.0, 30.0, 0.5), (5e3, 35.0, 0.7)])
def test_friction_on_level_ground(cohesion, angle, k0, figure):
    """τ_f = c cos φ + ½(1 + K0) σ_v sin φ: the lowest cell yields first, if any cell does."""
    soil = {"cohesion": cohesion, "friction_angle": angle, "k0": k0}
    slip = simulate(level({"sand": soil}, [(10.0, "sand", 10)])).lapses[0].slip
    phi, depth = np.radians(angle), 9.5
    expected = 0.5 * (1 + k0) * np.sin(phi)
    expected += cohesion * np.cos(phi) / (DENSITY * GRAVITY * depth)
    found = slip.yield_coefficient
    figure(f"level ground, φ {angle:g}°, c {cohesion:g} Pa: k_y", abs(found / expected - 1), 1e-3)


@pytest.mark.parametrize("cohesion", [1e6, 1e9])
def test_soil_beside_rock(cohesion, figure):
    """However strong what does not yield is."""
    k_y, strength = 0.25, 0.25 * DENSITY * GRAVITY * 10.05
    soils = {"rock": {"cohesion": cohesion}, "clay": {"cohesion": strength}}
    slip = simulate(level(soils, [(10.0, "rock", 5), (0.1, "clay", 1)])).lapses[0].slip
    said = f"clay of {strength / 1e3:.0f} kPa under {cohesion:.0e} Pa: k_y"
    figure(said, abs(slip.yield_coefficient / k_y - 1), 1e-3)
    assert slip.sense == 1  # both ways are alike: the first one, not the one that round-off favours


# ---------------------------------------------------------------- the same scene otherwise


def test_a_slope_in_a_mirror(figure):
    here, there = (simulate(Scene.from_dict(slope(mirrored=m))) for m in (False, True))
    assert total(here) > 0.05
    assert (here.lapses[0].slip.sense, there.lapses[0].slip.sense) == (1, -1)
    # The reduced sweep begins from other random numbers of each unknown, and is good to 1e-7.
    figure("slope in a mirror: slip", abs(total(there) / total(here) - 1), 1e-7)
    u, v = (result.history("displacement") for result in (here, there))
    figure("slope in a mirror: motion", abs(u * [[-1], [1]] - v).max() / abs(u).max(), 1e-7)


@pytest.mark.mpi
@pytest.mark.skipif(WORLD.size == 1, reason="compares several ranks with one")
@pytest.mark.parametrize("moves", [False, True])
def test_ranks(moves, figure):
    """As 1e-8 on ranks with a mesh each; those that share one factorise in another order.

    φ is found with moduli some 1e9 times apart, so it is known to 1e-7; on 3 ranks that share the
    mesh slip was 1.1e-8 off.
    """
    data = slope(lapses=2, convection=moves, sliding={"time_step": 0.005})
    data["solver"]["sweep"] = "direct"
    alone = simulate(Scene.from_dict(data), SELF)
    for size in (1, WORLD.size):
        mine = simulate(Scene.from_dict(data), WORLD, group_size=size)
        slip = np.array([lapse.slip.slip[-1] for lapse in mine.lapses])
        expected = np.array([lapse.slip.slip[-1] for lapse in alone.lapses])
        np.testing.assert_array_equal(slip, WORLD.bcast(slip))
        said = f"slope on {WORLD.size} ranks, {size} a mesh, {'moving' if moves else 'fixed'}: slip"
        figure(said, abs(slip - expected).max() / expected.max(), 1e-8 if size == 1 else 5e-8)


def arrays(result: Result) -> dict[str, bytes]:
    """All arrays of all lapses."""
    found = {}

    def collect(name, record):
        for field in dataclasses.fields(record):
            value = getattr(record, field.name)
            if dataclasses.is_dataclass(value):
                collect(f"{name}.{field.name}", value)
            elif value is not None:
                found[f"{name}.{field.name}"] = np.asarray(value).tobytes()

    for lapse in result.lapses:
        collect(str(lapse.index), lapse)
    return found


class Stop(Exception):
    pass


def test_a_slope_that_is_gone_on_with(tmp_path):
    """To the last bit, where lapses are cut short by new mechanisms."""
    data = slope(lapses=2, convection=True, sliding={"new_mechanism": 0.02, "time_step": 0.005})
    scene = Scene.from_dict(data | {"motion": [sine(1, 100, 0.3, 2.0)]})
    whole = simulate(scene)
    assert len(whole.lapses) > 2

    def stop(shown):
        if shown.index == 1:
            raise Stop

    with pytest.raises(Stop):
        simulate(scene, snapshot=stop, checkpoint=CheckpointFolder(tmp_path, scene, SELF))
    resumed = simulate(scene, checkpoint=CheckpointFolder(tmp_path, scene, SELF, resume=True))
    assert arrays(resumed) == arrays(whole)


def test_a_slope_too_strong_to_slide_and_moving():
    """The same to the last bit; the search for mechanisms alone is paid for."""
    moving = {"convection": True, "geometric_stiffness": True}
    still, without = (
        simulate(Scene.from_dict(slope(1e5, lapses=2, **moving, sliding=sliding)))
        for sliding in (True, False)
    )
    assert total(still) == 0.0
    found, expected = arrays(still), arrays(without)
    assert {name: found[name] for name in expected if ".factorisations" not in name} == {
        name: value for name, value in expected.items() if ".factorisations" not in name
    }
    searched = still.work.factorisations - without.work.factorisations
    least = sum(lapse.slip.iterations - 1 for lapse in still.lapses)
    assert least <= searched < 100
    for name in ("solves", "excited_lines", "inverse_mappings", "assemblies"):
        assert getattr(still.work, name) == getattr(without.work, name)


# ---------------------------------------------------------------- what is refused


def test_vertical_motion_alone_is_refused():
    data = slope()
    data["motion"][0]["direction"] = "y"
    with pytest.raises(SceneError, match="motion: found vertical motion alone"):
        simulate(Scene.from_dict(data))


WEAK = """
[mesh]
box = { size = [24.0, 7.0], cells = [24, 7] }
empty = ["air"]
[[mesh.regions]]
soil = "air"
polygon = [[0, 6], [8, 6], [14, 2], [24, 2], [24, 7], [0, 7]]
[[mesh.regions]]
soil = "clay"
[soil.clay]
density = 1800.0
shear_wave_velocity = 120.0
poisson = 0.4
cohesion = 11e3
[[motion]]
direction = "x"
harmonic = { amplitude = 1.0, frequency = 2.0, cycles = 2, samples = 100 }
[boundary]
left = "roller"
right = "roller"
[effects]
gravity = true
sliding = true
"""


def test_a_slope_that_does_not_stand_leaves_nothing_behind(tmp_path):
    (tmp_path / "weak.toml").write_text(WEAK)
    command = [sys.executable, "-m", "fenics_hytf.cli", "run", "weak.toml", "-o", "result"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 2
    assert "factor of safety of 0.9" in run.stderr and "Traceback" not in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["weak.toml"]
