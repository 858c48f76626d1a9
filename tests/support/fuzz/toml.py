# SPDX-License-Identifier: MIT
"""A raw table as the text of a scene file, whatever stands in it."""

import datetime as dt
import math
import re
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def document(data: dict[str, Any]) -> str:
    """A scene file: one inline table a section, sub-tables of sections as lines."""
    lines = []
    for name, section in data.items():
        if isinstance(section, dict) and section:
            lines.append(f"[{key(name)}]")
            lines += [f"{key(k)} = {value(v)}" for k, v in section.items()]
        else:  # top-level values come before the first table
            lines.insert(0, f"{key(name)} = {value(section)}")
    return "\n".join(lines) + "\n"


def key(name: object) -> str:
    """A key, quoted where it has to be."""
    text = str(name)
    return text if _BARE.fullmatch(text) else _string(text)


def value(found: Any) -> str:
    """A value on one line."""
    if isinstance(found, bool):
        return "true" if found else "false"
    if isinstance(found, int | dt.date | dt.time):
        return str(found).replace(" ", "T")
    if isinstance(found, float):
        return repr(found) if math.isfinite(found) else str(found)
    if isinstance(found, dict):
        return "{ " + ", ".join(f"{key(k)} = {value(v)}" for k, v in found.items()) + " }"
    if isinstance(found, list | tuple):
        return "[" + ", ".join(value(v) for v in found) + "]"
    return _string(str(found))


def _string(text: str) -> str:
    escaped = (
        f"\\{c}" if c in '"\\' else c if c.isprintable() else f"\\U{ord(c):08x}" for c in text
    )
    return '"' + "".join(escaped) + '"'
