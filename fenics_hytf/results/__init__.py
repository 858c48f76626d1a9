# SPDX-License-Identifier: MIT
"""Results: the folder and its tables, ``summary.json``, ParaView files, figures, the report.

A run writes through :class:`ResultFolder`; figures and the report are drawn from what stands in
the folder alone, so that they can be drawn again later.
"""

from fenics_hytf.results.definition import describe_scene
from fenics_hytf.results.folder import (
    CHECKPOINT,
    FINISHED,
    ResultError,
    ResultFolder,
    folder_faults,
    is_result_of,
    locked,
    open_result,
    place_faults,
)
from fenics_hytf.results.publish import publish
from fenics_hytf.results.reader import (
    as_written,
    read_result,
    read_summary,
    read_table,
    read_tables,
)
from fenics_hytf.results.summary import moving_components

__all__ = [
    "CHECKPOINT",
    "FINISHED",
    "ResultError",
    "ResultFolder",
    "as_written",
    "describe_scene",
    "folder_faults",
    "is_result_of",
    "locked",
    "moving_components",
    "open_result",
    "place_faults",
    "publish",
    "read_result",
    "read_summary",
    "read_table",
    "read_tables",
]
