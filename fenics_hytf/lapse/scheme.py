# SPDX-License-Identifier: MIT
"""Which way the lapses of a scene hang together, told from it and the soils of its mesh.

``steady``, the paper's; a hand-over where the law is causal, as without material damping, or where
one lapse hands nothing over; else the whole record in every lapse.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

from fenics_hytf.motion import Contour
from fenics_hytf.scene import Scene
from fenics_hytf.soil import RELAXATION_TIMES

HANDOVER = (6, 13.8)
"""T_p over the lapse, and ηT_p.

With 4 and 9.2 forty lapses of an elastic column were 1.3e-3 off in displacement, of a lightly
damped one 8e-4; with these, 4e-5 and 9e-6. ηT is the same, 2.3.
"""
_WHOLE_RECORD = (4, 9.2)  # T_p over the record, and ηT_p


@dataclass(frozen=True)
class Scheme:
    """How lapses hang together.

    Attributes:
        name: ``steady``: each is a periodic state of its own; ``handover``: displacement, velocity,
            stress and memory go on; ``whole_record``: the response to the whole record in each, and
            a free vibration about it.
        contour: The damped contour that lines lie on, ``None`` under ``steady``.
        remembers: Whether points carry the memory of Maxwell branches.
    """

    name: Literal["steady", "handover", "whole_record"]
    contour: Contour | None = None
    remembers: bool = False

    def num_lines(self, max_frequency: float | None) -> int:
        """Lines of a lapse on the contour.

        Args:
            max_frequency: Of the last line [Hz]; the Nyquist frequency if ``None``.

        Returns:
            Their number.

        Raises:
            ValueError: Under ``steady``, which has no contour.
        """
        if self.contour is None:
            raise ValueError("found steady continuity; expected one on a damped contour")
        return len(self.contour.lines(max_frequency))

    def carried(self, components: int) -> dict[str, tuple[int, ...]]:
        """What points carry: shapes of one point's entry by name.

        Args:
            components: Components of the displacement.
        """
        vector, strains = (components,), {1: 2, 2: 3, 3: 6}[components]
        if self.name == "steady":
            return {}
        fields: dict[str, tuple[int, ...]] = {
            "dynamic_velocity": vector,
            "dynamic_displacement": vector,
        }
        if self.name == "handover":
            fields |= {"dynamic_strain": (strains,), "dynamic_stress": (strains,)}
        if self.remembers:
            fields["memory_strain"] = (len(RELAXATION_TIMES), strains)
        return fields


def scheme_of(scene: Scene, region_names: Collection[str]) -> Scheme:
    """The scheme of a scene.

    Args:
        scene: The scene.
        region_names: Soils of the mesh.

    Returns:
        The scheme.
    """
    if scene.lapses.continuity == "steady":
        return Scheme("steady")
    maxwell, damped = scene.solver.complex_modulus == "maxwell", _is_damped(scene, region_names)
    length, dt = scene.segments[0].num_samples, scene.dt
    if maxwell or not damped or len(scene.segments) == 1:
        return Scheme("handover", Contour.over(length, dt, *HANDOVER), maxwell and damped)
    total = scene.base_acceleration.shape[1]
    return Scheme("whole_record", Contour.over(total, dt, *_WHOLE_RECORD))


def _is_damped(scene: Scene, region_names: Collection[str]) -> bool:
    """Whether a soil or an absorbing layer has damping."""
    loop = scene.effects.equivalent_linear is not None
    soils = [scene.soil[name] for name in region_names]
    damped = any((loop and soil.curve is not None) or soil.damping_ratio(loop) for soil in soils)
    return damped or scene.effects.calm is not None
