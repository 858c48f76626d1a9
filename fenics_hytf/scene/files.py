# SPDX-License-Identifier: MIT
"""Files that a scene names: there, and of a kind that comes to an end."""

from __future__ import annotations

from pathlib import Path

IRREGULAR = "which is no regular file"


def unusable(path: Path) -> str | None:
    """Why a path cannot be read as a file.

    Folders, devices and pipes are refused before they are opened: a pipe may wait for ever, a
    device need not end.

    Args:
        path: The path; one that cannot exist is not there.

    Returns:
        The reason, to go after the path; ``None`` for a file.
    """
    try:
        if path.is_file():
            return None
        return IRREGULAR if path.exists() else "which is not there"
    except (OSError, ValueError):
        return "which is not there"
