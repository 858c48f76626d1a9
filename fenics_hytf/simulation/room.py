# SPDX-License-Identifier: MIT
"""Whether a computer has room for a run: said before anything is built for it."""

from __future__ import annotations

from mpi4py import MPI

from fenics_hytf.lapse import scheme_of
from fenics_hytf.scene import Scene, Sections, components_of
from fenics_hytf.simulation import memory
from fenics_hytf.simulation.demand import (
    Demand,
    Sizes,
    demand_of,
    demand_of_mesh,
    gigabytes,
    plan_of,
    sizes_of,
)


def room_faults(
    scene: Scene | Sections, comm: MPI.Comm = MPI.COMM_WORLD, group_size: int | None = None
) -> list[str]:
    """What speaks against a run for want of memory (collective).

    Computers are taken by what they have in all, not by what is free at the moment: whether other
    programs are there is no property of the run.

    Args:
        scene: The scene; or, of one with faults, the sections that are valid.
        comm: All ranks of the run.
        group_size: Ranks that share a mesh; as many as there are, the least memory, if ``None``.

    Returns:
        A message, or none; the same on every rank.
    """
    if scene.mesh is None:
        return []
    sizes = comm.bcast(sizes_of(scene.mesh) if comm.rank == 0 else None)
    if sizes is None:
        return []
    group = group_size if group_size and comm.size % group_size == 0 else comm.size
    demand = _demand(scene, sizes)
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    here = node.size
    node.Free()
    asked = demand.of(comm.size, group) * here // comm.size
    there = memory.machine_memory()
    limit = memory.process_limit()
    if limit is not None:
        there = min(there, limit * here)
    places = comm.allgather((asked / there, asked, there))
    share, asked, there = max(places)
    if share <= 1.0:
        return []
    computer = "one computer" if here < comm.size else "this computer"
    return [
        f"memory: found a run that takes about {gigabytes(asked)} on {computer}, with "
        f"{sizes.cells} cells and {sizes.unknowns} unknowns; expected at most the "
        f"{gigabytes(there)} that it has. {demand.words(comm.size, group)}. Try it all the same "
        "with --force"
    ]


def _demand(scene: Scene | Sections, sizes: Sizes) -> Demand:
    if not isinstance(scene, Scene):
        return demand_of_mesh(sizes)
    components = components_of(sizes.gdim, scene.mesh.kinematics)
    if any(motion.direction not in components for motion in scene.motion):
        return demand_of_mesh(sizes)  # a fault, told once there is a mesh
    names = scene.mesh.soil_names or tuple(scene.soil)
    return demand_of(scene, plan_of(scene, scheme_of(scene, names), components), sizes)
