# SPDX-License-Identifier: MIT
"""What a lapse leaves behind: plain records, the same on every rank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fenics_hytf.lapse.energy import Energy
from fenics_hytf.particles import MassLedger

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class CellState:
    """Cell values of one lapse, all cells of all ranks in the order of the input mesh.

    Attributes:
        region: Index into the mesh's region names, shape ``(num_cells,)``.
        centroid: [m], shape ``(num_cells, gdim)``.
        shear_modulus: Secant shear modulus G [Pa], shape ``(num_cells,)``.
        g_over_gmax: G over its small-strain value [-], shape ``(num_cells,)``.
        damping: Damping ratio D [-], shape ``(num_cells,)``.
        effective_strain: Effective shear strain [-] (strain ratio times the peak where the
            equivalent-linear loop runs, else the peak), shape ``(num_cells,)``.
        peak_strain: Largest shear strain over the lapse [-], shape ``(num_cells,)``.
        peak_stress: Largest shear stress over the lapse [Pa], shape ``(num_cells,)``.
        peak_acceleration: Largest total acceleration at the cell centre, Euclidean norm of the
            components [m/s^2], shape ``(num_cells,)``.
        peak_velocity: Largest velocity there relative to the base, norm [m/s], shape
            ``(num_cells,)``.
        peak_displacement: Largest displacement there relative to the base, norm [m], shape
            ``(num_cells,)``.
        change: Last change of the equivalent-linear loop [-], nought where the cell is linear,
            shape ``(num_cells,)``.
        degradation: What counted cycles have left of the modulus in the lapse [-], shape
            ``(num_cells,)``; ``None`` where nothing degrades.
        fill: Volume of the soil in the cell over that of the cell [-], each point's spread over its
            piece, shape ``(num_cells,)``; ``None`` where all cells are full. An empty cell has no
            state.
    """

    region: npt.NDArray[np.int32]
    centroid: RealArray
    shear_modulus: RealArray
    g_over_gmax: RealArray
    damping: RealArray
    effective_strain: RealArray
    peak_strain: RealArray
    peak_stress: RealArray
    peak_acceleration: RealArray
    peak_velocity: RealArray
    peak_displacement: RealArray
    change: RealArray
    degradation: RealArray | None = None
    fill: RealArray | None = None


@dataclass(frozen=True)
class LoopHistory:
    """How the equivalent-linear loop went.

    Attributes:
        change: Per iteration max over cells of ``|G_new - G_old|/G_new`` and ``|dD|/D`` [-].
        worst_cell: Per iteration the input index of the cell that changed most.
        last: Change of every cell in the last iteration [-], shape ``(num_cells,)``.
    """

    change: tuple[float, ...] = ()
    worst_cell: tuple[int, ...] = ()
    last: RealArray | None = None


@dataclass(frozen=True)
class SlipResult:
    """What slipped in a lapse.

    Attributes:
        yield_coefficient: k_y [-].
        factor_of_safety: At rest, before shaking [-]; infinite where gravity shears nothing.
        direction: Component in which the mechanism is driven.
        sense: Of the motion that drives it along that, 1 or -1.
        time_step: Of the march [s].
        slip: λ from the start of the lapse to its end [m], shape ``(num_steps,)``.
        rate: λ̇ [m/s], likewise.
        driving: Acceleration of the linear response that drives the mechanism [m/s^2], likewise.
        rigid: What Newmark's rigid block slips in the lapse, times φᵀM r/φᵀMφ to be compared with
            λ [m].
        decoupled: Likewise of a rigid block under ``driving`` [m].
        mass: φᵀM r, what the mechanism carries [kg, in 2D kg/m].
        modal_mass: φᵀMφ [kg, in 2D kg/m].
        dissipation: ∫τ_f γ(φ) dV, what a metre of slip costs [N, in 2D N/m].
        shear_strain: γ(φ) in the middle of every cell [1/m], shape ``(num_cells,)``.
        iterations: Flows that the search for the mechanism took.
    """

    yield_coefficient: float
    factor_of_safety: float
    direction: str
    sense: int
    time_step: float
    slip: RealArray
    rate: RealArray
    driving: RealArray
    rigid: float
    decoupled: float
    mass: float
    modal_mass: float
    dissipation: float
    shear_strain: RealArray
    iterations: int

    @property
    def slid(self) -> bool:
        """Whether there was any slip."""
        return bool(self.slip[-1] > 0)


@dataclass(frozen=True)
class SofteningResult:
    """What the stiffness-reduction estimate has come to at the end of a lapse.

    Attributes:
        softest: Least G over its small-strain value up to then, all cells in the order of the input
            [-], shape ``(num_cells,)``.
        displacement: Permanent displacement of the receivers since the start [m], shape
            ``(num_receivers, num_components)``.
        largest: That of the point that has moved farthest [m].
    """

    softest: RealArray
    displacement: RealArray
    largest: float


@dataclass(frozen=True)
class LapseResult:
    """One lapse.

    Attributes:
        index: Number of the lapse, from 0.
        start_time: Time of the first sample [s].
        num_samples: Samples in the lapse.
        dt: Time step [s].
        excited_lines: Lines of the spectrum above the scene's threshold.
        solved_lines: Lines solved (each counted once, whatever the number of iterations).
        factorisations: Factorisations over all iterations.
        solves: Solves over all iterations.
        worst_residual: Largest relative residual of the final sweep [-].
        loop: History of the equivalent-linear loop; empty without it.
        frequency: Solved lines [Hz], shape ``(solved_lines,)``.
        transfer: Total acceleration over the input as given, shape
            ``(num_receivers, num_components, num_motions, solved_lines)`` [-].
        displacement: Relative to the base [m], shape
            ``(num_receivers, num_components, num_samples)``.
        velocity: Relative [m/s], same shape.
        acceleration: Relative [m/s^2], same shape.
        total_acceleration: [m/s^2], same shape.
        within: Total acceleration of the base in the direction of each motion [m/s^2], shape
            ``(num_motions, num_samples)``.
        outcrop: Acceleration of the bare rock likewise, or ``None`` where it is not known.
        cells: Values of the cells.
        seam_error: Estimate of the error that the hand-over from the lapse before brought: the
            larger of the jumps of displacement and velocity of the points over their peaks in the
            cells [-]; ``None`` where nothing was handed over.
        energy: Energy ledger, or ``None`` under ``steady`` continuity or a law that is not causal.
        ledger: Points and their mass after the lapse's convective phase.
        slip: What slipped, or ``None`` where the scene does not call for sliding.
        softening: What softening has brought, or ``None`` where the scene does not call for it.
    """

    index: int
    start_time: float
    num_samples: int
    dt: float
    excited_lines: int
    solved_lines: int
    factorisations: int
    solves: int
    worst_residual: float
    loop: LoopHistory
    frequency: RealArray
    transfer: ComplexArray
    displacement: RealArray
    velocity: RealArray
    acceleration: RealArray
    total_acceleration: RealArray
    within: RealArray
    outcrop: RealArray | None
    cells: CellState
    seam_error: float | None
    energy: Energy | None
    ledger: MassLedger
    slip: SlipResult | None = None
    softening: SofteningResult | None = None
