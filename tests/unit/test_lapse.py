# SPDX-License-Identifier: MIT
"""Parts of a lapse: acceleration of the loop, strain measures, what is in a cell, the input."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from support.loop import GMAX, RISING, SOFTENING, STRAIN, ground, misfit, run
from support.meshes import SOIL, scene

from fenics_hytf.domain import build, constraint_matrix
from fenics_hytf.frequency import constant, hysteretic
from fenics_hytf.lapse import (
    Anderson,
    CellProbe,
    ElasticConstants,
    EmptyCellError,
    Excitation,
    Material,
    Moduli,
    Part,
    Response,
    Spectra,
    excite,
    first_strain,
    peak_length,
    peak_shear_strain,
    survey,
)
from fenics_hytf.motion import to_time
from fenics_hytf.particles import quadrature_rule, seed
from fenics_hytf.particles.points import take
from fenics_hytf.scene import Scene
from fenics_hytf.soil import Curve

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
EPS = np.finfo(float).eps


# ---------------------------------------------------------------- Anderson acceleration


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
def test_a_linear_fixed_point_is_found_in_n_plus_one_steps(n):
    rng = np.random.default_rng(n)
    A = rng.normal(size=(n, n))
    A *= 0.9 / np.linalg.norm(A, 2)
    b = 0.1 * rng.normal(size=n)  # near: no step is cut
    fixed = np.linalg.solve(np.eye(n) - A, b)
    accelerated, x = Anderson(memory=n), np.zeros(n)
    errors = []
    for _ in range(n + 1):
        x = accelerated.next(x, A @ x + b)
        errors.append(np.abs(x - fixed).max())
    assert errors[-1] < 1e-9  # least squares with condition numbers up to 1e5
    assert errors[0] > 1e-3


@pytest.mark.parametrize("slope", [-1.0, -0.99, -1.5])
def test_oscillation_is_damped_at_once(slope):
    # x = slope x: Picard alternates for ever, or worse.
    accelerated, x = Anderson(), np.array([0.3])
    for _ in range(2):
        x = accelerated.next(x, slope * x)
    assert abs(x[0]) < 1e-15


def test_a_long_step_is_cut():
    # x → 0.999 x: the secant step goes all the way, 100 in ln γ.
    accelerated, x = Anderson(), np.array([100.0])
    x = accelerated.next(x, 0.999 * x)
    x, before = accelerated.next(x, 0.999 * x), x
    assert before[0] - x[0] == pytest.approx(1.0, rel=1e-12)


def test_points_that_repeat_do_no_harm():
    accelerated, x = Anderson(), np.array([0.1, 0.2])
    for _ in range(4):
        x = accelerated.next(np.array([0.1, 0.2]), np.array([0.15, 0.2]))
    assert np.isfinite(x).all()


# ---------------------------------------------------------------- the equivalent-linear loop


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("load", [1e-5, 5e-5, 1e-4])
def test_the_loop_finds_the_fixed_point(load, power):
    # Stress-controlled: peak = load (Gmax/G)^p. The slope of the map in ln γ is up to 0.6 here.
    curve = Curve(STRAIN, SOFTENING, RISING)
    soil = ground(curve)

    def defect(x):
        return np.log(0.65 * load * curve.evaluate(np.exp(x))[0] ** -power) - x

    fixed = brentq(defect, np.log(1e-6), np.log(2e-4))
    moduli, effective, history = run(
        soil, lambda m: load * (GMAX / m.shear_modulus) ** power, 1e-5, tolerance=1e-6
    )
    assert misfit(soil, moduli, effective) <= 1e-6
    # A change of 1e-6 in G or D is one of some 1e-5 in strain at the flat end of the curves.
    assert np.log(effective[0]) == pytest.approx(fixed, abs=2e-5)
    assert history.change[-1] <= 1e-6 < history.change[-2]


def test_damping_counts_where_the_modulus_is_flat():
    curve = Curve(STRAIN, np.full(5, 0.8), RISING)
    soil = ground(curve)
    moduli, effective, history = run(soil, lambda m: 5e-5 / m.damping, 1e-2)
    assert len(history.change) > 2
    assert misfit(soil, moduli, effective) <= 1e-4


def test_damping_that_falls_to_nothing_changes_by_a_number():
    none, some = (Moduli(np.array([GMAX]), np.array([d])) for d in (0.0, 0.05))
    assert none.change(none).tolist() == [0.0]
    assert some.change(none).tolist() == [1.0]
    # The change is over what is there now: next to nothing here, but not 1e306 of it.
    assert none.change(some) == pytest.approx(1 / EPS)


def test_a_linear_soil_takes_one_solve():
    soil = ground(None, cells=(0, 0))
    moduli, effective, history = run(soil, lambda m: np.array([1e-4, 2e-4]), 1e-5)
    assert history.change == (0.0,)
    np.testing.assert_allclose(effective, [0.65e-4, 1.3e-4], rtol=4 * EPS)
    assert moduli.shear_modulus.tolist() == [GMAX, GMAX]


def test_a_still_ground_is_no_error():
    soil = ground(Curve(STRAIN, SOFTENING, RISING))
    moduli, effective, _ = run(soil, lambda m: np.zeros(1), 0.0)
    assert effective.tolist() == [0.0]
    assert moduli.shear_modulus.tolist() == [GMAX]


def test_cells_can_share_the_strain_of_another():
    soil = ground(Curve(STRAIN, SOFTENING, RISING), cells=(0, 0, 0))
    centre = np.array([1, 1, 1])
    moduli, effective, _ = run(
        soil, lambda m: np.array([1e-6, 2e-4, 3e-3]) * GMAX / m.shear_modulus, 1e-4, centre
    )
    assert len(set(moduli.shear_modulus)) == 1
    alone, strain, _ = run(ground(soil.curves[0]), lambda m: 2e-4 * GMAX / m.shear_modulus, 1e-4)
    np.testing.assert_allclose(effective, strain[0], rtol=1e-12)
    np.testing.assert_allclose(moduli.shear_modulus, alone.shear_modulus[0], rtol=1e-12)


def test_first_guess():
    # ratio × PGV/Vs; nothing to guess without the loop
    soil = replace(ground(None, cells=(0, 0)), density=np.array([2000.0, 500.0]))
    curves = {"strain": list(STRAIN), "modulus": list(SOFTENING), "damping": list(RISING)}
    loop = {"equivalent_linear": {"strain_ratio": 0.6}}
    linear = scene({"box": {"size": [1.0, 1.0], "cells": [1, 1]}}, ("clay",))
    given = Scene.from_dict(
        linear.data | {"effects": loop, "soil": {"clay": SOIL | {"curves": curves}}}
    )
    velocity = abs(given.motion[0].record.velocity()).max()
    expected = 0.6 * velocity / np.sqrt(GMAX / soil.density)
    np.testing.assert_allclose(first_strain(given, soil), expected)
    np.testing.assert_array_equal(first_strain(linear, soil), 0.0)


# ---------------------------------------------------------------- strain measures


def voigt(tensor) -> np.ndarray:
    """Components with γ = 2ε, as one site at one instant."""
    pairs = [(0, 0), (1, 1)] if len(tensor) == 2 else [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2)]
    pairs.append((0, 1))
    return np.array([tensor[i, j] * (1 if i == j else 2) for i, j in pairs])[None, :, None]


@pytest.mark.parametrize(
    ("strain", "plane", "spatial"),
    [
        ([0.0, 0.0, 3e-4], 3e-4, 3e-4),  # pure shear
        ([2e-4, 0.0, 0.0], 2e-4, 2e-4),  # uniaxial
        ([-2e-4, 0.0, 0.0], 2e-4, 2e-4),
        ([2e-4, 2e-4, 0.0], 0.0, 2e-4),  # equal: no shear in the plane, but across it
        ([-2e-4, -2e-4, 0.0], 0.0, 2e-4),
        ([1e-4, -1e-4, 0.0], 2e-4, 2e-4),  # pure shear, turned by 45°
        ([3e-4, 1e-4, 0.0], 2e-4, 3e-4),
        ([0.0, 0.0, 0.0], 0.0, 0.0),
    ],
)
def test_strain_measures_in_plane_strain(strain, plane, spatial):
    values = np.array(strain)[None, :, None]
    assert peak_shear_strain(values, "plane")[0] == pytest.approx(plane, abs=1e-19)
    assert peak_shear_strain(values, "3d")[0] == pytest.approx(spatial, abs=1e-19)


def test_strain_measures_do_not_depend_on_the_axes():
    rng = np.random.default_rng(6)
    tensor = rng.normal(size=(3, 3))
    tensor += tensor.T
    principal = np.linalg.eigvalsh(tensor)
    for turn in Rotation.random(20, rng=rng).as_matrix():
        found = peak_shear_strain(voigt(turn @ tensor @ turn.T))[0]
        assert found == pytest.approx(principal[2] - principal[0], rel=1e-13)
    flat = tensor.copy()
    flat[2], flat[:, 2] = 0.0, 0.0
    third = np.linalg.eigvalsh(flat)
    for angle in np.linspace(0, np.pi, 13):
        c, s = np.cos(angle), np.sin(angle)
        turned = np.array([[c, -s], [s, c]]) @ flat[:2, :2] @ np.array([[c, s], [-s, c]])
        assert peak_shear_strain(voigt(turned), "3d")[0] == pytest.approx(
            third[2] - third[0], rel=1e-13
        )
        # In three dimensions the same measure.
        assert peak_shear_strain(voigt(flat))[0] == pytest.approx(third[2] - third[0], rel=1e-13)


def test_spatial_strains_by_their_components():
    for component in (3, 4, 5):  # engineering shear alone
        values = np.zeros((1, 6, 2))
        values[0, component] = [4e-4, -4e-4]
        np.testing.assert_allclose(peak_shear_strain(values), [4e-4], rtol=1e-14)
    values = np.zeros((1, 6, 1))
    values[0, :3, 0] = [1e-4, -2e-4, 5e-4]
    np.testing.assert_allclose(peak_shear_strain(values), [7e-4], rtol=1e-14)


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_the_peak_is_that_of_the_worst_instant(kind):
    rng = np.random.default_rng(8)
    strain = rng.normal(size=(5, 6, 400)).astype(kind)
    tensor = np.empty((5, 400, 3, 3))
    for component, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]):
        value = strain[:, component].astype(float) / (1 if i == j else 2)
        tensor[:, :, i, j] = tensor[:, :, j, i] = value
    principal = np.linalg.eigvalsh(tensor)
    expected = (principal[:, :, 2] - principal[:, :, 0]).max(axis=1)
    digits = 100 * np.finfo(kind).eps  # sums of a few squares
    np.testing.assert_allclose(peak_shear_strain(strain), expected, rtol=digits)
    length = np.linalg.norm(strain.astype(float), axis=1).max(axis=1)
    np.testing.assert_allclose(peak_length(strain), length, rtol=digits)
    assert not peak_shear_strain(strain[:, :, :0]).any() and not peak_length(strain[:, :, :0]).any()


# ---------------------------------------------------------------- what is in a cell

CURVED = {
    "curves": {
        "strain": STRAIN.tolist(),
        "modulus": SOFTENING.tolist(),
        "damping": RISING.tolist(),
    }
}
SOILS = {
    "clay": SOIL | {"damping": 0.03},
    "sand": SOIL | {"shear_modulus": 40e6, "poisson": 0.2, "damping": 0.07},
}
del SOILS["sand"]["shear_wave_velocity"]


def strip(comm, **sections):
    """Six cells of clay under six of sand, nine points in each."""
    regions = [{"soil": "clay", "below": 0.5}, {"soil": "sand"}]
    mesh = {"box": {"size": [6.0, 1.0], "cells": [6, 2]}, "regions": regions}
    case = scene(mesh, soil=SOILS, **sections)
    domain = build(case, comm)
    points = seed(domain.mesh, domain.regions, [1800.0, 1800.0], 9)
    return case, domain, points


@pytest.mark.mpi
def test_a_cell_takes_the_mean_of_its_points_by_volume():
    case, domain, points = strip(WORLD)
    # The sand of the last column of Gauss points in each upper cell becomes clay: 5/18 of its area.
    names = domain.region_names
    X, w = quadrature_rule("quadrilateral", 9)
    last = X[:, 0] > 0.8
    assert w[last].sum() == pytest.approx(5 / 18)
    points.region[points.X[:, 0] > 0.8] = names.index("clay")
    ground = survey(case, domain, points)
    assert ground.region.tolist() == [names.index("clay")] * 6 + [names.index("sand")] * 6
    clay, sand = case.soil["clay"].elastic, case.soil["sand"].elastic
    share = 5 / 18
    for name, a, b in (
        ("shear_modulus", clay.shear_modulus, sand.shear_modulus),
        ("poisson", 0.3, 0.2),
        ("damping", 0.03, 0.07),
    ):
        values = getattr(ground, name)
        assert np.all(values[:6] == a)  # one soil: free of round-off
        np.testing.assert_allclose(values[6:], share * a + (1 - share) * b, rtol=1e-14)
    assert ground.curves == (None, None)


def test_volume_counts_not_the_number_of_points():
    case, domain, points = strip(SELF)
    upper = domain.input_cells[points.cell] >= 6
    points.region[upper & (points.X[:, 0] > 0.8)] = domain.region_names.index("clay")
    points.volume[upper & (points.X[:, 0] > 0.8)] *= 10  # swollen
    ground = survey(case, domain, points)
    share = 50 / (50 + 13)
    expected = share * 0.3 + (1 - share) * 0.2
    np.testing.assert_allclose(ground.poisson[6:], expected, rtol=1e-14)
    assert np.all(ground.region == domain.region_names.index("clay"))  # which fills most of it


def test_curves_come_with_the_loop_only():
    case, domain, points = strip(SELF)
    soils = {name: soil | CURVED for name, soil in SOILS.items()}
    plain = scene(case.data["mesh"], soil=soils)
    loop = scene(case.data["mesh"], soil=soils, effects={"equivalent_linear": True})
    linear, curved = (survey(s, domain, points) for s in (plain, loop))
    assert linear.curves == (None, None)
    assert not linear.nonlinear.any()
    assert curved.nonlinear.all()
    np.testing.assert_allclose(curved.damping, RISING[0])
    assert set(linear.damping) == {0.03, 0.07}
    secant = curved.secant(np.full(12, 1e-4))
    np.testing.assert_allclose(secant.shear_modulus, 0.75 * curved.shear_modulus, rtol=1e-14)


@pytest.mark.mpi
def test_an_empty_cell_is_named_on_every_rank():
    case, domain, points = strip(WORLD)
    number = domain.input_cells[points.cell]
    points.assign(take(points.arrays(), ~np.isin(number, [4, 9])))
    with pytest.raises(
        EmptyCellError, match="found 2 cells without material points, the first: 4, 9"
    ):
        survey(case, domain, points)


# ---------------------------------------------------------------- the input and its lines


def excitation(period, lines, motions=2, dt=0.02, **more) -> tuple[Excitation, np.ndarray]:
    """Lines with random weights, and random transfer functions of four rows."""
    rng = np.random.default_rng(period)

    def noise(*shape):
        return rng.normal(size=shape) + 1j * rng.normal(size=shape)

    lines = np.asarray(lines)
    weights = noise(motions, len(lines))
    whole = Excitation(lines, weights, tuple(range(motions)), period, dt, len(lines), **more)
    return whole, noise(4, motions, len(lines))


@pytest.mark.parametrize("contour", [{}, {"eta": 3.0}, {"eta": 3.0, "num_samples": 2}])
@pytest.mark.parametrize(
    ("period", "lines"),
    [
        (16, range(9)),  # with line 0 and Nyquist's
        (15, range(8)),  # an odd number has no Nyquist line
        (16, [0]),
        (16, [8]),
        (16, [3]),
        (15, [7]),
        (2, [0, 1]),
        (17, [1, 4, 8]),
    ],
)
@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_factors_sum_the_response_at_any_sample(period, lines, derivative, contour):
    given, h = excitation(period, lines, **contour)
    spectra = np.einsum("rmk,mk->rk", h, given.weights) * given.s**derivative
    history = given.to_time(spectra)
    assert history.shape == (4, contour.get("num_samples", period))
    assert given.duration == pytest.approx(history.shape[1] * given.dt)
    np.testing.assert_allclose(given.s, contour.get("eta", 0.0) + 1j * given.omega)
    scale = np.abs(spectra).sum() / period
    for sample in range(history.shape[1]):
        factors = given.sum_at(sample * given.dt) * given.s**derivative
        summed = np.einsum("rmk,mk->r", h, given.weights * factors).real
        np.testing.assert_allclose(summed, history[:, sample], atol=100 * EPS * scale)
    # The period closes, but for what the contour lets grow.
    whole = given.sum_at(period * given.dt)
    grown = np.exp(given.eta * period * given.dt)
    np.testing.assert_allclose(
        whole, grown * given.sum_at(0.0), atol=1000 * EPS * np.abs(whole).max()
    )


def test_to_time_is_the_inverse_transform_with_zeros_elsewhere():
    given, _ = excitation(20, [0, 2, 5, 10])
    spectrum = np.zeros((2, 11), complex)
    spectrum[:, [0, 2, 5, 10]] = given.weights
    np.testing.assert_array_equal(given.to_time(given.weights), to_time(spectrum, 20))
    np.testing.assert_allclose(given.frequency, np.array([0, 2, 5, 10]) / (20 * 0.02))


class Projected:
    """A sweep of which projections alone are known."""

    def __init__(self, h):
        self.h = h

    def project(self, _rows):
        return self.h


def test_motions_and_what_is_carried_add_up():
    given, h = excitation(16, [1, 2, 3], motions=3)
    summed = sum(h[:, m] * given.weights[m] for m in range(3))
    carried = replace(given, axes=(0, 1))  # the third right-hand side is no motion
    for excited, motions in ((given, 3), (carried, 2)):
        response = Response(Projected(h), excited)
        np.testing.assert_allclose(response.spectra(None).coefficients, summed, rtol=1e-14)
        np.testing.assert_array_equal(response.transfer(None), h[:, :motions])
        np.testing.assert_array_equal(excited.motion_weights, given.weights[:motions])
    spectra = Spectra(summed, np.arange(16.0).reshape(4, 4))
    square = spectra.reshape(2, 2)
    assert square.coefficients.shape == (2, 2, 3) and square.start.shape == (2, 2, 4)
    difference = (spectra - spectra[[1, 0, 3, 2]])[1:]
    np.testing.assert_array_equal(difference.coefficients[0], summed[1] - summed[0])
    np.testing.assert_array_equal(difference.start[:, 0], [4, -4, 4])


def test_a_pure_harmonic_excites_one_line():
    harmonic = {"amplitude": 1.0, "frequency": 2.0, "cycles": 5, "samples": 400}
    mesh = {"box": {"size": [1.0, 1.0], "cells": [1, 1]}}
    case = scene(mesh, ("clay",), motion=[{"direction": "x", "harmonic": harmonic}])
    given = excite(case, case.base_acceleration, (0,))
    assert given.lines.tolist() == [5]
    assert given.frequency.tolist() == pytest.approx([2.0])
    assert given.excited == 1
    np.testing.assert_allclose(given.to_time(given.weights), case.base_acceleration, atol=1e-14)


def test_lines_above_the_limit_are_counted_but_not_solved():
    synthetic = {"n": 400, "dt": 0.01, "f1": 1.0, "f2": 20.0, "t1": 0.5, "t2": 3.0}
    motions = [
        {"direction": "x", "synthetic": synthetic},
        {
            "direction": "y",
            "harmonic": {"amplitude": 1e-6, "frequency": 40.0, "cycles": 160, "samples": 400},
        },
    ]
    mesh = {"box": {"size": [1.0, 1.0], "cells": [1, 1]}}
    solver = {"max_frequency": 10.0, "excited": 1e-3}
    case = scene(mesh, ("clay",), motion=motions, solver=solver)
    given = excite(case, case.base_acceleration, (0, 1))
    spectra = np.abs(np.fft.rfft(case.base_acceleration))
    above = (spectra > 1e-3 * spectra.max(axis=1, keepdims=True)).any(axis=0)
    assert given.excited == np.count_nonzero(above)
    assert above[160]  # the weak motion counts by its own peak
    frequency = np.fft.rfftfreq(400, 0.01)
    assert given.lines.tolist() == np.flatnonzero(above & (frequency <= 10.0)).tolist()
    assert 0 < len(given.lines) < given.excited


# ---------------------------------------------------------------- peaks of cells


class FieldSweep:
    """A sweep whose solutions are given nodal fields, on unknowns that are the nodes' own."""

    def __init__(self, fields):
        self.fields = fields  # (num_local, num_sides, num_lines)

    def response(self, weights):
        return lambda rows: np.einsum("rsk,sk->rk", self.project(rows), weights)

    def project(self, rows):
        out = np.empty((rows.getLocalSize()[0], *self.fields.shape[1:]), complex)
        x, y = rows.createVecRight(), rows.createVecLeft()
        for side in range(self.fields.shape[1]):
            for line in range(self.fields.shape[2]):
                x.array[:] = self.fields[:, side, line]
                rows.mult(x, y)
                out[:, side, line] = y.array_r
        return out


