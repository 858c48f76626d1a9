# SPDX-License-Identifier: MIT
"""Blocks on a rigid base with air round them, and their matrices, small enough for dense algebra.

Stiffness is held against what it might have been: a cell's constants by the share that is filled,
or that of the points everywhere.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy import sparse
from scipy.linalg import eigh, eigvalsh

from fenics_hytf.domain import build, facet_cells
from fenics_hytf.lapse import Equations, Filling, FillingSurvey, material, seed_points, survey
from fenics_hytf.operators import GhostForm, InternalForce, strain_rows
from fenics_hytf.particles import Points, gradient_matrices, move
from fenics_hytf.study.stability.ground import csr
from support.meshes import scene

SELF = MPI.COMM_SELF
SOFT = {"density": 1800.0, "shear_modulus": 1e6, "poisson": 0.3, "damping": 0.0}
DAMPED = {"damping": 0.05}
BAND = 2 * np.pi * np.linspace(0.0, 10.0, 101)
AIR = 2  # cells of it beside and above
SINGULAR = 1e12  # condition of what is left to round-off


@dataclass(frozen=True, eq=False)
class Unheld(Filling):
    """Loose cells without a ghost term."""

    def ghost(self, domain, strength=None):
        return None


@dataclass(frozen=True, eq=False)
class HeldEverywhere(Filling):
    """A ghost term on all facets of cells at the edge, loose or not."""

    strength: float = 1 / 30

    def ghost(self, domain, strength=None):
        facets, cells = facet_cells(domain.mesh)
        both = domain.input_cells[cells]
        at_edge = self.filled[both].all(axis=1) & self.edge[both].any(axis=1)
        return GhostForm(domain, facets[at_edge], self.strength)


def as_kind(filling: Filling, kind: type[Filling], **options) -> Filling:
    given = (filling.weight, filling.edge, filling.share, filling.fill, filling.gap)
    return kind(*given, **options)


def section(
    wide: int,
    high: int,
    dim: int = 2,
    size: float = 1.0,
    soil: dict | None = None,
    degree: int = 1,
    **sections,
):
    """A scene of soil, some cells high, with room for a block some cells wide in its middle.

    Args:
        wide: Cells of the block across.
        high: Cells of soil.
        dim: Dimensions.
        size: Of a cell [m].
        soil: What differs from the usual one.
        degree: Of displacement.
        sections: Of the scene.
    """
    cells = [wide + 2 * AIR] * (dim - 1) + [high + AIR]
    mesh = {
        "box": {"size": [n * size for n in cells], "cells": cells},
        "regions": [{"soil": "clay", "below": high * size}, {"soil": "air"}],
        "empty": ["air"],
        "degree": degree,
    }
    usual = {"effects": {"convection": True}}
    return scene(mesh, soil={"clay": SOFT | (soil or {})}, **(usual | sections))


def in_block(wide: int, high: int, size: float = 1.0) -> Callable:
    """Whether places are in the block of such a scene."""

    def inside(x: np.ndarray) -> np.ndarray:
        across = (x[:, :-1] > AIR * size) & (x[:, :-1] < (AIR + wide) * size)
        return across.all(axis=1) & (x[:, -1] < high * size)

    return inside


def only(points: Points, chosen: np.ndarray) -> None:
    points.assign({name: values[chosen] for name, values in points.arrays().items()})


class Ground:
    """Matrices of what points fill.

    Args:
        case: The scene.
        keep: Which places have soil.
        moved: Displacement of the points; or what it does to them, if it returns nothing.
        kind: How loose cells are held, and its options; as the package does if ``None``.
        come_off: Whether bodies that hang on nothing are taken out.
    """

    def __init__(self, case, keep=None, moved=None, kind=None, come_off=True, **options):
        self.case, self.domain = case, build(case, SELF)
        self.points = seed_points(case, self.domain)
        if keep is not None:
            only(self.points, keep(self.points.x))
        if moved is not None:
            by = moved(self.points)
            if by is not None:
                move(self.domain.mesh, self.points, by)
        look = FillingSurvey(case, self.domain)
        if not come_off:
            look._held = []  # nothing is asked to be held
        filling = look(self.points)
        self.filling = filling if kind is None else as_kind(filling, kind, **options)
        self.equations = Equations(case, self.domain, Counter())
        self.equations.occupy(self.filling)
        self.equations.weigh(self.points)
        self.soil = survey(case, self.domain, self.points, self.filling)
        moduli = self.soil.secant(np.zeros(self.domain.num_cells))
        self.law = material(self.soil, moduli, case.solver)
        lapse = self.equations.assemble(self.soil, self.law)
        self.terms = [(csr(matrix), function) for matrix, function in lapse.system.terms]
        self.b = lapse.loads[0].array_r.copy()
        self.T = csr(self.equations.T).real

    @property
    def K(self) -> np.ndarray:
        """Real stiffness, ghost included."""
        return self.terms[0][0].toarray().real

    @property
    def M(self) -> np.ndarray:
        return self.terms[-1][0].toarray().real

    def A(self, omega: float) -> np.ndarray:
        return sum(function(1j * omega) * matrix for matrix, function in self.terms).toarray()

    def nodal(self, omega: float) -> np.ndarray:
        """u of all nodes for a unit of base acceleration, shape ``(num_nodes, gdim)``."""
        return (self.T @ np.linalg.solve(self.A(omega), self.b)).reshape(-1, self.domain.gdim)

    def stiffness(self, located, volume: np.ndarray) -> np.ndarray:
        """Σ V Bᵀ D B of places, with D written out."""
        lame, shear = self.law.real.at(self.domain.input_cells[located.cell])
        B = strain_rows(gradient_matrices(located, self.domain.V), self.domain.gdim)
        normal = self.domain.gdim
        size = 3 * normal - 3
        D = np.zeros((len(located), size, size))
        D[:, range(size), range(size)] = shear[:, None]
        D[:, range(normal), range(normal)] *= 2
        D[:, :normal, :normal] += lame[:, None, None]
        blocks = sparse.block_diag(list(D * volume[:, None, None])) @ B
        return (self.T.T @ (B.T @ blocks) @ self.T).toarray()

    def by_share(self) -> np.ndarray:
        """What the constants of cells by the share that is filled would make of K."""
        gauss = InternalForce(self.domain)
        share = self.filling.weight[self.domain.input_cells[gauss.sites.cell]]
        return self.stiffness(gauss.sites, gauss.volume * share)

    def by_points(self) -> np.ndarray:
        """What the points of all cells would, without a ghost term."""
        return self.stiffness(self.points, self.points.volume)


def condition(A: np.ndarray, norm: int = 2) -> float:
    return float(np.real(np.linalg.cond(A, norm)))


def zero_modes(K: np.ndarray) -> int:
    power = eigvalsh(K)
    return int((power < 1e-12 * power[-1]).sum())


def lowest(K: np.ndarray, M: np.ndarray, count: int = 1) -> np.ndarray:
    """Natural frequencies [Hz]; M may be singular, K may not."""
    period = eigh(M, K, eigvals_only=True)[::-1][:count]  # 1/ω²
    return 1 / np.sqrt(period) / (2 * np.pi)


# ---------------------------------------------------------------- what points do


def translated(by: float, dim: int = 2) -> Callable:
    return lambda points: np.tile(np.eye(dim)[0] * by, (len(points), 1))


def cut(wide: int, high: int, fraction: float) -> Callable:
    """Points of the last column and row of a block stand in a fraction of their cells."""

    def squeeze(points: Points) -> np.ndarray:
        by = np.zeros_like(points.x)
        for axis, last in ((0, AIR + wide - 1), (-1, high - 1)):
            inside = points.x[:, axis] - last
            there = inside > 0
            by[there, axis] = (fraction - 1) * inside[there]
            points.volume[there] *= fraction
            points.mass[there] *= fraction
        return by

    return squeeze
