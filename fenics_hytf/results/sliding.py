# SPDX-License-Identifier: MIT
"""What slid: the slip of lapses and of the run, as ``summary.json`` and ``slip.csv`` have it.

The slip λ of a lapse is the displacement of the place that its mechanism moves farthest. Over a run
slips are summed, whichever mechanism they belong to. The mechanism yields under the acceleration
g k_y; k_max is the largest acceleration that drives it in a lapse, over g. Both are over the
gravity of the scene.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from fenics_hytf.lapse import LapseResult, SlipResult
    from fenics_hytf.scene import Scene
    from fenics_hytf.simulation import Result

RealArray = npt.NDArray[np.float64]

TRUSTED = 0.6
"""k_y/k_max up to which a single mechanism predicts slip well [-]."""

NOTE = f"small slips above k_y/k_max {TRUSTED:g} are not predicted well by a single mechanism"


def slip_record(scene: Scene, lapse: LapseResult) -> dict[str, Any] | None:
    """What slipped in a lapse.

    Args:
        scene: The scene.
        lapse: The lapse.

    Returns:
        Plain values, keys carry their units: ``rigid_m`` and ``decoupled_m`` are the slips of a
        rigid block and of one under the linear response; ``yield_over_peak`` is k_y/k_max,
        ``None`` where nothing drives the mechanism; ``factor_of_safety`` is ``None`` where gravity
        alone shears nothing; ``note`` says where that is too much for the
        slip to be trusted. ``None`` where the scene does not call for sliding.
    """
    slip = lapse.slip
    if slip is None:
        return None
    ratio = _yield_over_peak(scene, slip)
    return {
        "yield_coefficient": slip.yield_coefficient,
        "factor_of_safety": _safety(slip),
        "direction": slip.direction,
        "sense": slip.sense,
        "slip_m": float(slip.slip[-1]),
        "rigid_m": slip.rigid,
        "decoupled_m": slip.decoupled,
        "end_rate_m_s": float(slip.rate[-1]),
        "peak_driving_g": float(slip.driving.max()) / _gravity(scene),
        "yield_over_peak": ratio,
        "note": NOTE if _doubtful(slip.slid, ratio) else None,
        "iterations": slip.iterations,
        "time_step_s": slip.time_step,
        "mass": slip.mass,
        "modal_mass": slip.modal_mass,
        "dissipation": slip.dissipation,
    }


def slide(result: Result) -> dict[str, Any] | None:
    """What slipped in the run.

    Args:
        result: The simulation.

    Returns:
        Sums of the lapses' slips; the factor of safety at rest, as for a lapse; k_y of the first
        and the last lapse; ``yield_over_peak``, the least k_y/k_max of a lapse; ``note`` as for a
        lapse; and ``at_rest_s``, the time from which on nothing slips: nought where nothing ever
        does, ``None`` where the run ends while something slips. ``None`` where the scene does not
        call for sliding.
    """
    slips = _slips(result)
    if not slips:
        return None
    ratios = [_yield_over_peak(result.scene, slip) for slip in slips]
    ratio = min((r for r in ratios if r is not None), default=None)
    slid = any(slip.slid for slip in slips)
    return {
        "slip_m": float(sum(slip.slip[-1] for slip in slips)),
        "rigid_m": sum(slip.rigid for slip in slips),
        "decoupled_m": sum(slip.decoupled for slip in slips),
        "factor_of_safety": _safety(slips[0]),
        "yield_coefficient": slips[0].yield_coefficient,
        "yield_coefficient_last": slips[-1].yield_coefficient,
        "yield_over_peak": ratio,
        "at_rest_s": _at_rest(result),
        "note": NOTE if _doubtful(slid, ratio) else None,
    }


def slip_columns(result: Result) -> dict[str, RealArray]:
    """The slip over the whole run, at the time steps of the march.

    A seam between lapses is there once, as the start of the later one.

    Args:
        result: The simulation of a scene that calls for sliding.

    Returns:
        ``time_s``, ``slip_m`` from the start of the run, ``rate_m_s``, ``driving_m_s2`` (of the
        linear response), ``yield_m_s2`` (g k_y) and ``lapse``, shape ``(num_steps,)`` each.
    """
    parts: list[RealArray] = []
    before, last = 0.0, result.lapses[-1].index
    for lapse, slip in zip(result.lapses, _slips(result), strict=True):
        count = len(slip.slip) - (lapse.index != last)
        parts.append(
            np.stack(
                [
                    lapse.start_time + slip.time_step * np.arange(count),
                    before + slip.slip[:count],
                    slip.rate[:count],
                    slip.driving[:count],
                    np.full(count, _gravity(result.scene) * slip.yield_coefficient),
                    np.full(count, float(lapse.index)),
                ]
            )
        )
        before += float(slip.slip[-1])
    names = ("time_s", "slip_m", "rate_m_s", "driving_m_s2", "yield_m_s2", "lapse")
    return dict(zip(names, np.concatenate(parts, axis=1), strict=True))


def slip_warnings(result: Result) -> list[str]:
    """What a reader has to know about the slip before using it."""
    told = slide(result)
    if told is None:
        return []
    found = []
    if told["note"] is not None:
        found.append(
            f"The acceleration that drives the mechanism hardly exceeds what it yields under, "
            f"k_y/k_max is {told['yield_over_peak']:.2f}: {told['note']}."
        )
    if told["at_rest_s"] is None:
        rate = _slips(result)[-1].rate[-1]
        found.append(
            f"The slope was still sliding at {rate:.2g} m/s when the run ended: slip and "
            "displacement are those up to then. A larger effects.sliding.longest lets it come to "
            "rest."
        )
    return found


def _slips(result: Result) -> list[SlipResult]:
    return [lapse.slip for lapse in result.lapses if lapse.slip is not None]


def _safety(slip: SlipResult) -> float | None:
    return slip.factor_of_safety if np.isfinite(slip.factor_of_safety) else None


def _gravity(scene: Scene) -> float:
    assert scene.effects.gravity is not None
    return scene.effects.gravity.acceleration


def _yield_over_peak(scene: Scene, slip: SlipResult) -> float | None:
    peak = float(slip.driving.max())
    return _gravity(scene) * slip.yield_coefficient / peak if peak > 0.0 else None


def _doubtful(slid: bool, ratio: float | None) -> bool:
    return slid and ratio is not None and ratio > TRUSTED


def _at_rest(result: Result) -> float | None:
    """Time of the first step after the last one at which something slips [s]."""
    columns = slip_columns(result)
    moving = np.flatnonzero(columns["rate_m_s"] > 0.0)
    if not moving.size:
        return 0.0
    after = moving[-1] + 1
    return float(columns["time_s"][after]) if after < len(columns["time_s"]) else None
