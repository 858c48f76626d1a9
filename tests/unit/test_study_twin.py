# SPDX-License-Identifier: MIT
"""The viscous twin: its first mode and damping against closed forms, and its rest at the end."""

import copy

import numpy as np
import pytest
from scipy.linalg import eigh, eigvals
from support.meshes import scene

from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate
from fenics_hytf.study.matrices import assemble
from fenics_hytf.study.twin import RESIDUE, SECOND, viscous_twin

HEIGHT, CELLS = 20.0, 20
SAND = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3, "damping": 0.04}
CLAY = {"density": 1600.0, "shear_wave_velocity": 120.0, "poisson": 0.3, "damping": 0.10}
RECORD = {"synthetic": {"n": 400, "t1": 0.5, "t2": 2.0, "f2": 6.0}, "pga": 0.1}
ROCK = {"density": 2200.0, "shear_wave_velocity": 800.0, "poisson": 0.25, "damping": 0.01}


def column(clay: float = 0.0, direction: str = "x", **sections) -> Scene:
    """A column of sand of degree 2, a share of it clay on top."""
    split = round(clay * CELLS)
    layers = [
        {"thickness": count * HEIGHT / CELLS, "soil": soil, "cells": count}
        for count, soil in ((split, "clay"), (CELLS - split, "sand"))
        if count
    ]
    given = {
        "soil": {layer["soil"]: {"sand": SAND, "clay": CLAY}[layer["soil"]] for layer in layers},
        "motion": [RECORD | {"direction": direction}],
        "boundary": {"left": "tied", "right": "tied"},
        "output": {"receivers": {"top": [0.5, HEIGHT]}},
    }
    mesh = {"column": {"width": 1.0, "layers": layers}, "degree": 2}
    return scene(mesh, **(given | sections))


def rayleigh(twin: Scene) -> tuple[float, float]:
    assert twin.effects.rayleigh is not None
    return twin.effects.rayleigh.alpha, twin.effects.rayleigh.beta


def ratio(twin: Scene, omega: float) -> float:
    """Rayleigh damping ratio at a circular frequency."""
    alpha, beta = rayleigh(twin)
    return alpha / (2 * omega) + beta * omega / 2


@pytest.mark.parametrize(
    ("direction", "velocity"),
    [("x", 200.0), ("y", 200.0 * np.sqrt(2 * 0.7 / 0.4))],
    ids=["shear", "compression"],
)
@pytest.mark.parametrize("base", ["rigid", "compliant"])
def test_damping_ratio_at_the_frequencies_of_a_uniform_column(direction, velocity, base, figure):
    # f = V/4H on a base that is held; rock below does not change which mode is the ground's own.
    boundary = {"left": "tied", "right": "tied"}
    motion = RECORD | {"direction": direction}
    if base == "compliant":
        boundary["base"] = {"compliant": ROCK}
        motion["input"] = "outcrop"
    twin = viscous_twin(column(boundary=boundary, motion=[motion]))
    first = 2 * np.pi * velocity / (4 * HEIGHT)
    for omega in (first, SECOND * first):
        error = abs(ratio(twin, omega) / SAND["damping"] - 1)
        # settled to 1e-6 of ω², and the mesh is finer than that: 20 cells of degree 2
        figure(f"{base} base, {direction}: damping at {omega:.0f} rad/s", error, 1e-5)


def test_damping_ratio_of_two_soils_is_that_of_the_mode(figure):
    case = column(clay=0.3)
    matrices = assemble(case)
    K, M = matrices.stiffness.toarray(), matrices.mass.toarray()
    squared = eigh(K, M, eigvals_only=True)[0]
    # The first eigenvalue of K + iεK_i is ω²(1 + 2iεζ), in the imaginary part to order ε².
    little = 1e-3
    values = eigvals(K + 1j * little * matrices.hysteresis.toarray(), M)
    expected = values[np.argmin(values.real)].imag / (2 * squared * little)
    found = ratio(viscous_twin(case), np.sqrt(squared))
    assert SAND["damping"] < expected < CLAY["damping"]
    figure("damping of the first mode of two soils", abs(found / expected - 1), 1e-5)


