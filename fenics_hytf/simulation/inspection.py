# SPDX-License-Identifier: MIT
"""What a scene asks for, before anything is solved: sizes, lines, memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from fenics_hytf.domain import Domain, bare_nodes, constraint_matrix
from fenics_hytf.lapse import Scheme, scheme_of, seed_points
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.check import checked_domain
from fenics_hytf.simulation.demand import Demand, Sizes, demand_of, plan_of
from fenics_hytf.simulation.margins import edge_notes
from fenics_hytf.simulation.receivers import without_soil
from fenics_hytf.simulation.resolution import at_first, too_coarse
from fenics_hytf.soil import HELD_DAMPING

_NEARLY_INCOMPRESSIBLE = 0.45  # Poisson's ratio from which cells lock noticeably


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
        continuity: Which continuity, what it solves, and why it is this one.
        complex_modulus: Which convention, and why.
        lines: Lines solved in each lapse.
        factorisations: Factorisations of sweeps and of starts, see
            :class:`~fenics_hytf.simulation.demand.Plan`.
        bounded: Whether there can be no more of them.
        searched: Factorisations that mechanisms are expected to take besides.
        demand: Estimated memory.
        ranks: Ranks that share the mesh.
        notes: What the user should know.
    """

    effects: tuple[str, ...]
    cells: int
    unknowns: int
    points: int
    lapses: int
    samples_per_lapse: int
    continuity: str
    complex_modulus: str
    lines: tuple[int, ...]
    factorisations: int
    bounded: bool
    searched: int
    demand: Demand
    ranks: int
    notes: tuple[str, ...]

    @property
    def memory_bytes(self) -> int:
        """Estimated memory of all ranks [bytes]."""
        return self.memory_of(self.ranks)

    def memory_of(self, ranks: int) -> int:
        """Estimated memory of so many ranks that share the mesh [bytes]."""
        return self.demand.of(ranks, ranks)


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
    scheme = scheme_of(scene, domain.region_names)
    points = seed_points(scene, domain, scheme.carried(domain.num_components))
    axes = tuple(domain.components.index(m.direction) for m in scene.motion)
    bare = None
    if scene.mesh.empty:
        bare = bare_nodes(domain, domain.gather_cells(domain.regions.astype(np.int64)) >= 0)
    T = constraint_matrix(domain, scene.supports, axes, bare)
    unknowns = int(T.getSize()[1])
    T.destroy()
    plan = plan_of(scene, scheme, domain.components)
    lines = plan.lines
    num_points = comm.allreduce(len(points))
    sizes = Sizes(domain.gdim, domain.num_components, domain.num_cells, unknowns, num_points)
    return Inspection(
        effects=scene.effects.named,
        cells=domain.num_cells,
        unknowns=unknowns,
        points=num_points,
        lapses=len(lines),
        samples_per_lapse=scene.segments[0].num_samples,
        continuity=_continuity(scene, scheme),
        complex_modulus=_complex_modulus(scene),
        lines=lines,
        factorisations=plan.factorisations,
        bounded=plan.bounded,
        searched=plan.searched,
        demand=demand_of(scene, plan, sizes, points.bytes_per_point),
        ranks=comm.size,
        notes=(
            *_notes(scene, scheme, lines, domain.region_names),
            *_locking_notes(scene, domain),
            *too_coarse(scene, domain, at_first(scene, domain)),
            *_receiver_notes(scene, domain),
            *edge_notes(scene, domain),
        ),
    )


def _continuity(scene: Scene, scheme: Scheme) -> str:
    """The continuity in words: where it comes from and what is solved."""
    name, several = scene.lapses.continuity, len(scene.segments) > 1
    if scene.names("lapses", "continuity"):
        why = "named"
    elif scene.effects.sliding is not None:
        why = "the default for what slides"
    elif not several:
        why = "the default for one lapse"
    else:
        why = "the default for " + (
            "several lapses" if name == "transient" else "harmonic motions alone"
        )
    if scheme.contour is None:
        return f"{name} ({why}): each lapse is a period of its own"
    record, lapse = scene.base_acceleration.shape[1], scene.segments[0].num_samples
    whole = scheme.name == "whole_record"
    times = scheme.contour.period // (record if whole else lapse)
    over = f"{times} times the " + ("whole record, for every lapse" if whole else "lapse")
    period = scheme.contour.period * scene.dt
    return f"{name} ({why}): all lines of a damped contour of {period:g} s, {over}"


