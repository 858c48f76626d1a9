# SPDX-License-Identifier: MIT
"""Only what a scene calls for is assembled and solved: the counts of the work show it."""

from dataclasses import asdict

import numpy as np
import pytest

from fenics_hytf.lapse import equations
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import simulate


def scene(**changes):
    harmonic = {"amplitude": 1.0, "frequency": 2.0, "cycles": 4, "samples": 256}
    base = {
        "mesh": {"box": {"size": [8.0, 4.0], "cells": [8, 4]}},
        "soil": {"sand": {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3}},
        "motion": [{"direction": "x", "harmonic": harmonic}],
        "output": {"receivers": {"top": [4.0, 4.0]}},
    }
    return Scene.from_dict(base | changes)


def test_a_pure_harmonic_solves_one_line():
    work = simulate(scene()).work
    assert (work.factorisations, work.solves, work.excited_lines) == (1, 1, 1)


def test_without_effects_only_elasticity_and_mass_are_assembled():
    work = simulate(scene(lapses={"count": 4})).work
    assert work.assemblies == {"mass": 1, "elasticity": 4}
    assert work.inverse_mappings == 0


def test_material_damping_adds_the_imaginary_part():
    soil = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3, "damping": 0.05}
    work = simulate(scene(soil={"sand": soil})).work
    assert work.assemblies == {"mass": 1, "elasticity": 2}


def test_each_effect_adds_its_own_form():
    effects = {"rayleigh": {"alpha": 0.1, "beta": 1e-3}, "geometric_stiffness": True}
    work = simulate(scene(effects=effects)).work
    assert work.assemblies == {"mass": 1, "elasticity": 1, "rayleigh": 1, "geometric": 1}


def test_convection_weighs_the_mass_in_every_lapse():
    work = simulate(scene(effects={"convection": True}, lapses={"count": 4})).work
    assert work.assemblies["mass"] == 4


@pytest.mark.parametrize("effect", [None, "geometric_stiffness"])
def test_a_form_that_is_not_called_for_is_never_compiled(effect, monkeypatch):
    made = []
    original = equations.GeometricForm

    def spy(domain):
        made.append(domain)
        return original(domain)

    monkeypatch.setattr(equations, "GeometricForm", spy)
    simulate(scene(effects={effect: True} if effect else {}))
    assert len(made) == (1 if effect else 0)


def test_points_carry_only_what_an_effect_needs():
    from fenics_hytf.lapse import ground

    seen = []
    original = ground.seed

    def spy(*arguments):
        seen.append(original(*arguments))
        return seen[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ground, "seed", spy)
        simulate(scene())
        simulate(scene(effects={"convection": True, "geometric_stiffness": True}))
    assert set(seen[0].history) == set()
    assert set(seen[1].history) == {"velocity", "acceleration", "strain", "stress"}


def test_softening_costs_a_factorisation_a_new_minimum_and_nothing_where_it_is_off():
    soil = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3}
    curves = {"strain": [1e-6, 1e-2], "modulus": [1.0, 0.1], "damping": [0.01, 0.2]}

    def run(**softening):
        effects = {"equivalent_linear": True, "gravity": True} | softening
        soils = {"sand": soil | {"curves": curves}}
        shown = []
        result = simulate(scene(soil=soils, effects=effects), snapshot=shown.append)
        return result, {**asdict(result.work), "wall_s": None}, set(shown[-1].points)

    never, work, names = run()
    off, work_off, names_off = run(softening=False)
    assert (work, names) == (work_off, names_off)
    assert never.lapses[0].softening is off.lapses[0].softening is None
    on, work_on, names_on = run(softening=True)
    assert names_on - names == {"softest", "permanent_displacement"}
    assert work_on == work | {"factorisations": work["factorisations"] + 1}
    assert on.lapses[0].softening.softest.max() < 1


def test_zero_motion_moves_nothing():
    # A record of zeros excites no line: no factorisation, and every history is zero.
    zeros = {"amplitude": 0.0, "frequency": 2.0, "cycles": 4, "samples": 64}
    result = simulate(scene(motion=[{"direction": "x", "harmonic": zeros}]))
    assert result.work.factorisations == 0
    assert not np.any(result.history("displacement"))
