# SPDX-License-Identifier: MIT
"""Transient lapses: nothing is lost at a seam.

N lapses of a linear problem are held against one, and both against a column that is integrated in
time by other means (:mod:`support.shear_column`). The column: 40 m, V_s 170 m/s, 20 cells, under
noise from 0.5 to 8 Hz.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import minimize_scalar
from support import shear_column as column
from support.meshes import scene
from support.shear_column import (
    DT,
    REFERENCE_FREQUENCY,
    SAMPLES,
    Stage,
    maxwell_factor,
    quiet_record,
    usual_column,
    usual_stages,
)

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import Result, simulate
from fenics_hytf.simulation import weighing as steps

# What a seam may cost, of the largest displacement, of the rms acceleration, of the velocity.
SEAM_U, SEAM_A, SEAM_V = 5e-4, 5e-3, 1e-3
REFERENCE_U = 1e-3  # what the columns may differ by

ROCK = {"density": 2200.0, "shear_wave_velocity": 760.0, "poisson": 0.25}
IMPEDANCE = 2200.0 * 760.0
BETA = 2e-3
MAXWELL = {"complex_modulus": "maxwell", "reference_frequency": REFERENCE_FREQUENCY}


@dataclass(frozen=True)
class Law:
    """A damping law as the scene says it and as the reference column does."""

    damping: float = 0.0
    solver: dict = field(default_factory=dict)
    effects: dict = field(default_factory=dict)
    options: dict = field(default_factory=lambda: {"law": "elastic"})
    rock: dict | None = None


LAWS = {
    "elastic": Law(),
    "viscous": Law(
        effects={"rayleigh": {"alpha": 0.0, "beta": BETA}},
        options={"law": "viscous", "beta": BETA},
    ),
} | {
    f"maxwell {100 * damping:g} %": Law(damping, MAXWELL, options={"law": "maxwell"})
    for damping in (0.02, 0.05, 0.1)
}
ON_ROCK = {
    "viscous on rock": replace(
        LAWS["viscous"],
        options={"law": "viscous", "beta": BETA, "impedance": IMPEDANCE},
        rock=ROCK,
    ),
    "maxwell 5 % on rock": replace(
        LAWS["maxwell 5 %"], options={"law": "maxwell", "impedance": IMPEDANCE}, rock=ROCK
    ),
}
ALL = LAWS | ON_ROCK


def error(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def rms_error(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.sqrt(np.mean((found - expected) ** 2) / np.mean(expected**2)))


def transient(count: int) -> dict:
    return {"count": count, "continuity": "transient"}


def run_column(folder, law: Law, count: int, record=None, solver: dict | None = None) -> Result:
    """The usual column in so many transient lapses."""
    raw = column.table(
        folder,
        quiet_record() if record is None else record,
        lapses=transient(count),
        damping=law.damping,
        rock=law.rock,
        effects=law.effects,
        solver={"sweep": "direct"} | law.solver | (solver or {}),
    )
    return simulate(Scene.from_dict(raw), MPI.COMM_SELF)


def motion_x(result: Result, name: str = "displacement") -> np.ndarray:
    """Histories in x, up to the end of the record, shape ``(num_receivers, num_samples)``."""
    return result.history(name)[:, 0, :SAMPLES]


def seam_samples(result: Result) -> list[int]:
    """First samples of all lapses but the first."""
    starts = np.cumsum([lapse.num_samples for lapse in result.lapses])[:-1]
    return [int(start) for start in starts if start < SAMPLES]


def seam_jump(many: Result, expected: np.ndarray) -> float:
    """Largest jump of the error in velocity from one side of a seam to the other."""
    off = motion_x(many, "velocity")[:, : expected.shape[1]] - expected
    seams = np.array(seam_samples(many))
    return float(np.abs(off[:, seams] - off[:, seams - 1]).max() / np.abs(expected).max())


@pytest.fixture(scope="module")
def one_lapse(tmp_path_factory) -> Callable[[str], Result]:
    """Runs of the column in one lapse, each made once."""
    made: dict[str, Result] = {}

    def run(name: str) -> Result:
        if name not in made:
            made[name] = run_column(tmp_path_factory.mktemp("one"), ALL[name], 1)
        return made[name]

    return run


# ---------------------------------------------------------------- N lapses against one


@pytest.mark.parametrize("count", [2, 5, 10, 40])
@pytest.mark.parametrize("name", ALL)
def test_many_lapses_against_one(name, count, one_lapse, tmp_path, figure):
    one, many = one_lapse(name), run_column(tmp_path, ALL[name], count)
    assert len(many.lapses) == count
    u, expected = motion_x(many), motion_x(one)
    said = f"{name}, {count} lapses against one"
    figure(f"{said}: displacement", error(u, expected), SEAM_U)
    a = [motion_x(result, "acceleration") for result in (many, one)]
    figure(f"{said}: acceleration, rms", rms_error(*a), SEAM_A)
    jump = seam_jump(many, motion_x(one, "velocity"))
    figure(f"{said}: jump of velocity", jump, SEAM_V)
    # No growth: the error of the last lapses is that of the first ones, or less.
    off = np.abs(u - expected).max(axis=0) / np.abs(expected).max()
    figure(f"{said}: error in the last tenth", float(off[-SAMPLES // 10 :].max()), SEAM_U)


@pytest.mark.parametrize("sweep", ["direct", "reduced"])
def test_lapses_cut_at_a_frequency(sweep, one_lapse, tmp_path, figure):
    """A cut of the lines at 2.5 times the record's band, under the rule that allows it."""
    name = "maxwell 5 %"
    settings = {"max_frequency": 20.0, "sweep": sweep}
    many = run_column(tmp_path, ALL[name], 10, solver=settings)
    said = f"{name}, 10 lapses cut at 20 Hz, {sweep}"
    one = one_lapse(name)
    figure(f"{said}: displacement", error(motion_x(many), motion_x(one)), SEAM_U)
    a = [motion_x(result, "acceleration") for result in (many, one)]
    figure(f"{said}: acceleration, rms", rms_error(*a), SEAM_A)


