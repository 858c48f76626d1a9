# SPDX-License-Identifier: MIT
"""Whether the ground of a scene stands at rest, before anything is shaken."""

from __future__ import annotations

from mpi4py import MPI

from fenics_hytf.frequency import SweepError
from fenics_hytf.lapse import FillingSurvey, LapseError, Slope, Statics, seed_points, survey
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.check import checked_domain
from fenics_hytf.simulation.errors import SimulationError


def factor_of_safety(scene: Scene, comm: MPI.Comm = MPI.COMM_WORLD) -> float:
    """The factor of safety that a run of the scene begins with (collective).

    It takes some tens of factorisations of one secant stiffness, as many as a run does for it.

    Args:
        scene: The scene; it calls for sliding.
        comm: Communicator; its ranks share the mesh.

    Returns:
        The factor of safety [-]; infinite where gravity shears nothing, as in level ground.

    Raises:
        SceneError: A fault that only the mesh shows; or a factor below 1, where the scene does not
            ask for ground that does not stand.
        SimulationError: The stress does not come into balance, or no mechanism was found.
    """
    domain = checked_domain(scene, comm)
    statics = Statics(scene, domain)
    slope = Slope(scene, domain, statics)
    try:
        points = seed_points(scene, domain)
        filling = FillingSurvey(scene, domain).at_first(points) if scene.mesh.empty else None
        if filling is not None:
            statics.occupy(filling)
        statics.settle(points, survey(scene, domain, points, filling))
        slope.weigh(points, filling)
        return slope.factor_of_safety()
    except (SweepError, LapseError) as error:
        raise SimulationError(0, str(error), None) from error
    finally:
        slope.destroy()
        statics.destroy()
