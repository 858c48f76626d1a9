# SPDX-License-Identifier: MIT
"""The continuity that a scene asks for."""

from __future__ import annotations

from fenics_hytf.domain import Domain
from fenics_hytf.lapse.continuity import Continuity, Steady
from fenics_hytf.lapse.equations import Equations
from fenics_hytf.lapse.handover import Handover
from fenics_hytf.lapse.scheme import scheme_of
from fenics_hytf.lapse.statics import Statics
from fenics_hytf.lapse.whole_record import WholeRecord
from fenics_hytf.scene import Scene


def choose_continuity(
    scene: Scene,
    domain: Domain,
    equations: Equations,
    statics: Statics | None = None,
    after: int | None = None,
) -> Continuity:
    """What hands over from lapse to lapse in a scene.

    Args:
        scene: The scene.
        domain: The domain.
        equations: Its equations.
        statics: Static stress and weight, where the scene calls for gravity.
        after: Samples after the motion that lapses may reach; as the scene says if ``None``.

    Returns:
        The continuity of the scene's scheme.
    """
    scheme = scheme_of(scene, domain.region_names)
    if scheme.name == "steady":
        return Steady(scene, equations.axes)
    if scheme.name == "handover":
        after = scene.samples_after if after is None else after
        return Handover(scene, domain, equations, scheme, statics, after)
    return WholeRecord(scene, domain, equations, scheme)
