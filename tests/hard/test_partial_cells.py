# SPDX-License-Identifier: MIT
"""Hard cases 9 to 14: cells that points fill in part, or hardly, or no longer.

Blocks stand on a rigid base with air round them; matrices are small enough for dense algebra.
Stiffness is held against what it might have been: a cell's constants by the share that is filled,
or that of the points everywhere.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse
from scipy.linalg import eigh, eigvalsh
from scipy.sparse.linalg import eigsh
from support.meshes import scene

from fenics_hytf.domain import build, facet_cells
from fenics_hytf.lapse import (
    DetachedError,
    Equations,
    Filling,
    FillingSurvey,
    Unknowns,
    material,
    seed_points,
    survey,
)
from fenics_hytf.operators import STRENGTH, GhostForm, InternalForce, strain_rows
from fenics_hytf.particles import Points, gradient_matrices, move

SELF = MPI.COMM_SELF
SOFT = {"density": 1800.0, "shear_modulus": 1e6, "poisson": 0.3, "damping": 0.0}
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
    wide: int, high: int, dim: int = 2, size: float = 1.0, soil: dict | None = None, **sections
):
    """A scene of soil, some cells high, with room for a block some cells wide in its middle.

    Args:
        wide: Cells of the block across.
        high: Cells of soil.
        dim: Dimensions.
        size: Of a cell [m].
        soil: What differs from the usual one.
        sections: Of the scene.
    """
    cells = [wide + 2 * AIR] * (dim - 1) + [high + AIR]
    mesh = {
        "box": {"size": [n * size for n in cells], "cells": cells},
        "regions": [{"soil": "clay", "below": high * size}, {"soil": "air"}],
        "empty": ["air"],
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


def csr(matrix) -> sparse.csr_matrix:
    start, columns, values = matrix.getValuesCSR()
    return sparse.csr_matrix((values.copy(), columns, start), shape=matrix.getSize())


def condition(A: np.ndarray, norm: int = 2) -> float:
    return float(np.real(np.linalg.cond(A, norm)))


def zero_modes(K: np.ndarray) -> int:
    power = eigvalsh(K)
    return int((power < 1e-12 * power[-1]).sum())


def lowest(K: np.ndarray, M: np.ndarray, count: int = 1) -> np.ndarray:
    """Natural frequencies [Hz]; M may be singular, K may not."""
    period = eigh(M, K, eigvals_only=True)[::-1][:count]  # 1/ω²
    return 1 / np.sqrt(period) / (2 * np.pi)


# ---------------------------------------------------------------- 9


DAMPED = {"damping": 0.05}
BAND = 2 * np.pi * np.linspace(0.0, 10.0, 101)
PLACES = [(0.8, 0.2), (0.5, 0.5), (0.1, 0.1), (0.9, 0.9), (0.01, 0.01)]


def lifted(to: np.ndarray) -> Callable:
    """One point of the block's upper right corner moves to a place."""

    def step(points: Points) -> np.ndarray:
        by = np.zeros_like(points.x)
        one = np.argmax(points.x.sum(axis=1))
        by[one] = to - points.x[one]
        return by

    return step


@pytest.mark.parametrize("place", PLACES, ids=str)
@pytest.mark.parametrize("dim", [2, 3])
def test_09_one_point_in_a_cell_that_shares_a_side(dim, place, figure):
    """Without ghost a zero mode: one point has three strains, and two nodes four displacements."""
    side = 2
    case, inside = section(side, side, dim, soil=DAMPED), in_block(side, side)
    to = np.full(dim, AIR + side - 1 + place[0])
    to[-1] = side + place[1]
    name = f"case 9, {dim}D, a point at {place}"

    naive = Ground(case, inside, lifted(to), Unheld)
    alone = (naive.filling.share > 0) & (naive.filling.share < 0.3)
    assert alone.sum() == 1 and naive.filling.loose.sum() == 2  # it, and the one it came from
    modes = {2: 1, 3: 6}[dim]  # of 12 displacements in space six strains leave six
    assert zero_modes(naive.K) == modes
    ground = Ground(case, inside, lifted(to))
    assert zero_modes(ground.K) == 0
    figure(f"{name}: cond₁ of K", condition(ground.K, 1), 2e3)
    # At a resonance of ground damped by 5 % whole cells themselves have some 5e3.
    taller = section(side, side + 1, dim, soil=DAMPED)

    def with_a_whole_cell(x):
        above = (x[:, :-1] > AIR + side - 1) & (x[:, :-1] < AIR + side)
        return inside(x) | (above.all(axis=1) & (x[:, -1] > side))

    whole = Ground(taller, with_a_whole_cell)
    assert not whole.filling.loose.any()
    band = BAND[:: 1 if dim == 2 else 5]
    worst = max(condition(ground.A(w), 1) for w in band)
    usual = max(condition(whole.A(w), 1) for w in band)
    figure(f"{name}: cond₁ of A over that of whole cells", worst / usual, 4)
    largest = max(np.abs(ground.nodal(w)).max() for w in band)
    limit = 2 * max(np.abs(whole.nodal(w)).max() for w in band)
    figure(f"{name}: |u| against twice that of whole cells", largest, limit, "s²")


