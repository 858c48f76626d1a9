# SPDX-License-Identifier: MIT
"""How near a scene lies to the edge of what the stability maps show to be sound.

The maps are made by ``hytf stability`` and kept in ``demos/``, with every run in
``demos/stability.csv``. The limits below are read off them: within, every run converges. What a
run makes of its moduli cannot be known before it; what is said of them is a guess.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fenics_hytf.domain import Domain
from fenics_hytf.lapse import asked_residual
from fenics_hytf.scene import ABOVE_BAND, PERIODS, Scene, Solver, motion_band

NEAR_PERIODS = 1.4 * PERIODS
"""Length of a lapse times the highest frequency below which a scene is near the edge [-].

Columns without damping drift at 5, and are off by 0.2 % of the peak at 10, the rule. From 14 on ηT
may be smaller by 30 % or larger by 39 % than that of a run, and all are right to 0.3 %.
"""
NEAR_BAND = 1.4 * ABOVE_BAND
"""Highest frequency over the motion's band below which a scene is near the edge [-]."""
NEAR_FRACTION = 0.1
"""Share of the shear modulus that is left where lapses begin to pump energy as moduli swing [-]."""
PUMPED = 2.0
"""Energy that changes of the moduli bring over that which comes in at the base [-].

With more it is no longer the shaking that moves the ground, be its motion true or not. Within the
rules, moduli that fall bring up to 1.2, as stress that goes on strains softer ground more; moduli
that swing to a hundredth and back bring 8 and more.
"""
NEAR_WAVES = 20.0
"""Cells in a shear wave's length below which a mesh that points leave is near the edge [-]."""
DEFAULT_TOLERANCE = float(Solver.model_fields["tolerance"].default)
"""Residual that a scene asks for by default [-]."""
_RESIDUAL = 1e-13
"""Residual over contrast that sweeps leave where stiff ground rides on soft [-].

True solutions in doubles leave up to 1e-14, direct sweeps 7 times and reduced ones 10 times that.
"""
_SAFETY = 3.0
"""Contrast at which sweeps stop over that from which a scene is near the edge [-]."""

_MAP = "near the edge of the stability map ({}): "


def kept_map(name: str) -> str:
    """Where one of the maps is found, in words for users: ``demos`` travels with the package."""
    return f"`hytf stability` draws it, kept as demos/stability_{name}.png"


def near_contrast(tolerance: float, transient: bool, sweep: str) -> float:
    """Contrast from which a scene is near the edge.

    Args:
        tolerance: The scene's [-].
        transient: Whether lapses are.
        sweep: ``direct`` or ``reduced``.

    Returns:
        Shear modulus of the stiffest ground over that of the softest [-].
    """
    return asked_residual(tolerance, transient, sweep) / (_SAFETY * _RESIDUAL)


def edge_notes(scene: Scene, domain: Domain) -> Iterator[str]:
    """What a user should know of a scene that lies near an edge (collective).

    Args:
        scene: The scene.
        domain: Its domain.

    Yields:
        Each with what was found, what is sound, and what to do.
    """
    if len(scene.segments) > 1 and scene.lapses.continuity == "transient":
        yield from _lapse_notes(scene)
        yield from _swing_notes(scene, domain.region_names)
    yield from _contrast_notes(scene, domain.region_names)
    if scene.mesh.empty:
        yield from _cut_notes(scene, domain)


def _lapse_notes(scene: Scene) -> Iterator[str]:
    """Lapses that are short, or cut low."""
    nyquist = 0.5 / scene.dt
    highest = min(scene.solver.max_frequency or nyquist, nyquist)
    length = scene.segments[0].num_samples * scene.dt
    if highest * length < NEAR_PERIODS:
        yield (
            f"{_MAP.format(kept_map('lapses'))}lapses of {length:g} s hold "
            f"{highest * length:.3g} periods of the highest line, {highest:.3g} Hz; from "
            f"{NEAR_PERIODS:g} periods on errors stay small whatever the damping: take lapses of "
            f"{NEAR_PERIODS / highest:.3g} s or more"
        )
    band = motion_band(scene.motion)
    if highest < min(NEAR_BAND * band, nyquist * (1 - 1e-9)):
        yield (
            f"{_MAP.format(kept_map('max_frequency'))}solver.max_frequency is {highest:.3g} Hz, "
            f"{highest / band:.3g} times the band of the motion; take "
            f"{min(NEAR_BAND * band, nyquist):.3g} Hz or more"
        )


