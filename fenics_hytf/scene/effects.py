# SPDX-License-Identifier: MIT
"""What effects ask of the rest of the scene, and of each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from typing import Any

from fenics_hytf.scene.faults import Fault, join_key, name_key, toml_text
from fenics_hytf.scene.mesh import layout
from fenics_hytf.scene.settings import Calm, Degradation, Effects
from fenics_hytf.scene.soil import Soil


def effect_rules(
    raw: dict[str, Any],
    effects: Effects | None,
    soils: Mapping[str, Soil | None],
    num_lapses: int | None,
) -> Iterator[Fault]:
    """Check effects against the scene.

    Args:
        raw: The raw table of the scene.
        effects: ``[effects]``, or ``None`` where it has a fault.
        soils: ``[soil.NAME]`` by name, ``None`` for a soil with a fault.
        num_lapses: Number of lapses, or ``None`` where it is not known.

    Yields:
        The faults.
    """
    yield from _antiplane_rules(raw)
    if effects is None:
        return
    if effects.calm is not None:
        yield from _calm_rules(raw, effects.calm)
    if effects.degradation is not None:
        yield from _degradation_rules(effects.degradation, soils, num_lapses)
    if effects.sliding is not None:
        yield from _sliding_rules(effects, soils)
    if effects.softening:
        yield from _softening_rules(effects)


def _antiplane_rules(raw: dict[str, Any]) -> Iterator[Fault]:
    """A section that moves across its plane stays in it."""
    mesh, effects = raw.get("mesh"), raw.get("effects")
    if not (isinstance(mesh, dict) and mesh.get("kinematics") == "antiplane"):
        return
    for name in ("convection", "geometric_stiffness", "gravity", "sliding", "softening", "locking"):
        if isinstance(effects, dict) and effects.get(name):
            expected = "nothing: antiplane motion leaves the points where they are in the section"
            yield Fault(f"effects.{name}", toml_text(effects[name]), expected)


def _calm_rules(raw: dict[str, Any], calm: Calm) -> Iterator[Fault]:
    """An absorbing layer lies along sides that there are."""
    drawn = layout(raw.get("mesh"))
    names = drawn.boundaries if drawn is not None else None
    for i, side in enumerate(calm.sides):
        where = join_key("effects.calm.sides", i)
        # Of a mesh file the names are known later.
        if side in ("base", "top") or (names is not None and side not in names):
            sides = [name for name in names or () if name not in ("base", "top")]
            yield Fault(where, toml_text(side), ", ".join(sides) or "a side")


def _degradation_rules(
    effect: Degradation, soils: Mapping[str, Soil | None], num_lapses: int | None
) -> Iterator[Fault]:
    """Degradation of soils that there are, between lapses, by the package that counts cycles."""
    key = "effects.degradation"
    if find_spec("rainflow") is None:
        expected = "it to be installed, as cycles are counted with it; run 'pip install rainflow'"
        yield Fault(key, "no package rainflow", expected)
    if num_lapses == 1:
        yield Fault(key, "one lapse", "more than one lapse: degradation acts between lapses")
    for i, name in enumerate(effect.soils or ()):
        if soils and name not in soils:
            expected = f"one of the soils {', '.join(map(name_key, soils))}"
            yield Fault(join_key(key, "soils", i), toml_text(name), expected)


def _sliding_rules(effects: Effects, soils: Mapping[str, Soil | None]) -> Iterator[Fault]:
    """Sliding has weight to drive it, and strength to hold against it."""
    if effects.gravity is None:
        yield Fault("effects.gravity", "nothing", "gravity, which drives what slides")
    for name, soil in soils.items():
        if soil is not None and not soil.has_strength:
            key = join_key("soil", name_key(name), "cohesion")
            yield Fault(key, "no strength", "cohesion [Pa] or friction_angle [degrees] for sliding")


def _softening_rules(effects: Effects) -> Iterator[Fault]:
    """Softening has stress to redistribute, moduli that fall, and no other law beside it."""
    if effects.gravity is None:
        yield Fault("effects.gravity", "nothing", "gravity, whose stress softening redistributes")
    if effects.equivalent_linear is None and effects.degradation is None:
        expected = "equivalent_linear or degradation: without, no modulus falls for softening"
        yield Fault("effects.equivalent_linear", "nothing", expected)
    if effects.sliding is not None:
        expected = "one of the two: together they count the same permanent displacement twice"
        yield Fault("effects.softening", "true beside sliding", expected)
