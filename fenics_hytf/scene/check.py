# SPDX-License-Identifier: MIT
"""The whole scene, section by section, then what the sections say about each other.

Rules between sections read the raw tables where they can, so that a fault in one section does not
hide those of another.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fenics_hytf.motion import split
from fenics_hytf.scene.axes import raw_components, raw_gdim
from fenics_hytf.scene.boundary import (
    BOUNDARY_KINDS,
    Boundary,
    default_kind,
    outcrop_rules,
    read_boundary,
)
from fenics_hytf.scene.continuity import (
    continuity_rules,
    resolve,
    sliding_rules,
    softening_rules,
)
from fenics_hytf.scene.effects import effect_rules
from fenics_hytf.scene.faults import (
    NOT_YET,
    Fault,
    fault_from,
    join_key,
    name_key,
    toml_text,
)
from fenics_hytf.scene.mesh import Mesh, layout, read_mesh
from fenics_hytf.scene.motion import MotionInput, input_rules, read_motions
from fenics_hytf.scene.output import Output, read_output
from fenics_hytf.scene.settings import Effects, Lapses, Points, Solver
from fenics_hytf.scene.soil import Soil, read_curves, read_soils
from fenics_hytf.scene.table import (
    LARGEST,
    SMALLEST,
    as_list,
    as_number,
    number,
    read_table,
    unknown_key,
)

SECTIONS = (
    "title",
    "mesh",
    "soil",
    "motion",
    "boundary",
    "lapses",
    "effects",
    "points",
    "solver",
    "output",
)

# G* of Dormieux is G(√(1 − 4D²) + 2iD), that of SHAKE91 G(1 − 2D² + ...).
_MOST_DAMPING = {"dormieux": 0.5, "shake91": 0.5**0.5}


@dataclass
class Sections:
    """The sections of a scene; ``None`` where one has a fault.

    Attributes:
        data: The raw table.
        folder: Where relative paths start, absolute.
        title: Title, empty if none is given.
        mesh: ``[mesh]``.
        soil: ``[soil.NAME]`` by name, ``None`` for a soil with a fault.
        motion: ``[[motion]]``, read and scaled, ``None`` for a motion with a fault.
        boundary: What holds the boundaries that the scene names.
        lapses: ``[lapses]``.
        effects: ``[effects]``.
        points: ``[points]``.
        solver: ``[solver]``.
        output: ``[output]``.
    """

    data: dict[str, Any]
    folder: Path
    title: str | None = None
    mesh: Mesh | None = None
    soil: dict[str, Soil | None] = field(default_factory=dict)
    motion: tuple[MotionInput | None, ...] = ()
    boundary: Boundary | None = None
    lapses: Lapses | None = None
    effects: Effects | None = None
    points: Points | None = None
    solver: Solver | None = None
    output: Output | None = None


def check(data: object, folder: Path | str) -> tuple[Sections, list[Fault]]:
    """Check a scene whole.

    Args:
        data: The raw table of the scene file.
        folder: Where relative paths start.

    Returns:
        The sections that are valid; and every fault, in the order of the sections.
    """
    folder = Path(folder).absolute()
    if not isinstance(data, dict):
        return Sections({}, folder), [Fault("the scene", toml_text(data), "a table of sections")]
    raw = {str(name): value for name, value in data.items()}
    # numbers near the largest overflow in places; what comes of it is refused as not finite
    with np.errstate(all="ignore"):
        sections, faults = _read_sections(raw, folder)
        faults += _unknown_sections(raw)
        faults += _soil_rules(raw, sections)
        faults += _base_rules(raw, sections)
        faults += effect_rules(raw, sections.effects, sections.soil, _num_lapses(sections))
        faults += _time_rules(raw, sections)
        faults += _damping_rules(raw, sections)
        faults += _settle_continuity(raw, sections)
    told = tuple(fault.key for fault in faults)
    faults += [fault for fault in _odd_sizes(raw) if not fault.key.startswith(told)]
    order = {name: i for i, name in enumerate(SECTIONS)}
    faults.sort(key=lambda fault: order.get(fault.key.split(".")[0].split("[")[0], -1))
    return sections, faults


def _read_sections(raw: dict[str, Any], folder: Path) -> tuple[Sections, list[Fault]]:
    """Each section on its own."""
    sections = Sections(raw, folder)
    faults: list[Fault] = []
    title = raw.get("title", "")
    if isinstance(title, str):
        sections.title = title
    else:
        faults.append(Fault("title", toml_text(title), "a string"))
    sections.mesh, found = read_mesh(raw.get("mesh"), folder)
    faults += found
    sections.soil, found = read_soils(raw.get("soil"), folder)
    faults += found
    gdim, drawn = raw_gdim(raw.get("mesh")), layout(raw.get("mesh"))
    sections.motion, found = read_motions(
        raw.get("motion"), folder, raw_components(raw.get("mesh"))
    )
    faults += found
    names = None if drawn is None else drawn.boundaries
    tables = [table for table in as_list(raw.get("motion")) if isinstance(table, dict)]
    directions = [str(table.get("direction")) for table in tables]
    sections.boundary, found = read_boundary(raw.get("boundary", {}), names, directions)
    faults += found
    sections.lapses, found = read_table(Lapses, raw.get("lapses", {}), "lapses")
    faults += found
    sections.effects, found = read_table(Effects, raw.get("effects", {}), "effects")
    faults += found
    sections.points, found = read_table(Points, raw.get("points", {}), "points")
    faults += found
    sections.solver, found = read_table(Solver, raw.get("solver", {}), "solver")
    faults += found
    size = None if drawn is None else drawn.size
    sections.output, found = read_output(raw.get("output", {}), gdim, size)
    return sections, faults + found


def _odd_sizes(raw: object, key: str = "") -> Iterator[Fault]:
    """Numbers so large or small that what follows from them overflows or vanishes."""
    if isinstance(raw, dict):
        for name, value in raw.items():
            yield from _odd_sizes(value, join_key(key, name_key(name)))
    elif isinstance(raw, list | tuple):
        for i, value in enumerate(raw):
            yield from _odd_sizes(value, join_key(key, i))
    size = abs(as_number(raw) or 0.0)
    if size and not SMALLEST <= size <= LARGEST:
        expected = f"0, or a number from {SMALLEST:g} to {LARGEST:g} in size"
        yield Fault(key, toml_text(raw), expected)


def _unknown_sections(raw: dict[str, Any]) -> Iterator[Fault]:
    for name, value in raw.items():
        if name not in SECTIONS:
            yield unknown_key(name_key(name), value, name, list(SECTIONS))


def _soil_rules(raw: dict[str, Any], sections: Sections) -> Iterator[Fault]:
    """Layers and regions name soils that there are; several soils in a box need regions."""
    mesh, soils = raw.get("mesh"), sections.soil
    if not isinstance(mesh, dict) or not soils:
        return
    empty = as_list(mesh.get("empty"))
    for i, name in enumerate(empty):
        if isinstance(name, str) and name in soils:
            expected = "the name of a region without soil"
            yield Fault(join_key("mesh.empty", i), f"{toml_text(name)}, a soil", expected)
    for key, name in _named_soils(mesh):
        if name not in soils and name not in empty:
            yield Fault(key, toml_text(name), f"one of the soils {', '.join(map(name_key, soils))}")
    lone = mesh.get("box") is None or mesh.get("column") is not None
    if not lone and not mesh.get("regions") and len(soils) > 1:
        names = ", ".join(map(name_key, soils))
        yield Fault("mesh.regions", "nothing", f"which soil is where; there are {names}")


def _named_soils(mesh: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Keys of a raw mesh table that name a soil, and the names."""
    column = mesh.get("column")
    layers = column.get("layers") if isinstance(column, dict) else None
    for place, parts in (("column.layers", layers), ("regions", mesh.get("regions"))):
        for i, part in enumerate(parts if isinstance(parts, list | tuple) else ()):
            name = part.get("soil") if isinstance(part, dict) else None
            if isinstance(name, str) and name:
                yield join_key("mesh", place, i, "soil"), name