def _swing_notes(scene: Scene, soils: tuple[str, ...]) -> Iterator[str]:
    """Soils that may soften in one lapse and stiffen in the next."""
    loop = scene.effects.equivalent_linear
    if loop is None:
        return
    velocity = max(float(np.abs(m.record.velocity()).max()) for m in scene.motion)
    for name in soils:
        curve = scene.soil[name].curve
        if curve is None:
            continue
        speed = scene.soil[name].elastic.shear_wave_velocity
        strain = loop.strain_ratio * velocity / speed
        left = float(curve.evaluate(strain)[0])
        if left < NEAR_FRACTION:
            yield (
                f"{_MAP.format(kept_map('lapses'))}soil {name}: at the strain that PGV over the "
                f"shear-wave velocity makes, {100 * strain:.2g} %, {left:.2g} of its modulus is "
                f"left; moduli that swing to {NEAR_FRACTION:g} and back from lapse to lapse stay "
                "sound, to less they pump energy: compare with fewer, longer lapses, or with one"
            )


def _contrast_notes(scene: Scene, soils: tuple[str, ...]) -> Iterator[str]:
    """Ground so stiff beside other ground that sweeps may stop."""
    moduli = {name: scene.soil[name].elastic.shear_modulus for name in soils}
    soft, stiff = min(moduli, key=lambda n: moduli[n]), max(moduli, key=lambda n: moduli[n])
    contrast = moduli[stiff] / moduli[soft]
    transient = scene.lapses.continuity == "transient"
    sweep = scene.solver.sweep
    near = near_contrast(scene.solver.tolerance, transient, sweep)
    if contrast >= near:
        yield (
            f"{_MAP.format(kept_map('contrast'))}the shear modulus of {stiff} is {contrast:.2g} "
            f"times that of {soft}; to {near:.1g} every {sweep} sweep reaches solver.tolerance = "
            f"{scene.solver.tolerance:g}; beyond, where {stiff} rides on {soft}, it may stop: "
            f"give {stiff} a lower modulus, which moves no less as a rigid body, or raise the "
            "tolerance"
        )


def _cut_notes(scene: Scene, domain: Domain) -> Iterator[str]:
    """Cells that points leave in part, too large for the waves of the motion."""
    degree = domain.V.ufl_element().degree
    size = domain.comm.allgather(_largest(scene, domain) / degree)
    crossing = max(size) * motion_band(scene.motion)  # waves in a cell; none where nothing moves
    waves = 1 / crossing if crossing else np.inf
    if waves < NEAR_WAVES:
        yield (
            f"{_MAP.format(kept_map('cut_cells'))}the band of the motion, "
            f"{motion_band(scene.motion):.3g} Hz, has {waves:.3g} cells in a shear wave's length; "
            f"with {NEAR_WAVES:g} a cell may be filled to any share: take cells "
            f"{NEAR_WAVES / waves:.2g} times as small, or of degree 2"
        )


def _largest(scene: Scene, domain: Domain) -> float:
    """Largest cell size over the shear-wave velocity of its soil, of this rank's cells [s]."""
    speed = np.array([scene.soil[name].elastic.shear_wave_velocity for name in domain.region_names])
    owned = slice(domain.num_owned_cells)
    regions = domain.regions[owned]
    soil = regions >= 0
    passing = domain.cell_sizes()[owned][soil] / speed[regions[soil]]
    return float(passing.max(initial=0.0))