def _complex_modulus(scene: Scene) -> str:
    """The complex modulus in words, and where it comes from."""
    name = scene.solver.complex_modulus
    if scene.names("solver", "complex_modulus"):
        why = "named"
    else:
        slides = scene.effects.sliding is not None
        several = " for what slides" if slides else " for several transient lapses"
        why = "the default" + (several if name == "maxwell" else "")
    if name != "maxwell":
        return f"{name} ({why})"
    given = scene.names("solver", "reference_frequency")
    frequency = f"{scene.solver.reference_frequency:.3g} Hz"
    return f"{name} ({why}), G at {frequency}, " + (
        "as named" if given else "the dominant frequency of the motion"
    )


def _notes(
    scene: Scene, scheme: Scheme, lines: tuple[int, ...], soils: tuple[str, ...]
) -> Iterator[str]:
    effects, steady = scene.effects, scheme.name == "steady"
    if not any(lines) or not np.any(scene.base_acceleration):
        yield "no line is excited: the motion is zero up to solver.max_frequency"
    if scene.solver.sweep == "reduced":
        yield "the reduced sweep takes the factorisations it needs: their number is from experience"
    if scheme.name == "whole_record":
        yield (
            f"{scene.solver.complex_modulus} damping cannot be stopped and started again: every "
            "lapse solves the lines of the whole record, and a free vibration about it; maxwell "
            "costs less and hands over exactly"
        )
    if scene.solver.complex_modulus == "maxwell":
        yield from _damping_notes(scene, soils)
    if effects.sliding is not None:
        yield "what slides may cut lapses short, and go on after the motion until it rests"
    elif effects.convection and len(lines) == 1 and not effects.softening:
        yield "convection acts between lapses; the scene has one"
    if effects.convection and steady:
        but = ", but for softening" if effects.softening else ""
        yield f"under steady continuity the net movement of the points in a lapse is zero{but}"
    if effects.degradation is not None:
        yield "degradation acts between lapses: cycles of one lower the modulus from the next on"
    if effects.softening:
        yield "softening is an estimate from reduced stiffness: it knows neither strength nor time"
    if effects.geometric_stiffness and effects.gravity is None:
        yield "the points start without stress: geometric_stiffness adds nothing yet"


def _receiver_notes(scene: Scene, domain: Domain) -> Iterator[str]:
    """Receivers that the ground has yet to get to, and what is written of them meanwhile."""
    for name in without_soil(domain, scene.output.receivers) if scene.mesh.empty else ():
        yield (
            f"receiver {name}: there is no soil at the start (mesh.empty); until points get there "
            "its motion is that of the base, or within a cell of the ground between both"
        )


def _locking_notes(scene: Scene, domain: Domain) -> Iterator[str]:
    """Soil that hardly changes its volume, in cells that keep it from shearing then."""
    straight = domain.mesh.topology.cell_name() in ("triangle", "tetrahedron")
    if scene.effects.locking and straight:
        yield "locking changes nothing in straight triangles and tetrahedra of degree 2"
    if scene.effects.locking or domain.num_components == 1:
        return
    cure = "quadrilaterals or hexahedra with " if straight else ""
    for name in domain.region_names:
        poisson = scene.soil[name].elastic.poisson
        if poisson >= _NEARLY_INCOMPRESSIBLE:
            told = f"{poisson:g}"
            told = repr(poisson) if float(told) == 0.5 else told  # which it is not
            yield (
                f"soil {name}: Poisson's ratio is {told}, at which cells lock; the cure is "
                f"{cure}effects.locking = true"
            )


def _damping_notes(scene: Scene, soils: tuple[str, ...]) -> Iterator[str]:
    """Soils whose damping may be more than the Maxwell law can hold."""
    loop = scene.effects.equivalent_linear is not None
    but = f"above {HELD_DAMPING:g} four Maxwell branches no longer hold the loss factor"
    for name in soils:
        curve = scene.soil[name].curve if loop else None
        if curve is None:
            damping = scene.soil[name].damping_ratio(loop)
            if damping > HELD_DAMPING:
                yield f"soil {name}: damping is {damping:.2g}; {but}"
        elif curve.damping.max() > HELD_DAMPING:
            strain = np.geomspace(curve.strain[0], curve.strain[-1], 1000)
            beyond = strain[np.argmax(curve.evaluate(strain)[1] > HELD_DAMPING)]
            yield (
                f"soil {name}: damping may reach {curve.damping.max():.2g}, from strains of "
                f"{100 * beyond:.2g} % more than {HELD_DAMPING:g}; {but}"
            )
    calm = scene.effects.calm
    if calm is not None and calm.damping > HELD_DAMPING:
        yield f"effects.calm: damping reaches {calm.damping:.2g} at the side; {but}"
