# SPDX-License-Identifier: MIT
"""Dimensions of a mesh and components of the displacement, also of a scene that has faults."""

from __future__ import annotations

CELLS = {2: ("quadrilateral", "triangle"), 3: ("hexahedron", "tetrahedron")}
"""Cells that a box may have, by dimension; the first is the default."""
AXES = ("x", "y", "z")


def raw_gdim(raw: object) -> int | None:
    """The dimension that a raw ``[mesh]`` table asks for, or ``None`` where it is open."""
    if not isinstance(raw, dict):
        return None
    if raw.get("column") is not None:
        return 2
    box = raw.get("box")
    size = box.get("size") if isinstance(box, dict) else None
    return len(size) if isinstance(size, list | tuple) and len(size) in CELLS else None


def components_of(gdim: int, kinematics: str | None) -> tuple[str, ...]:
    """Names of the displacement components: across a section under antiplane kinematics.

    Args:
        gdim: Dimension of the mesh.
        kinematics: Of the section, or ``None``.

    Returns:
        ``("x", "y")``, ``("z",)``, or all three in 3D.
    """
    return ("z",) if gdim == 2 and kinematics == "antiplane" else AXES[:gdim]


def raw_components(raw: object) -> tuple[str, ...] | None:
    """The displacement components of a raw ``[mesh]`` table, or ``None`` where they are open."""
    gdim = raw_gdim(raw)
    if gdim is None or not isinstance(raw, dict):
        return None
    kinematics = raw.get("kinematics")
    return components_of(gdim, kinematics if isinstance(kinematics, str) else None)
