# SPDX-License-Identifier: MIT
"""What the curve models share: checks of their parameters, strains of their tables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fenics_hytf.soil.curves import RealArray

ATMOSPHERIC_PRESSURE = 101325.0
"""p_a [Pa]."""

_COARSE = np.asarray(np.logspace(-6.0, -1.5, 20), dtype=np.float64)
_FINE = np.asarray(np.logspace(-6.0, -1.0, 51), dtype=np.float64)


def check(name: str, value: object, inside: bool, expected: str) -> None:
    """Refuse a parameter that is out of range.

    Args:
        name: Its name.
        value: What was given.
        inside: Whether the value is in range.
        expected: What should have been given, with the unit.

    Raises:
        ValueError: If the value is not inside.
    """
    if not inside:
        raise ValueError(f"curves.{name}: found {value}; expected {expected}")


def check_plasticity_index(plasticity_index: float) -> None:
    """Refuse a plasticity index [%] that is negative or not finite (ValueError)."""
    inside = 0.0 <= plasticity_index < np.inf
    check("plasticity_index", plasticity_index, inside, "at least 0, in percent")


def check_mean_stress(mean_stress: float) -> None:
    """Refuse a mean effective stress [Pa] that is not positive and finite (ValueError)."""
    check("mean_stress", mean_stress, 0.0 < mean_stress < np.inf, "a positive stress in Pa")


def check_cycles(cycles: float) -> None:
    """Refuse a number of cycles [-] below 1 or not finite (ValueError)."""
    check("cycles", cycles, 1.0 <= cycles < np.inf, "at least 1")


def at_index(
    plasticity_index: float, indices: Sequence[float], rows: Sequence[Sequence[float]]
) -> RealArray:
    """A column of a table by plasticity, linear between its rows.

    Args:
        plasticity_index: PI [%], in the range of the table.
        indices: PI of the rows, increasing [%].
        rows: G/G_max or damping ratio at the strains of the table [-], a row each.

    Returns:
        Shape ``(num_strains,)``.
    """
    columns = zip(*rows, strict=True)
    return np.array([np.interp(plasticity_index, indices, column) for column in columns])


def table_strains(strain: npt.ArrayLike | None, fine: bool = False) -> RealArray:
    """Shear strains at which a model is tabulated.

    Args:
        strain: Those asked for [-], shape ``(num_points,)``, or ``None``.
        fine: Whether the model's own are ten a decade from 1e-6 to 0.1; else they are 20 from 1e-6
            to 10^-1.5, with which the families after Darendeli (2001) are tabulated elsewhere.

    Returns:
        The strains [-], positive, shape ``(num_points,)``.

    Raises:
        ValueError: If a strain is not positive and finite.
    """
    if strain is None:
        return _FINE if fine else _COARSE
    gamma = np.asarray(strain, dtype=np.float64)
    inside = bool(((gamma > 0.0) & (gamma < np.inf)).all())
    check("strain", gamma.tolist(), inside, "positive numbers")
    return gamma
