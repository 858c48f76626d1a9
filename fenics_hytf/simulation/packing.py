# SPDX-License-Identifier: MIT
"""Records as plain values and arrays, and back: what a checkpoint is made of.

A record (a dataclass of numbers, texts, arrays, tuples, mappings and further records) becomes a
tree of plain values as JSON knows them, in which arrays stand by their names. Nothing in the tree
says what to execute: the type that is read back is the one the caller names, and the types of its
fields are those its annotations name. Numbers come back to the last bit, NaN and whole numbers
of any size among them.
"""

from __future__ import annotations

import dataclasses
import math
import struct
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from fenics_hytf.simulation.errors import CheckpointError

Arrays = dict[str, npt.NDArray[Any]]

_KINDS = "biufcU"  # of dtypes: numbers, truth values and texts, never objects
_EXACT = 2**53  # whole numbers that any reader of JSON takes as they are


def pack(value: object, name: str, arrays: Arrays) -> Any:
    """Make a tree of plain values of a record.

    Args:
        value: The record, or any part of one.
        name: Where it stands; arrays are named ``name/field``.
        arrays: Its arrays are added here, not copied.

    Returns:
        The tree.

    Raises:
        TypeError: Something in it is no number, text, array, sequence, mapping or dataclass.
        ValueError: Two arrays have the same name.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, int | float | complex):
        return _pack_number(value)
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in _KINDS:
            raise TypeError(f"{name}: found an array of {value.dtype}; expected one of numbers")
        if name in arrays:
            raise ValueError(f"{name}: found a second array of that name; expected one")
        arrays[name] = value
        return {"array": name}
    if isinstance(value, tuple | list):
        return [pack(item, f"{name}/{number}", arrays) for number, item in enumerate(value)]
    if isinstance(value, Mapping):
        packed = {str(key): pack(item, f"{name}/{key}", arrays) for key, item in value.items()}
        return {"mapping": packed}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {
            field.name: pack(getattr(value, field.name), f"{name}/{field.name}", arrays)
            for field in dataclasses.fields(value)
        }
        return {"record": type(value).__name__, "fields": fields}
    raise TypeError(
        f"{name}: found a {type(value).__name__}; expected numbers, texts, arrays, sequences, "
        "mappings or dataclasses of them"
    )


def unpack(tree: Any, kind: Any, arrays: Mapping[str, npt.NDArray[Any]], name: str) -> Any:
    """Make a record of a tree again.

    Args:
        tree: What :func:`pack` returned.
        kind: The type of the record, such as ``tuple[LapseResult, ...]``.
        arrays: What :func:`pack` added.
        name: Where it stands, for messages.

    Returns:
        The record. Fields that the tree lacks take their defaults; sequences whose type is not
        named are tuples.

    Raises:
        CheckpointError: The tree does not fit the type.
    """
    if tree is None or isinstance(tree, bool | str | int | float):
        return tree
    if isinstance(tree, list):
        items = [
            unpack(item, inner, arrays, f"{name}/{number}")
            for number, (item, inner) in enumerate(zip(tree, _item_kinds(kind), strict=False))
        ]
        return items if _is_list(kind) else tuple(items)
    if not isinstance(tree, dict):
        raise _misfit(name, f"a {type(tree).__name__}", "a plain value")
    if "array" in tree:
        if tree["array"] not in arrays:
            raise _misfit(name, "no array", "one")
        return arrays[tree["array"]]
    if "record" in tree:
        return _unpack_record(tree, kind, arrays, name)
    if "mapping" in tree:
        inner = _value_kind(kind)
        mapping = {k: unpack(v, inner, arrays, f"{name}/{k}") for k, v in tree["mapping"].items()}
        made = next((k for k in _alternatives(kind) if _is_dict(k)), dict)
        return (typing.get_origin(made) or made)(mapping)
    return _unpack_number(tree, name)


def _pack_number(value: complex) -> Any:
    if isinstance(value, int):
        return int(value) if abs(value) <= _EXACT else {"int": str(int(value))}
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else {"float": struct.pack(">d", value).hex()}
    return {"complex": [_pack_number(value.real), _pack_number(value.imag)]}


def _unpack_number(tree: dict[str, Any], name: str) -> complex:
    try:
        ((kind, text),) = tree.items()
        if kind == "int":
            return int(text)
        if kind == "float":
            return float(struct.unpack(">d", bytes.fromhex(text))[0])
        if kind == "complex":
            parts = [_unpack_number(p, name) if isinstance(p, dict) else float(p) for p in text]
            real, imaginary = parts
            return complex(real.real, imaginary.real)
    except (TypeError, ValueError, struct.error) as error:
        raise _misfit(name, f"{tree} ({error})", "a number") from error
    raise _misfit(name, f"a table of {', '.join(tree)}", "a number")


def _unpack_record(
    tree: dict[str, Any], kind: Any, arrays: Mapping[str, npt.NDArray[Any]], name: str
) -> Any:
    fields = tree.get("fields")
    made = next((k for k in _records(kind) if k.__name__ == tree["record"]), None)
    if made is None or not isinstance(fields, dict):
        expected = ", ".join(k.__name__ for k in _records(kind)) or str(kind)
        raise _misfit(name, f"a record {tree['record']}", expected)
    hints = typing.get_type_hints(made)
    known = {field.name: field for field in dataclasses.fields(made)}
    surplus = [key for key in fields if key not in known]
    if surplus:
        raise _misfit(name, f"{', '.join(surplus)}", f"only {', '.join(known)}")
    values = {
        key: unpack(value, hints[key], arrays, f"{name}/{key}") for key, value in fields.items()
    }
    lacking = [
        key
        for key, field in known.items()
        if key not in values
        and field.init
        and field.default is dataclasses.MISSING
        and field.default_factory is dataclasses.MISSING
    ]
    if lacking:
        raise _misfit(name, f"no {', '.join(lacking)}", "them")
    record = made(**{key: value for key, value in values.items() if known[key].init})
    for key, value in values.items():
        if not known[key].init:
            object.__setattr__(record, key, value)
    return record


def _alternatives(kind: Any) -> Iterator[Any]:
    """The members of a union, or the type itself."""
    origin = typing.get_origin(kind)
    if origin is typing.Annotated:
        yield from _alternatives(typing.get_args(kind)[0])
    elif origin in (typing.Union, types.UnionType):
        for member in typing.get_args(kind):
            yield from _alternatives(member)
    else:
        yield kind


def _records(kind: Any) -> Iterator[type]:
    """The dataclasses that a type allows, subclasses among them."""
    for member in _alternatives(kind):
        if isinstance(member, type) and typing.get_origin(member) is None:
            if dataclasses.is_dataclass(member):
                yield member
            for below in member.__subclasses__() if member is not object else ():
                yield from _records(below)


def _is_list(kind: Any) -> bool:
    return list in [typing.get_origin(member) or member for member in _alternatives(kind)]


def _item_kinds(kind: Any) -> Iterator[Any]:
    """The type of each item of a sequence."""
    for member in _alternatives(kind):
        origin, inner = typing.get_origin(member), typing.get_args(member)
        if origin is tuple and Ellipsis not in inner:
            yield from inner
        elif inner and origin is not None and not _is_dict(member):
            while True:
                yield inner[0]
    while True:
        yield Any


def _value_kind(kind: Any) -> Any:
    """The type of the values of a mapping."""
    for member in _alternatives(kind):
        if _is_dict(member) or typing.get_origin(member) is Mapping:
            inner = typing.get_args(member)
            return inner[1] if len(inner) == 2 else Any
    return Any


def _is_dict(kind: Any) -> bool:
    origin = typing.get_origin(kind) or kind
    return isinstance(origin, type) and issubclass(origin, dict)


def _misfit(name: str, found: str, expected: str) -> CheckpointError:
    return CheckpointError(
        f"{name} in the checkpoint: found {found}; expected {expected}, as this version keeps it. "
        "Start anew: --force instead of --resume"
    )
