# SPDX-License-Identifier: MIT
"""Runs one lapse of a slope of about a million points: ``python3 million_job.py ORDER``.

The order is JSON, the arguments of :func:`slope_scene`; the last line printed is the answer, JSON
as well. A process of its own: its peak memory is that of the run. What is measured is ``hytf run``
without pictures, from the scene in memory to the files on the disk, but for compiled forms and
kernels, which come from the caches.
"""

import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))  # where there is no pytest to do it

from support.meshes import mesh_script, scene

from fenics_hytf.results import CHECKPOINT, open_result
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import CheckpointFolder, peak_memory, simulate
from fenics_hytf.simulation.clock import Clock

HEIGHT, DEPTH, AIR = 64.0, 32.0, 4.0
SPEED, FREQUENCY = 250.0, 25.0  # ten cells a wavelength: cells of 1 m, 63 000 with soil


def slope_scene(folder: Path, size: float = 1.0, sliding: bool = True) -> Scene:
    """A slope of 64 m at 1:1.5, whose points move, under five seconds of shaking.

    The moduli of strong shaking are a quarter of the first ones and waves half as long: what the
    cells resolve then is half the frequency that they were made for, and the sweep ends there.

    Args:
        folder: Where its mesh goes.
        size: Of its cells over that of a slope of a million points [-].
        sliding: Whether a mechanism is sought and slips.
    """
    mesh = mesh_script("slope")(
        folder / "slope.msh",
        height=HEIGHT,
        depth=DEPTH,
        air=AIR,
        max_frequency=FREQUENCY / size,
        vs=[SPEED],
    )
    soil = {
        "density": 1900.0,
        "shear_wave_velocity": SPEED,
        "poisson": 0.35,
        "curves": {"model": "darendeli", "plasticity_index": 15, "mean_stress": 400e3},
        "cohesion": 30e3,
        "friction_angle": 30.0,
    }
    shaking = {"pga_g": 0.35, "dt": 0.02, "n": 250, "f1": 0.5, "f2": 5.0, "t1": 1.0, "t2": 3.0}
    effects = {
        "equivalent_linear": {"tolerance": 0.3, "max_iterations": 3},
        "gravity": True,
        "geometric_stiffness": True,
        "convection": True,
    }
    return scene(
        {"file": str(mesh), "empty": ["air"], "points_per_cell": 16},
        ("soil",),
        soil={"soil": soil},
        motion=[{"direction": "x", "synthetic": shaking, "input": "outcrop"}],
        boundary={
            "base": {
                "compliant": {"density": 2200.0, "shear_wave_velocity": 760.0, "poisson": 0.25}
            },
            "left": "dashpot",
            "right": "dashpot",
        },
        lapses={"count": 1, "continuity": "transient"},
        effects=effects | ({"sliding": {"time_step": 0.005}} if sliding else {}),
        solver={"max_frequency": FREQUENCY / 2.5, "complex_modulus": "maxwell"},
        output={"receivers": {"crest": [2 * HEIGHT - 2.0, DEPTH + HEIGHT - 0.5], "base": [9.0, 0]}},
    )


class _Watch:
    """Wall and processor seconds by name; what is inside another is not in that one."""

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = {}
        self._inside: list[list[float]] = []

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        start = time.perf_counter(), time.process_time()
        self._inside.append([0.0, 0.0])
        try:
            yield
        finally:
            taken = [time.perf_counter() - start[0], time.process_time() - start[1]]
            inside = self._inside.pop()
            kept = self.seconds.setdefault(name, [0.0, 0.0])
            for i in range(2):
                kept[i] += taken[i] - inside[i]
                if self._inside:
                    self._inside[-1][i] += taken[i]


def measure(order: dict) -> dict:
    """Run what was ordered.

    Args:
        order: Arguments of :func:`slope_scene`.

    Returns:
        Wall and processor seconds by phase, ``rest`` being what is in none; peak memory [bytes];
        and what was done.
    """
    watch = _Watch()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        simulate(slope_scene(folder, **order | {"size": 12.0}))  # compiles
        case = slope_scene(folder, **order)
        Clock.phase = lambda clock, name: watch(name)
        with open_result(folder / "result") as opened, watch("rest"):
            kept = CheckpointFolder(folder / "result" / CHECKPOINT, case, first=opened.clear)
            save = kept.save

            def timed_save(*state: object) -> None:
                with watch("checkpoint"):
                    save(*state)

            def snapshot(shown: object) -> None:
                with watch("vtu"):
                    opened.snapshot(shown)

            kept.save = timed_save
            result = simulate(case, snapshot=snapshot, checkpoint=kept)
            with watch("tables"):
                opened.write(result)
    lapse = result.lapses[0]
    return {
        "seconds": watch.seconds,
        "memory": peak_memory(),
        "sizes": result.sizes,
        "filled": int((lapse.cells.fill > 0).sum()),
        "lines": lapse.solved_lines,
        "iterations": len(lapse.loop.change),
        "work": dict(Counter(factorisations=result.work.factorisations, solves=result.work.solves)),
        "mechanism": None
        if lapse.slip is None
        else {
            "iterations": lapse.slip.iterations,
            "yield": lapse.slip.yield_coefficient,
            "safety": lapse.slip.factor_of_safety,
            "slip": float(lapse.slip.slip[-1]),
        },
        "ledger": lapse.ledger.num_points,
        "least_ratio": float(lapse.cells.g_over_gmax.min()),
    }


if __name__ == "__main__":
    print(json.dumps(measure(json.loads(sys.argv[1]))))
