# SPDX-License-Identifier: MIT
"""What the scripts do on the command line: draw as the options say."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path


def draw_as_asked(
    draw: Callable[..., Path],
    options: argparse.ArgumentParser,
    arguments: Sequence[str] | None = None,
) -> None:
    """Draw a mesh; ends with a message where the options make none.

    Args:
        draw: Takes the path, and all other options by name.
        options: The options; ``output`` is the path.
        arguments: Those of the process if ``None``.
    """
    given = vars(options.parse_args(arguments))
    try:
        draw(given.pop("output"), **given)
    except (ValueError, RuntimeError) as error:
        options.error(str(error))
