# SPDX-License-Identifier: MIT
"""One table of the scene file: a strict, frozen pydantic model whose complaints become faults.

A field's ``description`` is what a message says was expected, with the unit. Rules between fields
run on the raw table, so that they speak up even if another field is wrong as well.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, Strict, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from fenics_hytf.scene.faults import Fault, join_key, name_key, toml_text

NAME = re.compile(r"[^,\"\x00-\x1f\x7f]+")
"""Names of soils and regions, which are a column of a CSV file."""

SMALLEST, LARGEST = 1e-30, 1e30
"""Sizes of numbers but 0: powers of these, as in energies and their squares, are numbers too."""

Name = Annotated[str, Field(min_length=1)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, lt=1)]
Count = Annotated[int, Field(ge=1)]

_T = TypeVar("_T", bound="Table")
_E = TypeVar("_E")

Several = Annotated[tuple[_E, ...], Strict(False)]
"""A TOML array of equal things; kept as a tuple."""


class Table(BaseModel):
    """A table of the scene file: no unknown keys, no conversions, no NaN, no change afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @classmethod
    def rules(cls, raw: dict[str, Any], key: str) -> Iterator[Fault]:
        """Faults between fields, from the raw table; never raises, whatever the table holds."""
        yield from ()

    @classmethod
    def prepare(cls, raw: dict[str, Any]) -> dict[str, Any]:
        """The raw table with its short forms (``true`` for "with defaults") written out."""
        return raw


def read_table(model: type[_T], raw: object, key: str) -> tuple[_T | None, list[Fault]]:
    """Read one table.

    Args:
        model: What the table should be.
        raw: What stands in the file.
        key: Where it stands.

    Returns:
        The table, or ``None`` if it has a fault; and its faults.
    """
    if not isinstance(raw, dict):
        return None, [Fault(key, toml_text(raw), "a table")]
    faults = list(model.rules(raw, key))
    ruled = {fault.key for fault in faults}
    table = None
    try:
        table = model.model_validate(model.prepare(raw))
    except ValidationError as error:
        errors = error.errors(include_url=False)
        found = [_translate(model, e, key) for e in errors if not _follows(e, errors)]
        faults += [fault for fault in found if fault.key not in ruled]
    return (None if faults else table), faults


def number(raw: Mapping[str, Any], name: str) -> float | None:
    """The finite number at a key of a raw table, or ``None`` if there is none."""
    return as_number(raw.get(name))


def as_number(value: object) -> float | None:
    """A raw value as a finite number, or ``None`` if it is none (a bool or a string is none)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        converted = float(value)
    except OverflowError:
        return None
    return converted if math.isfinite(converted) else None


def as_list(value: object) -> list[Any]:
    """A raw array, or an empty one for anything else."""
    return list(value) if isinstance(value, list | tuple) else []


def given(raw: Mapping[str, Any], *names: str) -> list[str]:
    """Those of the names that the raw table has a value for."""
    return [name for name in names if raw.get(name) is not None]


def is_given(raw: Mapping[str, Any], section: str, key: str) -> bool:
    """Whether a section of the raw scene has a value for a key."""
    table = raw.get(section)
    return isinstance(table, dict) and bool(given(table, key))


def exactly_one(raw: Mapping[str, Any], key: str, *names: str) -> Iterator[Fault]:
    """A fault unless exactly one of the keys is given."""
    there = given(raw, *names)
    if len(there) != 1:
        found = " and ".join(there) if there else "none of them"
        yield Fault(key, found, f"exactly one of {', '.join(names)}")


def at_most_one(raw: Mapping[str, Any], key: str, *names: str) -> Iterator[Fault]:
    """A fault if several of the keys are given."""
    there = given(raw, *names)
    if len(there) > 1:
        yield Fault(key, " and ".join(there), f"at most one of {', '.join(names)}")


def unknown_key(key: str, value: object, name: str, known: list[str]) -> Fault:
    """The fault of a key that the table does not know, with the nearest one it does."""
    close = difflib.get_close_matches(name, known, n=1)
    hint = f'; did you mean "{close[0]}"?' if close else ""
    return Fault(key, toml_text(value), f"one of the keys {', '.join(known)}{hint}")


def _follows(error: ErrorDetails, errors: list[ErrorDetails]) -> bool:
    """Whether a complaint about a whole only follows from one about its parts."""
    loc = error["loc"]
    return any(len(e["loc"]) > len(loc) and e["loc"][: len(loc)] == loc for e in errors)


def _translate(model: type[Table], error: ErrorDetails, key: str) -> Fault:
    """One of pydantic's complaints as a fault."""
    where = join_key(key, *(p if isinstance(p, int) else name_key(p) for p in error["loc"]))
    table, field = _field_at(model, error["loc"])
    if error["type"] in ("extra_forbidden", "invalid_key"):
        name = str(error["loc"][-1])
        return unknown_key(where, error["input"], name, list(table.model_fields))
    found = toml_text(None if error["type"] == "missing" else error["input"])
    expected = field.description if field is not None and field.description else "a table"
    return Fault(where, found, expected)


def _field_at(
    model: type[Table], loc: tuple[str | int, ...]
) -> tuple[type[Table], FieldInfo | None]:
    """The innermost model and field that a pydantic location names."""
    table, field = model, None
    for position, part in enumerate(loc):
        if isinstance(part, int):
            continue
        field = table.model_fields.get(part)
        if field is None:
            break
        inner = _inner_table(field.annotation)
        # the place is inside the inner table only if more names follow
        if inner is None or not any(isinstance(p, str) for p in loc[position + 1 :]):
            break
        table = inner
    return table, field


def _inner_table(annotation: object) -> type[Table] | None:
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return annotation
    for argument in get_args(annotation):
        inner = _inner_table(argument)
        if inner is not None:
            return inner
    return None
