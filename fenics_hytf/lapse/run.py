# SPDX-License-Identifier: MIT
"""One lapse: sweeps with given moduli, the equivalent-linear loop round them, and what slips."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fenics_hytf.frequency import (
    AffineLoads,
    Columns,
    DynamicSystem,
    Loads,
    Sweep,
    direct_sweep,
    negative_eigenvalues,
    reduced_sweep,
)
from fenics_hytf.lapse.cells import CellProbe
from fenics_hytf.lapse.continuity import Continuity
from fenics_hytf.lapse.equations import Equations, LapseEquations
from fenics_hytf.lapse.equivalent_linear import iterate
from fenics_hytf.lapse.errors import GeometricInstability
from fenics_hytf.lapse.excitation import Excitation
from fenics_hytf.lapse.ground import Ground, Moduli
from fenics_hytf.lapse.material import Material, material
from fenics_hytf.lapse.records import LoopHistory
from fenics_hytf.lapse.response import Response
from fenics_hytf.lapse.sliding import Sliding
from fenics_hytf.lapse.slipped import Slipped
from fenics_hytf.scene import Scene

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_LOOSEST = 1e-2  # residual of a sweep that only tells the loop where to go
# Directions a factorisation is used for: it costs 6 to 8 solves in sections, some 40 in solids.
_BLOCK = {2: 14, 3: 24}
# Groups of ranks take a point each a round, and a round costs the factorisation: wider blocks spare
# rounds. In a block of 40 000 unknowns two points of 30 do what three of 24 and less did.
_WIDER = 1.25
_IN_REACH = 1e-10  # residual that round-off leaves in reach of every reduced sweep
_SHARE = 1e-2  # of the last change of the moduli, as a residual
_BEFORE_GROWTH = 0.1  # e^{−ηT}: on a damped contour the error grows by e^{ηT} within a lapse


def asked_residual(tolerance: float, transient: bool, sweep: str) -> float:
    """What a lapse asks of every line, lest its motion be off by more than a tolerance.

    Args:
        tolerance: Relative residual of the motion [-].
        transient: Whether lines lie on a damped contour.
        sweep: ``direct``, which is as good as it is and only has to show that, or ``reduced``.

    Returns:
        Relative residual of a line [-].
    """
    if sweep == "direct" or not transient:
        return tolerance
    return max(_BEFORE_GROWTH * tolerance, min(tolerance, _IN_REACH))


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
        response: The response.
        moduli: Moduli it was solved with.
        material: The law that they made.
        effective_strain: Of every cell [-], or ``None`` without the equivalent-linear loop.
        loop: History of the loop.
        tally: Factorisations and solves.
        slip: What slipped, where the scene calls for sliding.
    """

    response: Response
    moduli: Moduli
    material: Material
    effective_strain: RealArray | None
    loop: LoopHistory
    tally: Tally = field(default_factory=Tally)
    slip: Slipped | None = None

    @property
    def excitation(self) -> Excitation:
        """The input at the solved lines."""
        return self.response.excitation


def solve(
    scene: Scene,
    equations: Equations,
    ground: Ground,
    excitation: Excitation,
    continuity: Continuity,
    probe: CellProbe,
    start: RealArray,
    observer: Observer,
    strain_from: npt.NDArray[np.intp] | None = None,
    sliding: Sliding | None = None,
) -> Solved:
    """Solve a lapse: one sweep, or the equivalent-linear loop round it; then what slips.

    The moduli are those of the response without slip: what yields is not to make the ground round
    it softer as well.

    Args:
        scene: The scene.
        equations: The equations, their mass weighed and their stress carried.
        ground: The ground.
        excitation: The input.
        continuity: How the lapse hangs together with the one before; it has begun the lapse.
        probe: Evaluates strain in the cells.
        start: First effective strain of every cell [-], shape ``(num_cells,)``.
        observer: Where to report.
        strain_from: See :func:`iterate`.
        sliding: Has found the mechanism of the lapse, where the scene calls for one.

    Returns:
        The solution.

    Raises:
        SweepError: A line cannot be solved.
        EquivalentLinearError: The loop reaches its limit.
        GeometricInstability: The ground buckles under its weight.
    """
    sweeps = _Sweeps(scene, equations, ground, excitation, continuity, observer)

    def peak_strain(moduli: Moduli, iteration: int) -> RealArray:
        response, law = sweeps.solve(moduli, iteration, sweeps.tolerance_so_far)
        with observer.phase("response"):
            return probe.peak_strain(response, continuity.carried(law))

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
    response, law = sweeps.last
    if scene.effects.geometric_stiffness and scene.effects.gravity is not None:
        sweeps.require_stability()
    slip = None
    if sliding is not None:
        response, slip = sliding.slip(response, sweeps.equations, sweeps.again, sweeps.kernel)
    return Solved(response, moduli, law, effective, loop, sweeps.tally, slip)


