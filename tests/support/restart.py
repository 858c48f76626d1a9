# SPDX-License-Identifier: MIT
"""A small scene with something of everything that lapses hand over; runs that stop and go on."""

from __future__ import annotations

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
from mpi4py import MPI

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import CheckpointFolder, Result, simulate

KILLS = int(os.environ.get("HYTF_KILLS", "3"))  # ten by 'docker/run hard'
SCENE = """
title = "A section"
[mesh]
box = { size = [8.0, 6.0], cells = [4, 3], cell = "quadrilateral" }
regions = [ { soil = "sand", below = 4.0 }, { soil = "fill" } ]
[soil.sand]
density = 1900.0
shear_wave_velocity = 220.0
poisson = 0.3
curves = { model = "darendeli", plasticity_index = 0, mean_stress = 80e3 }
[soil.fill]
density = 1800.0
shear_wave_velocity = 160.0
poisson = 0.3
damping = 0.03
[[motion]]
direction = "x"
synthetic = { n = 128, dt = 0.04 }
pga = 0.2
[boundary]
left = "tied"
right = "tied"
[lapses]
count = 4
[effects]
equivalent_linear = { tolerance = 1e-2 }
convection = true
geometric_stiffness = true
[solver]
sweep = "reduced"
[output]
receivers = { top = [4.0, 6.0], rider = { point = [3.0, 5.0] } }
"""


class Stop(Exception):
    """What stops a run."""


def scene_with(folder: Path, **settings: str) -> Scene:
    """The scene with other settings, ``solver__sweep='"direct"'``."""
    file = folder / f"s{MPI.COMM_WORLD.rank}.toml"
    file.write_text(SCENE)
    return Scene.load(file, [f"{key.replace('__', '.')}={v}" for key, v in settings.items()])


def run(scene: Scene, comm: MPI.Comm, folder: Path, resume=False, stop=None, size=None) -> Result:
    """Run with checkpoints; as if something had gone wrong after lapse ``stop`` was shown."""

    def snapshot(shown):
        if shown.index == stop:
            raise Stop

    checkpoint = CheckpointFolder(folder, scene, comm, resume)
    return simulate(scene, comm, None, snapshot, group_size=size, checkpoint=checkpoint)


def arrays(result: Result) -> dict[str, np.ndarray]:
    """All arrays of all lapses, joined by name."""
    found: dict[str, list] = {}

    def collect(name, record):
        for field in dataclasses.fields(record):
            value = getattr(record, field.name)
            if dataclasses.is_dataclass(value):
                collect(f"{name}.{field.name}", value)
            elif value is not None and field.name not in ("change", "worst_cell", "last"):
                found.setdefault(f"{name}.{field.name}", []).append(np.asarray(value).ravel())

    for lapse in result.lapses:
        collect("lapse", lapse)
    return {name: np.concatenate(parts) for name, parts in found.items()}


EFFORT = ("lapse.worst_residual", "lapse.factorisations", "lapse.solves")
"""What a sweep took and left, not what it found: ranks take expansion points of their own."""


def apart(expected: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> float:
    """Largest difference over the largest value of its quantity; of energies over that of all."""
    energy = max(np.abs(v).max(initial=0.0) for n, v in expected.items() if ".energy." in n)
    worst = 0.0
    for name, values in expected.items():
        if name in EFFORT:
            continue
        # some energies are differences of others, and nought
        largest = energy if ".energy." in name else np.abs(values).max(initial=0.0)
        off = np.abs(found[name] - values).max(initial=0.0)
        worst = max(worst, float(off / largest) if off else 0.0)
    return worst


def different(expected: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> int:
    """Arrays that differ in any bit, or that only one has."""
    alike = [n for n in expected if n in found and expected[n].tobytes() == found[n].tobytes()]
    return len(expected.keys() | found.keys()) - len(alike)


def counts(result: Result) -> dict:
    """Work done, but for the time it took."""
    work = dataclasses.asdict(result.work)
    return {name: value for name, value in work.items() if name != "wall_s"}


def other_files(whole: str, resumed: str) -> int:
    """How many files differ: tables in any byte, the summary but for times."""
    names = sorted(p.name for p in Path(whole).iterdir())
    assert names == sorted(p.name for p in Path(resumed).iterdir())
    assert "checkpoint" not in names
    tables = [name for name in names if not name.endswith(".json")]
    other = sum(Path(whole, n).read_bytes() != Path(resumed, n).read_bytes() for n in tables)
    summaries = [json.loads(Path(d, "summary.json").read_text()) for d in (whole, resumed)]
    for summary in summaries:
        for key in ("written", "wall_s", "peak_memory_bytes"):
            del summary[key]
        del summary["work"]["wall_s"]
    return other + (summaries[0] != summaries[1])
