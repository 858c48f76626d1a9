# SPDX-License-Identifier: MIT
"""One lapse: ground, equations, the equivalent-linear loop, response, what slips, convection."""

from fenics_hytf.lapse.base import BaseProbe, outcrop_motion, within_motion
from fenics_hytf.lapse.cells import CellPeaks, CellProbe
from fenics_hytf.lapse.choice import choose_continuity
from fenics_hytf.lapse.continuity import Continuity, excite
from fenics_hytf.lapse.convective import cell_stress, convect
from fenics_hytf.lapse.cycles import CycleCount
from fenics_hytf.lapse.energy import Energy
from fenics_hytf.lapse.equations import Equations, LapseEquations
from fenics_hytf.lapse.equivalent_linear import Anderson, first_strain, iterate
from fenics_hytf.lapse.errors import (
    BalanceError,
    DetachedError,
    EmptyCellError,
    EquivalentLinearError,
    GeometricInstability,
    LapseError,
    PeakError,
    VolumeError,
)
from fenics_hytf.lapse.excitation import Excitation
from fenics_hytf.lapse.filling import Filling, FillingSurvey
from fenics_hytf.lapse.free_field import FreeField, FreeFieldState, column_supports
from fenics_hytf.lapse.ground import Ground, Moduli, seed_points, survey
from fenics_hytf.lapse.handover import Handover
from fenics_hytf.lapse.material import ElasticConstants, Material, Part, material
from fenics_hytf.lapse.mechanism import Mechanism, MechanismError, MechanismSearch
from fenics_hytf.lapse.peaks import peak_length, peak_shear_strain
from fenics_hytf.lapse.records import (
    CellState,
    LapseResult,
    LoopHistory,
    SlipResult,
    SofteningResult,
)
from fenics_hytf.lapse.response import Histories, ReceiverProbe, Response, Spectra
from fenics_hytf.lapse.run import Observer, Solved, asked_residual, solve
from fenics_hytf.lapse.scheme import HANDOVER, Scheme, scheme_of
from fenics_hytf.lapse.sliding import Sliding
from fenics_hytf.lapse.slipped import Slipped, SlipState
from fenics_hytf.lapse.slope import Slope
from fenics_hytf.lapse.softening import Softening
from fenics_hytf.lapse.statics import Statics
from fenics_hytf.lapse.unknowns import Unknowns

__all__ = [
    "HANDOVER",
    "Anderson",
    "BalanceError",
    "BaseProbe",
    "CellPeaks",
    "CellProbe",
    "CellState",
    "Continuity",
    "CycleCount",
    "DetachedError",
    "ElasticConstants",
    "EmptyCellError",
    "Energy",
    "Equations",
    "EquivalentLinearError",
    "Excitation",
    "Filling",
    "FillingSurvey",
    "FreeField",
    "FreeFieldState",
    "GeometricInstability",
    "Ground",
    "Handover",
    "Histories",
    "LapseEquations",
    "LapseError",
    "LapseResult",
    "LoopHistory",
    "Material",
    "Mechanism",
    "MechanismError",
    "MechanismSearch",
    "Moduli",
    "Observer",
    "Part",
    "PeakError",
    "ReceiverProbe",
    "Response",
    "Scheme",
    "Sliding",
    "SlipResult",
    "SlipState",
    "Slipped",
    "Slope",
    "Softening",
    "SofteningResult",
    "Solved",
    "Spectra",
    "Statics",
    "Unknowns",
    "VolumeError",
    "asked_residual",
    "cell_stress",
    "choose_continuity",
    "column_supports",
    "convect",
    "excite",
    "first_strain",
    "iterate",
    "material",
    "outcrop_motion",
    "peak_length",
    "peak_shear_strain",
    "scheme_of",
    "seed_points",
    "solve",
    "survey",
    "within_motion",
]
