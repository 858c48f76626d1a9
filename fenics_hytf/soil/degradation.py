# SPDX-License-Identifier: MIT
"""Cyclic degradation: the modulus falls with the number of cycles that the soil went through.

- I. M. Idriss, R. Dobry, R. D. Singh, Nonlinear behavior of soft clays during cyclic loading,
  Journal of the Geotechnical Engineering Division 104(GT12), 1978, 1427-1447: the degradation index
  is the secant modulus in cycle N over that in cycle 1, at the same strain amplitude,

      δ = G_N / G_1 = N^(-t)

- M. Vucetic, Cyclic threshold shear strains in soils, Journal of Geotechnical Engineering 120(12),
  1994, 2208-2228: below a threshold γ_tv nothing degrades, however many the cycles. It is near 1e-4
  in sands and grows with plasticity: 2.4e-4 to 6e-4 at plasticity indices of 14 to 30 (C.-C. Hsu,
  M. Vucetic, Journal of Geotechnical and Geoenvironmental Engineering 132(10), 2006, 1325-1335).
- N. Matasovic, M. Vucetic, Generalized cyclic-degradation-pore-pressure generation model for clays,
  Journal of Geotechnical Engineering 121(1), 1995, 33-42: with strains in **percent**,

      t = s (γ_c - γ_tv)^r,   γ_tv < γ_c

  and δ scales the stress of the whole backbone: τ = δ τ_1(γ), that is, G = δ G_max (G/G_max)(γ).

Strains are ratios here, as everywhere in this package; they are turned into percent for t alone, so
that s and r are the published numbers.

N counts from 1: soil that was never sheared is about to go through its first cycle, has N = 1 and
δ = 1. After n cycles of one amplitude it is about to go through cycle n + 1 and δ = (n + 1)^(-t):
the first cycle alone lowers the modulus of the second. Where amplitudes vary, δ is what the soil
remembers: it stands for N = δ^(-1/t) cycles of the amplitude that comes next, t being that of this
amplitude, and n more of them make δ = (N + n)^(-t); a half cycle is n = 1/2.

Cycles are those of rainflow counting (ASTM E1049-85, 5.4.4) by the package rainflow, their
amplitude half their range, in the order in which they are complete. The counting goes on from lapse
to lapse: a cycle that a lapse cuts is complete when a later lapse closes it. What is still open,
the residue, is a few turning points whose ranges shrink; only they are kept. Counted in pieces or
at once, the cycles are the same, to the last bit. Until its cycles are closed the residue counts as
half cycles, as at the end of a history, but for the time being only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

RealArray = npt.NDArray[np.float64]

_PERCENT = 100.0
_LARGEST_THRESHOLD = 0.1


@dataclass(frozen=True, eq=False)
class Cycles:
    """Counted cycles, in the order in which they were complete.

    Attributes:
        amplitude: Half the range of each [-], shape ``(num_cycles,)``.
        count: 1 for a cycle, 0.5 for half a cycle, shape ``(num_cycles,)``.
    """

    amplitude: RealArray
    count: RealArray


def continue_count(
    history: npt.ArrayLike, residue: npt.ArrayLike = (), smallest: float = 0.0
) -> tuple[Cycles, RealArray]:
    """Count the cycles that a piece of a history completes.

    Args:
        history: Signed shear strain of the piece [-], shape ``(num_samples,)``.
        residue: What the piece before left open, shape ``(num_turning_points,)``; empty at first.
        smallest: Cycles up to this range [-] may be missed; the residue is then the shorter.

    Returns:
        The cycles that are complete; and the residue, turning points whose ranges strictly
        decrease, the last one the last sample if ``smallest`` is 0.

    Raises:
        ValueError: If the history is not a row of at least one finite number.
        ImportError: If the package rainflow is not installed.
    """
    strain = _checked(history, 1)
    points = _turning_points(np.concatenate([np.asarray(residue, dtype=np.float64), strain]))
    # The library takes a point for the last one when the next is the same.
    series = [float(point) for point in points]
    found = list(_rainflow()([*series, series[-1]]))
    num_open = _num_open(found)
    complete = found[: len(found) - num_open]
    tail = [points[cycle[3]] for cycle in found[len(complete) :]]
    left = np.array([*tail, points[-1]])
    negligible = np.flatnonzero(np.abs(np.diff(left)) <= smallest)
    if negligible.size:
        left = left[: negligible[0] + 2]
    return (
        Cycles(
            np.array([0.5 * cycle[0] for cycle in complete]),
            np.array([float(cycle[2]) for cycle in complete]),
        ),
        left,
    )


def open_cycles(residue: npt.ArrayLike) -> Cycles:
    """Half cycles of a residue, the largest first.

    Args:
        residue: Turning points [-], shape ``(num_turning_points,)``.

    Returns:
        One half cycle from each to the next.
    """
    amplitude = 0.5 * np.abs(np.diff(np.asarray(residue, dtype=np.float64)))
    return Cycles(amplitude, np.full(amplitude.size, 0.5))


@dataclass(frozen=True, eq=False)
class CyclicState:
    """What cells remember of their cycles: all that a checkpoint needs.

    Attributes:
        index: δ [-], by which G is lowered, half cycles of the residue included; shape
            ``(num_cells,)``.
        settled: δ by the complete cycles alone [-], shape ``(num_cells,)``.
        turning_points: Residue of each cell [-], filled up with NaN, shape ``(num_cells, width)``.
    """

    index: RealArray
    settled: RealArray
    turning_points: RealArray

    @classmethod
    def undegraded(cls, num_cells: int) -> CyclicState:
        """Cells that went through no cycle.

        Args:
            num_cells: Their number.

        Returns:
            Their state.
        """
        return cls(np.ones(num_cells), np.ones(num_cells), np.empty((num_cells, 0)))


@dataclass(frozen=True)
class DegradationLaw:
    """How the degradation index falls with the cycles.

    The defaults are those of Matasovic and Vucetic (1995) for a normally consolidated marine clay.

    Attributes:
        threshold: γ_tv, the shear strain amplitude up to which nothing degrades [-].
        s: s of t = s (γ_c - γ_tv)^r, for strains in percent [-].
        r: r of it [-].
        minimum: δ never falls below [-]. A guard that keeps the stiffness from vanishing, not a
            property of the soil: with the other defaults 0.1 takes 2e4 cycles of 10 % strain.
    """

    threshold: float = 1e-3
    s: float = 0.075
    r: float = 0.495
    minimum: float = 0.1

    def __post_init__(self) -> None:
        limit = _LARGEST_THRESHOLD
        strain = f"a shear strain above 0 and below {limit:g}, not in percent"
        _check("threshold", self.threshold, 0.0 < self.threshold < limit, strain)
        _check("s", self.s, 0.0 < self.s < np.inf, "a positive number")
        _check("r", self.r, 0.0 < self.r < np.inf, "a positive number")
        inside = 0.0 < self.minimum < 1.0
        _check("minimum", self.minimum, inside, "a number between 0 and 1")

    def parameter(self, strain: npt.ArrayLike) -> RealArray:
        """Degradation parameter t of an amplitude.

        Args:
            strain: Shear strain amplitude γ_c [-], any shape.

        Returns:
            t [-], 0 up to the threshold, with the shape of ``strain``.
        """
        excess = np.asarray(strain, dtype=np.float64) - self.threshold
        return np.asarray(self.s * (_PERCENT * np.maximum(excess, 0.0)) ** self.r)

    def degrade(
        self, index: npt.ArrayLike, amplitude: npt.ArrayLike, cycles: npt.ArrayLike = 1.0
    ) -> RealArray:
        """The degradation index after more cycles of one amplitude, (δ^(-1/t) + cycles)^(-t).

        Args:
            index: δ before [-], from ``minimum`` to 1; 1 for soil that went through no cycle.
            amplitude: Shear strain amplitude of the cycles [-].
            cycles: Their number, not negative, 0.5 for half a cycle [-].

        Returns:
            δ after [-], at most ``index`` and at least ``minimum``; ``index`` itself up to the
            threshold. The shape is that of the arguments together.

        Raises:
            ValueError: If an argument is out of range.
        """
        before, gamma, number = (
            np.asarray(value, dtype=np.float64) for value in (index, amplitude, cycles)
        )
        in_range = (before >= self.minimum) & (before <= 1.0)
        _check("index", before, in_range, f"numbers from {self.minimum:g} to 1")
        _check("amplitude", gamma, (gamma >= 0.0) & (gamma < np.inf), "strains not below 0")
        _check("cycles", number, (number >= 0.0) & (number < np.inf), "numbers not below 0")
        t = self.parameter(gamma)
        # Near the threshold N = δ^(-1/t) is beyond all numbers; its inverse is just 0.
        with np.errstate(divide="ignore", over="ignore", under="ignore"):
            inverse = before ** (1.0 / t)
            after = before * np.exp(-t * np.log1p(number * inverse))
        return np.asarray(np.clip(after, self.minimum, before))

    def after_lapse(
        self,
        state: CyclicState,
        history: npt.ArrayLike,
        degrades: npt.NDArray[np.bool_] | None = None,
    ) -> CyclicState:
        """State of the cells after one more lapse.

        Cells whose strain never left a range of twice the threshold cost nothing.

        Args:
            state: Their state before.
            history: Signed shear strain of the lapse [-], shape ``(num_cells, num_samples)``.
            degrades: Cells whose soil degrades, shape ``(num_cells,)``; all if ``None``.

        Returns:
            Their state after. The index never rises.

        Raises:
            ValueError: If the history is not finite, or not one of these cells.
            ImportError: If the package rainflow is not installed and some cell needs it.
        """
        strain = _checked(history, 2)
        if len(strain) != state.index.size:
            raise ValueError(
                f"history: found {len(strain)} cells; expected {state.index.size}, as in the state"
            )
        some = np.full(len(strain), True) if degrades is None else np.asarray(degrades, np.bool_)
        before = state.turning_points
        low = np.fmin(strain.min(axis=1), np.fmin.reduce(before, axis=1, initial=np.inf))
        high = np.fmax(strain.max(axis=1), np.fmax.reduce(before, axis=1, initial=-np.inf))
        smallest = 2.0 * self.threshold
        active = np.flatnonzero(some & (high - low > smallest))
        # Of cycles too small to count, only their extremes may be part of larger ones to come.
        residues: list[Sequence[float] | RealArray] = list(np.column_stack([low, high]))
        for cell in np.flatnonzero(~some):
            residues[cell] = []
        closed = []
        for cell in active:
            points = before[cell]
            cycles, residues[cell] = continue_count(
                strain[cell], points[~np.isnan(points)], smallest
            )
            closed.append(cycles)
        settled, index = state.settled.copy(), state.index.copy()
        settled[active] = self._through(settled[active], closed)
        pending = [open_cycles(residues[cell]) for cell in active]
        index[active] = np.minimum(index[active], self._through(settled[active], pending))
        return CyclicState(index, settled, _stacked(residues))

    def _through(self, index: RealArray, cycles: Sequence[Cycles]) -> RealArray:
        """Indices of cells after the cycles of each, one cycle of every cell at a time."""
        large = [c.amplitude > self.threshold for c in cycles]
        amplitude = _stacked([c.amplitude[w] for c, w in zip(cycles, large, strict=True)])
        count = _stacked([c.count[w] for c, w in zip(cycles, large, strict=True)])
        for column in range(amplitude.shape[1]):
            gamma, number = amplitude[:, column], count[:, column]
            there = ~np.isnan(gamma)
            index[there] = self.degrade(index[there], gamma[there], number[there])
        return index


def _rainflow() -> Callable[[Iterable[float]], Iterable[tuple[float, float, float, int, int]]]:
    """The library's counting: range, mean, count, and the places of both turning points."""
    try:
        from rainflow import extract_cycles
    except ImportError as error:
        raise ImportError(
            "degradation: found no package rainflow; expected it to be installed, as cycles are "
            "counted with it; run 'pip install rainflow'"
        ) from error
    return extract_cycles