# ---------------------------------------------------------------- against the reference


@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize("name", ALL)
def test_against_the_reference_column(name, count, one_lapse, tmp_path, figure):
    law = ALL[name]
    found = one_lapse(name) if count == 1 else run_column(tmp_path, law, count)
    reference = usual_column(**law.options).respond(
        quiet_record(), DT, usual_stages([1.0], law.damping)
    )
    said = f"{name}, {count} lapses against the reference"
    for motion, limit in (("displacement", REFERENCE_U), ("velocity", 2 * REFERENCE_U)):
        expected = reference.above_base(motion)
        figure(f"{said}: {motion}", error(motion_x(found, motion), expected), limit)
    off = rms_error(motion_x(found, "acceleration"), reference.above_base("acceleration"))
    figure(f"{said}: acceleration, rms", off, SEAM_A)


@pytest.mark.parametrize("sweep", ["direct", "reduced"])
def test_a_record_that_ends_in_the_midst_of_shaking(sweep, tmp_path, figure):
    """The end of a lapse is as good as its start, and needs nothing of what is to come."""
    law, samples = LAWS["maxwell 5 %"], 658
    record = quiet_record()[:samples]
    assert abs(record[-1]) > 0.8
    found = run_column(tmp_path, law, 1, record, solver={"sweep": sweep})
    stages = usual_stages([1.0], law.damping)
    reference = usual_column(**law.options).respond(quiet_record(), DT, stages)
    expected = reference.displacement[:, :samples]
    name = f"record that ends at once, {sweep}: displacement"
    figure(name, error(motion_x(found), expected), REFERENCE_U)


# ---------------------------------------------------------------- stiffness that changes


