# SPDX-License-Identifier: MIT
"""``hytf mesh``: draws a mesh with a script that travels with the package.

Each script ``KIND.py`` has a function ``KIND``, and ``parser``, whose options are that function's
arguments, ``output`` the first of them: they are defined there and nowhere else.
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import runpy
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import fenics_hytf
from fenics_hytf.cli.outcome import DONE, INPUT, STOPPED, InputError, say, tell

_HELP = ("-h", "--help")


def mesh_folder() -> Path:
    """Where the scripts are: in the installed package, or beside it in a checkout."""
    package = Path(fenics_hytf.__file__).resolve().parent
    inside = package / "meshes"
    return inside if inside.is_dir() else package.parent / "meshes"


def list_kinds() -> str:
    """Kinds of meshes, one a line with what it is."""
    kinds = _kinds()
    width = max(map(len, kinds), default=0)
    return "\n".join(f"{kind:{width}}  {_title(script)}" for kind, script in kinds.items())


def make_mesh(arguments: Sequence[str]) -> int:
    """Draw a mesh, or list the kinds.

    Args:
        arguments: Kind and the options of its script; nothing or ``--help``: list the kinds.

    Returns:
        The exit code.
    """
    if not arguments or arguments[0] in _HELP:
        say(list_kinds())
        say("\nhytf mesh KIND --help tells the options of a kind.")
        return DONE
    try:
        say(_draw(arguments[0], arguments[1:]))
    except InputError as error:
        tell(error.faults)
        return INPUT
    except RuntimeError as error:  # no mesh came of input that is sound
        tell([f"mesh {arguments[0]}: {error}"])
        return STOPPED
    return DONE


def _kinds() -> dict[str, Path]:
    """The scripts by their names; those with an underscore are parts of others."""
    return {script.stem: script for script in sorted(mesh_folder().glob("[!_]*.py"))}


def _title(script: Path) -> str:
    """How a script's docstring begins; reads nothing that it imports."""
    text = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
    return re.split(r"[.,:;]\s", text + "\n", maxsplit=1)[0]


def _draw(kind: str, arguments: Sequence[str]) -> str:
    """Draw a mesh of a kind, and tell what it holds."""
    script = _load(kind)
    parser: argparse.ArgumentParser = script["parser"]()
    parser.prog = f"hytf mesh {kind}"
    parser.add_argument("--force", action="store_true", help="replace a file that is there")

    def refuse(message: str) -> NoReturn:
        raise InputError([f"mesh {kind}: {message}. See: {parser.prog} --help"])

    parser.error = refuse  # type: ignore[method-assign]
    given = vars(parser.parse_args(arguments))
    output, force = given.pop("output"), given.pop("force")
    faults = output_faults(output, force)
    if faults:
        raise InputError(faults)
    try:
        with tempfile.TemporaryDirectory(dir=output.parent, prefix=".mesh-") as place:
            drawn = script[kind](Path(place, output.name), **given)
            said = describe_mesh(drawn)
            drawn.replace(output)
    except ValueError as error:
        refuse(str(error))
    except OSError as error:
        fault = f"{output}: found that it cannot be written ({error}); expected write permission"
        raise InputError([fault]) from error
    return f"{output}: {said}"


def _load(kind: str) -> dict[str, Any]:
    """What a script defines."""
    kinds = _kinds()
    if kind not in kinds:
        raise InputError([f"mesh: found {kind!r}; expected one of {', '.join(kinds) or 'none'}"])
    try:
        return runpy.run_path(str(kinds[kind]))
    except ImportError as error:
        raise InputError(
            [
                f"gmsh: found that it cannot be imported ({error}); expected it installed. On "
                "Debian 13: apt-get install python3-gmsh; or: pip install 'fenics-hytf[gmsh]'"
            ]
        ) from error


def describe_mesh(path: Path) -> str:
    """What a mesh file holds, and how well its cells are shaped.

    Args:
        path: The file.

    Returns:
        Cells by region; longest side, largest ratio of sides of a cell, and least inverse condition
        number of a Jacobian: 1 in a square or cube, 0 in a flat corner.

    Raises:
        RuntimeError: An inverted cell.
    """
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(path))
        dim = gmsh.model.getDimension()
        numbers = {}
        cells: list[int] = []
        for _, group in gmsh.model.getPhysicalGroups(dim):
            inside = [
                int(cell)
                for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group)
                for cells_of_kind in gmsh.model.mesh.getElements(dim, entity)[1]
                for cell in cells_of_kind
            ]
            numbers[gmsh.model.getPhysicalName(dim, group)] = len(inside)
            cells += inside
        quality = gmsh.model.mesh.getElementQualities
        longest, shortest = quality(cells, "maxEdge"), quality(cells, "minEdge")
        shape = quality(cells, "minSICN")
    finally:
        gmsh.finalize()
    flat = (shape <= 0) | (shortest <= 0)
    if flat.any():
        raise RuntimeError(f"found {flat.sum()} inverted or flat cells; expected none")
    listed = ", ".join(f"{name} {number}" for name, number in numbers.items())
    ratio = (longest / shortest).max()
    return (
        f"{len(cells)} cells ({listed}), longest side {longest.max():.3g} m, ratio of sides at "
        f"most {ratio:.2g}, inverse condition number at least {shape.min():.2g}"
    )


def output_faults(path: Path, force: bool) -> list[str]:
    """What speaks against writing a mesh to a file; touches nothing."""
    folder = path.parent
    if path.suffix != ".msh":
        return [f"--output: found {path}; expected a file that ends in .msh"]
    if not folder.is_dir():
        return [f"--output: found no folder {folder}; expected one that is there"]
    if not os.access(folder, os.W_OK | os.X_OK):
        return [f"--output: found that {folder} may not be written; expected write permission"]
    if path.is_dir():
        return [f"--output: found the folder {path}; expected a file"]
    if os.path.lexists(path) and not force:
        return [
            f"--output: found {path} there; expected no such file. Choose another with -o, or "
            "replace it with --force"
        ]
    return []
