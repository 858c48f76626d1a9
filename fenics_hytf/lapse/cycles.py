# SPDX-License-Identifier: MIT
"""Degradation by counted cycles: what each lapse leaves of the shear modulus of the next.

Cycles are counted in cells, in the shear strain along the direction of the lapse's largest one:

    γ(t) = γ_max e(t):e_max / e_max:e_max

with e the deviator of the strain, so that γ has a sign and is γ_max at its peak.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fenics_hytf.domain import Domain
from fenics_hytf.lapse.cells import CarriedCells, CellProbe
from fenics_hytf.lapse.peaks import peak_shear_strain
from fenics_hytf.lapse.response import Response
from fenics_hytf.operators import NORMAL_STRAINS
from fenics_hytf.scene import Degradation
from fenics_hytf.soil import CyclicState

RealArray = npt.NDArray[np.float64]


class CycleCount:
    """The degradation of every cell, lapse by lapse; the same on every rank.

    Args:
        settings: The scene's degradation.
        domain: The domain.

    Attributes:
        state: Of every cell, in the order of the input.
    """

    def __init__(self, settings: Degradation, domain: Domain) -> None:
        self._law, self._domain = settings.law, domain
        names = domain.region_names
        self._degrades = np.array([settings.soils is None or n in settings.soils for n in names])
        self.state = CyclicState.undegraded(domain.num_cells)

    def count(
        self,
        probe: CellProbe,
        response: Response,
        carried: CarriedCells | None,
        region: npt.NDArray[np.int32],
    ) -> None:
        """Count the cycles of a lapse (collective).

        Args:
            probe: Evaluates the strain in the cells.
            response: The response of the lapse.
            carried: What the lapse began with.
            region: Soil of every cell in the order of the input, shape ``(num_cells,)``.
        """
        found = []
        for some, strain in probe.strains(response, carried):
            cells = self._domain.input_cells[some]
            before = CyclicState(
                self.state.index[cells],
                self.state.settled[cells],
                self.state.turning_points[cells],
            )
            history = signed_shear(np.asarray(strain, np.float64))
            after = self._law.after_lapse(before, history, self._degrades[region[cells]])
            found.append((cells, after))
        every = [part for parts in self._domain.comm.allgather(found) for part in parts]
        if self._domain.across.size > 1:
            shares = self._domain.across.allgather(every)
            every = [part for share in shares for part in share]
        width = max((part.turning_points.shape[1] for _, part in every), default=0)
        index, settled = self.state.index.copy(), self.state.settled.copy()
        turning_points = np.full((len(index), width), np.nan)
        for cells, part in every:
            index[cells], settled[cells] = part.index, part.settled
            turning_points[cells, : part.turning_points.shape[1]] = part.turning_points
        self.state = CyclicState(index, settled, turning_points)


def signed_shear(strain: RealArray) -> RealArray:
    """Shear strain with a sign, along the direction of its largest value.

    Args:
        strain: Voigt columns, shear as γ = 2ε [-], shape ``(n, 2, 3 or 6, num_samples)``: two
            columns are the shears across a section, three those of plane strain in its plane.

    Returns:
        Shape ``(n, num_samples)``. Of the two senses of a direction the one along which its largest
        component is positive, so that it does not change from lapse to lapse.
    """
    deviator = strain.copy()
    normal = NORMAL_STRAINS[strain.shape[1]]
    deviator[:, normal:] /= np.sqrt(2.0)  # ε:ε counts a shear component twice, γ²/2
    if normal:
        deviator[:, :normal] -= strain[:, :normal].mean(axis=1, keepdims=True)
    size = np.einsum("nct,nct->nt", deviator, deviator)
    at = np.argmax(size, axis=1)
    cells = np.arange(len(strain))
    direction = deviator[cells, :, at]
    chief = direction[cells, np.argmax(np.abs(direction), axis=1)]
    largest = peak_shear_strain(np.ascontiguousarray(strain[cells, :, at])[:, :, None])
    square = size[cells, at]
    scale = np.where(square > 0, np.sign(chief) * largest / np.where(square > 0, square, 1.0), 0.0)
    return np.asarray(np.einsum("nct,nc->nt", deviator, direction) * scale[:, None])
