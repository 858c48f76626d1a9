# SPDX-License-Identifier: MIT
"""The slip mechanism of a slope and the acceleration at which it yields, by secant iterations.

Of all flows u in which the driving force does unit work, f_h·u = 1, the mechanism is the one with
the least of what the soil dissipates and gravity does not provide, and that least is k_y:

    k_y = min F(u),   F(u) = ∫ τ_f s dV − f_g·u,   s² = γ² + 1e4 θ²

with f_h the force of inertia at 1 g, f_g the weight, τ_f the shear strength and γ = √(2 e:e) of the
deviator e of ε(u): the upper bound of limit analysis for soil of von Mises, or of Tresca in plane
strain. θ, a cell's change of volume, is held near nought by its factor. Each iteration minimises

    ½ ∫ G_s s² dV − f_g·u,   G_s = τ_f/√(s_n² + ε²),   ε = 1e-5 max s_n

a quadratic that lies above F, up to ε and a constant, and touches it at the last flow u_n (linear
matching; Ponter and Carter 1997): with u₁ = K_s⁻¹f_h and u_g = K_s⁻¹f_g its minimum is
u_g + k u₁, k = (1 − f_h·u_g)/(f_h·u₁). F falls monotonically that way, but slowly. So the next flow
is the best one in the plane of u_n, that minimum and the flow before. It is found by the same
iterations in two unknowns, which need no factorisation: on a vertical cut 29 are left of 72.

At a pressure p the soil gives way by θ = p/κ, which lowers the minimum by ½ ∫ κθ² dV. k_y is given
without, as F + ∫ τ_f (s − γ) dV: in a slip surface that is too high by 0.4 (p/100τ_f)⁴, while F is
too low by 0.5 (p/100τ_f)². Where p is more than 100 τ_f there is no minimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from petsc4py import PETSc

from fenics_hytf.domain import Domain
from fenics_hytf.frequency import DynamicSystem, SymmetricFactorisation
from fenics_hytf.lapse.errors import LapseError
from fenics_hytf.lapse.unknowns import Unknowns
from fenics_hytf.operators import SecantForm

RealArray = npt.NDArray[np.float64]

_SMOOTHING = 1e-5  # ε over the largest s; 1e-4 raises the height of a vertical cut by 0.1 %
# Settled once so many iterations together have lowered F by no more than this of the dissipation.
# What was left to gain then was measured as up to the same again.
_TOLERANCE, _WINDOW = 1e-4, 3
_LIMIT = 150
_BOTTOMLESS = -100.0  # accelerations of gravity; F then falls for ever
# Share of what a flow takes that must go into shear for a mechanism: a hundredth is left where soil
# is pressed together, and more than nine tenths in slip surfaces at 30 times the strength.
_SHEARED = 0.5
_PLANE_ITERATIONS = 10  # 20 save at most one factorisation in thirty, 5 cost two more


class MechanismError(LapseError):
    """The search for a mechanism did not settle.

    Attributes:
        change: Fall of the functional in the last iterations over the dissipation [-].
    """

    def __init__(self, iterations: int, change: float, functional: float) -> None:
        self.change = change
        if functional < _BOTTOMLESS:
            found = f"flows that gravity drives and the shaking does not ({functional:.3g} g)"
            expected = "ground that fails at rest only in ways that the shaking drives as well"
            hint = (
                "look at its factor of safety, and for pressures above a hundred times the strength"
            )
        else:
            found = f"{functional:.4g} g still falling by {change:.3g} of the dissipation"
            expected = f"at most {_TOLERANCE:g}"
            hint = "check the mesh and the strength for cells unlike their neighbours"
        super().__init__(
            f"slip mechanism, iteration {iterations}: found {found}; expected {expected}: {hint}"
        )


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A slip mechanism φ.

    Attributes:
        yield_coefficient: k_y, the acceleration at which it begins to slip over that of gravity
            [-]; negative where the slope does not stand at rest.
        field: φ at this rank's nodes, ghosts included, the longest displacement of all ranks 1 [-],
            shape ``(num_local_nodes, num_components)``.
        dissipation: ∫ τ_f γ(φ) dV [N, in 2D N/m].
        driving: f_h·φ [N, in 2D N/m].
        iterations: Flows, with the one that the search began with.
        factorisations: Of K_s.
        functional: F of each flow [-], shape ``(iterations,)``.
    """

    yield_coefficient: float
    field: RealArray
    dissipation: float
    driving: float
    iterations: int
    factorisations: int
    functional: RealArray


