# SPDX-License-Identifier: MIT
"""The ``[[motion]]`` tables: one source a direction, read and scaled."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from fenics_hytf import motion as records
from fenics_hytf.scene.axes import AXES
from fenics_hytf.scene.faults import Fault, fault_from, join_key, name_key, toml_text
from fenics_hytf.scene.files import unusable
from fenics_hytf.scene.table import (
    LARGEST,
    Positive,
    Table,
    at_most_one,
    exactly_one,
    given,
    number,
    read_table,
    unknown_key,
)

SOURCES = ("file", "harmonic", "record", "synthetic")
_MOST_SAMPLES = 10_000_000  # 80 MB; more is a slip of the pen
_MOST_SINES = 100_000_000  # samples times frequencies of a synthetic record: 800 MB

_SHORTEST, _LONGEST = 1e-5, 1e6  # time steps [s]; response spectra take 10 s of the shortest


@dataclass(frozen=True, eq=False)
class MotionInput:
    """The motion of the base in one direction.

    Attributes:
        direction: ``x``, ``y`` or ``z``.
        record: Acceleration, read and scaled.
        input: ``within`` or ``outcrop``.
    """

    direction: str
    record: records.Record = field(repr=False)
    input: str


class Harmonic(Table):
    """A sine, ``amplitude * sin(2 pi frequency t)``, the end excluded."""

    amplitude: float = Field(description="a number [m/s2]")
    frequency: Positive = Field(description="a positive number [Hz]")
    cycles: Positive = Field(description="a positive number of cycles")
    samples: Annotated[int, Field(ge=2, le=_MOST_SAMPLES)] = Field(
        description=f"a whole number from 2 to {_MOST_SAMPLES}, more than 2 a cycle"
    )

    @classmethod
    def rules(cls, raw: dict[str, Any], key: str) -> Iterator[Fault]:
        """More than two samples a cycle: below, the sine is not seen."""
        cycles, samples = number(raw, "cycles"), number(raw, "samples")
        if cycles is not None and samples is not None and 2 <= samples <= 2 * cycles:
            expected = f"more than {2 * cycles:g} samples, 2 a cycle"
            yield Fault(join_key(key, "samples"), toml_text(raw["samples"]), expected)


class MotionTable(Table):
    """One ``[[motion]]`` as it stands in the file; see :class:`MotionInput`."""

    direction: Literal["x", "y", "z"] = Field(description='"x", "y" or "z" (3D and antiplane)')
    file: str | None = Field(None, description="the path of an AT2 or CSV file")
    harmonic: Harmonic | None = Field(
        None, description="a table with amplitude, frequency, cycles and samples"
    )
    record: str | None = Field(None, description="the name of a recorded motion")
    synthetic: dict[str, Any] | None = Field(None, description="a table of parameters")
    dt: Positive | None = Field(None, description="a positive time step [s]")
    units: Literal["g", "m/s2"] | None = Field(None, description='"g" or "m/s2"')
    pga: Positive | None = Field(None, description="a positive peak acceleration [g]")
    scale: float | None = Field(None, description="a number other than 0 [-]")
    input: Literal["within", "outcrop"] = Field("within", description='"within" or "outcrop"')

    @classmethod
    def rules(cls, raw: dict[str, Any], key: str) -> Iterator[Fault]:
        """One source, one scaling; time step and units with a file only."""
        yield from exactly_one(raw, key, *SOURCES)
        yield from at_most_one(raw, key, "pga", "scale")
        if isinstance(raw.get("harmonic"), dict):
            yield from Harmonic.rules(raw["harmonic"], join_key(key, "harmonic"))
        if number(raw, "scale") == 0:
            yield Fault(join_key(key, "scale"), toml_text(raw["scale"]), "a number other than 0")
        for name in given(raw, "dt", "units"):
            if "file" not in raw:
                yield Fault(join_key(key, name), toml_text(raw[name]), "nothing without file")


def read_motions(
    raw: object, folder: Path, components: tuple[str, ...] | None
) -> tuple[tuple[MotionInput | None, ...], list[Fault]]:
    """Read all motions.

    Args:
        raw: What stands in the file, an array of tables.
        folder: Where relative paths start.
        components: Displacement components, or ``None`` where only the mesh file knows them.

    Returns:
        The motions in the file's order, ``None`` where one has a fault; and the faults.
    """
    if not isinstance(raw, list | tuple) or not raw:
        return (), [Fault("motion", toml_text(raw), "at least one table [[motion]]")]
    faults: list[Fault] = []
    motions: list[MotionInput | None] = []
    dt0: float | None = None
    first: dict[str, int] = {}
    for i, table in enumerate(raw):
        where = join_key("motion", i)
        motion, found = _read_motion(table, folder, where)
        faults += found
        direction = table.get("direction") if isinstance(table, dict) else None
        if components is not None and direction in AXES and direction not in components:
            faults.append(direction_fault(join_key(where, "direction"), direction, components))
        if isinstance(direction, str) and direction in first:
            expected = f"each direction once; motion[{first[direction]}] has it"
            faults.append(Fault(join_key(where, "direction"), toml_text(direction), expected))
        elif isinstance(direction, str):
            first[direction] = i
        motions.append(motion)
        if motion is None:
            continue
        dt = motion.record.dt
        dt0 = dt if dt0 is None else dt0
        # time steps computed from a frequency differ by rounding; a real difference shows
        if abs(dt - dt0) > 1e-9 * dt0:
            faults.append(Fault(where, f"a time step of {dt:g} s", f"{dt0:g} s, as before"))
    return tuple(motions), faults


def direction_fault(key: str, direction: str, components: tuple[str, ...]) -> Fault:
    """The fault of a motion along an axis that the mesh does not move in."""
    names = " or ".join(f'"{name}"' for name in components)
    kinds = {1: "an antiplane section", 2: "a section in plane strain", 3: "a solid"}
    return Fault(key, f'"{direction}"', f"{names}: the mesh is {kinds[len(components)]}")


def input_rules(motions: tuple[MotionInput | None, ...], base: str) -> Iterator[Fault]:
    """Outcrop motions come up through a compliant base; all motions are of one kind.

    Args:
        motions: The motions that could be read.
        base: Kind of the base.

    Yields:
        The faults.
    """
    kinds = {i: motion.input for i, motion in enumerate(motions) if motion is not None}
    first = next(iter(kinds.values()), None)
    for i, kind in kinds.items():
        where = join_key("motion", i, "input")
        if kind == "outcrop" and base != "compliant":
            expected = (
                '"within" on a rigid base; or boundary.base = { compliant = ... } with the '
                "properties of the rock"
            )
            yield Fault(where, f'"outcrop" on a base that is {base}', expected)
        elif kind != first:
            yield Fault(where, f'"{kind}"', f'"{first}", as the first motion is')


def _read_motion(raw: object, folder: Path, key: str) -> tuple[MotionInput | None, list[Fault]]:
    """One motion: its table, then its record even if another field is wrong."""
    table, faults = read_table(MotionTable, raw, key)
    if not isinstance(raw, dict) or len(given(raw, *SOURCES)) != 1:
        return None, faults
    source = given(raw, *SOURCES)[0]
    where = join_key(key, source)
    taken = (join_key(key, "dt"), join_key(key, "units"))
    if any(fault.key.startswith((where, *taken)) for fault in faults):
        return None, faults
    record, found = _read_record(raw, source, folder, where)
    faults += found
    if record is not None and not _SHORTEST <= record.dt <= _LONGEST:
        expected = f"one from {_SHORTEST:g} to {_LONGEST:g} s"
        faults.append(Fault(where, f"a time step of {record.dt:g} s", expected))
    if table is None or record is None or faults:
        return None, faults
    try:
        with np.errstate(over="ignore"):
            record = record.scaled(pga_g=table.pga, scale=table.scale)
    except ValueError as error:
        name = "scale" if table.pga is None else "pga"
        return None, [fault_from(error, join_key(key, name), toml_text(raw.get(name)))]
    if record.pga > LARGEST:
        return None, [
            Fault(where, f"accelerations up to {record.pga:g} m/s2", f"at most {LARGEST:g} m/s2")
        ]
    return MotionInput(table.direction, record, table.input), []


def _read_record(
    raw: dict[str, Any], source: str, folder: Path, key: str
) -> tuple[records.Record | None, list[Fault]]:
    """The record of a source that is valid as a table."""
    value = raw[source]
    try:
        if source == "file":
            path = Path(folder, value)
            why = unusable(path)
            if why:
                found = f"{toml_text(value)}, {why}"
                return None, [Fault(key, found, f"an AT2 or CSV file; looked for {path}")]
            return records.read(path, dt=number(raw, "dt"), units=raw.get("units")), []
        if source == "harmonic":
            return records.harmonic(**value), []
        if source == "record":
            return records.recorded(value), []
        return _synthetic(value, key)
    except (ValueError, ArithmeticError) as error:
        return None, [fault_from(error, key, toml_text(value))]


def _synthetic(value: dict[str, Any], key: str) -> tuple[records.Record | None, list[Fault]]:
    """The synthetic record of a table of parameters."""
    known = list(inspect.signature(records.synthetic).parameters)
    faults = [
        unknown_key(join_key(key, name_key(name)), given_value, str(name), known)
        if name not in known
        else Fault(join_key(key, name), toml_text(given_value), "a finite number")
        for name, given_value in value.items()
        if name not in known or number(value, name) is None
    ]
    if not faults and (number(value, "n") or 0) * max(number(value, "nf") or 0, 16) > _MOST_SINES:
        expected = f"fewer samples; n times nf at most {_MOST_SINES}"
        faults.append(Fault(join_key(key, "n"), toml_text(value["n"]), expected))
    return (None, faults) if faults else (records.synthetic(**value), [])
