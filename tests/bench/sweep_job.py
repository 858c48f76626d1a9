# SPDX-License-Identifier: MIT
"""The program that runs a scene beside its peers: ``python3 sweep_job.py FOLDER``.

It reads ``scene.json`` and leaves the total acceleration of the receivers in ``response.npy`` and
CPU and wall seconds from the scene in memory to the response on the disk in ``cost.json``. Nothing
is run before: forms and kernels come from the caches on the disk while the clock runs.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np

from fenics_hytf import Scene, simulate


def main(folder: Path) -> None:
    """Run the scene of a folder."""
    data = json.loads((folder / "scene.json").read_text())
    cpu, wall = time.process_time(), time.perf_counter()
    result = simulate(Scene.from_dict(data))
    np.save(folder / "response.npy", result.history("total_acceleration"))
    cost = {"cpu_s": time.process_time() - cpu, "wall_s": time.perf_counter() - wall}
    (folder / "cost.json").write_text(json.dumps(cost))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
