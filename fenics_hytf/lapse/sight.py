# SPDX-License-Identifier: MIT
"""Histories of what many rows see of a response: by its lines, or by its directions.

By lines, a row takes a product with the coordinates of every line, and a Fourier transform of the
period for each derivative. By directions, the coordinates are brought to time once, and a history
is a row's product with them, as many numbers as samples. On a damped contour, whose period is
several times the lapse, that was measured as five times faster.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.lapse.course import Course
from fenics_hytf.lapse.material import Part, part_functions
from fenics_hytf.lapse.response import Response, Spectra

RealArray = npt.NDArray[np.float64]


class Sight(Protocol):
    """Sees a response; what it has seen can be indexed like an array of quantities."""

    def see(self, rows: PETSc.Mat, count: int) -> Any:
        """What rows see (collective).

        Args:
            rows: Matrix with as many columns as there are unknowns.
            count: Of this rank's objects that the rows are of, as many rows each.

        Returns:
            Quantities, shape ``(count, rows of each, ...)``.
        """

    def history(self, seen: Any, derivative: int = 0) -> RealArray:
        """Values at every sample, as precise as the sweep and no more.

        Args:
            seen: Quantities.
            derivative: Order of the time derivative.

        Returns:
            Shape ``(..., num_samples)``.
        """

    def stress(self, seen: Any, moduli: RealArray) -> RealArray:
        """Histories of what a law makes of strains.

        Args:
            seen: Strains, shape ``(n, num_strains, ...)``.
            moduli: Shear modulus of each part of the law [Pa], shape ``(n, num_parts)``.

        Returns:
            Σ_j G_j f_j(s) times the strain [Pa], shape ``(n, num_strains, num_samples)``.
        """


def sight_of(response: Response, comm: MPI.Comm, parts: tuple[Part, ...] = ()) -> Sight:
    """The faster way to see a response.

    Args:
        response: The response.
        comm: Communicator of the unknowns.
        parts: Of the law, for stress.
    """
    if response.excitation.eta and response.sweep.has_directions:
        return _ByDirections(response, comm, parts)
    return _ByLines(response, parts)


class _ByLines:
    """By way of spectra."""

    def __init__(self, response: Response, parts: tuple[Part, ...]) -> None:
        self._response, self._weighed = response, response.weighed()
        self._functions = part_functions(parts, response.excitation.s)
        held = response.start is not None and len(parts) > 0
        self._start = response.start_through(parts) if held else None

    def see(self, rows: PETSc.Mat, count: int) -> Spectra:
        seen = self._weighed(rows)
        return seen.reshape(count, len(seen.coefficients) // max(count, 1))

    def history(self, seen: Spectra, derivative: int = 0) -> RealArray:
        return self._response.history(seen, derivative)

    def stress(self, seen: Spectra, moduli: RealArray) -> RealArray:
        values = seen.coefficients
        # What overflows single precision is told by the peaks of the cells.
        with np.errstate(over="ignore", invalid="ignore"):
            factor = (moduli @ self._functions).astype(values.dtype)
            history = self._response.excitation.to_time(factor[:, None, :] * values)
        if self._start is not None and seen.start is not None:
            functions = np.tensordot(moduli, self._start, axes=1).astype(history.dtype)
            history += seen.start.astype(history.dtype) @ functions
        return history


class _ByDirections:
    """By way of coordinates in time."""

    def __init__(self, response: Response, comm: MPI.Comm, parts: tuple[Part, ...]) -> None:
        given = response.excitation
        self._course = Course(response, comm)
        self._kind = np.finfo(response.sweep.precision).dtype
        self._samples = given.num_samples
        self._coordinates: dict[int, RealArray] = {}  # by derivative
        held = [None] * len(parts)
        if response.start is not None and parts:
            held = list(response.start_through(parts))
        functions = part_functions(parts, given.s)
        through = [self._course.through(functions[j], start) for j, start in enumerate(held)]
        self._through = self._told(np.concatenate(through)) if parts else None

    def _told(self, coordinates: RealArray) -> RealArray:
        return np.ascontiguousarray(coordinates[:, : self._samples], self._kind)

    def see(self, rows: PETSc.Mat, count: int) -> RealArray:
        # Rows take differences of neighbours, so they meet the directions in double precision.
        seen = self._course.seen_by(rows)
        return seen.astype(self._kind).reshape(count, len(seen) // max(count, 1), seen.shape[1])

    def history(self, seen: RealArray, derivative: int = 0) -> RealArray:
        if derivative not in self._coordinates:
            self._coordinates[derivative] = self._told(self._course.coordinates(derivative))
        return _product(seen, self._coordinates[derivative])

    def stress(self, seen: RealArray, moduli: RealArray) -> RealArray:
        assert self._through is not None
        # All parts in one product, each part's coordinates met by the strain times its modulus.
        weighed = moduli[:, None, :, None].astype(seen.dtype) * seen[:, :, None, :]
        count, quantities, parts, directions = weighed.shape
        return _product(weighed.reshape(count, quantities, parts * directions), self._through)


def _product(seen: RealArray, coordinates: RealArray) -> RealArray:
    """One product for all quantities: of stacks of small ones, each would be on its own."""
    count, quantities, directions = seen.shape  # of ground that rests there is no direction
    flat = seen.reshape(count * quantities, directions) @ coordinates
    return flat.reshape(count, quantities, coordinates.shape[1])
