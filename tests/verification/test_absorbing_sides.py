# SPDX-License-Identifier: MIT
"""Waves that meet a side: what dashpots send back against Lysmer and Kuhlemeyer's closed form.

Two plane waves mirrored in the section's axis make a pattern along the side, cos(k y) or sin(k y),
that sides on rollers half a wave apart (for SH: free ones) do not disturb. So a strip holds one
angle of incidence, and what it sends back is that of either wave alone.
"""

import json
from collections import Counter

import numpy as np
import pytest
from mpi4py import MPI
from support.reference import DATA

from fenics_hytf.domain import build, constraint_matrix
from fenics_hytf.frequency import DynamicSystem, direct_sweep
from fenics_hytf.lapse import Equations, Moduli, material, seed_points, survey
from fenics_hytf.operators import DashpotForm, ElasticForm, assemble_mass
from fenics_hytf.particles import particle_mass_matrix, transfer_matrix
from fenics_hytf.scene import Scene

CLOSED_FORM = json.loads((DATA / "analytic_2d.json").read_text())["lysmer_kuhlemeyer_reflection"]
DENSITY, SPEED = 2000.0, 100.0  # [kg/m3], of shear waves [m/s]
WIDTH, LENGTH = 10.0, 40.0  # of the strip, along the side and across [m]
LIMIT = 0.01  # percentage points; at 30 degrees P waves send back 0.02 to 0.03 % of their energy
PER_CELL = 0.625  # [m], of degree 2: 16 cells a shear wave where one is 10 m long


def strip(kinematics: str, poisson: float, effects: dict | None = None, **sides: object) -> Scene:
    cells = [round(LENGTH / PER_CELL), round(WIDTH / PER_CELL)]
    across = "z" if kinematics == "antiplane" else "y"
    harmonic = {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 8}
    return Scene.from_dict(
        {
            "mesh": {
                "box": {"size": [LENGTH, WIDTH], "cells": cells},
                "degree": 2,
                "kinematics": kinematics,
            },
            "soil": {
                "soil": {"density": DENSITY, "shear_wave_velocity": SPEED, "poisson": poisson}
            },
            "motion": [{"direction": across, "harmonic": harmonic}],
            "boundary": sides,
            "effects": effects or {},
        }
    )


def respond(scene: Scene, frequency: float, loads: list) -> tuple[np.ndarray, np.ndarray]:
    """Nodes, and the nodal motion under forces on the left side, of each load."""
    domain = build(scene, MPI.COMM_SELF)
    points = seed_points(scene, domain)
    x = domain.V.tabulate_dof_coordinates()[:, :2]
    if domain.num_components == 1:
        T = constraint_matrix(domain, {"base": "free"})
        system = shear_across(domain, points)
    else:
        equations = Equations(scene, domain, Counter())
        T = equations.T
        equations.weigh(points)
        ground = survey(scene, domain, points)
        moduli = Moduli(ground.shear_modulus, ground.damping)
        system = equations.assemble(ground, material(ground, moduli, scene.solver)).system
    traction = DashpotForm(domain, ["left"])
    on_left = traction.create_matrix()
    cells = np.ones(len(domain.regions))
    traction.assemble(on_left, cells, cells)  # consistent forces of nodal tractions
    sides = []
    for load in loads:
        values, nodal = on_left.createVecs()
        values.array[:] = load(x[:, 1]).ravel()
        on_left.mult(values, nodal)
        sides.append(T.createVecRight())
        T.multTranspose(nodal, sides[-1])
    sweep = direct_sweep(system, sides, [2j * np.pi * frequency])
    rows = T.getValuesCSR()
    moved = np.zeros((len(x) * domain.num_components, len(loads)), complex)
    filled = np.diff(rows[0]) > 0
    moved[filled] = sweep.solution(0)[rows[1]]
    return x, moved.reshape(len(x), domain.num_components, len(loads))


def shear_across(domain, points) -> DynamicSystem:
    """The system of an antiplane strip with dashpots on its right side, from its operators."""
    elastic, dashpots = ElasticForm(domain), DashpotForm(domain, ["right"])
    K = elastic.create_matrix()
    cells = np.ones(len(domain.regions))
    elastic.assemble(K, 0 * cells, DENSITY * SPEED**2 * cells)
    nodal = particle_mass_matrix(transfer_matrix(points, domain.V), points.mass)
    C = K.duplicate()
    dashpots.assemble(C, 0 * cells, DENSITY * SPEED * cells)
    return DynamicSystem(K, assemble_mass(domain, nodal, K), C)


def angle_of(degrees: float, speed: float) -> tuple[float, float]:
    """Wave number along the side [1/m] and frequency [Hz] of waves of a speed at an angle."""
    if degrees == 0:
        return 0.0, speed / WIDTH
    along = np.pi / WIDTH
    return along, along * speed / np.sin(np.radians(degrees)) / (2 * np.pi)


@pytest.mark.parametrize("degrees", [0, 30])
def test_shear_waves_across_the_plane(degrees, figure):
    along, frequency = angle_of(degrees, SPEED)
    scene = strip("antiplane", 0.25, base="rigid", right="dashpot")
    x, w = respond(scene, frequency, [lambda y: np.cos(along * y)[:, None]])
    k = np.sqrt((2 * np.pi * frequency / SPEED) ** 2 - along**2)
    waves = [
        np.exp(sign * 1j * k * (x[:, 0] - LENGTH)) * np.cos(along * x[:, 1]) for sign in (-1, 1)
    ]
    (there, back), rest = fit(waves, w[:, 0])
    assert rest < 2e-3
    expected = CLOSED_FORM["SH_abs_R"][CLOSED_FORM["angle_deg_from_normal"].index(degrees)] ** 2
    energy = float(abs(back[0] / there[0]) ** 2)
    figure(
        f"SH, {degrees} deg: energy back, % (closed form {100 * expected:.3f})",
        100 * abs(energy - expected),
        LIMIT,
        "points",
    )


