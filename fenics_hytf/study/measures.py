# SPDX-License-Identifier: MIT
"""How far a response is from another one: two measures that engineers and analysts each read.

- relative L2 of the total acceleration of a receiver, all its components together; of several
  receivers the worst one counts;
- max |ln PSA/PSA_ref|, 5 % damped pseudo-acceleration over 0.05 to 5 s, over all receivers and the
  components that move.

Of ground that slides the relative difference of its slip, and of what else is told of it, stands
beside them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fenics_hytf.motion import response_spectrum
from fenics_hytf.study.slip_measures import slip_errors

RealArray = npt.NDArray[np.float64]

PERIODS = np.geomspace(0.05, 5.0, 81)
"""Periods of the response spectra [s]: 40 a decade."""

DAMPING = 0.05

_STILL = 1e-9  # of the strongest receiver: rounding
_MOVES = 0.1  # of the strongest component's peak at a receiver: less is not looked at in spectra


@dataclass(frozen=True)
class Error:
    """Distance from the reference.

    Attributes:
        relative_l2: Of the worst receiver [-].
        ln_psa: Largest |ln PSA ratio| [-].
        receiver: Name of the worst receiver in L2.
        slides: Relative differences of what slid, by the keys of ``slip_measures.MEASURES`` [-].
    """

    relative_l2: float
    ln_psa: float
    receiver: str
    slides: Mapping[str, float] = field(default_factory=dict)


class Yardstick:
    """Measures responses against one of them.

    Args:
        reference: Total acceleration of the receivers [m/s^2], shape
            ``(num_receivers, num_components, num_samples)``.
        dt: Time step [s].
        names: Of the receivers.
        slid: What slid in the reference, by the keys of ``slip_measures.MEASURES``.

    Raises:
        ValueError: If the reference does not move, or is not a number somewhere.
    """

    def __init__(
        self,
        reference: RealArray,
        dt: float,
        names: Sequence[str],
        slid: Mapping[str, float] | None = None,
    ) -> None:
        if not np.isfinite(reference).all():
            raise ValueError("the reference response: found values that are not numbers")
        norms = np.linalg.norm(reference, axis=(1, 2))
        if not norms.max(initial=0.0) > 0:
            raise ValueError("the reference response: found no motion; expected a receiver's")
        self.reference, self.slid = reference, {} if slid is None else dict(slid)
        self._dt, self._names = dt, list(names)
        self._moving = norms > _STILL * norms.max()
        peaks = np.abs(reference).max(axis=2)
        self._components = (peaks > _MOVES * peaks.max(axis=1, keepdims=True)) & (
            self._moving[:, None]
        )
        self._spectra = self._spectrum(reference)

    def _spectrum(self, response: RealArray) -> RealArray:
        return response_spectrum(response[self._components], self._dt, PERIODS, DAMPING)

    def l2_by_receiver(self, difference: RealArray) -> RealArray:
        """Relative L2 norm of a difference; 0 for receivers that stand still.

        Args:
            difference: Shape ``(num_receivers, num_components, num_samples)``, or fewer samples.

        Returns:
            [-], shape ``(num_receivers,)``.
        """
        reference = self.reference[:, :, : difference.shape[2]]
        norms = np.linalg.norm(reference, axis=(1, 2))
        norms[~self._moving] = np.inf
        return np.asarray(np.linalg.norm(difference, axis=(1, 2)) / norms)

    def error(self, response: RealArray, slid: Mapping[str, float] | None = None) -> Error:
        """Distance of a response.

        Lapses that do not divide the record pad it; the samples that both have are compared.

        Args:
            response: As the reference; it may have more or fewer samples.
            slid: What slid.

        Returns:
            The distance.
        """
        num = min(response.shape[2], self.reference.shape[2])
        by_receiver = self.l2_by_receiver(response[:, :, :num] - self.reference[:, :, :num])
        worst = int(by_receiver.argmax())
        spectra = self._spectrum(self.fitted(response))
        with np.errstate(divide="ignore"):  # a response of nought is infinitely far in ln
            ratio = np.abs(np.log(spectra / self._spectra))
        slides = slip_errors(slid or {}, self.slid)
        return Error(float(by_receiver[worst]), float(ratio.max()), self._names[worst], slides)

    def distance(self, one: RealArray, other: RealArray) -> float:
        """Relative L2 norm of a difference, of the worst receiver [-]."""
        return float(self.l2_by_receiver(self.fitted(one) - self.fitted(other)).max())

    def products(self, vectors: Sequence[RealArray]) -> RealArray:
        """Inner products of responses, relative to the reference's square norm.

        Args:
            vectors: Each of the shape of the reference.

        Returns:
            Of each receiver [-], 0 for those that stand still, shape ``(num_receivers,
            num_vectors, num_vectors)``.
        """
        squares = np.sum(self.reference**2, axis=(1, 2))
        squares[~self._moving] = np.inf
        products = np.empty((len(squares), len(vectors), len(vectors)))
        for receiver, square in enumerate(squares):
            rows = np.stack([vector[receiver].ravel() for vector in vectors])
            products[receiver] = rows @ rows.T / square
        return products

    def fitted(self, response: RealArray) -> RealArray:
        """A response cut, or padded with zeros, to the samples of the reference."""
        num = self.reference.shape[2]
        missing = max(num - response.shape[2], 0)
        return np.pad(response[:, :, :num], ((0, 0), (0, 0), (0, missing)))
