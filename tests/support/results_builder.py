# SPDX-License-Identifier: MIT
"""Made-up results of the right shapes, for tests of what is written and drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fenics_hytf.lapse.energy import Energy
from fenics_hytf.lapse.records import CellState, LapseResult, LoopHistory, SlipResult
from fenics_hytf.particles import MassLedger
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.records import Result, Snapshot, Work

COMPONENTS = ("x", "y", "z")
DEGRADES = {"equivalent_linear": True, "degradation": {"threshold": 1e-4, "soils": ["fill"]}}
ROCK = {"density": 2243.0, "shear_wave_velocity": 760.0, "poisson": 0.25, "damping": 0.01}


def make_scene(
    directions=("x",),
    lapses=1,
    loop=True,
    gdim=2,
    kind="column",
    receivers=3,
    samples=240,
    compliant=False,
    continuity=None,
    **extra,
):
    """A valid scene; compliant: on rock, under outcrop motions; continuity: if not the default."""
    sand = {"density": 1835.0, "shear_wave_velocity": 225.0, "poisson": 0.3, "damping": 0.02}
    fill = {**sand, "shear_wave_velocity": 150.0}
    if loop:
        curves = {"strain": [1e-6, 1e-4, 1e-2], "modulus": [1.0, 0.8, 0.1]}
        sand["curves"] = fill["curves"] = {**curves, "damping": [0.01, 0.05, 0.2]}
    if kind == "column":
        layers = [
            {"thickness": 4.0, "soil": "fill", "cells": 4},
            {"thickness": 20.0, "soil": "sand", "cells": 10},
        ]
        mesh = {"column": {"width": 1.0, "layers": layers}}
    else:
        size = [40.0, 24.0] if gdim == 2 else [40.0, 30.0, 24.0]
        cells = [20, 12] if gdim == 2 else [8, 6, 12]
        regions = [{"soil": "sand", "below": 20.0}, {"soil": "fill"}]
        mesh = {"box": {"size": size, "cells": cells}, "regions": regions}
    if gdim == 2 and directions == ("z",):
        mesh["kinematics"] = "antiplane"
    places = {
        f"r{i}": [0.5] * (gdim - 1) + [24.0 - 24.0 * i / max(receivers, 2)]
        for i in range(receivers)
    }
    synthetic = {"n": samples, "dt": 0.05}
    given = {"synthetic": synthetic, "pga": 0.2, "input": "outcrop" if compliant else "within"}
    data = {
        "title": "A made-up scene",
        "mesh": mesh,
        "soil": {"sand": sand, "fill": fill},
        "motion": [{"direction": d, **given} for d in directions],
        "lapses": {"count": lapses} | ({"continuity": continuity} if continuity else {}),
        "output": {"receivers": places},
        **({"effects": {"equivalent_linear": True}} if loop else {}),
        **({"boundary": {"base": {"compliant": ROCK}}} if compliant else {}),
        **extra,
    }
    return Scene.from_dict(data)


def make_result(directions=("x",), lapses=1, loop=True, gdim=2, kind="column", **more):
    """A result with smooth histories, three excited lines' worth of resonance, plausible cells.

    Transient lapses have seam errors and, under the Maxwell law, energy; where soils degrade they
    lose 2 % a lapse.
    """
    scene = make_scene(directions, lapses, loop, gdim, kind, **more)
    receivers = tuple(scene.output.receivers)
    places = np.array([scene.output.receivers[r].place for r in receivers]).reshape(-1, gdim)
    dt, samples = scene.dt, scene.motion[0].record.num_samples
    base = np.array([m.record.acceleration for m in scene.motion])
    components = directions if directions == ("z",) and gdim == 2 else COMPONENTS[:gdim]
    rock = scene.boundary.rock is not None
    return Result(
        scene=scene,
        num_ranks=1,
        group_size=1,
        components=components,
        directions=tuple(directions),
        receivers=receivers,
        places=places,
        region_names=("sand", "fill"),
        dt=dt,
        base_acceleration=base,
        lapses=tuple(
            _handed_over(
                scene,
                _lapse(
                    i, samples // lapses, dt, base, directions, places, loop, components, kind, rock
                ),
            )
            for i in range(lapses)
        ),
        sizes={"cells": _centroids(gdim, kind).shape[0], "unknowns": 60, "points": 56},
        work=Work(
            factorisations=240,
            solves=240,
            excited_lines=60 * lapses,
            inverse_mappings=0,
            assemblies={"elasticity": 8, "mass": 1},
            wall_s={"setup": 0.5, "assembly": 0.2, "sweep": 2.5, "response": 0.4},
        ),
        peak_memory=300 * 2**20,
    )


SLIDES = {"gravity": {"acceleration": 10.0}, "sliding": True, "convection": True}
AIR = [[20.0, 14.0], [40.0, 14.0], [40.0, 24.0], [20.0, 24.0]]
SLIPS = (0.0, 0.3, 0.1, 0.0)
SAMPLES = (60, 30, 60, 120)  # of a record of 240: a lapse is cut, and one goes on after the end


def make_slide(slips=SLIPS, yields=(0.1, 0.11, 0.12, 0.13), end_rate=0.0, gdim=2, **more):
    """A box that slides along +x in some lapses; in two dimensions with air in a corner.

    Slip grows as half a period of a cosine over each lapse, from rest to rest but for ``end_rate``
    [m/s]; the driving acceleration is a sine of 3 m/s^2, k_y g 1 m/s^2 and more. Lapse 0 finds cell
    0 empty besides.
    """
    soil = {"density": 1835.0, "shear_wave_velocity": 225.0, "poisson": 0.3, "cohesion": 2e4}
    if gdim == 2 and more.get("kind") != "column":
        size, cells = [40.0, 24.0], [20, 12]
        regions = [
            {"soil": "air", "polygon": AIR},
            {"soil": "sand", "below": 20.0},
            {"soil": "fill"},
        ]
        mesh = {"box": {"size": size, "cells": cells}, "regions": regions, "empty": ["air"]}
        more = {"mesh": mesh, **more}
    soils = {"soil": {"sand": soil, "fill": soil}}
    given = {"kind": "box", "loop": False, "effects": SLIDES, "receivers": 1, **soils}
    result = make_result(lapses=len(slips), gdim=gdim, **(given | more))
    lapses, start = [], 0
    for lapse, slip, k_y, count in zip(result.lapses, slips, yields, SAMPLES, strict=False):
        last = lapse.index == len(slips) - 1
        lapse = _resized(lapse, count, start)
        fill = np.ones(len(lapse.cells.region))
        fill[(lapse.cells.centroid[:, 0] > 20.0) & (lapse.cells.centroid[:, -1] > 14.0)] = 0.0
        fill[0] = float(lapse.index > 0)
        cells = replace(lapse.cells, fill=fill)
        record = _slip(lapse, slip, k_y, end_rate if last else 0.0)
        lapses.append(replace(lapse, cells=cells, slip=record))
        start += count
    base = result.base_acceleration
    base = np.pad(base, ((0, 0), (0, max(0, start - base.shape[1]))))
    return replace(result, lapses=tuple(lapses), base_acceleration=base)


def make_slide_snapshot(result, index, fields=False):
    """A point in the middle of every cell; those above 10 m move with the slip, up to 1 m ahead."""
    cells = result.lapses[index].cells
    gdim = cells.centroid.shape[1]
    start = cells.centroid[result.lapses[0].cells.fill > 0]
    came = sum(lapse.slip.slip[-1] for lapse in result.lapses[: index + 1])
    u = np.zeros_like(start)
    high = start[:, -1] > 10.0
    u[high, 0], u[high, -1] = came, -0.5 * came
    size = 2.0**gdim if gdim == 2 else 5.0 * 5.0 * 2.0
    points = {
        "position": start + u,
        "displacement": u,
        "volume": np.full(len(start), size),
        "id": np.arange(len(start)),
        "stress": np.outer(start[:, -1], np.arange(1.0, 3.0 * gdim - 2.0)),
        "g_over_gmax": np.ones(len(start)),
    }
    vertices, corners = _box_mesh(gdim)
    state = {"fill": cells.fill, "shear_modulus": cells.shear_modulus} if fields else {}
    kind = "quad" if gdim == 2 else "hexahedron"
    end = result.lapses[index].start_time + result.lapses[index].num_samples * result.dt
    at_vertices = {"displacement": vertices} if fields else {}
    return Snapshot(index, end, points, vertices, corners, kind, at_vertices, state, with_mesh=True)


def _slip(lapse, slip, k_y, end_rate):
    steps = 2 * lapse.num_samples + 1
    time = np.linspace(0.0, 1.0, steps)
    length = lapse.num_samples * lapse.dt
    rate = 0.5 * np.pi * slip / length * np.sin(np.pi * time)
    rate[[0, -1]] = 0.0, end_rate
    return SlipResult(
        yield_coefficient=k_y,
        factor_of_safety=1.5,
        direction="x",
        sense=1,
        time_step=0.5 * lapse.dt,
        slip=0.5 * slip * (1.0 - np.cos(np.pi * time)),
        rate=rate,
        driving=3.0 * np.sin(2.0 * np.pi * time),
        rigid=0.5 * slip,
        decoupled=2.0 * slip,
        mass=2e5,
        modal_mass=1.5e5,
        dissipation=4e5,
        shear_strain=0.01 * (1 + lapse.index) * np.arange(len(lapse.cells.region)),
        iterations=20 + lapse.index,
    )


def _resized(lapse, count, start):
    """A lapse of another length: cut, or with zeros after its end."""

    def fit(values):
        missing = max(0, count - values.shape[-1])
        return np.pad(values[..., :count], [(0, 0)] * (values.ndim - 1) + [(0, missing)])

    names = ("displacement", "velocity", "acceleration", "total_acceleration", "within")
    histories = {name: fit(getattr(lapse, name)) for name in names}
    return replace(lapse, num_samples=count, start_time=start * lapse.dt, **histories)


def _box_mesh(gdim):
    """Vertices and cells in VTK order of the boxes here, cells as their centroids are ordered."""
    grids = ([20, 12], [40.0, 24.0]) if gdim == 2 else ([8, 6, 12], [40.0, 30.0, 24.0])
    ticks = [np.linspace(0.0, size, n + 1) for n, size in zip(*grids, strict=True)]
    vertices = np.column_stack([a.ravel() for a in np.meshgrid(*ticks, indexing="ij")])
    number = np.arange(len(vertices)).reshape([n + 1 for n in grids[0]])
    square = ((0, 0), (1, 0), (1, 1), (0, 1))
    corners = square if gdim == 2 else [(*xy, z) for z in (0, 1) for xy in square]
    block = [number[tuple(slice(c, n + c) for c, n in zip(corner, grids[0], strict=True))].ravel()
             for corner in corners]  # fmt: skip
    return vertices, np.column_stack(block)


def make_snapshot(index=0, fields=True, gdim=2):
    """Four points in one cell, and the cell."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)[:, :gdim]
    points = {
        "position": 0.25 + 0.5 * corners,
        "displacement": 1e-3 * corners,
        "mass": np.full(4, 450.0),
        "id": np.arange(4),
    }
    if not fields:
        return Snapshot(index, 1.0, points)
    return Snapshot(
        index,
        1.0,
        points,
        vertices=corners,
        cells=np.array([[0, 1, 2, 3]]),
        cell_type="quad",
        vertex_fields={"displacement": 1e-3 * corners},
        cell_fields={"shear_modulus": np.array([9e7]), "damping": np.array([np.nan])},
    )