def test_what_the_twin_is():
    curves = {"strain": [1e-6, 1e-3], "modulus": [1.0, 0.5], "damping": [0.03, 0.2]}
    soil = {"sand": SAND | {"curves": curves}}
    case = column(
        soil=soil,
        effects={"equivalent_linear": True, "rayleigh": {"alpha": 0.2, "beta": 1e-4}},
        lapses={"count": 3, "continuity": "steady"},
        solver={"max_frequency": 10.0, "sweep": "reduced", "tolerance": 1e-5},
    )
    before = copy.deepcopy(case.data)
    twin = viscous_twin(case)
    assert case.data == before
    assert twin.effects.named == ("rayleigh",)
    assert len(twin.segments) == 1
    assert (twin.solver.sweep, twin.solver.tolerance) == ("reduced", 1e-5)
    assert twin.solver.max_frequency is None
    assert assemble(twin).hysteresis is None
    # damping = 0.04 holds where the loop does not run; the scene's own Rayleigh damping stays
    plain = viscous_twin(column())
    given = np.subtract(rayleigh(twin), rayleigh(plain))
    assert given == pytest.approx([0.2, 1e-4], rel=1e-9)


@pytest.mark.parametrize("solver", [{}, {"reference_frequency": 3.0}, {"keep": "bulk"}])
def test_the_twin_of_several_transient_lapses(solver):
    """Their law hangs on frequency, the twin's damping on the damping ratio alone."""
    case = column(lapses={"count": 3}, solver=solver)
    assert case.solver.complex_modulus == "maxwell"
    twin, plain = viscous_twin(case), viscous_twin(column(solver={"keep": case.solver.keep}))
    assert (len(twin.segments), twin.lapses.continuity) == (1, "steady")
    assert rayleigh(twin) == rayleigh(plain)


def test_the_record_is_padded_until_rest(figure):
    """The periodic response is that from rest: what the next period begins with is nothing."""
    twin = viscous_twin(column(clay=0.3))
    padded = twin.base_acceleration[0]
    assert not padded[400:].any()
    response = simulate(twin).history("total_acceleration")[0, 0]
    samples = round(0.5 / twin.dt)  # half a period of the first mode, about
    alpha, beta = rayleigh(twin)
    omega = 2 * np.pi * 2.0  # between those of all clay and of all sand
    grown = np.exp((alpha + beta * omega**2) / 2 * samples * twin.dt)
    left = abs(response[-samples:]).max() / abs(response[400 : 400 + samples]).max()
    figure("free vibration left at the end", left, RESIDUE * grown)
    figure("and no longer than needed", left, RESIDUE / 10, at_least=True)


@pytest.mark.parametrize(
    ("sections", "reason"),
    [
        ({"soil": {"sand": SAND | {"damping": 0.0}}}, "expected damped soils"),
        ({"boundary": {"left": "free_field", "right": "free_field"}}, "free_field"),
        (
            {
                "boundary": {"left": "dashpot", "right": "dashpot"},
                "effects": {"calm": {"sides": ["left"], "thickness": 0.5}},
            },
            "absorbing layer",
        ),
    ],
    ids=["undamped", "free field", "absorbing layer"],
)
def test_no_twin(sections, reason):
    with pytest.raises(ValueError, match=reason):
        viscous_twin(column(**sections))


def test_no_twin_beside_air():
    regions = [{"soil": "sand", "below": 8.0}, {"soil": "air"}]
    mesh = {"box": {"size": [1.0, 12.0], "cells": [1, 12]}, "regions": regions, "empty": ["air"]}
    receivers = {"receivers": {"top": [0.5, 8.0]}}
    motion = [RECORD | {"direction": "x"}]
    given = scene(mesh, soil={"sand": SAND}, motion=motion, output=receivers)
    with pytest.raises(ValueError, match="regions without soil"):
        viscous_twin(given)
