# SPDX-License-Identifier: MIT
"""The section ``[output]``: receivers, and what is written."""

from __future__ import annotations

import re
from collections.abc import Iterator

from pydantic import Field

from fenics_hytf.scene.faults import Fault, join_key, name_key, toml_text
from fenics_hytf.scene.table import Count, Several, Table, read_table

_KEY = "output"
_LONGEST = 50  # letters of up to four bytes, and what else is in a file's name of 255 bytes
_RECEIVER_NAME = re.compile(rf"[\w-]{{1,{_LONGEST}}}")


class Receiver(Table):
    """A place whose motion is written.

    Attributes:
        place: [m], shape ``(gdim,)``.
        rides: Whether it rides the material point nearest to the place at the start.
    """

    place: Several[float] = Field(
        min_length=2, max_length=3, description="a place [x, y] or [x, y, z] [m]"
    )
    rides: bool = Field(False, description="true or false")


class Output(Table):
    """What is written.

    Attributes:
        receivers: By name. Names become columns such as ``NAME.u_x`` and files of ``hytf export``,
            so they are made of at most 50 letters, digits, ``_`` and ``-``.
        fields: Whether nodal fields are written.
        every: Snapshots every so many lapses.
        water_table: Elevation of the water table [m], for effective vertical stress; or ``None``:
            total stress.
    """

    receivers: dict[str, Receiver] = Field({}, description="a table of places")
    fields: bool = Field(False, description="true or false")
    every: Count = Field(1, description="a whole number from 1")
    water_table: float | None = Field(None, description="an elevation [m]")


def read_output(
    raw: object, gdim: int | None, size: tuple[float, ...] | None
) -> tuple[Output | None, list[Fault]]:
    """Read ``[output]``; each receiver on its own.

    Args:
        raw: What stands in the file.
        gdim: Dimension of the mesh, or ``None`` where only the mesh file knows.
        size: Extent of a column or box from the origin [m], or ``None``.

    Returns:
        The section, or ``None`` if it has a fault; and its faults.
    """
    if not isinstance(raw, dict):
        return read_table(Output, raw, _KEY)
    output, faults = read_table(Output, {**raw, "receivers": {}}, _KEY)
    receivers: dict[str, Receiver] = {}
    table = raw.get("receivers", {})
    if not isinstance(table, dict):
        faults.append(Fault(join_key(_KEY, "receivers"), toml_text(table), "a table of places"))
        table = {}
    for name, place in table.items():
        where = join_key(_KEY, "receivers", name_key(name))
        if name in ("within", "outcrop"):
            expected = "another name: so the motions of the base are called in exports"
            faults.append(Fault(where, toml_text(name), expected))
        if not _RECEIVER_NAME.fullmatch(str(name)):
            expected = f"a name of letters, digits, _ and - only, at most {_LONGEST} of them"
            faults.append(Fault(where, toml_text(name), expected))
        receiver, found = _read_receiver(place, where)
        faults += found
        if receiver is not None:
            faults += _place_faults(receiver, gdim, size, where)
            receivers[str(name)] = receiver
    if output is None or faults:
        return None, faults
    return output.model_copy(update={"receivers": receivers}), []


def _place_faults(
    receiver: Receiver, gdim: int | None, size: tuple[float, ...] | None, key: str
) -> Iterator[Fault]:
    """A receiver has as many coordinates as the mesh and is inside it."""
    place, key = receiver.place, join_key(key, "point") if receiver.rides else key
    found = toml_text(place)
    if gdim is not None and len(place) != gdim:
        yield Fault(key, found, f"{gdim} coordinates, as the mesh is {gdim}D [m]")
    elif size is not None:
        # heights summed from decimal thicknesses are off by rounding (1e-16 a layer)
        slack = 1e-9 * max(size)
        if any(not -slack <= p <= s + slack for p, s in zip(place, size, strict=True)):
            corner = ", ".join(f"{s:g}" for s in size)
            yield Fault(key, found, f"a place inside the mesh, from 0 to ({corner}) m")


def _read_receiver(raw: object, key: str) -> tuple[Receiver | None, list[Fault]]:
    """A receiver from ``[x, y]`` or ``{ point = [x, y] }``."""
    expected = "a place [x, y] or [x, y, z] [m], or { point = [x, y] }"
    rides = isinstance(raw, dict)
    place = raw
    if isinstance(raw, dict):
        if list(raw) != ["point"]:
            return None, [Fault(key, toml_text(raw), expected)]
        place, key = raw["point"], join_key(key, "point")
    if not isinstance(place, list | tuple) or len(place) not in (2, 3):
        return None, [Fault(key, toml_text(place), expected)]
    receiver, faults = read_table(Receiver, {"place": place, "rides": rides}, key)
    return receiver, [
        Fault(fault.key.replace(join_key(key, "place"), key, 1), fault.found, "a number [m]")
        for fault in faults
    ]