@pytest.mark.parametrize("dim", [2, 3])
def test_09_one_point_in_a_cell_that_shares_a_node(dim, figure):
    """Kept as it is it turns about the node: three zero modes at any frequency, ghost or not.

    There is no facet for a ghost to act on. Such a cell has come off, and its point with it.
    """
    side = 2
    case, inside = section(side, side, dim, soil=DAMPED), in_block(side, side)
    to = np.full(dim, AIR + side + 0.3)
    to[-1] = side + 0.4
    for kind in (Unheld, None):
        naive = Ground(case, inside, lifted(to), kind, come_off=False)
        assert zero_modes(naive.K) == {2: 3, 3: 15}[dim]
        conditions = [condition(naive.A(w)) for w in BAND[::20]]
        held = "with" if kind is None else "without"
        name = f"case 9, {dim}D, a corner kept, {held} ghost: cond of A at any frequency"
        figure(name, min(conditions), SINGULAR, at_least=True)
    ground = Ground(case, inside, lifted(to))
    assert ground.points.ledger(SELF).parked == 1
    whole = Ground(case, inside)
    # 15 of 16 points, or 63 of 64, are left; the cell that lost one has none above it.
    name = f"case 9, {dim}D, a corner taken out"
    figure(f"{name}: cond₁ of K", condition(ground.K, 1), 2e3)
    band = BAND[:: 1 if dim == 2 else 2]
    largest = max(np.abs(ground.nodal(w)).max() for w in band)
    limit = 2 * max(np.abs(whole.nodal(w)).max() for w in band)
    figure(f"{name}: |u| against twice that of whole cells", largest, limit, "s²")


# ---------------------------------------------------------------- 10


def translated(by: float, dim: int = 2) -> Callable:
    return lambda points: np.tile(np.eye(dim)[0] * by, (len(points), 1))


@pytest.mark.parametrize(("dim", "side", "steps"), [(2, 4, 40), (2, 8, 10), (3, 4, 5)])
def test_10_a_block_translated_through_a_cell(dim, side, steps, figure):
    """The same block wherever it stands on the grid: by shares of cells it stiffens by 6 %.

    What is in half of a cell is smeared over all of it, and bends less. Points everywhere are a
    quadrature of their own, with the noise of points that cross from cell to cell. Points at the
    edge and Gauss points inside are both right.
    """
    case, inside = section(side, side, dim), in_block(side, side)
    found = []
    for by in np.linspace(0.0, 1.0, steps + 1):
        ground = Ground(case, inside, translated(by, dim))
        ways = (ground.K, ground.by_share(), ground.by_points())
        # In space it sways in two directions at nearly the same frequency.
        swaying = [lowest(K, ground.M, dim - 1) for K in ways]
        found.append((swaying, [condition(K) for K in ways]))
    f1, cond = np.array([f for f, _ in found]), np.array([c for _, c in found])
    off = np.abs(f1 / f1[0] - 1).max(axis=(0, 2))
    name = f"case 10, {dim}D, {side} cells"
    figure(f"{name}: f₁", 100 * off[0], 0.5, "%")
    figure(f"{name}: cond of K", cond[:, 0].max(), 1.2e3)
    # Measured beside it, so that the choice is documented.
    figure(f"{name}: f₁ by shares of cells", 100 * off[1], 2.0, "%", at_least=True)
    figure(f"{name}: f₁ by points everywhere", 100 * off[2], 2.0, "%")
    figure(f"{name}: cond by shares of cells", cond[:, 1].max(), 1.2e3)
    figure(f"{name}: cond by points everywhere", cond[:, 2].max(), 1.2e3)


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


def test_10_cells_cut_to_next_to_nothing(figure):
    """Without a ghost term the condition of K grows like ε⁻⁴ where a corner is cut both ways."""
    side = 3
    case, inside = section(side, side), in_block(side, side)
    fractions = np.array([0.1, 0.01, 1e-3])
    naive = [condition(Ground(case, inside, cut(side, side, f), Unheld).K) for f in fractions]
    growth = np.diff(np.log(naive)) / np.diff(np.log(fractions))
    figure("case 10, cut to ε, without ghost: growth of cond", -growth.max(), 3.5, at_least=True)
    for fraction in (*fractions, 1e-6):
        ground = Ground(case, inside, cut(side, side, fraction))
        figure(f"case 10, cut to {fraction:g}: cond of K", condition(ground.K), 1.2e3)