def _base_rules(raw: dict[str, Any], sections: Sections) -> Iterator[Fault]:
    """The base and the kind of the motions fit each other."""
    boundary = raw.get("boundary", {})
    base = boundary.get("base", default_kind("base")) if isinstance(boundary, dict) else None
    if isinstance(base, dict) and "compliant" in base:
        yield from input_rules(sections.motion, "compliant")
        motions = [m for m in sections.motion if m is not None and m.input == "outcrop"]
        if sections.boundary is not None and motions:
            yield from outcrop_rules(sections.boundary, [m.direction for m in motions])
    elif isinstance(base, str) and base in set(BOUNDARY_KINDS) - {"dashpot", "free_field"}:
        yield from input_rules(sections.motion, base)


def _num_lapses(sections: Sections) -> int | None:
    """Number of lapses, or ``None`` where it is not known or there is a fault."""
    lapses = sections.lapses
    if lapses is None or lapses.duration is None:
        return None if lapses is None else lapses.count
    records = [motion.record for motion in sections.motion if motion is not None]
    if not records:
        return None
    try:
        longest = max(record.num_samples for record in records)
        return len(split(longest, records[0].dt, duration=lapses.duration))
    except (ValueError, OverflowError):  # a fault of its own
        return None


def _time_rules(raw: dict[str, Any], sections: Sections) -> Iterator[Fault]:
    """Lapses of at least two samples; no line above the Nyquist frequency."""
    read = [motion.record for motion in sections.motion if motion is not None]
    if not read:
        return
    dt = read[0].dt
    solver = raw["solver"] if isinstance(raw.get("solver"), dict) else {}
    if sections.lapses is not None and None not in sections.motion:
        yield from _lapse_rules(sections.lapses, max(r.num_samples for r in read), dt)
    highest = number(solver, "max_frequency")
    nyquist = 0.5 / dt
    # a Nyquist frequency written with the digits of dt may be off by rounding
    if highest is not None and highest > nyquist * (1 + 1e-9):
        expected = f"at most {nyquist:g} Hz, the Nyquist frequency of the motion"
        yield Fault("solver.max_frequency", toml_text(solver["max_frequency"]), expected)


