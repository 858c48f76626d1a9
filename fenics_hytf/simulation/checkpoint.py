# SPDX-License-Identifier: MIT
"""Checkpoints: plain arrays and plain values in one file that is there whole or not at all.

The file is an uncompressed zip archive of ``.npy`` arrays and ``meta.json``, which NumPy and any
unzip read; nothing in it is ever executed. Its last 64 bytes, the archive's comment, are the
SHA-256 of all before: a torn or damaged file is found out before anything of it is used. It is
written beside the last one, forced to the disk, and put in its place by one rename, so that
whatever happens the last one stays.
"""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import dolfinx
import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

import fenics_hytf
from fenics_hytf.motion.files import fault_of_place, replacing
from fenics_hytf.scene import Fault, Scene, SceneError, changed_keys, identity
from fenics_hytf.simulation.errors import CheckpointError
from fenics_hytf.simulation.packing import Arrays, pack, unpack

FORMAT = 2
"""Raised when a checkpoint of before can no longer be read."""

FILE = "state.npz"

_META = "meta.json"
_ARRAY = ".npy"
_HEADS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
_DIGEST = 64  # bytes: SHA-256 in hexadecimal digits
_BLOCK = 1 << 20
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_SINCE = "as in the checkpoint"


@dataclass(frozen=True)
class Checkpoint:
    """What a run had after a lapse.

    Attributes:
        meta: Plain values: ``format``; ``versions`` of programs by name; the ``scene`` as its file
            said it, its ``scene_hash``, and what of it ``decides`` the results; ``ranks`` and
            ``group_size``; the number of the ``lapse`` after which it was taken, from 0, and
            ``num_lapses``; the ``state``, in which arrays stand by name.
        arrays: Arrays by name, such as ``points/x``.
    """

    meta: dict[str, Any]
    arrays: Arrays

    @property
    def lapse(self) -> int:
        """Number of the last lapse that is done, from 0."""
        return int(self.meta["lapse"])

    def load(self, name: str, kind: Any) -> Any:
        """Read a part of the state.

        Args:
            name: Its name.
            kind: Its type, such as ``tuple[LapseResult, ...]``.

        Returns:
            The part.

        Raises:
            CheckpointError: There is none of that name and type.
        """
        state = self.meta["state"]
        if name not in state:
            raise CheckpointError(
                f"the checkpoint: found no {name} in it; expected one, as this version keeps it. "
                "Start anew: --force instead of --resume"
            )
        return unpack(state[name], kind, self.arrays, name)


def take_checkpoint(
    scene: Scene, lapse: int, ranks: int, group_size: int, state: Mapping[str, object]
) -> Checkpoint:
    """Put together what a run has.

    Args:
        scene: The scene.
        lapse: Number of the lapse that is done, from 0.
        ranks: Ranks of the run.
        group_size: Ranks that share a mesh.
        state: Records by name, see :mod:`fenics_hytf.simulation.packing`; arrays are not copied.

    Returns:
        The checkpoint.

    Raises:
        TypeError: A part of the state cannot be kept.
        OSError: The scene's mesh file cannot be read any more.
    """
    arrays: Arrays = {}
    meta = {
        "format": FORMAT,
        "versions": versions(),
        "scene_hash": scene.hash,
        "scene": json.loads(json.dumps(scene.data, default=str)),
        "decides": identity(scene),
        "ranks": ranks,
        "group_size": group_size,
        "lapse": lapse,
        "num_lapses": len(scene.segments),
        "state": {name: pack(part, name, arrays) for name, part in state.items()},
    }
    return Checkpoint(meta, arrays)


def require_same_scene(checkpoint: Checkpoint, scene: Scene) -> None:
    """Refuse a checkpoint of another scene.

    Args:
        checkpoint: The checkpoint.
        scene: The scene that is to be gone on with. What may differ from the checkpoint's is told
            in :mod:`fenics_hytf.scene.identity`.

    Raises:
        SceneError: With every key that differs, what was found and what the checkpoint has.
        OSError: The scene's mesh file cannot be read.
    """
    faults: list[Fault] = changed_keys(checkpoint.meta["decides"], identity(scene), _SINCE)
    if faults:
        raise SceneError(faults)


