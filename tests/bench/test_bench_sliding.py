# SPDX-License-Identifier: MIT
"""What a mechanism that slides costs, over the lapse without it.

The search at the start of a lapse, and after its loop the sweeps of the kernel and of the vibration
that slip excites, the march and the rest, in seconds of the processor; against all else that the
same lapses take. The first lapse searches from nothing and is not counted.
"""

import time
from collections import Counter

import pytest
from support.meshes import mesh_script
from support.two_masses import LIMIT, STEP, TwoMasses, burst, linear_driving

from fenics_hytf.lapse import Sliding
from fenics_hytf.motion import march
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(3600)]

SOIL = {"density": 1800.0, "poisson": 0.4}
CURVES = {"model": "darendeli", "plasticity_index": 15, "mean_stress": 80e3}


def slope(file) -> Scene:
    """A slope with a weak seam under a motion of 8 s, in four lapses, with the loop."""
    soil = {**SOIL, "shear_wave_velocity": 200.0, "curves": CURVES, "cohesion": 60e3}
    motion = {"pga_g": 0.3, "dt": 0.02, "n": 400, "f1": 0.5, "f2": 5.0, "t1": 1.0, "t2": 4.0}
    return Scene.from_dict(
        {
            "mesh": {"file": str(file), "empty": ["air"]},
            "soil": {
                "soil": soil,
                "seam": {**soil, "shear_wave_velocity": 180.0, "cohesion": 17e3},
            },
            "motion": [{"direction": "x", "synthetic": {**motion, "c": 1.5}}],
            "boundary": {"left": "dashpot", "right": "dashpot"},
            "lapses": {"count": 4},
            "effects": {
                "equivalent_linear": True,
                "gravity": True,
                "geometric_stiffness": True,
                "convection": True,
                "sliding": True,
            },
        }
    )


@pytest.mark.parametrize("size", [1.0, 0.5])
def test_a_mechanism_once_it_is_warm(size, tmp_path, monkeypatch, figure):
    spent: Counter[str] = Counter()

    def timed(name):
        method = getattr(Sliding, name)

        def run(*arguments):
            start = time.process_time()
            found = method(*arguments)
            spent["mechanism"] += time.process_time() - start
            return found

        monkeypatch.setattr(Sliding, name, run)

    timed("begin")
    timed("slip")
    seam = {"seam": (0.0, 16.5, 38.3, 5.0, 2.5), "air": 2.0, "size": size}
    scene = slope(mesh_script("slope")(tmp_path / "slope.msh", **seam))
    lapses: list[tuple[float, float]] = []
    start = time.process_time()

    def progress(event):
        nonlocal start
        if event.phase == "lapse":
            now = time.process_time()
            lapses.append((spent["mechanism"], now - start - spent["mechanism"]))
            start = now
            spent.clear()

    result = simulate(scene, progress=progress)
    rows = [
        f"\n  lapse {lapse.index}: {len(lapse.loop.change)} iterations, "
        f"{lapse.slip.slip[-1]:.3f} m, "
        f"mechanism {mine:.2f} s, all else {rest:.2f} s"
        for lapse, (mine, rest) in zip(result.lapses, lapses, strict=True)
    ]
    print(f"\n{result.sizes['unknowns']} unknowns" + "".join(rows))
    slid = [pair for lapse, pair in zip(result.lapses, lapses, strict=True) if lapse.slip.slip[-1]]
    mine, rest = map(sum, zip(*slid[1:], strict=True))
    figure(f"a warm mechanism over the rest of its lapses, cells of {size} m", mine / rest, 0.4)


def test_a_march_of_20000_steps(figure):
    """Each step meets all before it: the convolution is what may take long."""
    system, num = TwoMasses(0.0), 20_000
    driving = linear_driving(system, burst(STEP, 101.0)[:num], STEP)
    weights = system.weights(num, STEP)
    march(driving[:10], LIMIT, weights, STEP)  # compiled
    start = time.process_time()
    march(driving, LIMIT, weights, STEP)
    # found 0.2 s of the processor for 100 s of motion
    figure("a march of 20 000 steps", time.process_time() - start, 1.0, "s")