# ---------------------------------------------------------------- 11


def test_11_units_of_length(figure):
    """In m, mm and km; E/30·h³/3 of the literature would hold by a square of the unit too much."""
    side = 3
    band = 2 * np.pi * np.linspace(0.1, 6.0, 30)

    def measured(unit: float, naive: bool = False) -> tuple[np.ndarray, float]:
        """Transfer functions u_x ω² of all nodes at all frequencies, and the condition of K."""
        soil = DAMPED | {
            "density": SOFT["density"] / unit**3,
            "shear_modulus": SOFT["shear_modulus"] / unit,
        }
        case, inside = section(side, side, size=unit, soil=soil), in_block(side, side, unit)
        options = {"kind": HeldEverywhere, "strength": unit**2 / 30} if naive else {}
        ground = Ground(case, inside, translated(0.3 * unit), **options)
        assert ground.filling.loose.any()
        transfer = np.array([w**2 * ground.nodal(w)[:, 0] for w in band])
        x = ground.domain.V.tabulate_dof_coordinates() / unit
        return transfer[:, np.lexsort(x.round(6).T)], condition(ground.K)

    for naive in (False, True):
        metres, cond = measured(1.0, naive)
        for unit, name in ((1e3, "mm"), (1e-3, "km")):
            other, other_cond = measured(unit, naive)
            error = np.abs(other - metres).max() / np.abs(metres).max()
            if naive:
                figure(f"case 11, {name}, E/30·h³/3: transfer", error, 1e-3, at_least=True)
            else:
                figure(f"case 11, {name}: transfer function", error, 1e-10)
                ratio = max(other_cond / cond, cond / other_cond)
                figure(f"case 11, {name}: cond over that in m", ratio, 2.0)


# ---------------------------------------------------------------- 12


@pytest.mark.parametrize(("wide", "limit"), [(4, 0.2), (8, 0.05), (16, 0.02)])
def test_12_a_ghost_hardly_shifts_a_pillar(wide, limit, figure):
    """5 m by 10 m of whole cells; the term is put on all of its edges, as if they were loose."""
    size, high = 5.0 / wide, 2 * wide
    case, inside = section(wide, high, size=size), in_block(wide, high, size)
    f1 = []
    for kind in (None, HeldEverywhere):
        ground = Ground(case, inside, kind=kind)
        K, M = (ground.terms[i][0].real.tocsc() for i in (0, -1))
        f1.append(np.sqrt(eigsh(K, 1, M, sigma=0.0, return_eigenvectors=False)[0]) / (2 * np.pi))
    assert not ground.filling.loose.any()  # so that the package puts none
    shift = 100 * abs(f1[1] / f1[0] - 1)
    figure(f"case 12, pillar of {wide} cells: shift of f₁ by the ghost", shift, limit, "%")


def test_12_there_is_no_false_peak(figure):
    """A ghost of mass beside that of stiffness rings at √(γ_K/γ_M), wherever cells are loose."""
    side, fraction, gamma = 4, 1e-4, 0.25
    case, inside = section(side + 1, side + 1), in_block(side + 1, side + 1)
    ground = Ground(case, inside, cut(side + 1, side + 1, fraction))
    unheld = Ground(case, inside, cut(side + 1, side + 1, fraction), Unheld)
    K_G = ground.K - unheld.K
    young = float(ground.law.real.youngs_modulus[0])
    ringing = np.sqrt(STRENGTH[2] * young / (3 * gamma * SOFT["density"]))  # at h = 1 m
    M_G = K_G / ringing**2
    block = Ground(section(side, side), in_block(side, side))  # without its slivers
    count = 6
    expected = lowest(block.K, block.M, count)
    figure(
        "case 12: modes of a block with slivers against those without",
        np.abs(lowest(ground.K, ground.M, count) / expected - 1).max(),
        0.02,
    )
    near = np.abs(lowest(ground.K, ground.M + M_G, 40) / (ringing / (2 * np.pi)) - 1) < 0.05
    figure("case 12: false modes with a ghost of mass", near.sum(), 5, at_least=True)
    mine = np.abs(lowest(ground.K, ground.M, 40) / (ringing / (2 * np.pi)) - 1) < 0.05
    true = np.abs(expected / (ringing / (2 * np.pi)) - 1) < 0.05
    assert mine.sum() == true.sum()


