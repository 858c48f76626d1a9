# SPDX-License-Identifier: MIT
"""Blocks of directions that the solution of A(s) x = b takes near an expansion point.

With A(s₀ + δ) = A₀ + δA₁ + δ²A₂ + ... the Taylor coefficients of x obey

    A₀ x_k = b_k − A₁ x_{k−1} − A₂ x_{k−2} − ...

so one factorisation of A₀ serves as many of them as are wanted. They are not used themselves, being
nearly parallel, but an orthonormal basis of what they span, by two-level orthogonal Arnoldi on the
linearised recurrence (Lu, Su and Bai 2016, SIAM J. Matrix Anal. Appl. 37(1), 195-214).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from fenics_hytf.frequency.products import TermProducts, inner, norm
from fenics_hytf.frequency.system import ScalarFunction

ComplexArray = npt.NDArray[np.complex128]

_ORDER = 2  # Taylor coefficients of A that are used
_CIRCLE = 0.3  # radius of the circle round an expansion point, over its distance from the real axis
_NODES = 16  # on the circle: a function that is regular within three times it is exact to 1e-8
_NOTHING = 1e-12  # of a vector: what the directions before leave of it is round-off


def taylor(function: ScalarFunction, s: complex, order: int, radius: float) -> ComplexArray:
    """Taylor coefficients of a function from its values on a circle (Cauchy's integral).

    Args:
        function: Regular within the circle.
        s: Centre [rad/s].
        order: Of the last coefficient, below 16.
        radius: Of the circle [rad/s].

    Returns:
        Coefficients of (δ/radius)^k, shape ``(order + 1,)``.
    """
    circle = s + radius * np.exp(2j * np.pi * np.arange(_NODES) / _NODES)
    values = np.array([function(complex(z)) for z in circle])
    return np.asarray(np.fft.fft(values)[: order + 1] / _NODES)


def krylov_block(
    products: TermProducts,
    solve: Callable[[ComplexArray], ComplexArray],
    first: ComplexArray,
    s: complex,
    size: int,
) -> ComplexArray:
    """Orthonormal basis of the first Taylor coefficients of x about s.

    Args:
        products: The system's matrices.
        solve: Solves A(s) x = b with the factorisation at ``s``.
        first: This rank's part of the solution at ``s``, shape ``(num_local,)``.
        s: Expansion point [rad/s]; on the real axis, where a hysteretic law is not regular, the
            block is the solution alone.
        size: Directions wanted.

    Returns:
        Shape ``(num_local, size)``, or narrower where there are fewer.
    """
    radius = _CIRCLE * abs(s.imag)
    steps = size if radius > 0 else 1
    coefficients = [taylor(f, s, _ORDER, radius) for f in products.functions] if radius else []
    comm = products.comm
    length = norm(comm, first)
    Q = np.empty((len(first), steps), np.complex128)
    if length == 0.0:
        return Q[:, :0]
    Q[:, 0] = first / length
    # States of the recurrence (x_{k−1}, ..., x_{k−order}) in terms of Q, orthonormal as a whole.
    states = np.zeros((steps, _ORDER, steps), np.complex128)
    states[0, 0, 0] = 1.0
    for k in range(1, steps):
        pull = np.zeros(len(first), np.complex128)
        for back in range(_ORDER):
            x = Q[:, :k] @ states[k - 1, back, :k]
            pull -= products.weighted([c[back + 1] for c in coefficients], x)
        w = solve(pull)
        overlap, rest = _against(comm, Q[:, :k], w)
        length = norm(comm, rest)
        if length <= _NOTHING * norm(comm, w):
            return Q[:, :k]
        Q[:, k] = rest / length
        state = np.zeros((_ORDER, steps), np.complex128)
        state[0, :k], state[0, k] = overlap, length
        state[1:] = states[k - 1, : _ORDER - 1]
        states[k] = _beside_states(states[:k], state)
    return Q


def _beside_states(states: ComplexArray, state: ComplexArray) -> ComplexArray:
    """A state at right angles to orthonormal ones, shape ``(k, order, steps)``, of norm one."""
    for _ in range(2):
        overlap = np.einsum("lij,ij->l", states.conj(), state)
        state = state - np.einsum("l,lij->ij", overlap, states)
    return np.asarray(state / np.linalg.norm(state))


def _against(comm: MPI.Comm, Q: ComplexArray, w: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Overlap of w with an orthonormal basis, and what is left of it."""
    overlap = inner(comm, Q, w)
    rest = w - Q @ overlap
    again = inner(comm, Q, rest)
    return overlap + again, rest - Q @ again