class _Sweeps:
    """The sweeps of a lapse, each with other moduli; one that is reduced learns from the last."""

    def __init__(
        self,
        scene: Scene,
        equations: Equations,
        ground: Ground,
        excitation: Excitation,
        continuity: Continuity,
        observer: Observer,
    ) -> None:
        self._solver, self._equations, self._ground = scene.solver, equations, ground
        self._excitation, self._continuity, self._observer = excitation, continuity, observer
        self._change = 1.0
        self._expansions: tuple[int, ...] = ()
        self._directions: Columns | None = None  # of the kernel
        self.tally = Tally()
        loop = scene.effects.equivalent_linear
        needed = self._solver.tolerance
        if loop is not None:  # what the strain is off by must not keep the loop from its end
            needed = min(needed, max(_SHARE * loop.tolerance, _IN_REACH))
        self.finest = self.tolerance = self._asked(needed)
        self.last: tuple[Response, Material] | None = None
        self.equations: LapseEquations
        wider = _WIDER if equations.across.size > 1 else 1
        self._block = round(_BLOCK[equations.gdim] * wider)

    def iterated(self, iteration: int, change: float) -> None:
        """Take note of the change of an iteration, and pass it on."""
        self._change = change
        self._observer.iterated(iteration, change)

    @property
    def tolerance_so_far(self) -> float:
        """What an iteration needs: a hundredth of what the moduli still change by."""
        return max(self.finest, self._asked(min(_LOOSEST, _SHARE * self._change)))

    def _asked(self, tolerance: float) -> float:
        return asked_residual(tolerance, self._excitation.eta > 0, self._solver.sweep)

    def solve(
        self, moduli: Moduli, iteration: int, tolerance: float | None = None
    ) -> tuple[Response, Material]:
        """Solve the lapse with some moduli.

        Args:
            moduli: The moduli.
            iteration: Number of the iteration.
            tolerance: Relative residual of every line [-]; if ``None`` the scene's, or what the
                end of its loop needs. A direct sweep is as good as it is.

        Returns:
            The response, and the law of the moduli.
        """
        with self._observer.phase("assembly"):
            law = material(self._ground, moduli, self._solver)
            lapse = self.equations = self._equations.assemble(self._ground, law)

        def sweep(loads: Sequence[PETSc.Vec] | Loads) -> Sweep:
            return self._sweep(lapse.system, loads, iteration, tolerance)

        with self._observer.phase("sweep"):
            self.last = self._continuity.respond(sweep, lapse, law), law
        self.tally.factorisations += self.last[0].start_factorisations
        return self.last

    def require_stability(self) -> None:
        """See that the ground does not buckle under its weight, as its moduli are now (collective).

        Raises:
            GeometricInstability: The stiffness is not definite; on every rank.
        """
        with self._observer.phase("sweep"):
            negative = negative_eigenvalues(self.equations.lasting)
        self.tally.factorisations += 1
        if negative:
            raise GeometricInstability(negative)

    def again(self, loads: Sequence[PETSc.Vec] | Loads) -> Sweep:
        """Sweep the equations of the last solution for other right-hand sides.

        With the directions of the kernel to begin with: they are those of the same force.
        """
        with self._observer.phase("sweep"):
            return self._sweep(self.equations.system, loads, 0, None, self._directions)

    def kernel(self, loads: AffineLoads, s: ComplexArray, tolerance: float) -> Sweep:
        """Sweep them at other complex frequencies; again and again for the same force."""
        with self._observer.phase("sweep"):
            across = self._equations.across
            sweep = reduced_sweep(
                self.equations.system,
                loads,
                s,
                tolerance,
                block=self._block,
                across=across,
                directions=self._directions,
            )
        self._directions = sweep.basis
        self.tally.factorisations += sweep.factorisations
        self.tally.solves += sweep.solves
        return sweep

    def _sweep(
        self,
        system: DynamicSystem,
        loads: Sequence[PETSc.Vec] | Loads,
        iteration: int,
        tolerance: float | None,
        directions: Columns | None = None,
    ) -> Sweep:
        """Sweep a system over the lines of the lapse."""
        arguments = system, loads, self._excitation.s
        across = self._equations.across

        def report(done: int, total: int) -> None:
            self._observer.sweeping(iteration, done, total)

        sweep: Sweep
        if self._solver.sweep == "direct":
            asked = self._asked(self._solver.tolerance)
            sweep = direct_sweep(*arguments, asked, report, across)
        else:
            self.tolerance = self.finest if tolerance is None else tolerance
            reduced = reduced_sweep(
                *arguments,
                self.tolerance,
                report,
                self._expansions if directions is None else (),
                block=self._block,
                across=across,
                directions=directions,
            )
            sweep = reduced
            if directions is None:
                self._expansions = reduced.expansions
        self.tally.factorisations += sweep.factorisations
        self.tally.solves += sweep.solves
        return sweep
