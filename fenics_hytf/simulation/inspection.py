# SPDX-License-Identifier: MIT
"""What a scene asks for, before anything is solved: sizes, lines, memory."""

from __future__ import annotations

from dataclasses import dataclass

from mpi4py import MPI

from fenics_hytf.domain import constraint_matrix
from fenics_hytf.lapse import excite, seed_points
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.check import checked_domain

# Entries of an LDLᵀ factor a row, from nested dissection: 2D c n log2 n (measured 7.6 M entries on
# 81 002 unknowns, so c = 5.8), 3D c n^(4/3) (PORD on 41 k unknowns, so c = 1).
_FACTOR_2D = 5.8
_ENTRY = 16  # bytes of a complex number
# Of a reduced sweep in a section with 2 to 5 % damping: 14 to 19, and 100 to 160.
_EXPANSIONS = 20
_BASIS = 200
_BASE = 250e6  # bytes: interpreter, libraries, compiled forms


@dataclass(frozen=True)
class Inspection:
    """What a scene asks for.

    Attributes:
        effects: Effects called for.
        cells: Cells.
        unknowns: Unknowns after constraining.
        points: Material points.
        lapses: Number of lapses.
        samples_per_lapse: Samples in each.
        lines: Lines solved in each lapse.
        factorisations: Factorisations expected, those of free-field columns among them; with the
            equivalent-linear loop the most there can be.
        shared_bytes: Estimated memory of what ranks share that share a mesh [bytes].
        ranks: Ranks that share the mesh.
        notes: What the user should know.
    """

    effects: tuple[str, ...]
    cells: int
    unknowns: int
    points: int
    lapses: int
    samples_per_lapse: int
    lines: tuple[int, ...]
    factorisations: int
    shared_bytes: int
    ranks: int
    notes: tuple[str, ...]

    @property
    def memory_bytes(self) -> int:
        """Estimated memory of all ranks [bytes]."""
        return self.memory_of(self.ranks)

    def memory_of(self, ranks: int) -> int:
        """Estimated memory of so many ranks that share the mesh [bytes]."""
        return self.shared_bytes + int(ranks * _BASE)


def inspect(scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD) -> Inspection:
    """Check a scene against its mesh and estimate its cost (collective).

    Args:
        scene: The scene.
        comm: Communicator.

    Returns:
        Sizes and estimates, the same on every rank.

    Raises:
        SceneError: A fault that only the mesh shows.
    """
    domain = checked_domain(scene, comm)
    points = seed_points(scene, domain)
    axes = tuple(domain.components.index(m.direction) for m in scene.motion)
    T = constraint_matrix(domain, scene.supports, axes)
    unknowns = int(T.getSize()[1])
    T.destroy()
    lines = tuple(
        len(excite(scene, scene.base_acceleration[:, s.samples], axes).lines)
        for s in scene.segments
    )
    loop = scene.effects.equivalent_linear
    iterations = 1 if loop is None else loop.max_iterations
    columns = list(scene.boundary.kinds.values()).count("free_field")
    if scene.solver.sweep == "reduced":
        solved, held = [min(n, _EXPANSIONS) for n in lines], _BASIS
    else:
        solved, held = list(lines), max(lines, default=0) * len(axes)
    num_points = comm.allreduce(len(points))
    return Inspection(
        effects=scene.effects.named,
        cells=domain.num_cells,
        unknowns=unknowns,
        points=num_points,
        lapses=len(lines),
        samples_per_lapse=scene.segments[0].num_samples,
        lines=lines,
        factorisations=sum(solved) * iterations * (1 + columns),
        shared_bytes=_memory(unknowns, domain.gdim, held) + num_points * points.bytes_per_point,
        ranks=comm.size,
        notes=_notes(scene, lines),
    )


def _memory(unknowns: int, gdim: int, columns: int) -> int:
    log = max(unknowns, 2).bit_length()
    factor = _FACTOR_2D * unknowns * log if gdim == 2 else float(unknowns) ** (4 / 3)
    row = (9 if gdim == 2 else 27) * gdim * 2
    matrices = 8 * unknowns * row * (_ENTRY + 8)
    return int(2 * factor * _ENTRY + matrices + unknowns * columns * _ENTRY)


def _notes(scene: Scene, lines: tuple[int, ...]) -> tuple[str, ...]:
    notes = []
    if not any(lines):
        notes.append("no line is excited: the motion is zero up to solver.max_frequency")
    if scene.solver.sweep == "reduced":
        notes.append(
            "the reduced sweep takes the factorisations it needs: their number is from experience"
        )
    if scene.effects.convection and len(lines) == 1:
        notes.append("convection acts between lapses; the scene has one")
    if scene.effects.convection:
        notes.append("under steady continuity the net movement of the points in a lapse is zero")
    if scene.effects.geometric_stiffness:
        notes.append("the points start without stress: geometric_stiffness adds nothing yet")
    return tuple(notes)
