# SPDX-License-Identifier: MIT
"""Curves of an equivalent-linear soil: G/G_max and damping ratio against shear strain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

RealArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curve:
    """G/G_max and damping ratio against the effective shear strain, as a table.

    Between its points the table is linear in ln gamma, outside constant. Damping need not grow with
    strain: measured and published tables dip slightly at both ends, and nothing relies on it.

    Attributes:
        strain: Shear strain [-], not percent, positive and increasing, shape ``(num_points,)``.
        modulus: G/G_max [-], in (0, 1], nowhere increasing, shape ``(num_points,)``.
        damping: Damping ratio D [-], not percent, in [0, 1), shape ``(num_points,)``.

    Raises:
        ValueError: If the table has fewer than two points, columns of different lengths, or
            values out of range or order.
    """

    strain: RealArray
    modulus: RealArray
    damping: RealArray

    def __post_init__(self) -> None:
        """Check and freeze."""
        for name in ("strain", "modulus", "damping"):
            object.__setattr__(self, name, _column(name, getattr(self, name)))
        sizes = self.strain.size, self.modulus.size, self.damping.size
        if min(sizes) < 2 or len(set(sizes)) != 1:
            raise ValueError(
                "curves: found {} strains, {} moduli and {} damping ratios; expected equally "
                "many, at least 2".format(*sizes)
            )
        _check_range("strain", self.strain, self.strain > 0.0, "positive numbers")
        _check_range(
            "modulus", self.modulus, (self.modulus > 0.0) & (self.modulus <= 1.0), "0 < G/Gmax <= 1"
        )
        _check_range(
            "damping",
            self.damping,
            (self.damping >= 0.0) & (self.damping < 1.0),
            "0 <= damping < 1, as a ratio, not in percent",
        )
        _check_order("strain", self.strain, np.diff(self.strain) > 0.0, "increase")
        _check_order("modulus", self.modulus, np.diff(self.modulus) <= 0.0, "do not increase")

    @property
    def small_strain_damping(self) -> float:
        """Damping ratio at the smallest strain of the table [-]."""
        return float(self.damping[0])

    def evaluate(self, strain: npt.ArrayLike) -> tuple[RealArray, RealArray]:
        """Interpolate.

        Args:
            strain: Effective shear strain [-], any shape; 0 gives the small-strain values.

        Returns:
            G/G_max [-] and damping ratio [-], each with the shape of ``strain``.
        """
        inside = np.clip(np.asarray(strain, dtype=np.float64), self.strain[0], self.strain[-1])
        x, table = np.log(inside), np.log(self.strain)
        return (
            np.asarray(np.interp(x, table, self.modulus)),
            np.asarray(np.interp(x, table, self.damping)),
        )


def _column(name: str, values: npt.ArrayLike) -> RealArray:
    """Read-only copy of one column of a table."""
    try:
        column = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"curves.{name}: found {values!r}; expected a list of numbers") from error
    if column.ndim != 1:
        raise ValueError(f"curves.{name}: found shape {column.shape}; expected a list of numbers")
    column.flags.writeable = False
    return column


def _check_range(
    name: str, values: RealArray, inside: npt.NDArray[np.bool_], expected: str
) -> None:
    """Raise ValueError at the first value out of range; NaN is out of every range."""
    faulty = np.flatnonzero(~(inside & np.isfinite(values)))
    if faulty.size:
        at = faulty[0]
        raise ValueError(
            f"curves.{name}: found {values[at]} at position {at + 1}; expected {expected}"
        )


def _check_order(
    name: str, values: RealArray, ordered: npt.NDArray[np.bool_], expected: str
) -> None:
    """Raise ValueError at the first pair out of order."""
    faulty = np.flatnonzero(~ordered)
    if faulty.size:
        at = faulty[0]
        raise ValueError(
            f"curves.{name}: found {values[at]} then {values[at + 1]} at positions {at + 1} and "
            f"{at + 2}; expected values that {expected}"
        )
