# SPDX-License-Identifier: MIT
"""What can go wrong in a sweep."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt


class SweepError(RuntimeError):
    """A line of the sweep could not be solved.

    Attributes:
        s: Complex frequency of the line [rad/s].
    """

    def __init__(self, s: complex, message: str) -> None:
        self.s = s
        super().__init__(f"at {s.imag / (2 * math.pi):.6g} Hz (s = {s:.6g} rad/s): {message}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the message, which ranks pass to each other, and not by the arguments."""
        return _revive, (type(self), self.args, self.__dict__)


def _revive(kind: type[SweepError], args: tuple[str], state: dict[str, Any]) -> SweepError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error


class FactorisationError(SweepError):
    """The matrix of a line is singular, or the factorisation failed otherwise."""

    def __init__(self, s: complex) -> None:
        super().__init__(
            s,
            "found a matrix that cannot be factorised; expected a regular one: an undamped "
            "resonance needs damping, and every part of the mesh a support",
        )


class ResonanceError(SweepError):
    """A line lies on an undamped resonance: the response there is not a number but a round-off."""

    def __init__(self, s: complex, amplification: float) -> None:
        super().__init__(
            s,
            f"found inertia forces {amplification:.3g} times the load, an undamped resonance; "
            "expected damping, or a frequency beside the resonance",
        )


class ResidualError(SweepError):
    """The solution of a line does not satisfy its equations."""

    def __init__(self, s: complex, residual: float, tolerance: float) -> None:
        super().__init__(
            s,
            f"found a relative residual of {residual:.3g}; expected at most {tolerance:.3g}: the "
            "line may be an undamped resonance, or stiff ground ride on ground a million times as "
            "soft, where round-off is larger; add damping or loosen solver.tolerance",
        )


class ReductionError(SweepError):
    """The reduced sweep used up its budget before every line was solved.

    Attributes:
        lines: Complex frequencies of the lines that are left [rad/s], shape ``(n,)``.
    """

    def __init__(
        self, lines: npt.NDArray[np.complex128], residual: float, tolerance: float
    ) -> None:
        self.lines = lines
        hertz = lines.imag / (2 * math.pi)
        super().__init__(
            complex(lines[0]),
            f"found {len(lines)} lines from {hertz.min():.6g} to {hertz.max():.6g} Hz with "
            f"relative residuals up to {residual:.3g}; expected at most {tolerance:.3g} within the "
            'budget of factorisations: loosen solver.tolerance, or use solver.sweep = "direct"',
        )
