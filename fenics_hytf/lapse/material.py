# SPDX-License-Identifier: MIT
"""The material law of every cell at a complex frequency: a sum of real constants times functions.

    D(s) = Σ_j f_j(s) D(λ_j, G_j)

Hysteretic laws have two parts, G real and G imaginary times i·sign(ω) (see
:mod:`fenics_hytf.soil.complex_modulus`). The causal Maxwell law has a relaxed part and one for
each branch (:mod:`fenics_hytf.soil.maxwell`). With Poisson's ratio kept the whole elasticity tensor
takes G(s)/G, with the bulk modulus kept its deviator does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fenics_hytf.frequency import ScalarFunction, constant, hysteretic
from fenics_hytf.lapse.ground import Ground, Moduli
from fenics_hytf.scene import Scene, Solver
from fenics_hytf.soil import (
    RELAXATION_TIMES,
    branch_weights,
    branches,
    complex_factor,
    relaxed_factor,
    wave_factors,
)

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_MOST_DAMPING = 0.95  # of a Maxwell law, at the rim of an absorbing layer
_JUMP = 1e12  # s far above every rate 1/τ [1/s]


@dataclass(frozen=True)
class ElasticConstants:
    """Lamé's λ and the shear modulus of every cell [Pa], shape ``(num_cells,)``."""

    lame_lambda: RealArray
    shear_modulus: RealArray

    @property
    def youngs_modulus(self) -> RealArray:
        """E of every cell [Pa]."""
        lame, shear = self.lame_lambda, self.shear_modulus
        return shear * (3 * lame + 2 * shear) / (lame + shear)

    def at(self, cells: npt.NDArray[np.integer]) -> tuple[RealArray, RealArray]:
        """λ and G of some cells."""
        return self.lame_lambda[cells], self.shear_modulus[cells]


@dataclass(frozen=True)
class Part:
    """One part of a law.

    Attributes:
        name: What its matrix is kept under.
        constants: Of every cell.
        function: f(s).
        relaxation_time: τ of a Maxwell branch [s], ``None`` for other parts.
    """

    name: str
    constants: ElasticConstants
    function: ScalarFunction
    relaxation_time: float | None = None

    @property
    def instantaneous(self) -> float:
        """Share of the part in the stiffness against a jump, f(s → ∞) on the real axis."""
        return float(np.real(self.function(complex(_JUMP))))


@dataclass(frozen=True)
class Material:
    """The law of all cells, in the order of the input.

    Attributes:
        real: Elastic constants at the frequency at which the modulus is G.
        parts: The parts; the first one is never without stiffness.
    """

    real: ElasticConstants
    parts: tuple[Part, ...]


def part_functions(parts: Sequence[Part], s: ComplexArray) -> ComplexArray:
    """f_j(s) of some parts of a law.

    Args:
        parts: The parts.
        s: Complex frequencies [rad/s], shape ``(num_lines,)``.

    Returns:
        [-], shape ``(len(parts), num_lines)``.
    """
    return np.array([[part.function(complex(z)) for z in s] for part in parts])


def material(ground: Ground, moduli: Moduli, solver: Solver) -> Material:
    """The law that a scene's convention makes of secant moduli and damping.

    Args:
        ground: The ground, for Poisson's ratio, the small-strain bulk modulus and what an absorbing
            layer adds.
        moduli: Secant modulus and damping of every cell.
        solver: Convention of the complex modulus, what is kept, reference frequency.

    Returns:
        The law; without any damping one part.
    """
    if solver.complex_modulus == "maxwell":
        return _maxwell(ground, moduli, solver)
    G = moduli.shear_modulus * complex_factor(moduli.damping, solver.complex_modulus)
    lame = _lame(ground, G, solver.keep)
    real = ElasticConstants(lame.real, G.real)
    if ground.absorbing is not None:
        absorbed = 1 + 2j * ground.absorbing
        lame, G = lame.real * absorbed + 1j * lame.imag, G.real * absorbed + 1j * G.imag
    parts = [Part("real", real, constant)]
    if np.any(G.imag):
        parts.append(Part("imaginary", ElasticConstants(lame.imag, G.imag), hysteretic))
    return Material(real, tuple(parts))


def elastic_constants(ground: Ground, solver: Solver) -> ElasticConstants:
    """Small-strain constants of every cell.

    Args:
        ground: The ground.
        solver: What is kept of the elastic constants as G changes.

    Returns:
        The constants.
    """
    return ElasticConstants(_lame(ground, ground.shear_modulus, solver.keep), ground.shear_modulus)


def with_bulk_kept(ground: Ground, shear_modulus: RealArray) -> ElasticConstants:
    """Constants of cells whose deviator alone has softened.

    Args:
        ground: The ground.
        shear_modulus: G of every cell [Pa], shape ``(num_cells,)``.

    Returns:
        The constants, with the bulk modulus of small strain.
    """
    return ElasticConstants(_lame(ground, shear_modulus, "bulk"), shear_modulus)


def _lame(ground: Ground, G: npt.NDArray[Any], keep: str) -> npt.NDArray[Any]:
    """λ that belongs to a shear modulus, real or complex."""
    nu = ground.poisson
    if keep == "poisson":
        return G * (2 * nu / (1 - 2 * nu))
    bulk = ground.shear_modulus * 2 * (1 + nu) / (3 * (1 - 2 * nu))
    return bulk - 2 / 3 * G


def _maxwell(ground: Ground, moduli: Moduli, solver: Solver) -> Material:
    G = moduli.shear_modulus
    real = ElasticConstants(_lame(ground, G, solver.keep), G)
    damping = moduli.damping if ground.absorbing is None else moduli.damping + ground.absorbing
    damping = np.minimum(damping, _MOST_DAMPING)
    assert solver.reference_frequency is not None
    relaxed = G * relaxed_factor(damping, solver.reference_frequency)
    parts = [Part("real", ElasticConstants(_lame(ground, relaxed, solver.keep), relaxed), constant)]
    for number, (weight, tau) in enumerate(
        zip(branch_weights(damping).T, RELAXATION_TIMES, strict=True)
    ):
        if np.any(weight):
            share = relaxed * weight
            # Of the deviator alone where the bulk modulus is kept: λ = −2/3 G.
            lame = _lame(ground, share, "poisson") if solver.keep == "poisson" else -2 / 3 * share
            constants = ElasticConstants(lame, share)
            parts.append(Part(f"branch {number}", constants, branches[number], tau))
    return Material(real, tuple(parts))


def rock_factors(scene: Scene) -> tuple[complex, complex]:
    """Complex over real modulus of P and of S waves in the rock below a base.

    Under the causal Maxwell law dashpots are real, ρV: the root of a modulus with memory has no
    finite memory itself. With a damping ratio of 0.5 % in the rock that is 0.2 % in the motion.
    """
    rock, solver = scene.boundary.rock, scene.solver
    assert rock is not None
    if solver.complex_modulus == "maxwell":
        return 1.0, 1.0
    return wave_factors(rock.damping, rock.poisson, solver.complex_modulus, solver.keep)
