# SPDX-License-Identifier: MIT
"""A ground-motion record: acceleration at equal time steps, in SI units."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

import numpy as np
import numpy.typing as npt
from scipy.integrate import cumulative_trapezoid

RealArray = npt.NDArray[np.float64]

GRAVITY = 9.80665
"""Standard gravity [m/s^2]; turns accelerations in g into SI."""


class RecordError(ValueError):
    """A record that cannot be used: says where, what was found, what was expected, what to do."""

    @classmethod
    def at(
        cls,
        path: str | PathLike[str],
        line: int | None,
        found: str,
        expected: str,
        advice: str,
    ) -> RecordError:
        """Error at a line of a file.

        Args:
            path: The file.
            line: Number of the line, from 1, or ``None`` for the file as a whole.
            found: What is there.
            expected: What should be there.
            advice: What to do about it.

        Returns:
            The error, to be raised.
        """
        where = f"{path}" if line is None else f"{path}, line {line}"
        return cls(f"{where}: found {found}; expected {expected}; {advice}")


@dataclass(frozen=True, eq=False)
class Record:
    """Acceleration sampled at equal time steps; sample ``j`` is at ``j * dt``.

    Attributes:
        acceleration: [m/s^2], shape ``(num_samples,)``, at least two samples, read-only.
        dt: Time step [s].
        name: What to call the record.

    Raises:
        RecordError: If there are fewer than two samples, a sample is not finite, or the time
            step is not positive.
    """

    acceleration: RealArray
    dt: float
    name: str = "record"

    def __post_init__(self) -> None:
        """Check and freeze."""
        acceleration = np.array(self.acceleration, dtype=np.float64)
        if acceleration.ndim != 1 or acceleration.size < 2:
            raise RecordError(
                f"record '{self.name}': found acceleration of shape {acceleration.shape}; expected "
                "one row of at least 2 samples; give a longer record"
            )
        faulty = np.flatnonzero(~np.isfinite(acceleration))
        if faulty.size:
            raise RecordError(
                f"record '{self.name}': found {acceleration[faulty[0]]} at sample {faulty[0]} "
                f"({faulty.size} in all); expected finite numbers; repair the record"
            )
        if not (np.isfinite(self.dt) and self.dt > 0.0):
            raise RecordError(
                f"record '{self.name}': found time step {self.dt} s; expected a positive number; "
                "give the time step in seconds"
            )
        acceleration.flags.writeable = False
        object.__setattr__(self, "acceleration", acceleration)
        object.__setattr__(self, "dt", float(self.dt))

    @property
    def num_samples(self) -> int:
        """Number of samples."""
        return self.acceleration.size

    @property
    def time(self) -> RealArray:
        """Time of every sample [s], shape ``(num_samples,)``."""
        return self.dt * np.arange(self.num_samples, dtype=np.float64)

    @property
    def duration(self) -> float:
        """Number of samples times the time step [s]: the period of the discrete transform."""
        return self.num_samples * self.dt

    @property
    def pga(self) -> float:
        """Largest absolute acceleration [m/s^2]."""
        return float(np.abs(self.acceleration).max())

    def velocity(self) -> RealArray:
        """Velocity from rest by the trapezoidal rule [m/s], shape ``(num_samples,)``."""
        velocity: RealArray = cumulative_trapezoid(self.acceleration, dx=self.dt, initial=0.0)
        return velocity

    def scaled(self, pga_g: float | None = None, scale: float | None = None) -> Record:
        """Copy scaled to a peak or by a factor; without either, the record itself.

        Args:
            pga_g: Wanted largest absolute acceleration [g]; the polarity is kept.
            scale: Factor [-]; a negative one turns the polarity.

        Returns:
            The scaled record.

        Raises:
            ValueError: If both are given, or one is out of range.
            RecordError: If a record that is zero throughout shall get a peak.
        """
        if pga_g is not None and scale is not None:
            raise ValueError(f"scale: found pga_g = {pga_g} as well; expected one of the two")
        if pga_g is not None:
            if not (np.isfinite(pga_g) and pga_g > 0.0):
                raise ValueError(f"pga_g: found {pga_g}; expected a positive peak in g")
            if self.pga == 0.0:
                raise RecordError(
                    f"record '{self.name}': found zero acceleration throughout; expected a peak "
                    f"to scale to {pga_g} g; check the record or use scale"
                )
            scale = pga_g * GRAVITY / self.pga
        if scale is None:
            return self
        if not np.isfinite(scale):
            raise ValueError(f"scale: found {scale}; expected a finite factor")
        return Record(scale * self.acceleration, self.dt, self.name)

    def padded(self, num_samples: int) -> Record:
        """Copy with zeros appended.

        Args:
            num_samples: Wanted number of samples, at least the present one.

        Returns:
            The longer record.

        Raises:
            ValueError: If the record is longer than that.
        """
        missing = num_samples - self.num_samples
        if missing < 0:
            raise ValueError(
                f"record '{self.name}': found {self.num_samples} samples; expected at most "
                f"{num_samples}, the length to pad to"
            )
        return Record(np.pad(self.acceleration, (0, missing)), self.dt, self.name)