def test_12_slivers_in_space(figure):
    """Twists of hollow cells take a stronger term there; what it costs is told."""
    side, count = 3, 6
    case, inside = section(side + 1, side + 1, 3), in_block(side + 1, side + 1)
    ground = Ground(case, inside, cut(side + 1, side + 1, 1e-4))
    block = Ground(case, lambda x: inside(x) & (x[:, 0] < AIR + side) & (x[:, -1] < side))
    off = np.abs(lowest(ground.K, ground.M, count) / lowest(block.K, block.M, count) - 1)
    figure("case 12, 3D: f₁ of a block with slivers against that without", 100 * off[0], 1.0, "%")
    figure("case 12, 3D: its six lowest modes", 100 * off.max(), 3.0, "%")


# ---------------------------------------------------------------- 13


@pytest.mark.parametrize("dim", [2, 3])
def test_13_void_beside_stiff_ground(dim, figure):
    """A 1 on the diagonal for what is empty costs as many digits as the stiffness has."""
    side = 3 if dim == 2 else 2
    conditions, padded = [], []
    for stiffer in (1.0, 1e6):
        soil = {"shear_modulus": stiffer * 1e9 / 2.6, "damping": 0.05}
        case, inside = section(side, side, dim, soil=soil), in_block(side, side)
        ground = Ground(case, inside, translated(0.3, dim))
        conditions.append(condition(ground.K))
        u = ground.nodal(30.0)
        filled = ground.filling.filled[ground.domain.input_cells]
        near = np.unique(ground.domain.V.dofmap.list[filled])
        away = np.setdiff1d(np.arange(len(u)), near)
        assert len(away) and not u[away].any() and np.abs(u[near]).max() > 0
        T = csr(Unknowns(ground.domain, case.supports).T).real  # with nodes of empty cells
        ours = (T.T @ ground.T).toarray()
        padded.append(condition(ours @ ground.K @ ours.T + np.diag(ours.sum(axis=1) == 0)))
    growth = conditions[1] / conditions[0]
    figure(f"case 13, {dim}D: growth of cond with E 1e6 times as large", abs(growth - 1), 1e-6)
    figure(f"case 13, {dim}D: cond of K", conditions[0], 1.2e3)
    figure(f"case 13, {dim}D, a 1 on the diagonal: cond", padded[0], 1e7, at_least=True)
    name = f"case 13, {dim}D, a 1 on the diagonal: growth"
    figure(name, padded[1] / padded[0], 1e5, at_least=True)


# ---------------------------------------------------------------- 14


def thrown(points: Points) -> np.ndarray:
    """The upper right corner of a block flies off."""
    by = np.zeros_like(points.x)
    off = (points.x > np.append(np.full(points.x.shape[1] - 1, AIR + 2.0), 2.0)).all(axis=1)
    by[off] = 1.25
    return by


@pytest.mark.parametrize("dim", [2, 3])
def test_14_a_detached_clump(dim, figure):
    """Kept it is free to move as a rigid body: K is singular and the answer is noise."""
    side = 3
    inside = in_block(side, side)
    rigid = {2: 3, 3: 6}[dim]
    case = section(side, side, dim, points={"detached": "park"})
    naive = Ground(case, inside, thrown, come_off=False)
    assert zero_modes(naive.K) == rigid
    figure(f"case 14, {dim}D, kept: cond of K", condition(naive.K), SINGULAR, at_least=True)

    def standing(x):
        return inside(x) & ~(x > np.append(np.full(dim - 1, AIR + 2.0), 2.0)).all(axis=1)

    without = Ground(case, standing)
    for policy in ("park", "delete"):
        case = section(side, side, dim, soil=DAMPED, points={"detached": policy})
        ground = Ground(case, inside, thrown)
        ledger = ground.points.ledger(SELF)
        count = 4 if dim == 2 else 8
        assert (ledger.parked, ledger.deleted) == ((count, 0) if policy == "park" else (0, count))
        # Of all that was seeded, the block is what was kept here; the rest was dropped by hand.
        mass = ledger.mass + ledger.parked_mass + ledger.deleted_mass
        expected = SOFT["density"] * side**dim
        figure(f"case 14, {dim}D, {policy}: ledger", abs(mass / expected - 1), 1e-14)
        np.testing.assert_array_equal(ground.filling.filled, without.filling.filled)
        for omega in BAND[::20]:
            assert np.isfinite(ground.nodal(omega)).all()
    error = np.abs(ground.K - without.K).max() / np.abs(without.K).max()
    figure(f"case 14, {dim}D: K against that of ground without it", error, 1e-14)
    case = section(side, side, dim, points={"detached": "error"})
    with pytest.raises(DetachedError, match=r"no longer hang together with held ground"):
        Ground(case, inside, thrown)
