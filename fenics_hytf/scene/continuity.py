# SPDX-License-Identifier: MIT
"""What lapses hand over to each other: defaults that hang on their number, and what may go wrong.

The response is handed over exactly only under a causal law, so several transient lapses take the
Maxwell law unless the scene names another. A lapse is solved on a damped contour; lines that are
left out above a maximum frequency are felt there as an error that grows from lapse to lapse, unless
the maximum is well above what the motion holds and lapses are long enough for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from fenics_hytf.motion import Segment, dominant_frequency, energy_band
from fenics_hytf.scene.faults import Fault, toml_text
from fenics_hytf.scene.motion import MotionInput
from fenics_hytf.scene.settings import Effects, Lapses, Sliding, Solver
from fenics_hytf.scene.table import as_list, is_given

ABOVE_BAND = 2.0
"""Least highest frequency over that below which 99 % of the motion's energy lies [-]."""
PERIODS = 10.0
"""Least highest frequency times the length of a lapse [-]."""
_MOST_REST = 10_000_000  # samples after the motion: 80 MB of zeros for each
_MOST_STEPS = 100_000  # of the march in a lapse, whose time goes with their square


def resolve(
    raw: dict[str, Any],
    lapses: Lapses,
    solver: Solver,
    effects: Effects,
    motions: tuple[MotionInput, ...],
    segments: list[Segment],
) -> tuple[Lapses, Solver]:
    """Fill in what hangs on the number of lapses, on sliding and on the motion.

    Args:
        raw: The raw table of the scene.
        lapses: ``[lapses]``.
        solver: ``[solver]``.
        effects: ``[effects]``; a mechanism that slides needs a causal law, and goes on.
        motions: The motions.
        segments: The lapses.

    Returns:
        Both sections, with a continuity, a complex modulus and, for ``maxwell``, a reference
        frequency.
    """
    continuity, law = lapses.continuity, solver.complex_modulus
    if not is_given(raw, "lapses", "continuity"):
        tables = as_list(raw.get("motion"))
        harmonic = all(isinstance(t, dict) and "harmonic" in t for t in tables)
        once = len(segments) == 1 or harmonic
        continuity = "steady" if once and effects.sliding is None else "transient"
    if not is_given(raw, "solver", "complex_modulus"):
        several = continuity == "transient" and len(segments) > 1
        law = "maxwell" if several or effects.sliding is not None else "hysteretic"
    frequency = solver.reference_frequency
    if frequency is None and law == "maxwell":
        frequency = dominant_frequency(_padded(motions), motions[0].record.dt)
    return (
        lapses.model_copy(update={"continuity": continuity}),
        solver.model_copy(update={"complex_modulus": law, "reference_frequency": frequency}),
    )


def sliding_rules(
    sliding: Sliding, lapses: Lapses, solver: Solver, duration: float, dt: float
) -> Iterator[Fault]:
    """What a mechanism that slides needs of lapses and law.

    Args:
        sliding: ``[effects.sliding]``.
        lapses: ``[lapses]``, resolved.
        solver: ``[solver]``, resolved.
        duration: Of the longest lapse [s].
        dt: Time step of the motions [s].

    Yields:
        The faults.
    """
    if lapses.continuity != "transient":
        expected = '"transient": what slides does not come back at the end of a period'
        yield Fault("lapses.continuity", toml_text(lapses.continuity), f"{expected}, with sliding")
    if solver.complex_modulus != "maxwell":
        expected = '"maxwell": the kernel of a mechanism that slides needs a causal law'
        yield Fault("solver.complex_modulus", toml_text(solver.complex_modulus), expected)
    if duration > _MOST_STEPS * sliding.time_step:
        expected = f"at least {duration / _MOST_STEPS:.3g} s, {_MOST_STEPS} steps a lapse"
        yield Fault("effects.sliding.time_step", f"{sliding.time_step:g}", expected)
    if sliding.longest > _MOST_REST * dt:
        expected = f"at most {_MOST_REST * dt:.3g} s, {_MOST_REST} samples"
        yield Fault("effects.sliding.longest", f"{sliding.longest:g}", expected)


def softening_rules(solver: Solver) -> Iterator[Fault]:
    """What softening needs of the law, where points move from one transient lapse to the next.

    Args:
        solver: ``[solver]``, resolved.

    Yields:
        The fault: under a law that is not causal static stress takes vibration along.
    """
    if solver.complex_modulus != "maxwell":
        expected = '"maxwell": another law keeps no static stress of its own for softening'
        yield Fault("solver.complex_modulus", toml_text(solver.complex_modulus), expected)


def continuity_rules(
    lapses: Lapses,
    solver: Solver,
    motions: tuple[MotionInput, ...],
    segments: list[Segment],
) -> Iterator[Fault]:
    """A reference frequency where it is used; a maximum frequency that lapses can bear.

    Args:
        lapses: ``[lapses]``, resolved.
        solver: ``[solver]``, resolved.
        motions: The motions.
        segments: The lapses.

    Yields:
        The faults.
    """
    if solver.reference_frequency is not None and solver.complex_modulus != "maxwell":
        expected = 'nothing without complex_modulus = "maxwell"'
        yield Fault("solver.reference_frequency", toml_text(solver.reference_frequency), expected)
    dt, cut = motions[0].record.dt, solver.max_frequency
    if len(segments) == 1 or lapses.continuity == "steady":
        return
    duration, nyquist = segments[0].num_samples * dt, 0.5 / dt
    if cut is None or cut >= nyquist * (1 - 1e-9):
        return
    found = toml_text(cut)
    band = ABOVE_BAND * motion_band(motions)
    if cut < band:
        expected = (
            f"at least {band:.3g} Hz, twice the frequency below which the motion has 99 % of its "
            "energy, or none: with less, transient lapses drift apart"
        )
        yield Fault("solver.max_frequency", found, expected)
    if cut * duration < PERIODS:
        expected = (
            f"at least {PERIODS / duration:.3g} Hz with lapses of {duration:g} s (frequency times "
            f"length from {PERIODS:g}), or none, or longer lapses: shorter ones blow up"
        )
        yield Fault("solver.max_frequency", found, expected)


def lapse_length_rules(lapses: Lapses, num_samples: int, count: int) -> Iterator[Fault]:
    """Transient lapses that are too short for any motion.

    Args:
        lapses: ``[lapses]``, resolved.
        num_samples: Samples of a lapse.
        count: Number of lapses.

    Yields:
        The fault.
    """
    least = 2 * round(PERIODS)  # f_max at the Nyquist frequency
    if count > 1 and lapses.continuity == "transient" and num_samples < least:
        name = "count" if lapses.duration is None else "duration"
        found = f"{toml_text(getattr(lapses, name))}, lapses of {num_samples} samples"
        expected = f"lapses of at least {least} samples: shorter transient ones drift apart"
        yield Fault(f"lapses.{name}", found, expected)


def motion_band(motions: tuple[MotionInput, ...]) -> float:
    """Frequency below which motions have 99 % of their energy [Hz]."""
    return energy_band(_padded(motions), motions[0].record.dt)


def _padded(motions: tuple[MotionInput, ...]) -> npt.NDArray[np.float64]:
    count = max(motion.record.num_samples for motion in motions)
    return np.stack([motion.record.padded(count).acceleration for motion in motions])
