# SPDX-License-Identifier: MIT
"""Memory that is told of a run, beside what it took in a process of its own."""

import json
import subprocess
import sys

from fenics_hytf.scene import Scene

_MEASURE = """
import json, sys
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import inspect, peak_memory, simulate
scene = Scene.from_dict(json.loads(sys.argv[1]))
told = inspect(scene)
simulate(scene, snapshot=lambda _: None)
print(json.dumps([told.unknowns, told.points, told.memory_bytes, peak_memory()]))
"""


def told_and_taken(scene: Scene) -> tuple[int, int, int, int]:
    """Run a scene on one rank.

    Returns:
        Unknowns, material points, and memory told before and taken at its peak [bytes].
    """
    command = [sys.executable, "-c", _MEASURE, json.dumps(scene.data)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    unknowns, points, told, taken = json.loads(done.stdout.splitlines()[-1])
    return unknowns, points, told, taken
