# SPDX-License-Identifier: MIT
"""The energy of lapses, and of the run, as ``summary.json`` has it.

Energies are in J, in two dimensions of a slice one metre thick, J/m; ``unit`` says which. Over the
lapses of a run

    Σ input − Σ damping − Σ rest − Σ slip + Σ seam − Σ imbalance
        = stored at the end − stored at the start

with what mechanisms take beyond what gravity brings them (``slip``), what the seams put in
(``seam``, stored at the start of a lapse less at the end of the one before) and what does not close
(``imbalance``).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fenics_hytf.lapse import Energy, LapseResult

_SUMMED = ("input", "damping", "rest", "slip", "seam", "imbalance")


def energy_unit(gdim: int) -> str:
    """J, or J/m in two dimensions."""
    return "J" if gdim == 3 else "J/m"


def ledger(energy: Energy | None, gdim: int) -> dict[str, Any] | None:
    """The ledger of one lapse.

    Args:
        energy: As the lapse has it, or ``None``.
        gdim: Dimension of the mesh.

    Returns:
        ``unit``, ``input``, ``damping``, ``rest``, ``slip``, ``kinetic`` and ``strain`` at the
        start and the end, ``seam``, ``imbalance``; ``None`` where there is none.
    """
    if energy is None:
        return None
    return {"unit": energy_unit(gdim), **vars(energy), "imbalance": energy.imbalance}


def totals(lapses: Sequence[LapseResult], gdim: int) -> dict[str, Any] | None:
    """The ledger of the run.

    Args:
        lapses: The lapses.
        gdim: Dimension of the mesh.

    Returns:
        ``unit``; sums of ``input``, ``damping``, ``rest``, ``slip``, ``seam`` and ``imbalance``;
        ``stored`` at the start and the end of the run; and ``worst_imbalance``, the largest
        imbalance of a lapse over the sum of what came in or went back [-], ``None`` without any.
        ``None`` where a lapse has no ledger.
    """
    energies = [lapse.energy for lapse in lapses if lapse.energy is not None]
    if not energies or len(energies) < len(lapses):
        return None
    turned_over = sum(abs(energy.input) for energy in energies)
    worst = max(abs(energy.imbalance) for energy in energies)
    return {
        "unit": energy_unit(gdim),
        **{name: sum(getattr(energy, name) for energy in energies) for name in _SUMMED},
        "stored": [energies[0].stored[0], energies[-1].stored[1]],
        "worst_imbalance": worst / turned_over if turned_over > 0.0 else None,
    }


def worst_seam_error(lapses: Sequence[LapseResult]) -> float | None:
    """Largest seam error of the lapses [-]; ``None`` where nothing was handed over."""
    errors = [lapse.seam_error for lapse in lapses if lapse.seam_error is not None]
    return max(errors, default=None)
