# SPDX-License-Identifier: MIT
"""The outer loop, as in the paper's flow chart: lapse by lapse, the points moving in between."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fenics_hytf.frequency import SweepError
from fenics_hytf.lapse import LapseError
from fenics_hytf.particles import PointsNotFinite, PointsOutside
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.checkpoint_folder import CheckpointFolder
from fenics_hytf.simulation.errors import SimulationError
from fenics_hytf.simulation.groups import form_groups
from fenics_hytf.simulation.records import ProgressCallback, Result, SnapshotCallback
from fenics_hytf.simulation.run import Run


def simulate(
    scene: Scene,
    comm: MPI.Comm = MPI.COMM_WORLD,
    progress: ProgressCallback | None = None,
    snapshot: SnapshotCallback | None = None,
    strain_from: npt.NDArray[np.intp] | None = None,
    group_size: int | None = None,
    checkpoint: CheckpointFolder | None = None,
) -> Result:
    """Run a scene: what ``hytf run`` does, without files (collective).

    Args:
        scene: The scene.
        comm: Communicator; its ranks share out the lines, and the mesh where memory asks for it.
        progress: Called on rank 0 while the simulation runs.
        snapshot: Called on every rank after every ``output.every``-th lapse, with points and
            fields on rank 0.
        strain_from: For every cell of the input the cell whose strain rules its moduli in the
            equivalent-linear loop, shape ``(num_cells,)``; each cell's own if ``None``.
        group_size: Ranks that share a mesh, a divisor of their number; from memory if ``None``.
        checkpoint: Where a checkpoint is kept after every lapse, and what the run goes on from if
            it has found one; made for this scene and communicator.

    Returns:
        The result, the same on every rank.

    Raises:
        SceneError: A fault that only the mesh shows.
        ValueError: The group size does not divide the number of ranks.
        SimulationError: The numerics stopped; it holds the lapses that were solved.
        CheckpointError: A checkpoint cannot be written, or is not what this version keeps.
    """
    if group_size is None and checkpoint is not None:
        group_size = checkpoint.group_size
    groups = form_groups(scene, comm, group_size)
    run = Run(scene, comm, groups, progress, strain_from)
    index = 0
    try:
        run.set_up()
        if checkpoint is not None and checkpoint.found is not None:
            run.restore(checkpoint.found)
        for segment in run.segments():
            index = segment.index
            run.weigh()
            solved = run.solve_lapse(segment)
            run.observe(solved, index, segment.start)
            run.count_cycles(solved)
            start = run.hand_over(solved)
            given_way = run.soften(solved)
            run.convect(solved, given_way)
            if snapshot is not None and (index + 1) % scene.output.every == 0:
                run.show(solved, index, start, snapshot)
            if checkpoint is not None:
                run.keep(checkpoint)
        result = run.result()
    except (SweepError, LapseError, PointsOutside, PointsNotFinite) as error:
        partial = run.result() if run.lapses else None
        raise SimulationError(index, str(error), partial) from error
    finally:
        run.destroy()
    groups.free()
    return result
