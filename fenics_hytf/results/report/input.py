# SPDX-License-Identifier: MIT
"""The report on what was run: mesh and layers, soils, rock, boundaries, motions, settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fenics_hytf.results.report.markup import NOTHING, definitions, number, section, table

Summary = Mapping[str, Any]

_STRENGTH = ("Cohesion [kPa]", "Friction angle [°]")


def input_section(summary: Summary) -> str:
    """The section on the input.

    Args:
        summary: ``summary.json``.

    Returns:
        HTML.
    """
    return section(
        "Ground and input",
        definitions(_settings(summary)),
        _layers(summary),
        _soils(summary),
        _motions(summary),
    )


def _layers(summary: Summary) -> str:
    layers = summary["scene"]["mesh"].get("layers", ())
    rows, top = [], 0.0
    for layer in layers:
        bottom = top + layer["thickness_m"]
        rows.append((layer["soil"], f"{top:g}", f"{bottom:g}", f"{bottom - top:g}", layer["cells"]))
        top = bottom
    head = ("Layer, top down", "Top [m]", "Bottom [m]", "Thickness [m]", "Cells [-]")
    return table("Layers, depths below the surface.", head, rows)


def _soils(summary: Summary) -> str:
    head = (
        "Soil",
        "Density [kg/m³]",
        "Vs [m/s]",
        "G [MPa]",
        "Poisson's ratio [-]",
        "Damping [%]",
        *(_STRENGTH if summary["sliding"] else ()),
        "Curves of G/Gmax and damping",
    )
    scene = summary["scene"]
    rows = [
        (
            name,
            number(soil["density_kg_m3"], 5),
            number(soil["shear_wave_velocity_m_s"], 4),
            number(soil["shear_modulus_pa"] / 1e6, 4),
            f"{soil['poisson']:g}",
            number(100 * soil["damping"]),
            *(_strength(soil) if summary["sliding"] else ()),
            soil["curves"] or NOTHING,
        )
        for name, soil in scene["soils"].items()
    ]
    rock = scene["rock"]
    if rock is not None:
        density, velocity = rock["density"], rock["shear_wave_velocity"]
        rows.append(
            (
                "Rock below the base",
                number(density, 5),
                number(velocity, 4),
                number(density * velocity**2 / 1e6, 4),
                f"{rock['poisson']:g}",
                number(100 * rock["damping"]),
                *((NOTHING,) * len(_STRENGTH) if summary["sliding"] else ()),
                NOTHING,
            )
        )
    return table("Soils, at small strain.", head, rows, words=(0, len(head) - 1))


def _strength(soil: Mapping[str, Any]) -> tuple[str, ...]:
    """Cohesion [kPa] and friction angle [°]; what is not given is nought."""
    return number((soil["cohesion_pa"] or 0.0) / 1e3), number(soil["friction_angle_degrees"] or 0.0)


def _motions(summary: Summary) -> str:
    head = (
        "Motion",
        "Direction",
        "Given as",
        "PGA [g]",
        "Time step [s]",
        "Samples [-]",
        "Duration [s]",
    )
    rows = [
        (
            motion["name"],
            motion["direction"],
            motion["input"],
            number(motion["pga_g"]),
            f"{motion['dt_s']:g}",
            motion["samples"],
            f"{motion['dt_s'] * motion['samples']:g}",
        )
        for motion in summary["motions"]
    ]
    return table("Motions, as used after scaling.", head, rows, words=(0, 1, 2))


def _settings(summary: Summary) -> list[tuple[str, str]]:
    scene, solver = summary["scene"], summary["scene"]["solver"]
    effects = ", ".join(name.replace("_", " ") for name in summary["effects"]) or "none"
    kinds = scene["boundary"].items()
    limit = solver["max_frequency"]
    settings = [
        ("Effects", effects),
        ("Mesh", scene["mesh"]["text"]),
        ("Boundaries", ", ".join(f"{name} {kind.replace('_', ' ')}" for name, kind in kinds)),
        ("Complex modulus", _modulus(solver)),
        (
            "Sweep",
            f"{solver['sweep']}, tolerance {solver['tolerance']:g}, "
            + ("to the Nyquist frequency" if limit is None else f"to {limit:g} Hz"),
        ),
        ("Lapses", f"{len(summary['lapses'])}, {scene['continuity']}"),
        ("Scene", f"hash {summary['scene_hash'][:12]}"),
    ]
    if scene["loop_tolerance"] is not None:
        text = f"strain ratio {scene['strain_ratio']:g}, tolerance {scene['loop_tolerance']:g}"
        settings.insert(1, ("Equivalent linear", text))
    degradation = scene["degradation"]
    if degradation is not None:
        soils = ", ".join(degradation["soils"] or ["all soils"])
        text = (
            f"{soils}: above a strain of {100 * degradation['threshold']:g} %, "
            f"s {degradation['s']:g}, r {degradation['r']:g}, not below {degradation['minimum']:g}"
        )
        settings.insert(1, ("Degradation", text))
    if scene["gravity"] is not None:
        stress = scene["gravity"]["initial_stress"]
        first = "" if stress is None else f", initial stress {stress}"
        settings.insert(1, ("Gravity", f"{scene['gravity']['acceleration']:g} m/s²{first}"))
    if scene["sliding"] is not None:
        sliding = scene["sliding"]
        text = f"steps of {1e3 * sliding['time_step']:g} ms at most"
        if "convection" in summary["effects"]:
            text += f", a new mechanism after {sliding['new_mechanism']:g} of a cell"
        text += f", at most {sliding['longest']:g} s beyond the motion"
        settings.insert(1, ("Sliding", text))
    if scene["rayleigh"] is not None:
        text = f"alpha {scene['rayleigh']['alpha']:g} 1/s, beta {scene['rayleigh']['beta']:g} s"
        settings.insert(1, ("Rayleigh damping", text))
    return settings


def _modulus(solver: Mapping[str, Any]) -> str:
    text = f"{solver['complex_modulus']}, {_kept(solver['keep'])} kept"
    frequency = solver["reference_frequency"]
    return text if frequency is None else f"{text}, G at {number(frequency)} Hz"


def _kept(name: str) -> str:
    return {"poisson": "Poisson's ratio", "bulk": "bulk modulus"}.get(name, name)
