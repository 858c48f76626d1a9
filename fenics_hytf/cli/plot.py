# SPDX-License-Identifier: MIT
"""``hytf plot``: figures and report of a finished result, from its folder alone."""

from __future__ import annotations

from pathlib import Path

from fenics_hytf.cli.outcome import DONE, INPUT, say, tell
from fenics_hytf.results import ResultError, as_written, locked, publish


def plot_result(folder: Path) -> int:
    """Draw a result again.

    Args:
        folder: Its folder.

    Returns:
        The exit code.
    """
    try:
        with locked(folder), as_written(folder):
            written = publish(folder)
    except ResultError as error:
        tell([str(error)])
        return INPUT
    except OSError as error:
        tell([f"{folder}: found that it cannot be written ({error}); expected write permission"])
        return INPUT
    say(f"{folder}: {', '.join(written)}")
    return DONE