def require_sound(checkpoint: Checkpoint, path: Path) -> None:
    """Refuse a checkpoint whose plain values are not of the kinds that :class:`Checkpoint` names.

    Args:
        checkpoint: The checkpoint.
        path: Its folder.

    Raises:
        CheckpointError: With the value that is not.
    """
    meta = checkpoint.meta
    counts = {"lapse": 0, "num_lapses": 1, "ranks": 1, "group_size": 1}
    odd = [n for n, least in counts.items() if not isinstance(meta.get(n), int) or meta[n] < least]
    odd += [n for n in ("versions", "decides", "state") if not isinstance(meta.get(n), dict)]
    if odd:
        found = f"a checkpoint that holds {meta.get(odd[0])!r:.40} for {odd[0]}"
        raise CheckpointError(_damage(path / FILE, found))


def require_place(folder: Path) -> None:
    """Refuse what is no folder where a checkpoint is to be kept: a file, or a link elsewhere.

    Args:
        folder: The checkpoint's folder; it may be missing.

    Raises:
        CheckpointError: With what is there.
    """
    fault = fault_of_place(folder)
    if fault:
        raise CheckpointError(fault)


def write_checkpoint(
    folder: Path, meta: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]]
) -> None:
    """Write a checkpoint in the place of the last one, which stays if that fails.

    Args:
        folder: Its folder, made if needed.
        meta: Plain values as JSON knows them.
        arrays: Arrays by name, of numbers or texts.

    Raises:
        CheckpointError: It could not be written.
    """
    require_place(folder)
    path = folder / FILE
    try:
        if not folder.is_dir():
            folder.mkdir(parents=True)
            _to_disk(folder.parent)
        with replacing(path) as part, part.open("r+b") as file:
            _write_archive(file, meta, arrays)
            _seal(file)
        _to_disk(folder)
    except OSError as error:
        raise CheckpointError(_trouble(path, error)) from error


def read_checkpoint(folder: Path) -> Checkpoint | None:
    """Read a checkpoint.

    Args:
        folder: Its folder.

    Returns:
        The checkpoint, or ``None`` if there is none.

    Raises:
        CheckpointError: It is damaged, cannot be read, or is of another format.
    """
    path = folder / FILE
    try:
        with path.open("rb") as file:
            if not _is_whole(file):
                raise CheckpointError(_damage(path, "a file that is damaged or cut short"))
            return _read_archive(path, file)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise CheckpointError(
            f"{path}: found a checkpoint that cannot be read ({error.strerror}); expected read "
            "permission"
        ) from error


def versions() -> dict[str, str]:
    """Versions of the programs that decide the last digits."""
    return {
        "fenics_hytf": fenics_hytf.__version__,
        "numpy": np.__version__,
        "dolfinx": dolfinx.__version__,
        "petsc": ".".join(str(part) for part in PETSc.Sys.getVersion()),
    }


