# SPDX-License-Identifier: MIT
"""``summary.json``: what was run, what it took, what came out; all that figures need but arrays.

A figure that does not exist (a residual of no solve, a change of no loop) is ``null``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from platform import python_version
from typing import TYPE_CHECKING, Any

import numpy as np

import fenics_hytf
from fenics_hytf.motion import GRAVITY, Intensity, energy_band, intensity_measures
from fenics_hytf.results.definition import describe_scene
from fenics_hytf.results.energy import ledger, totals, worst_seam_error
from fenics_hytf.results.layers import layer_states
from fenics_hytf.results.sliding import slide, slip_record, slip_warnings
from fenics_hytf.results.softening import softening_record
from fenics_hytf.results.writers import QUANTITIES, base_motions
from fenics_hytf.soil import HELD_DAMPING, LimitedCurve

if TYPE_CHECKING:
    from fenics_hytf.lapse import LapseResult
    from fenics_hytf.simulation import Result

FORMAT = 5
"""Raised when a key of the summary changes its meaning, or one that is read is new."""

_SEAM_ERROR = 0.01  # of the peaks; seams of sound lapses are some 1e-4 off
_IMBALANCE = 0.01  # of the energy that comes in

_ROUNDING = 1e-9  # of the largest peak: below, a component does not move

PHASES = ("setup", "assembly", "sweep", "response", "convection", "output")

_PACKAGES = {
    "dolfinx": "fenics-dolfinx",
    "petsc4py": "petsc4py",
    "numpy": "numpy",
    "scipy": "scipy",
}


def summarise(result: Result) -> dict[str, Any]:
    """Everything of a simulation but its arrays, as JSON knows it.

    Args:
        result: The simulation.

    Returns:
        The summary; keys carry their units.
    """
    seconds = {phase: 0.0 for phase in PHASES} | result.work.wall_s
    work = asdict(result.work) | {"wall_s": dict(seconds)}
    summary = {
        "format": FORMAT,
        "title": result.scene.title,
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": versions(),
        "ranks": result.num_ranks,
        "group_size": result.group_size,
        "scene_hash": result.scene.hash,
        "scene": describe_scene(result.scene, result.region_names),
        "effects": list(result.scene.effects.named),
        "sizes": result.sizes,
        "components": result.components,
        "directions": result.directions,
        "regions": result.region_names,
        "dt_s": result.dt,
        "samples": int(result.base_acceleration.shape[1]),
        "duration_s": result.dt * result.base_acceleration.shape[1],
        "motions": _motions(result),
        "base": _base(result),
        "receivers": _receivers(result),
        "lapses": [_lapse(result, lapse) for lapse in result.lapses],
        "worst_seam_error": worst_seam_error(result.lapses),
        "energy": totals(result.lapses, _gdim(result)),
        "sliding": slide(result),
        "softening": softening_record(result.lapses[-1], result.receivers),
        "peaks": _peaks(result),
        "intensity": _intensity(result),
        "work": work,
        "wall_s": seconds,
        "peak_memory_bytes": result.peak_memory,
        "warnings": warnings(result),
    }
    return plain(summary)


def warnings(result: Result) -> list[str]:
    """What a reader has to know before using the figures."""
    found = []
    tolerance = result.scene.solver.tolerance
    for lapse in result.lapses:
        if lapse.worst_residual > tolerance:
            found.append(
                f"Lapse {lapse.index}: the worst relative residual is {lapse.worst_residual:.1e}, "
                f"above the tolerance of {tolerance:.0e}."
            )
        lost = lapse.ledger.parked + lapse.ledger.deleted
        if lost:
            found.append(
                f"Lapse {lapse.index}: {lost} points had left the mesh by its end, or come off the "
                "ground that is held."
            )
    if result.scene.output.water_table is not None and result.scene.mesh.size is None:
        found.append(
            "output.water_table is not used: the vertical stress, and with it the stress ratio, is "
            "known below the level surface of a column or box only."
        )
    if result.scene.effects.equivalent_linear is not None:
        strains = [lapse.cells.effective_strain for lapse in result.lapses]
        strain = max((float(np.nanmax(s, initial=0.0)) for s in strains), default=0.0)
        if strain > 0.01:
            found.append(
                f"Effective strains reach {100 * strain:.2g} %. Above about 1 % an equivalent-"
                "linear analysis is outside the range it was made for."
            )
    found += [f"{said[0].upper()}{said[1:]}." for said in result.coarse]
    found += _exceeded_strengths(result)
    found += _seam_warnings(result)
    found += slip_warnings(result)
    return found


def _seam_warnings(result: Result) -> list[str]:
    """Seams that are felt, energy that is not balanced, damping that the law does not hold."""
    found = []
    error = worst_seam_error(result.lapses)
    if error is not None and error > _SEAM_ERROR:
        remedy = (
            "Longer lapses, a higher solver.max_frequency or, at the Nyquist frequency, a motion "
            "in shorter time steps make jumps smaller."
        )
        if any(i.slip is not None and i.slip.rate[0] > 0 for i in result.lapses[1:]):
            remedy = (
                "Where a mechanism gives way to the next one as it slips, accelerations of a "
                "sample or two after the seam are not those of the ground: peaks and spectra of "
                "what slides may come from there."
            )
        found.append(
            f"Displacement or velocity jumps at a seam between lapses by {100 * error:.2g} % of "
            f"its peak. {remedy}"
        )
    band, nyquist = energy_band(result.base_acceleration, result.dt), 0.5 / result.dt
    if error is not None and error > 0.1 * _SEAM_ERROR and 2 * band > nyquist:
        found.append(
            f"The motion has energy up to {band:.3g} Hz, more than half its Nyquist frequency of "
            f"{nyquist:.3g} Hz: transient lapses want it in shorter time steps."
        )
    energy = totals(result.lapses, _gdim(result))
    if energy is not None and (energy["worst_imbalance"] or 0.0) > _IMBALANCE:
        found.append(
            f"The energy of a lapse is off balance by {100 * energy['worst_imbalance']:.2g} % of "
            "what comes in."
        )
    if result.scene.solver.complex_modulus == "maxwell":
        damping = max(float(np.nanmax(i.cells.damping, initial=0.0)) for i in result.lapses)
        if damping > HELD_DAMPING:
            found.append(
                f"Damping ratios reach {100 * damping:.2g} %. Above {100 * HELD_DAMPING:g} % the "
                "four branches of the Maxwell law no longer hold the loss factor."
            )
    return found


def _exceeded_strengths(result: Result) -> list[str]:
    """Soils whose peak stress is above the strength that limits their curves.

    The curve is read at the effective strain, the peak stress goes with the peak strain.
    """
    found: list[str] = []
    if result.scene.effects.equivalent_linear is None:
        return found
    for name, soil in result.scene.soil.items():
        curve = soil.curve
        if name not in result.region_names or not isinstance(curve, LimitedCurve):
            continue
        number = result.region_names.index(name)
        stresses = [c.peak_stress[c.region == number] for c in (i.cells for i in result.lapses)]
        peak = max((float(np.nanmax(s, initial=0.0)) for s in stresses), default=0.0)
        strength = curve.strength * soil.elastic.shear_modulus
        if peak > strength:
            found.append(
                f"Soil {name}: peak shear stresses reach {peak / 1e3:.3g} kPa, above the strength "
                f"of {strength / 1e3:.3g} kPa. The curve limits the stress at the effective "
                "strain; peaks go with the peak strain."
            )
    return found


def component_peaks(summary: Mapping[str, Any]) -> dict[str, float]:
    """Largest total acceleration of any receiver, by component [m/s^2].

    Args:
        summary: As :func:`summarise` makes it.

    Returns:
        The peaks; 0 where there are no receivers.
    """
    receivers = summary["peaks"].values()
    return {
        component: max((peaks[f"A_{component}"] or 0.0 for peaks in receivers), default=0.0)
        for component in summary["components"]
    }


def moving_components(summary: Mapping[str, Any], receiver: str | None = None) -> list[str]:
    """Components that move by more than rounding.

    Args:
        summary: As :func:`summarise` makes it.
        receiver: In which a component moves; in any if ``None``.

    Returns:
        Their names.
    """
    peaks = component_peaks(summary)
    largest = max(peaks.values(), default=0.0)
    if receiver is not None:
        peaks = {c: summary["peaks"][receiver][f"A_{c}"] for c in peaks}
    # a receiver whose point has left the mesh has no peak, but it moved
    return [c for c, peak in peaks.items() if peak is None or peak > _ROUNDING * largest]


def versions() -> dict[str, str | None]:
    """Versions of the programs that made a result; ``None`` where one is not installed."""
    found = {"fenics_hytf": own_version()}
    found |= {name: _version(package) for name, package in _PACKAGES.items()}
    found["petsc"] = _petsc_version()
    found["python"] = python_version()
    return found


def plain(value: Any) -> Any:
    """A value as JSON knows it: NumPy's numbers as Python's, NaN and infinity as ``None``."""
    if isinstance(value, Mapping):
        return {str(name): plain(item) for name, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def own_version() -> str | None:
    """Version of this package; a checkout that is run in place is not installed."""
    return getattr(fenics_hytf, "__version__", None) or _version("fenics-hytf")


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _petsc_version() -> str | None:
    try:
        from petsc4py import PETSc
    except ImportError:
        return None
    return ".".join(str(part) for part in PETSc.Sys.getVersion())


def _motions(result: Result) -> list[dict[str, Any]]:
    motions = []
    for motion, direction, used in zip(
        result.scene.motion, result.directions, result.base_acceleration, strict=True
    ):
        peak = float(np.max(np.abs(used)))
        motions.append(
            {
                "direction": direction,
                "name": motion.record.name,
                "input": motion.input,
                "pga_m_s2": peak,
                "pga_g": peak / GRAVITY,
                "dt_s": motion.record.dt,
                "samples": int(motion.record.acceleration.size),
            }
        )
    return motions


def _base(result: Result) -> dict[str, dict[str, Any]]:
    """Peak and intensity of the base's motions, by direction; the outcrop's where it is known."""
    base: dict[str, dict[str, Any]] = {}
    for kind, direction, motion in base_motions(result):
        measures = intensity_measures(motion, result.dt, _seams(result))
        told = base.setdefault(direction, {"outcrop_pga_g": None, "outcrop_intensity": None})
        told[f"{kind}_pga_g"] = measures.pga / GRAVITY
        told[f"{kind}_intensity"] = _with_units(measures)
    return base


def _intensity(result: Result) -> dict[str, dict[str, dict[str, float]]]:
    """Intensity measures of the total motion by receiver and component."""
    history, seams = result.history("total_acceleration"), _seams(result)
    return {
        receiver: {
            component: _with_units(intensity_measures(history[r, c], result.dt, seams))
            for c, component in enumerate(result.components)
        }
        for r, receiver in enumerate(result.receivers)
    }


def _seams(result: Result) -> list[int]:
    """First samples of what is a periodic state of its own: each lapse, or the whole record."""
    if result.scene.lapses.continuity == "transient":
        return [0]
    return [round(lapse.start_time / result.dt) for lapse in result.lapses]


def _gdim(result: Result) -> int:
    return int(result.lapses[0].cells.centroid.shape[1])


def _with_units(measures: Intensity) -> dict[str, float]:
    """Intensity measures under keys that carry their units."""
    return {
        "pga_m_s2": measures.pga,
        "pgv_m_s": measures.pgv,
        "pgd_m": measures.pgd,
        "arias_m_s": measures.arias,
        "cav_m_s": measures.cav,
        "d5_95_s": measures.significant_duration,
    }


def _receivers(result: Result) -> dict[str, Any]:
    return {
        name: {"place_m": place, "rides": result.scene.output.receivers[name].rides}
        for name, place in zip(result.receivers, result.places, strict=True)
    }


def _lapse(result: Result, lapse: LapseResult) -> dict[str, Any]:
    change, degradation = lapse.loop.change, lapse.cells.degradation
    return {
        "index": lapse.index,
        "start_time_s": lapse.start_time,
        "samples": lapse.num_samples,
        "excited_lines": lapse.excited_lines,
        "solved_lines": lapse.solved_lines,
        "factorisations": lapse.factorisations,
        "solves": lapse.solves,
        "iterations": len(change),
        "final_change": change[-1] if change else None,
        "change": change,
        "worst_cell": lapse.loop.worst_cell,
        "layers": layer_states(result.scene, result.region_names, lapse),
        "worst_residual": lapse.worst_residual,
        "seam_error": lapse.seam_error,
        "energy": ledger(lapse.energy, _gdim(result)),
        "degradation": None if degradation is None else np.nanmin(degradation),
        "slip": slip_record(result.scene, lapse),
        "softening": softening_record(lapse, result.receivers),
        "points_lost": lapse.ledger.deleted,
        "points_parked": lapse.ledger.parked,
        "mass_ledger": lapse.ledger.as_dict(),
    }


def _peaks(result: Result) -> dict[str, dict[str, float]]:
    """Largest absolute values by receiver, letter and component; units as in ``receivers.csv``."""
    histories = {letter: result.history(name) for letter, name in QUANTITIES.items()}
    return {
        receiver: {
            f"{letter}_{component}": float(np.max(np.abs(history[r, c]), initial=0.0))
            for letter, history in histories.items()
            for c, component in enumerate(result.components)
        }
        for r, receiver in enumerate(result.receivers)
    }
