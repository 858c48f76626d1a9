# SPDX-License-Identifier: MIT
"""What a scene asks of a machine, before anything is built for it.

A column or a box says by itself how large its mesh will be; of a mesh file so much is read as tells
its cells. What takes memory is reckoned from that, by rules that were measured (see
``tests/unit/test_demand.py``): they are good to a factor of two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import prod

from fenics_hytf.domain import count_cells
from fenics_hytf.lapse import Scheme, excite
from fenics_hytf.scene import Mesh, Scene, SceneError, default_points_per_cell
from fenics_hytf.soil import RELAXATION_TIMES

# Entries of an LDLᵀ factor a row, from nested dissection: 2D c n log2 n (measured 7.6 M entries on
# 81 002 unknowns, so c = 5.8), 3D c n^(4/3) (PORD on 41 k unknowns, so c = 1).
_FACTOR_2D = 5.8
_ENTRY = 16  # bytes of a complex number
_NUMBER = 8  # bytes of a real number
# Of a reduced sweep in a section with 2 to 5 % damping: 14 to 19, and 100 to 160.
_EXPANSIONS = 20
_BASIS = 200
SEARCH = 50
"""Factorisations of a search for a mechanism, or for a factor of safety.

The demos ``slope`` and ``runout`` took 64 and 41 each, in 4 and 16 searches.
"""

_PROGRAM = 275e6  # bytes: interpreter, libraries, compiled forms; on each rank
_SAMPLE = 350  # bytes of each motion: what a check takes of a record of 6e6 samples
_CELL = {2: 1.2e3, 3: 5e3}  # bytes: mesh, its connections and search tree
_POINT = 400  # bytes
_PARTS = 2  # stiffness matrices of a law without memory
_MATRICES = 6  # besides: mass, the sums of each frequency, their symbolic copies
_SEEN = 64  # cells whose histories are held at once
_HISTORIES = 100  # bytes a line of each component that is seen: spectra, and five histories
_VALUES = 2 * 22  # numbers of a cell that a lapse leaves, with the copy in the checkpoint
_SHARED = "a coarser mesh, or more ranks that share it"
# What takes memory in words, and what makes that less.
_WORDS = {
    "factors": ("factors of the matrices", _SHARED),
    "matrices": ("matrices", _SHARED),
    "solutions": (
        "solutions held",
        'sweep = "reduced", or fewer lines by solver.max_frequency',
    ),
    "mesh": ("mesh and points", "fewer cells, or a smaller points_per_cell"),
    "histories": (
        "histories of cells and receivers",
        "shorter records, fewer lapses or receivers",
    ),
    "records": ("records", "shorter ones, or larger time steps"),
    "programs": ("programs", "fewer ranks"),
}


@dataclass(frozen=True)
class Sizes:
    """How large a mesh is.

    Attributes:
        gdim: Dimension.
        components: Components of the displacement.
        cells: Cells.
        unknowns: Unknowns.
        points: Material points.
    """

    gdim: int
    components: int
    cells: int
    unknowns: int
    points: int


@dataclass(frozen=True)
class Plan:
    """What a run solves.

    Attributes:
        lines: Lines solved in each lapse.
        factorisations: Factorisations of sweeps and of starts, those of free-field columns among
            them, and one a lapse of some effects; with all iterations that the equivalent-linear
            loop may take.
        bounded: Whether there can be no more of them: a reduced sweep takes what it needs, and what
            slides may add lapses.
        searched: Factorisations that the mechanisms of what slides are expected to take besides.
        held: Solutions, or columns of a basis, that are held at once.
    """

    lines: tuple[int, ...]
    factorisations: int
    bounded: bool
    searched: int
    held: int


@dataclass(frozen=True)
class Demand:
    """Memory that a run is estimated to take.

    Attributes:
        shared: Of what ranks share that share a mesh, by what takes it [bytes].
    """

    shared: Mapping[str, int]

    def of(self, ranks: int, group: int) -> int:
        """Memory of all ranks, so many of which share a mesh [bytes]."""
        return ranks // group * sum(self.shared.values()) + int(ranks * _PROGRAM)

    def words(self, ranks: int, group: int) -> str:
        """What takes most of it, how much, and what makes that less."""
        parts = {name: ranks // group * size for name, size in self.shared.items()}
        parts["programs"] = int(ranks * _PROGRAM)
        largest = max(parts, key=lambda name: parts[name])
        what, less = _WORDS[largest]
        return f"{gigabytes(parts[largest])} of it for {what}; less takes {less}"


def gigabytes(size: float) -> str:
    """A size of memory in words."""
    return f"{size / 2**30:.3g} GiB" if size < 1e4 * 2**30 else f"{size / 2**30:.0e} GiB"


def sizes_of(mesh: Mesh) -> Sizes | None:
    """How large a mesh will be, without making it.

    Args:
        mesh: The mesh of a scene.

    Returns:
        Its sizes, empty cells among them; ``None`` for a file that cannot be read.
    """
    if mesh.column is not None:
        counts: tuple[int, ...] = (1, sum(layer.cells for layer in mesh.column.layers))
        cell = "quadrilateral"
    elif mesh.box is not None:
        counts, cell = mesh.box.cells, mesh.box.cell
    else:
        return _sizes_of_file(mesh)
    cells = prod(counts) * {"triangle": 2, "tetrahedron": 6}.get(cell, 1)
    nodes = prod(mesh.degree * count + 1 for count in counts)
    return _sizes(mesh, len(counts), cell, cells, nodes)


def plan_of(scene: Scene, scheme: Scheme, components: Sequence[str]) -> Plan:
    """What a run of a scene solves.

    Args:
        scene: The scene.
        scheme: How its lapses hang together.
        components: Names of the components of the displacement.
    """
    axes = tuple(components.index(m.direction) for m in scene.motion)
    lines = _lines(scene, scheme, axes)
    loop = scene.effects.equivalent_linear
    iterations = 1 if loop is None else loop.max_iterations
    columns = list(scene.boundary.kinds.values()).count("free_field")
    # What is carried over is one more side; beside a whole record it is swept on its own.
    several = scheme.name != "steady" and len(lines) > 1
    twice = several and scheme.name == "whole_record"
    if scene.solver.sweep == "reduced":
        solved, held = [min(n, _EXPANSIONS) for n in lines], _BASIS * (1 + twice)
    else:
        solved, held = list(lines), max(lines, default=0) * (len(axes) + several)
    sweeps = sum(solved) + (sum(solved[1:]) if twice else 0)
    # One more finds how a lapse starts; beside a whole record the first one starts at rest.
    starts = {"steady": 0, "handover": len(lines), "whole_record": len(lines) - 1}[scheme.name]
    # One a lapse sees whether the ground buckles, one what it gives way by as it softens.
    effects = scene.effects
    counted = (effects.geometric_stiffness and effects.gravity is not None) + effects.softening
    searched = 0
    if scene.effects.sliding is not None:
        ways = 2 * len(scene.level_axes(len(components)))  # both senses of each
        searched = SEARCH * (1 + ways + len(lines) - 1)
    return Plan(
        lines=lines,
        factorisations=(sweeps * (1 + columns) + starts) * iterations + counted * len(lines),
        bounded=scene.solver.sweep == "direct" and scene.effects.sliding is None,
        searched=searched,
        held=held,
    )


def _lines(scene: Scene, scheme: Scheme, axes: tuple[int, ...]) -> tuple[int, ...]:
    """Lines solved in each lapse."""
    if scheme.contour is not None:
        return (scheme.num_lines(scene.solver.max_frequency),) * len(scene.segments)
    motion = scene.base_acceleration
    return tuple(len(excite(scene, motion[:, s.samples], axes).lines) for s in scene.segments)


def demand_of(scene: Scene, plan: Plan, sizes: Sizes, bytes_per_point: int = _POINT) -> Demand:
    """Estimate the memory of a run.

    Args:
        scene: The scene.
        plan: What it solves.
        sizes: Of its mesh.
        bytes_per_point: Of a material point; the default is about the most that any carries.
    """
    maxwell = scene.solver.complex_modulus == "maxwell"
    parts = 1 + len(RELAXATION_TIMES) if maxwell else _PARTS
    strains = {1: 2, 2: 3, 3: 6}[sizes.components]
    samples = sum(segment.num_samples for segment in scene.segments)
    seen = min(sizes.cells, _SEEN) * strains * max(plan.lines, default=0) * _HISTORIES
    receivers = len(scene.output.receivers) * sizes.components * samples * 12 * _NUMBER
    left = len(plan.lines) * sizes.cells * _VALUES * _NUMBER
    return Demand(
        {
            **demand_of_mesh(sizes, parts, bytes_per_point).shared,
            "solutions": sizes.unknowns * plan.held * _ENTRY,
            "histories": seen + receivers + left,
            "records": len(scene.motion) * samples * _SAMPLE,
        }
    )


def demand_of_mesh(sizes: Sizes, parts: int = _PARTS, bytes_per_point: int = 0) -> Demand:
    """What a mesh takes with its matrices and their factors, whatever is solved.

    Args:
        sizes: Its sizes.
        parts: Stiffness matrices of the law.
        bytes_per_point: Of a material point.
    """
    n, gdim = sizes.unknowns, sizes.gdim
    factor = _FACTOR_2D * n * max(n, 2).bit_length() if gdim == 2 else float(n) ** (4 / 3)
    row = (9 if gdim == 2 else 27) * sizes.components * 2
    return Demand(
        {
            "factors": int(2 * factor * _ENTRY),
            "matrices": (_MATRICES + parts) * n * row * (_ENTRY + _NUMBER),
            "mesh": int(sizes.cells * _CELL[gdim] + sizes.points * bytes_per_point),
        }
    )


def _sizes_of_file(mesh: Mesh) -> Sizes | None:
    assert mesh.file is not None
    try:
        cell, gdim, cells, nodes = count_cells(mesh.file)
    except SceneError:  # told when it is read
        return None
    finer = 2 ** (gdim * mesh.refine)
    return _sizes(mesh, gdim, cell, cells * finer, nodes * finer * mesh.degree**gdim)


def _sizes(mesh: Mesh, gdim: int, cell: str, cells: int, nodes: int) -> Sizes:
    components = 1 if gdim == 2 and mesh.kinematics == "antiplane" else gdim
    each = mesh.points_per_cell or default_points_per_cell(cell, mesh.degree)
    return Sizes(gdim, components, cells, nodes * components, cells * each)
