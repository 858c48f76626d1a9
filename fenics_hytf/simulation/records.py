# SPDX-License-Identifier: MIT
"""What a simulation leaves behind: plain records, the same on every rank."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fenics_hytf.lapse.records import LapseResult
from fenics_hytf.scene import Scene

RealArray = npt.NDArray[np.float64]


@dataclass
class Work:
    """Counts of what was done, over all lapses and iterations.

    Attributes:
        factorisations: Matrix factorisations.
        solves: Solves with a factorised matrix.
        excited_lines: Excited lines, summed over lapses.
        inverse_mappings: Points whose reference coordinates were searched by Newton iteration.
        assemblies: Assemblies by the name of the form: ``elasticity``, ``geometric``, ``mass``,
            ``rayleigh``, ``dashpot``, ``ghost``. What a scene does not call for has no entry.
        wall_s: Wall seconds by phase: ``setup``, ``assembly``, ``mechanism``, ``sweep``,
            ``response``, ``convection``, ``output``.
    """

    factorisations: int = 0
    solves: int = 0
    excited_lines: int = 0
    inverse_mappings: int = 0
    assemblies: dict[str, int] = field(default_factory=dict)
    wall_s: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Snapshot:
    """Points and nodal fields after a lapse, gathered on rank 0 (``None`` elsewhere).

    Attributes:
        index: Number of the lapse.
        time: End of the lapse [s].
        points: Arrays of the material points by name (``position`` [m] with shape
            ``(num_points, gdim)``, ``displacement`` [m], ``mass`` [kg/m or kg], ``volume``,
            ``id``, ``cell``, ``shear_modulus`` [Pa] ...), or ``None``.
        vertices: Mesh vertices [m], shape ``(num_vertices, gdim)``, or ``None`` where neither
            fields nor the mesh are written.
        cells: Vertices of each cell in VTK order, shape ``(num_cells, n)``, or ``None``.
        cell_type: meshio's name of the cell type.
        vertex_fields: By name, shape ``(num_vertices, gdim)`` or ``(num_vertices,)``.
        cell_fields: By name, shape ``(num_cells,)``; cells whose ``fill`` is 0 are empty.
        with_mesh: Whether the mesh is written by itself: points move over it.
    """

    index: int
    time: float
    points: dict[str, npt.NDArray[np.generic]] | None
    vertices: RealArray | None = None
    cells: npt.NDArray[np.int64] | None = None
    cell_type: str = ""
    vertex_fields: dict[str, RealArray] = field(default_factory=dict)
    cell_fields: dict[str, RealArray] = field(default_factory=dict)
    with_mesh: bool = False


@dataclass(frozen=True)
class Progress:
    """One report of progress, rank 0 only.

    Attributes:
        lapse: Number of the lapse, from 0.
        num_lapses: How many there are.
        phase: ``"sweep"``, ``"iteration"``, ``"lapse"`` (a lapse is done); after the last one what
            is done with the result may report too, as ``hytf run`` does: ``"tables"``,
            ``"figures"``.
        iteration: Equivalent-linear iteration, from 1 (0 without the loop).
        done: Lines solved in the running sweep.
        total: Lines of the running sweep.
        change: Last change of the equivalent-linear loop [-], or NaN.
        residual: Worst residual so far [-], or NaN.
        side: The side whose free field is being solved, or nothing.
    """

    lapse: int
    num_lapses: int
    phase: str
    iteration: int = 0
    done: int = 0
    total: int = 0
    change: float = float("nan")
    residual: float = float("nan")
    side: str = ""


ProgressCallback = Callable[[Progress], None]
SnapshotCallback = Callable[[Snapshot], None]


@dataclass(frozen=True)
class Result:
    """A finished simulation.

    Attributes:
        scene: The scene that was run.
        num_ranks: MPI ranks.
        group_size: Ranks that share a mesh; groups of them share out the lines.
        components: Names of the displacement components, ``("x", "y")`` or with ``"z"``.
        directions: Direction of each motion.
        receivers: Names.
        places: Places of the receivers at the start [m], shape ``(num_receivers, gdim)``.
        region_names: Names of the mesh's regions.
        dt: Time step [s].
        base_acceleration: Input as used, zero-padded [m/s^2], shape ``(num_motions, num_samples)``.
        lapses: One record a lapse.
        sizes: ``cells``, ``unknowns``, ``points``.
        work: Counts and wall seconds.
        peak_memory: Largest resident memory of a rank [bytes].
        coarse: What is to be said of cells too large for the motion.
    """

    scene: Scene
    num_ranks: int
    group_size: int
    components: tuple[str, ...]
    directions: tuple[str, ...]
    receivers: tuple[str, ...]
    places: RealArray
    region_names: tuple[str, ...]
    dt: float
    base_acceleration: RealArray
    lapses: tuple[LapseResult, ...]
    sizes: dict[str, int]
    work: Work
    peak_memory: int
    coarse: tuple[str, ...] = ()

    @property
    def time(self) -> RealArray:
        """Time of every sample of the record [s], shape ``(num_samples,)``."""
        return np.asarray(self.dt * np.arange(self.base_acceleration.shape[1]), np.float64)

    def history(self, name: str) -> RealArray:
        """Receiver histories over the whole record.

        Args:
            name: ``displacement``, ``velocity``, ``acceleration`` or ``total_acceleration``.

        Returns:
            The lapses joined sample for sample, shape ``(num_receivers, gdim, num_samples)``.
        """
        return np.concatenate([getattr(lapse, name) for lapse in self.lapses], axis=2)

    @property
    def within_acceleration(self) -> RealArray:
        """Acceleration of the base over the whole record [m/s^2].

        In the direction of each motion, shape ``(num_motions, num_samples)``.
        """
        return np.concatenate([lapse.within for lapse in self.lapses], axis=1)

    @property
    def outcrop_acceleration(self) -> RealArray | None:
        """Acceleration of the bare rock likewise, or ``None`` where it is not known."""
        parts = [lapse.outcrop for lapse in self.lapses if lapse.outcrop is not None]
        return np.concatenate(parts, axis=1) if len(parts) == len(self.lapses) else None
