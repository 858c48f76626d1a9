# SPDX-License-Identifier: MIT
"""Accuracy against cost, and stability: what a scene's settings cost, where the method holds.

The work-precision study of numerical analysis (Hairer, Nørsett and Wanner, 1993, §II.10), for one
scene over its knobs, with the frequency against the time domain: what each of its settings costs,
and what error it leaves. Beside it, in ``stability``, maps of where the method converges, drifts or
blows up, beyond what scenes are allowed.
"""

from fenics_hytf.study.conduct import conduct
from fenics_hytf.study.records import (
    BudgetSpent,
    Study,
    StudyCallback,
    StudyError,
    StudyProgress,
)
from fenics_hytf.study.runs import Processes
from fenics_hytf.study.stability.conduct import conduct_stability
from fenics_hytf.study.stability.records import StabilityRun

__all__ = [
    "BudgetSpent",
    "Processes",
    "StabilityRun",
    "Study",
    "StudyCallback",
    "StudyError",
    "StudyProgress",
    "conduct",
    "conduct_stability",
]
