# SPDX-License-Identifier: MIT
"""Ground motion: records, lapses, transforms and response spectra. Knows no mesh and no MPI."""

from fenics_hytf.motion.formats import read, read_at2, read_csv
from fenics_hytf.motion.lapses import Segment, split
from fenics_hytf.motion.records import GRAVITY, Record, RecordError
from fenics_hytf.motion.response import default_periods, response_spectrum
from fenics_hytf.motion.sources import harmonic, recorded, recorded_names, synthetic
from fenics_hytf.motion.spectra import excited_lines, frequencies, to_frequency, to_time

__all__ = [
    "GRAVITY",
    "Record",
    "RecordError",
    "Segment",
    "default_periods",
    "excited_lines",
    "frequencies",
    "harmonic",
    "read",
    "read_at2",
    "read_csv",
    "recorded",
    "recorded_names",
    "response_spectrum",
    "split",
    "synthetic",
    "to_frequency",
    "to_time",
]
