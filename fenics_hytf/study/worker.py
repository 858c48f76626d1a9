# SPDX-License-Identifier: MIT
"""The process that does one run of a study: ``python3 -m fenics_hytf.study.worker FOLDER``.

It reads ``job.json`` from the folder and leaves ``response.npy`` and ``cost.json`` there, or
``failure``. The clock runs from the scene in memory to the response on the disk: mesh, assembly,
solution, response and output. Compiled forms and kernels are loaded before, by a run over the
lowest lines alone. A run of less than two seconds is repeated and its fastest repetition counts.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fenics_hytf.motion import excited_lines, to_frequency
from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import SimulationError, peak_memory, simulate
from fenics_hytf.study.newmark import integrate
from fenics_hytf.study.runs import COST, FAILURE, JOB, RESPONSE, Cost, Job, read_job, write_cost

RealArray = npt.NDArray[np.float64]

_REPEAT_BELOW = 2.0  # core-seconds
_REPEATS = 3
_FEW_LINES = 2  # of a sweep, and samples of a march, that load all code
_FEW_SAMPLES = 8


@dataclass(frozen=True)
class Work:
    """The work of a run, as far as it is known."""

    factorisations: int
    solves: int
    unknowns: int
    cells: int


def main(folder: Path) -> int:
    """Do the job in a folder.

    Args:
        folder: Holds ``job.json``.

    Returns:
        The exit code: 0, or 3 where ``failure`` says why.
    """
    try:
        job = read_job(folder / JOB)
        warm(job)
        cost, response = measured(job, folder)
    except SceneError as error:
        return _fail(folder, "; ".join(str(fault) for fault in error.faults))
    except SimulationError as error:
        return _fail(folder, str(error))
    except MemoryError:
        return _fail(folder, "out of memory")
    if not np.isfinite(response).all():
        return _fail(folder, "the response holds values that are not numbers")
    write_cost(folder / COST, cost)
    return 0


def warm(job: Job) -> None:
    """Load, or compile, what a run needs.

    What fails here fails again, with its message, in the run that counts.
    """
    try:
        if job.method == "simulate":
            _sweep_little(job.scene)
        else:
            _march_little(job)
    except SimulationError:
        pass


def _march_little(job: Job) -> None:
    """The scene under a few samples."""
    scene, samples = job.scene, _FEW_SAMPLES
    sine = {"amplitude": 1.0, "frequency": 1 / (samples * scene.dt), "cycles": 1}
    motion = [
        {"direction": each.direction, "input": each.input, "harmonic": sine | {"samples": samples}}
        for each in scene.motion
    ]
    data = scene.data | {"motion": motion, "lapses": {}}
    integrate(Scene.from_dict(data, scene.folder), job.method, job.substeps)


def _sweep_little(scene: Scene) -> None:
    """The scene over its lowest lines, its loop loose."""
    acceleration = scene.base_acceleration
    num_samples = acceleration.shape[1]
    lines = excited_lines(to_frequency(acceleration), scene.dt, num_samples, scene.solver.excited)
    if not len(lines):
        return
    first = lines[0] / (num_samples * scene.dt)
    highest = max(first, _FEW_LINES / (scene.segments[0].num_samples * scene.dt))
    data = scene.data | {"solver": scene.data.get("solver", {}) | {"max_frequency": float(highest)}}
    loop = scene.effects.equivalent_linear
    if loop is not None:
        table = loop.model_dump(exclude={"magnitude"}) | {"tolerance": 0.5}
        data["effects"] = scene.data["effects"] | {"equivalent_linear": table}
    simulate(Scene.from_dict(data, scene.folder))


def measured(job: Job, folder: Path) -> tuple[Cost, RealArray]:
    """Run a job, several times if it is short, and take the fastest.

    Args:
        job: The job.
        folder: Where the response is written while the clock runs.

    Returns:
        The cost, and the total acceleration of the receivers [m/s^2], shape ``(num_receivers,
        num_components, num_samples)``.
    """
    action = _action(job)
    seconds: list[tuple[float, float]] = []
    while not seconds or (len(seconds) < _REPEATS and min(seconds)[0] < _REPEAT_BELOW):
        cpu, wall = time.process_time(), time.perf_counter()
        response, work = action()
        np.save(folder / RESPONSE, response)
        seconds.append((time.process_time() - cpu, time.perf_counter() - wall))
    core_s, wall_s = min(seconds)
    cost = Cost(
        core_s=core_s,
        wall_s=wall_s,
        factorisations=work.factorisations,
        solves=work.solves,
        peak_memory=peak_memory(),
        unknowns=work.unknowns,
        cells=work.cells,
    )
    return cost, response


def _action(job: Job) -> Callable[[], tuple[RealArray, Work]]:
    if job.method == "simulate":
        return lambda: _simulated(job.scene)
    return lambda: _marched(job)


def _simulated(scene: Scene) -> tuple[RealArray, Work]:
    result = simulate(scene)
    work = result.work
    sizes = (result.sizes["unknowns"], result.sizes["cells"])
    return result.history("total_acceleration"), Work(work.factorisations, work.solves, *sizes)


def _marched(job: Job) -> tuple[RealArray, Work]:
    march = integrate(job.scene, job.method, job.substeps)
    cost = march.cost
    work = Work(cost.factorisations, cost.steps, march.unknowns, march.cells)
    return march.total_acceleration, work


def _fail(folder: Path, why: str) -> int:
    (folder / FAILURE).write_text(why)
    return 3


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
