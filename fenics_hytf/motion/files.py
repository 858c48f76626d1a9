# SPDX-License-Identifier: MIT
"""Files that are there whole or not at all, in the folder they are meant for and nowhere else.

A file is written under another name beside its place and put there by one rename. What stands at
either name is replaced, not written through: a link that someone left in the folder leads nowhere.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write a file and put it in place once it is whole.

    Args:
        path: The file.

    Yields:
        An empty new file beside it to write to; it has the same ending.

    Raises:
        OSError: It cannot be written; it names the file, as a full disk does not by itself.
    """
    part = part_of(path)
    try:
        part.unlink(missing_ok=True)
        os.close(os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield part
        os.replace(part, path)
    except OSError as error:
        _discard(part)
        if error.filename is None or error.filename == str(part):
            error.filename = str(path)
            error.filename2 = None
        raise
    except BaseException:
        _discard(part)
        raise


def part_of(path: Path) -> Path:
    """Where a file stands until it is whole; a run that is killed leaves it there."""
    return path.with_name(f".{path.name}")


def fault_of_place(folder: Path) -> str:
    """What is wrong with what stands where a folder is to be written in.

    Args:
        folder: The folder.

    Returns:
        That it is a file, or a link, which would lead elsewhere; empty if it is a folder, or
        nothing is there.
    """
    try:
        mode = folder.lstat().st_mode
    except OSError:
        return ""
    if stat.S_ISDIR(mode):
        return ""
    found = "a link" if stat.S_ISLNK(mode) else "a file"
    return f"{folder}: found {found}; expected a folder, or nothing. Remove it"


def replace_file(path: Path, text: str) -> None:
    """Write a text file, forced to the disk, by :func:`replacing`.

    Args:
        path: The file.
        text: What it holds afterwards.
    """
    with replacing(path) as part, part.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def _discard(part: Path) -> None:
    with suppress(OSError):
        part.unlink()
