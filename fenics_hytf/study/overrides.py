# SPDX-License-Identifier: MIT
"""Values of a scene file that others take the place of."""

from __future__ import annotations

from typing import Any

from fenics_hytf.scene.faults import toml_text

Path = tuple[str | int, ...]
Overrides = dict[Path, Any]
"""Values by their place in the file."""


def text_of(overrides: Overrides) -> list[str]:
    """Overrides as after ``--set``."""
    return [f"{_key(path)}={toml_text(value)}" for path, value in overrides.items()]


def _key(path: Path) -> str:
    parts = [f"[{part}]" if isinstance(part, int) else f".{part}" for part in path]
    return "".join(parts).lstrip(".")


def place(data: dict[str, Any], path: Path, value: Any) -> None:
    """Set a value of the raw table of a scene, in place; tables on the way are made."""
    table: Any = data
    for part in path[:-1]:
        table = table.setdefault(part, {}) if isinstance(table, dict) else table[part]
    table[path[-1]] = value