def _lapse(index, samples, dt, base, directions, places, loop, components, kind, rock):
    here = slice(index * samples, (index + 1) * samples)
    time = dt * np.arange(index * samples, (index + 1) * samples)
    gdim = places.shape[1]
    shape = (len(places), len(components), samples)
    u, total = np.zeros(shape), np.zeros(shape)
    acceleration = np.zeros(shape)
    frequency = np.arange(1, 61) / (samples * dt) * 2.0
    transfer = np.zeros((*shape[:2], len(directions), frequency.size), complex)
    for m, direction in enumerate(directions):
        c = components.index(direction)
        for r, place in enumerate(places):
            amplification = 1.0 + 1.5 * place[-1] / 24.0
            record = base[m, here]
            total[r, c] = amplification * record
            acceleration[r, c] = total[r, c] - record
            u[r, c] = 0.01 * (amplification - 1.0) * np.sin(2 * np.pi * 0.7 * time)
            ratio = frequency / 2.3
            transfer[r, c, m] = 1 + (amplification - 1) / (1 - ratio**2 + 0.2j * ratio)
    centroid = _centroids(gdim, kind)
    depth = 24.0 - centroid[:, -1]
    strain = 1e-4 * (1 + depth / 6.0) * (1.0 + 0.1 * index)
    ratio = 1.0 / (1.0 + strain / 1e-3) if loop else np.ones_like(strain)
    region = (centroid[:, -1] > 20.0).astype(np.int32)
    gmax = np.where(region == 1, 4e7, 9e7)
    return LapseResult(
        index=index,
        start_time=index * samples * dt,
        num_samples=samples,
        dt=dt,
        excited_lines=60,
        solved_lines=60,
        factorisations=240,
        solves=240,
        worst_residual=3e-13,
        loop=LoopHistory((0.5, 0.08, 0.011, 7e-4), (3, 3, 7, 7)) if loop else LoopHistory(),
        frequency=frequency,
        transfer=transfer,
        displacement=u,
        velocity=0.5 * u,
        acceleration=acceleration,
        total_acceleration=total,
        within=(0.7 if rock else 1.0) * base[:, here],
        outcrop=base[:, here] if rock else None,
        cells=CellState(
            region=region,
            centroid=centroid,
            shear_modulus=gmax * ratio,
            g_over_gmax=ratio,
            damping=0.01 + 0.1 * (1 - ratio) if loop else np.full_like(ratio, 0.02),
            effective_strain=(0.65 if loop else 1.0) * strain,
            peak_strain=strain,
            peak_stress=gmax * ratio * strain,
            peak_acceleration=2.0 + 3.0 * np.exp(-depth / 8.0),
            peak_velocity=0.4 * np.exp(-depth / 8.0),
            peak_displacement=0.02 * np.exp(-depth / 8.0),
            change=np.where(region == 1, 7e-4, 2e-4) if loop else np.zeros_like(ratio),
        ),
        seam_error=None,
        energy=None,
        ledger=MassLedger(56, 44_040.0, 0, 0.0, 0, 0.0, 0, 44_040.0, 0.0),
    )


