# SPDX-License-Identifier: MIT
"""The 24 m profile, equivalent linear, against pystrata: cases c and d of the reference.

Cases c stand on a rigid base under a within motion, cases d on a compliant one under an outcrop
motion.

Tolerance of the loop 1e-4: the loop's own error then stays below a tenth of the limits.
"""

import numpy as np
import pytest
from support.reference import G0, column, load, motion, rms

from fenics_hytf.simulation import simulate

CASES = [
    f"{base}_darendeli24_{record}_pga{pga}"
    for base in "cd"
    for record in ("synthetic", "NIS090")
    for pga in ("0p05", "0p2", "0p5")
]


def errors(
    name: str, cells: int, strain_from: np.ndarray | None = None, tolerance: float = 1e-4
) -> dict[str, float]:
    """Largest errors in per cent (damping in percentage points), and the iterations."""
    case = load(name)
    period = case["motion"]["fa_length"] * case["motion"]["dt_s"]
    loop = {"tolerance": tolerance, "max_iterations": 40}
    scene = column(case, motion(case), cells=cells, duration=period, equivalent_linear=loop)
    result = simulate(scene, strain_from=strain_from)
    lapse = result.lapses[0]
    expected = {k: np.array(v) for k, v in case["results"].items() if isinstance(v, list)}
    acceleration = expected["surface_accel_g"]
    surface = lapse.total_acceleration[0, 0, : len(acceleration)] / G0
    middle = slice(cells // 2, None, cells)
    state = lapse.cells
    pga = case["results"]["surface_pga_g"]
    within = abs(result.within_acceleration).max() / G0 / case["results"]["base_within_pga_g"]

    def worst(values: np.ndarray, name: str) -> float:
        return 100 * float(np.max(abs(values[middle] / expected[name] - 1)))

    return {
        "PGA": 100 * abs(abs(surface).max() / pga - 1),
        "within PGA": 100 * abs(within - 1),
        "surface acceleration rms": 100 * rms(surface - acceleration) / rms(acceleration),
        "strain": worst(state.peak_strain, "max_shear_strain_mid"),
        "G": worst(state.g_over_gmax, "G_over_Gmax"),
        "damping": 100 * float(np.max(abs(state.damping[middle] - expected["damping"]))),
        "stress": worst(state.peak_stress / 1e3, "max_shear_stress_mid_kPa"),
        "iterations": len(lapse.loop.change),
    }


LIMITS = {
    "PGA": (0.2, "%"),
    "within PGA": (0.2, "%"),
    "surface acceleration rms": (0.5, "%"),
    "strain": (1.5, "%"),
    "G": (1.5, "%"),
    "damping": (0.3, "points"),
    "stress": (1.5, "%"),  # no limit was set for it: strain's
    "iterations": (30, ""),
}


@pytest.mark.parametrize("name", CASES)
def test_one_cell_per_sublayer(name, figure):
    found = errors(name, cells=1)
    for quantity, (limit, unit) in LIMITS.items():
        figure(f"{name.replace('darendeli24_', '')} {quantity}", found[quantity], limit, unit)


def test_three_cells_share_the_modulus(figure):
    # Three cells a sublayer, its modulus from the strain of the middle one: what is left of the
    # error is the mesh's, and that of strain falls with the square of the cell, nine times. Roughly
    # ten times is asked for; an independent finite-element code got 8.6 to 10 times here.
    # A recorded motion, whose mean is nought: the reference leaves out strain at zero frequency,
    # which shifts its peaks by 2e-4 under the synthetic record's mean.
    name = "c_darendeli24_NIS090_pga0p2"
    middle = 3 * (np.arange(72) // 3) + 1
    coarse, fine = errors(name, 1, tolerance=1e-6), errors(name, 3, middle, tolerance=1e-6)
    for quantity in ("surface acceleration rms", "strain", "G"):
        ratio = fine[quantity] / coarse[quantity]
        figure(f"{quantity}, three cells over one", ratio, 1 / 8, "")
