# SPDX-License-Identifier: MIT
"""``hytf demo``: the demo scenes that travel with the package, and copying one to the user."""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fenics_hytf
from fenics_hytf.cli.outcome import InputError, RunRequest


@dataclass(frozen=True)
class Copy:
    """A file to be copied into the folder one stands in.

    Attributes:
        name: Its name there.
        content: Its content there.
    """

    name: str
    content: bytes


def demo_folder() -> Path:
    """Where the demo scenes are: in the installed package, or beside it in a checkout."""
    package = Path(fenics_hytf.__file__).resolve().parent
    inside = package / "demos"
    return inside if inside.is_dir() else package.parent / "demos"


def list_demos() -> str:
    """Names and titles of the demos, one a line."""
    scenes = sorted(demo_folder().glob("*.toml"))
    width = max((len(scene.stem) for scene in scenes), default=0)
    return "\n".join(f"{scene.stem:{width}}  {_title(scene)}" for scene in scenes)


def find_demo(name: str) -> Path:
    """The scene of a demo.

    Args:
        name: Its name.

    Returns:
        The scene file.

    Raises:
        InputError: If there is no such demo.
    """
    names = sorted(scene.stem for scene in demo_folder().glob("*.toml"))
    if name not in names:
        raise InputError([f"demo: found {name!r}; expected one of {', '.join(names) or 'none'}"])
    return demo_folder() / f"{name}.toml"


def plan_demo(demo: Path, request: RunRequest) -> tuple[list[Copy], list[str], str]:
    """What would be copied, and whether the scene would run; writes nothing that stays.

    Args:
        demo: The demo's scene file.
        request: What was asked for.

    Returns:
        The files, the faults, and the hash of the scene (empty if it has faults).
    """
    from fenics_hytf.scene import Scene, SceneError

    copies = list(_copies(demo))
    faults = [
        f"{copy.name}: found another file of that name here; expected none, or the demo's own. "
        "Run the demo in another folder, or run your scene with: hytf run SCENE"
        for copy in copies
        if Path(copy.name).exists() and not _is_there(copy)
    ]
    with tempfile.TemporaryDirectory() as place:
        for copy in copies:
            Path(place, copy.name).write_bytes(copy.content)
        try:
            scene = Scene.load(Path(place, demo.name), request.overrides, request.motion)
        except SceneError as error:
            return copies, faults + [str(fault) for fault in error.faults], ""
    return copies, faults, scene.hash


def copy_demo(copies: list[Copy]) -> None:
    """Copy a demo's files into the folder one stands in, but those that are there already.

    Args:
        copies: The files.
    """
    for copy in copies:
        if not _is_there(copy):
            Path(copy.name).write_bytes(copy.content)


def _copies(demo: Path) -> Iterator[Copy]:
    """The scene and the files it refers to, all in one folder: other paths are cut to names."""
    text = demo.read_text(encoding="utf-8")
    for reference in _references(tomllib.loads(text)):
        name = Path(reference).name
        for quote in "\"'":
            text = text.replace(f"{quote}{reference}{quote}", f"{quote}{name}{quote}")
        yield Copy(name, (demo.parent / reference).read_bytes())
    yield Copy(demo.name, text.encode())


def _references(table: dict[str, Any]) -> list[str]:
    """Paths of the files that a scene refers to: a mesh, records."""
    tables = [table.get("mesh", {}), *table.get("motion", [])]
    return [part["file"] for part in tables if isinstance(part.get("file"), str)]


def _is_there(copy: Copy) -> bool:
    path = Path(copy.name)
    return path.is_file() and path.read_bytes() == copy.content


def _title(scene: Path) -> str:
    try:
        return str(tomllib.loads(scene.read_text(encoding="utf-8")).get("title", ""))
    except (OSError, ValueError):
        return ""
