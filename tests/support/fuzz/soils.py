# SPDX-License-Identifier: MIT
"""Soils by chance: every kind of modulus and of curves, strength, stress at rest."""

from typing import Any

from hypothesis import strategies as st

from fenics_hytf.soil import CURVE_MODELS
from support.fuzz.records import Files, numbers

_STRAINS = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2]
_FIXED = ("seed_idriss_1970_mean", "idriss_1990_clay", "epri_1993_20_50ft", "gei_1983_0_50ft")


@st.composite
def soils(
    draw: st.DrawFn, curved: bool, strong: bool, most_damping: float, files: Files, name: str
) -> dict[str, Any]:
    """A soil.

    Args:
        draw: From hypothesis.
        curved: Whether it has curves for sure.
        strong: Whether it has a strength for sure.
        most_damping: Damping ratios stay below [-].
        files: Where curves that it names are put.
        name: Of the file of curves.

    Returns:
        Table ``[soil.NAME]``.
    """
    density, velocity = draw(numbers(1200, 2400)), draw(numbers(90, 700))
    table: dict[str, Any] = {
        "density": density,
        "poisson": draw(st.one_of(numbers(0.0, 0.45), st.sampled_from((0.0, 0.49, 0.499)))),
    }
    modulus = density * velocity**2
    kind = draw(st.sampled_from(("shear_wave_velocity", "shear_modulus", "youngs_modulus")))
    factor = {"shear_modulus": modulus, "youngs_modulus": 2.5 * modulus}
    table[kind] = factor.get(kind, velocity)
    if draw(st.booleans()):
        table["damping"] = draw(numbers(0, min(0.3, most_damping)))
    if curved or draw(st.integers(0, 3)) == 0:
        table["curves"] = draw(_curves(most_damping, files, name))
    if strong or draw(st.integers(0, 4)) == 0:
        strength = draw(st.sampled_from(("cohesion", "friction_angle", "both")))
        if strength != "friction_angle":
            table["cohesion"] = draw(numbers(2e4, 2e5))
        if strength != "cohesion":
            table["friction_angle"] = draw(numbers(5, 50))
    if draw(st.integers(0, 4)) == 0:
        table["k0"] = draw(numbers(0.2, 2))
    return table


@st.composite
def _curves(draw: st.DrawFn, most_damping: float, files: Files, name: str) -> dict[str, Any]:
    kind = draw(st.sampled_from(("table", "file", "fixed", "model")))
    modulus = sorted((draw(numbers(0.05, 1)) for _ in _STRAINS), reverse=True)
    damping = sorted(draw(numbers(0, min(0.25, most_damping))) for _ in _STRAINS)
    if kind == "file":
        rows = (f"{s},{m},{d}" for s, m, d in zip(_STRAINS, modulus, damping, strict=True))
        files[name] = ("strain,modulus,damping\n" + "\n".join(rows) + "\n").encode()
        table: dict[str, Any] = {"file": name}
    elif kind == "table":
        table = {"strain": _STRAINS, "modulus": modulus, "damping": damping}
    elif kind == "fixed":
        table = {"model": draw(st.sampled_from(_FIXED))}
    else:
        table = draw(_models(most_damping))
    # Stress need not grow along a curve that is drawn point by point.
    if "model" in table and draw(st.integers(0, 4)) == 0:
        table["shear_strength"] = draw(numbers(5e3, 2e5))
    return table


@st.composite
def _models(draw: st.DrawFn, most_damping: float) -> dict[str, Any]:
    """A model with parameters; damping after Masing comes to 2/π, that of the others to 0.4."""
    with_parameters = {
        "darendeli": {
            "plasticity_index": numbers(0, 60),
            "mean_stress": numbers(1e4, 4e5),
            "ocr": numbers(1, 4),
        },
        "menq": {
            "uniformity_coefficient": numbers(1.2, 10),
            "d50": numbers(0.1, 5),
            "mean_stress": numbers(2e4, 4e5),
        },
        "ishibashi_zhang": {"plasticity_index": numbers(0, 60), "mean_stress": numbers(1e4, 4e5)},
        "vucetic_dobry_1991": {"plasticity_index": numbers(0, 200)},
        "epri_1993_pi": {"plasticity_index": numbers(10, 70)},
        "hardin_drnevich": {
            "reference_strain": numbers(1e-4, 1e-2),
            "max_damping": numbers(0.05, 0.3),
        },
        "mkz": {"reference_strain": numbers(1e-3, 1e-2), "curvature": numbers(0.6, 1.1)},
    }
    if most_damping < 0.64:
        del with_parameters["mkz"]
    model = draw(st.sampled_from(sorted(with_parameters.keys() & CURVE_MODELS.keys())))
    return {"model": model} | {k: draw(v) for k, v in with_parameters[model].items()}
