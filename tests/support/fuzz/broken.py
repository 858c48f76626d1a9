# SPDX-License-Identifier: MIT
"""Scenes with something wrong: sound ones of which a key, a value, a byte or a file is changed."""

import copy
import datetime as dt
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

from support.fuzz import toml
from support.fuzz.meshes import Drawn, damaged_meshes
from support.fuzz.records import damaged_records
from support.fuzz.scenes import Case, scenes

NAN, INF = float("nan"), float("inf")
ODD_NUMBERS = (NAN, INF, -INF, 0, 0.0, -0.0, -1, -1.0, 1e300, -1e300, 1e-300, 5e-324)
HUGE = (50, 10**6, 10**9, 10**12, 10**18, 10**30, 1e12, 1e-12)
ODD_STRINGS = (
    "",
    " ",
    "x" * 20_000,
    "\x00",
    "a\nb",
    "'\"\\",
    "\u202e\U0001f30b",
    "../..",
    "/",
    "/dev/null",
    "-1",
    "nan",
    "x, y",
)
ODD_VALUES = (True, False, [], {}, [[]], [{}], {"x": 1}, [1, "a"], dt.date(2020, 1, 1))
ODD = (*ODD_NUMBERS, *HUGE, *ODD_STRINGS, *ODD_VALUES)

Place = tuple[Any, Any]


@st.composite
def broken_scenes(draw: st.DrawFn, drawn: dict[str, Drawn]) -> tuple[Case, bytes]:
    """A sound scene with one to three things changed.

    Returns:
        The scene with its files, and what the scene file holds.
    """
    case = draw(scenes(drawn))
    data = copy.deepcopy(case.data)
    how = draw(st.sampled_from(("values", "values", "values", "keys", "text", "files", "sizes")))
    if how == "values":
        for _ in range(draw(st.integers(1, 3))):
            table, key = draw(st.sampled_from(list(_leaves(data))))
            table[key] = draw(_changed(table[key]))
    elif how == "keys":
        for _ in range(draw(st.integers(1, 2))):
            draw(_change_keys(data))
    elif how == "sizes":
        draw(_blow_up(data))
    text = toml.document(data).encode("utf-8", errors="surrogatepass")
    if how == "text":
        text = draw(_garbled(text))
    elif how == "files":
        case = draw(_without_file(case, drawn))
    return Case(data, case.files, case.mesh), text


def _leaves(table: Any) -> Iterator[Place]:
    """Each value that is no table or array of tables, by what holds it and where; arrays too."""
    items = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in list(items):
        yield table, key
        if isinstance(value, dict | list):
            yield from _leaves(value)


