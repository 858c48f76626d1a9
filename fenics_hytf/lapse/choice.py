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
    scene: Scene, domain: Domain, equations: Equations, statics: Statics | None = None
) -> Continuity:
    """What hands over from lapse to lapse in a scene.

    Args:
        scene: The scene.
        domain: The domain.
        equations: Its equations.
        statics: Static stress and weight, where the scene calls for gravity.

    Returns:
        The continuity of the scene's scheme.
    """
    scheme = scheme_of(scene, domain.region_names)
    if scheme.name == "steady":
        return Steady(scene, equations.axes)
    if scheme.name == "handover":
        return Handover(scene, domain, equations, scheme, statics)
    return WholeRecord(scene, domain, equations, scheme)
