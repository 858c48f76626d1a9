# SPDX-License-Identifier: MIT
"""What cells see of a response by its directions, against what they see by its lines."""

import numpy as np
import pytest
from mpi4py import MPI
from support.meshes import SOIL, scene

from fenics_hytf.frequency import ReducedSweep
from fenics_hytf.simulation import simulate

WORLD = MPI.COMM_WORLD


def shaken(law: str, tolerance: float, comm: MPI.Comm = WORLD):
    """Two lapses that hand over, under a pulse."""
    motion = {"synthetic": {"pga_g": 0.2, "dt": 0.02, "n": 100, "f1": 0.5, "f2": 5.0}}
    return simulate(
        scene(
            {"box": {"size": [12.0, 6.0], "cells": [6, 3], "cell": "quadrilateral"}},
            ("soil",),
            soil={"soil": SOIL | {"damping": 0.05}},
            motion=[motion | {"direction": "x"}],
            boundary={"left": "dashpot", "right": "dashpot"},
            lapses={"count": 2, "continuity": "transient"},
            solver={"complex_modulus": law, "tolerance": tolerance},
            output={"receivers": {"top": [6.0, 6.0]}},
        ),
        comm,
        group_size=comm.size if law == "maxwell" else 1,  # one mesh for all ranks, or one each
    )


@pytest.mark.mpi
@pytest.mark.parametrize("law", ["maxwell", "hysteretic"])
@pytest.mark.parametrize(("tolerance", "kind"), [(1e-5, np.float32), (1e-9, np.float64)])
def test_by_directions_and_by_lines(law, tolerance, kind, monkeypatch, figure):
    limit = 100 * np.finfo(kind).eps  # sums of some hundred numbers, in the sweep's precision
    by_directions = shaken(law, tolerance)
    monkeypatch.setattr(ReducedSweep, "has_directions", False)
    by_lines = shaken(law, tolerance)
    for name in ("strain", "stress", "acceleration", "velocity", "displacement"):
        worst = 0.0
        for one, other in zip(by_directions.lapses, by_lines.lapses, strict=True):
            found, expected = (getattr(lapse.cells, f"peak_{name}") for lapse in (one, other))
            worst = max(worst, np.abs(found - expected).max() / expected.max())
        figure(f"peak {name} by directions, {law}, tolerance {tolerance:g}", worst, limit)


@pytest.mark.mpi
def test_energy_on_ranks_that_share_a_mesh(figure):
    shared, alone = shaken("maxwell", 1e-9), shaken("maxwell", 1e-9, MPI.COMM_SELF)
    for one, other in zip(shared.lapses, alone.lapses, strict=True):
        assert one.energy is not None and other.energy is not None
        for name in ("input", "damping", "imbalance"):
            found, expected = getattr(one.energy, name), getattr(other.energy, name)
            # each sweep leaves up to its tolerance of every line
            figure(f"energy, {name}", abs(found - expected) / other.energy.input, 1e-8)


def test_ground_that_rests_has_no_directions():
    """Two motions of nought in a cell held all round leave a sweep without a single one."""
    wave = {"amplitude": 0.0, "frequency": 1.25, "cycles": 1, "samples": 80}
    held = dict(zip(("left", "right", "front", "back"), ("fixed", "roller") * 2, strict=True))
    resting = scene(
        {"box": {"size": [1.0, 1.0, 1.0], "cells": [1, 1, 1], "cell": "hexahedron"}},
        ("soil",),
        soil={"soil": SOIL},
        motion=[{"direction": direction, "harmonic": wave} for direction in ("x", "y")],
        boundary=held,
        lapses={"count": 2, "continuity": "transient"},
        effects={"calm": {"sides": ["left"], "thickness": 0.4}},
        solver={"complex_modulus": "hysteretic"},
        output={"receivers": {"top": [1.0, 1.0, 1.0]}},
    )
    for lapse in simulate(resting, MPI.COMM_SELF).lapses:
        assert not lapse.displacement.any() and not lapse.total_acceleration.any()
        assert not lapse.cells.peak_strain.any() and not lapse.cells.peak_stress.any()
