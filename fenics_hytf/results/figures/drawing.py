# SPDX-License-Identifier: MIT
"""All figures of a stored result: which apply, in which order, and what is said below them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from matplotlib.figure import Figure

from fenics_hytf.results.figures import style
from fenics_hytf.results.figures.animation import animate
from fenics_hytf.results.figures.convergence import convergence
from fenics_hytf.results.figures.energy import energy_balance
from fenics_hytf.results.figures.histories import base_motions, histories
from fenics_hytf.results.figures.plane import plane_of
from fenics_hytf.results.figures.profiles import caption, peak_profiles, profiles
from fenics_hytf.results.figures.section import section
from fenics_hytf.results.figures.shown import (
    has_outcrop,
    has_transfer,
    input_kind,
    left_out,
    on_contour,
    seams,
    shown_components,
    solved_band,
    without_slip,
)
from fenics_hytf.results.figures.slip import slip_caption, slip_history
from fenics_hytf.results.figures.slope import (
    RUN_OUT_CAPTION,
    deformed,
    mechanism,
    mechanism_caption,
    moves,
    run_out,
)
from fenics_hytf.results.figures.spectra import (
    fourier_amplitudes,
    response_spectra,
    transfer_functions,
)
from fenics_hytf.results.figures.stiffness import stiffness, stiffness_caption
from fenics_hytf.results.reader import StoredResult


@dataclass(frozen=True)
class Drawing:
    """A figure, and what is said about it.

    Attributes:
        file: Its name in the result folder.
        title: Heading.
        caption: What it shows, and how to read it.
        part: Where it belongs in the report: ``base``, ``motion``, ``sliding``, ``ground``,
            ``seams`` or ``loop``.
        picture: Content of the file; empty until it is drawn.
    """

    file: str
    title: str
    caption: str
    part: str
    picture: bytes = b""


ANIMATION = Drawing(
    "points.gif",
    "The points as they slide",
    "A frame for every lapse after which points were written; many are thinned.",
    "sliding",
)


def draw_figures(stored: StoredResult) -> list[Drawing]:
    """Draw every figure that the result has data for; nothing is written.

    Args:
        stored: The result.

    Returns:
        The figures with their pictures, in reading order.
    """
    drawings = []
    with style.figure_style():
        for figure, drawing in all_figures(stored):
            drawings.append(replace(drawing, picture=style.png(figure)))
        plane = plane_of(stored)
        if plane is not None and moves(stored):
            drawings.append(replace(ANIMATION, picture=animate(stored, plane)))
    return drawings


def all_figures(stored: StoredResult) -> Iterator[tuple[Figure, Drawing]]:
    """Every figure that the result has data for, in reading order.

    Args:
        stored: The result.

    Yields:
        The figure, to be drawn in the package's style, and what to say about it.
    """
    if has_outcrop(stored):
        for direction in stored.summary["directions"]:
            yield _base(stored, direction)
    components = shown_components(stored)
    for component in components:
        yield _histories(stored, component)
    for component in components:
        yield _response_spectra(stored, component)
    for component in components:
        for direction in stored.summary["directions"]:
            if has_transfer(stored, component, direction):
                yield _transfer(stored, component, direction)
    band = solved_band(stored)
    if band is not None:
        for component in components:
            yield _fourier(stored, component, band)
    if stored.slip is not None:
        yield from _sliding(stored)
    yield from _ground(stored)
    if stored.summary["energy"] is not None:
        yield _energy(stored)
    if any(lapse["change"] for lapse in stored.summary["lapses"]):
        text = (
            "Largest change over all cells of the shear modulus or of the damping ratio from one "
            "iteration to the next, relative."
        )
        title = "Convergence of the equivalent-linear loop"
        yield convergence(stored), Drawing("convergence.png", title, text, "loop")


def _base(stored: StoredResult, direction: str) -> tuple[Figure, Drawing]:
    text = (
        "Outcrop: the motion at the surface of the bare rock; within: the motion of the base, "
        "under the soil. Right: 5 % damped pseudo-acceleration of both."
    )
    drawing = Drawing(f"base_{direction}.png", f"Motion of the base, {direction}", text, "base")
    return base_motions(stored, direction), drawing


def _histories(stored: StoredResult, component: str) -> tuple[Figure, Drawing]:
    text = (
        "Left: total acceleration; right: displacement relative to the base. All panels of a "
        "column share one scale; a dot and a number mark the peak. The input is shown as far as "
        f"its lines were solved.{_seams(stored)}{left_out(stored)}"
    )
    title = f"Time histories, {component}"
    return histories(stored, component), Drawing(
        f"histories_{component}.png", title, text, "motion"
    )


def _response_spectra(stored: StoredResult, component: str) -> tuple[Figure, Drawing]:
    text = "Pseudo-acceleration of a 5 % damped oscillator under the total acceleration"
    title = f"Response spectra, {component}"
    if input_kind(stored, component) is None:
        text += "."
    else:
        text += "; below, its ratio to the input's. The input is taken as far as it was solved."
        title = f"Response spectra and amplification, {component}"
    return response_spectra(stored, component), Drawing(
        f"spectra_{component}.png", title, text + left_out(stored), "motion"
    )


def _transfer(stored: StoredResult, component: str, direction: str) -> tuple[Figure, Drawing]:
    several = len(stored.summary["directions"]) > 1
    kind = input_kind(stored, direction)
    text = (
        f"Amplitude of total acceleration over the input as given ({kind}), on the lines that were "
        f"solved{on_contour(stored)}.{_which_lapse(stored)}{left_out(stored)}"
    )
    name = f"transfer_{component}{'_' + direction if several else ''}.png"
    title = f"Transfer function, {component} over input {direction}"
    return transfer_functions(stored, component, direction), Drawing(name, title, text, "motion")


def _fourier(
    stored: StoredResult, component: str, band: tuple[float, float]
) -> tuple[Figure, Drawing]:
    text = (
        "Amplitude of the Fourier integral of total acceleration, smoothed by the window of Konno "
        f"and Ohmachi (1998) with b = 40.{left_out(stored)}"
    )
    title = f"Fourier amplitude, {component}"
    return fourier_amplitudes(stored, component, band), Drawing(
        f"fourier_{component}.png", title, text, "motion"
    )


def _sliding(stored: StoredResult) -> Iterator[tuple[Figure, Drawing]]:
    """The mechanism, the slip, and the ground that has moved with it."""
    plane = plane_of(stored)
    if plane is not None:
        drawing = Drawing("mechanism.png", "Mechanism", mechanism_caption(stored), "sliding")
        yield mechanism(stored, plane), drawing
    drawing = Drawing("slip.png", "Slip over time", slip_caption(stored), "sliding")
    yield slip_history(stored), drawing
    if plane is None or not moves(stored):
        return
    text = "Material points where they came to, as large as the soil they stand for, over the mesh."
    drawing = Drawing("deformed.png", "Ground that has slid", text, "sliding")
    yield deformed(stored, plane), drawing
    yield run_out(stored, plane), Drawing("runout.png", "Run-out", RUN_OUT_CAPTION, "sliding")


def _ground(stored: StoredResult) -> Iterator[tuple[Figure, Drawing]]:
    """Profiles and maps of what the ground went through."""
    how = caption(stored)
    text = "Peak of the total acceleration, peak shear strain, and the soil's state that fits it."
    text += how + without_slip(stored)
    yield profiles(stored), Drawing("profiles.png", "Profiles", text, "ground")
    text = "Peaks of velocity and displacement relative to the base, and of shear stress."
    if stored.slip is not None:
        text += " Displacement holds the slip of one lapse, not of those before."
    title = "Profiles of further peaks"
    yield peak_profiles(stored), Drawing("profiles_peaks.png", title, text + how, "ground")
    maps = section(stored)
    if maps is not None:
        text = "Cell values contoured between the cells' centres."
        if len(stored.summary["lapses"]) > 1:
            text += " Over all lapses: the largest, of G/Gmax the smallest."
        text += without_slip(stored)
        yield maps, Drawing("section.png", "Section", text, "ground")
    softened = stiffness(stored)
    if softened is not None:
        text = stiffness_caption(stored)
        yield softened, Drawing("stiffness.png", "Stiffness from lapse to lapse", text, "ground")


def _energy(stored: StoredResult) -> tuple[Figure, Drawing]:
    text = (
        "Input is the work of the base's acceleration on the mass that moves relative to it. "
        "Summed up to the end of each lapse, straight in between."
    )
    if stored.slip is not None:
        text += (
            " A mechanism that slips takes Q_y λ more than gravity brings it; where it yields "
            "under its weight alone gravity brings more than it takes."
        )
    if len(stored.summary["lapses"]) > 1:
        text += (
            " Where moduli change at a seam the energy in the springs jumps, and stress that the "
            "new moduli do not account for does work while it fades: input and these make what is "
            "lost and stored. Below: both, lapse by lapse, and what does not close."
        )
    return energy_balance(stored), Drawing("energy.png", "Energy", text, "seams")


def _seams(stored: StoredResult) -> str:
    if not seams(stored):
        return ""
    text = " Vertical lines mark the seams between lapses."
    if stored.summary["scene"]["continuity"] == "steady":
        text += " Each lapse is a periodic state of its own, so curves may jump there."
    return text


def _which_lapse(stored: StoredResult) -> str:
    count = len(stored.summary["lapses"])
    return f" The last of {count} lapses is shown." if count > 1 else ""
