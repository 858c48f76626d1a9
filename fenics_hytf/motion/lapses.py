# SPDX-License-Identifier: MIT
"""Lapses: a record cut into pieces of equal length that join sample for sample.

The base acceleration is cut into n lapses of equal length Δt, within which the matrices are
constant. A record that the lapses do not divide is padded with zeros at its end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_WHOLE = 1e-6
"""How near duration/dt must be to a whole number, relative to it.

Time steps found from printed times are good to about that; a lapse that is longer or shorter than
asked for by a fraction of a sample would not be what the scene says.
"""

_MOST_LAPSES = 10_000
_MOST_SAMPLES = 10_000_000
"""Lapses, and samples of all of them with the zeros at the end; more is a slip of the pen."""


@dataclass(frozen=True)
class Segment:
    """Samples of a lapse.

    Attributes:
        index: Number of the lapse, from 0.
        start: First sample.
        num_samples: Number of samples.
    """

    index: int
    start: int
    num_samples: int

    @property
    def stop(self) -> int:
        """First sample of the next lapse."""
        return self.start + self.num_samples

    @property
    def samples(self) -> slice:
        """The samples as a slice of the padded record."""
        return slice(self.start, self.stop)


def split(
    num_samples: int, dt: float, count: int | None = None, duration: float | None = None
) -> list[Segment]:
    """Cut a record into lapses of equal length.

    The last lapse ends at or after the end of the record: pad the record with zeros up to
    ``split(...)[-1].stop`` samples.

    Args:
        num_samples: Samples of the record.
        dt: Time step [s].
        count: Number of lapses; one if neither is given.
        duration: Length of a lapse [s], a whole number of time steps. One longer than the record
            gives one lapse.

    Returns:
        The lapses in order; each starts where the one before stops.

    Raises:
        ValueError: If both are given, one is out of range, a lapse would have fewer than two
            samples, the duration is not a whole number of time steps within 1e-6 of it, or there
            are more lapses, or zeros after the record, than anyone means.
    """
    if count is not None and duration is not None:
        raise ValueError(f"count: found duration = {duration} as well; expected one of them")
    if duration is None:
        count = 1 if count is None else count
        if count != int(count) or count < 1:
            raise ValueError(f"count: found {count}; expected a whole number of at least 1")
        count = int(count)
        samples = -(-num_samples // count)
        asked = f"count: found {count} lapses for a record of {num_samples} samples"
    else:
        samples = _whole_steps(duration, dt)
        count = -(-num_samples // max(samples, 1))
        asked = f"duration: found {duration:g} s with time steps of {dt:g} s"
    if samples < 2:
        raise ValueError(f"{asked}; expected at least 2 samples a lapse; make the lapses longer")
    if count > _MOST_LAPSES:
        raise ValueError(f"{asked}; expected at most {_MOST_LAPSES} lapses; make them longer")
    if count * samples > max(_MOST_SAMPLES, 2 * num_samples):
        raise ValueError(
            f"{asked}; expected at most {_MOST_SAMPLES} samples in all; make the lapses shorter"
        )
    return [Segment(index, index * samples, samples) for index in range(count)]


def _whole_steps(duration: float, dt: float) -> int:
    """Number of time steps in a duration [s]."""
    if not (np.isfinite(duration) and duration > 0.0):
        raise ValueError(f"duration: found {duration}; expected a positive number of seconds")
    steps = duration / dt
    whole = round(steps)
    if whole and abs(steps - whole) > _WHOLE * whole:
        below, above = np.floor(steps) * dt, np.ceil(steps) * dt
        raise ValueError(
            f"duration: found {duration:g} s, {steps:.6g} time steps of {dt:g} s; expected a whole "
            f"number of time steps; use {below:g} or {above:g} s"
        )
    return whole
