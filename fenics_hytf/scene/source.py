# SPDX-License-Identifier: MIT
"""From a scene file, overrides and a motion named on the command line to one raw table."""

from __future__ import annotations

import copy
import re
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fenics_hytf.scene.faults import Fault, toml_text
from fenics_hytf.scene.files import IRREGULAR, unusable

_INDEX = re.compile(r"\[(\d+)\]")
_LONG_INDEX = 10  # digits: no array is that long, and int() takes no more than some thousands
_SOURCES = ("file", "harmonic", "record", "synthetic", "dt", "units")


def read_source(
    path: Path, overrides: Sequence[str] = (), motion_file: Path | str | None = None
) -> tuple[dict[str, Any] | None, list[Fault]]:
    """Read a scene file as one raw table.

    Args:
        path: The scene file.
        overrides: ``key.path=value`` with TOML values, as after ``--set``; array items by number
            (``motion[0].pga=0.3`` or ``motion.0.pga=0.3``); a value that is no TOML is a string.
        motion_file: Takes the place of the first motion's source, as after ``--motion``.

    Returns:
        The table, or ``None`` if the file cannot be read; and the faults.
    """
    if unusable(path) == IRREGULAR:
        found = f"something {IRREGULAR}"
        return None, [Fault(str(path), found, "a scene file")]
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        found = f"byte 0x{error.object[error.start]:02x} at {error.start}, which is not UTF-8"
        return None, [Fault(str(path), found, "a scene file (TOML in UTF-8)")]
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        return None, [Fault(str(path), f"nothing that can be read ({reason})", "a scene file")]
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        return None, [_syntax_fault(path, text, str(error))]
    except RecursionError:
        return None, [Fault(str(path), "values nested too deeply", "a scene file")]
    except ValueError:  # of int(), which refuses to read so many digits
        return None, [_long_integer(f"{path}{_line_of_digits(text)}")]
    if motion_file is not None:
        _replace_motion(data, Path(motion_file).absolute())
    faults = [fault for override in overrides for fault in apply_override(data, override)]
    return data, faults


def apply_override(data: dict[str, Any], override: str) -> list[Fault]:
    """Set one value of a raw table in place.

    Args:
        data: The table.
        override: ``key.path=value``.

    Returns:
        The fault, if it cannot be set.
    """
    key = f"--set {override}"
    left, equals, right = override.partition("=")
    path = _key_path(left)
    if not equals or path is None:
        return [Fault(key, toml_text(override), "key=value, such as solver.max_frequency=10")]
    try:
        parsed = tomllib.loads(f"value = {right}")
        value = parsed["value"] if len(parsed) == 1 else right
    except (tomllib.TOMLDecodeError, RecursionError):
        value = right.strip()
    except ValueError:
        return [_long_integer(f"--set {left.strip()}")]
    place: Any = data
    for step, part in enumerate(path):
        last = step == len(path) - 1
        if isinstance(place, list):
            if not (part.isdecimal() and len(part) < _LONG_INDEX and int(part) < len(place)):
                return [Fault(key, part, f"an item from 0 to {len(place) - 1}")]
            index: Any = int(part)
        elif isinstance(place, dict):
            index = part
        else:
            return [Fault(key, toml_text(place), f"a table at {'.'.join(path[:step])}")]
        if last:
            place[index] = value
        else:
            place = place.setdefault(index, {}) if isinstance(place, dict) else place[index]
    return []


def _key_path(text: str) -> list[str] | None:
    """The parts of a dotted key, or ``None`` if it is none."""
    try:
        dotted = _INDEX.sub(r".\1", text.strip())
        table: Any = tomllib.loads(f"{dotted} = 0")
    except (tomllib.TOMLDecodeError, RecursionError):
        return None
    path: list[str] = []
    while isinstance(table, dict):
        if len(table) != 1:
            return None
        part, table = next(iter(table.items()))
        path.append(part)
    return path


def _replace_motion(data: dict[str, Any], path: Path) -> None:
    """Put a file in the place of the first motion's source; CSV files stay in their units."""
    motions = data.setdefault("motion", [{}])
    if isinstance(motions, list) and motions and isinstance(motions[0], dict):
        kept = {k: v for k, v in motions[0].items() if k not in _SOURCES}
        if "units" in motions[0] and path.suffix.lower() != ".at2":
            kept["units"] = motions[0]["units"]
        motions[0] = {**kept, "file": str(path)}


def _syntax_fault(path: Path, text: str, message: str) -> Fault:
    """A TOML syntax error with its line."""
    place = re.search(r" \(at (?:line (\d+), (column \d+)|end of document)\)$", message)
    what = message[: place.start()] if place else message
    lines = text.splitlines() or [""]
    line = int(place[1]) if place and place[1] else len(lines)
    content = lines[line - 1].strip() if line <= len(lines) else ""
    where = f" at {place[2]}" if place and place[2] else ""
    return Fault(f"{path}, line {line}", toml_text(content), f"valid TOML ({what}{where})")


def _long_integer(key: str) -> Fault:
    """An integer that is longer than Python reads."""
    most = sys.get_int_max_str_digits()
    return Fault(key, f"an integer of more than {most} digits", "a number that can be used")


def _line_of_digits(text: str) -> str:
    """Where the first such integer stands, as far as that can be seen from the text alone."""
    digits = re.search(rf"[\d_]{{{sys.get_int_max_str_digits() + 1},}}", text)
    return f", line {text.count(chr(10), 0, digits.start()) + 1}" if digits else ""


def copy_data(data: dict[str, Any]) -> dict[str, Any]:
    """A copy of a raw table that later changes do not reach."""
    return copy.deepcopy(data)
