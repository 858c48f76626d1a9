# SPDX-License-Identifier: MIT
"""One lapse: the ground, its equations, the equivalent-linear loop, the response, convection."""

from fenics_hytf.lapse.base import BaseProbe, outcrop_motion, within_motion
from fenics_hytf.lapse.convective import cell_stress, convect
from fenics_hytf.lapse.equations import Equations, LapseEquations
from fenics_hytf.lapse.equivalent_linear import Anderson, first_strain, iterate
from fenics_hytf.lapse.errors import EmptyCellError, EquivalentLinearError, LapseError
from fenics_hytf.lapse.free_field import FreeField, column_supports
from fenics_hytf.lapse.ground import (
    ElasticConstants,
    Ground,
    Moduli,
    complex_constants,
    seed_points,
    survey,
)
from fenics_hytf.lapse.peaks import peak_length, peak_shear_strain
from fenics_hytf.lapse.records import CellState, LapseResult, LoopHistory
from fenics_hytf.lapse.response import (
    CellPeaks,
    CellProbe,
    Excitation,
    Histories,
    ReceiverProbe,
)
from fenics_hytf.lapse.run import Observer, Solved, excite, solve

__all__ = [
    "Anderson",
    "BaseProbe",
    "CellPeaks",
    "CellProbe",
    "CellState",
    "ElasticConstants",
    "EmptyCellError",
    "Equations",
    "EquivalentLinearError",
    "Excitation",
    "FreeField",
    "Ground",
    "Histories",
    "LapseEquations",
    "LapseError",
    "LapseResult",
    "LoopHistory",
    "Moduli",
    "Observer",
    "ReceiverProbe",
    "Solved",
    "cell_stress",
    "column_supports",
    "complex_constants",
    "convect",
    "excite",
    "first_strain",
    "iterate",
    "outcrop_motion",
    "peak_length",
    "peak_shear_strain",
    "seed_points",
    "solve",
    "survey",
    "within_motion",
]