def _num_open(found: Sequence[tuple[float, float, float, int, int]]) -> int:
    """How many of the counted cycles are half cycles only because the history ends.

    A half cycle is complete when the next one is at least as large. Those that are open are the
    last ones, each smaller than the one before.
    """
    number, larger = 0, 0.0
    for extent, _, count, _, _ in reversed(found):
        if count == 1.0 or extent <= larger:
            break
        number, larger = number + 1, extent
    return number


def _turning_points(x: RealArray) -> RealArray:
    """The first value, those where the direction changes, the last one."""
    x = x[np.append(True, x[1:] != x[:-1])]
    rising = x[1:] > x[:-1]
    turns = rising[1:] != rising[:-1]
    return x[np.concatenate([[True], turns, [True]])] if x.size > 1 else x


def _stacked(rows: Sequence[Sequence[float] | RealArray]) -> RealArray:
    """Rows of several lengths as one array, filled up with NaN."""
    width = max((len(row) for row in rows), default=0)
    stacked = np.full((len(rows), width), np.nan)
    for row, place in zip(rows, stacked, strict=True):
        place[: len(row)] = row
    return stacked


def _checked(history: npt.ArrayLike, ndim: int) -> RealArray:
    """A history as an array of finite numbers, at least one sample."""
    strain = np.asarray(history, dtype=np.float64)
    shape = "(num_samples,)" if ndim == 1 else "(num_cells, num_samples)"
    if strain.ndim != ndim or not strain.shape[-1]:
        raise ValueError(f"history: found shape {strain.shape}; expected {shape}")
    if not np.isfinite(strain).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(strain))[0])
        raise ValueError(f"history: found {strain[place]} at {place}; expected finite strains")
    return strain


def _check(name: str, value: object, inside: bool | npt.NDArray[np.bool_], expected: str) -> None:
    """Refuse values that are out of range, the first of them named."""
    if not np.all(inside):
        wrong = np.asarray(value)[~np.asarray(inside)].flat[0]
        raise ValueError(f"degradation.{name}: found {wrong}; expected {expected}")