def _settle_continuity(raw: dict[str, Any], sections: Sections) -> Iterator[Fault]:
    """What lapses hand over, once they and the motions are known."""
    motions = tuple(motion for motion in sections.motion if motion is not None)
    lapses, solver, effects = sections.lapses, sections.solver, sections.effects
    if lapses is None or solver is None or effects is None:
        return
    if not motions or len(motions) < len(sections.motion):
        return
    dt = motions[0].record.dt
    if any(abs(motion.record.dt - dt) > 1e-9 * dt for motion in motions):  # a fault of its own
        return
    longest = max(motion.record.num_samples for motion in motions)
    try:
        segments = split(longest, dt, lapses.count, lapses.duration)
    except (ValueError, OverflowError):  # a fault of its own
        return
    lapses, solver = resolve(raw, lapses, solver, effects, motions, segments)
    sections.lapses, sections.solver = lapses, solver
    yield from continuity_rules(lapses, solver, motions, segments)
    if effects.sliding is not None:
        duration = max(segment.num_samples for segment in segments) * dt
        yield from sliding_rules(effects.sliding, lapses, solver, duration, dt)
    handed_over = lapses.continuity == "transient" and len(segments) > 1
    if handed_over and effects.softening and effects.convection:
        yield from softening_rules(solver)
    if handed_over and solver.complex_modulus != "maxwell" and sections.boundary is not None:
        for name, kind in sections.boundary.kinds.items():
            if kind == "free_field":
                expected = (
                    f"{NOT_YET} with several transient lapses under a law that is not causal; "
                    'solver.complex_modulus = "maxwell" or lapses.continuity = "steady" is'
                )
                yield Fault(join_key("boundary", name_key(name)), toml_text(kind), expected)


def _lapse_rules(lapses: Lapses, num_samples: int, dt: float) -> Iterator[Fault]:
    """The motion can be cut as asked for."""
    name = "count" if lapses.duration is None else "duration"
    try:
        split(num_samples, dt, count=lapses.count, duration=lapses.duration)
    except (ValueError, OverflowError) as error:
        key = join_key("lapses", name)
        yield fault_from(error, key, toml_text(getattr(lapses, name)))


def _damping_rules(raw: dict[str, Any], sections: Sections) -> Iterator[Fault]:
    """Damping that leaves stiffness; curves for the equivalent-linear loop."""
    soils = raw.get("soil")
    if not isinstance(soils, dict):
        return
    solver, effects = raw.get("solver"), raw.get("effects")
    law = solver.get("complex_modulus") if isinstance(solver, dict) else None
    if isinstance(law, str) and law in _MOST_DAMPING:
        for name, soil in soils.items():
            yield from _damping_limit(law, soil, join_key("soil", name_key(name)), sections.folder)
        base = raw["boundary"].get("base") if isinstance(raw.get("boundary"), dict) else None
        if isinstance(base, dict):
            rock = base.get("compliant")
            yield from _damping_limit(law, rock, "boundary.base.compliant", sections.folder)
    loop = effects.get("equivalent_linear", False) if isinstance(effects, dict) else False
    if loop is False or loop is None:
        return
    drawn = layout(raw.get("mesh"))
    used = (drawn.soil_names if drawn is not None else ()) or tuple(soils)
    if not used or any(name not in soils for name in used):
        return
    if not any(isinstance(soils[name], dict) and "curves" in soils[name] for name in used):
        expected = f"curves in one of the soils {', '.join(map(name_key, used))}"
        yield Fault("effects.equivalent_linear", "no soil with curves", expected)


def _damping_limit(law: str, raw: object, key: str, folder: Path) -> Iterator[Fault]:
    """Damping ratios at which the real part of G* is still positive, of the curve everywhere."""
    if not isinstance(raw, dict):
        return
    limit = _MOST_DAMPING[law]
    expected = f'below {limit:.4g} with complex_modulus = "{law}"'
    damping = number(raw, "damping")
    if damping is not None and limit <= damping < 1:
        yield Fault(join_key(key, "damping"), toml_text(damping), f"a damping ratio {expected}")
    curves = raw.get("curves")
    curve = read_curves(curves, "curves", folder)[0] if isinstance(curves, dict) else None
    if curve is not None and float(curve.damping.max()) >= limit:
        found = f"damping up to {float(curve.damping.max()):g}"
        yield Fault(join_key(key, "curves"), found, f"damping ratios {expected}")