class MechanismSearch:
    """Finds mechanisms on a domain; the form is compiled once.

    Args:
        domain: The domain: a section in plane strain, or a body. Cells of degree 1 are
            quadrilaterals or hexahedra: simplices of degree 1 cannot flow at constant volume.

    Attributes:
        factorisations: Of all searches.
    """

    def __init__(self, domain: Domain) -> None:
        self._domain = domain
        self._form = SecantForm(domain)
        self._K = self._form.create_matrix()
        self.factorisations = 0

    def destroy(self) -> None:
        """Destroy the matrix."""
        self._K.destroy()

    def find(
        self,
        unknowns: Unknowns,
        weight: RealArray,
        strength: RealArray,
        gravity: PETSc.Vec | None,
        driving: PETSc.Vec,
        start: RealArray | None = None,
    ) -> Mechanism:
        """Find the mechanism that yields first under a driving force (collective).

        Args:
            unknowns: The unknowns, each of a cell that is filled.
            weight: Part of each local cell that is filled, 0 to 1, shape ``(num_local_cells,)``.
            strength: Shear strength τ_f [Pa] of local cells, shape ``(num_local_cells,)``, or at
                the Gauss points of owned cells, shape ``(num_owned_cells, num_gauss_points)``.
            gravity: Weight f_g on the unknowns [N, in 2D N/m]; ``None`` for none.
            driving: Force of inertia f_h at 1 g, downslope, on the unknowns, likewise.
            start: An earlier mechanism's field, where the search begins, shape
                ``(num_local_nodes, num_components)``; it is not used where the driving force does
                no work in it.

        Returns:
            The mechanism.

        Raises:
            ValueError: On every rank: no driving force, or a cell with soil without strength.
            MechanismError: The functional does not settle.
            FactorisationError: Unknowns without soil.
        """
        search = _Search(
            self._domain, self._form, self._K, unknowns, weight, strength, gravity, driving
        )
        try:
            return search.run(start)
        finally:
            self.factorisations += search.factorisations
            search.destroy()

    def factor_of_safety(
        self, unknowns: Unknowns, weight: RealArray, strength: RealArray, gravity: PETSc.Vec
    ) -> float:
        """The factor by which the strength exceeds what the ground needs at rest (collective).

        min ∫ τ_f s dV over the flows with f_g·u = 1: gravity drives and there is no other load. In
        level ground the best flow is one that presses soil together, which s allows for a hundred
        times the strength: no factor of safety follows from that.

        Args:
            unknowns: As for :meth:`find`.
            weight: Likewise.
            strength: Likewise.
            gravity: Likewise.

        Returns:
            The factor of safety [-]; infinite where gravity shears nothing.

        Raises:
            ValueError: As :meth:`find`.
            MechanismError: As :meth:`find`.
            FactorisationError: As :meth:`find`.
        """
        found = self.find(unknowns, weight, strength, None, gravity)
        sheared = found.dissipation / found.driving / found.functional[-1]
        return found.yield_coefficient if sheared > _SHEARED else np.inf


