# SPDX-License-Identifier: MIT
"""Hard cases 13 and 14: cells that are empty, and ground that has come off the rest.

Naively unknowns of empty cells get a 1 on the diagonal, which costs as many digits as the stiffness
has; and a clump that hangs on nothing makes K singular by its rigid motions.
"""

import numpy as np
import pytest
from support.blocks import (
    AIR,
    BAND,
    DAMPED,
    SELF,
    SINGULAR,
    SOFT,
    Ground,
    condition,
    csr,
    in_block,
    section,
    translated,
    zero_modes,
)

from fenics_hytf.lapse import DetachedError, Unknowns
from fenics_hytf.particles import Points

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
        assert len(away) and np.abs(u[near]).max() > 0
        figure("|u| where there is no ground", np.abs(u[away]).max(), 0)
        T = csr(Unknowns(ground.domain, case.supports).T).real  # with nodes of empty cells
        ours = (T.T @ ground.T).toarray()
        padded.append(condition(ours @ ground.K @ ours.T + np.diag(ours.sum(axis=1) == 0)))
    growth = conditions[1] / conditions[0]
    figure("growth of cond with E 1e6 times as large", abs(growth - 1), 1e-6)
    figure("cond of K", conditions[0], 1.2e3)
    figure("naive, a 1 on the diagonal: cond of K", padded[0], 1e7, at_least=True)
    figure("naive, a 1 on the diagonal: growth", padded[1] / padded[0], 1e5, at_least=True)


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
    figure("naive, kept: zero modes", zero_modes(naive.K), rigid, at_least=True)
    figure("naive, kept: cond of K", condition(naive.K), SINGULAR, at_least=True)

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
        figure("mass off the ledger", abs(mass / expected - 1), 1e-14)
        np.testing.assert_array_equal(ground.filling.filled, without.filling.filled)
        wrong = sum(int(np.sum(~np.isfinite(ground.nodal(omega)))) for omega in BAND[::20])
        figure("displacements that are no numbers", wrong, 0)
    error = np.abs(ground.K - without.K).max() / np.abs(without.K).max()
    figure("K against that of ground without the clump", error, 1e-14)
    case = section(side, side, dim, points={"detached": "error"})
    with pytest.raises(DetachedError, match=r"no longer hang together with held ground"):
        Ground(case, inside, thrown)
