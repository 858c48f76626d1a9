# SPDX-License-Identifier: MIT
"""The viscous twin of a scene: a linear problem that frequency and time domain solve alike.

Hysteretic damping is not causal and has no equation in time. The twin has Rayleigh damping C = αM +
βK in its place, with one damping ratio ζ at the first natural frequency f₁ and at 5 f₁, as Kwok et
al. (2007) recommend for site response: between them less than ζ, outside more. ζ is what the
soils' own damping gives the first mode, φᵀK_iφ / 2φᵀKφ with K_i the imaginary part of the
stiffness (Roesset, Whitman and Dobry 1973): each soil's damping ratio by its share of the energy.

The sweep's response is periodic. The twin is padded with zeros until free vibration has died out,
and is then the response from rest as well. Of the modes that a record moves the first one dies out
last, as e^{−ζω₁t}: with Rayleigh damping ζω = α/2 + βω²/2 grows with ω, and modes that are
overdamped die out at a rate of 1/β or more, which is far above.
"""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.fft import next_fast_len
from scipy.sparse.linalg import splu

from fenics_hytf.scene import Scene
from fenics_hytf.study.matrices import Matrices, assemble

RealArray = npt.NDArray[np.float64]

RESIDUE = 1e-6
"""Free vibration that is left when the period ends, over its amplitude at the record's end."""

SECOND = 5.0
"""The second frequency of full ζ over the first."""

_SETTLED = 1e-9  # change of ω₁² from one inverse iteration to the next
_ITERATIONS = 50  # modes that are still mixed after so many are a few per cent apart
_LONGEST = 1000.0  # records: a twin that rings on for longer is no use to a comparison


def viscous_twin(scene: Scene) -> Scene:
    """Make the twin of a scene.

    The same mesh, soils at small strain, boundaries, motions, receivers and solver; one steady
    lapse, without the equivalent-linear loop and what happens between lapses; undamped soils and
    rock, and Rayleigh damping, to which that of the scene is added. All lines are solved: a march
    knows no highest frequency.

    Args:
        scene: The scene.

    Returns:
        The twin.

    Raises:
        ValueError: There is none: why, and what would have to change.
    """
    _require_a_twin(scene)
    omega, damping = _first_mode(scene)
    given = scene.effects.rayleigh
    alpha = 2 * damping * omega * SECOND / (1 + SECOND)
    beta = 2 * damping / (omega * (1 + SECOND))
    if given is not None:
        alpha, beta = alpha + given.alpha, beta + given.beta
    decay = (alpha + beta * omega**2) / 2  # ζω₁ [1/s]
    num_samples = max(motion.record.num_samples for motion in scene.motion)
    rest = -math.log(RESIDUE) / scene.dt / decay if decay else math.inf
    if rest > _LONGEST * num_samples:
        raise ValueError(
            f"damping: found {decay / omega:.2g} in the first mode at {omega / 2 / np.pi:.3g} Hz, "
            f"which rings for more than {_LONGEST:g} times the record; expected damped soils"
        )
    data = _undamped(_steady(scene))
    data["effects"] = {"rayleigh": {"alpha": float(alpha), "beta": float(beta)}}
    padded = next_fast_len(num_samples + math.ceil(rest), real=True)
    data["lapses"] = {"duration": padded * scene.dt}
    return Scene.from_dict(data, scene.folder)


def _require_a_twin(scene: Scene) -> None:
    """Refuse what has no viscous counterpart.

    Raises:
        ValueError: Free field, an absorbing layer, or regions without soil.
    """
    if scene.mesh.empty:
        raise ValueError(
            "mesh.empty: found regions without soil, whose nodes have no mass to march; expected "
            "soil everywhere"
        )
    if "free_field" in scene.supports.values():
        raise ValueError(
            'boundary: found "free_field", whose forces come from a sweep of their own; expected '
            "tied, roller, dashpot or free sides"
        )
    if scene.effects.calm is not None:
        raise ValueError(
            "effects.calm: found an absorbing layer, which is material damping; expected none"
        )


def _steady(scene: Scene) -> dict[str, Any]:
    """A scene's table with one steady lapse, and a law whose matrices stand at powers of s."""
    table = copy.deepcopy(scene.data)
    table["lapses"] = {}
    if scene.solver.complex_modulus == "maxwell":
        solver = table.setdefault("solver", {})
        solver["complex_modulus"] = "hysteretic"
        solver.pop("reference_frequency", None)
    return table


def _undamped(data: dict[str, Any]) -> dict[str, Any]:
    """A table without what only a nonlinear or hysteretic run has."""
    table = copy.deepcopy(data)
    for soil in table["soil"].values():
        soil.pop("curves", None)
        soil["damping"] = 0.0
    for kind in table.get("boundary", {}).values():
        if isinstance(kind, dict):
            kind["compliant"]["damping"] = 0.0
    table.get("solver", {}).pop("max_frequency", None)
    return table


def _first_mode(scene: Scene) -> tuple[float, float]:
    """The first natural mode that the motions excite, of ground on a base that is held.

    Returns:
        Circular frequency [rad/s] and damping ratio [-].
    """
    data = _steady(scene)
    data["effects"] = {}
    for motion in data["motion"]:
        motion["input"] = "within"  # holds the base
    matrices = assemble(Scene.from_dict(data, scene.folder))
    return min(_mode(matrices, load) for load in matrices.loads)


def _mode(matrices: Matrices, load: RealArray) -> tuple[float, float]:
    """Inverse iteration from the static deflection: it stays among the modes that are excited.

    Returns:
        Circular frequency [rad/s] and damping ratio [-].
    """
    K, M, loss = matrices.stiffness, matrices.mass, matrices.hysteresis
    solve = splu(K.tocsc()).solve
    shape, squared = solve(load), math.inf
    for _ in range(_ITERATIONS):
        inertia, last = M @ shape, squared
        squared = shape @ (K @ shape) / (shape @ inertia)
        if abs(squared - last) <= _SETTLED * squared:
            break
        shape = solve(inertia / math.sqrt(shape @ inertia))
    energy = shape @ (K @ shape)
    damping = 0.0 if loss is None else shape @ (loss @ shape) / (2 * energy)
    return math.sqrt(squared), float(damping)
