# SPDX-License-Identifier: MIT
"""Small mesh files: sections and solids of all cells, linear and quadratic, and damaged ones."""

from dataclasses import dataclass, field
from pathlib import Path

import meshio
import numpy as np
from hypothesis import strategies as st

from support.meshes import gmsh_block, gmsh_model, gmsh_section, mesh_script


@dataclass(frozen=True)
class Drawn:
    """A mesh file and what a scene may say of it.

    Attributes:
        content: Of the file.
        cell: Type of its cells.
        soils: Names of its regions with soil.
        empty: Names of those without.
        sides: Names of its boundaries but the base; pairs that may be tied come first.
        tied: Whether left and right may be tied.
        size: A corner of the box from the origin within which receivers are in soil [m].
        suffix: Of the file.
    """

    content: bytes = field(repr=False)
    cell: str
    soils: tuple[str, ...] = ("clay", "sand")
    empty: tuple[str, ...] = ()
    sides: tuple[str, ...] = ("left", "right")
    tied: bool = True
    size: tuple[float, ...] = (4.0, 2.0)
    suffix: str = ".msh"


def draw_meshes(folder: Path) -> dict[str, Drawn]:
    """Draw the files with gmsh, once for all scenes."""
    drawn = {}
    for order, name in ((1, ""), (2, " of second order")):
        section = gmsh_section(folder / "a.msh", order=order, MeshSizeMin=1.0, MeshSizeMax=2.0)
        drawn[f"triangles{name}"] = Drawn(section.read_bytes(), "triangle")
        quads = gmsh_section(
            folder / "a.msh", order=order, quads=True, RecombinationAlgorithm=2, MeshSizeMin=1.0
        )
        drawn[f"quadrilaterals{name}"] = Drawn(quads.read_bytes(), "quadrilateral")
        block = gmsh_block(folder / "a.msh", order=order, MeshSizeMin=0.6)
        drawn[f"tetrahedra{name}"] = Drawn(
            block.read_bytes(), "tetrahedron", ("sand",), sides=(), tied=False, size=(2.0, 1.0, 1.0)
        )
    old = gmsh_section(folder / "a.msh", MshFileVersion=2.2, MeshSizeMin=1.0)
    drawn["triangles, version 2"] = Drawn(old.read_bytes(), "triangle")
    drawn["a slope"] = _slope(folder / "slope.msh")
    drawn["hexahedra"] = _bricks(folder / "bricks.msh")
    drawn["a format of meshio"] = _foreign(folder / "plain.vtu")
    return drawn


def _slope(path: Path) -> Drawn:
    """Triangles or quadrilaterals of a slope with air above it."""
    sizes = {"height": 3.0, "depth": 2.0, "behind": 4.0, "before": 4.0, "size": 2.0, "air": 2.0}
    mesh_script("slope")(path, **sizes)
    kinds = {block.type for block in meshio.read(path).cells}
    cell = "quadrilateral" if "quad" in kinds else "triangle"
    return Drawn(path.read_bytes(), cell, ("soil",), ("air",), tied=False, size=(4.0, 2.0))


def _bricks(path: Path) -> Drawn:
    """A box of 2 m of hexahedra on a named base."""
    with gmsh_model(path, dim=3) as gmsh:
        corner = gmsh.model.geo.addPoint(0, 0, 0, 1.0)
        line = gmsh.model.geo.extrude([(0, corner)], 2, 0, 0, [2], recombine=True)[1]
        plane = gmsh.model.geo.extrude([line], 0, 1, 0, [1], recombine=True)[1]
        solid = gmsh.model.geo.extrude([plane], 0, 0, 2, [2], recombine=True)[1]
        gmsh.model.geo.synchronize()
        gmsh.model.addPhysicalGroup(2, [plane[1]], name="base")
        gmsh.model.addPhysicalGroup(3, [solid[1]], name="sand")
    size = (2.0, 1.0, 2.0)
    return Drawn(path.read_bytes(), "hexahedron", ("sand",), sides=(), tied=False, size=size)


def _foreign(path: Path) -> Drawn:
    """Squares without a name, as VTU: the soil is the only one, the sides are those of a box."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(3.0), np.arange(3.0)))
    lower = np.array([0, 1, 3, 4])
    cells = np.stack([lower, lower + 1, lower + 4, lower + 3], axis=1)
    meshio.Mesh(np.stack([x, y, 0 * x], axis=1), [("quad", cells)]).write(path)
    sides = ("left", "right")
    return Drawn(path.read_bytes(), "quadrilateral", ("sand",), (), sides, True, (2.0, 2.0), ".vtu")


@st.composite
def damaged_meshes(draw: st.DrawFn, drawn: Drawn) -> bytes:
    """A mesh file cut off, changed here and there, without names, folded over or out of plane."""
    content = drawn.content
    how = draw(st.sampled_from(("cut", "noise", "nameless", "folded", "flat", "empty", "lines")))
    if how == "cut":
        return content[: draw(st.integers(0, len(content) - 1))]
    if how == "noise":
        noisy = bytearray(content)
        for _ in range(draw(st.integers(1, 5))):
            noisy[draw(st.integers(0, len(noisy) - 1))] = draw(st.integers(0, 255))
        return bytes(noisy)
    if how == "empty":
        return b""
    lines = content.split(b"\n")
    if how == "nameless":
        begin, end = b"$PhysicalNames", b"$EndPhysicalNames"
        head, _, rest = content.partition(begin)
        return head + rest.partition(end)[2]
    if how == "lines":
        at = draw(st.integers(0, len(lines) - 1))
        return b"\n".join(lines[:at] + lines[at + draw(st.integers(1, 5)) :])
    # nodes are lines of three coordinates: fold cells over, flatten them, or send them far away
    factors = {"folded": (b"-1", b"1e9", b"nan", b"1e300"), "flat": (b"0",)}[how]
    changed = draw(st.sampled_from(factors))
    axis = draw(st.integers(0, 2))
    nodes = [i for i, line in enumerate(lines) if line.count(b" ") == 2 and b"." in line]
    nodes = nodes or [0]
    chosen = nodes if how == "flat" else [draw(st.sampled_from(nodes))]
    for i in chosen:
        parts = lines[i].split(b" ")
        parts[min(axis, len(parts) - 1)] = changed
        lines[i] = b" ".join(parts)
    return b"\n".join(lines)
