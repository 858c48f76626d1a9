# SPDX-License-Identifier: MIT
"""The scene file: its schema, defaults and messages; which effects are called for.

A scene is read and checked whole before anything is computed; every fault is reported at once,
each with its key, what was found and what was expected. How anything is solved is not known here.
"""

from fenics_hytf.scene.axes import components_of
from fenics_hytf.scene.boundary import Boundary, Rock, default_kind
from fenics_hytf.scene.check import Sections, check
from fenics_hytf.scene.continuity import ABOVE_BAND, PERIODS, lapse_length_rules, motion_band
from fenics_hytf.scene.faults import Fault, SceneError
from fenics_hytf.scene.identity import changed_keys, identity
from fenics_hytf.scene.mesh import MOST_CELLS, Box, Column, Layer, Mesh
from fenics_hytf.scene.motion import MotionInput, direction_fault
from fenics_hytf.scene.output import Output, Receiver
from fenics_hytf.scene.quadrature import (
    allowed_points_per_cell,
    default_points_per_cell,
    rule_degrees,
)
from fenics_hytf.scene.regions import Region
from fenics_hytf.scene.scene import Scene, examine
from fenics_hytf.scene.settings import (
    Calm,
    Degradation,
    Effects,
    EquivalentLinear,
    Lapses,
    Points,
    Rayleigh,
    Solver,
)
from fenics_hytf.scene.soil import Soil

__all__ = [
    "ABOVE_BAND",
    "MOST_CELLS",
    "PERIODS",
    "Boundary",
    "Box",
    "Calm",
    "Column",
    "Degradation",
    "Effects",
    "EquivalentLinear",
    "Fault",
    "Lapses",
    "Layer",
    "Mesh",
    "MotionInput",
    "Output",
    "Points",
    "Rayleigh",
    "Receiver",
    "Region",
    "Rock",
    "Scene",
    "SceneError",
    "Sections",
    "Soil",
    "Solver",
    "allowed_points_per_cell",
    "changed_keys",
    "check",
    "components_of",
    "default_kind",
    "default_points_per_cell",
    "direction_fault",
    "examine",
    "identity",
    "lapse_length_rules",
    "motion_band",
    "rule_degrees",
]
