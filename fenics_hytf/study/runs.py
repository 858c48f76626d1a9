# SPDX-License-Identifier: MIT
"""Runs of a study: each in a process of its own, its outcome kept where a later study finds it.

A process of its own has a peak memory of its own, and what ends it, a crash or a shortage of
memory, ends nothing else. An outcome is found again by a hash of everything it depends on: the
scene with its record and mesh file, how it is solved, and the code that solves it.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

import fenics_hytf
from fenics_hytf.motion.files import replace_file
from fenics_hytf.scene import Scene

RealArray = npt.NDArray[np.float64]

JOB, RESPONSE, COST, FAILURE = "job.json", "response.npy", "cost.json", "failure"
"""Files in the folder of a run: what is to be done, and what the process that does it leaves."""

_ROOMS = (  # that a run solves with, as :func:`_code` looks at them
    "motion",
    "soil",
    "scene",
    "domain",
    "particles",
    "operators",
    "frequency",
    "lapse",
    "simulation",
)
_SHARED = ("_compat.py", "results/sliding.py", "study/slip_measures.py", "study/worker.py")
_MARCHING = ("study/newmark.py", "study/matrices.py")
_ONE_CORE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


@dataclass(frozen=True)
class Job:
    """What is run.

    Attributes:
        scene: The scene.
        method: ``simulate``: in the frequency domain, as ``hytf run`` does; ``newmark`` or
            ``hht``: marched in time.
        substeps: Time steps per sample of the record, of a march.
    """

    scene: Scene
    method: str = "simulate"
    substeps: int = 1

    @property
    def key(self) -> str:
        """Hash of everything the outcome depends on."""
        digest = hashlib.sha256(self.scene.hash.encode())
        digest.update(
            f"{self.method} {self.substeps} {self.scene.dt!r} {_code(self.method)}".encode()
        )
        digest.update(self.scene.base_acceleration.tobytes())
        if self.scene.mesh.file is not None:
            digest.update(self.scene.mesh.file.read_bytes())
        return digest.hexdigest()[:20]


@dataclass(frozen=True)
class Cost:
    """What a run cost.

    Attributes:
        core_s: CPU time of solving and of writing the response, without the start of the
            interpreter and the compilation of forms [s].
        wall_s: Wall time of the same [s].
        factorisations: Factorisations.
        solves: Solves with a factorised matrix.
        peak_memory: Of the process, interpreter and libraries among it [bytes].
        unknowns: Unknowns.
        cells: Cells.
    """

    core_s: float
    wall_s: float
    factorisations: int
    solves: int
    peak_memory: int
    unknowns: int
    cells: int


@dataclass(frozen=True)
class Outcome:
    """What a run left.

    Attributes:
        cost: Its cost; ``None`` if it failed.
        response: Total acceleration of the receivers [m/s^2], shape ``(num_receivers,
            num_components, num_samples)``; ``None`` if it failed.
        failure: Why it failed.
        kept: Whether it was found, not run.
        slid: What slid, by the keys of ``slip_measures.MEASURES``; empty where nothing is to slide.
    """

    cost: Cost | None
    response: RealArray | None
    failure: str = ""
    kept: bool = False
    slid: Mapping[str, float] = field(default_factory=dict)


class Runner(Protocol):
    """Runs jobs."""

    def __call__(self, job: Job, limit: float | None = None) -> Outcome:
        """Run a job, or find it done.

        Args:
            job: The job.
            limit: Wall time after which it is given up [s]; ``None``: never.

        Returns:
            The outcome, of a failed run too.
        """
        ...


class Processes:
    """Runs jobs in processes, one at a time, and keeps outcomes in a folder.

    Args:
        folder: Where outcomes are kept; made if it is not there.
        before: Called before a run starts that is not kept; it raises to stop the study.
    """

    def __init__(self, folder: Path, before: Callable[[], None] = lambda: None) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._before = folder, before

    def __call__(self, job: Job, limit: float | None = None) -> Outcome:
        """See :class:`Runner`."""
        key = job.key
        found = self._find(key)
        if found is not None:
            return found
        self._before()
        with tempfile.TemporaryDirectory(dir=self._folder, prefix=".run-") as name:
            place = Path(name)
            write_job(place / JOB, job)
            failure = _execute(place, limit)
            if not failure:
                (place / RESPONSE).replace(self._folder / f"{key}.npy")
                replace_file(self._folder / f"{key}.json", (place / COST).read_text())
        return Outcome(None, None, failure) if failure else self._read(key, kept=False)

    def _find(self, key: str) -> Outcome | None:
        try:
            return self._read(key, kept=True)
        except (OSError, ValueError, TypeError, EOFError):
            return None

    def _read(self, key: str, kept: bool) -> Outcome:
        record = json.loads((self._folder / f"{key}.json").read_text())
        slid = record.pop("slid", {})
        response = np.load(self._folder / f"{key}.npy", "r")
        return Outcome(Cost(**record), response, kept=kept, slid=slid)


def write_job(path: Path, job: Job) -> None:
    """Write a job for the process that does it."""
    record = {
        "data": job.scene.data,
        "folder": str(job.scene.folder),
        "method": job.method,
        "substeps": job.substeps,
    }
    path.write_text(json.dumps(record, default=str))


def read_job(path: Path) -> Job:
    """Read what :func:`write_job` has written."""
    record: dict[str, Any] = json.loads(path.read_text())
    scene = Scene.from_dict(record["data"], record["folder"])
    return Job(scene, record["method"], record["substeps"])


def write_cost(path: Path, cost: Cost, slid: Mapping[str, float]) -> None:
    """Write what a run has cost, and what slid where anything was to."""
    path.write_text(json.dumps(asdict(cost) | ({"slid": dict(slid)} if slid else {})))


def _execute(place: Path, limit: float | None) -> str:
    """Run the job in a folder; why it failed, or nothing."""
    command = [sys.executable, "-m", "fenics_hytf.study.worker", str(place)]
    root = str(Path(fenics_hytf.__file__).resolve().parents[1])
    paths = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    start = time.monotonic()
    with (place / "said").open("w+") as said:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            env=os.environ | _ONE_CORE | {"PYTHONPATH": paths},
        )
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            return f"not done after {time.monotonic() - start:.0f} s, given up"
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        if code == 0:
            return ""
        if (place / FAILURE).exists():
            return (place / FAILURE).read_text()
        said.seek(0)
        last = [line.strip() for line in said if line.strip()][-1:]
        how = f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        return ": ".join([how, *last])


@cache
def _code(method: str) -> str:
    """Hash of the code that an outcome of a method depends on."""
    digest = hashlib.sha256()
    package = Path(fenics_hytf.__file__).resolve().parent
    files = [file for room in _ROOMS for file in sorted((package / room).glob("*.py"))]
    names = _SHARED if method == "simulate" else _SHARED + _MARCHING
    for file in files + [package / name for name in names]:
        digest.update(file.read_bytes())
    return digest.hexdigest()
