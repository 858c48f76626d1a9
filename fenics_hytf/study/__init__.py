# SPDX-License-Identifier: MIT
"""Accuracy against cost: one scene over its knobs, and the frequency against the time domain.

The work-precision study of numerical analysis (Hairer, Nørsett and Wanner, 1993, §II.10), for one
scene: what each of its settings costs, and what error it leaves.
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
from fenics_hytf.study.stability import Axes, StabilityRun, conduct_stability

__all__ = [
    "Axes",
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
