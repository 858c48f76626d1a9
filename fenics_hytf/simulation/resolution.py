# SPDX-License-Identifier: MIT
"""Whether cells are small enough for the shear waves of the motion.

Kuhlemeyer and Lysmer (1973) ask for eight elements in the shortest wave. Linear cells, N of them in
a wave, carry it with a length that is off by (2π/N)²/24: 2.6 % for eight, 10 % for four. Three
cells of degree 2, with six nodes, are off by (2π/3)⁴/1440 = 1.3 %.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from fenics_hytf._compat import geometry_dofmap
from fenics_hytf.domain import Domain
from fenics_hytf.scene import Scene, motion_band

RealArray = npt.NDArray[np.float64]

WANTED = {1: 8.0, 2: 6.0}
"""Nodes in a shear wave's length by the degree of displacement [-]."""


def too_coarse(
    scene: Scene, domain: Domain, states: Iterable[tuple[npt.NDArray[np.integer], RealArray]]
) -> tuple[str, ...]:
    """Soils whose cells are too large for the motion (collective).

    Args:
        scene: The scene.
        domain: Its domain.
        states: Soil of all cells in the order of the input, as an index into the region names, and
            its shear modulus [Pa], each of shape ``(num_cells,)``; of one state or of several.

    Returns:
        A sentence each, with what was found, what the rule asks for and what to do.
    """
    band = motion_band(scene.motion)
    frequency = min(band, scene.solver.max_frequency or band)
    if frequency == 0:
        return ()
    extent = domain.gather_cells(_extents(scene, domain)[: domain.num_owned_cells])
    degree = domain.V.ufl_element().degree
    wanted = WANTED[degree]
    fewest = dict.fromkeys(domain.region_names, np.inf)
    for region, shear_modulus in states:
        for index, name in enumerate(domain.region_names):
            mine = (region == index) & np.isfinite(shear_modulus)
            speed = np.sqrt(shear_modulus[mine] / scene.soil[name].density)
            nodes = degree * speed / frequency / extent[mine]
            fewest[name] = min(fewest[name], float(nodes.min(initial=np.inf)))
    what = "the band of the motion" if frequency == band else "solver.max_frequency"
    finer = "degree = 2 or " if degree == 1 else ""
    return tuple(
        f"soil {name}: found {nodes:.2g} nodes in a shear wave's length at {frequency:.3g} Hz, "
        f"{what}; {wanted:g} carry it: take {finer}cells {wanted / nodes:.3g} times as small"
        for name, nodes in fewest.items()
        if nodes < wanted
    )


def at_first(scene: Scene, domain: Domain) -> Iterator[tuple[npt.NDArray[np.integer], RealArray]]:
    """The soil of each cell and its small-strain modulus; see :func:`too_coarse` (collective)."""
    region = domain.gather_cells(domain.regions[: domain.num_owned_cells].astype(np.int64))
    moduli = [scene.soil[name].elastic.shear_modulus for name in domain.region_names]
    yield region, np.where(region < 0, np.nan, np.array(moduli)[region])


def _extents(scene: Scene, domain: Domain) -> RealArray:
    """Longest extent of each local cell along an axis in which waves travel [m].

    Where every side is tied they travel upwards alone.
    """
    mesh = domain.mesh
    x = mesh.geometry.x[geometry_dofmap(mesh)][:, :, : domain.gdim]
    extents = np.ptp(x, axis=1)
    kinds = [kind for name, kind in scene.supports.items() if name != "base"]
    level = kinds.count("tied") == 2 * (domain.gdim - 1)
    return np.asarray(extents[:, -1] if level else extents.max(axis=1))
