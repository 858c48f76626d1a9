# SPDX-License-Identifier: MIT
"""The ``[boundary]`` section: what holds each boundary, by its name.

- ``rigid`` and ``fixed`` move with the input, ``roller`` does so across the boundary only.
- ``compliant``: the ground stands on a half-space of rock, into which waves leave (dashpots).
- ``dashpot``: waves leave sideways; ``free_field``: as well, into level ground of the same soil.
- ``tied``: opposite sides move alike; ``free``: nothing holds.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import Field

from fenics_hytf.scene.axes import AXES
from fenics_hytf.scene.faults import Fault, join_key, name_key, toml_text
from fenics_hytf.scene.table import Fraction, Positive, Table, read_table

BOUNDARY_KINDS = ("rigid", "fixed", "roller", "tied", "free", "dashpot", "free_field")
NORMALS = {"left": "x", "right": "x", "front": "y", "back": "y"}  # base and top: the vertical
PAIRS = {"left": "right", "right": "left", "front": "back", "back": "front"}
_ROCK = "{ compliant = { density = ..., shear_wave_velocity = ..., poisson = ... } }"


class Rock(Table):
    """The half-space below a compliant base.

    Attributes:
        density: Mass density [kg/m^3].
        shear_wave_velocity: [m/s].
        poisson: Poisson's ratio [-].
        damping: Damping ratio of shear [-]; what P waves have of it, ``solver.keep`` says.
    """

    density: Positive = Field(description="a positive number [kg/m3]")
    shear_wave_velocity: Positive = Field(description="a positive number [m/s]")
    poisson: Annotated[float, Field(ge=0, lt=0.5)] = Field(
        description="a number from 0 to below 0.5 [-]"
    )
    damping: Fraction = Field(0.0, description="a damping ratio from 0 to below 1 [-]")

    @property
    def p_wave_velocity(self) -> float:
        """V_p = V_s √((2 − 2ν)/(1 − 2ν)) [m/s]."""
        ratio = (2 - 2 * self.poisson) / (1 - 2 * self.poisson)
        return float(self.shear_wave_velocity * ratio**0.5)


@dataclass(frozen=True)
class Boundary:
    """What holds the boundaries.

    Attributes:
        kinds: Kind by name, of the boundaries that the scene names.
        rock: The half-space below, where the base is compliant.
    """

    kinds: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    rock: Rock | None = None

    def supports(self, input_kind: str) -> dict[str, str]:
        """What holds each boundary under an input.

        Args:
            input_kind: ``outcrop``; or ``within``, which is the motion of the base itself: it
                holds a compliant base as a rigid one.

        Returns:
            Kind by name.
        """
        held = {"compliant": "rigid"} if input_kind == "within" else {}
        return {name: held.get(kind, kind) for name, kind in self.kinds.items()}


def read_boundary(
    raw: object,
    names: tuple[str, ...] | None,
    directions: Collection[str] = (),
) -> tuple[Boundary | None, list[Fault]]:
    """Read ``[boundary]``.

    Args:
        raw: What stands in the file: kinds by the name of the boundary.
        names: Boundaries that there are, or ``None`` where only the mesh file knows.
        directions: Directions of the motions, as far as they can be read.

    Returns:
        The boundaries that the scene names; and the faults.
    """
    if not isinstance(raw, dict):
        return None, [Fault("boundary", toml_text(raw), "a table of boundaries")]
    faults: list[Fault] = []
    kinds: dict[str, str] = {}
    rock = None
    for name, kind in raw.items():
        where = join_key("boundary", name_key(name))
        if names is not None and name not in names:
            faults.append(Fault(where, toml_text(kind), f"one of the names {', '.join(names)}"))
        if isinstance(kind, dict) and list(kind) == ["compliant"]:
            rock, found = _read_rock(str(name), kind["compliant"], where)
            kinds[str(name)] = "compliant"
        else:
            found = list(_kind_faults(str(name), kind, where))
            kinds[str(name)] = str(kind)
        faults += found
        if kind == "tied":
            faults += _tied_faults(raw, str(name), where)
    if faults:
        return None, faults
    if names is not None:
        faults += _base_faults(kinds, names, directions)
    return (None if faults else Boundary(MappingProxyType(kinds), rock)), faults


def default_kind(name: str) -> str:
    """Kind of a boundary that the scene does not name: the base is rigid, others are free."""
    return "rigid" if name == "base" else "free"


def _base_faults(
    kinds: dict[str, str], names: tuple[str, ...], directions: Collection[str]
) -> Iterator[Fault]:
    """Something moves with the base in the direction of every motion."""
    all_kinds = {name: kinds.get(name, default_kind(name)) for name in names}
    if all_kinds.get("base") == "compliant":
        return
    axes = AXES[: 3 if "front" in names else 2]
    held: set[str] = set()
    for name, kind in all_kinds.items():
        if kind in ("rigid", "fixed"):
            held.update(AXES)
        elif kind == "roller":
            held.add(NORMALS.get(name, axes[-1]))
    loose = [axis for axis in AXES if axis in directions and axis not in held]
    if loose or not held:
        where = f" in {' and '.join(loose)}" if loose else ""
        text = ", ".join(f"{name} {kind}" for name, kind in all_kinds.items())
        expected = f"a boundary that moves with the base{where}: rigid, fixed or a roller across it"
        yield Fault("boundary", text, expected)


def outcrop_rules(boundary: Boundary, directions: Collection[str]) -> Iterator[Fault]:
    """Nothing but the rock holds ground on a compliant base under outcrop motions.

    Args:
        boundary: The boundaries.
        directions: Directions of the motions.

    Yields:
        The faults: what is held would move as the bare rock does, which nothing at hand does.
    """
    for name, kind in boundary.kinds.items():
        across = kind == "roller" and NORMALS.get(name) in directions
        if kind in ("rigid", "fixed") or across:
            expected = "tied, free_field, dashpot or free under an outcrop motion"
            yield Fault(join_key("boundary", name_key(name)), f'"{kind}"', expected)


def _read_rock(name: str, raw: object, key: str) -> tuple[Rock | None, list[Fault]]:
    """The rock below a compliant base."""
    if name != "base":
        return None, [Fault(key, toml_text({"compliant": raw}), "compliant for the base only")]
    if not isinstance(raw, dict) or not raw:
        return None, [Fault(key, toml_text({"compliant": raw}), f"the rock below it: {_ROCK}")]
    return read_table(Rock, raw, join_key(key, "compliant"))


def _kind_faults(name: str, kind: object, key: str) -> Iterator[Fault]:
    text = toml_text(kind)
    if kind == "compliant" or (name == "base" and kind == "dashpot"):
        expected = f"the rock below it: {_ROCK}" if name == "base" else "compliant for the base"
        yield Fault(key, text, expected)
    elif kind == "free_field" and name in ("base", "top"):
        yield Fault(key, text, "free_field for the sides only")
    elif not isinstance(kind, str) or kind not in BOUNDARY_KINDS:
        kinds = f"one of {', '.join(BOUNDARY_KINDS)}"
        yield Fault(key, text, f"{kinds}, or {_ROCK}" if name == "base" else kinds)


def _tied_faults(raw: dict[str, Any], name: str, key: str) -> Iterator[Fault]:
    """Opposite sides are tied to each other, so both are."""
    other = PAIRS.get(name)
    if other is None:
        yield Fault(key, '"tied"', "another kind; sides are tied in pairs left/right, front/back")
    elif raw.get(other) != "tied":
        found = f'"tied", but {other} is {toml_text(raw.get(other, default_kind(other)))}'
        yield Fault(key, found, f'{other} = "tied" as well')
