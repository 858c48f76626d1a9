# SPDX-License-Identifier: MIT
"""Transient continuity where a law that is not causal is insisted on: u = U_j + w.

Hysteretic damping feels the future as well as the past, so no state at one instant can start it
again. In each lapse the whole record is solved with the lapse's matrices, U_j, and what u and v at
the seam differ from it by goes on as a free vibration w in total form:

    A(s) U_j = −M r â_g (of the whole record, from rest)
    A(s) W = s M w₀ + M ẇ₀ + C w₀,    w₀ = u − U_j,  ẇ₀ = v − V_j  at the seam

While the matrices do not change w is nought and the lapses are one. Every lapse costs all lines of
the record.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import AffineLoads, Columns, JoinedSweep
from fenics_hytf.lapse.continuity import Solve, jump_at_start
from fenics_hytf.lapse.equations import Equations, LapseEquations
from fenics_hytf.lapse.excitation import Excitation
from fenics_hytf.lapse.material import Material
from fenics_hytf.lapse.response import Response
from fenics_hytf.lapse.scheme import Scheme
from fenics_hytf.lapse.slipped import Slipped
from fenics_hytf.lapse.starts import product, start_accelerations, start_columns
from fenics_hytf.motion import (
    LapseRecord,
    Segment,
    StartFunctions,
    band_limited,
)
from fenics_hytf.particles import Points, transfer_matrix
from fenics_hytf.scene import Scene

RealArray = npt.NDArray[np.float64]


class WholeRecord:
    """The response to the whole record and a free vibration about it.

    Args:
        scene: The scene.
        domain: The domain.
        equations: Its equations.
        scheme: Its contour, and what points carry.
    """

    goes_on_from_nought = False

    def __init__(self, scene: Scene, domain: Domain, equations: Equations, scheme: Scheme) -> None:
        self._scene, self._domain, self._equations = scene, domain, equations
        motion = band_limited(scene.base_acceleration, scene.dt, scene.solver.max_frequency)
        record = LapseRecord(motion, scene.dt)
        self._motion = motion
        assert scheme.contour is not None
        self._contour = scheme.contour
        self.fields = scheme.carried(domain.num_components)
        self._transform = self._contour.transform(motion, record.derivatives[:, :, 0].T)
        # A free vibration is as long as a lapse.
        length = scene.segments[0].num_samples
        share = length / motion.shape[1]
        lapse = replace(self._contour, period=round(share * self._contour.period))
        self._start = StartFunctions.fading_in(lapse, scene.solver.max_frequency)
        self._excitation: Excitation
        self._points: Points

    def excite(self, segment: Segment) -> Excitation:
        """All lines of the record, read from the start of the lapse on."""
        later = np.exp(self._contour.s * segment.start * self._contour.dt)
        return Excitation.on_contour(
            self._contour,
            self._scene.solver.max_frequency,
            weights=self._transform * later,
            axes=self._equations.axes,
            segment=segment,
            motion=self._motion,
            start=self._start,
        )

    def begin(self, points: Points, excitation: Excitation) -> None:
        """Remember where the points are."""
        self._points, self._excitation = points, excitation

    def respond(self, solve: Solve, equations: LapseEquations, material: Material) -> Response:
        """The response to the record and, after the first lapse, the free vibration about it."""
        given = self._excitation
        record = solve(equations.loads)
        driven = Response(record, replace(given, weights=given.motion_weights, start=None))
        if not given.carries:
            return driven
        w, rate = (self._momentum_beside(driven, derivative) for derivative in (0, 1))
        displacement = self._equations.inertia.accelerate(w)
        damped = product([(C, 1.0) for C in equations.viscous], displacement, like=w)
        s = given.s
        coefficients = np.stack([s, np.ones_like(s), np.ones_like(s)])[:, None]
        free = solve(AffineLoads([w, rate, damped], coefficients))
        start = self._starts(equations, w, rate)
        for vector in (w, rate, damped):
            vector.destroy()
        return Response(JoinedSweep(record, free), given, start, start_factorisations=1)

    def _momentum_beside(self, driven: Response, derivative: int) -> PETSc.Vec:
        """SᵀM_p times displacement or velocity of the points less the driven one."""
        points, S = self._points, transfer_matrix(self._points, self._domain.V)
        carried = points["dynamic_velocity" if derivative else "dynamic_displacement"]
        nodal = self._equations.unknowns.expand(driven.unknowns_at(0.0, derivative))
        return self._equations.momentum(points, carried - S @ nodal)

    def _starts(self, equations: LapseEquations, w: PETSc.Vec, rate: PETSc.Vec) -> Columns:
        """Coefficients of the start functions of the free vibration, from its two momenta."""
        viscous = [(C, -1.0) for C in equations.viscous]
        stiff = [(K, -share) for K, share in equations.stiff]
        displacement, velocity = (
            self._equations.inertia.accelerate(w),
            self._equations.inertia.accelerate(rate),
        )
        force = product(stiff, displacement, like=w)
        force.axpy(1.0, slowed := product(viscous, velocity, like=w))
        change = product(stiff, velocity, like=w)
        highest = float(self._excitation.omega.max())
        accelerations = start_accelerations(equations, highest, force, change)
        for vector in (force, slowed, change):
            vector.destroy()
        return start_columns(self._start, [displacement, velocity, *accelerations])

    def carried(self, material: Material) -> None:
        """Nothing: the response is total."""
        return None

    def jump(self, points: Points, response: Response) -> tuple[float, float] | None:
        """Displacement and velocity at the start of the lapse, against what was carried."""
        if not self._excitation.carries:
            return None
        carried = points["dynamic_displacement"]
        return jump_at_start(self._domain, self._equations, points, response, carried)

    def energy(
        self,
        response: Response,
        material: Material,
        stored_before: float | None,
        slip: Slipped | None = None,
    ) -> None:
        """A law that feels the future has no energy at an instant."""
        return None

    def finish(self, points: Points, response: Response, material: Material) -> None:
        """Displacement and velocity at the end of the lapse."""
        S, end = transfer_matrix(points, self._domain.V), response.excitation.duration
        for name, derivative in (("dynamic_displacement", 0), ("dynamic_velocity", 1)):
            points[name] = S @ self._equations.unknowns.expand(
                response.unknowns_at(end, derivative)
            )

    def destroy(self) -> None:
        """None outlives a call."""