class _Search:
    """One search: F and the quadratics above it; fields are arrays of this rank's unknowns."""

    def __init__(
        self,
        domain: Domain,
        form: SecantForm,
        K: PETSc.Mat,
        unknowns: Unknowns,
        weight: RealArray,
        strength: RealArray,
        gravity: PETSc.Vec | None,
        driving: PETSc.Vec,
    ) -> None:
        self._domain, self._form, self._K = domain, form, K
        self._unknowns, self._weight = unknowns, weight
        owned = self._domain.num_owned_cells
        self._volume = self._form.volume * weight[:owned, None]
        strength = strength[:, None] if strength.ndim == 1 else strength
        self._strength = np.where(self._volume > 0, strength[:owned], 0.0)
        self._require_strength()
        self._forces = [driving] if gravity is None else [driving, gravity]
        self._driving = driving.array_r.real.copy()
        self._gravity = 0 * self._driving if gravity is None else gravity.array_r.real.copy()
        if self._work(self._driving, self._driving) == 0:
            raise ValueError("found no driving force; expected one that moves an unknown")
        self._solution = driving.duplicate()
        self.factorisations = 0

    def _require_strength(self) -> None:
        lowest = float(self._strength[self._volume > 0].min(initial=np.inf))
        lowest = self._domain.comm.allreduce(lowest, MPI.MIN)
        if not 0 < lowest < np.inf:
            raise ValueError(
                f"found soil with a shear strength of {lowest:g} Pa; expected a positive one"
            )

    def destroy(self) -> None:
        """Destroy the vector."""
        self._solution.destroy()

    def run(self, start: RealArray | None) -> Mechanism:
        """Search."""
        self._form.assemble(self._K, np.ones_like(self._volume), self._weight)
        K = self._K.ptap(self._unknowns.T)
        try:
            with SymmetricFactorisation(DynamicSystem(K, K)) as factorisation:
                self._constrained, self._factorisation = K, factorisation
                flow, functional = self._descend(start)
                self.factorisations = factorisation.factorisations
        finally:
            K.destroy()
        return self._mechanism(flow, functional)

    def _mechanism(self, flow: RealArray, functional: Sequence[float]) -> Mechanism:
        """The flow brought to the length 1."""
        nodal = self._unknowns.expand(flow)
        longest = float(np.linalg.norm(nodal, axis=1).max(initial=0.0))
        longest = self._domain.comm.allreduce(longest, MPI.MAX)
        shear = self._dissipation(self._form.shear_strain(nodal)[:, :, None])
        compression = self._dissipation(self._form.strain(nodal)) - shear
        return Mechanism(
            yield_coefficient=functional[-1] + compression,
            field=np.asarray(nodal / longest),
            dissipation=shear / longest,
            driving=1 / longest,
            iterations=len(functional),
            factorisations=self.factorisations,
            functional=np.array(functional),
        )

    def _descend(self, start: RealArray | None) -> tuple[RealArray, list[float]]:
        """Secant iterations until F has settled: the last flow, and F of all."""
        flow = self._normalised(start)
        if flow is None:
            flow = self._minimise(np.ones_like(self._volume), self._forces[:1])
        previous = None
        functional: list[float] = []
        for _ in range(_LIMIT):
            strain = self._strain(flow)
            dissipation = self._dissipation(strain)
            functional.append(dissipation - self._work(self._gravity, flow))
            change = (functional[-_WINDOW - 1 :][0] - functional[-1]) / dissipation
            if len(functional) > _WINDOW and abs(change) < _TOLERANCE:
                return flow, functional
            if not functional[-1] > _BOTTOMLESS:
                break
            smoothing = self._smoothing(strain)
            target = self._minimise(
                self._moduli(np.sum(strain**2, axis=2), smoothing), self._forces
            )
            directions = [target - flow] + ([] if previous is None else [flow - previous])
            # They do no work but for round-off, which steps would lower F by, again and again.
            directions = [d - self._work(self._driving, d) * flow for d in directions]
            previous = flow
            flow = flow + self._best_step(flow, directions, smoothing)
        raise MechanismError(len(functional), change, functional[-1])

    def _minimise(self, shear_modulus: RealArray, forces: Sequence[PETSc.Vec]) -> RealArray:
        """u_g + k u₁ with moduli at the Gauss points; forces are the driving one and gravity."""
        self._form.assemble(self._K, shear_modulus, self._weight)
        self._K.ptap(self._unknowns.T, result=self._constrained)
        self._factorisation.factorise(0.0)
        solutions = []
        for force in forces:
            self._factorisation.backsolve(force, self._solution)
            solutions.append(self._solution.array_r.real.copy())
        driven, *weighed = solutions
        minimum = sum(weighed, np.zeros_like(driven))
        k = (1 - self._work(self._driving, minimum)) / self._work(self._driving, driven)
        return np.asarray(minimum + k * driven)

    def _best_step(
        self, flow: RealArray, directions: Sequence[RealArray], smoothing: float
    ) -> RealArray:
        """The combination of some directions that lowers F most; the first one is a good guess."""
        fields = [flow, *directions]
        soil = self._volume > 0
        strains = [self._strain(field)[soil] for field in fields]
        i, j = np.triu_indices(len(fields))
        products = np.stack(
            [np.einsum("ns,ns->n", strains[a], strains[b]) for a, b in zip(i, j, strict=True)]
        )
        volume, strength = self._volume[soil], self._strength[soil]
        work = np.array([self._work(self._gravity, field) for field in fields])
        share = (np.arange(len(fields)) < 2).astype(float)
        K = np.empty((len(fields), len(fields)))
        for _ in range(_PLANE_ITERATIONS):
            squares = (np.where(i == j, 1.0, 2.0) * share[i] * share[j]) @ products
            moduli = strength / np.sqrt(squares + smoothing**2)
            K[i, j] = K[j, i] = self._sum(products @ (volume * moduli))
            share[1:] = _solve(K[1:, 1:], (work - K[0])[1:])
        return np.asarray(share[1:] @ np.array(directions))

    def _normalised(self, start: RealArray | None) -> RealArray | None:
        """Unknowns of a nodal field, scaled to unit work; none where it does not do any."""
        if start is None:
            return None
        flow = self._unknowns.restrict(start)
        work = self._work(self._driving, flow)
        return np.asarray(flow / work) if work > 0 else None

    def _moduli(self, squares: RealArray, smoothing: float) -> RealArray:
        return self._strength / np.sqrt(squares + smoothing**2)

    def _smoothing(self, strain: RealArray) -> float:
        largest = float(np.linalg.norm(strain[self._volume > 0], axis=1).max(initial=0.0))
        return _SMOOTHING * float(self._domain.comm.allreduce(largest, MPI.MAX))

    def _strain(self, flow: RealArray) -> RealArray:
        return self._form.strain(self._unknowns.expand(flow))

    def _dissipation(self, strain: RealArray) -> float:
        power = self._strength * np.linalg.norm(strain, axis=2)
        return float(self._sum(np.sum(self._volume * power)))

    def _work(self, force: RealArray, flow: RealArray) -> float:
        return float(self._sum(force @ flow))

    def _sum(self, mine: RealArray) -> RealArray:
        return np.asarray(self._domain.comm.allreduce(mine))


def _solve(A: RealArray, b: RealArray) -> RealArray:
    """Solve a small symmetric system; its unknowns may differ in size, or amount to the same."""
    size = np.sqrt(np.diag(A))
    size[size == 0] = 1.0
    scaled = np.linalg.lstsq(A / np.outer(size, size), b / size, rcond=1e-12)[0]
    return np.asarray(scaled / size)
