# SPDX-License-Identifier: MIT
"""The matrices of a linear scene outside a run: real, and sorted by the power of s they stand at.

A(s) = K + H(s) + s C + s² M, with H hysteretic. They are those that a run solves, on the same
unknowns, and so are the rows that evaluate its receivers.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import DynamicSystem, ScalarFunction
from fenics_hytf.lapse import (
    Equations,
    first_strain,
    material,
    seed_points,
    survey,
)
from fenics_hytf.operators import constrained_rows, displacement_rows
from fenics_hytf.particles import Points, transfer_matrix
from fenics_hytf.scene import Scene
from fenics_hytf.simulation.check import checked_domain
from fenics_hytf.simulation.receivers import Receivers

RealArray = npt.NDArray[np.float64]

_PROBES = np.array([1j, 2.0 + 3.0j])  # complex frequencies at which powers of s differ
_LAWS = {  # what each kind of matrix is multiplied by there
    "stiffness": np.ones(2),
    "hysteresis": np.full(2, 1j),
    "damping": _PROBES,
    "mass": _PROBES**2,
}


@dataclass(frozen=True)
class Matrices:
    """What a scene's equations are made of, with n unknowns.

    Attributes:
        stiffness: K [N/m], shape ``(n, n)``, as the three below; all have one pattern.
        mass: M [kg].
        damping: C [N s/m], or ``None`` without viscous damping.
        hysteresis: Imaginary part of the stiffness at positive frequencies [N/m], or ``None``
            without material damping.
        loads: −TᵀM r of each motion [kg], shape ``(num_motions, n)``.
        receivers: Displacement of the receivers from the unknowns, shape
            ``(num_receivers·num_components, n)``, components fastest.
        axes: Component in which each motion acts.
        num_components: Displacement components.
        num_cells: Cells.
    """

    stiffness: sparse.csr_matrix
    mass: sparse.csr_matrix
    damping: sparse.csr_matrix | None
    hysteresis: sparse.csr_matrix | None
    loads: RealArray
    receivers: sparse.csr_matrix
    axes: tuple[int, ...]
    num_components: int
    num_cells: int

    @property
    def num_unknowns(self) -> int:
        """Unknowns."""
        return int(self.mass.shape[0])


def assemble(scene: Scene) -> Matrices:
    """Assemble the matrices of a scene's first lapse, in this process alone.

    The moduli are those that the first sweep of a run has: of a linear scene, its moduli.

    Args:
        scene: The scene.

    Returns:
        The matrices.

    Raises:
        SceneError: A fault that only the mesh shows.
        ValueError: The ground beyond a side, or the rock, follows no power of s.
    """
    if "free_field" in scene.supports.values():
        raise ValueError(
            'found a side with "free_field", whose forces differ from line to line; expected '
            "equations that hold at all frequencies: tied, roller, dashpot or free sides"
        )
    domain = checked_domain(scene, MPI.COMM_SELF)
    points = seed_points(scene, domain)
    equations = Equations(scene, domain, Counter())
    try:
        equations.weigh(points)
        ground = survey(scene, domain, points)
        moduli = ground.secant(first_strain(scene, ground))
        lapse = equations.assemble(ground, material(ground, moduli, scene.solver))
        matrices = _sorted(lapse.system)
        assert isinstance(lapse.loads, list)  # else they are the free field's
        loads = lapse.loads
        return Matrices(
            stiffness=matrices["stiffness"],
            mass=matrices["mass"],
            damping=matrices.get("damping"),
            hysteresis=matrices.get("hysteresis"),
            loads=np.array([load.array_r.real for load in loads]),
            receivers=_receiver_rows(scene, domain, points, equations),
            axes=equations.axes,
            num_components=domain.num_components,
            num_cells=domain.num_cells,
        )
    finally:
        equations.destroy()


def _sorted(system: DynamicSystem) -> dict[str, sparse.csr_matrix]:
    """Sums of the matrices that stand at one power of s."""
    found: dict[str, sparse.csr_matrix] = {}
    for matrix, function in system.terms:
        law, values = _law(function), _real(matrix)
        if law in found:
            found[law].data += values.data  # a sum of sparse matrices would lose the pattern
        else:
            found[law] = values
    return found


def _law(function: ScalarFunction) -> str:
    """Name of a scalar function of s."""
    values = np.array([function(complex(s)) for s in _PROBES])
    for name, expected in _LAWS.items():
        if np.allclose(values, expected, rtol=1e-12, atol=0):
            return name
    raise ValueError(
        f"found a matrix that stands at neither 1, s nor s² (at s = i its factor is "
        f"{values[0]:.4g}), as the dashpots of damped rock do; expected undamped rock"
    )


def _real(matrix: PETSc.Mat) -> sparse.csr_matrix:
    """A serial real matrix in the common pattern, zeros and all."""
    start, columns, values = matrix.getValuesCSR()
    return sparse.csr_matrix((values.real.copy(), columns, start), shape=matrix.getSize())


def _receiver_rows(
    scene: Scene, domain: Domain, points: Points, equations: Equations
) -> sparse.csr_matrix:
    receivers = Receivers(domain, points, scene.output.receivers)
    sites, numbers = receivers.sites(points)
    count = domain.num_components
    local = displacement_rows(transfer_matrix(sites, domain.V), count)
    rows = constrained_rows(domain, local, equations.T)
    result = _real(rows)
    rows.destroy()
    order = np.argsort(numbers)[:, None] * count + np.arange(count)
    return result[order.ravel()]