def _handed_over(scene, lapse):
    """The lapse as its scene's continuity, law and degradation make it."""
    i, more = lapse.index, {}
    if scene.lapses.continuity == "transient":
        more["seam_error"] = 1e-4 * (1 + i % 3) if i else None
        if scene.solver.complex_modulus == "maxwell":
            stored = [0.0, *(100.0 * np.sin(0.3 * (1 + i)) ** 2 for i in range(i + 1))]
            rest, seam = (8.0 - 2.0 * i, 5.0 - i) if i else (0.0, 0.0)
            start, end = (stored[i] + seam, stored[i + 1])
            given = 400.0 * np.exp(-(((i - 2) / 3.0) ** 2))
            damping = given - rest - (end - start) - 1e-3
            kinetic, strain = (0.4 * start, 0.4 * end), (0.6 * start, 0.6 * end)
            more["energy"] = Energy(given, damping, rest, kinetic, strain, seam)
    if scene.effects.degradation is not None:
        index = np.where(lapse.cells.region == 1, 0.98**i, 1.0)
        modulus, ratio = (
            index * getattr(lapse.cells, name) for name in ("shear_modulus", "g_over_gmax")
        )
        cells = {"degradation": index, "shear_modulus": modulus, "g_over_gmax": ratio}
        more["cells"] = replace(lapse.cells, **cells)
    return replace(lapse, **more)


def _centroids(gdim, kind):
    if kind == "column":
        y = np.concatenate([1.0 + 2.0 * np.arange(10), 20.5 + np.arange(4)])
        return np.column_stack([np.full(y.size, 0.5), y])
    grids = ([20, 12], [40.0, 24.0]) if gdim == 2 else ([8, 6, 12], [40.0, 30.0, 24.0])
    centres = [(np.arange(n) + 0.5) * size / n for n, size in zip(*grids, strict=True)]
    return np.column_stack([a.ravel() for a in np.meshgrid(*centres, indexing="ij")])
