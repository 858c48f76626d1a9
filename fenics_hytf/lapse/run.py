# SPDX-License-Identifier: MIT
"""One lapse: the input at its lines, sweeps with given moduli, and the equivalent-linear loop."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fenics_hytf.frequency import Sweep, direct_sweep, reduced_sweep
from fenics_hytf.lapse.equations import Equations
from fenics_hytf.lapse.equivalent_linear import iterate
from fenics_hytf.lapse.ground import ElasticConstants, Ground, Moduli, complex_constants
from fenics_hytf.lapse.records import LoopHistory
from fenics_hytf.lapse.response import CellProbe, Excitation
from fenics_hytf.motion import excited_lines, to_frequency
from fenics_hytf.scene import Scene

RealArray = npt.NDArray[np.float64]

_LOOSEST = 1e-2  # residual of a sweep that only tells the loop where to go
# Directions a factorisation is used for: it costs 6 to 8 solves in sections, some 40 in solids.
_BLOCK = {2: 14, 3: 24}
_IN_REACH = 1e-10  # residual that round-off leaves in reach of every reduced sweep
_SHARE = 1e-2  # of the last change of the moduli, as a residual


@dataclass
class Tally:
    """What the sweeps of a lapse cost."""

    factorisations: int = 0
    solves: int = 0


@dataclass(frozen=True)
class Observer:
    """Where a lapse reports to while it runs.

    Attributes:
        sweeping: Called with the iteration, the lines done and their number.
        iterated: Called with the iteration and its change.
        phase: Context manager by the name of the phase, which measures its time.
    """

    sweeping: Callable[[int, int, int], None]
    iterated: Callable[[int, float], None]
    phase: Callable[[str], AbstractContextManager[None]]


@dataclass(frozen=True)
class Solved:
    """The solution of a lapse.

    Attributes:
        excitation: The input at the solved lines.
        sweep: Transfer functions h(ω) of each motion (5).
        moduli: Moduli it was solved with.
        constants: Real elastic constants it was solved with.
        effective_strain: Of every cell [-], or ``None`` without the equivalent-linear loop.
        loop: History of the loop.
        tally: Factorisations and solves.
    """

    excitation: Excitation
    sweep: Sweep
    moduli: Moduli
    constants: ElasticConstants
    effective_strain: RealArray | None
    loop: LoopHistory
    tally: Tally = field(default_factory=Tally)


def excite(scene: Scene, acceleration: RealArray, axes: tuple[int, ...]) -> Excitation:
    """Find the lines of a lapse that carry energy.

    Args:
        scene: The scene: thresholds and time step.
        acceleration: Base acceleration in the lapse [m/s^2], shape ``(num_motions, num_samples)``.
        axes: Component in which each motion acts.

    Returns:
        The input at those lines.
    """
    spectra = to_frequency(acceleration)
    num_samples = acceleration.shape[1]
    limits = (scene.solver.excited, scene.solver.max_frequency)
    lines = excited_lines(spectra, scene.dt, num_samples, *limits)
    everywhere = excited_lines(spectra, scene.dt, num_samples, scene.solver.excited)
    return Excitation(lines, spectra[:, lines], axes, num_samples, scene.dt, len(everywhere))


def solve(
    scene: Scene,
    equations: Equations,
    ground: Ground,
    excitation: Excitation,
    probe: CellProbe,
    start: RealArray,
    observer: Observer,
    strain_from: npt.NDArray[np.intp] | None = None,
) -> Solved:
    """Solve a lapse: one sweep, or the equivalent-linear loop round it.

    Args:
        scene: The scene.
        equations: The equations, their mass weighed and their stress carried.
        ground: The ground.
        excitation: The input.
        probe: Evaluates strain in the cells.
        start: First effective strain of every cell [-], shape ``(num_cells,)``.
        observer: Where to report.
        strain_from: See :func:`iterate`.

    Returns:
        The solution.

    Raises:
        SweepError: A line cannot be solved.
        EquivalentLinearError: The loop reaches its limit.
    """
    sweeps = _Sweeps(scene, equations, ground, excitation, observer)

    def peak_strain(moduli: Moduli, iteration: int) -> RealArray:
        sweep = sweeps.solve(moduli, iteration, sweeps.tolerance_so_far)
        with observer.phase("response"):
            return probe.peak_strain(sweep, excitation)

    effective, loop = None, LoopHistory()
    if scene.effects.equivalent_linear is None:
        moduli = ground.secant(start)
        sweeps.solve(moduli, 0)
    else:
        moduli, effective, loop = iterate(
            ground,
            scene.effects.equivalent_linear,
            start,
            peak_strain,
            sweeps.iterated,
            strain_from,
        )
        if sweeps.tolerance > sweeps.finest:
            sweeps.solve(moduli, len(loop.change))
    assert sweeps.last is not None
    constants, sweep = sweeps.constants, sweeps.last
    return Solved(excitation, sweep, moduli, constants, effective, loop, sweeps.tally)


class _Sweeps:
    """The sweeps of a lapse, each with other moduli; one that is reduced learns from the last."""

    def __init__(
        self,
        scene: Scene,
        equations: Equations,
        ground: Ground,
        excitation: Excitation,
        observer: Observer,
    ) -> None:
        self._solver, self._equations, self._ground = scene.solver, equations, ground
        self._excitation, self._observer = excitation, observer
        self._change = 1.0
        self._expansions: tuple[int, ...] = ()
        self.tally = Tally()
        loop = scene.effects.equivalent_linear
        self.finest = self._solver.tolerance
        if loop is not None:  # what the strain is off by must not keep the loop from its end
            needed = max(_SHARE * loop.tolerance, _IN_REACH)
            self.finest = min(self.finest, needed)
        self.tolerance = self.finest
        self.last: Sweep | None = None

    def iterated(self, iteration: int, change: float) -> None:
        """Take note of the change of an iteration, and pass it on."""
        self._change = change
        self._observer.iterated(iteration, change)

    @property
    def tolerance_so_far(self) -> float:
        """What an iteration needs: a hundredth of what the moduli still change by."""
        return max(self.finest, min(_LOOSEST, _SHARE * self._change))

    def solve(self, moduli: Moduli, iteration: int, tolerance: float | None = None) -> Sweep:
        """Sweep with some moduli.

        Args:
            moduli: The moduli.
            iteration: Number of the iteration.
            tolerance: Relative residual of every line [-]; if ``None`` the scene's, or what the
                end of its loop needs. A direct sweep is as good as it is.

        Returns:
            The sweep.
        """
        solver, excitation = self._solver, self._excitation
        with self._observer.phase("assembly"):
            parts = complex_constants(self._ground, moduli, solver.complex_modulus, solver.keep)
            lapse = self._equations.assemble(self._ground, *parts)
        with self._observer.phase("sweep"):
            arguments = lapse.system, lapse.loads, excitation.s
            across = self._equations.across

            def report(done: int, total: int) -> None:
                self._observer.sweeping(iteration, done, total)

            sweep: Sweep
            if solver.sweep == "direct":
                sweep = direct_sweep(*arguments, solver.tolerance, report, across)
            else:
                self.tolerance = self.finest if tolerance is None else tolerance
                reduced = reduced_sweep(
                    *arguments,
                    self.tolerance,
                    report,
                    self._expansions,
                    block=_BLOCK[self._equations.gdim],
                    across=across,
                )
                self._expansions, sweep = reduced.expansions, reduced
        self.last, self.constants = sweep, parts[0]
        self.tally.factorisations += sweep.factorisations
        self.tally.solves += sweep.solves
        return sweep
