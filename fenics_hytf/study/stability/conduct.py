# SPDX-License-Identifier: MIT
"""Making the stability maps: all their runs, a few at a time, each timed."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator

from fenics_hytf.study.records import StudyCallback, StudyProgress
from fenics_hytf.study.stability.block import block_jobs
from fenics_hytf.study.stability.contrast import contrast_jobs
from fenics_hytf.study.stability.lapses import frequency_jobs, lapse_jobs
from fenics_hytf.study.stability.records import Job, StabilityRun


def plan() -> list[Job]:
    """The runs of all maps."""
    return [*lapse_jobs(), *frequency_jobs(), *block_jobs(), *contrast_jobs()]


def conduct_stability(
    progress: StudyCallback | None = None, jobs: Iterable[Job] | None = None
) -> Iterator[list[StabilityRun]]:
    """Make the maps.

    Args:
        progress: Called before every job.
        jobs: What is to be made; all maps if ``None``.

    Yields:
        The runs of a job.
    """
    jobs = plan() if jobs is None else list(jobs)
    done, planned = 0, sum(job.planned for job in jobs)
    for job in jobs:
        if progress is not None:
            progress(StudyProgress(done, planned, job.text))
        yield list(_timed(job))
        done += job.planned


def _timed(job: Job) -> Iterator[StabilityRun]:
    runs = job.runs()  # with it the reference is made
    start = time.process_time()
    for axes, figures, verdict in runs:
        yield StabilityRun(job.map, axes, figures, verdict, time.process_time() - start)
        start = time.process_time()