def hysteretic_shear(domain, modulus: complex) -> Material:
    """A complex shear modulus, the same everywhere, with λ of nought."""
    every = np.ones(domain.num_cells)
    real = ElasticConstants(0 * every, modulus.real * every)
    imaginary = ElasticConstants(0 * every, modulus.imag * every)
    return Material(real, (Part("real", real, constant), Part("imaginary", imaginary, hysteretic)))


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["quadrilateral", "tetrahedron"])
def test_peaks_of_a_uniform_field(cell):
    """h(x, ω) = H x at one line: strain, stress and total acceleration in closed form."""
    gdim = 2 if cell == "quadrilateral" else 3
    mesh = {"box": {"size": [2.0] * gdim, "cells": [2] * gdim, "cell": cell}}
    domain = build(scene(mesh, ("clay",)), WORLD)
    T = constraint_matrix(domain, {"base": "free"})
    size = domain.V.dofmap.index_map.size_local
    x = domain.V.tabulate_dof_coordinates()[:size, :gdim]
    shear, amplitude, line = 1e-3 * np.exp(0.4j), 3.0, 4
    H = np.zeros((gdim, gdim), complex)
    H[0, -1] = shear  # u_x = γ z
    fields = (x @ H.T).reshape(-1, 1, 1)
    N, dt = 64, 0.05
    weights = np.array([[amplitude * N / 2]], complex)
    given = Excitation(np.array([line]), weights, (0,), N, dt, 1)
    probe = CellProbe(domain, T, "plane")
    response = Response(FieldSweep(fields), given)
    modulus = 20e6 * (1 + 0.3j)
    base = np.zeros((gdim, 1), complex)
    base[0] = 0.5 * shear * weights[0]  # as if the base were half a metre up
    peaks = probe.peaks(response, hysteretic_shear(domain, modulus), Spectra(base))
    # Sampled sixteen times a cycle from known phases: the peak over the samples, not the crest.
    phase = 2 * np.pi * line * np.arange(N) / N
    peak = np.abs(amplitude * np.real(shear * np.exp(1j * phase))).max()
    np.testing.assert_allclose(peaks.strain, peak, rtol=1e-12)
    np.testing.assert_allclose(probe.peak_strain(response), peak, rtol=1e-12)
    stress = np.abs(amplitude * np.real(modulus * shear * np.exp(1j * phase))).max()
    np.testing.assert_allclose(peaks.stress, stress, rtol=1e-12)
    omega = 2 * np.pi * line / (N * dt)
    heights = domain.gather_cells(centroids(domain)[:, -1])
    total = amplitude * np.real(
        (1 - omega**2 * shear * heights[:, None]) * np.exp(1j * phase[None])
    )
    np.testing.assert_allclose(peaks.acceleration, np.abs(total).max(axis=1), rtol=1e-12)
    moved = amplitude * (heights[:, None] - 0.5) * shear * np.exp(1j * phase[None])
    for found, values in ((peaks.displacement, moved), (peaks.velocity, 1j * omega * moved)):
        np.testing.assert_allclose(found, np.abs(values.real).max(axis=1), rtol=1e-11, atol=EPS)
    probe.destroy()
    T.destroy()


def centroids(domain) -> np.ndarray:
    nodes = domain.mesh.geometry.x[domain.mesh.geometry.dofmap[: domain.num_owned_cells]]
    return nodes.mean(axis=1)[:, : domain.gdim]


def test_at_rest_the_modulus_is_real():
    domain = build(scene({"box": {"size": [1.0, 1.0], "cells": [1, 1]}}, ("clay",)), SELF)
    T = constraint_matrix(domain, {"base": "free"})
    x = domain.V.tabulate_dof_coordinates()[:, :2]
    fields = (x @ np.array([[0, 1e-3], [0, 0]]).T).astype(complex).reshape(-1, 1, 1)
    given = Excitation(np.array([0]), np.array([[8.0 + 0j]]), (0,), 8, 0.1, 1)
    probe = CellProbe(domain, T, "plane")
    law, base = hysteretic_shear(domain, 1e6 * (1 + 0.5j)), Spectra(np.zeros((2, 1), complex))
    peaks = probe.peaks(Response(FieldSweep(fields), given), law, base)
    assert peaks.stress[0] == pytest.approx(1e3, rel=1e-12)
    probe.destroy()
    T.destroy()