def fit(waves: list, motion: np.ndarray) -> tuple[np.ndarray, float]:
    """Amplitudes of waves in a motion, and what they leave of it."""
    basis = np.stack([np.ravel(wave) for wave in waves], axis=1)
    values = motion.reshape(len(basis), -1)
    amplitude, *_ = np.linalg.lstsq(basis, values, rcond=None)
    rest = np.linalg.norm(values - basis @ amplitude) / np.linalg.norm(values)
    return amplitude, float(rest)


def plane_waves(x: np.ndarray, along: float, omega: float, speeds: tuple) -> list:
    """P there, SV there, P back, SV back: displacements of unit amplitude at the side."""
    waves = []
    y, beyond = x[:, 1], x[:, 0] - LENGTH
    for sign in (-1, 1):  # exp(iωt − ikx) goes there
        for kind, speed in zip(("P", "SV"), speeds, strict=True):
            k = sign * np.sqrt((omega / speed) ** 2 - along**2)
            phase = np.exp(1j * k * beyond)
            if kind == "P":
                u = [1j * k * np.cos(along * y), -along * np.sin(along * y)]
            else:
                u = [along * np.cos(along * y), -1j * k * np.sin(along * y)]
            waves.append(np.stack(u, axis=1) * phase[:, None] / (omega / speed))
    return waves


# At 0 degrees an SV wave moves as an SH wave does, and rollers would hold it.
@pytest.mark.parametrize(("kind", "degrees"), [("P", 0), ("P", 30), ("SV", 30)])
@pytest.mark.parametrize("poisson", [0.25, 0.3])
def test_waves_in_the_plane(kind, poisson, degrees, figure):
    ratio = np.sqrt((2 - 2 * poisson) / (1 - 2 * poisson))
    speeds = (ratio * SPEED, SPEED)
    along, frequency = angle_of(degrees, speeds[0] if kind == "P" else SPEED)
    omega = 2 * np.pi * frequency
    scene = strip("plane_strain", poisson, base="roller", top="roller", right="dashpot")
    loads = [
        lambda y: np.stack([np.cos(along * y), 0 * y], axis=1),
        lambda y: np.stack([0 * y, np.sin(along * y)], axis=1),
    ]
    x, u = respond(scene, frequency, loads[: 1 if degrees == 0 else 2])
    waves = plane_waves(x, along, omega, speeds)
    if degrees == 0:
        (there, back), rest = fit([waves[0], waves[2]], u)
        energy = float(abs(back[0] / there[0]) ** 2)
    else:
        amplitude, rest = fit(waves, u)
        scattered = amplitude[2:] @ np.linalg.inv(amplitude[:2])
        flux = [speed * np.sqrt(1 - (along * speed / omega) ** 2) for speed in speeds]
        column = ("P", "SV").index(kind)
        energy = float(abs(scattered[:, column]) ** 2 @ flux / flux[column])
    assert rest < 2e-2
    angles = CLOSED_FORM["angle_deg_from_normal"]
    expected = CLOSED_FORM[f"{kind}_nu{poisson:g}"]["energy_back"][angles.index(degrees)]
    figure(
        f"{kind}, nu {poisson}, {degrees} deg: energy back, % (closed form {100 * expected:.3f})",
        100 * abs(energy - expected),
        LIMIT,
        "points",
    )


def layered_reflection(omega: float, thickness: float, damping: float) -> complex:
    """A P wave that meets a free end behind the layer, cell by cell, of ν = 0.25."""
    modulus = 3 * DENSITY * SPEED**2
    centres = np.arange(PER_CELL / 2, thickness, PER_CELL)  # from the inner edge outwards
    factors = 1 + 2j * damping * (centres / thickness) ** 2
    impedance = np.sqrt(DENSITY * modulus * factors)
    k = omega * np.sqrt(DENSITY / (modulus * factors))
    load = 0.0  # impedance of what is beyond: nothing
    for z, wave in zip(impedance[::-1], k[::-1], strict=True):
        turn = 1j * np.tan(wave * PER_CELL)
        load = z * (load + z * turn) / (z + load * turn)
    own = np.sqrt(DENSITY * modulus)
    return (own - load) / (own + load)


@pytest.mark.parametrize(("thickness", "damping"), [(10.0, 0.5), (20.0, 0.5), (20.0, 1.0)])
def test_an_absorbing_layer(thickness, damping, figure):
    omega = 2 * np.pi * np.sqrt(3) * SPEED / WIDTH  # a P wave is as long as the strip is wide
    calm = {"sides": ["right"], "thickness": thickness, "damping": damping}
    scene = strip("plane_strain", 0.25, {"calm": calm}, base="roller", top="roller")
    x, u = respond(scene, omega / 2 / np.pi, [lambda y: np.stack([0 * y + 1, 0 * y], axis=1)])
    outside = x[:, 0] < LENGTH - thickness - 1e-9
    waves = plane_waves(x[outside], 0.0, omega, (np.sqrt(3) * SPEED, SPEED))
    (there, back), rest = fit([waves[0], waves[2]], u[outside])
    assert rest < 1e-3
    # Phases from the inner edge of the layer, where the closed form has its own.
    shift = np.exp(-4j * np.pi / WIDTH * thickness)
    found, expected = -back[0] / there[0] / shift, layered_reflection(omega, thickness, damping)
    name = f"absorbing layer of {thickness:g} m, D = {damping:g}, a 10 m wave"
    figure(
        f"{name}: reflection, % (closed form {100 * abs(expected):.2f})",
        100 * abs(found - expected),
        0.1,
        "points",
    )
