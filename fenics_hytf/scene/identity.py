# SPDX-License-Identifier: MIT
"""What of a scene decides its results, and which of its keys differ from those of another scene.

Files count by what is in them, not by their names: a motion by its samples as scaled, a mesh by
its bytes, curves by their columns. Defaults are written out, so that a scene which spells one out
is the same scene. These may differ, for they decide what is written, or when a loop gives up, and
no number of what has been computed: ``title``, ``output.every``, ``output.fields``,
``output.water_table`` and ``effects.equivalent_linear.max_iterations``.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from fenics_hytf.scene.faults import Fault, join_key, name_key, toml_text
from fenics_hytf.scene.output import Receiver
from fenics_hytf.scene.scene import Scene
from fenics_hytf.scene.soil import Soil

_BESIDE = {".xdmf": ".h5", ".node": ".ele", ".ele": ".node"}
"""Meshes in two files: the suffix of the other one."""

_DEFAULTS = "defaults"


def identity(scene: Scene) -> dict[str, Any]:
    """What decides the results of a scene.

    Args:
        scene: The scene; its mesh file is read.

    Returns:
        Plain values as JSON knows them, by section; optional keys that are not given are left out.

    Raises:
        OSError: If the mesh file cannot be read any more.
    """
    mesh = scene.mesh.model_dump(exclude={"file"})
    if scene.mesh.file is not None:
        mesh["file"] = {"sha256": _digest_of_files(scene.mesh.file)}
    effects = scene.effects.model_dump(exclude={"equivalent_linear": {"max_iterations"}})
    parts = {
        "mesh": mesh,
        "soil": {name: _soil(soil) for name, soil in scene.soil.items()},
        "motion": _motions(scene),
        "boundary": _boundary(scene),
        "lapses": scene.lapses.model_dump(),
        "effects": effects,
        "points": scene.points.model_dump(),
        "solver": scene.solver.model_dump(),
        "output": {"receivers": {n: _receiver(r) for n, r in scene.output.receivers.items()}},
        _DEFAULTS: list(_defaults(scene)),
    }
    plain: dict[str, Any] = json.loads(json.dumps(_without_none(parts), default=str))
    return plain


def changed_keys(before: Mapping[str, Any], now: Mapping[str, Any], since: str) -> list[Fault]:
    """The keys in which two scenes differ.

    Args:
        before: What :func:`identity` said of the one.
        now: Of the other, whose values are *found*.
        since: What is said after the values *expected*, such as "as in the checkpoint".

    Returns:
        A fault a key, in the order of the sections; of a list of numbers the first one that
        differs; of a motion whose samples differ the keys of its table, or its source where they
        are the same. Defaults that follow from other keys are told where those do not differ.
    """
    faults: list[Fault] = []
    for section in dict.fromkeys((*now, *before)):
        old, new = before.get(section), now.get(section)
        if section == "motion":
            faults += _motion_changes(old or [], new or [], since)
        elif section != _DEFAULTS:
            faults += _changes(section, old, new, since)
    follow = set(before.get(_DEFAULTS, ())) & set(now.get(_DEFAULTS, ()))
    return [fault for fault in faults if fault.key not in follow] or faults


def _defaults(scene: Scene) -> Iterator[str]:
    """Keys whose values may follow from the number of lapses and the motions: not given."""
    for section in ("lapses", "solver"):
        names = type(getattr(scene, section)).model_fields
        yield from (join_key(section, n) for n in names if n not in scene.data.get(section, {}))


def _motions(scene: Scene) -> list[dict[str, Any]]:
    """Each motion as it is used, and the table that it was read from."""
    return [
        {
            "direction": motion.direction,
            "input": motion.input,
            "dt": motion.record.dt,
            "samples": motion.record.num_samples,
            "sha256": hashlib.sha256(motion.record.acceleration.tobytes()).hexdigest(),
            "source": table,
        }
        for motion, table in zip(scene.motion, scene.data["motion"], strict=True)
    ]


def _soil(soil: Soil) -> dict[str, Any]:
    described = soil.model_dump()
    curves = described["curves"]
    if curves is not None and "strain" in curves:
        described["curves"] = {name: value for name, value in curves.items() if name != "file"}
    return described


def _boundary(scene: Scene) -> dict[str, Any]:
    kinds: dict[str, Any] = dict(scene.boundary.kinds)
    rock = scene.boundary.rock
    if rock is not None:
        kinds["base"] = {"compliant": rock.model_dump()}
    return kinds


def _receiver(receiver: Receiver) -> Any:
    return {"point": receiver.place} if receiver.rides else receiver.place


def _digest_of_files(path: Path) -> str:
    """Digest of a mesh file, and of the one beside it where the format has two."""
    beside = path.with_suffix(_BESIDE.get(path.suffix.lower(), path.suffix))
    digest = hashlib.sha256()
    for part in dict.fromkeys((path, beside)):
        if part == path or part.is_file():
            with part.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()


def _without_none(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _without_none(v) for k, v in value.items() if v is not None}
    if isinstance(value, list | tuple | np.ndarray):
        return [_without_none(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


def _motion_changes(before: list[Any], now: list[Any], since: str) -> Iterator[Fault]:
    for number, (old, new) in enumerate(zip_longest(before, now)):
        key = join_key("motion", number)
        if old is None or new is None:
            yield from _changes(key, old and old["source"], new and new["source"], since)
            continue
        if {**old, "source": None} == {**new, "source": None}:
            continue
        faults = list(_changes(key, old["source"], new["source"], since))
        if not faults:  # the same words, other samples: a file has changed
            found, expected = (_samples(motion) for motion in (new, old))
            source = next((s for s in ("file", "record") if s in new["source"]), "")
            faults = [Fault(join_key(key, source), found, f"{expected}, {since}")]
        yield from faults


def _samples(motion: Mapping[str, Any]) -> str:
    return (
        f"{motion['samples']} samples of {motion['dt']:g} s with sha256 {motion['sha256'][:12]}..."
    )


def _changes(key: str, old: Any, new: Any, since: str) -> Iterator[Fault]:
    """Where two plain values differ, as deep as they are alike."""
    if isinstance(old, dict) and isinstance(new, dict):
        if set(old) == set(new) == {"sha256"}:
            if old != new:
                found, expected = (
                    f"contents with sha256 {d['sha256'][:12]}..." for d in (new, old)
                )
                yield Fault(key, found, f"{expected}, {since}")
            return
        for name in dict.fromkeys((*new, *old)):
            where = join_key(key, name_key(name))
            yield from _changes(where, old.get(name), new.get(name), since)
    elif isinstance(old, list) and isinstance(new, list) and _is_deep(old) and _is_deep(new):
        for number, (was, is_now) in enumerate(zip_longest(old, new)):
            yield from _changes(join_key(key, number), was, is_now, since)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new) > 3:
        differing = (n for n in range(len(old)) if not _is_same(old[n], new[n]))
        for number in list(differing)[:1]:
            yield from _changes(join_key(key, number), old[number], new[number], since)
    elif not _is_same(old, new):
        yield Fault(key, toml_text(new), f"{toml_text(old)}, {since}")


def _is_deep(values: list[Any]) -> bool:
    return any(isinstance(value, dict | list) for value in values)


def _is_same(old: Any, new: Any) -> bool:
    """Equal as TOML has it: 1 is 1.0, but not true."""
    return bool(old == new) and isinstance(old, bool) == isinstance(new, bool)
