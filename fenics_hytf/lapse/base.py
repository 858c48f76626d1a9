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
from fenics_hytf.lapse.equations import Equations
from fenics_hytf.lapse.material import rock_factors
from fenics_hytf.lapse.response import Response, Spectra
from fenics_hytf.operators import boundary_area, constrained_rows, evaluate, mean_rows
from fenics_hytf.scene import Scene

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

    def motion(self, response: Response) -> Spectra:
        """Mean displacement of the base, relative to the motion that is given.

        Args:
            response: The response.

        Returns:
            A spectrum for each component; nought where the base is held.
        """
        if self._rows is None:
            shape = (self._domain.num_components, len(response.excitation.lines))
            return Spectra(np.zeros(shape, complex))
        return response.spectra(self._rows).summed(self._domain.comm)

    def at(self, unknowns: RealArray) -> RealArray:
        """Mean displacement of the base at one instant (collective).

        Args:
            unknowns: This rank's unknowns then [m], shape ``(num_local_unknowns,)``.

        Returns:
            [m], shape ``(num_components,)``.
        """
        if self._rows is None:
            return np.zeros(self._domain.num_components)
        return np.asarray(self._domain.comm.allreduce(evaluate(self._rows, unknowns)))


def within_motion(response: Response, base: Spectra) -> RealArray:
    """Total acceleration of the base in the direction of each motion.

    Args:
        response: The response.
        base: Mean displacement of the base, as :meth:`BaseProbe.motion` gives it.

    Returns:
        [m/s^2], shape ``(num_motions, num_samples)``.
    """
    given = response.excitation
    return given.base_acceleration + response.history(base[list(given.axes)], 2)


def outcrop_motion(
    scene: Scene, domain: Domain, equations: Equations, response: Response
) -> RealArray | None:
    """Acceleration of bare rock in the direction of each motion.

    From a within motion it follows for a column between level ground, whose base is under one
    traction throughout. The force that its base takes is that of its inertia,
    τA = rᵀM(r a_b + s²u).

    Args:
        scene: The scene.
        domain: The domain.
        equations: The equations.
        response: The response.

    Returns:
        On the solved lines [m/s^2], shape ``(num_motions, num_samples)``; ``None`` where the
        scene does not tell the rock, or the traction, as of a within motion on a damped contour.
    """
    rock, given = scene.boundary.rock, response.excitation
    if rock is None:
        return None
    if not equations.base_is_held:
        return given.base_acceleration
    if not _traction_is_known(scene) or given.given is not None:
        return None
    force = _base_force(domain, equations, response)
    vertical = domain.components.index("y") if "y" in domain.components else None
    velocity = [
        rock.p_wave_velocity if axis == vertical else rock.shear_wave_velocity
        for axis in given.axes
    ]
    factors = rock_factors(scene)
    roots = np.sqrt([factors[0 if axis == vertical else 1] for axis in given.axes])
    impedance = rock.density * np.array(velocity) * roots * boundary_area(domain, "base")
    # v_outcrop − v_within = τ/ρV*; at rest they are the same
    return given.to_time(given.motion_weights + given.s * force / impedance[:, None])


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


def _base_force(domain: Domain, equations: Equations, response: Response) -> ComplexArray:
    """Force on the base in the direction of each motion, shape ``(num_motions, num_lines)``."""
    given = response.excitation
    total = given.s**2 * _inertia_rows(domain, equations, response)
    for motion, (axis, Mr) in enumerate(zip(given.axes, equations.inertia.influence, strict=True)):
        mass = Mr.array_r[axis :: domain.num_components].real.sum()
        total[motion, motion] += domain.comm.allreduce(float(mass))
    return np.einsum("fmk,mk->fk", total, given.motion_weights)


def _inertia_rows(domain: Domain, equations: Equations, response: Response) -> ComplexArray:
    """rᵀM T h of each direction and motion, shape ``(num_motions, num_motions, num_lines)``."""
    owned = np.stack([Mr.array_r.real for Mr in equations.inertia.influence])
    ghosts = domain.V.dofmap.index_map.num_ghosts * domain.num_components
    local = sparse.csr_matrix(np.pad(owned, ((0, 0), (0, ghosts))))
    rows = constrained_rows(domain, local, equations.T)
    projected = response.transfer(rows)
    rows.destroy()
    return np.asarray(domain.comm.allreduce(projected))
