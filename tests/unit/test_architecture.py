# SPDX-License-Identifier: MIT
"""The package keeps to its own plan: rooms, names that are private, what a module begins with."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import fenics_hytf

TOP = Path(fenics_hytf.__file__).parent
MODULES = sorted(TOP.rglob("*.py"))

# Ground floor first.
ROOMS = (
    *("motion", "soil", "scene", "domain", "particles", "operators", "frequency"),
    *("lapse", "simulation", "results", "study", "cli"),
)
LONGEST = 400  # lines of a module: what one can still read through in one go
# Of dolfinx, such as differ between its versions or are not public.
VERSION_DEPENDENT = re.compile(
    r"\bdolfinx\.cpp\b|\b_cpp_object\b|\bgeometry\.(dofmaps?|cmaps?)\b|\bgmshio\b"
)


def place_of(path: Path) -> str:
    return str(path.relative_to(TOP))


@cache
def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8")


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(text_of(path))


def nodes(*kinds: type[ast.AST]) -> Iterator[tuple[str, Any]]:
    """Nodes of some kinds in all modules, each after its place."""
    for path in MODULES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, kinds):
                yield f"{place_of(path)}:{getattr(node, 'lineno', 1)}", node


def imports() -> Iterator[tuple[str, str]]:
    """What modules take from others by its full name, within functions as well; after its place."""
    for place, node in nodes(ast.Import, ast.ImportFrom):
        for alias in node.names:
            module = getattr(node, "module", None)
            yield place, f"{module}.{alias.name}" if module else alias.name


def module_name(path: Path) -> str:
    """What a module is imported by."""
    parts = ("fenics_hytf", *path.relative_to(TOP).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room_of(place: str) -> str | None:
    """The room of a place; none of the modules that stand beside the rooms."""
    room, _, rest = place.partition("/")
    return room if rest else None


def test_a_room_takes_only_from_rooms_below_it() -> None:
    faults = []
    for place, name in imports():
        room, parts = room_of(place), name.split(".")
        if room is None or parts[0] != "fenics_hytf":  # the public names of the package are above
            continue
        below = parts[1] if len(parts) > 1 else "__version__"
        if below not in (*ROOMS[: ROOMS.index(room) + 1], "_compat", "__version__"):
            faults.append(f"{place} takes {name}")
    assert not faults


def test_no_two_modules_need_each_other() -> None:
    names = {place_of(path): module_name(path) for path in MODULES}
    needs: dict[str, set[str]] = {name: set() for name in names.values() if name != "fenics_hytf"}
    for place, name in imports():
        module = names[place.partition(":")[0]]
        source = name if name in needs else name.rpartition(".")[0]
        if module in needs and source in needs:  # the package's own names are above all rooms
            needs[module].add(source)
    while free := [name for name, others in needs.items() if not others & needs.keys()]:
        for name in free:
            del needs[name]
    assert not needs, "these go round in circles"


def test_what_is_private_is_used_where_it_is_made() -> None:
    faults = []
    for place, name in imports():
        last = name.rpartition(".")[2]
        if name.startswith("fenics_hytf.") and re.match(r"_[^_]", last) and last != "_compat":
            faults.append(f"{place} {name}")
    for place, node in nodes(ast.Attribute):
        own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
        if re.match(r"_[^_]", node.attr) and not own:
            faults.append(f"{place} {ast.unparse(node)}")
    assert [fault for fault in faults if not fault.endswith(" os._exit")] == []


def test_only_the_command_line_knows_the_terminal() -> None:
    faults = [
        f"{place} {node.func.id}"
        for place, node in nodes(ast.Call)
        if isinstance(node.func, ast.Name) and node.func.id in ("print", "input")
    ]
    for place, name in imports():
        if name.partition(".")[0] in ("argparse", "typer", "rich"):
            faults.append(f"{place} {name}")
    assert [fault for fault in faults if room_of(fault) != "cli"] == []


def test_names_that_change_with_dolfinx_stand_in_one_module() -> None:
    told = [place_of(path) for path in MODULES if VERSION_DEPENDENT.search(text_of(path))]
    assert told == ["_compat.py"]


def test_a_module_says_its_licence_and_what_it_is_for() -> None:
    faults = [
        place_of(path)
        for path in MODULES
        if not text_of(path).startswith("# SPDX-License-Identifier: MIT\n")
        or not ast.get_docstring(tree_of(path))
    ]
    assert not faults


def test_a_module_can_be_read_through_in_one_go() -> None:
    lengths = {place_of(path): text_of(path).count("\n") for path in MODULES}
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST} == {}


def test_docstrings_name_the_arguments_that_there_are() -> None:
    faults = []
    for place, node in nodes(ast.FunctionDef, ast.ClassDef):
        text = (ast.get_docstring(node) or "") + "\n"
        section = re.search(r"^Args:\n((?:    .*\n|\n)+)", text, re.MULTILINE)
        if section:
            told = re.findall(r"^    \*{0,2}(\w+):", section[1], re.MULTILINE)
            if told != arguments(node):
                faults.append(f"{place} {node.name}: {told}, not {arguments(node)}")
    assert not faults


def arguments(node: ast.FunctionDef | ast.ClassDef) -> list[str]:
    """Names of what a function, or a class, is called with."""
    if isinstance(node, ast.ClassDef):
        made = [part for part in node.body if isinstance(part, ast.FunctionDef)]
        return next((arguments(part) for part in made if part.name == "__init__"), [])
    given = node.args
    every = [*given.posonlyargs, *given.args, given.vararg, *given.kwonlyargs, given.kwarg]
    names = [argument.arg for argument in every if argument is not None]
    return [name for name in names if name not in ("self", "cls")]
