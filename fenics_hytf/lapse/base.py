# SPDX-License-Identifier: MIT
"""The motion of the base, as a within and as an outcrop motion.

A *within* motion is the total motion of the base, of a section its mean along the base; an
*outcrop* motion is that of the bare rock. The dashpots of the rock tell one from the other, for
they carry the traction of the base:

    τ = ρV* (v_outcrop − v_within)
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy import sparse

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import Sweep
from fenics_hytf.lapse.equations import Equations
from fenics_hytf.lapse.response import Excitation
from fenics_hytf.operators import boundary_area, constrained_rows, mean_rows
from fenics_hytf.scene import Scene
from fenics_hytf.soil import wave_factors

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


class BaseProbe:
    """Evaluates the mean motion of the base (collective).

    Args:
        domain: The domain.
        equations: The equations, which know whether the base is held.
    """

    def __init__(self, domain: Domain, equations: Equations) -> None:
        self._domain = domain
        self._rows: PETSc.Mat | None = None
        if not equations.base_is_held:
            self._rows = constrained_rows(domain, mean_rows(domain, "base"), equations.T)

    def destroy(self) -> None:
        """Destroy the rows."""
        if self._rows is not None:
            self._rows.destroy()

    def mean(self, sweep: Sweep, excitation: Excitation) -> ComplexArray:
        """Mean transfer function h of the base: relative to the motion that is given.

        Args:
            sweep: Transfer functions h.
            excitation: The input.

        Returns:
            Shape ``(num_components, num_motions, num_lines)``; nought where the base is held.
        """
        shape = (self._domain.num_components, len(excitation.axes), len(excitation.lines))
        if self._rows is None:
            return np.zeros(shape, complex)
        return np.asarray(self._domain.comm.allreduce(sweep.project(self._rows)))


def within_motion(excitation: Excitation, base: ComplexArray) -> RealArray:
    """Total acceleration of the base in the direction of each motion.

    Args:
        excitation: The input.
        base: Its mean transfer function h, as :meth:`BaseProbe.mean` gives it.

    Returns:
        On the solved lines [m/s^2], shape ``(num_motions, num_samples)``.
    """
    moved = excitation.respond(-(excitation.omega**2) * base)
    return excitation.to_time(excitation.weights + moved[list(excitation.axes)])


def outcrop_motion(
    scene: Scene, domain: Domain, equations: Equations, sweep: Sweep, excitation: Excitation
) -> RealArray | None:
    """Acceleration of bare rock in the direction of each motion.

    From a within motion it follows for a column between level ground, whose base is under one
    traction throughout. The force that its base takes is that of its inertia,
    τA = rᵀM(r a_b + s²u).

    Args:
        scene: The scene.
        domain: The domain.
        equations: The equations.
        sweep: Transfer functions h.
        excitation: The input.

    Returns:
        On the solved lines [m/s^2], shape ``(num_motions, num_samples)``; ``None`` where the
        scene does not tell the rock, or the traction.
    """
    rock = scene.boundary.rock
    if rock is None:
        return None
    if not equations.base_is_held:
        return excitation.to_time(excitation.weights)
    if not _traction_is_known(scene):
        return None
    force = _base_force(domain, equations, sweep, excitation)
    vertical = domain.components.index("y") if "y" in domain.components else None
    velocity = [
        rock.p_wave_velocity if axis == vertical else rock.shear_wave_velocity
        for axis in excitation.axes
    ]
    solver = scene.solver
    factors = wave_factors(rock.damping, rock.poisson, solver.complex_modulus, solver.keep)
    roots = np.sqrt([factors[0 if axis == vertical else 1] for axis in excitation.axes])
    impedance = rock.density * np.array(velocity) * roots * boundary_area(domain, "base")
    # v_outcrop − v_within = τ/ρV*; at rest they are the same
    return excitation.to_time(excitation.weights + excitation.s * force / impedance[:, None])


def _traction_is_known(scene: Scene) -> bool:
    """A column between sides of level ground, and nothing that pulls at it from outside."""
    kinds, rayleigh = scene.boundary.kinds, scene.effects.rayleigh
    level = all(kinds.get(side) in ("tied", "free_field") for side in ("left", "right"))
    return (
        scene.mesh.column is not None
        and level
        and kinds.get("top", "free") == "free"
        and (rayleigh is None or rayleigh.alpha == 0)
    )


def _base_force(
    domain: Domain, equations: Equations, sweep: Sweep, excitation: Excitation
) -> ComplexArray:
    """Force on the base in the direction of each motion, shape ``(num_motions, num_lines)``."""
    total = -(excitation.omega**2) * _inertia_rows(domain, equations, sweep)
    for motion, (axis, Mr) in enumerate(zip(excitation.axes, equations.influence, strict=True)):
        mass = Mr.array_r[axis :: domain.num_components].real.sum()
        total[motion, motion] += domain.comm.allreduce(float(mass))
    return excitation.respond(total)


def _inertia_rows(domain: Domain, equations: Equations, sweep: Sweep) -> ComplexArray:
    """rᵀM T h of each direction and motion, shape ``(num_motions, num_motions, num_lines)``."""
    owned = np.stack([Mr.array_r.real for Mr in equations.influence])
    ghosts = domain.V.dofmap.index_map.num_ghosts * domain.num_components
    local = sparse.csr_matrix(np.pad(owned, ((0, 0), (0, ghosts))))
    rows = constrained_rows(domain, local, equations.T)
    projected = sweep.project(rows)
    rows.destroy()
    return np.asarray(domain.comm.allreduce(projected))
