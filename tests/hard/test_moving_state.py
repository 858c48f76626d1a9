# SPDX-License-Identifier: MIT
"""Hard cases 28 and 30: what points carry while they turn, and when it is no longer to be trusted.

Naively strain is the symmetric part of I + ∇u: a rotation then makes volume and stress, and a cell
that collapses goes on with a negative one.
"""

import numpy as np
import pytest
from dolfinx.mesh import CellType, create_unit_cube, create_unit_square
from mpi4py import MPI
from scipy.linalg import expm
from support.meshes import SOIL, scene

from fenics_hytf.domain import build
from fenics_hytf.lapse import VolumeError, convect, seed_points
from fenics_hytf.particles import seed, to_tensor, update_kinematics
from fenics_hytf.simulation import simulate

TURN = 0.1  # rad a lapse
QUIET_AT_ITS_END = {"n": 800, "dt": 0.01, "f2": 8.0, "t1": 1.0, "t2": 3.0, "c": 2.0}
LAPSES = 50


def block(dim: int):
    """Points of a block, with all that lapses hand over."""
    comm = MPI.COMM_SELF
    if dim == 2:
        mesh = create_unit_square(comm, 2, 2, CellType.quadrilateral)
    else:
        mesh = create_unit_cube(comm, 2, 2, 2, CellType.hexahedron)
    cells = mesh.topology.index_map(dim).size_local
    points = seed(mesh, np.zeros(cells, np.int32), [1800.0], 2**dim, ["strain", "stress"])
    count = 3 * dim - 3
    rng = np.random.default_rng(28)
    for name, shape in {
        "dynamic_strain": (count,),
        "dynamic_stress": (count,),
        "memory_strain": (4, count),
    }.items():
        points.add(name, shape)
        points[name] = rng.normal(size=(len(points), *shape))
    points["stress"] = rng.normal(size=(len(points), count))
    return points


def spin(dim: int, angle: float) -> np.ndarray:
    """A skew gradient: a rotation about a slanted axis in space, or in the plane."""
    if dim == 2:
        return angle * np.array([[0.0, -1.0], [1.0, 0.0]])
    x, y, z = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    return angle * np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def invariants(tensors: np.ndarray) -> np.ndarray:
    powers = [tensors, tensors @ tensors, tensors @ tensors @ tensors]
    return np.stack([np.trace(power, axis1=-2, axis2=-1) for power in powers], axis=-1)


def tensors_of(points, name: str) -> np.ndarray:
    columns = points[name].reshape(-1, points[name].shape[-1]).copy()
    dim = {3: 2, 6: 3}[columns.shape[1]]
    if "strain" in name and name != "strain":
        columns[:, dim:] /= 2  # γ = 2ε
    return to_tensor(columns)


@pytest.mark.parametrize("dim", [2, 3])
def test_28_a_rotation_keeps_the_volume(dim, figure):
    """Naively det(I + ∇u) = 1 + θ²: 50 lapses of 0.1 rad make 60 % of volume."""
    points = block(dim)
    before, naive = points.volume.copy(), points.volume.copy()
    gradient = np.tile(spin(dim, TURN), (len(points), 1, 1))
    for _ in range(LAPSES):
        update_kinematics(points, gradient, 1e6, 1e6)
        naive *= np.linalg.det(np.eye(dim) + gradient)
    drift = np.abs(points.volume / before - 1).max()
    figure("volume drift of 50 lapses of 0.1 rad", drift, 1e-12)
    figure("naive, det(I + ∇u): volume drift", np.abs(naive / before - 1).max(), 0.5, at_least=True)


@pytest.mark.parametrize("dim", [2, 3])
def test_28_a_turned_block_keeps_its_invariants(dim, figure):
    """A stressed block turned by 90 degrees in 20 steps: all that is carried turns with it."""
    points, names = block(dim), ("stress", "dynamic_strain", "dynamic_stress", "memory_strain")
    before = {name: tensors_of(points, name) for name in names}
    gradient = np.tile(spin(dim, np.pi / 40), (len(points), 1, 1))
    for _ in range(20):
        update_kinematics(points, gradient, 0.0, 0.0)
    R = expm(spin(dim, np.pi / 2))
    for name in names:
        after = tensors_of(points, name)
        kept = np.abs(invariants(after) - invariants(before[name])).max()
        figure("change of invariants of stress and strain", kept, 1e-10)
        turned = np.abs(after - R @ before[name] @ R.T).max()
        figure("stress and strain off R T Rᵀ", turned, 1e-10)


@pytest.mark.parametrize("squeeze", [np.log(0.05), np.log(12.0)])
@pytest.mark.parametrize("dim", [2, 3])
def test_30_a_volume_that_collapses_is_a_typed_error(dim, squeeze, figure):
    """Naively the points go on with a volume of nothing, or a negative one."""
    kind = "quadrilateral" if dim == 2 else "hexahedron"
    case = scene({"box": {"size": [4.0] * dim, "cells": [2] * dim, "cell": kind}}, ("clay",))
    domain = build(case, MPI.COMM_SELF)
    points = seed_points(case, domain)
    held = {name: values.copy() for name, values in points.arrays().items()}
    x = domain.V.tabulate_dof_coordinates()[:, :dim]
    increment = np.zeros_like(x)
    increment[:, 0] = squeeze * (x[:, 0] - 2.0)
    with pytest.raises(VolumeError, match="volume has become") as caught:
        convect(domain, points, increment, "park", density=np.array([SOIL["density"]]))
    unnamed = len(set(caught.value.points) ^ set(points.id.tolist()))
    figure("points of J = 0.05 or 12 that are not named", unnamed, 0)
    after = points.arrays()
    changed = sum(int(np.sum(after[name] != values)) for name, values in held.items())
    figure("values of points changed by a move that fails", changed, 0)


@pytest.mark.parametrize("law", ["elastic", "viscous", "maxwell"])
@pytest.mark.parametrize("dim", [2, 3])
def test_30_energy_is_accounted_for(dim, law, tmp_path, figure):
    """Naively energy is made or lost at seams, and nobody sees it."""
    kind = "quadrilateral" if dim == 2 else "hexahedron"
    size, cells = [12.0] * (dim - 1) + [8.0], [4] * (dim - 1) + [4]
    effects = {"rayleigh": {"beta": 2e-3}} if law == "viscous" else {}
    sides = ("left", "right", "front", "back")[: 2 * (dim - 1)]
    result = simulate(
        scene(
            {"box": {"size": size, "cells": cells, "cell": kind}},
            ("clay",),
            soil={"clay": SOIL | {"damping": 0.05 if law == "maxwell" else 0.0}},
            motion=[{"direction": "x", "synthetic": QUIET_AT_ITS_END, "pga": 0.1}],
            boundary=dict.fromkeys(sides, "tied" if law == "elastic" else "dashpot"),
            lapses={"count": 4, "continuity": "transient"},
            effects=effects,
            output={"receivers": {}},
        ),
        MPI.COMM_SELF,
    )
    scale = max(max(abs(lapse.energy.input), *lapse.energy.stored) for lapse in result.lapses)
    open_ = max(abs(lapse.energy.imbalance) for lapse in result.lapses) / scale
    figure("|W_ext − W_damp − ΔE| over W", open_, 1e-3)
    seams = max(abs(lapse.energy.seam) for lapse in result.lapses) / scale
    figure("energy made or lost at seams over W", seams, 1e-3)
