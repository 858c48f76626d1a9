# SPDX-License-Identifier: MIT
"""Mesh files made by gmsh's own Python interface, and scenes round a mesh."""

import runpy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from fenics_hytf.scene import Scene

SOIL = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3}
MOTION = {
    "direction": "x",
    "harmonic": {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 16},
}


def scene(mesh: dict, soils: tuple[str, ...] = ("clay", "sand"), **sections) -> Scene:
    """A scene of a mesh section; any other section can be given."""
    usual = {"mesh": mesh, "soil": dict.fromkeys(soils, SOIL), "motion": [MOTION]}
    return Scene.from_dict(usual | sections)


def mesh_script(name: str) -> Callable[..., Path]:
    """The function of a script of the folder ``meshes``, which has the script's name."""
    return runpy.run_path(str(Path(__file__).parents[2] / "meshes" / f"{name}.py"))[name]


@contextmanager
def gmsh_model(path: Path, dim: int = 2, order: int = 1, **options: float) -> Iterator[ModuleType]:
    """Draw with gmsh inside, and mesh and write at the end; options are those of ``Mesh``."""
    import gmsh

    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("test")
        yield gmsh
        for name, value in options.items():
            gmsh.option.setNumber(f"Mesh.{name}", value)
        gmsh.model.mesh.generate(dim)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def gmsh_section(
    path: Path,
    *,
    order: int = 1,
    quads: bool = False,
    right: int = 0,
    groups: dict[str, tuple[int, list[int]]] | None = None,
    **options: float,
) -> Path:
    """A section of 4 m x 2 m, clay under sand, with cells of about 0.7 m.

    Args:
        path: Where to write.
        order: Of the cells.
        quads: Recombine into quadrilaterals.
        right: Cells along each half of the right side; as on the left where 0.
        groups: Dimension and entities of each physical group, instead of the usual ones. Curves 1
            to 7 are: base, lower right, interface, lower left, upper right, top, upper left;
            surfaces 1 and 2 the clay and the sand.
        options: Options of gmsh's ``Mesh``.
    """
    with gmsh_model(path, order=order, **options) as gmsh:
        geo, model = gmsh.model.geo, gmsh.model
        corners = [(0, 0), (4, 0), (4, 1), (0, 1), (4, 2), (0, 2)]
        a, b, c, d, e, f = (geo.addPoint(x, y, 0, 0.7) for x, y in corners)
        lines = [(a, b), (b, c), (c, d), (d, a), (c, e), (e, f), (f, d)]
        base, low_right, between, low_left, high_right, top, high_left = (
            geo.addLine(*ends) for ends in lines
        )
        geo.addPlaneSurface([geo.addCurveLoop([base, low_right, between, low_left])])
        geo.addPlaneSurface([geo.addCurveLoop([-between, high_right, top, high_left])])
        geo.synchronize()
        if right:
            for line in (low_right, high_right):
                model.mesh.setTransfiniteCurve(line, right + 1)
        if quads:
            model.mesh.setRecombine(2, 1)
            model.mesh.setRecombine(2, 2)
        usual = {
            "clay": (2, [1]),
            "sand": (2, [2]),
            "base": (1, [base]),
            "left": (1, [low_left, high_left]),
            "right": (1, [low_right, high_right]),
        }
        for name, (dim, entities) in (usual if groups is None else groups).items():
            model.addPhysicalGroup(dim, entities, name=name)
    return path


def gmsh_block(path: Path, order: int = 1, **options: float) -> Path:
    """A block of 2 m x 1 m x 1 m of tetrahedra, all sand, its lower side named base."""
    with gmsh_model(path, dim=3, order=order, MeshSizeMax=0.6, **options) as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 2, 1, 1)
        gmsh.model.occ.synchronize()
        floor = gmsh.model.getEntitiesInBoundingBox(-0.1, -0.1, -0.1, 2.1, 1.1, 0.1, 2)
        gmsh.model.addPhysicalGroup(3, [1], name="sand")
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in floor], name="base")
    return path
