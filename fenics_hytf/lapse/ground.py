# SPDX-License-Identifier: MIT
"""The ground of one lapse: what soil the points have brought into each cell, and its stiffness.

A cell takes the mean of the small-strain constants of the points in it, by volume, and the curves
of the soil that fills most of it; a gap takes them from the points whose soil reaches into it. All
arrays hold every cell of the mesh in the order of the input, so that a run on several ranks adds in
the same order as a serial one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from fenics_hytf.domain import Domain, distance_to_sides
from fenics_hytf.lapse.errors import EmptyCellError
from fenics_hytf.lapse.filling import Filling, cell_integrals
from fenics_hytf.particles import Points, first_pieces, seed
from fenics_hytf.scene import Scene
from fenics_hytf.soil import Curve

RealArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Ground:
    """Soil of every cell.

    Attributes:
        region: Soil that fills most of the cell, as an index into the region names.
        density: Mass density [kg/m^3].
        shear_modulus: Small-strain G [Pa].
        poisson: Poisson's ratio [-].
        damping: Damping ratio without curves [-].
        curves: Curves of each region, ``None`` for a linear soil, shape ``(num_regions,)``.
        absorbing: Damping ratio that an absorbing layer adds [-], or ``None`` without one.
        degradation: What counted cycles have left of the modulus [-], or ``None`` where nothing
            degrades.
        filling: How far points fill the cells, or ``None`` where all are full; an empty cell has
            the constants of the first soil, and they do not count.

    All but ``curves`` have the shape ``(num_cells,)``.
    """

    region: npt.NDArray[np.int32]
    density: RealArray
    shear_modulus: RealArray
    poisson: RealArray
    damping: RealArray
    curves: tuple[Curve | None, ...]
    absorbing: RealArray | None = None
    degradation: RealArray | None = None
    filling: Filling | None = None

    @property
    def filled(self) -> npt.NDArray[np.bool_]:
        """Cells with soil, shape ``(num_cells,)``."""
        return np.ones(len(self.region), bool) if self.filling is None else self.filling.filled

    @property
    def nonlinear(self) -> npt.NDArray[np.bool_]:
        """Cells whose soil has curves, shape ``(num_cells,)``."""
        return np.array([curve is not None for curve in self.curves])[self.region] & self.filled

    def secant(self, effective_strain: RealArray) -> Moduli:
        """Read the curves.

        Args:
            effective_strain: Of every cell [-], shape ``(num_cells,)``.

        Returns:
            Secant modulus and damping of every cell.
        """
        ratio, damping = np.ones_like(self.shear_modulus), self.damping.copy()
        if self.degradation is not None:
            ratio = self.degradation.copy()
        for number, curve in enumerate(self.curves):
            if curve is not None:
                mine = self.region == number
                secant, damping[mine] = curve.evaluate(effective_strain[mine])
                ratio[mine] *= secant
        return Moduli(ratio * self.shear_modulus, damping)


@dataclass(frozen=True)
class Moduli:
    """Secant shear modulus [Pa] and damping ratio [-] of every cell, shape ``(num_cells,)``."""

    shear_modulus: RealArray
    damping: RealArray

    def change(self, old: Moduli) -> RealArray:
        """The larger relative change of G and D from ``old``, shape ``(num_cells,)``."""
        # Curves may begin without damping: what has fallen to nothing has changed by a number.
        least = np.maximum(np.finfo(float).eps * old.damping, np.finfo(float).tiny)
        modulus = np.abs(self.shear_modulus - old.shear_modulus) / self.shear_modulus
        damping = np.abs(self.damping - old.damping) / np.maximum(self.damping, least)
        return np.maximum(modulus, damping)


def seed_points(
    scene: Scene, domain: Domain, carried: Mapping[str, tuple[int, ...]] = MappingProxyType({})
) -> Points:
    """Fill the cells with points; only what an effect of the scene carries gets an array.

    Args:
        scene: The scene.
        domain: The domain.
        carried: What is carried over seams: shapes of one point's entry by name.

    Returns:
        The points of this rank.

    Raises:
        SceneError: The mesh's cells have no rule of so many points.
    """
    fields = []
    if scene.effects.convection:
        fields += ["velocity", "acceleration", "strain"]
    if scene.effects.geometric_stiffness or scene.effects.gravity is not None:
        fields += ["stress"]
    vectors: dict[str, tuple[int, ...]] = {}
    if scene.effects.sliding is not None:
        vectors = {"mechanism": (domain.num_components,), "plastic_strain": (), "shear_strain": ()}
    density = [scene.soil[name].density for name in domain.region_names]
    count = scene.mesh.points_in(domain.mesh.topology.cell_name())
    regions = np.where(domain.regions < 0, len(density), domain.regions).astype(np.int32)
    points = seed(domain.mesh, regions, [*density, 0.0], count, fields)
    if scene.effects.softening:
        vectors |= {"softest": (), "permanent_displacement": (domain.num_components,)}
    for name, shape in (*vectors.items(), *carried.items()):
        if name not in points.history:
            points.add(name, shape)
    if scene.effects.softening:
        points["softest"][...] = 1.0
    if scene.mesh.empty and scene.effects.convection:
        gdim = domain.gdim
        points.add("piece", (gdim, gdim + 1))
        points["piece"] = first_pieces(domain.mesh, points, count)
    return points


def survey(scene: Scene, domain: Domain, points: Points, filling: Filling | None = None) -> Ground:
    """See which soil the points have brought where.

    Args:
        scene: The scene.
        domain: The domain.
        points: The points.
        filling: How far they fill the cells; if ``None`` every cell holds some.

    Returns:
        The ground, the same on every rank.

    Raises:
        EmptyCellError: A cell holds no point; on every rank.
    """
    soils = [scene.soil[name] for name in domain.region_names]
    with_curves = scene.effects.equivalent_linear is not None
    constants = np.array(
        [
            [s.density, s.elastic.shear_modulus, s.elastic.poisson, s.damping_ratio(with_curves)]
            for s in soils
        ]
    )
    share = cell_integrals(domain, points, np.eye(len(soils))[points.region], filling)
    volume = share.sum(axis=1)
    if filling is None and not volume.all():
        raise EmptyCellError([int(cell) for cell in np.flatnonzero(volume == 0)])
    volume[volume == 0] = 1.0
    # A cell of one soil takes its constants as they stand, free of round-off.
    region = share.argmax(axis=1).astype(np.int32)
    density, shear_modulus, poisson, damping = np.where(
        (share > 0).sum(axis=1)[:, None] <= 1,
        constants[region],
        share @ constants / volume[:, None],
    ).T
    curves = tuple(s.curve if with_curves else None for s in soils)
    absorbing = _absorbing_layer(scene, domain)
    return Ground(
        region, density, shear_modulus, poisson, damping, curves, absorbing, filling=filling
    )


def _absorbing_layer(scene: Scene, domain: Domain) -> RealArray | None:
    """Damping ratio that grows towards some sides (Semblat et al. 2011), every cell."""
    calm = scene.effects.calm
    if calm is None:
        return None
    distance = distance_to_sides(domain, calm.sides, domain.centroids())
    return calm.damping * np.maximum(1.0 - distance / calm.thickness, 0.0) ** 2
