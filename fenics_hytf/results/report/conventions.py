# SPDX-License-Identifier: MIT
"""The method and its conventions in plain words, as they hold for one result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fenics_hytf.motion import GRAVITY
from fenics_hytf.results.report.markup import count, listed, number
from fenics_hytf.soil import HELD_DAMPING, RELAXATION_TIMES
from fenics_hytf.soil.maxwell import BAND

Summary = Mapping[str, Any]

_MODULUS = {
    "hysteretic": "G(1 + 2iD)",
    "kramer": "G(1 − D² + 2iD)",
    "shake91": "G(1 − 2D² + 2iD√(1 − D²))",
    "dormieux": "G(√(1 − 4D²) + 2iD)",
}

# Measured against the hysteretic law on columns of 2, 5 and 10 % damping.
_DISPERSION = (
    "Against the hysteretic law the peaks of a steady motion agree to 1 % in height, but modes 2 "
    "to 5 rise in frequency by 1–3 % at D = 2 %, 4–8 % at 5 % and 8–16 % at 10 %: a causal modulus "
    "grows with frequency."
)

_KINDS = {
    "rigid": "held to the input's motion",
    "fixed": "held to the input's motion",
    "roller": "held to the input's motion across the boundary and free along it",
    "tied": "tied to the opposite side, so that both move alike, as in level ground without end",
    "free": "free of stress",
    "dashpot": (
        "lined with dashpots (ρVp across and ρVs along the boundary) on the velocity relative to "
        "the input, which let waves out"
    ),
    "free_field": (
        "joined by dashpots to level ground of the same soil, a column solved along with the rest"
    ),
}


def method(summary: Summary) -> list[str]:
    """What was computed, and how, in a few paragraphs.

    Args:
        summary: ``summary.json``.

    Returns:
        Paragraphs of plain text.
    """
    parts = (_analysis, _soil, _modulus, _sliding, _softening, _base, _sides, _lines, _quantities)
    return [text for part in parts if (text := " ".join(part(summary)))]


def rock_words(rock: Mapping[str, float]) -> str:
    """The properties of the rock."""
    return (
        f"density {number(rock['density'], 5)} kg/m³, Vs {number(rock['shear_wave_velocity'], 4)} "
        f"m/s, Poisson's ratio {rock['poisson']:g}, damping {100 * rock['damping']:g} %"
    )


def _analysis(summary: Summary) -> Iterator[str]:
    lapses = summary["lapses"]
    yield (
        "The response of the ground is computed in the frequency domain: the motion is taken apart "
        "into its Fourier lines, the equations of motion of a finite-element mesh, whose mass is "
        "carried by material points, are solved for each line, and the lines are summed again."
    )
    if summary["scene"]["mesh"]["kinematics"] == "antiplane":
        yield "The section moves across its plane (SH waves)."
    lengths = sorted(lapse["samples"] * summary["dt_s"] for lapse in lapses)
    length = f"{lengths[0]:g}"
    scheme = summary["scene"]["scheme"]
    if len(lapses) == 1:
        yield (
            f"The analysed time of {length} s is taken as one period of a motion that repeats "
            "itself; quiet at its end lets the response die out."
            if scheme == "steady"
            else f"The analysed {length} s begin at rest."
        )
        return
    if summary["sliding"] is not None and lengths[-1] > lengths[0]:
        length += f" to {lengths[-1]:g}"
    yield (
        f"The motion is cut into {len(lapses)} lapses of {length} s. Stiffness and damping are "
        "constant within a lapse and found anew for the next."
    )
    yield {
        "steady": "Each lapse is taken as periodic, so nothing is carried from one to the next.",
        "handover": (
            "Lapses are transient: the first begins at rest, and displacement, velocity, stress "
            "and the memory of the soil at the end of one, carried by the material points, begin "
            "the next. Where moduli change at a seam the stress goes on without a jump; what the "
            "new moduli do not account for fades within about a second."
        ),
        "whole_record": (
            "Lapses are transient. Damping that does not depend on frequency cannot be stopped and "
            "started again, so in every lapse the response to the whole record is solved with the "
            "stiffness of the lapse; what displacement and velocity at the seam differ from it by "
            "goes on as a free vibration. That is exact while the stiffness stays the same."
        ),
    }[scheme]
    if "degradation" in summary["effects"]:
        yield (
            "Cycles of shear strain counted in a lapse lower the shear modulus from the next on "
            "(Idriss, Dobry and Singh, 1978; Matasovic and Vucetic, 1995)."
        )
    if "convection" in summary["effects"]:
        yield "Between lapses the material points move with the ground."


def _soil(summary: Summary) -> Iterator[str]:
    scene = summary["scene"]
    if scene["strain_ratio"] is None:
        yield (
            "The soil is linear: it keeps the shear modulus and the damping ratio of the table"
            + (", but for what cycles leave of the modulus." if scene["degradation"] else ".")
        )
        return
    ratio = f"{scene['strain_ratio']:g}"
    if scene["magnitude"] is not None:
        magnitude = f"{scene['magnitude']:g}"
        ratio += f" (from the magnitude, (M − 1)/10 with M = {magnitude}; Idriss and Sun, 1992)"
    yield (
        "The soil is equivalent linear (Seed and Idriss, 1969): in every cell the shear modulus G "
        "and the damping ratio D are read from the soil's curves at the effective shear strain, "
        f"{ratio} times the largest one at the cell's centre, and the motion is solved again until "
        f"neither changes by more than {100 * scene['loop_tolerance']:g} % in any cell."
    )
    yield f"Shear strain is {_strain_measure(summary)}."


def _strain_measure(summary: Summary) -> str:
    scene = summary["scene"]
    if scene["mesh"]["kinematics"] == "antiplane":
        return "√(γxz² + γyz²)"
    if len(summary["components"]) == 2 and scene["strain_measure"] == "plane":
        column = scene["mesh"]["kind"] == "column"
        return "√((εx − εy)² + γxy²)" + (", |γxy| in a column sheared along x" if column else "")
    return "the largest difference between principal strains"


def _modulus(summary: Summary) -> Iterator[str]:
    scene = summary["scene"]
    solver = scene["solver"]
    name = solver["complex_modulus"]
    if name == "maxwell":
        yield from _maxwell(scene)
    else:
        yield (
            "Damping does not depend on frequency: it enters through the complex shear modulus "
            f"G* = {_MODULUS.get(name, name)}, the convention named {name}."
        )
    yield (
        "The factor G*/G multiplies all elastic constants, so Poisson's ratio is kept."
        if solver["keep"] == "poisson"
        else "It takes the place of G only; the bulk modulus is kept and has no damping."
    )
    if scene["rayleigh"] is not None:
        alpha, beta = scene["rayleigh"]["alpha"], scene["rayleigh"]["beta"]
        yield f"Viscous damping C = αM + βK is added, α = {alpha:g} 1/s and β = {beta:g} s."


def _maxwell(scene: Mapping[str, Any]) -> Iterator[str]:
    frequency = scene["solver"]["reference_frequency"]
    low, high = BAND
    yield (
        "Damping is that of a causal law with memory, a spring beside four Maxwell branches: "
        f"G* = G_r(1 + Σ a_m sτ_m/(1 + sτ_m)), τ = {listed([f'{t:g}' for t in RELAXATION_TIMES])} "
        f"s, fitted so that the loss factor is 2D from {low:g} to {high:g} Hz, and such that the "
        f"real part of the modulus is G at the reference frequency of {number(frequency)} Hz."
    )
    yield _DISPERSION
    yield f"Above D = {HELD_DAMPING:g} four branches no longer hold the loss factor."
    if scene["rock"] is not None:
        yield "The dashpots of the base are real, ρV: damping in the rock is left out."


def _sliding(summary: Summary) -> Iterator[str]:
    settings = summary["scene"]["sliding"]
    if settings is None:
        return
    yield (
        "Permanent displacement is that of a mechanism: the flow of the ground that yields first "
        "under its weight and a push downslope of k_y times its weight, found for every lapse by "
        "iterations with a secant modulus (linear matching; Ponter and Carter, 1997). Shear "
        "strength is that of Mohr and Coulomb under the mean stress as the lapse begins; flow "
        "keeps its volume. k_y is an upper bound, and so is the factor of safety at rest, sought "
        "in the same way. In a lapse the ground moves by its vibration and by the slip λ(t) of the "
        "mechanism, λ being the displacement of the place that moves farthest. It slips, one way, "
        "whenever the force that drives it would exceed what it yields under, and its slip acts "
        f"back on the vibration, in steps of {1e3 * settings['time_step']:g} ms at most."
    )
    if "convection" in summary["effects"]:
        yield (
            "A lapse ends early, and a new mechanism is sought, where the slip in it comes to "
            f"{settings['new_mechanism']:g} of the smallest edge of a cell."
        )
    yield (
        "Lapses go on after the motion until nothing slips, for at most "
        f"{settings['longest']:g} s. Mechanisms that compete, go back and forth or eat their way "
        "upslope are not in the method, nor is pore pressure. PGD, which takes the motion as one "
        "that repeats itself, says nothing about ground that slides: its displacement is in the "
        "table of peaks."
    )


def _softening(summary: Summary) -> Iterator[str]:
    if not summary["scene"]["softening"]:
        return
    yield (
        "Permanent displacement is estimated from the reduction of stiffness (Lee, 1974; Serff et "
        "al., 1976): where a lapse ends with a lower modulus than any before it, the deviator of "
        "the static stress falls with the modulus, and the softened ground bears elastically what "
        "is lacking, its bulk modulus that of small strain. In an infinite slope that is the shear "
        "strain τ₀(1/G_min − 1/G₀), however many lapses it took. Shaking that brings no lower "
        "modulus adds nothing, whatever it would do to a slope that slides: strength and the "
        "length of shaking are not in the estimate. Nothing of it acts on the vibration"
        + (", but that points move." if "convection" in summary["effects"] else ".")
    )


def _base(summary: Summary) -> Iterator[str]:
    rock = summary["scene"]["rock"]
    given = summary["motions"][0]["input"]
    if rock is None:
        yield (
            "The base is rigid. The input is a within motion: the total motion of the base, under "
            "the soil."
        )
        return
    if given == "outcrop":
        yield (
            "The base is compliant: the ground stands on a half-space of rock "
            f"({rock_words(rock)}), which takes up the waves that come down. The input is an "
            "outcrop motion: that of the surface of the bare rock, twice the wave that comes up. "
            "The within motion, that of the base under the soil, is part of the result."
        )
        return
    yield (
        "The input is a within motion, that of the base under the soil, and the base is held to it."
    )
    if any(base["outcrop_pga_g"] is not None for base in summary["base"].values()):
        yield (
            f"The rock below ({rock_words(rock)}) serves to find the outcrop motion that belongs "
            "to it: that of the surface of the bare rock, twice the wave that comes up."
        )


def _sides(summary: Summary) -> Iterator[str]:
    by_kind: dict[str, list[str]] = {}
    for name, kind in summary["scene"]["boundary"].items():
        if name != "base":
            by_kind.setdefault(kind, []).append(name)
    held = [f"{listed(names)} {_KINDS.get(kind, kind)}" for kind, names in by_kind.items()]
    if held:
        yield f"The other boundaries: {'; '.join(held)}."
    if summary["scene"]["mesh"]["kind"] == "file":
        yield "Boundaries that the scene does not name are free of stress."
    calm = summary["scene"]["calm"]
    if calm is not None:
        yield (
            f"Along {listed(calm['sides'])} a layer {calm['thickness']:g} m thick absorbs waves: "
            f"damping grows by up to {calm['damping']:g} towards the side."
        )


def _lines(summary: Summary) -> Iterator[str]:
    lapses, solver = summary["lapses"], summary["scene"]["solver"]
    solved, excited = (sum(lapse[f"{w}_lines"] for lapse in lapses) for w in ("solved", "excited"))
    spacing = 1.0 / (lapses[0]["samples"] * summary["dt_s"])
    limit = solver["max_frequency"]
    nyquist = f"{0.5 / summary['dt_s']:g} Hz, the Nyquist frequency"
    highest = nyquist if limit is None else f"{limit:g} Hz"
    contour = summary["scene"]["contour"]
    if contour is not None:
        yield _contour_words(summary, contour, highest)
        return
    threshold = f"{solver['excited']:g}".replace("e-0", "e-")
    yield (
        f"{count(excited, 'Fourier line')} {'carries' if excited == 1 else 'carry'} more than "
        f"{threshold} of the spectrum's peak; {'all' if solved == excited else solved} of them, "
        f"up to {highest}, {'was' if solved == 1 else 'were'} solved. Lines are {spacing:.3g} Hz "
        "apart; the others count as zero in the input and in the response alike."
    )


def _contour_words(summary: Summary, contour: Mapping[str, float], highest: str) -> str:
    each = summary["lapses"][0]["solved_lines"]
    return (
        "Lines lie on a damped contour, the complex frequencies s = η + iω with η = "
        f"{contour['eta_1_s']:.3g} 1/s; all {each} of them, up to {highest}, were solved"
        + (" in each lapse" if len(summary["lapses"]) > 1 else "")
        + f". They are {1.0 / contour['period_s']:.3g} Hz apart, and e^(ηt) undoes the damping in "
        "time. "
        "Transfer functions are those on the contour: their peaks are lower and wider than those "
        "of a steady motion, iω, and not to be compared with them."
    )


def _quantities(summary: Summary) -> Iterator[str]:
    water = summary["scene"]["water_table_m"]
    yield (
        f"Relative motions are relative to the base; total ones include it. 1 g = {GRAVITY} m/s². "
        "PGV and PGD are peaks of the total motion, integrated in the frequency domain. Arias "
        "intensity is π/(2g)∫a²dt, CAV is ∫|a|dt, and D5-95 the time in which the Arias intensity "
        "grows from 5 to 95 %."
    )
    if summary["scene"]["mesh"]["kind"] == "file":
        return
    yield (
        "The stress ratio is the peak shear stress over the "
        + ("total" if water is None else "effective")
        + " vertical stress, the weight of the soil above"
        + (
            "."
            if water is None
            else f" less the pore pressure below the water table at elevation {water:g} m "
            "(9.81 kN/m³)."
        )
    )