SMALL = 2e-5  # of the record: the column moves by a micrometre, and the points with it
RATIOS = (1.0, 0.8, 0.5, 0.4)
STEPS = {
    "elastic": ("elastic", (0.0,) * 4),
    "viscous": ("viscous", (0.0,) * 4),
    "viscous on rock": ("viscous on rock", (0.0,) * 4),
    "maxwell 2 %": ("maxwell 2 %", (0.02,) * 4),
    "maxwell 5 %": ("maxwell 5 %", (0.05,) * 4),
    "maxwell 10 %": ("maxwell 10 %", (0.1,) * 4),
    "maxwell 5 % on rock": ("maxwell 5 % on rock", (0.05,) * 4),
    "maxwell, damping too": ("maxwell 2 %", (0.02, 0.05, 0.08, 0.1)),
}


def change_ground(monkeypatch, ratios, dampings) -> list[int]:
    """Give each lapse its own stiffness and damping; counts the lapses."""
    survey, calls = steps.survey, []

    def changing(*arguments):
        ground = survey(*arguments)
        lapse = len(calls)
        calls.append(lapse)
        return replace(
            ground,
            shear_modulus=ratios[lapse] * ground.shear_modulus,
            damping=np.full_like(ground.damping, dampings[lapse]),
        )

    monkeypatch.setattr(steps, "survey", changing)
    return calls


@pytest.mark.parametrize("name", STEPS)
def test_stiffness_that_changes(name, tmp_path, monkeypatch, figure):
    """The stress stays at a seam, and its mismatch fades; see the residual stress σ_q."""
    which, dampings = STEPS[name]
    law = replace(ALL[which], effects=ALL[which].effects | {"convection": True})
    calls = change_ground(monkeypatch, RATIOS, dampings)
    record = SMALL * quiet_record()
    found = run_column(tmp_path, law, len(RATIOS), record)
    assert len(calls) == len(RATIOS)
    stages = [
        replace(stage, damping=np.full(column.NUM_CELLS, damping))
        for stage, damping in zip(usual_stages(RATIOS), dampings, strict=True)
    ]
    soil = usual_column(**law.options)
    reference = soil.respond(record, DT, stages)
    expected = reference.above_base()
    assert np.abs(expected).max() < 3e-6
    said = f"{name}, G falls to 0.4 in four lapses"
    figure(f"{said}: displacement", error(motion_x(found), expected), REFERENCE_U)
    jump = seam_jump(found, reference.above_base("velocity"))
    figure(f"{said}: jump of velocity", jump, SEAM_V)
    off = rms_error(motion_x(found, "acceleration"), reference.above_base("acceleration"))
    figure(f"{said}: acceleration, rms", off, SEAM_A)
    # The two other readings of a seam are far from it, or this would tell nothing.
    for other in ("drop", "keep"):
        reading = soil.respond(record, DT, stages, jump=other).above_base()
        assert error(reading, expected) > 20 * REFERENCE_U


