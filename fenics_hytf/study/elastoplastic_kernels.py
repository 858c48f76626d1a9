# SPDX-License-Identifier: MIT
"""Compiled loops of the march of a section that yields: its cells, its state, a step.

Stresses, strains and the law between them are those of :mod:`fenics_hytf.study.elastoplastic`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

RealArray = npt.NDArray[np.float64]


class Cells(NamedTuple):
    """What the compiled march knows of the n cells, with four Gauss points each."""

    nodes: npt.NDArray[np.int64]  # shape (n, 4)
    gradients: RealArray  # of the shape functions [1/m], shape (n, 4 points, 4 nodes, 2)
    dilatation: RealArray  # those that e is made of, same shape
    volume: RealArray  # filled, a metre thick [m^3], shape (n, 4)
    moduli: RealArray  # K + G/3 and G [Pa], shape (n, 2)
    cohesion: RealArray  # [Pa], shape (n,)


class State(NamedTuple):
    """What a march carries along, overwritten as it goes.

    Attributes:
        displacement: u [m], shape ``(num_nodes, 2)``.
        velocity: [m/s], same shape.
        stress: p, s and τ, tension positive [Pa], shape ``(num_cells, 4, 3)``.
        viscous: Viscous part of them [Pa], same shape.
        plastic_strain: Plastic shear strain along its path, ∫√(ḋ_p² + γ̇_p²) dt [-], shape
            ``(num_cells, 4)``.
    """

    displacement: RealArray
    velocity: RealArray
    stress: RealArray
    viscous: RealArray
    plastic_strain: RealArray

    def copy(self) -> State:
        """Return a state of its own."""
        return State(*(array.copy() for array in self))


@njit(cache=True)
def resist(cells, state, force):  # type: ignore[no-untyped-def]
    """Subtract ∫ Bᵀ (σ + σ_v) dV from forces of the nodes."""
    for cell in range(cells.nodes.shape[0]):
        for point in range(4):
            volume = cells.volume[cell, point]
            p = volume * (state.stress[cell, point, 0] + state.viscous[cell, point, 0])
            s = volume * (state.stress[cell, point, 1] + state.viscous[cell, point, 1])
            t = volume * (state.stress[cell, point, 2] + state.viscous[cell, point, 2])
            for corner in range(4):
                node = cells.nodes[cell, corner]
                x = cells.gradients[cell, point, corner, 0]
                y = cells.gradients[cell, point, corner, 1]
                force[node, 0] -= p * cells.dilatation[cell, point, corner, 0] + s * x + t * y
                force[node, 1] -= p * cells.dilatation[cell, point, corner, 1] - s * y + t * x


@njit(cache=True)
def strain(cells, state, increment, rate, damp_slip):  # type: ignore[no-untyped-def]
    """Strain the cells by an increment of the displacement, rate = β/h; returns viscous work."""
    work = 0.0
    for cell in range(cells.nodes.shape[0]):
        volumetric, shear = cells.moduli[cell, 0], cells.moduli[cell, 1]
        cohesion = cells.cohesion[cell]
        for point in range(4):
            e, d, g = 0.0, 0.0, 0.0
            for corner in range(4):
                node = cells.nodes[cell, corner]
                x = cells.gradients[cell, point, corner, 0]
                y = cells.gradients[cell, point, corner, 1]
                e += cells.dilatation[cell, point, corner, 0] * increment[node, 0]
                e += cells.dilatation[cell, point, corner, 1] * increment[node, 1]
                d += x * increment[node, 0] - y * increment[node, 1]
                g += y * increment[node, 0] + x * increment[node, 1]
            stress, viscous = state.stress[cell, point], state.viscous[cell, point]
            s, t = stress[1] + shear * d, stress[2] + shear * g
            radius = np.sqrt(s * s + t * t)
            if radius > cohesion:
                s, t = s * cohesion / radius, t * cohesion / radius
                state.plastic_strain[cell, point] += (radius - cohesion) / shear
            viscous[0] = rate * volumetric * e
            viscous[1] = rate * (shear * d if damp_slip else s - stress[1])
            viscous[2] = rate * (shear * g if damp_slip else t - stress[2])
            stress[0], stress[1], stress[2] = stress[0] + volumetric * e, s, t
            work += cells.volume[cell, point] * (viscous[0] * e + viscous[1] * d + viscous[2] * g)
    return work


@njit(cache=True)
def _stored(cells, state):  # type: ignore[no-untyped-def]
    """Elastic energy, and energy that yielding has dissipated."""
    elastic, plastic = 0.0, 0.0
    for cell in range(cells.nodes.shape[0]):
        for point in range(4):
            volume, slip = cells.volume[cell, point], state.plastic_strain[cell, point]
            p, s, t = (
                state.stress[cell, point, 0],
                state.stress[cell, point, 1],
                state.stress[cell, point, 2],
            )
            deviator = (s * s + t * t) / cells.moduli[cell, 1]
            elastic += 0.5 * volume * (p * p / cells.moduli[cell, 0] + deviator)
            if slip > 0.0:  # without, the cohesion may be infinite
                plastic += volume * cells.cohesion[cell] * slip
    return elastic, plastic


@njit(cache=True)
def march(cells, ground, state, drive, h, substeps, watched, histories, energy):  # type: ignore[no-untyped-def]
    """Steps of half a kick, a drift and half a kick, which are central differences."""
    mass, weight, free, beta, damp_slip = ground
    u, v = state.displacement, state.velocity
    first, load, force = u.copy(), np.empty_like(u), np.empty_like(u)
    increment = np.zeros_like(u)
    work, viscous_work = 0.0, 0.0
    last = (drive.shape[0] - 1) * substeps
    for step in range(last + 1):
        sample, part = step // substeps, (step % substeps) / substeps
        for k in range(2):
            a = drive[sample, k]
            if part > 0.0:
                a += part * (drive[sample + 1, k] - a)
            for node in range(mass.size):
                load[node, k] = weight[node, k] + mass[node] * a
        force[:] = load
        resist(cells, state, force)
        if step > 0:
            _kick(force, mass, free, v, 0.5 * h)
            work += 0.5 * np.sum(load * increment)
        if part == 0.0:
            histories[1][sample] = np.sqrt(np.sum((u - first) ** 2, axis=1).max())
            for number in range(watched.size):
                histories[0][sample, number] = u[watched[number]] - first[watched[number]]
            kinetic = 0.5 * np.sum(mass * np.sum(v * v, axis=1))
            elastic, plastic = _stored(cells, state)
            energy[sample] = np.array([work, kinetic, elastic, plastic, viscous_work])
        if step < last:
            _kick(force, mass, free, v, 0.5 * h)
            increment[:] = h * v
            work += 0.5 * np.sum(load * increment)
            u += increment
            viscous_work += strain(cells, state, increment, beta / h, damp_slip)


@njit(cache=True)
def _kick(force, mass, free, velocity, duration):  # type: ignore[no-untyped-def]
    """Change the velocity of what is free."""
    for node in range(mass.size):
        for k in range(2):
            if free[node, k]:
                velocity[node, k] += duration * force[node, k] / mass[node]
