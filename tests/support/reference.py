# SPDX-License-Identifier: MIT
"""Reference columns: the data, the scenes that repeat them, and closed forms."""

import json
from pathlib import Path

import numpy as np
import pytest

from fenics_hytf.scene import Scene

DATA = Path(__file__).parents[1] / "data"
SHARED = Path(__file__).parents[3] / "shared" / "reference" / "ground"
PUBLISHED = SHARED.parent / "published"
SLIDING = SHARED.parent / "sliding"
G0 = 9.80665


def load(name: str) -> dict:
    """A case: from tests/data, or, where it holds a recorded motion, from beside the checkout."""
    for folder in (DATA, SHARED):
        if (folder / f"{name}.json").exists():
            return json.loads((folder / f"{name}.json").read_text())
    if SHARED.exists():
        pytest.fail(f"{name}: {SHARED} is there, but not this case")
    pytest.skip(f"{name} holds a recorded motion and is not in the repository")


def load_sliding(name: str) -> dict:
    """A file of slips in the time domain, where the reference data are beside the checkout."""
    if not SLIDING.exists():
        pytest.skip(f"{name} is beside the repository, not in it")
    return json.loads((SLIDING / f"{name}.json").read_text())


def slope2d_case(motion: str) -> dict:
    """What ``slope2d`` has for a motion of ``study.sliding_slope``."""
    (case,) = (c for c in load_sliding("slope2d")["cases"] if c["motion"].startswith(motion))
    return case


def motion(case: dict) -> dict:
    given = case["motion"]
    table = {"direction": "x", "pga": given["pga_g"], "input": case.get("base_input", "within")}
    if given["kind"] == "synthetic":
        parameters = {k: v for k, v in given["parameters"].items() if k != "golden"}
        return table | {"synthetic": parameters}
    return table | {"file": str(SHARED / "motions" / "NIS090.AT2")}


def rock(case: dict) -> dict:
    """The compliant base of a case."""
    half_space = case["profile"]["halfspace"]
    return {
        "density": half_space["density_kg_m3"],
        "shear_wave_velocity": half_space["vs_m_s"],
        "damping": half_space["damping"],
        "poisson": 0.25,  # not used under shear
    }


def comb(path: Path, lines: np.ndarray, num_samples: int, dt: float) -> dict:
    """A record that excites some lines alike, multiples of 1/(num_samples dt) Hz, and no other.

    Args:
        path: Where the CSV file is written.
        lines: Their numbers; none is the last one of an even number of samples.
        num_samples: Samples.
        dt: Time step [s].

    Returns:
        A ``[[motion]]`` table without a direction.
    """
    spectrum = np.zeros(num_samples // 2 + 1)
    spectrum[lines] = num_samples / len(lines)
    np.savetxt(path, np.fft.irfft(spectrum, num_samples))
    return {"file": str(path), "dt": dt, "units": "m/s2"}


def column(
    case: dict,
    motion: dict,
    *,
    cell: float | None = None,
    cells: int = 1,
    duration: float,
    equivalent_linear: dict | None = None,
    convention: str = "dormieux",
    sweep: str = "direct",
) -> Scene:
    """The scene that repeats a case with degree-2 cells, ``cell`` metres or ``cells`` a layer."""
    layers, soils = [], {}
    for number, layer in enumerate(case["profile"]["layers_top_down"]):
        name = f"layer{number:02d}"
        soils[name] = {
            "density": layer["density_kg_m3"],
            "shear_wave_velocity": layer["vs_m_s"],
            "poisson": 0.3,
        }
        if "curve" in layer:
            curve = case["curves"][layer["curve"]]
            soils[name]["curves"] = {
                "strain": curve["strain"],
                "modulus": curve["G_over_Gmax"],
                "damping": curve["damping"],
            }
        else:
            soils[name]["damping"] = layer["damping"]
        thickness = layer["thickness_m"]
        count = cells if cell is None else round(thickness / cell)
        layers.append({"thickness": thickness, "soil": name, "cells": count})
    height = sum(layer["thickness"] for layer in layers)
    effects = {"equivalent_linear": equivalent_linear} if equivalent_linear else {}
    base = {"base": {"compliant": rock(case)}} if motion.get("input") == "outcrop" else {}
    return Scene.from_dict(
        {
            "mesh": {"column": {"width": 1.0, "layers": layers}, "degree": 2},
            "soil": soils,
            "motion": [motion],
            "boundary": {"left": "tied", "right": "tied"} | base,
            "lapses": {"duration": duration},
            "effects": effects,
            "solver": {"complex_modulus": convention, "sweep": sweep},
            "output": {"receivers": {"surface": [0.5, height]}},
        }
    )


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def two_layer_transfer(
    omega: np.ndarray,
    thickness: tuple[float, float],
    density: tuple[float, float],
    modulus: tuple[complex, complex],
) -> np.ndarray:
    """Total motion of the top over that of the base, upper layer first (one-dimensional waves)."""
    speed = np.sqrt(np.asarray(modulus, complex) / density)
    upper, lower = (omega * h / v for h, v in zip(thickness, speed, strict=True))
    impedance = density[0] * speed[0] / (density[1] * speed[1])
    return 1 / (np.cos(upper) * np.cos(lower) - impedance * np.sin(upper) * np.sin(lower))
