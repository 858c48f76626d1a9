# SPDX-License-Identifier: MIT
"""Slopes on a weak seam through whole simulations, against the same ones marched in time.

In the time domain they yield wherever they are too weak: nothing is told where they slip.
"""

import copy
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import meshio
import numpy as np
import pytest
from support.reference import slope2d_case
from support.sliding import (
    DENSITY,
    GRAVITY,
    in_file,
    open_energy,
    simulate_slope2d,
    sine,
    slope2d,
    total,
)

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import Result, simulate
from fenics_hytf.study.elastoplastic import Section, elastoplastic_slope
from fenics_hytf.study.sliding_slope import reference_motion

SINE = sine(4, 400, 0.25)
STRONG, SEAM = 150e3, 17e3  # [Pa]
MODULUS = DENSITY * 200.0**2


def k_y_over_k_max(result: Result) -> float:
    """With k_max that of the linear response."""
    driving = max(lapse.slip.driving.max() for lapse in result.lapses)
    return result.lapses[0].slip.yield_coefficient * GRAVITY / driving


def blocks(result: Result, analysis: str) -> float:
    """Slip of a sliding-block analysis, ``rigid`` or ``decoupled`` [m]."""
    return float(sum(getattr(lapse.slip, analysis) for lapse in result.lapses))


def described(result: Result) -> str:
    k_y = result.lapses[0].slip.yield_coefficient
    return (
        f"k_y {k_y:.4f}, k_max {k_y / k_y_over_k_max(result):.3f}, slip {total(result):.3f}, "
        f"rigid {blocks(result, 'rigid'):.3f}, decoupled {blocks(result, 'decoupled'):.3f} m"
    )


# ---------------------------------------------------------------- on squares, which it cuts


@cache
def under_the_sine(lapses: int) -> Result:
    return simulate_slope2d(slope2d(SINE, lapses))


def test_a_slope_under_a_sine(figure):
    result = under_the_sine(1)
    assert blocks(result, "rigid") < total(result)
    case = slope2d_case("sine")
    expected = case["slip_elastoplastic_m"]
    said = f"slope2d, sine, elastoplastic {expected:.3f} m: {described(result)}"
    figure(said, abs(total(result) / expected - 1), 0.2)
    # The file has two digits of it.
    off = abs(k_y_over_k_max(result) / case["ky_over_kmax"] - 1)
    figure("slope2d, sine: k_y/k_max", off, 0.045)


@pytest.mark.skipif(
    find_spec("pyslammer") is None, reason="pyslammer, an optional extra, is not installed"
)
def test_a_slope_under_a_record(tmp_path, figure):
    expected = slope2d_case("Northridge")["slip_elastoplastic_m"]
    result = simulate_slope2d(slope2d(in_file(tmp_path, *reference_motion("Northridge"))))
    said = f"slope2d, Northridge, elastoplastic {expected:.3f} m: {described(result)}"
    figure(said, abs(total(result) / expected - 1), 0.2)
    figure("slope2d, Northridge: energy left open", abs(open_energy(result)), 0.03)


def test_lapses_do_not_change_the_slip(figure):
    once, several = under_the_sine(1), under_the_sine(4)
    figure("slope2d, sine: slip in 4 lapses", abs(total(several) / total(once) - 1), 5e-3)


@pytest.mark.parametrize("lapses", [1, 4])
def test_the_books_of_energy_close(lapses, figure):
    result = under_the_sine(lapses)
    open_by = abs(open_energy(result))
    figure(f"slope2d, sine: energy left open, {lapses} lapses", open_by, 0.03)
    energies = [lapse.energy for lapse in result.lapses]
    assert sum(e.slip for e in energies) > 0.2 * sum(e.input for e in energies)


def test_a_mechanism_that_does_not_slip_changes_nothing(figure):
    """A seam as strong as the rest: the same to round-off as without a word of sliding."""
    strong = slope2d(SINE, lapses=2, seam=STRONG)
    without = copy.deepcopy(strong)
    del without["effects"]["sliding"]
    without["lapses"]["continuity"] = "transient"
    without["solver"] = {"complex_modulus": "maxwell"}
    still, never = (simulate_slope2d(data) for data in (strong, without))
    assert total(still) == 0.0
    u, v = (result.history("displacement") for result in (still, never))
    figure("slope2d that does not slip", np.abs(u - v).max() / np.abs(v).max(), 1e-12)
    assert still.work.assemblies == never.work.assemblies
    assert still.work.solves == never.work.solves


# ---------------------------------------------------------------- on a mesh that fits


MESH = Path(__file__).parents[2] / "meshes" / "slope_seam.msh"


def elastoplastic_twin() -> Section:
    """The very cells of the mesh file that hold soil."""
    mesh = meshio.read(MESH)
    x, names = mesh.points[:, :2], {tag: name for name, (tag, _) in mesh.field_data.items()}
    region = np.array([names[tag] for tag in mesh.cell_data_dict["gmsh:physical"]["quad"]])
    cells = mesh.cells_dict["quad"][region != "air"]
    a, b = x[cells[:, 1]] - x[cells[:, 0]], x[cells[:, 2]] - x[cells[:, 0]]
    backward = a[:, 0] * b[:, 1] < a[:, 1] * b[:, 0]
    cells[backward] = cells[backward, ::-1]
    fixed = np.zeros(x.shape, bool)
    fixed[x[:, 1] == 0] = True
    fixed[(x[:, 0] == 0) | (x[:, 0] == x[:, 0].max()), 0] = True
    return Section(
        x,
        cells,
        density=DENSITY,
        shear_modulus=MODULUS,
        bulk_modulus=10 * MODULUS,
        cohesion=np.where(region[region != "air"] == "seam", SEAM, STRONG),
        fixed=fixed,
        beta=5e-4,
        gravity=(0.0, -GRAVITY),
    )


def test_a_slope_on_a_mesh_that_fits(figure):
    expected = elastoplastic_slope(elastoplastic_twin(), *reference_motion("sine")).slip
    data = slope2d(SINE)
    data["mesh"] = {"file": str(MESH), "empty": ["air"]}
    data["soil"]["soil"] = data["soil"].pop("clay")
    result = simulate(Scene.from_dict(data))
    said = f"slope on its mesh, elastoplastic {expected:.3f} m: {described(result)}"
    figure(said, abs(total(result) / expected - 1), 0.2)
