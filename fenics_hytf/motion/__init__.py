# SPDX-License-Identifier: MIT
"""Ground motion: records, lapses, transforms, spectra and intensity. Knows no mesh and no MPI."""

from fenics_hytf.motion.contour import Contour, LapseRecord, StartFunctions
from fenics_hytf.motion.convolution import ConvolutionQuadrature
from fenics_hytf.motion.formats import read, read_at2, read_csv
from fenics_hytf.motion.fourier import dominant_frequency, fourier_amplitude, smoothed
from fenics_hytf.motion.intensity import (
    Intensity,
    arias_intensity,
    cumulative_absolute_velocity,
    integrated,
    intensity_measures,
    significant_duration,
)
from fenics_hytf.motion.lapses import Segment, split
from fenics_hytf.motion.rational import from_few
from fenics_hytf.motion.records import GRAVITY, Record, RecordError
from fenics_hytf.motion.response import default_periods, response_spectrum
from fenics_hytf.motion.sliding_block import (
    SlipError,
    SlipHistory,
    decoupled_slip,
    march,
    rigid_slip,
    straight_lines,
)
from fenics_hytf.motion.sources import harmonic, recorded, recorded_names, synthetic
from fenics_hytf.motion.spectra import (
    band_limited,
    energy_band,
    excited_lines,
    frequencies,
    to_frequency,
    to_time,
)
from fenics_hytf.motion.writers import write_at2, write_columns, write_csv

__all__ = [
    "GRAVITY",
    "Contour",
    "ConvolutionQuadrature",
    "Intensity",
    "LapseRecord",
    "Record",
    "RecordError",
    "Segment",
    "SlipError",
    "SlipHistory",
    "StartFunctions",
    "arias_intensity",
    "band_limited",
    "cumulative_absolute_velocity",
    "decoupled_slip",
    "default_periods",
    "dominant_frequency",
    "energy_band",
    "excited_lines",
    "fourier_amplitude",
    "frequencies",
    "from_few",
    "harmonic",
    "integrated",
    "intensity_measures",
    "march",
    "read",
    "read_at2",
    "read_csv",
    "recorded",
    "recorded_names",
    "response_spectrum",
    "rigid_slip",
    "significant_duration",
    "smoothed",
    "split",
    "straight_lines",
    "synthetic",
    "to_frequency",
    "to_time",
    "write_at2",
    "write_columns",
    "write_csv",
]
