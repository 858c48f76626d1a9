# SPDX-License-Identifier: MIT
"""Ground that yields, marched in time: what permanent displacements are compared with.

A plane-strain section of elastic, perfectly plastic soil of cohesion c on a fixed mesh of
quadrilaterals, in one process; displacements u are relative to a base that moves by u_b:

    M ü + ∫ Bᵀ (σ + σ_v) dV = M (g − r ü_b)

Nothing tells it where it slips, nor that it slips one way. In the stresses (p, s, τ), p the mean of
σ_x and σ_y, s half of their difference, and in their strains (e, d, γ), e = ε_x + ε_y and
d = ε_x − ε_y, Hooke's law is diagonal, and Tresca's criterion is a circle as long as σ_z lies
between the principal stresses of the plane:

    p = (K + G/3) e,   s = G (d − d_p),   τ = G (γ − γ_p),   √(s² + τ²) ≤ c

Flow is along (s, τ): closest-point projection scales them back to c, and p is elastic. σ_z − p is
−G e: a nearly incompressible soil keeps σ_z in between, and whether it does is not looked at. e is
the mean of its cell (B-bar; Nagtegaal, Parks and Rice 1974), or cells lock. Damping is proportional
to stiffness, C = βK: a viscous stress σ_v = β σ̇, which resists the elastic part of a motion and not
the slip.

Mass is lumped; time goes in central differences, the viscous stress half a step late; they are
stable up to (h ω)² + 2 β h ω² = 4 for the highest ω of any cell (Belytschko, Liu and Moran 2000,
§6.2). A cell that is filled in part has that part of its stiffness, forces and mass.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from fenics_hytf.study.elastoplastic_kernels import Cells, State, march, resist, strain

RealArray = npt.NDArray[np.float64]

SAFETY = 0.8
"""Part of the longest stable step that is taken where none is asked for."""

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_SWINGING = 5.0  # after gravity was switched on at once [s]
_AT_REST = 1e-9  # residual over gravity [-]
_PATIENCE = 1000  # iterations, in which the residual has to fall to this part of what it was:
_PROGRESS = 0.9


class NoEquilibrium(RuntimeError):
    """The strength does not carry the weight: the ground fails before it is shaken."""


@dataclass(frozen=True, eq=False)
class Motion:
    """How a section moved from its state of rest on; samples are those of the base and beyond.

    Attributes:
        time: [s], shape ``(num_samples,)``.
        displacement: Of the watched nodes less that at rest [m], shape
            ``(num_watched, 2, num_samples)``.
        largest: Largest length of it over all nodes [m], shape ``(num_samples,)``.
        energy: Since rest, a metre thick [J], shape ``(num_samples,)`` each: ``work`` of gravity
            and of the base, and what became of it: ``kinetic``, ``elastic``, ``plastic``,
            ``viscous``.
        state: At the end.
        substeps: Steps a sample.
    """

    time: RealArray
    displacement: RealArray
    largest: RealArray
    energy: dict[str, RealArray]
    state: State
    substeps: int

    @property
    def slip(self) -> float:
        """Largest displacement that remains [m]."""
        return float(self.largest[-1])

    @property
    def imbalance(self) -> float:
        """Largest difference of work and energies, over all the energy that was spent [-]."""
        spent = sum(abs(self.energy[name]) for name in ("kinetic", "plastic", "viscous"))
        found = spent + self.energy["elastic"]
        return float(abs(self.energy["work"] - found).max() / np.max(spent))


class Section:
    """A plane-strain section of ground that yields.

    Args:
        nodes: Coordinates [m], shape ``(num_nodes, 2)``. A node without a cell does not move.
        cells: Nodes of each cell, counter-clockwise, shape ``(num_cells, 4)``.
        density: [kg/m^3], one or shape ``(num_cells,)``, as all that follow.
        shear_modulus: G [Pa].
        bulk_modulus: K [Pa].
        cohesion: c [Pa]; infinite where the soil is elastic.
        fixed: Components that move with the base, shape ``(num_nodes, 2)``.
        weight: Part of a cell that is filled [-], above 0.
        beta: β [s].
        gravity: [m/s^2], shape ``(2,)``.
        b_bar: e is the mean of a cell; else cells lock.
        damp_slip: C = βK resists plastic strain as well, σ_v = βDε̇; a seam then is a dashpot.

    Raises:
        ValueError: A number is out of range, a shape does not fit, or a cell is not convex.
    """

    def __init__(
        self,
        nodes: npt.ArrayLike,
        cells: npt.ArrayLike,
        *,
        density: npt.ArrayLike,
        shear_modulus: npt.ArrayLike,
        bulk_modulus: npt.ArrayLike,
        cohesion: npt.ArrayLike,
        fixed: npt.ArrayLike,
        weight: npt.ArrayLike = 1.0,
        beta: float = 0.0,
        gravity: npt.ArrayLike = (0.0, -9.81),
        b_bar: bool = True,
        damp_slip: bool = False,
    ) -> None:
        self.nodes = np.array(nodes, dtype=np.float64)
        corners = np.array(cells, dtype=np.int64)
        held, pull = np.array(fixed, dtype=bool), np.array(gravity, dtype=np.float64)
        _check_shape("nodes", self.nodes, (len(self.nodes), 2))
        _check_shape("cells", corners, (len(corners), 4))
        _check_shape("fixed", held, self.nodes.shape)
        _check_shape("gravity", pull, (2,))
        if corners.size == 0 or corners.min() < 0 or corners.max() >= len(self.nodes):
            raise ValueError(f"cells: expected numbers of nodes, 0 to {len(self.nodes) - 1}")
        if not (np.isfinite(beta) and beta >= 0.0):
            raise ValueError(f"beta: found {beta} s; expected a number from 0")
        rho, G, K, c, filled = (
            _positive(name, values, len(corners))
            for name, values in (
                ("density", density),
                ("shear_modulus", shear_modulus),
                ("bulk_modulus", bulk_modulus),
                ("cohesion", cohesion),
                ("weight", weight),
            )
        )
        gradients, volume = _shape_gradients(self.nodes[corners])
        volume *= filled[:, None]
        dilatation = gradients
        if b_bar:
            mean = np.einsum("cg,cgni->cni", volume, gradients) / volume.sum(1)[:, None, None]
            dilatation = np.repeat(mean[:, None], 4, axis=1)
        self.cells = Cells(
            corners, gradients, dilatation, volume, np.stack([K + G / 3, G], axis=1), c
        )
        self.beta, self.damp_slip = float(beta), damp_slip
        corner_mass = rho * volume.sum(1) / 4
        self.mass = np.bincount(
            corners.ravel(), np.repeat(corner_mass, 4), minlength=len(self.nodes)
        )
        self.free = ~held & (self.mass > 0.0)[:, None]
        if not (held & (self.mass > 0.0)[:, None]).any(axis=0).all():
            raise ValueError("fixed: found a direction in which nothing is held; expected a base")
        self.gravity_load = self.mass[:, None] * pull
        self._cell_stiffness = _cell_stiffness(self.cells)
        highest = np.linalg.eigvalsh(self._cell_stiffness)[:, -1] / corner_mass
        self.longest_step = float(np.sqrt(self.beta**2 + 4 / highest.max()) - self.beta)
        """Longest stable step [s]."""

    def stiffness(self) -> sparse.csc_matrix:
        """Elastic K [N/m], components of a node together, shape ``(2·num_nodes, 2·num_nodes)``."""
        dofs = (2 * self.cells.nodes[:, :, None] + np.arange(2)).reshape(-1, 8)
        rows, columns = np.repeat(dofs, 8, axis=1), np.tile(dofs, 8)
        shape = (self.mass.size * 2,) * 2
        entries = (self._cell_stiffness.ravel(), (rows.ravel(), columns.ravel()))
        return sparse.csc_matrix(sparse.coo_matrix(entries, shape))

    def unstressed(self) -> State:
        """The state without gravity."""
        points = self.cells.volume.shape
        at_nodes, at_points = np.zeros(self.nodes.shape), np.zeros((*points, 3))
        return State(at_nodes, at_nodes.copy(), at_points, at_points.copy(), np.zeros(points))

    def strain(self, state: State, increment: RealArray) -> None:
        """Move the nodes, at no speed, and let the soil yield.

        Args:
            state: Overwritten.
            increment: Of the displacement [m], shape ``(num_nodes, 2)``.
        """
        state.displacement[:] += increment
        strain(self.cells, state, np.ascontiguousarray(increment), 0.0, False)

    def rest(self, start: str = "static") -> State:
        """The state under gravity.

        Stresses that gravity leaves in a yielding soil hang on how it is switched on. ``static``:
        at once on the elastic soil, then equilibrium iterations with the elastic stiffness.
        ``sudden``: at once on the soil at rest, which swings past its equilibrium, yields on its
        way and is damped by C alone; then equilibrium iterations.

        Args:
            start: ``static`` or ``sudden``.

        Returns:
            The state, without velocity.

        Raises:
            ValueError: Another start.
            NoEquilibrium: The soil does not carry its weight.
        """
        if start not in ("static", "sudden"):
            raise ValueError(f"start: found {start!r}; expected static or sudden")
        state = self.unstressed()
        if start == "sudden":
            self.march(state, np.zeros((2, 2)), _SWINGING)
            state.velocity[:], state.viscous[:] = 0.0, 0.0
        self._balance(state)
        return state

    def _balance(self, state: State) -> None:
        """Equilibrium iterations with the elastic stiffness."""
        free = self.free.ravel()
        elastic: SuperLU = splu(self.stiffness()[free][:, free])
        weight, latest = float(np.linalg.norm(self.gravity_load)), np.inf
        for iteration in count():
            residual = self.gravity_load.copy()
            resist(self.cells, state, residual)
            unbalanced = float(np.linalg.norm(residual[self.free]))
            if unbalanced <= _AT_REST * weight:
                return
            if iteration % _PATIENCE == 0:
                if unbalanced > _PROGRESS * latest:
                    raise NoEquilibrium(
                        f"gravity: found {unbalanced / weight:.2g} of the weight without support "
                        f"after {iteration} iterations, hardly less than {_PATIENCE} before; "
                        f"expected {_AT_REST:g}; the strength is too low"
                    )
                latest = unbalanced
            increment = np.zeros(free.size)
            increment[free] = elastic.solve(residual.ravel()[free])
            self.strain(state, increment.reshape(-1, 2))

    def march(
        self,
        state: State,
        drive: RealArray,
        step: float,
        substeps: int | None = None,
        watched: npt.ArrayLike = (),
    ) -> tuple[RealArray, RealArray, RealArray, int]:
        """March in time, gravity acting, the drive linear between its samples.

        Args:
            state: Overwritten.
            drive: −ü_b [m/s^2], shape ``(num_samples, 2)``.
            step: From sample to sample [s].
            substeps: Steps a sample; ``None`` for those that stability asks for.
            watched: Nodes, shape ``(num_watched,)``.

        Returns:
            Displacement of the watched nodes less that at the start [m], shape ``(num_watched, 2,
            num_samples)``; the largest of all nodes [m], shape ``(num_samples,)``; work, kinetic,
            elastic, plastic and viscous energy since the start [J], shape ``(5, num_samples)``;
            the steps a sample.

        Raises:
            ValueError: The step is longer than is stable.
        """
        least = int(np.ceil(step / self.longest_step))
        substeps = (
            int(np.ceil(step / (SAFETY * self.longest_step))) if substeps is None else substeps
        )
        if substeps < least:
            raise ValueError(f"substeps: found {substeps}; expected at least {least}, to be stable")
        nodes = np.array(watched, dtype=np.int64).reshape(-1)
        histories = np.zeros((len(drive), nodes.size, 2)), np.zeros(len(drive))
        energy = np.zeros((len(drive), 5))
        ground = self.mass, self.gravity_load, self.free, self.beta, self.damp_slip
        march(self.cells, ground, state, drive, step / substeps, substeps, nodes, histories, energy)
        energy[:, 2:4] -= energy[0, 2:4]
        return np.moveaxis(histories[0], 0, 2), histories[1], energy.T, substeps


def elastoplastic_slope(
    section: Section,
    base_acceleration: npt.ArrayLike,
    dt: float,
    *,
    duration: float | None = None,
    start: str | State = "static",
    watched: npt.ArrayLike = (),
    substeps: int | None = None,
) -> Motion:
    """Shake a section that stands under gravity.

    Args:
        section: The section.
        base_acceleration: ü_b [m/s^2], along x with shape ``(num_samples,)`` or of shape
            ``(num_samples, 2)``; linear between samples, 0 from the one after the last on.
        dt: From sample to sample [s].
        duration: How long to march [s]; as long as the record if ``None``.
        start: How gravity is switched on, see :meth:`Section.rest`, or a state of rest.
        watched: Nodes whose displacement is wanted.
        substeps: Steps a sample; ``None`` for those that stability asks for.

    Returns:
        The motion since rest.

    Raises:
        ValueError: A number is out of range, or a shape does not fit.
        NoEquilibrium: The soil does not carry its weight.
    """
    base = np.array(base_acceleration, dtype=np.float64)
    if base.ndim == 1:
        base = np.stack([base, np.zeros_like(base)], axis=1)
    _check_shape("base_acceleration", base, (len(base), 2))
    if not (np.isfinite(dt) and dt > 0.0 and np.isfinite(base).all()):
        raise ValueError(f"dt: found {dt} s; expected a positive one, and finite accelerations")
    steps = len(base) if duration is None else round(duration / dt)
    drive = np.zeros((steps + 1, 2))
    drive[: len(base)] -= base[: steps + 1]
    state = start.copy() if isinstance(start, State) else section.rest(start)
    displacement, largest, energy, substeps = section.march(state, drive, dt, substeps, watched)
    names = ("work", "kinetic", "elastic", "plastic", "viscous")
    return Motion(
        time=dt * np.arange(steps + 1, dtype=np.float64),
        displacement=displacement,
        largest=largest,
        energy=dict(zip(names, energy, strict=True)),
        state=state,
        substeps=substeps,
    )


def _check_shape(name: str, values: npt.NDArray[np.generic], shape: tuple[int, ...]) -> None:
    if values.shape != shape:
        raise ValueError(f"{name}: found shape {values.shape}; expected {shape}")


def _positive(name: str, values: npt.ArrayLike, count: int) -> RealArray:
    """One value a cell."""
    found = np.array(values, dtype=np.float64)
    if found.shape not in ((), (count,)):
        raise ValueError(f"{name}: found shape {found.shape}; expected one value or ({count},)")
    if not (found > 0.0).all():
        raise ValueError(f"{name}: found {found.min():g}; expected positive numbers")
    return np.array(np.broadcast_to(found, (count,)))


def _shape_gradients(corners: RealArray) -> tuple[RealArray, RealArray]:
    """Gradients of the shape functions and volumes, at 2 × 2 Gauss points."""
    points = _CORNERS / np.sqrt(3.0)
    other = 1.0 + points[:, None, ::-1] * _CORNERS[None, :, ::-1]  # 1 + ηη_n, 1 + ξξ_n
    slopes = _CORNERS * other / 4
    jacobian = np.einsum("gnk,cni->cgik", slopes, corners)
    volume = np.linalg.det(jacobian)
    if volume.min() <= 0.0:
        cell = int(np.argmin(volume.min(axis=1)))
        raise ValueError(
            f"cells: found cell {cell} turned over; expected corners counter-clockwise"
        )
    return np.einsum("gnk,cgki->cgni", slopes, np.linalg.inv(jacobian)), volume


def _cell_stiffness(cells: Cells) -> RealArray:
    """Elastic stiffness of each cell [N/m], shape ``(num_cells, 8, 8)``."""
    strain = np.zeros((*cells.volume.shape, 3, 8))  # e, d and γ of the corners' displacements
    strain[..., 0, 0::2], strain[..., 0, 1::2] = cells.dilatation[..., 0], cells.dilatation[..., 1]
    strain[..., 1, 0::2], strain[..., 1, 1::2] = cells.gradients[..., 0], -cells.gradients[..., 1]
    strain[..., 2, 0::2], strain[..., 2, 1::2] = cells.gradients[..., 1], cells.gradients[..., 0]
    moduli = cells.moduli[:, [0, 1, 1]]
    return np.einsum("cgki,ck,cgkj,cg->cij", strain, moduli, strain, cells.volume, optimize=True)