def _write_archive(
    file: IO[bytes], meta: Mapping[str, Any], arrays: Mapping[str, npt.NDArray[Any]]
) -> None:
    """Write the archive with room for its seal."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        archive.comment = b"0" * _DIGEST
        # ZipInfo without a date: the same state is the same file
        archive.writestr(zipfile.ZipInfo(_META), json.dumps(meta))
        for name, values in arrays.items():
            with archive.open(zipfile.ZipInfo(f"{name}{_ARRAY}"), "w", force_zip64=True) as member:
                np.lib.format.write_array(member, values, allow_pickle=False)


def _seal(file: IO[bytes]) -> None:
    """Put the digest of all before at the end, and all of it on the disk."""
    digest, size = _digest(file)
    file.seek(size)
    file.write(digest)
    file.flush()
    os.fsync(file.fileno())


def _is_whole(file: IO[bytes]) -> bool:
    digest, _ = _digest(file)
    return digest == file.read(_DIGEST)


def _digest(file: IO[bytes]) -> tuple[bytes, int]:
    """Digest of a file up to its seal, where the file stands then."""
    size = max(file.seek(0, os.SEEK_END) - _DIGEST, 0)
    file.seek(0)
    digest, left = hashlib.sha256(), size
    while left:
        block = file.read(min(_BLOCK, left))
        if not block:
            break
        digest.update(block)
        left -= len(block)
    return digest.hexdigest().encode(), size


def _read_archive(path: Path, file: IO[bytes]) -> Checkpoint:
    """Read what was sealed; the seal tells damage from the file that was written, not who wrote it.

    So nothing is taken for granted that an archive says of itself: nothing is unpacked or inflated,
    and no more memory is taken than the file has bytes.
    """
    arrays: Arrays = {}
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    try:
        with zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            _refuse_odd_members(members, size)
            meta = json.loads(archive.read(_META))
            found = meta.get("format") if isinstance(meta, dict) else None
            if found != FORMAT:
                raise CheckpointError(
                    f"{path}: found a checkpoint of format {found}; expected {FORMAT}, which this "
                    "version reads. Go on with the version that wrote it, or start anew: --force "
                    "instead of --resume"
                )
            for member in members:
                if member.filename != _META:
                    arrays[member.filename.removesuffix(_ARRAY)] = _read_array(archive, member)
    except (
        zipfile.BadZipFile,
        ValueError,
        KeyError,
        EOFError,
        NotImplementedError,
        RecursionError,
    ) as error:
        raise CheckpointError(_damage(path, f"no checkpoint ({error})")) from error
    return Checkpoint(meta, arrays)


def _refuse_odd_members(members: Sequence[zipfile.ZipInfo], size: int) -> None:
    """Raise ValueError unless members are as :func:`_write_archive` writes them."""
    names = [member.filename for member in members]
    if len(set(names)) < len(names):
        raise ValueError("two members of one name")
    for member in members:
        if member.compress_type != zipfile.ZIP_STORED:
            raise ValueError(f"a squeezed member, {member.filename}")
        parts = member.filename.split("/")
        if (member.filename != _META and not member.filename.endswith(_ARRAY)) or ".." in parts:
            raise ValueError(f"a member that no run writes, {member.filename}")
        if "" in parts:
            raise ValueError(f"a member at an absolute place, {member.filename}")
    if sum(member.file_size for member in members) > size:
        raise ValueError("members larger than the file")


def _read_array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> npt.NDArray[Any]:
    """Read an array whose head claims no more than follows it; no objects."""
    with archive.open(member) as file:
        version = np.lib.format.read_magic(file)
        if version not in _HEADS:
            raise ValueError(f"{member.filename} is of version {version}")
        shape, _, dtype = _HEADS[version](file)
        if math.prod(shape) * dtype.itemsize != member.file_size - file.tell():
            raise ValueError(f"{member.filename} claims a shape of {shape!r:.40}")
        file.seek(0)
        values: npt.NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
    return values


def _to_disk(folder: Path) -> None:
    """Force the names in a folder to the disk, where the file system knows how to."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):
            os.fsync(handle)
    finally:
        os.close(handle)


def _trouble(path: Path, error: OSError) -> str:
    """Why a checkpoint could not be written, and what is left."""
    reason = error.strerror or str(error)
    found = "no room for the checkpoint" if error.errno in _NO_ROOM else "that it cannot be written"
    kept = "The checkpoint before is kept" if path.exists() else "There is none before"
    advice = "make room" if error.errno in _NO_ROOM else "see to that"
    return (
        f"{path}: found {found} ({reason}); expected a disk that holds it. {kept}: {advice}, then "
        "go on with --resume"
    )


def _damage(path: Path, found: str) -> str:
    return (
        f"{path}: found {found}; expected a checkpoint as a run wrote it. Start anew: --force "
        "instead of --resume"
    )
