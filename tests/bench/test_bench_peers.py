# SPDX-License-Identifier: MIT
"""Beside peers: OpenSees on linear ground, pystrata on equivalent-linear ground.

OpenSees: the same ground with the same Rayleigh damping, C = αM + βK on both sides. Its elements
have lumped masses and it marches with Newmark's average acceleration, one step a sample of the
record; ours has consistent masses and a reduced sweep. Each is a discretisation with errors of its
own, so both are measured against the ground itself: a closed form, or a mesh of 16 times the
unknowns and of degree 2. Costs are those of separate processes, one after the other, from the
problem in memory to the response on the disk; imports are not in them.
"""

import json
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import resample
from support.reference import G0, column, load, motion, rms, two_layer_transfer

from fenics_hytf import Scene, simulate
from fenics_hytf.motion import to_frequency, to_time
from fenics_hytf.study.measures import Error, Yardstick
from fenics_hytf.study.twin import viscous_twin

HERE = Path(__file__).parent
needs_opensees = pytest.mark.skipif(find_spec("openseespy") is None, reason="needs openseespy")
needs_pystrata = pytest.mark.skipif(find_spec("pystrata") is None, reason="needs pystrata")

RECORD = {"direction": "x", "pga": 0.2, "synthetic": {"n": 4096, "t2": 30.0}}
SOFT = {"density": 1733.5, "shear_wave_velocity": 150.0, "poisson": 0.3, "damping": 0.05}
STIFF = {"density": 1937.5, "shear_wave_velocity": 300.0, "poisson": 0.3, "damping": 0.05}
TOP, BOTTOM = 6.0, 14.0  # layers of the column [m]


def linear(mesh: dict, receivers: dict) -> Scene:
    """The viscous twin of a section or column of two soils between tied sides."""
    return viscous_twin(
        Scene.from_dict(
            {
                "mesh": mesh,
                "soil": {"soft": SOFT, "stiff": STIFF},
                "motion": [RECORD],
                "boundary": {"left": "tied", "right": "tied"},
                "solver": {"sweep": "reduced"},
                "output": {"receivers": receivers},
            }
        )
    )


@dataclass(frozen=True)
class Run:
    """What a process cost and found, response of shape ``(receivers, 2, samples)``."""

    name: str
    cpu_s: float
    wall_s: float
    response: np.ndarray


