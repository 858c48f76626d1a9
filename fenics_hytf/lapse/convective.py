# SPDX-License-Identifier: MIT
"""The convective phase between lapses: points move, are found again, carry on.

Points take the increment Δu = S(u(t_end) − u(t_start)) of the lapse with its gradient; the mesh
stays where it was. Under ``steady`` continuity a lapse is periodic and the net increment is zero.
What has slipped they ride in short steps, on a field that is as even as the cells allow, and the
pieces of soil that they stand for ride along.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from fenics_hytf.domain import Domain
from fenics_hytf.lapse.errors import VolumeError
from fenics_hytf.lapse.filling import cell_integrals
from fenics_hytf.lapse.material import ElasticConstants
from fenics_hytf.particles import (
    MoveReport,
    Points,
    PointsNotFinite,
    PointsOutside,
    carry_pieces,
    even_shift,
    gradient_matrices,
    move,
    to_tensor,
    transfer_matrix,
    update_kinematics,
)

RealArray = npt.NDArray[np.float64]

_STRIDE = 0.1  # of a cell: points ride what slips in steps of no more
_LEAST_VOLUME = 0.1  # of a point over that at the start; its inverse is the most


def convect(
    domain: Domain,
    points: Points,
    increment: RealArray,
    outside: Literal["error", "park", "delete"] = "error",
    constants: ElasticConstants | None = None,
    velocity: RealArray | None = None,
    acceleration: RealArray | None = None,
    density: RealArray | None = None,
    slip: RealArray | None = None,
) -> MoveReport:
    """Move the points with the nodes' increment and find them again (collective).

    Args:
        domain: The domain.
        points: The points, changed in place.
        increment: Displacement increment of the lapse at the local nodes, ghosts included [m],
            shape ``(num_local_nodes, gdim)``.
        outside: What happens to a point that leaves the mesh.
        constants: Elastic constants of every cell in the order of the input, for points that carry
            stress. Where lapses hand over, what the strain adds is the dynamic stress that points
            carry besides, and the static one only goes with the ground.
        velocity: At the nodes at the end of the lapse [m/s], for points that carry it, shaped like
            the increment.
        acceleration: Likewise [m/s^2].
        density: Of each region when it was seeded [kg/m^3], to know a point's volume then, shape
            ``(num_regions,)``.
        slip: Plastic part λφ of the increment, likewise; it turns stress and adds none.

    Returns:
        The mass ledger, and how many points were mapped.

    Raises:
        VolumeError: A point's volume has become less than a tenth, or more than ten times, of what
            it was.
        PointsOutside: A point left the mesh and ``outside`` is ``error``.
        PointsNotFinite: The increment is not finite. Each is raised on every rank, and leaves the
            points as they were.
    """
    before = points.arrays() | {name: old.copy() for name, old in points.history.items()}
    S = transfer_matrix(points, domain.V)
    for name, field in (("velocity", velocity), ("acceleration", acceleration)):
        if field is not None and name in points.history:
            points[name] = S @ field
    if "dynamic_stress" in points.history:
        constants = None
    strides = 1 if slip is None else _strides(domain, slip)
    slip = None if slip is None else slip / strides
    reports = []
    try:
        for _ in range(strides):
            displacement = _ride(domain, points, increment / strides, slip, constants)
            if density is not None:
                _require_volume(domain, points, density)
            reports.append(move(domain.mesh, points, displacement, outside))
    except (PointsOutside, PointsNotFinite, VolumeError):
        points.assign(before)
        raise
    migrated = sum(report.ledger.migrated for report in reports)
    mapped = sum(report.inverse_mappings for report in reports)
    return MoveReport(replace(reports[-1].ledger, migrated=migrated), mapped)


def _strides(domain: Domain, slip: RealArray) -> int:
    """Steps to ride a flow in (collective): in one, what turns would spread, and thin out."""
    longest = float(np.linalg.norm(slip, axis=1).max(initial=0.0))
    smallest = float(domain.cell_sizes().min(initial=np.inf))
    shares = domain.comm.allgather((longest, smallest))
    way, size = max(share[0] for share in shares), min(share[1] for share in shares)
    return max(1, int(np.ceil(way / (_STRIDE * size) - 1e-9)))


def _ride(
    domain: Domain,
    points: Points,
    increment: RealArray,
    slip: RealArray | None,
    constants: ElasticConstants | None,
) -> RealArray:
    """What points carry follows an increment; the displacement by which they are to move."""
    S = transfer_matrix(points, domain.V)
    gradients = gradient_matrices(points, domain.V)
    gradient = np.stack([dS @ increment for dS in gradients], axis=2)
    displacement, moved, plastic = S @ increment, gradient, None
    if slip is not None:
        plastic = np.stack([dS @ slip for dS in gradients], axis=2)
        shift, of_shift = even_shift(domain.V, slip, points)
        displacement, moved = displacement + S @ slip + shift, gradient + plastic + of_shift
    if np.isfinite(gradient).all():
        moduli: dict[str, npt.ArrayLike] = {"lame_lambda": 0.0, "shear_modulus": 0.0}
        if constants is not None:
            cells = domain.input_cells[points.cell]
            moduli = {
                "lame_lambda": constants.lame_lambda[cells],
                "shear_modulus": constants.shear_modulus[cells],
            }
        # Stress overflows in points that collapse or are thrown out: volume or place tells.
        with np.errstate(over="ignore", invalid="ignore"):
            update_kinematics(points, gradient, **moduli, plastic=plastic)
        if "piece" in points.history:
            carry_pieces(points, moved)
    return np.asarray(displacement)


def _require_volume(domain: Domain, points: Points, density: RealArray) -> None:
    """No point has collapsed or blown up; agreed on by all ranks."""
    ratio = points.volume * density[points.region] / points.mass
    wrong = ~((ratio >= _LEAST_VOLUME) & (ratio <= 1 / _LEAST_VOLUME))
    shares = domain.comm.allgather((points.id[wrong].tolist(), ratio[wrong].tolist()))
    found = sorted(pair for ids, ratios in shares for pair in zip(ids, ratios, strict=True))
    if found:
        raise VolumeError([point for point, _ in found], found[0][1])


def cell_stress(domain: Domain, points: Points) -> RealArray:
    """Stress of each local cell, the mean over its points by volume.

    Args:
        domain: The domain.
        points: Points that carry stress.

    Returns:
        Cauchy stress [Pa], ghosts included, nought where there is none, shape
        ``(num_local_cells, gdim, gdim)``.
    """
    values = np.column_stack([np.ones(len(points)), points["stress"]])
    everyone = cell_integrals(domain, points, values, None)[domain.input_cells]
    volume = np.where(everyone[:, :1] > 0, everyone[:, :1], 1.0)
    return to_tensor(everyone[:, 1:] / volume)
