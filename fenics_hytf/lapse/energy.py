# SPDX-License-Identifier: MIT
"""The energy of a lapse: what comes in, what is stored, what is lost.

With u relative to the motion that is given, the power of the input is that of the inertia forces,
−M r a·u̇. What is stored is kinetic, ½ u̇ᵀM u̇, and in the springs of the law, ½ γ:D_r:γ and
½ ζ_m:D_m:ζ_m; what is lost goes into dashpots, u̇ᵀC u̇, and those of the Maxwell branches,
ζ_m:D_m:ζ_m/τ_m. The rest of stress that moduli leave when they change at a seam does work of its
own while it fades. The balance of all that does not close by itself: it is a check.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Energy:
    """Energy ledger of one lapse [J, in 2D J/m].

    Attributes:
        input: Work of the base motion, and of what static stress leaves out of balance.
        damping: Lost in the ground and in dashpots.
        rest: Work done against the rest of stress that fades after the moduli have changed.
        kinetic: At the start and at the end, of what slips as well.
        strain: In the springs of the law, likewise.
        seam: Stored at the start less stored at the end of the lapse before.
        slip: Lost in the mechanism beyond what gravity brings, Q_y λ.
    """

    input: float
    damping: float
    rest: float
    kinetic: tuple[float, float]
    strain: tuple[float, float]
    seam: float
    slip: float = 0.0

    @property
    def stored(self) -> tuple[float, float]:
        """Kinetic and strain energy at the start and at the end."""
        return self.kinetic[0] + self.strain[0], self.kinetic[1] + self.strain[1]

    @property
    def imbalance(self) -> float:
        """Input less what was lost, released and stored; nought but for numerical errors."""
        start, end = self.stored
        return self.input - self.damping - self.rest - self.slip - (end - start)
