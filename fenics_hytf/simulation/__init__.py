# SPDX-License-Identifier: MIT
"""The outer loop over lapses, and what it leaves behind."""

from fenics_hytf.simulation.check import mesh_faults
from fenics_hytf.simulation.checkpoint_folder import CheckpointFolder
from fenics_hytf.simulation.errors import CheckpointError, SimulationError
from fenics_hytf.simulation.flow import simulate
from fenics_hytf.simulation.groups import group_faults
from fenics_hytf.simulation.inspection import Inspection, inspect
from fenics_hytf.simulation.memory import peak_memory
from fenics_hytf.simulation.records import (
    Progress,
    ProgressCallback,
    Result,
    Snapshot,
    SnapshotCallback,
    Work,
)
from fenics_hytf.simulation.room import room_faults
from fenics_hytf.simulation.safety import factor_of_safety

__all__ = [
    "CheckpointError",
    "CheckpointFolder",
    "Inspection",
    "Progress",
    "ProgressCallback",
    "Result",
    "SimulationError",
    "Snapshot",
    "SnapshotCallback",
    "Work",
    "factor_of_safety",
    "group_faults",
    "inspect",
    "mesh_faults",
    "peak_memory",
    "room_faults",
    "simulate",
]