def test_stiffness_that_changes_from_cell_to_cell(tmp_path, monkeypatch, figure):
    """Layers soften by themselves: every seam meets a pattern of its own."""
    rng = np.random.default_rng(5)
    lapses, cells = 6, column.NUM_CELLS
    ratios = rng.uniform(0.4, 1.0, (lapses, cells))
    dampings = rng.uniform(0.01, 0.15, (lapses, cells))
    survey, calls = steps.survey, []

    def changing(case, domain, *points):
        ground = survey(case, domain, *points)
        # By height from the base up, whatever the order of the cells.
        number = np.floor(domain.centroids()[:, 1] / column.CELL).astype(int)
        lapse = len(calls)
        calls.append(lapse)
        return replace(
            ground,
            shear_modulus=ratios[lapse, number] * ground.shear_modulus,
            damping=dampings[lapse, number],
        )

    monkeypatch.setattr(steps, "survey", changing)
    law = replace(LAWS["maxwell 5 %"], effects={"convection": True})
    record = SMALL * quiet_record()
    found = run_column(tmp_path, law, lapses, record)
    modulus = column.DENSITY * column.SPEED**2
    stages = [
        Stage(SAMPLES // lapses, modulus * ratio, damping)
        for ratio, damping in zip(ratios, dampings, strict=True)
    ]
    expected = usual_column(**law.options).respond(record, DT, stages).above_base()
    said = "maxwell, random G and D in 20 cells and 6 lapses"
    figure(f"{said}: displacement", error(motion_x(found), expected), REFERENCE_U)


# ---------------------------------------------------------------- sections


WIDE, DEEP = 48.0, 24.0
SECTION_DT, SECTION_SAMPLES = 0.02, 600
SIDES = {"left": "dashpot", "right": "dashpot"}
CLAY = {"density": 1800.0, "shear_wave_velocity": 150.0, "poisson": 0.35, "damping": 0.06}
SAND = {"density": 1900.0, "shear_wave_velocity": 250.0, "poisson": 0.3, "damping": 0.03}
SECTIONS = {
    "rigid base, dashpots": SIDES,
    "rock, dashpots": SIDES | {"base": {"compliant": ROCK}},
}


def section(folder, boundary: dict, count: int, **settings) -> Scene:
    """Sand under clay with a slanted lens of clay, between dashpots."""
    path = folder / f"section{MPI.COMM_WORLD.rank}.csv"
    np.savetxt(path, quiet_record(SECTION_SAMPLES, SECTION_DT))
    kind = "outcrop" if "base" in boundary else "within"
    motion = {"direction": "x", "file": str(path), "dt": SECTION_DT, "units": "m/s2"}
    lens = [(8.0, 6.0), (20.0, 3.0), (40.0, 10.0), (30.0, 14.0)]
    regions = [
        {"soil": "clay", "polygon": lens},
        {"soil": "sand", "below": 14.0},
        {"soil": "clay"},
    ]
    box = {"size": [WIDE, DEEP], "cells": [12, 6], "cell": "quadrilateral"}
    places = {"crest": [24.0, DEEP], "shoulder": [4.0, DEEP], "side": [WIDE, 12.0]}
    return scene(
        {"box": box, "regions": regions},
        soil={"clay": CLAY, "sand": SAND},
        motion=[motion | {"input": kind}],
        boundary=boundary,
        lapses=transient(count),
        solver={"sweep": "direct"} | MAXWELL | settings,
        output={"receivers": places},
    )


@pytest.fixture(scope="module")
def one_section(tmp_path_factory) -> Callable[[str], Result]:
    """Runs of the section in one lapse, each made once."""
    made: dict[str, Result] = {}

    def run(name: str) -> Result:
        if name not in made:
            case = section(tmp_path_factory.mktemp("section"), SECTIONS[name], 1)
            made[name] = simulate(case, MPI.COMM_SELF)
        return made[name]

    return run


@pytest.mark.parametrize("count", [2, 5, 10])
@pytest.mark.parametrize("name", SECTIONS)
def test_section(name, count, one_section, tmp_path, figure):
    one = one_section(name)
    many = simulate(section(tmp_path, SECTIONS[name], count), MPI.COMM_SELF)
    said = f"section, {name}, {count} lapses against one"
    for axis in (0, 1):
        u, expected = (run.history("displacement")[:, axis] for run in (many, one))
        off = error(u[:, :SECTION_SAMPLES], expected)
        figure(f"{said}: displacement {'xy'[axis]}", off, SEAM_U)
    a, expected = (run.history("acceleration")[..., :SECTION_SAMPLES] for run in (many, one))
    figure(f"{said}: acceleration, rms", rms_error(a, expected), SEAM_A)
    v, expected = (run.history("velocity")[..., :SECTION_SAMPLES] for run in (many, one))
    seams = np.cumsum([lapse.num_samples for lapse in many.lapses])[:-1]
    jump = (v - expected)[..., seams] - (v - expected)[..., seams - 1]
    figure(f"{said}: jump of velocity", np.abs(jump).max() / np.abs(expected).max(), SEAM_V)


def test_section_reduced(one_section, tmp_path, figure):
    """The error of a reduced sweep grows as e^{ηt} on the contour, unless it is kept down."""
    name = "rock, dashpots"
    many = simulate(section(tmp_path, SECTIONS[name], 5, sweep="reduced"), MPI.COMM_SELF)
    u, expected = (run.history("displacement") for run in (many, one_section(name)))
    off = error(u[..., :SECTION_SAMPLES], expected)
    figure(f"section, {name}, 5 lapses, reduced: displacement", off, SEAM_U)


@pytest.mark.mpi
@pytest.mark.parametrize("group_size", [1, None], ids=["lines shared", "mesh shared"])
def test_section_on_several_ranks(group_size, shared_path):
    """What the points remember lives on the ranks that hold them."""
    comm = MPI.COMM_WORLD
    case = section(shared_path, SECTIONS["rock, dashpots"], 3, max_frequency=20.0)
    size = comm.size if group_size is None else group_size
    parallel = simulate(case, comm, group_size=size)
    serial = simulate(case, MPI.COMM_SELF)
    for name in ("displacement", "velocity", "total_acceleration"):
        assert error(parallel.history(name), serial.history(name)) <= 1e-9


# ---------------------------------------------------------------- resonance


@pytest.mark.parametrize("count", [1, 4, 10])
def test_undamped_resonance(count, tmp_path, figure):
    """20 periods at the first frequency of the column itself: the amplitude grows in proportion."""
    cycles, samples = 20, 800
    soil, modulus = usual_column(), usual_stages([1.0])[0].modulus
    omega, shapes, parts = soil.frequencies(modulus)
    w = omega[0]
    raw = column.table(
        tmp_path, np.zeros(2), lapses=transient(count), solver={"sweep": "direct"}
    ) | {
        "motion": [
            {
                "direction": "x",
                "harmonic": {
                    "amplitude": 1.0,
                    "frequency": w / (2 * np.pi),
                    "cycles": cycles,
                    "samples": samples,
                },
            }
        ]
    }
    found = simulate(Scene.from_dict(raw), MPI.COMM_SELF)
    time = found.time
    # Of q̈ + ω²q = p sin ωt at rest, and of the other modes q̈ + ω_k²q = p_k sin ωt beside it.
    q = np.empty((len(omega), len(time)))
    q[0] = (np.sin(w * time) - w * time * np.cos(w * time)) / (2 * w**2)
    for mode, own in enumerate(omega[1:], start=1):
        q[mode] = (np.sin(w * time) - w / own * np.sin(own * time)) / (own**2 - w**2)
    expected = (shapes @ (parts[:, None] * q))[-1]
    u = found.history("displacement")[-1, 0]
    said = f"resonance, {count} lapses"
    figure(f"{said}: displacement", error(u, expected), 0.01)
    by_cycle = [np.abs(x).reshape(cycles, -1).max(axis=1) for x in (u, expected)]
    growth = [np.polyfit(np.arange(5, cycles), peaks[5:], 1)[0] for peaks in by_cycle]
    figure(f"{said}: growth", abs(growth[0] / growth[1] - 1), 0.01)


# ---------------------------------------------------------------- the hysteretic law


def test_hysteretic_lapses_against_one(tmp_path, figure):
    """No state restarts this law: each lapse answers to the whole record."""
    law = Law(0.05, {"complex_modulus": "hysteretic"})
    one, many = (run_column(tmp_path, law, count) for count in (1, 5))
    off = error(motion_x(many), motion_x(one))
    figure("hysteretic 5 %, 5 lapses against one: displacement", off, 1e-3)
    off = rms_error(*(motion_x(result, "acceleration") for result in (many, one)))
    figure("hysteretic 5 %, 5 lapses against one: acceleration, rms", off, SEAM_A)


def test_one_hysteretic_lapse_is_the_steady_one_with_a_long_rest(tmp_path, figure):
    """Transient or steady, one lapse of this law is the same but for wrap-around."""
    law = Law(0.05, {"complex_modulus": "hysteretic"})
    found = run_column(tmp_path, law, 1)
    raw = column.table(
        tmp_path,
        np.pad(quiet_record(), (0, 5 * SAMPLES)),
        lapses={"count": 1, "continuity": "steady"},
        damping=law.damping,
        solver={"sweep": "direct", "max_frequency": 15.0} | law.solver,
    )
    expected = simulate(Scene.from_dict(raw), MPI.COMM_SELF)
    off = error(motion_x(found), motion_x(expected))
    figure("hysteretic 5 %, transient against steady: displacement", off, REFERENCE_U)


def _peak(top: Callable[[float], float], near: float) -> tuple[float, float]:
    """Frequency and height of the steady-state peak near a frequency."""
    grid = near * np.linspace(0.8, 1.3, 150)
    heights = np.array([top(frequency) for frequency in grid])
    inner = np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] > heights[2:])) + 1
    best = min(inner, key=lambda i: abs(grid[i] - 1.05 * near))
    refined = minimize_scalar(
        lambda frequency: -top(frequency),
        bounds=(grid[best - 1], grid[best + 1]),
        method="bounded",
        options={"xatol": 1e-8},
    )
    return refined.x, -refined.fun


