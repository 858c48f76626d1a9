# SPDX-License-Identifier: MIT
"""Scenes of ground that slides: a column on a weak cell, two slopes; and what slid of them."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import fenics_hytf.simulation.run as steps
from fenics_hytf.lapse import seed_points
from fenics_hytf.particles import take_out
from fenics_hytf.scene import Scene
from fenics_hytf.simulation import Result, simulate

GRAVITY = 9.81
DENSITY = 1800.0
_STRONG = 20.0  # strength of a column over that of its weak cell: it does not yield


def in_file(folder: Path, acceleration: npt.NDArray[np.float64], dt: float) -> dict:
    """A ``[[motion]]`` table along x of samples in m/s2."""
    file = folder / f"motion{len(list(folder.iterdir()))}.csv"
    np.savetxt(file, acceleration)
    return {"direction": "x", "file": str(file), "dt": dt, "units": "m/s2"}


def sine(cycles: int, samples: int, amplitude_g: float = 0.5, frequency: float = 1.0) -> dict:
    """A ``[[motion]]`` table of a sine whose inertia drives downslope, along x, first."""
    wave = {"amplitude": -amplitude_g * GRAVITY, "frequency": frequency}
    return {"direction": "x", "harmonic": wave | {"cycles": cycles, "samples": samples}}


def column(
    motion: dict,
    k_y: float,
    speed: float,
    *,
    height: float = 30.0,
    cells: int = 15,
    weak: float = 0.5,
    weak_density: float = DENSITY,
    damping: float = 0.0,
    rayleigh: dict | None = None,
    lapses: int = 1,
    sliding: dict | bool = True,
    base: dict | None = None,
) -> Scene:
    """A column above a weak cell of the same stiffness, on level ground.

    Args:
        motion: A ``[[motion]]`` table.
        k_y: Of the weak cell.
        speed: Shear wave velocity [m/s].
        height: Above the weak cell [m].
        cells: Over the height.
        weak: Height of the weak cell [m].
        weak_density: Its density [kg/m3].
        damping: Damping ratio.
        rayleigh: ``effects.rayleigh``.
        lapses: Their number.
        sliding: ``effects.sliding``.
        base: The rock of a compliant base.
    """
    strength = k_y * GRAVITY * (DENSITY * height + weak_density * weak / 2)
    soil = {"poisson": 0.3, "damping": damping, "shear_modulus": DENSITY * speed**2}
    effects: dict = {"gravity": {"acceleration": GRAVITY}, "sliding": sliding}
    layers = [
        {"thickness": height, "soil": "body", "cells": cells},
        {"thickness": weak, "soil": "weak", "cells": 1},
    ]
    return Scene.from_dict(
        {
            "mesh": {"column": {"width": 1.0, "layers": layers}},
            "soil": {
                "body": soil | {"density": DENSITY, "cohesion": _STRONG * strength},
                "weak": soil | {"density": weak_density, "cohesion": strength},
            },
            "motion": [motion | ({} if base is None else {"input": "outcrop"})],
            "boundary": {"left": "tied", "right": "tied"}
            | ({} if base is None else {"base": {"compliant": base}}),
            "lapses": {"count": lapses},
            "effects": effects | ({} if rayleigh is None else {"rayleigh": rayleigh}),
            "output": {"receivers": {"top": [0.5, height + weak]}},
        }
    )


def slope(cohesion: float = 16e3, lapses: int = 1, *, mirrored: bool = False, **effects) -> dict:
    """The raw scene of a slope of 4 m at 1:1.5 in squares of 1 m, shaken by 2 cycles of 2 Hz.

    Args:
        cohesion: Of its clay [Pa].
        lapses: Their number.
        mirrored: Whether it falls to the left.
        effects: ``[effects]`` besides gravity, sliding and locking.
    """
    width, surface = 24.0, [(0.0, 6.0), (8.0, 6.0), (14.0, 2.0), (24.0, 2.0)]
    air = [*surface, (width, 7.0), (0.0, 7.0)]
    motion = sine(2, 200, 0.3, 2.0)
    if mirrored:
        air = [(width - x, y) for x, y in reversed(air)]
        motion["harmonic"]["amplitude"] *= -1
    crest, toe = (width - x if mirrored else x for x in (6.0, 16.0))
    soil = {"density": DENSITY, "shear_wave_velocity": 120.0, "poisson": 0.4, "damping": 0.05}
    return {
        "mesh": {
            "box": {"size": [width, 7.0], "cells": [24, 7]},
            "empty": ["air"],
            "regions": [{"soil": "air", "polygon": air}, {"soil": "clay"}],
        },
        "soil": {"clay": soil | {"cohesion": cohesion}},
        "motion": [motion],
        "boundary": {"left": "roller", "right": "roller"},
        "lapses": {"count": lapses, "continuity": "transient"},
        "effects": {
            "gravity": {"acceleration": GRAVITY},
            "sliding": True,
            "locking": True,
            **effects,
        },
        "solver": {"complex_modulus": "maxwell"},
        "output": {"receivers": {"crest": [crest, 6.0], "toe": [toe, 2.0]}},
    }


def slope2d(motion: dict, lapses: int = 1, seam: float = 17e3, **effects) -> dict:
    """The raw scene of ``study.sliding_slope``: 10 m at 1:1.5 with a seam, in squares of 1 m.

    Args:
        motion: A ``[[motion]]`` table.
        lapses: Their number.
        seam: Cohesion of the seam [Pa].
        effects: ``[effects]`` besides gravity, sliding, locking and Rayleigh damping.
    """
    soil = {
        "density": DENSITY,
        "shear_wave_velocity": 200.0,
        "poisson": 28 / 62,  # a bulk modulus ten times the shear modulus
        "damping": 0.0,
    }
    regions = [
        {"soil": "clay", "below": 5.0},
        {"soil": "air", "polygon": [[0, 15], [60, 15], [60, 16], [0, 16]]},
        {"soil": "seam", "polygon": [[42, 2.6], [0, 15.2], [0, 17.8], [42, 5.2]]},
        {"soil": "clay"},
    ]
    return {
        "mesh": {
            "box": {"size": [60.0, 16.0], "cells": [60, 16]},
            "empty": ["air"],
            "points_per_cell": 16,
            "regions": regions,
        },
        "soil": {"clay": soil | {"cohesion": 150e3}, "seam": soil | {"cohesion": seam}},
        "motion": [motion],
        "boundary": {"left": "roller", "right": "roller"},
        "lapses": {"count": lapses},
        "effects": {
            "gravity": {"acceleration": GRAVITY},
            "sliding": True,
            "locking": True,
            "rayleigh": {"beta": 5e-4},
            **effects,
        },
        "output": {"receivers": {"crest": [15.0, 14.5]}},
    }


def simulate_slope2d(data: dict) -> Result:
    """Run ``slope2d`` with the cells that its surface cuts filled in part.

    Points above the surface are not seeded, nor those in cells that a fifth would not fill.
    """

    def below_the_surface(scene, domain, fields):
        points = seed_points(scene, domain, fields)
        above = points.x[:, 1] > 5 + np.clip((35 - points.x[:, 0]) / 1.5, 0, 10)
        share = np.bincount(points.cell, points.volume * ~above, domain.num_owned_cells)
        take_out(points, above | (share[points.cell] < 0.2), "delete")
        return points

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steps, "seed_points", below_the_surface)
        return simulate(Scene.from_dict(data))


def total(result: Result) -> float:
    """Slip of all lapses [m]."""
    return float(sum(lapse.slip.slip[-1] for lapse in result.lapses))


def open_energy(result: Result) -> float:
    """What the ledgers of all lapses leave, over the work of the base motion."""
    energies = [lapse.energy for lapse in result.lapses]
    return float(sum(e.imbalance for e in energies) / sum(e.input for e in energies))
