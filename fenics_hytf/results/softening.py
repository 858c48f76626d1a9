# SPDX-License-Identifier: MIT
"""What softened ground has given way by, as ``summary.json`` has it.

It is the stiffness-reduction estimate of Lee (1974) and Serff et al. (1976), and no law of
displacement; see :mod:`fenics_hytf.lapse.softening`. Histories of displacement are those of the
vibration alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from fenics_hytf.lapse import LapseResult

NOTE = (
    "a stiffness-reduction estimate (Lee, 1974; Serff et al., 1976), no law of displacement: it "
    "knows neither strength nor how long shaking lasts"
)


def softening_record(lapse: LapseResult, receivers: tuple[str, ...]) -> dict[str, Any] | None:
    """What the estimate has come to at the end of a lapse.

    Args:
        lapse: The lapse.
        receivers: Names of the receivers.

    Returns:
        Plain values: ``softest``, the least G over its small-strain value of any cell up to then;
        ``largest_m``, the permanent displacement of the point that has moved farthest;
        ``receivers_m``, that of each receiver by component; and ``note``, what it is. ``None``
        where the scene does not call for softening.
    """
    told = lapse.softening
    if told is None:
        return None
    return {
        "softest": float(np.min(told.softest)),
        "largest_m": told.largest,
        "receivers_m": dict(zip(receivers, told.displacement, strict=True)),
        "note": NOTE,
    }
