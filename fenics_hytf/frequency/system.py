# SPDX-License-Identifier: MIT
"""The dynamic stiffness A(s) = sum_j f_j(s) K_j + s C + s² M as an affine sum of matrices.

A law of material damping is a scalar function of the complex frequency s = η + iω beside a real
matrix: hysteretic damping is ``(K_imag, hysteretic)``, viscous branches are rational functions, and
nothing else in this room changes. All matrices are complex *symmetric* (A = Aᵀ), never Hermitian.
The paper's transfer function (5) h(ω) = [ω²M − K*]⁻¹ M r is the solution of A(iω) h = −M r.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

# Spring of a dashpot at rest over its impedance [rad/s]: as stiff as ten metres of rock of
# 1000 m/s, so about as stiff as a cell and well conditioned.
_AT_REST = 100.0

ScalarFunction = Callable[[complex], complex]


def constant(s: complex) -> complex:
    """The function 1, of an elastic stiffness."""
    return 1.0


def hysteretic(s: complex) -> complex:
    """i·sign(ω), of the imaginary part of a hysteretic stiffness; 0 on the real axis."""
    return 1j * np.sign(s.imag)


def radiation(factor: complex) -> ScalarFunction:
    """s·√(M*/M), of dashpots whose impedance ρV* is that of a damped material.

    Ground that stands on dashpots has no place of its own at s = 0, and A(0) would be singular.
    Rock does hold it at rest, so there they become springs. A level column under a steady
    acceleration strains alike whatever their stiffness, for its base takes its weight either way.

    Args:
        factor: M*/M, complex over real modulus, at positive frequencies [-].

    Returns:
        The function; on the real axis, where the modulus is real, it is s, and at rest the spring.
    """
    root = complex(np.sqrt(complex(factor)))

    def function(s: complex) -> complex:
        if s.imag == 0:
            return s or _AT_REST
        return s * (root if s.imag > 0 else root.conjugate())

    return function


def values(function: ScalarFunction, s: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
    """A function of s at all lines: at once where it takes arrays, else one by one.

    Args:
        function: The function.
        s: Complex frequencies [rad/s], shape ``(num_lines,)``.

    Returns:
        Shape ``(num_lines,)``.
    """
    try:
        found = np.broadcast_to(np.asarray(function(s), np.complex128), s.shape)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        found = None
    if found is None or (len(s) and found[-1] != function(complex(s[-1]))):
        return np.array([function(complex(z)) for z in s], np.complex128)
    return found


class DynamicSystem:
    """A(s) as an affine sum of matrices times scalar functions of s.

    Args:
        K: One matrix, or a sequence of ``(matrix, function of s)``.
        M: Mass matrix [kg].
        C: Damping matrix [N s/m], or ``None``.

    The matrices are borrowed: whoever made them destroys them. They share one sparsity pattern, so
    that their sum is a flat loop over the values.

    Raises:
        ValueError: The matrices differ in size or pattern.
    """

    def __init__(
        self,
        K: PETSc.Mat | Sequence[tuple[PETSc.Mat, ScalarFunction]],
        M: PETSc.Mat,
        C: PETSc.Mat | None = None,
    ) -> None:
        single = isinstance(K, PETSc.Mat)
        stiffness: list[tuple[PETSc.Mat, ScalarFunction]] = [(K, constant)] if single else [*K]
        if not stiffness:
            raise ValueError("K: found no matrix; expected at least one")
        self.mass = M
        self.terms: list[tuple[PETSc.Mat, ScalarFunction]] = [
            *stiffness,
            (M, lambda s: s * s),
            *([(C, lambda s: s)] if C is not None else []),
        ]
        self._require_one_pattern()

    def _require_one_pattern(self) -> None:
        # PETSc adds matrices declared of one pattern without looking: unequal ones corrupt the sum.
        first = self.terms[0][0]
        pattern = first.getValuesCSR()[:2]
        same = all(
            matrix.getSizes() == first.getSizes()
            and all(map(np.array_equal, matrix.getValuesCSR()[:2], pattern))
            for matrix, _ in self.terms[1:]
        )
        if not self.comm.tompi4py().allreduce(same, MPI.LAND):
            raise ValueError(
                "K, M, C: found matrices of different sizes or sparsity patterns; expected one "
                "pattern: assemble M and C into zeroed copies of K"
            )

    @property
    def comm(self) -> PETSc.Comm:
        """Communicator of the matrices."""
        return self.terms[0][0].comm

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix that :meth:`fill` can fill; the caller destroys it."""
        matrix = self.terms[0][0].duplicate(copy=False)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return matrix

    def fill(self, A: PETSc.Mat, s: complex) -> None:
        """Write A(s) into a matrix made by :meth:`create_matrix`.

        Args:
            A: The matrix.
            s: Complex frequency η + iω [rad/s].
        """
        same = PETSc.Mat.Structure.SAME_NONZERO_PATTERN
        first, function = self.terms[0]
        first.copy(A, structure=same)
        A.scale(function(s))
        for matrix, function in self.terms[1:]:
            factor = function(s)
            if factor != 0:
                A.axpy(factor, matrix, structure=same)
