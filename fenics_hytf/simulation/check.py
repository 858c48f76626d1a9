# SPDX-License-Identifier: MIT
"""What is wrong with a scene that only its mesh shows; all of it at once."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from mpi4py import MPI

from fenics_hytf.domain import (
    Domain,
    constraint_matrix,
    distance_to_sides,
    examine,
    side_column,
)
from fenics_hytf.lapse import column_supports
from fenics_hytf.scene import (
    Calm,
    Fault,
    Scene,
    SceneError,
    Sections,
    default_kind,
    lapse_length_rules,
)
from fenics_hytf.simulation.receivers import receiver_faults, without_soil


def mesh_faults(
    scene: Scene | Sections, comm: MPI.Comm = MPI.COMM_WORLD
) -> tuple[Domain | None, list[Fault]]:
    """Make the scene's domain and collect the faults that it shows (collective).

    Args:
        scene: The scene; or, of one with faults, the sections that are valid.
        comm: Communicator.

    Returns:
        The domain, ``None`` where there is none to compute on; and the faults, the same on every
        rank.
    """
    if scene.mesh is None:
        return None, []
    domain, faults = examine(scene, comm)
    if isinstance(scene, Scene):
        segments = scene.segments
        faults += lapse_length_rules(scene.lapses, segments[0].num_samples, len(segments))
    if domain is None:
        return None, faults
    try:
        scene.mesh.points_in(domain.mesh.topology.cell_name())
    except SceneError as error:
        faults += error.faults
    if scene.mesh.file is not None and "base" not in domain.boundaries:
        found = f"no boundary named base, only {', '.join(sorted(domain.boundaries))}"
        faults.append(Fault("mesh.file", found, "one named base, which the ground stands on"))
    faults += _locking_faults(scene, domain)
    faults += _sliding_faults(scene, domain)
    if scene.output is not None:
        outside = receiver_faults(domain, scene.output.receivers)
        faults += outside or _empty_faults(scene, domain)
    if scene.boundary is not None and not faults:
        faults += _boundary_faults(scene, domain)
    if not faults:
        faults += _curve_faults(scene, domain)
    return domain, faults


def checked_domain(scene: Scene, comm: MPI.Comm) -> Domain:
    """Make the scene's domain.

    Args:
        scene: The scene.
        comm: Communicator.

    Returns:
        The domain.

    Raises:
        SceneError: With every fault that the mesh shows; on every rank.
    """
    domain, faults = mesh_faults(scene, comm)
    if domain is None or faults:
        raise SceneError(faults)
    return domain


def _curve_faults(scene: Scene | Sections, domain: Domain) -> list[Fault]:
    """Curves are of soils that fill a cell; that no soil at all has any, the scene has told."""
    if scene.effects is None or scene.effects.equivalent_linear is None or scene.mesh is None:
        return []
    filling = [scene.soil.get(name) for name in domain.region_names]
    named = [scene.soil.get(name) for name in scene.mesh.soil_names or scene.soil]
    if any(soil is None or soil.curve is not None for soil in filling):
        return []
    if all(soil is not None and soil.curve is None for soil in named):
        return []
    expected = f"curves for one of the mesh's soils, {', '.join(domain.region_names)}"
    return [Fault("effects.equivalent_linear", "no soil with curves", expected)]


def _locking_faults(scene: Scene | Sections, domain: Domain) -> list[Fault]:
    """Strain of simplices of degree 1 is constant: there is no mean that they could take."""
    name = {"triangle": "triangles", "tetrahedron": "tetrahedra"}.get(
        domain.mesh.topology.cell_name()
    )
    wanted = scene.effects is not None and scene.effects.locking and domain.num_components > 1
    if not wanted or name is None or domain.V.ufl_element().degree > 1:
        return []
    expected = "quadrilaterals or hexahedra, or degree 2"
    return [Fault("effects.locking", f"{name} of degree 1", expected)]


def _empty_faults(scene: Scene | Sections, domain: Domain) -> list[Fault]:
    """Without convection no point ever gets to a receiver in a region without soil."""
    if scene.mesh is None or not scene.mesh.empty or scene.output is None:
        return []
    if scene.effects is None or scene.effects.convection:
        return []
    receivers = scene.output.receivers
    expected = "a place in the ground: no point moves there without effects.convection"
    return [
        Fault(
            f"output.receivers.{name}",
            f"{list(receivers[name].place)} in a region of mesh.empty",
            expected,
        )
        for name in without_soil(domain, receivers)
    ]


def _sliding_faults(scene: Scene | Sections, domain: Domain) -> list[Fault]:
    """What slides is driven along the ground."""
    directions = {motion.direction for motion in scene.motion if motion is not None}
    slides = scene.effects is not None and scene.effects.sliding is not None
    if not slides or directions != {domain.components[-1]} or domain.num_components == 1:
        return []
    expected = "one along the ground, which drives what slides"
    return [Fault("motion", "vertical motion alone", expected)]


def _boundary_faults(scene: Scene | Sections, domain: Domain) -> list[Fault]:
    """What keeps the constraints, the columns beyond sides or an absorbing layer from being."""
    motions = [m for m in scene.motion if m is not None and m.direction in domain.components]
    axes = [domain.components.index(m.direction) for m in motions]
    supports = scene.boundary.supports(motions[0].input) if scene.boundary and motions else {}
    calm = scene.effects.calm if scene.effects is not None else None
    attempts: list[Callable[[], object]] = [
        lambda: constraint_matrix(domain, supports, axes).destroy(),
        *(partial(_try_column, domain, name, supports, axes) for name in supports),
        *([partial(_try_layer, domain, calm, supports)] if calm else []),
    ]
    faults: list[Fault] = []
    for attempt in attempts:
        try:
            attempt()
        except SceneError as error:
            faults += error.faults
    return faults


def _try_column(domain: Domain, name: str, supports: dict[str, str], axes: list[int]) -> None:
    """Make the column beyond a side with free field, and hold its base."""
    if supports[name] == "free_field":
        column = side_column(domain, name).domain
        constraint_matrix(column, column_supports(supports, column.gdim), axes).destroy()


def _try_layer(domain: Domain, calm: Calm, supports: dict[str, str]) -> None:
    """Lay an absorbing layer along plane sides that let it, and leave something of the section."""
    for number, side in enumerate(calm.sides):
        key = f"effects.calm.sides[{number}]"
        if side not in domain.boundaries:
            names = ", ".join(domain.boundaries)
            raise SceneError([Fault(key, f"no boundary '{side}' in the mesh", f"one of {names}")])
        kind = supports.get(side, default_kind(side))
        if kind in ("tied", "free_field"):
            expected = (
                "a side that is free, dashpot or fixed: the layer would damp the level ground "
                "that such a side goes on as"
            )
            raise SceneError([Fault(key, f"'{side}', which is {kind}", expected)])
    distance = distance_to_sides(domain, calm.sides, domain.centroids())
    if distance.max() < calm.thickness:
        found = f"{calm.thickness:g}, a layer that holds every cell"
        expected = f"a thickness below {distance.max():.4g} m"
        raise SceneError([Fault("effects.calm.thickness", found, expected)])
