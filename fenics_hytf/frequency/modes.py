# SPDX-License-Identifier: MIT
"""Many lines of a small quadratic system at once, from one eigendecomposition.

Where A(s) = A₀ + s A₁ + s² A₂ with A₂ Hermitian and positive, A₂ = LLᴴ and w = Lᴴy, all lines
follow from the eigenvalues of L⁻¹A₀L⁻ᴴ, or, with A₁, of the linearised system

    (s − Z) [w, s w] = [0, L⁻¹b],     Z = [[0, 1], [−L⁻¹A₀L⁻ᴴ, −L⁻¹A₁L⁻ᴴ]]

for hardly more than one line costs by elimination (Tisseur and Meerbergen 2001, SIAM Review 43).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import linalg

ComplexArray = npt.NDArray[np.complex128]

_POLYNOMIAL = 1e-13  # a function that is one to this is a polynomial, to round-off


def as_quadratic(factors: ComplexArray, s: ComplexArray) -> ComplexArray | None:
    """Coefficients of functions that are quadratic polynomials of s.

    Args:
        factors: Values of the functions, shape ``(num_functions, num_lines)``.
        s: Complex frequencies [rad/s], shape ``(num_lines,)``, at least three of them.

    Returns:
        Of 1, s and s², shape ``(num_functions, 3)``, or ``None`` if they are not.
    """
    scale = abs(s).max()
    powers = (s / scale) ** np.arange(3)[:, None]
    found, *_ = np.linalg.lstsq(powers.T, factors.T, rcond=None)
    found[abs(found) < _POLYNOMIAL * abs(found).max(axis=0)] = 0.0
    off = abs(found.T @ powers - factors).max(axis=1)
    if np.any(off > _POLYNOMIAL * abs(factors).max(axis=1)):
        return None
    return np.asarray(found.T / scale ** np.arange(3))


class Modes:
    """The eigendecomposition of a quadratic system.

    Args:
        A: A₀, A₁, A₂, shape ``(3, n, n)``.
        scale: Size of the frequencies [rad/s].

    Raises:
        numpy.linalg.LinAlgError: A₂ is not positive, or the eigenvalues do not converge.
    """

    def __init__(self, A: ComplexArray, scale: float) -> None:
        self._scale, size = scale, A.shape[1]
        self._lower = linalg.cholesky(scale**2 * A[2], lower=True)
        stiffness = self._between(A[0])
        self._damped = bool(np.any(A[1]))
        if self._damped:
            damping = self._between(scale * A[1])
            stiffness = np.block([[np.zeros_like(damping), np.eye(size)], [-stiffness, -damping]])
        self._values, vectors = np.linalg.eig(stiffness)
        self._inverse = np.linalg.inv(vectors)[:, -size:]
        self._vectors = linalg.solve_triangular(self._lower, vectors[:size], trans="C", lower=True)

    def _between(self, matrix: ComplexArray) -> ComplexArray:
        """L⁻¹ A L⁻ᴴ."""
        left = linalg.solve_triangular(self._lower, matrix, lower=True)
        right = linalg.solve_triangular(self._lower, left.conj().T, lower=True)
        return np.asarray(right.conj().T)

    def solve(self, s: ComplexArray, b: ComplexArray, coordinates: ComplexArray) -> ComplexArray:
        """Solve A(s) y = b c(s).

        Args:
            s: Complex frequencies [rad/s], shape ``(num_lines,)``.
            b: Shape ``(n, m)``.
            coordinates: c, shape ``(m, num_sides, num_lines)``.

        Returns:
            y, shape ``(n, num_sides, num_lines)``.
        """
        z = self._inverse @ linalg.solve_triangular(self._lower, b, lower=True)
        p = s / self._scale
        excited = np.tensordot(z, coordinates, axes=1)
        if self._damped:
            excited /= p - self._values[:, None, None]
        else:
            excited /= p * p + self._values[:, None, None]
        return np.asarray(np.tensordot(self._vectors, excited, axes=1))
