# SPDX-License-Identifier: MIT
"""Slip mechanisms against what limit analysis knows: cuts, slopes, level layers, and each other."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
import ufl
from dolfinx import la
from dolfinx.fem import Function, form, functionspace
from dolfinx.fem.petsc import assemble_matrix
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse.linalg import splu
from support.meshes import scene
from support.reference import load_sliding

from fenics_hytf.domain import Domain, MeshData, make_domain
from fenics_hytf.domain.grids import box_mesh
from fenics_hytf.frequency import FactorisationError
from fenics_hytf.lapse import Mechanism, MechanismError, MechanismSearch, mechanism
from fenics_hytf.lapse.unknowns import Unknowns
from fenics_hytf.motion import recorded
from fenics_hytf.operators.quadrature import gauss_sites
from fenics_hytf.particles import transfer_matrix
from fenics_hytf.study.stability.ground import csr

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
ROLLERS = {"base": "fixed", "left": "roller", "right": "roller"}
SETTLED = 1e-4  # of the dissipation: what a search leaves to be gained
G0 = 9.81  # of slope2d.json


@dataclass
class Ground:
    """Ground with what a search asks for; the strength is given in each test."""

    domain: Domain
    unknowns: Unknowns
    search: MechanismSearch
    weight: np.ndarray
    gravity: PETSc.Vec
    driving: PETSc.Vec

    @property
    def centres(self) -> np.ndarray:
        """Of local cells."""
        geometry = self.domain.mesh.geometry
        return geometry.x[geometry.dofmap].mean(axis=1)[:, : self.domain.gdim]

    def strength(self, value: float) -> np.ndarray:
        return np.full(len(self.weight), value)

    def find(self, strength, gravity=True, driving=None, start=None) -> Mechanism:
        load = self.gravity if gravity else None
        force = self.driving if driving is None else driving
        strength = self.strength(strength) if np.isscalar(strength) else strength
        return self.search.find(self.unknowns, self.weight, strength, load, force, start)

    def safety(self, strength) -> float:
        strength = self.strength(strength) if np.isscalar(strength) else strength
        arguments = self.unknowns, self.weight, strength, self.gravity
        return self.search.factor_of_safety(*arguments)


def grid(size, cells, cell="quadrilateral", keep=None, move=None) -> MeshData:
    """A box of which some cells are kept, by their centres, and whose nodes are moved."""
    box = scene({"box": {"size": list(size), "cells": list(cells), "cell": cell}}, ("clay",)).mesh
    data = box_mesh(box.box, box, ("clay",))
    if keep is not None:
        kept = data.cells[keep(data.points[data.cells].mean(axis=1))]
        used, kept = np.unique(kept, return_inverse=True)
        kept = kept.reshape(-1, data.cells.shape[1])
        data = replace(data, points=data.points[used], cells=kept, region=data.region[: len(kept)])
    return data if move is None else replace(data, points=move(data.points))


def ground(
    data: MeshData,
    supports: dict[str, str],
    weight: Callable[[np.ndarray], np.ndarray] = lambda x: np.ones(len(x)),
    *,
    unit_weight: float = 1.0,
    down=None,
    along=None,
    degree: int = 1,
    comm=WORLD,
) -> Ground:
    """Ground of a mesh; the weight of its cells follows from their centres."""
    gdim = data.points.shape[1]
    domain = make_domain(data if comm.rank == 0 else None, comm, degree, gdim)
    geometry = domain.mesh.geometry
    filled = weight(geometry.x[geometry.dofmap].mean(axis=1)[:, :gdim])
    touched = Function(domain.V)
    owned = domain.num_owned_cells
    nodes = domain.V.dofmap.list[:owned][filled[:owned] > 0].ravel()
    touched.x.array.reshape(-1, gdim)[nodes] = 1.0
    touched.x.scatter_reverse(la.InsertMode.add)
    size = domain.V.dofmap.index_map.size_local
    bare = touched.x.array.real.reshape(-1, gdim)[:size, 0] == 0
    unknowns = Unknowns(domain, supports, bare=bare)
    sites, volume = gauss_sites(domain)
    N = transfer_matrix(sites, domain.V)
    nodal = N.T @ (unit_weight * volume * filled[:owned, None]).ravel()
    down = -np.eye(gdim)[-1] if down is None else np.asarray(down)
    along = np.eye(gdim)[0] if along is None else np.asarray(along)
    forces = [unknowns.collect((nodal[:, None] * way).ravel()) for way in (down, along)]
    return Ground(domain, unknowns, MechanismSearch(domain), filled, *forces)


def in_cut(x: np.ndarray) -> np.ndarray:
    """The ground of a cut of 1 m at x = 1 m, on half a metre of ground."""
    return (x[:, -1] < 0.5) | (x[:, 0] > 1.0)


def cut(n: int, cell="quadrilateral", **options) -> Ground:
    """A vertical cut of height 1 and n cells, behind it 1.5 m; unit weight 1."""
    return ground(grid((2.5, 1.5), (5 * n // 2, 3 * n // 2), cell, in_cut), ROLLERS, **options)


def slope45(n: int, **options) -> Ground:
    """A slope of 45° and height 1, the mesh fitted to its face."""

    def lean(x):
        above = np.maximum(x[:, 1] - 0.5, 0.0)
        return np.stack([x[:, 0] + above * (4.0 - x[:, 0]) / 3.0, x[:, 1]], axis=1)

    data = grid((4.0, 1.5), (4 * n, 3 * n // 2), keep=in_cut, move=lean)
    return ground(data, ROLLERS, along=[-1.0, 0.0], **options)


# ---------------------------------------------------------------- heights


def test_vertical_cut(figure):
    """N = γH/c is 3.776: what limit analysis has closed in on from both sides."""
    coarse, fine = (cut(n).safety(1.0) for n in (10, 20))
    figure("vertical cut, h = H/20, γH/c", fine, 3.95)
    figure("vertical cut, h = H/20, γH/c", fine, 3.78, at_least=True)
    # An upper bound that falls nearly as h, for a slip surface is as wide as a cell.
    assert 1.7 < (coarse - 3.776) / (fine - 3.776) < 2.2


def test_vertical_cut_in_cells_of_degree_2(figure):
    figure("vertical cut, degree 2, h = H/10, γH/c", cut(10, degree=2).safety(1.0), 3.95)
    triangles = cut(10, "triangle", degree=2).safety(1.0)
    figure("vertical cut, triangles of degree 2, h = H/10, γH/c", triangles, 4.0)
    figure("vertical cut, triangles of degree 2, h = H/10, γH/c", triangles, 3.776, at_least=True)


def test_a_cut_in_a_grid_with_empty_cells_is_that_of_the_cells_alone():
    """Cells of weight 0 bring nothing: the same problem, its unknowns in another order."""
    whole = ground(grid((2.5, 1.5), (25, 15)), ROLLERS, lambda x: np.where(in_cut(x), 1.0, 0.0))
    strength = np.where(in_cut(whole.centres), 1.0, np.nan)  # of nothing
    assert whole.safety(strength) == pytest.approx(cut(10).safety(1.0), rel=1e-9)


def test_slope_of_45_degrees(figure):
    """Taylor (1937) gives 5.5 to 5.6 on a shallow base; in a grid of squares the face is stairs."""
    fitted = slope45(16).safety(1.0)
    figure("slope of 45°, h = H/16, γH/c", fitted, 5.65)
    figure("slope of 45°, h = H/16, γH/c", fitted, 5.45, at_least=True)

    def part(x):
        depth = (np.maximum(x[:, 0] - 1.0, 0.0) + 0.5 - x[:, 1]) * 16  # of centres, in cells
        return np.where(x[:, 1] < 0.5, 1.0, np.clip(np.round(depth, 6) + 0.5, 0.0, 1.0))

    stairs = ground(grid((4.0, 1.5), (64, 24)), ROLLERS, part)
    assert np.unique(stairs.weight).tolist() == [0.0, 0.5, 1.0]
    figure("slope of 45° in stairs, off the fitted one", abs(stairs.safety(1.0) / fitted - 1), 0.01)


# ---------------------------------------------------------------- closed forms

HEIGHT, WIDTH, LAYERS, UNIT_WEIGHT = 10.0, 2.0, 10, 18e3


def infinite_slope(cell: str, angle: float, degree: int = 1) -> Ground:
    """A column of a slope, its axes along and across the slope, shaken along it."""
    gdim = 2 if cell in ("triangle", "quadrilateral") else 3
    level = [WIDTH] * (gdim - 1)
    data = grid((*level, HEIGHT), (*[1] * (gdim - 1), LAYERS), cell)
    supports = dict.fromkeys(("left", "right", "front", "back")[: 2 * gdim - 2], "tied")
    down = np.zeros(gdim)
    down[0], down[-1] = np.sin(angle), -np.cos(angle)
    supports |= {"base": "fixed"}
    return ground(data, supports, unit_weight=UNIT_WEIGHT, down=down, degree=degree)


def sheared_layer(cohesion: float, angle: float) -> tuple[float, float]:
    """k_y and FS where one layer of cells of degree 1 shears, half of it moving along."""
    drive = UNIT_WEIGHT * (HEIGHT - 0.5 * HEIGHT / LAYERS)
    return cohesion / drive - np.sin(angle), cohesion / (drive * np.sin(angle))


@pytest.mark.parametrize("cohesion", [30e3, 6e3])  # a pressure of 5.9 and of 29 times that
@pytest.mark.parametrize("cell", ["quadrilateral", "triangle", "hexahedron", "tetrahedron"])
def test_infinite_slope(cell, cohesion, figure):
    angle = np.radians(10.0)
    slope = infinite_slope(cell, angle)
    k_y, safety = sheared_layer(cohesion, angle)
    found = slope.find(cohesion)
    dissipation = k_y + np.sin(angle)  # where the driving force does unit work
    # 0.4 (p/100τ)⁴, and what ε shears the other layers by.
    limit = 0.4 * (0.01 * UNIT_WEIGHT * HEIGHT * np.cos(angle) / cohesion) ** 4 + SETTLED
    error = abs(found.yield_coefficient - k_y) / dissipation
    figure(f"k_y of an infinite slope, {cell}, c = {cohesion:.0f} Pa", error, limit)
    assert slope.safety(cohesion) == pytest.approx(safety, rel=limit)
    assert found.dissipation == pytest.approx(cohesion * WIDTH ** (slope.domain.gdim - 1), rel=1e-2)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle", "hexahedron", "tetrahedron"])
def test_infinite_slope_in_cells_of_degree_2(cell):
    """Less than half of the sheared cells moves back with the base: between the bounds."""
    angle = np.radians(10.0)
    exact = 30e3 / (UNIT_WEIGHT * HEIGHT) - np.sin(angle)
    found = infinite_slope(cell, angle, degree=2).find(30e3).yield_coefficient
    assert exact < found < sheared_layer(30e3, angle)[0]


# ---------------------------------------------------------------- what must agree


def test_strength_over_the_factor_of_safety_just_stands():
    """Two searches with other loads: k_y of a slope whose strength is c/FS is nought."""
    slope = slope45(8)
    found = slope.find(0.25 / slope.safety(0.25))
    assert abs(found.yield_coefficient) < 2 * SETTLED * found.dissipation / found.driving


def test_the_functional_falls():
    slope = slope45(8)
    for found in (cut(10).find(1.0, gravity=False), slope.find(0.25), slope.find(0.15)):
        scale = found.dissipation / found.driving
        # ε may raise it by 1e-5 of a cell's share
        assert np.diff(found.functional).max() < 1e-5 * scale
        assert found.functional[0] - found.functional[-1] > 0.1 * scale
        assert len(found.functional) == found.iterations
        assert 15 < found.factorisations == found.iterations < 50


def test_what_a_mechanism_says_of_itself():
    slope = slope45(8)
    found = slope.find(0.25)
    unknowns = slope.unknowns.restrict(found.field)
    field = slope.unknowns.expand(unknowns)
    np.testing.assert_allclose(found.field, field, atol=1e-14)
    assert np.linalg.norm(found.field, axis=1).max() == pytest.approx(1.0, rel=1e-12)
    driving = slope.driving.array_r.real @ unknowns
    gravity = slope.gravity.array_r.real @ unknowns
    assert found.driving == pytest.approx(driving, rel=1e-12)
    balance = (found.dissipation - gravity) / driving
    assert found.yield_coefficient == pytest.approx(balance, abs=2e-3)  # θ is nought but for 1e-4
    assert slope.search.factorisations == found.factorisations


def test_ground_that_does_not_stand_has_a_negative_coefficient():
    slope = slope45(8)
    strength = 0.85 / 5.6
    assert 0.8 < slope.safety(strength) < 0.9
    assert -0.2 < slope.find(strength).yield_coefficient < -0.02


def test_the_other_sense_yields_later():
    slope = slope45(8)
    uphill = slope.driving.copy()
    uphill.scale(-1.0)
    later = slope.find(0.25, driving=uphill).yield_coefficient
    assert later > 2 * slope.find(0.25).yield_coefficient
    uphill.destroy()


@pytest.mark.parametrize("weak", [0.6, 1.5])
def test_a_warm_start_finds_the_same_sooner(weak):
    """From the mechanism of even ground to that of a weak or a strong layer at mid-height."""
    slope = slope45(10)
    start = slope.find(0.25).field
    layer = np.abs(slope.centres[:, 1] - 0.9) < 0.1
    strength = np.where(layer, weak * 0.25, 0.25)
    cold, warm = slope.find(strength), slope.find(strength, start=start)
    scale = cold.dissipation / cold.driving
    assert abs(warm.yield_coefficient - cold.yield_coefficient) < 3 * SETTLED * scale
    assert warm.factorisations < 0.75 * cold.factorisations
    again = slope.find(strength, start=cold.field)
    assert again.factorisations <= 4
    back = slope.find(strength, start=-start)  # does no work: as if cold
    assert back.yield_coefficient == cold.yield_coefficient


def test_strength_at_gauss_points():
    section = cut(10)
    points = section.search._form.volume.shape
    even = section.find(np.full(points, 1.0), gravity=False, driving=section.gravity)
    assert even.yield_coefficient == section.safety(1.0)
    half = section.find(np.full(points, 0.5), gravity=False, driving=section.gravity)
    assert half.yield_coefficient == pytest.approx(0.5 * even.yield_coefficient, rel=1e-9)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_body_in_plane_strain_is_its_section(degree):
    n = 8 // degree
    section = cut(n, degree=degree).safety(1.0)
    keep = grid((2.5, 0.25, 1.5), (5 * n // 2, 1, 3 * n // 2), "hexahedron", in_cut)
    body = ground(keep, ROLLERS | {"front": "roller", "back": "roller"}, degree=degree)
    assert body.safety(1.0) == pytest.approx(section, rel=1e-7)


@pytest.mark.mpi
@pytest.mark.skipif(WORLD.size == 1, reason="compares several ranks with one")
@pytest.mark.parametrize("cell", ["quadrilateral", "hexahedron", "triangle"])
def test_the_same_on_any_number_of_ranks(cell, figure):
    def found(comm):
        options = {"weight": lambda x: np.where(in_cut(x), 1.0, 0.0), "comm": comm}
        if cell == "hexahedron":
            data = grid((2.5, 0.25, 1.5), (20, 1, 12), cell)
            section = ground(data, ROLLERS | {"front": "roller", "back": "roller"}, **options)
        else:
            degree = 2 if cell == "triangle" else 1
            section = ground(grid((2.5, 1.5), (20, 12), cell), ROLLERS, degree=degree, **options)
        result = section.find(0.5, driving=section.driving)
        x = section.domain.V.tabulate_dof_coordinates().round(6) + 0.0
        return result, dict(zip(map(tuple, x), result.field, strict=True))

    (mine, field), (alone, whole) = found(WORLD), found(SELF)
    assert mine.iterations == alone.iterations
    scale = alone.dissipation / alone.driving
    error = abs(mine.yield_coefficient - alone.yield_coefficient) / scale
    figure(f"k_y on all ranks and on one, {cell}", error, 1e-8)
    # φ has the round-off of K_s, whose moduli range over nine decades.
    off = max(np.abs(u - whole[x]).max() for x, u in field.items())
    figure(f"mechanism on all ranks and on one, {cell}", WORLD.allreduce(off, MPI.MAX), 1e-6)


# ---------------------------------------------------------------- what is refused


def test_refusals(monkeypatch):
    section = cut(4)
    with pytest.raises(ValueError, match="shear strength of 0 Pa; expected a positive one"):
        section.find(np.where(section.centres[:, 0] > 2, 0.0, 1.0))
    nothing = section.driving.duplicate()
    with pytest.raises(ValueError, match="no driving force"):
        section.find(1.0, driving=nothing)
    loose = ground(grid((2.5, 1.5), (10, 6)), ROLLERS)
    loose.weight = np.where(in_cut(loose.centres), 1.0, 0.0)
    with pytest.raises(FactorisationError):
        loose.find(1.0)
    monkeypatch.setattr(mechanism, "_LIMIT", 6)
    with pytest.raises(MechanismError, match=r"iteration 6: .* still falling by 0\.0") as caught:
        section.find(1.0)
    assert 1e-4 < caught.value.change < 0.1


def test_a_slope_that_falls_apart_has_no_coefficient():
    """At half of its strength flows that hardly move along the slope gain without end."""
    with pytest.raises(MechanismError, match="gravity drives and the shaking does not"):
        slope45(8).find(0.3 / 5.6)


# ---------------------------------------------------------------- the reference slope


def reference_slope() -> tuple[Ground, np.ndarray]:
    """The slope of slope2d.json, and which of its cells are seam by their centres."""
    part = np.zeros((60, 15))
    for i in range(60):
        x = i + (np.arange(200) + 0.5) / 200
        surface = 5 + np.clip((35 - x) / 1.5, 0, 10)
        part[i] = np.clip(surface - np.arange(15)[:, None], 0, 1).mean(axis=1)
    part[part < 0.2] = 0.0

    def weight(x):
        return part[tuple(x.astype(int).T)]

    data = grid((60.0, 15.0), (60, 15), keep=lambda x: weight(x) > 0)
    slope = ground(data, ROLLERS, weight, unit_weight=1800 * G0)
    x, y = slope.centres.T
    return slope, (np.abs(y - (6 + 0.3 * (35 - x))) < 1.3) & (y > 5)


def motions() -> dict[str, tuple[np.ndarray, float]]:
    """Drive along +x [m/s2], and its time step."""
    time = np.arange(0, 6, 0.01)
    sine = np.where(time < 4, 0.25 * G0 * np.sin(2 * np.pi * time), 0.0)
    record = recorded("Northridge_1994_PAC-175")
    shaken = -0.35 * G0 * record.acceleration[:450] / record.pga
    return {"sine": (sine, 0.01), "Northridge": (shaken, record.dt)}


def csc(matrix: PETSc.Mat) -> sparse.csc_matrix:
    return csr(matrix).real.tocsc()


def driving_peak(slope: Ground, found: Mechanism, drive: np.ndarray, dt: float) -> float:
    """Largest φᵀKu/φᵀMr of the linear response [g], by the trapezoidal rule, 2 steps a sample."""
    V, modulus = slope.domain.V, 1800 * 200.0**2
    weight = Function(functionspace(slope.domain.mesh, ("DG", 0)))
    weight.x.array[:] = slope.weight
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    strain_u, strain_v = ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))
    traces = ufl.inner(ufl.div(u), ufl.div(v))
    one_point = ufl.dx(metadata={"quadrature_degree": 0})
    shear = 2 * modulus * weight * (ufl.inner(strain_u, strain_v) - traces / 3) * ufl.dx
    matrices = []
    for part in (
        1800 * weight * ufl.inner(u, v) * ufl.dx,
        shear + 10 * modulus * weight * traces * one_point,
    ):
        matrix = assemble_matrix(form(part))
        matrix.assemble()
        matrices.append(csc(matrix.ptap(slope.unknowns.T)))
    M, K = matrices
    C, h = 5e-4 * K, dt / 2
    force = slope.driving.array_r.real / G0
    samples = np.arange(2 * len(drive)) / 2
    solver = splu((M + h / 2 * C + h * h / 4 * K).tocsc())
    x, speed, pace = np.zeros((3, len(force)))
    unknowns = slope.unknowns.restrict(found.field)
    peak, row = 0.0, K @ unknowns
    for a in np.interp(samples, np.arange(len(drive)), drive):
        x, speed = x + h * speed + h * h / 4 * pace, speed + h / 2 * pace
        pace = solver.solve(force * a - C @ speed - K @ x)
        x, speed = x + h * h / 4 * pace, speed + h / 2 * pace
        peak = max(peak, row @ x)
    return peak / (unknowns @ force) / G0


def test_reference_slope(figure):
    """k_y over the largest acceleration of the linear response, as the reference has it."""
    pytest.importorskip("pyslammer")
    cases = load_sliding("slope2d")["cases"]
    slope, seam = reference_slope()
    found = slope.find(np.where(seam, 17e3, 150e3))
    for case, (name, motion) in zip(cases, motions().items(), strict=True):
        assert case["motion"].startswith(name)
        ratio = found.yield_coefficient / driving_peak(slope, found, *motion)
        error = abs(ratio / case["ky_over_kmax"] - 1)
        figure(f"k_y/k_max of the slope, {name}, off {case['ky_over_kmax']}", error, 0.05)
