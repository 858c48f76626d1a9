# SPDX-License-Identifier: MIT
"""What is wrong with a scene: every fault with its key, what was found, what was expected.

Faults are collected, never raised one by one; :class:`SceneError` carries all of them.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

NOT_YET = "not in this version"
NOTHING = "nothing"
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_MESSAGE = re.compile(r"(.*?): found (.*?); expected (.*)", re.DOTALL)
_QUOTED = re.compile(r'(["\\])')
_BACKSLASH = r"\\\1"
_LONGEST = 60


@dataclass(frozen=True)
class Fault:
    """One thing wrong with the input.

    Attributes:
        key: Where: the dotted key in the scene file (``soil.sand.density``), or a file.
        found: What stands there, as TOML would write it; ``nothing`` where a key is missing.
        expected: What should stand there, with its unit; or ``not in this version; ...``.
    """

    key: str
    found: str
    expected: str

    def __str__(self) -> str:
        if self.expected.startswith(NOT_YET):
            return f"{self.key}: found {self.found}; {self.expected}"
        return f"{self.key}: found {self.found}; expected {self.expected}"


class SceneError(ValueError):
    """The scene cannot be used; ``str()`` lists every fault, one a line.

    Attributes:
        faults: Every fault, in the order of the file's sections.
    """

    def __init__(self, faults: Iterable[Fault]) -> None:
        self.faults: list[Fault] = list(faults)
        super().__init__("\n".join(str(fault) for fault in self.faults))


def fault_from(error: Exception, key: str, found: str) -> Fault:
    """The fault that an error of a lower room tells, ``WHERE: found X; expected Y; ADVICE``.

    Args:
        error: The error.
        key: Key of the value that was refused.
        found: What stands there, for an error that is worded otherwise.

    Returns:
        The fault; WHERE extends the key if it is one, and goes into what was found otherwise.
    """
    message = _MESSAGE.fullmatch(str(error))
    if message is None:
        return Fault(key, found, f"a value that can be used ({error})")
    where, there, expected = (_printable(part) for part in message.groups())
    last = key.rsplit(".", 1)[-1]
    if where == last or where.startswith(f"{last}."):
        return Fault(key + where.removeprefix(last), there, expected)
    if _BARE_KEY.fullmatch(where):
        return Fault(join_key(key, where), there, expected)
    return Fault(key, f"{there} ({where})", expected)


def join_key(*parts: str | int) -> str:
    """Write a key as the user would: ``mesh.column.layers[0].soil``; odd names are quoted."""
    text = ""
    for part in parts:
        if isinstance(part, int):
            text += f"[{part}]"
        elif part:
            text += "." if text else ""
            text += part
    return text


def name_key(name: object) -> str:
    """A user's name (of a soil, a receiver) as part of a key, quoted where TOML would."""
    text = str(name)
    return text if _BARE_KEY.fullmatch(text) else toml_text(text)


def toml_text(value: Any, depth: int = 2) -> str:
    """Write a value as TOML would, shortened to what fits a message."""
    if value is None:
        return NOTHING
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Path):
        return toml_text(str(value))
    if isinstance(value, str):
        return _shorten(f'"{_printable(_QUOTED.sub(_BACKSLASH, value[: 2 * _LONGEST]))}"')
    if isinstance(value, int):
        return str(value) if abs(value) < 10**_LONGEST else "an integer of too many digits"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, dict):
        if depth == 0 or not value:
            return "a table" if value else "an empty table"
        items = (f"{name_key(k)} = {toml_text(v, depth - 1)}" for k, v in list(value.items())[:8])
        return _shorten("{ " + ", ".join(items) + " }")
    if isinstance(value, list | tuple):
        if depth == 0:
            return "an array"
        return _shorten("[" + ", ".join(toml_text(v, depth - 1) for v in value[:16]) + "]")
    if isinstance(value, dt.date | dt.time):
        return value.isoformat()
    return f"a {type(value).__name__}"


def _printable(text: str) -> str:
    """The text on one line, other characters than printable ones as TOML escapes."""
    return "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in text)


def _shorten(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 4] + " ..."
