# SPDX-License-Identifier: MIT
"""Which way lapses hang together in a scene."""

from __future__ import annotations

from fenics_hytf.domain import Domain
from fenics_hytf.lapse.continuity import Continuity, Steady
from fenics_hytf.lapse.equations import Equations
from fenics_hytf.lapse.handover import Handover, material_damps
from fenics_hytf.lapse.whole_record import WholeRecord
from fenics_hytf.scene import Scene


def choose_continuity(scene: Scene, domain: Domain, equations: Equations) -> Continuity:
    """The continuity that a scene asks for.

    Args:
        scene: The scene.
        domain: The domain.
        equations: Its equations.

    Returns:
        ``Steady``; ``Handover`` where the law is causal, as without material damping, or nothing is
        to be handed over; else ``WholeRecord``.
    """
    if scene.lapses.continuity == "steady":
        return Steady(scene, equations.axes)
    causal = scene.solver.complex_modulus == "maxwell" or not material_damps(scene, domain)
    if causal or len(scene.segments) == 1:
        return Handover(scene, domain, equations)
    return WholeRecord(scene, domain, equations)
