# SPDX-License-Identifier: MIT
"""Softening: the stiffness-reduction estimate of permanent displacement.

Ground that shaking has softened bears its weight at a larger strain (Lee 1974; Serff, Seed, Makdisi
and Chang 1976). Points carry the least secant modulus that their ground has had in any lapse. Where
a lapse ends with a lower one, the deviator s of the static stress falls with it, and the softened
ground bears elastically what it then lacks:

    G_min ← min(G_min, G),    s ← s G_min/G_min,old
    K(G_min) u = f_int(σ) − f_int(σ fallen),    σ ← σ fallen + D(G_min) ε(u)

with the small-strain bulk modulus in D. The fall keeps the elastic strain D⁻¹σ, so that increments
add up to what one step would bring, however many lapses it took: in an infinite slope to the shear
strain γ = τ₀(1/G_min − 1/G₀), in elastic ground to u = K(G_min)⁻¹f_g − K(G₀)⁻¹f_g. A lapse, or an
earthquake, that brings no new minimum moves nothing: a stress that fell with every fluctuation of G
would ratchet.

It is an estimate and no law of displacement. Strength is not in it, nor how long shaking lasts, nor
which way it drives: three earthquakes move the ground no more than the strongest one, and in
prototypes it gave 0.25 to 640 times the slip of Newmark's block. It is for ground that deforms
throughout, such as embankments that settle; what slides is the business of
:mod:`fenics_hytf.lapse.sliding`. Nothing of it acts on the vibration, but that points move.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fenics_hytf.domain import Domain
from fenics_hytf.lapse.filling import cell_integrals
from fenics_hytf.lapse.ground import Ground, Moduli
from fenics_hytf.lapse.material import with_bulk_kept
from fenics_hytf.lapse.records import SofteningResult
from fenics_hytf.lapse.starts import largest
from fenics_hytf.lapse.statics import Statics
from fenics_hytf.operators import NORMAL_STRAINS
from fenics_hytf.particles import Points, transfer_matrix

RealArray = npt.NDArray[np.float64]


class Softening:
    """Lets static stress fall with the least secant moduli, and the ground give way.

    Args:
        domain: The domain.
        statics: Static stress and weight.
    """

    def __init__(self, domain: Domain, statics: Statics) -> None:
        self._domain, self._statics = domain, statics

    def __call__(self, points: Points, ground: Ground, moduli: Moduli) -> RealArray | None:
        """Soften the ground of a lapse (collective).

        What the lapse began with out of balance stays so, and acts on the next one.

        Args:
            points: The points, where they were as the ground was surveyed. ``softest``, G_min over
                the small-strain modulus [-], their static stress and ``permanent_displacement`` [m]
                are changed in place.
            ground: The ground of the lapse.
            moduli: Its secant moduli.

        Returns:
            The permanent displacement that it adds at this rank's nodes, ghosts included [m], shape
            ``(num_local_nodes, gdim)``; ``None`` where no modulus is lower than ever before.
        """
        cells = self._domain.input_cells[points.cell]
        before = points["softest"].copy()
        now = np.minimum(before, (moduli.shear_modulus / ground.shear_modulus)[cells])
        if not self._domain.comm.allreduce(bool(np.any(now < before)), MPI.LOR):
            return None
        points["softest"] = now
        fallen = fallen_stress(points["stress"], before, now, ground.poisson[cells])
        softest = self._softest(points) * ground.shear_modulus
        increment = self._statics.redistribute(points, fallen, with_bulk_kept(ground, softest))
        at_points = transfer_matrix(points, self._domain.V) @ increment
        points["permanent_displacement"] = points["permanent_displacement"] + at_points
        return increment

    def result(self, points: Points, displacement: RealArray) -> SofteningResult:
        """What it has come to (collective).

        Args:
            points: The points, in the cells that they were softened in.
            displacement: Permanent displacement of the receivers [m], shape
                ``(num_receivers, num_components)``.

        Returns:
            The record, the same on every rank.
        """
        farthest = largest(self._domain.comm, points["permanent_displacement"])
        return SofteningResult(self._softest(points), displacement, farthest)

    def _softest(self, points: Points) -> RealArray:
        """Of every cell the mean over its points by volume, 1 where it has none."""
        values = np.column_stack([np.ones(len(points)), points["softest"]])
        volume, total = cell_integrals(self._domain, points, values, None).T
        return np.where(volume > 0, total, 1.0) / np.where(volume > 0, volume, 1.0)


def fallen_stress(
    stress: RealArray, before: RealArray, now: RealArray, poisson: RealArray
) -> RealArray:
    """Static stress once its deviator has fallen with G, D(G_now) D(G_before)⁻¹ σ.

    In plane strain the stress across the section, which points do not carry, is that of elastic
    ground: what the mean keeps is λ + G times the strain of the area.

    Args:
        stress: xx, yy, xy or xx, yy, zz, yz, xz, xy [Pa], shape ``(n, 3)`` or ``(n, 6)``.
        before: G over the small-strain modulus [-], shape ``(n,)``.
        now: Likewise after the fall.
        poisson: Poisson's ratio at small strain [-], shape ``(n,)``.

    Returns:
        Stress, shaped like ``stress``.
    """
    normal = NORMAL_STRAINS[stress.shape[1]]
    bulk = 2 * (1 + poisson) / (3 * (1 - 2 * poisson))
    # λ + 2G/d over the small-strain modulus; in space the bulk modulus itself.
    stiff, stiff_now = (bulk + 2 * ratio * (1 / normal - 1 / 3) for ratio in (before, now))
    fallen = (now / before)[:, None] * stress
    mean = stress[:, :normal].mean(axis=1)
    fallen[:, :normal] += ((stiff_now / stiff - now / before) * mean)[:, None]
    return fallen
