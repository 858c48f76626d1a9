# SPDX-License-Identifier: MIT
"""The equivalent-linear loop: the shear modulus and damping of every cell fit its effective strain.

γ_eff = ratio × max_t γ(t) → curves → G, D → sweep → γ_eff ... (Seed & Idriss 1969),
accelerated as a fixed point in ln γ_eff (Anderson 1965; type I of Fang & Saad 2009). A peak that
jumps from one instant to another bends the map: there type I, which measures along the steps taken,
went on where type II, which minimises the defect, circled; a few earlier steps do best.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from fenics_hytf.lapse.errors import EquivalentLinearError
from fenics_hytf.lapse.ground import Ground, Moduli
from fenics_hytf.lapse.records import LoopHistory
from fenics_hytf.scene import EquivalentLinear, Scene

RealArray = npt.NDArray[np.float64]

_PICARD = 0.2  # plain iteration until the moduli change by less: far away, it is the safer one
_MEMORY = 3
_GROWTH = 2.0  # a defect that grows by more says that the earlier steps mislead: forget them
_LONGEST_STEP = 1.0  # in ln γ_eff: an accelerated step is not trusted further
_SMALLEST_STRAIN = 1e-12  # below every curve; keeps the logarithm finite where nothing moves


class Anderson:
    """Anderson acceleration, type I, of a fixed point x = g(x).

    Args:
        memory: Differences of earlier steps that are kept.
    """

    def __init__(self, memory: int = _MEMORY) -> None:
        self._points: deque[tuple[RealArray, RealArray]] = deque(maxlen=memory + 1)

    def next(self, x: RealArray, g: RealArray) -> RealArray:
        """Propose the next point.

        Args:
            x: Point, shape ``(n,)``.
            g: Its image, shape ``(n,)``.

        Returns:
            The next point, shape ``(n,)``; the image itself at the first call.
        """
        if self._points:
            before = self._points[-1]
            if np.linalg.norm(g - x) > _GROWTH * np.linalg.norm(before[1] - before[0]):
                self._points.clear()
        self._points.append((x, g))
        if len(self._points) == 1:
            return g
        steps = np.diff([point for point, _ in self._points], axis=0)
        images = np.diff([image for _, image in self._points], axis=0)
        # Steps that are alike but for a millionth tell no more than one of them.
        weights, *_ = np.linalg.lstsq(steps @ (images - steps).T, steps @ (g - x), rcond=1e-6)
        return x + np.clip(g - x - images.T @ weights, -_LONGEST_STEP, _LONGEST_STEP)


def iterate(
    ground: Ground,
    settings: EquivalentLinear,
    start: RealArray,
    peak_strain: Callable[[Moduli, int], RealArray],
    report: Callable[[int, float], None],
    strain_from: npt.NDArray[np.intp] | None = None,
) -> tuple[Moduli, RealArray, LoopHistory]:
    """Iterate until G and D of every cell change by less than the tolerance.

    Args:
        ground: The ground.
        settings: Tolerance, strain ratio and limit.
        start: First effective strain of every cell [-], shape ``(num_cells,)``.
        peak_strain: Solves with given moduli; called with them and the iteration (from 1), returns
            the peak strain of every cell [-], shape ``(num_cells,)``.
        report: Called with the iteration and its change.
        strain_from: For every cell the cell whose strain rules its moduli, shape ``(num_cells,)``;
            itself if ``None``.

    Returns:
        The moduli that the last response was solved with, the effective strain of that response,
        and the history.

    Raises:
        EquivalentLinearError: The limit is reached.
    """
    nonlinear = ground.nonlinear
    changes: list[float] = []
    worst: list[int] = []
    accelerated: Anderson | None = None
    log_strain = np.log(np.maximum(start, _SMALLEST_STRAIN))
    moduli = ground.secant(np.exp(log_strain))
    for iteration in range(1, settings.max_iterations + 1):
        effective = settings.strain_ratio * peak_strain(moduli, iteration)
        if strain_from is not None:
            effective = effective[strain_from]
        image = np.log(np.maximum(effective, _SMALLEST_STRAIN))
        change = np.where(nonlinear, ground.secant(effective).change(moduli), 0.0)
        worst.append(int(np.argmax(change)))
        changes.append(float(change[worst[-1]]))
        report(iteration, changes[-1])
        if changes[-1] <= settings.tolerance:
            return moduli, effective, LoopHistory(tuple(changes), tuple(worst), change)
        if accelerated is None and changes[-1] <= _PICARD:
            accelerated = Anderson()
        if accelerated is not None:
            # Linear cells have nothing to find: their strain must not steer the others.
            image[nonlinear] = accelerated.next(log_strain[nonlinear], image[nonlinear])
        log_strain = image
        moduli = ground.secant(np.exp(log_strain))
    raise EquivalentLinearError(settings.max_iterations, changes[-1], settings.tolerance, worst[-1])


def first_strain(scene: Scene, ground: Ground) -> RealArray:
    """A first guess, ratio × PGV/Vs, of the effective strain.

    Args:
        scene: The scene, for its motions.
        ground: The ground.

    Returns:
        Of every cell [-], shape ``(num_cells,)``; nought without the equivalent-linear loop.
    """
    loop = scene.effects.equivalent_linear
    if loop is None:
        return np.zeros(len(ground.region))
    velocity = max(float(np.abs(m.record.velocity()).max()) for m in scene.motion)
    return loop.strain_ratio * velocity / np.sqrt(ground.shear_modulus / ground.density)
