# SPDX-License-Identifier: MIT
"""A slope on a weak seam, that sliding is compared with.

It is ten metres high at 1:1.5 on five metres of foundation, V_s = 200 m/s, K = 10 G, c = 150 kPa
but in a seam 2.6 m high that leaves it at its toe:

    ground surface y = 5 + clip((35 − x)/1.5, 0, 10),   seam |y − 6 − 0.3 (35 − x)| < 1.3, y > 5

in square cells, whose cohesion is that at their centre; those filled less than 20 % are left out.
The base is held, the sides x = 0 and x = 60 m are on rollers, C = βK with β = 0.5 ms.

Its slips belong to cells of 1 m and to this seam, and compare methods on the same grid: in cells of
0.5 m the seam is less of a staircase and slips more than twice as far, and 3 % of its cohesion are
10 to 25 % of the slip.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.motion import recorded
from fenics_hytf.study.elastoplastic import Section

RealArray = npt.NDArray[np.float64]

GRAVITY = 9.81
"""[m/s^2]."""

MOTIONS = ("sine", "Northridge")
"""Four cycles of 1 Hz, 0.25 g, and two seconds more; a record scaled to 0.35 g."""

WIDTH, HEIGHT = 60, 15  # of the box of cells [m]
TOE, CREST = 35.0, 20.0  # x [m]
SHEAR_MODULUS = 1800.0 * 200.0**2  # [Pa]
BETA = 5e-4  # [s]
_LEAST_FILLED = 0.2
_STRIPS = 200  # of a cell, whose filled heights are summed


def reference_slope(
    seam_cohesion: float = 17e3, cell_size: float = 1.0, *, damp_slip: bool = False
) -> Section:
    """The slope.

    Args:
        seam_cohesion: c of the seam [Pa].
        cell_size: Side of a cell, which divides a metre [m].
        damp_slip: See :class:`Section`.

    Returns:
        The section.

    Raises:
        ValueError: The cells do not divide a metre.
    """
    across = round(1 / cell_size) if cell_size > 0 else 0
    if across < 1 or not np.isclose(across * cell_size, 1.0):
        raise ValueError(f"cell_size: found {cell_size} m; expected a metre or a part of it")
    nx, ny = WIDTH * across, HEIGHT * across
    x, y = np.meshgrid(np.linspace(0, WIDTH, nx + 1), np.linspace(0, HEIGHT, ny + 1))
    nodes = np.stack([x.ravel(), y.ravel()], axis=1)
    corner = (np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)).ravel()
    cells = np.stack([corner, corner + 1, corner + nx + 2, corner + nx + 1], axis=1)
    filled = _filled(nodes[corner], cell_size)
    cells, filled = cells[filled >= _LEAST_FILLED], filled[filled >= _LEAST_FILLED]
    centre = nodes[cells].mean(axis=1)
    above = centre[:, 1] - 6.0 - 0.3 * (TOE - centre[:, 0])
    seam = (np.abs(above) < 1.3) & (centre[:, 1] > 5.0)
    fixed = np.zeros(nodes.shape, dtype=bool)
    fixed[nodes[:, 1] == 0.0] = True
    fixed[(nodes[:, 0] == 0.0) | (nodes[:, 0] == WIDTH), 0] = True
    return Section(
        nodes,
        cells,
        density=1800.0,
        shear_modulus=SHEAR_MODULUS,
        bulk_modulus=10.0 * SHEAR_MODULUS,
        cohesion=np.where(seam, seam_cohesion, 150e3),
        fixed=fixed,
        weight=filled,
        beta=BETA,
        gravity=(0.0, -GRAVITY),
        damp_slip=damp_slip,
    )


def reference_motion(name: str) -> tuple[RealArray, float]:
    """A motion of the slope's base, and how far apart its samples are.

    Args:
        name: One of ``MOTIONS``.

    Returns:
        Acceleration along x, away from the toe where it drives downslope [m/s^2], shape
        ``(num_samples,)``; from sample to sample [s].

    Raises:
        ValueError: Another name.
        RecordError: The package pyslammer, which brings the record, is not installed.
    """
    if name == "sine":
        time = 0.01 * np.arange(600)
        return -0.25 * GRAVITY * np.sin(2 * np.pi * time) * (time < 4.0), 0.01
    if name == "Northridge":
        record = recorded("Northridge_1994_PAC-175")
        return record.scaled(scale=0.35 * GRAVITY / record.pga).acceleration[:450], record.dt
    raise ValueError(f"motion: found {name!r}; expected one of {', '.join(MOTIONS)}")


def _filled(lowest: RealArray, size: float) -> RealArray:
    """Part of each cell below the ground surface, from its lower left corners."""
    x = lowest[:, 0, None] + (np.arange(_STRIPS) + 0.5) / _STRIPS * size
    surface = 5.0 + np.clip((TOE - x) / 1.5, 0.0, 10.0)
    return np.array(np.clip((surface - lowest[:, 1, None]) / size, 0.0, 1.0).mean(axis=1))
