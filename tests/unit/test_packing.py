# SPDX-License-Identifier: MIT
"""Records as plain values and arrays, and back: to the last bit."""

from __future__ import annotations

import dataclasses
import json
import math
import struct
from collections import Counter
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import pytest
from support.results_builder import make_result

from fenics_hytf.lapse.records import LapseResult
from fenics_hytf.simulation import CheckpointError, Work
from fenics_hytf.simulation.packing import pack, unpack


@dataclass(frozen=True)
class Inner:
    values: npt.NDArray[np.float64] | None
    count: int = 3


@dataclass(frozen=True)
class Below(Inner):
    more: str = "ä\n"


@dataclass(frozen=True)
class Outer:
    inner: Inner
    several: tuple[Inner, ...]
    pair: tuple[int, Inner | None]
    listed: list[float]
    by_name: dict[str, Inner]
    counted: Counter[str]
    number: complex
    big: int
    annotated: Annotated[float, "m"]
    anything: Any
    nothing: float | None
    truth: bool
    late: int = field(init=False, default=0)


def round_trip(value, kind):
    arrays = {}
    tree = json.loads(json.dumps(pack(value, "value", arrays)))
    return unpack(tree, kind, arrays, "value")


def same(a, b):
    """Equal in type and in every bit."""
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if dataclasses.is_dataclass(a):
        fields = dataclasses.fields(a)
        return type(a) is type(b) and all(
            same(getattr(a, f.name), getattr(b, f.name)) for f in fields
        )
    if isinstance(a, tuple | list):
        return type(a) is type(b) and len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return type(a) is type(b) and list(a) == list(b) and all(map(same, a.values(), b.values()))
    if isinstance(a, float):
        return type(b) is float and struct.pack("d", a) == struct.pack("d", b)
    return type(a) is type(b) and a == b


def outer(**more):
    values = np.array([0.1, np.nan, -np.inf, -0.0])
    fields = {
        "inner": Inner(values),
        "several": (Inner(None, 1), Below(values[:0], 2, "x")),
        "pair": (2**53 + 1, Inner(values)),
        "listed": [0.1, math.nan, math.inf, -0.0, 5e-324],
        "by_name": {"a/b": Inner(values), "": Inner(None)},
        "counted": Counter({"mass": 2}),
        "number": complex(0.1, -math.inf),
        "big": -(7**900),
        "annotated": 1 / 3,
        "anything": (1, "two", None, (3.0,)),
        "nothing": None,
        "truth": True,
        **more,
    }
    return Outer(**fields)


def test_everything_comes_back_to_the_last_bit():
    record = outer()
    object.__setattr__(record, "late", 7)
    assert same(record, round_trip(record, Outer))
    odd = struct.unpack(">d", bytes.fromhex("fff8000000000123"))[0]  # a NaN with a message
    assert same(odd, round_trip(odd, float))


@pytest.mark.parametrize("dtype", ["f8", "f4", "c16", "i4", "i8", "u1", "?", "U400", ">f8"])
def test_arrays_keep_their_kind(dtype):
    for shape in ((), (0, 3), (2, 3)):
        array = np.arange(math.prod(shape)).reshape(shape).astype(dtype)
        assert same(array, round_trip(array, np.ndarray))


def test_scalars_of_numpy_become_numbers():
    record = Inner(None, np.int64(4))
    assert same(Inner(None, 4), round_trip(record, Inner))
    assert same(
        (0.5, True, 1j), round_trip((np.float64(0.5), np.bool_(True), np.complex128(1j)), tuple)
    )


def test_a_result_comes_back():
    result = make_result(lapses=3, directions=("x", "y"), compliant=True, kind="box")
    lapses = (*result.lapses, *make_result(loop=False).lapses)
    assert same(lapses, round_trip(lapses, tuple[LapseResult, ...]))
    assert same(result.work, round_trip(result.work, Work))


def test_a_field_that_is_new_takes_its_default():
    arrays = {}
    tree = pack(outer(), "value", arrays)
    del tree["fields"]["late"], tree["fields"]["inner"]["fields"]["count"]
    record = unpack(tree, Outer, arrays, "value")
    assert record.late == 0 and record.inner.count == 3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda tree: tree["fields"].pop("truth"), "value in the checkpoint: found no truth"),
        (lambda tree: tree["fields"].update(old=1), "found old; expected only inner"),
        (lambda tree: tree.update(record="Path"), "found a record Path; expected Outer"),
        (lambda tree: tree["fields"].update(big={"int": "x"}), "value/big in the checkpoint"),
        (lambda tree: tree["fields"].update(number={"complex": [1]}), "value/number"),
        (lambda tree: tree["fields"].update(big={"call": "exit"}), "value/big"),
        (lambda tree: tree["fields"].update(big={}), "value/big"),
        (lambda tree: tree["fields"]["inner"]["fields"].update(values={"array": "z"}), "no array"),
    ],
)
def test_what_does_not_fit_is_told(change, words):
    arrays = {}
    tree = pack(outer(), "value", arrays)
    change(tree)
    with pytest.raises(CheckpointError, match="Start anew") as error:
        unpack(tree, Outer, arrays, "value")
    assert words in str(error.value)


@pytest.mark.parametrize(
    "value", [object(), np.array([object()]), {1, 2}, b"x", np.array(["2020"], "M8[D]"), Inner]
)
def test_what_cannot_be_kept_is_refused(value):
    with pytest.raises(TypeError, match=r"state/0/part: found an? "):
        pack([{"part": value}], "state", {})


def test_two_arrays_of_one_name_are_refused():
    with pytest.raises(ValueError, match="second array"):
        pack({"a": {"b": np.zeros(1)}, "a/b": np.zeros(1)}, "state", {})
