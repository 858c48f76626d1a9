# SPDX-License-Identifier: MIT
"""The program that runs a section in OpenSees: ``python3 opensees_model.py FOLDER``.

A process of its own: openseespy brings a BLAS that it puts before that of every other library. It
reads ``job.json`` and leaves accelerations relative to the base in ``response.txt``, a row a time
step, and CPU and wall seconds from the job in memory to the response on the disk in ``cost.json``.

Set up as fast as OpenSees was found to run it, in CPU time of 4096 steps of 100 x 20 quads:
``SSPquad``, which on rectangles gives the displacements of ``quad`` to twelve digits and takes 4.0
against 5.3 ms a step; damping on the initial stiffness, which of three kinds costs ``quad`` the
least; the matrix factorised once. With that, SuperLU, SparseSYM, ProfileSPD and Mumps are within
15 % of each other, for a step is mostly spent in the elements; BandSPD, BandGeneral and UmfPack
take four times as long and more. The ties of the sides need no handler beyond ``Plain``.
"""

import json
import sys
import time
from pathlib import Path

import openseespy.opensees as ops


def build(job: dict) -> dict[tuple[int, int], int]:
    """Nodes, soils, elements, supports and damping; the tag of each node by its place."""
    x, y = job["x"], job["y"]
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 2)
    places = [(i, j) for i in range(len(x)) for j in range(len(y))]
    tags = {place: number for number, place in enumerate(places, start=1)}
    for (i, j), tag in tags.items():
        ops.node(tag, x[i], y[j])
    for number, soil in enumerate(job["soils"], start=1):
        modulus = 2 * soil["shear_modulus"] * (1 + soil["poisson"])
        ops.nDMaterial("ElasticIsotropic", number, modulus, soil["poisson"], soil["density"])
    cells = [(i, j) for i in range(len(x) - 1) for j in range(len(y) - 1)]
    for number, (i, j) in enumerate(cells, start=1):
        corners = [tags[place] for place in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]
        soil = 1 + job["soil_of_cell"][i][j]
        ops.element("SSPquad", number, *corners, soil, "PlaneStrain", 1.0)
    for i in range(len(x)):
        ops.fix(tags[i, 0], 1, 1)
    for j in range(1, len(y)):
        ops.equalDOF(tags[0, j], tags[len(x) - 1, j], 1, 2)
    return tags


def march(job: dict, tags: dict[tuple[int, int], int], response: Path) -> int:
    """Newmark's average acceleration; 0 if all steps were taken."""
    ops.timeSeries("Path", 1, "-dt", job["step"], "-values", *job["record"])
    ops.pattern("UniformExcitation", 1, 1, "-accel", 1)
    ops.rayleigh(job["alpha"], 0.0, job["beta"], 0.0)
    watched = [tags[i, j] for i, j in job["watched"]]
    output = ["-file", str(response), "-precision", 12]
    ops.recorder("Node", *output, "-node", *watched, "-dof", 1, 2, "accel")
    ops.constraints("Plain")
    ops.numberer("RCM")
    ops.system("SuperLU")
    ops.algorithm("Linear", "-factorOnce")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.analysis("Transient")
    return ops.analyze(len(job["record"]) - 1, job["step"])


def main(folder: Path) -> int:
    """Run the job of a folder."""
    job = json.loads((folder / "job.json").read_text())
    cpu, wall = time.process_time(), time.perf_counter()
    failed = march(job, build(job), folder / "response.txt")
    ops.wipe()  # closes the file
    cost = {"cpu_s": time.process_time() - cpu, "wall_s": time.perf_counter() - wall}
    (folder / "cost.json").write_text(json.dumps(cost))
    return failed


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
