# SPDX-License-Identifier: MIT
"""The ``[boundary]`` section: what holds each boundary, by its name.

Motions are those of the base: what a boundary holds moves with it. A roller holds the direction
normal to its boundary.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

from fenics_hytf.scene.faults import NOT_YET, Fault, join_key, name_key, toml_text

BOUNDARY_KINDS = ("rigid", "fixed", "roller", "tied", "free")
LATER_BOUNDARY_KINDS = ("dashpot", "free_field", "compliant")
AXES = ("x", "y", "z")
NORMALS = {"left": "x", "right": "x", "front": "y", "back": "y"}  # base and top: the vertical
PAIRS = {"left": "right", "right": "left", "front": "back", "back": "front"}


def read_boundary(
    raw: object,
    names: tuple[str, ...] | None,
    directions: Collection[str] = (),
    key: str = "boundary",
) -> tuple[dict[str, str] | None, list[Fault]]:
    """Read ``[boundary]``.

    Args:
        raw: What stands in the file: kinds by the name of the boundary.
        names: Boundaries that there are, or ``None`` where only the mesh file knows.
        directions: Directions of the motions, as far as they can be read.
        key: Where it stands.

    Returns:
        Kind by name, of those that the scene names; and the faults.
    """
    if not isinstance(raw, dict):
        return None, [Fault(key, toml_text(raw), "a table of boundaries")]
    faults: list[Fault] = []
    for name, kind in raw.items():
        where = join_key(key, name_key(name))
        if names is not None and name not in names:
            faults.append(Fault(where, toml_text(kind), f"one of the names {', '.join(names)}"))
        faults += _kind_faults(kind, where)
        if kind == "tied":
            faults += _tied_faults(raw, str(name), where)
    if faults:
        return None, faults
    kinds = {str(name): str(kind) for name, kind in raw.items()}
    if names is not None:
        faults += _base_faults(kinds, names, directions, key)
    return (None if faults else kinds), faults


def default_kind(name: str) -> str:
    """Kind of a boundary that the scene does not name: the base is rigid, others are free."""
    return "rigid" if name == "base" else "free"


def _base_faults(
    kinds: dict[str, str], names: tuple[str, ...], directions: Collection[str], key: str
) -> Iterator[Fault]:
    """Something moves with the base in the direction of every motion."""
    all_kinds = {name: kinds.get(name, default_kind(name)) for name in names}
    axes = AXES[: 3 if "front" in names else 2]
    held: set[str] = set()
    for name, kind in all_kinds.items():
        if kind in ("rigid", "fixed"):
            held.update(axes)
        elif kind == "roller":
            held.add(NORMALS.get(name, axes[-1]))
    loose = [axis for axis in axes if axis in directions and axis not in held]
    if loose or not held:
        where = f" in {' and '.join(loose)}" if loose else ""
        text = ", ".join(f"{name} {kind}" for name, kind in all_kinds.items())
        expected = f"a boundary that moves with the base{where}: rigid, fixed or a roller across it"
        yield Fault(key, text, expected)


def _kind_faults(kind: object, key: str) -> Iterator[Fault]:
    text = next(iter(kind)) if isinstance(kind, dict) and len(kind) == 1 else kind
    kinds = ", ".join(BOUNDARY_KINDS)
    if isinstance(text, str) and text in LATER_BOUNDARY_KINDS:
        yield Fault(key, toml_text(kind), f"{NOT_YET}; {kinds} are")
    elif not isinstance(kind, str) or kind not in BOUNDARY_KINDS:
        yield Fault(key, toml_text(kind), f"one of {kinds}")


def _tied_faults(raw: dict[str, Any], name: str, key: str) -> Iterator[Fault]:
    """Opposite sides are tied to each other, so both are."""
    other = PAIRS.get(name)
    if other is None:
        yield Fault(key, '"tied"', "another kind; sides are tied in pairs left/right, front/back")
    elif raw.get(other) != "tied":
        found = f'"tied", but {other} is {toml_text(raw.get(other, default_kind(other)))}'
        yield Fault(key, found, f'{other} = "tied" as well')