@pytest.mark.parametrize(
    ("damping", "low", "high"), [(0.02, 0.01, 0.03), (0.05, 0.035, 0.08), (0.1, 0.075, 0.16)]
)
def test_maxwell_beside_hysteretic(damping, low, high, figure):
    """Peaks as high, but at frequencies that rise: a causal law disperses (Kramers and Kronig)."""
    soil, modulus = usual_column(), usual_stages([1.0])[0].modulus
    fundamental = soil.frequencies(modulus)[0][:5] / (2 * np.pi)

    def top(frequency: float, factor: complex) -> float:
        s = 2j * np.pi * frequency
        return abs(1 + s**2 * soil.steady(s, modulus * factor)[-1])

    height, shift = [], []
    for near in fundamental:
        plain = _peak(lambda f: top(f, 1 + 2j * damping), near)
        causal = _peak(
            lambda f: top(f, complex(maxwell_factor(2j * np.pi * f, damping, fundamental[0]))), near
        )
        shift.append(causal[0] / plain[0] - 1)
        height.append(causal[1] / plain[1] - 1)
    said = f"maxwell beside hysteretic, {100 * damping:g} %"
    figure(f"{said}: heights of peaks 1-5", np.abs(height).max(), 0.01)
    figure(f"{said}: rise of mode 1", abs(shift[0]), 1e-3)
    figure(f"{said}: least rise of modes 2-5", min(shift[1:]), low, at_least=True)
    figure(f"{said}: largest rise of modes 2-5", max(shift[1:]), high)


@pytest.mark.parametrize("damping", [0.02, 0.05, 0.1])
def test_steady_maxwell(damping, tmp_path, figure):
    """The package's law, line by line, against that of the reference."""
    raw = column.table(
        tmp_path,
        quiet_record(),
        lapses={"count": 1, "continuity": "steady"},
        damping=damping,
        solver={"sweep": "direct", "max_frequency": 9.0} | MAXWELL,
    )
    lapse = simulate(Scene.from_dict(raw), MPI.COMM_SELF).lapses[0]
    soil, modulus = usual_column(), usual_stages([1.0])[0].modulus
    expected = np.empty(lapse.transfer.shape[:1] + lapse.transfer.shape[3:], complex)
    for line, s in enumerate(2j * np.pi * lapse.frequency):
        factor = maxwell_factor(s, damping, REFERENCE_FREQUENCY)
        expected[:, line] = 1 + s**2 * soil.steady(s, modulus * factor)
    off = error(lapse.transfer[:, 0, 0], expected)
    figure(f"maxwell {100 * damping:g} %, steady: transfer function", off, 1e-3)
