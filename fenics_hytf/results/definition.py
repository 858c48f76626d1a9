# SPDX-License-Identifier: MIT
"""What was run, as plain values: the scene's description for the figures and the report."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fenics_hytf.scene import Scene
    from fenics_hytf.scene.mesh import Mesh
    from fenics_hytf.scene.soil import Soil


def describe_scene(scene: Scene) -> dict[str, Any]:
    """The scene as the report and the figures need it, and as its file says it.

    Args:
        scene: The scene.

    Returns:
        Plain values.
    """
    loop, rayleigh = scene.effects.equivalent_linear, scene.effects.rayleigh
    solver = scene.solver
    return {
        "definition": json.loads(json.dumps(scene.data, default=str)),
        "mesh": _mesh(scene.mesh),
        "soils": {name: _soil(soil, loop is not None) for name, soil in scene.soil.items()},
        "boundary": dict(scene.boundary),
        "continuity": scene.lapses.continuity,
        "loop_tolerance": None if loop is None else loop.tolerance,
        "strain_ratio": None if loop is None else loop.strain_ratio,
        "rayleigh": None if rayleigh is None else rayleigh.model_dump(),
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
        "curves": _curves(soil) if with_curves else None,
    }


def _curves(soil: Soil) -> str | None:
    if soil.curves is None:
        return None
    parameters = [
        f"{key} {value:g}" if isinstance(value, float | int) else f"{key} {value}"
        for key, value in soil.curves.items()
        if key != "model"
    ]
    if "model" not in soil.curves:
        return f"table of {len(soil.curves['strain'])} strains"
    return ", ".join([str(soil.curves["model"]), *parameters]).replace("_", " ")