@st.composite
def _changed(draw: st.DrawFn, value: Any) -> Any:
    """Another value: one much larger or smaller, of another sign, or of another kind."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if number and draw(st.integers(0, 3)):
        factor = draw(st.sampled_from((-1, 1e-20, 1e-9, 1e-3, 0.1, 0.5, 2, 10, 1e3, 1e9, 1e20)))
        changed = value * factor
        whole = isinstance(value, int) and draw(st.booleans())
        return int(changed) if whole and abs(changed) < 1e30 else changed
    return draw(st.sampled_from(ODD))


@st.composite
def _change_keys(draw: st.DrawFn, data: dict[str, Any]) -> None:
    """Remove a key, call it otherwise, or add one."""
    tables = [data, *(t[k] for t, k in _leaves(data) if isinstance(t[k], dict))]
    table = draw(st.sampled_from([t for t in tables if t] or [data]))
    key = draw(st.sampled_from(list(table) or ["x"]))
    how = draw(st.sampled_from(("remove", "rename", "add", "move")))
    if how in ("remove", "rename", "move"):
        value = table.pop(key, 1)
        if how == "rename":
            table[draw(st.sampled_from((key[:-1], key.upper(), f"{key}s", "ü", "")))] = value
        if how == "move":
            draw(st.sampled_from(tables))[key] = value
    else:
        table[draw(st.sampled_from(("x", "degree", "file", "soil", "a.b", "")))] = draw(
            st.sampled_from(ODD)
        )


@st.composite
def _blow_up(draw: st.DrawFn, data: dict[str, Any]) -> None:
    """Sizes that would fill any memory or take for ever, and numbers near the largest."""
    mesh, motion = data["mesh"], data["motion"][0]
    number = draw(st.sampled_from((10**8, 10**9, 10**12, 10**18)))
    tables: list[tuple[dict[str, Any], str, Any]] = [
        (data.setdefault("lapses", {}), "count", number),
        (data["lapses"], "duration", draw(st.sampled_from((1e-300, 1e300, 1e-9, 0.02)))),
        (mesh, "refine", draw(st.sampled_from((1, 5, 50, number)))),
        (mesh, "points_per_cell", number),
        (motion, "pga", draw(st.sampled_from((1e300, 1e308, 1e150, 1e12, 1e-300)))),
        (motion, "scale", draw(st.sampled_from((1e300, 1e308, 1e150, 1e12, 1e-300)))),
        (data.setdefault("output", {}), "every", number),
        (data.setdefault("solver", {}), "max_frequency", draw(st.sampled_from((1e-300, 1e300)))),
        (data["solver"], "reference_frequency", draw(st.sampled_from((1e-300, 1e300)))),
    ]
    if "box" in mesh:
        cells = [draw(st.sampled_from((10**6, number)))] * len(mesh["box"]["cells"])
        tables.append((mesh["box"], "cells", cells))
    if "column" in mesh:
        tables.append((mesh["column"]["layers"][0], "cells", number))
        tables.append((mesh["column"], "layers", mesh["column"]["layers"] * 100))
    if "harmonic" in motion:
        tables.append((motion["harmonic"], "samples", number))
        tables.append((motion["harmonic"], "frequency", draw(st.sampled_from((1e-300, 1e300)))))
    if "synthetic" in motion:
        tables.append((motion["synthetic"], "n", number))
        tables.append((motion["synthetic"], "nf", number))
        tables.append((motion["synthetic"], "dt", draw(st.sampled_from((1e-300, 1e300)))))
    effects = data.setdefault("effects", {})
    tables += [
        (effects, "gravity", {"acceleration": draw(st.sampled_from((1e300, 1e-300)))}),
        (effects, "rayleigh", {"alpha": 1e300, "beta": draw(st.sampled_from((0.0, 1e300)))}),
        (effects, "sliding", {"time_step": 1e-12, "longest": 1e12}),
        (effects, "calm", {"sides": ["left"], "thickness": 1e-300, "damping": 1e300}),
    ]
    for soil in data["soil"].values():
        for name in soil.keys() - {"curves", "k0", "damping"}:
            tables.append((soil, name, draw(st.sampled_from((1e300, 1e-300, 1e150, 1e20)))))
    table, key, value = draw(st.sampled_from(tables))
    table[key] = value


@st.composite
def _garbled(draw: st.DrawFn, text: bytes) -> bytes:
    """A scene file cut off, with bytes put in, left out or turned round, or without end."""
    at = draw(st.integers(0, len(text) - 1))
    how = draw(st.sampled_from(("cut", "insert", "drop", "repeat", "nest", "digits", "order")))
    if how == "cut":
        return text[:at]
    if how == "insert":
        bytes_ = draw(st.one_of(st.binary(min_size=1, max_size=4), st.just(b"\xff\xfe\0")))
        return text[:at] + bytes_ + text[at:]
    if how == "drop":
        return text[:at] + text[at + draw(st.integers(1, 5)) :]
    if how == "repeat":
        return text + text[at:]
    if how == "nest":
        return text + b"x = " + b"[" * 5000 + b"]" * 5000
    if how == "digits":  # more than int() reads
        return text + b"x = " + b"1" * 5000
    lines = text.split(b"\n")
    return b"\n".join(lines[::-1])


@st.composite
def _without_file(draw: st.DrawFn, case: Case, drawn: dict[str, Drawn]) -> Case:
    """One of the scene's files damaged, missing, or a folder: ``None`` among the files."""
    files: dict[str, Any] = dict(case.files)
    if not files:
        return case
    name = draw(st.sampled_from(sorted(files)))
    how = draw(st.sampled_from(("damage",) * 6 + ("missing", "folder", "other")))
    if how == "missing":
        del files[name]
    elif how == "folder":
        files[name] = None
    elif how == "other":  # what another file holds
        files[name] = draw(st.sampled_from([d.content for d in drawn.values()]))
    elif name.startswith("mesh") and case.mesh is not None:
        files[name] = draw(damaged_meshes(drawn[case.mesh]))
    else:
        files[name] = draw(damaged_records(files[name]))
    return Case(case.data, files, case.mesh)
