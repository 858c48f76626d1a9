# SPDX-License-Identifier: MIT
"""What was run, as plain values: the scene's description for the figures and the report."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

from fenics_hytf.scene import default_kind

if TYPE_CHECKING:
    from fenics_hytf.scene import Scene
    from fenics_hytf.scene.mesh import Mesh
    from fenics_hytf.scene.soil import Soil

_MODEL = re.compile(r"([a-z]+(?:_[a-z]+)*)(?:_(\d{4}))?(?:_(\w+))?")
_PAIRS = ("hardin_drnevich", "ishibashi_zhang", "seed_idriss", "vucetic_dobry")  # of authors
_ACRONYMS = ("epri", "gei", "mkz", "ocr")
_UNITS = {
    "plasticity_index": (1.0, " %"),
    "mean_stress": (1e-3, " kPa"),
    "shear_strength": (1e-3, " kPa"),
    "d50": (1.0, " mm"),
    "frequency": (1.0, " Hz"),
}


def describe_scene(scene: Scene, region_names: tuple[str, ...]) -> dict[str, Any]:
    """The scene as the report and the figures need it, and as its file says it.

    Args:
        scene: The scene.
        region_names: Soils of the mesh.

    Returns:
        Plain values. ``scheme`` says how lapses hang together, see
        :class:`fenics_hytf.lapse.Scheme`; ``contour`` is the damped contour on which they are
        solved, or ``None``.
    """
    # what solves is loaded where something was solved, not where a result is read
    from fenics_hytf.lapse import scheme_of

    scheme = scheme_of(scene, region_names)
    contour = scheme.contour
    effects, solver, boundary = scene.effects, scene.solver, scene.boundary
    loop = effects.equivalent_linear
    names = scene.mesh.boundaries or tuple(dict.fromkeys(("base", *boundary.kinds)))
    return {
        "definition": json.loads(json.dumps(scene.data, default=str)),
        "mesh": _mesh(scene.mesh),
        "soils": {name: _soil(soil, loop is not None) for name, soil in scene.soil.items()},
        "boundary": {name: boundary.kinds.get(name, default_kind(name)) for name in names},
        "rock": None if boundary.rock is None else boundary.rock.model_dump(),
        "continuity": scene.lapses.continuity,
        "scheme": scheme.name,
        "contour": None
        if contour is None
        else {"eta_1_s": contour.eta, "period_s": contour.period * contour.dt},
        "loop_tolerance": None if loop is None else loop.tolerance,
        "strain_ratio": None if loop is None else loop.strain_ratio,
        "magnitude": None if loop is None else loop.magnitude,
        "strain_measure": "plane" if loop is None else loop.strain,
        "rayleigh": None if effects.rayleigh is None else effects.rayleigh.model_dump(),
        "degradation": None if effects.degradation is None else effects.degradation.model_dump(),
        "gravity": None if effects.gravity is None else effects.gravity.model_dump(),
        "sliding": None if effects.sliding is None else effects.sliding.model_dump(),
        "softening": effects.softening,
        "calm": None if effects.calm is None else effects.calm.model_dump(),
        "water_table_m": scene.output.water_table,
        "solver": solver.model_dump(),
    }


def _mesh(mesh: Mesh) -> dict[str, Any]:
    described: dict[str, Any] = {
        "degree": mesh.degree,
        "kinematics": mesh.kinematics,
        "points_per_cell": mesh.points_per_cell,
    }
    if mesh.column is not None:
        column = mesh.column
        kind, text = "column", f"column {column.height:g} m high, {column.width:g} m wide"
        described["layers"] = [
            {"thickness_m": i.thickness, "soil": i.soil, "cells": i.cells} for i in column.layers
        ]
    elif mesh.box is not None:
        box = mesh.box
        kind = "box"
        size, cells = (" x ".join(f"{n:g}" for n in numbers) for numbers in (box.size, box.cells))
        text = f"box {size} m, {cells} {box.cell} cells"
    else:
        kind, text = "file", "" if mesh.file is None else mesh.file.name
        if mesh.refine:
            text += f", every edge in {2**mesh.refine}"
    kinematics = "" if mesh.kinematics is None else f", {mesh.kinematics.replace('_', ' ')}"
    return {"kind": kind, "text": f"{text}, degree {mesh.degree}{kinematics}", **described}


def _soil(soil: Soil, with_curves: bool) -> dict[str, Any]:
    """Constants of a soil; ``curves`` says which rule, or is ``None`` where none do."""
    elastic = soil.elastic
    return {
        "density_kg_m3": elastic.density,
        "shear_wave_velocity_m_s": elastic.shear_wave_velocity,
        "shear_modulus_pa": elastic.shear_modulus,
        "poisson": elastic.poisson,
        "damping": soil.damping_ratio(with_curves),
        "cohesion_pa": soil.cohesion,
        "friction_angle_degrees": soil.friction_angle,
        "curves": _curves(soil) if with_curves else None,
    }


def _curves(soil: Soil) -> str | None:
    """Which curves, with their parameters; a table by the number of its strains."""
    if soil.curves is None:
        return None
    curves = dict(soil.curves)
    parts = []
    if "model" in curves:
        parts.append(_model(str(curves.pop("model"))))
    for columns in ("strain", "modulus", "damping"):
        values = curves.pop(columns, None)
        if columns == "strain" and values is not None:
            parts.append(f"table of {len(values)} strains")
    return ", ".join([*parts, *(_parameter(*item) for item in curves.items())])


def _model(name: str) -> str:
    """The name of a model: its authors or region, year, and what follows."""
    match = _MODEL.fullmatch(name)
    if match is None:
        return name.replace("_", " ")
    words, year, rest = match.groups()
    joint = " and " if words in _PAIRS else " "
    who = joint.join(w.upper() if w in _ACRONYMS else w.capitalize() for w in words.split("_"))
    which = "" if rest is None else f", {rest.replace('_', ' ')}"
    return who + ("" if year is None else f" ({year})") + which


def _parameter(name: str, value: object) -> str:
    """A parameter of curves with its unit; stresses, which the scene gives in Pa, as kPa."""
    words = name.upper() if name in _ACRONYMS else name.replace("_", " ")
    if not isinstance(value, float | int):
        return f"{words} {value}"
    factor, unit = _UNITS.get(name, (1.0, ""))
    return f"{words} {factor * value:g}{unit}"