def run(program: str, folder: Path) -> dict[str, float]:
    """Run a program of this folder on a job; its cost."""
    done = subprocess.run(
        [sys.executable, HERE / program, folder], capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, f"{program}: {done.stdout}{done.stderr}"
    return json.loads((folder / "cost.json").read_text())


def ours(scene: Scene, folder: Path) -> Run:
    (folder / "scene.json").write_text(json.dumps(scene.data))
    run("sweep_job.py", folder)  # compiles, if nothing was compiled before
    cost = run("sweep_job.py", folder)
    return Run("reduced sweep", **cost, response=np.load(folder / "response.npy"))


@dataclass(frozen=True)
class Grid:
    """A section for OpenSees: lines of nodes, and whether the cell at a place is stiff."""

    x: np.ndarray
    y: np.ndarray
    is_stiff: Callable[[float, float], bool]
    watched: tuple[tuple[float, float], ...]


def opensees(grid: Grid, twin: Scene, substeps: int, folder: Path) -> Run:
    middle_x, middle_y = ((line[1:] + line[:-1]) / 2 for line in (grid.x, grid.y))
    rayleigh = twin.effects.rayleigh
    assert rayleigh is not None
    padded = twin.base_acceleration[0]
    num_samples = twin.motion[0].record.num_samples
    assert padded[0] == 0  # OpenSees is at rest at the first sample
    # Straight lines between samples would lose 2 % of 8 Hz, however fine the steps.
    record = resample(padded, substeps * len(padded))[: (num_samples - 1) * substeps + 1]
    job = {
        "x": grid.x.tolist(),
        "y": grid.y.tolist(),
        "soils": [
            {
                "density": soil.density,
                "shear_modulus": soil.elastic.shear_modulus,
                "poisson": soil.elastic.poisson,
            }
            for soil in (twin.soil["soft"], twin.soil["stiff"])
        ],
        "soil_of_cell": [[int(grid.is_stiff(x, y)) for y in middle_y] for x in middle_x],
        "alpha": rayleigh.alpha,
        "beta": rayleigh.beta,
        "step": twin.dt / substeps,
        "record": record.tolist(),
        "watched": [
            (int(np.argmin(abs(grid.x - x))), int(np.argmin(abs(grid.y - y))))
            for x, y in grid.watched
        ],
    }
    (folder / "job.json").write_text(json.dumps(job))
    cost = run("opensees_model.py", folder)
    rows = np.loadtxt(folder / "response.txt")[substeps - 1 :: substeps]
    response = np.zeros((len(grid.watched), 2, num_samples))
    response[:, :, 1:] = rows.T.reshape(len(grid.watched), 2, -1)
    response[:, 0] += padded[:num_samples]
    return Run(f"OpenSees, {substeps} a sample", **cost, response=response)


def compare(
    name: str,
    runs: list[Run],
    reference: np.ndarray,
    twin: Scene,
    figure: Callable[..., None],
    faster_than: int,
) -> None:
    """Print errors and costs; ours, the first, errs no more than any, and is faster than one."""
    num_samples = twin.motion[0].record.num_samples
    yardstick = Yardstick(reference[:, :, :num_samples], twin.dt, list(twin.output.receivers))
    errors: list[Error] = [yardstick.error(found.response) for found in runs]
    print(f"\n{name}: {num_samples} samples of {twin.dt:g} s")
    for found, error in zip(runs, errors, strict=True):
        print(
            f"  {found.name:22s} CPU {found.cpu_s:7.2f} s, wall {found.wall_s:7.2f} s; error L2 "
            f"{error.relative_l2:.2e}, ln PSA {error.ln_psa:.2e}"
        )
    for measure in ("relative_l2", "ln_psa"):
        mine, least = getattr(errors[0], measure), min(getattr(e, measure) for e in errors[1:])
        figure(f"{name}: {measure}, ours over OpenSees' least", mine / least, 1.0)
    peer = runs[faster_than]
    for measure in ("cpu_s", "wall_s"):
        ratio = getattr(peer, measure) / getattr(runs[0], measure)
        figure(f"{name}: {measure}, {peer.name}, over ours", ratio, 1.0, at_least=True)


@needs_opensees
@pytest.mark.benchmark
def test_opensees_on_a_section_of_2000_quads(tmp_path, figure):
    def mesh(cells: list[int], degree: int) -> dict:
        box = {"size": [200.0, 40.0], "cells": cells, "cell": "quadrilateral"}
        shelf = {"soil": "stiff", "polygon": [[0, 0], [80, 0], [80, 30], [0, 30]]}
        regions = [{"soil": "stiff", "below": 20.0}, shelf, {"soil": "soft", "below": 41.0}]
        return {"box": box, "regions": regions, "degree": degree}

    places = ((40.0, 40.0), (100.0, 40.0), (160.0, 40.0))
    receivers = dict(zip(("shelf", "edge", "basin"), map(list, places), strict=True))
    twin = linear(mesh([100, 20], 1), receivers)
    grid = Grid(
        np.linspace(0, 200, 101),
        np.linspace(0, 40, 21),
        lambda x, y: y < 20 or (x < 80 and y < 30),
        places,
    )
    fine = Scene.from_dict(twin.data | {"mesh": mesh([200, 40], 2)})
    reference = simulate(fine).history("total_acceleration")
    runs = [ours(twin, tmp_path), *(opensees(grid, twin, n, tmp_path) for n in (1, 2))]
    compare("section of 2000 quads", runs, reference, twin, figure, faster_than=1)


def closed_form(twin: Scene) -> np.ndarray:
    """Acceleration of the top of the column, shape ``(1, 2, num_samples)``.

    In layers with Rayleigh damping −ω²(1 − iα/ω) ρ u − (1 + iωβ) G u″ = −ρ ü_b for u relative to
    the base. All of it moves by w = ü_b/(ω² − iωα), less a wave that starts at the base with w.
    """
    rayleigh = twin.effects.rayleigh
    assert rayleigh is not None
    spectrum = to_frequency(twin.base_acceleration[0])
    omega = 2 * np.pi * np.arange(1, len(spectrum)) / (len(twin.base_acceleration[0]) * twin.dt)
    inertia, stiffness = 1 - 1j * rayleigh.alpha / omega, 1 + 1j * rayleigh.beta * omega
    soils = (twin.soil["soft"], twin.soil["stiff"])
    density = tuple(soil.density * inertia for soil in soils)
    modulus = tuple(soil.elastic.shear_modulus * stiffness for soil in soils)
    wave = two_layer_transfer(omega, (TOP, BOTTOM), density, modulus)
    transfer = np.concatenate([[1.0], 1 - (1 - wave) / inertia])
    response = np.zeros((1, 2, len(twin.base_acceleration[0])))
    response[0, 0] = to_time(transfer * spectrum, response.shape[2])
    return response


@needs_opensees
@pytest.mark.benchmark
def test_opensees_on_a_column_of_two_layers(tmp_path, figure):
    layers = [
        {"thickness": TOP, "soil": "soft", "cells": 6},
        {"thickness": BOTTOM, "soil": "stiff", "cells": 7},
    ]
    mesh = {"column": {"width": 1.0, "layers": layers}, "degree": 2}
    twin = linear(mesh, {"top": [0.5, TOP + BOTTOM]})
    height = np.linspace(0, TOP + BOTTOM, 41)
    grid = Grid(np.array([0.0, 1.0]), height, lambda _, y: y < BOTTOM, ((1.0, TOP + BOTTOM),))
    runs = [ours(twin, tmp_path), *(opensees(grid, twin, n, tmp_path) for n in (1, 4, 16))]
    # At one step a sample OpenSees is about as fast as ours, and far off.
    compare("column of two layers", runs, closed_form(twin), twin, figure, faster_than=2)


def pystrata_pass(case: dict, record: np.ndarray) -> tuple[float, int, np.ndarray]:
    """CPU seconds of pystrata's own calculation, its passes, and the surface acceleration [g]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what its imports say is not ours
        from pystrata.motion import TimeSeriesMotion
        from pystrata.propagation import EquivalentLinearCalculator
        from pystrata.site import Layer, NonlinearProperty, Profile, SoilType

    class Counted(EquivalentLinearCalculator):
        passes = 0

        def _calc_waves(self, *arguments: object) -> object:
            self.passes += 1
            return super()._calc_waves(*arguments)

    started = time.process_time()
    given = TimeSeriesMotion(
        "", "", case["motion"]["dt_s"], record, fa_length=case["motion"]["fa_length"]
    )
    layers = []
    for layer in case["profile"]["layers_top_down"]:
        curve = case["curves"][layer["curve"]]
        soil = SoilType(
            "",
            layer["density_kg_m3"] * G0 / 1e3,
            NonlinearProperty("", curve["strain"], curve["G_over_Gmax"], "mod_reduc"),
            NonlinearProperty("", curve["strain"], curve["damping"], "damping"),
        )
        layers.append(Layer(soil, layer["thickness_m"], layer["vs_m_s"]))
    rock = case["profile"]["halfspace"]
    below = SoilType("", rock["unit_wt_kN_m3"], None, rock["damping"])
    profile = Profile([*layers, Layer(below, 0, rock["vs_m_s"])])
    calculator = Counted(strain_ratio=case["strain_ratio"], tolerance=0.01, max_iterations=40)
    calculator(given, profile, profile.location("within", index=-1))
    transfer = calculator.calc_accel_tf(calculator.loc_input, profile.location("outcrop", index=0))
    surface = given.calc_time_series(transfer)
    return time.process_time() - started, calculator.passes, surface


@needs_pystrata
@pytest.mark.benchmark
@pytest.mark.parametrize("record", ["synthetic", "NIS090"])
def test_pystrata_pass_by_pass(record, figure):
    """Case c at 0.2 g: all that a calculation takes, but our set-up, over its passes."""
    name = f"c_darendeli24_{record}_pga0p2"
    case = load(name)
    period = case["motion"]["fa_length"] * case["motion"]["dt_s"]
    loop = {"tolerance": 1e-4, "max_iterations": 40, "strain_ratio": case["strain_ratio"]}
    data = column(case, motion(case), cells=1, duration=period, equivalent_linear=loop).data
    scene = Scene.from_dict(data | {"solver": data["solver"] | {"sweep": "reduced"}})
    acceleration = scene.motion[0].record.acceleration / G0

    mine, its = [], []
    for attempt in range(6):  # the first one loads and compiles, on both sides
        started = time.process_time()
        result = simulate(scene)
        spent = time.process_time() - started - result.work.wall_s["setup"]
        passes = len(result.lapses[0].loop.change)
        its_time, its_passes, its_surface = pystrata_pass(case, acceleration)
        if attempt:
            mine.append(spent / passes)
            its.append(its_time / its_passes)
    expected = np.array(case["results"]["surface_accel_g"])
    surface = result.history("total_acceleration")[0, 0] / G0
    print(f"\n{name}: {result.lapses[0].solved_lines} lines")
    for who, seconds, count, found in (
        ("reduced sweep", min(mine), passes, surface),
        ("pystrata", min(its), its_passes, its_surface),
    ):
        found = found[: len(expected)]
        peak = 100 * abs(np.abs(found).max() / case["results"]["surface_pga_g"] - 1)
        apart = 100 * rms(found - expected) / rms(expected)
        print(
            f"  {who:14s} {1e3 * seconds:6.1f} ms a pass, {count} passes; PGA {peak:.4f} %, "
            f"acceleration {apart:.4f} % from the converged reference"
        )
    figure(f"{name}: pass, ours over pystrata's", min(mine) / min(its), 3.0)
