# SPDX-License-Identifier: MIT
"""Hard cases 16 and 20: the line at rest, and real results from a complex build.

A response is real because h(−ω) is the conjugate of h(ω) and h(0) is real. The code solves ω ≥ 0
and takes real parts, so what those drop is measured here before they do: from both signs of ω,
summed as complex numbers.
"""

from collections import Counter

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from support.meshes import SOIL, scene

from fenics_hytf.domain import build
from fenics_hytf.frequency import direct_sweep, reduced_sweep
from fenics_hytf.lapse import Equations, Response, excite, material, seed_points, survey
from fenics_hytf.motion import spectra
from fenics_hytf.operators import constrained_rows, displacement_rows
from fenics_hytf.particles import transfer_matrix
from fenics_hytf.simulation import simulate

NOTHING = 1e-14
DT, SAMPLES = 0.02, 101  # an odd number: no line is its own twin but the one at rest

SECTION = {"box": {"size": [40.0, 20.0], "cells": [20, 10], "cell": "quadrilateral"}}
BLOCK = {"box": {"size": [20.0, 20.0, 20.0], "cells": [4, 4, 6], "cell": "hexahedron"}}
LAYERS = {"regions": [{"soil": "sand", "below": 10.0}, {"soil": "clay"}]}
GROUND = {
    "clay": SOIL | {"shear_wave_velocity": 150.0, "damping": 0.05},
    "sand": SOIL | {"damping": 0.02},
}
ROCK = {
    "compliant": {
        "density": 2243.0,
        "shear_wave_velocity": 760.0,
        "poisson": 0.25,
        "damping": 0.01,
    }
}
DASHPOTS = {"left": "dashpot", "right": "dashpot"}
VISCOUS = {"rayleigh": {"alpha": 0.1, "beta": 1e-3}}
CASES = {
    "rigid base, tied sides": (SECTION, {"boundary": {"left": "tied", "right": "tied"}}),
    "rock, dashpots, Rayleigh": (
        SECTION,
        {"boundary": DASHPOTS | {"base": ROCK}, "effects": VISCOUS},
    ),
    "free field": (SECTION, {"boundary": {"left": "free_field", "right": "free_field"}}),
    "degree 2, bulk kept": (
        SECTION | {"degree": 2},
        {
            "boundary": {"left": "roller", "right": "roller"},
            "solver": {"keep": "bulk", "complex_modulus": "kramer"},
        },
    ),
    "across the section": (
        SECTION | {"kinematics": "antiplane"},
        {"boundary": DASHPOTS | {"base": ROCK}, "direction": "z"},
    ),
    "block": (
        BLOCK,
        {
            "boundary": {"left": "tied", "right": "tied", "front": "dashpot", "base": ROCK},
            "effects": VISCOUS,
        },
    ),
}


def shaken(folder, name, mean=0.3, sweep="direct"):
    """The scene of a case under noise with a mean."""
    mesh, sections = CASES[name]
    sections = {**sections}
    path = folder / f"noise{MPI.COMM_WORLD.rank}.csv"
    np.savetxt(path, mean + np.random.default_rng(20).normal(size=SAMPLES))
    motion = {"direction": sections.pop("direction", "x"), "file": str(path), "dt": DT}
    motion |= {"units": "m/s2", "input": "outcrop" if "base" in sections["boundary"] else "within"}
    sections["solver"] = sections.get("solver", {}) | {"sweep": sweep, "max_frequency": 15.0}
    height = mesh["box"]["size"]
    top = {"top": [*(0.5 * x for x in height[:-1]), height[-1]]}
    return scene(
        mesh | LAYERS,
        soil=GROUND,
        motion=[motion],
        **sections,
        output={"receivers": top},
    )


class Lapse:
    """What a lapse is made of, before any real part is taken."""

    def __init__(self, case):
        self.domain = build(case, MPI.COMM_SELF)
        self.equations = Equations(case, self.domain, Counter())
        self.points = seed_points(case, self.domain)
        self.equations.weigh(self.points)
        ground = survey(case, self.domain, self.points)
        moduli = ground.secant(np.zeros(self.domain.num_cells))
        lapse = self.equations.assemble(ground, material(ground, moduli, case.solver))
        self.system, self.loads = lapse.system, lapse.loads
        motions = np.stack([motion.record.acceleration for motion in case.motion])
        self.excitation = excite(case, motions, self.equations.axes)


def imaginary_share(values: np.ndarray) -> float:
    return float(np.abs(np.imag(values)).max() / np.abs(np.real(values)).max())


def entries(matrix: PETSc.Mat) -> np.ndarray:
    return matrix.getValuesCSR()[2]


SOLVED_HERE = [name for name in CASES if name != "free field"]  # its loads come from columns


@pytest.mark.parametrize("name", SOLVED_HERE)
def test_20_matrices_and_loads_are_real(name, tmp_path, figure):
    """What the sweeps, probes and sums take the real parts of."""
    lapse = Lapse(shaken(tmp_path, name))
    S = transfer_matrix(lapse.points, lapse.domain.V)
    rows = displacement_rows(S, lapse.domain.num_components)
    probe = constrained_rows(lapse.domain, rows, lapse.equations.T)
    found = [entries(matrix) for matrix, _ in lapse.system.terms]
    found += [entries(lapse.equations.T), entries(probe)]
    found += [vector.array_r for vector in (*lapse.loads, *lapse.equations.inertia.influence)]
    worst = max(imaginary_share(values) for values in found)
    figure("imaginary part of matrices and loads", worst, NOTHING)


@pytest.mark.parametrize("name", SOLVED_HERE)
def test_20_positions_are_real(name, tmp_path, figure):
    """Naively a law whose imaginary part does not change sign makes complex displacements."""
    lapse = Lapse(shaken(tmp_path, name))
    excitation, T = lapse.excitation, lapse.equations.T
    assert excitation.lines[0] == 0
    twins = np.concatenate([excitation.s, excitation.s[1:].conj()])
    both = direct_sweep(lapse.system, lapse.loads, twins)
    one = direct_sweep(lapse.system, lapse.loads, excitation.s)
    weights = np.concatenate([excitation.weights[0], excitation.weights[0, 1:].conj()])
    S = displacement_rows(
        transfer_matrix(lapse.points, lapse.domain.V), lapse.domain.num_components
    )
    dropped, moved = 0.0, 0.0
    for time in (0.0, 0.4 * SAMPLES * DT, 0.77 * SAMPLES * DT):
        waves = weights * np.exp(twins * time) / SAMPLES
        q, nodes = T.createVecs()
        q.array[:] = both.combine(waves[None])
        T.mult(q, nodes)
        points = S @ nodes.array_r
        dropped = max(dropped, float(np.abs(points.imag).max()))
        moved = max(moved, float(np.abs(points.real).max()))
        # The code's own way, from one sign of ω, is the same displacement.
        taken = lapse.equations.unknowns.expand(Response(one, excitation).unknowns_at(time))
        np.testing.assert_allclose(
            S @ taken.ravel(), points.real, rtol=0, atol=1e-12 * np.abs(points.real).max()
        )
        q.destroy()
        nodes.destroy()
    figure("imaginary part of displacements of points", dropped / moved, NOTHING)


class Dropped:
    """Listens to the inverse transform: it takes the line at rest to be real."""

    def __init__(self, monkeypatch):
        self.share = {np.dtype(np.complex64): 0.0, np.dtype(np.complex128): 0.0}
        self._transform = spectra.fft.irfft
        monkeypatch.setattr(spectra.fft, "irfft", self)

    def __call__(self, values, n, **options):
        history = self._transform(values, n=n, **options)
        lost = float(np.abs(values[..., 0].imag).max(initial=0.0)) / n
        largest = float(np.abs(history).max(initial=0.0))
        if largest:
            self.share[values.dtype] = max(self.share[values.dtype], lost / largest)
        return history


@pytest.mark.parametrize("sweep", ["direct", "reduced"])
@pytest.mark.parametrize("name", CASES)
def test_20_inverse_transforms_are_real(name, sweep, tmp_path, monkeypatch, figure):
    """All histories of a run: base, receivers, peaks of cells."""
    dropped = Dropped(monkeypatch)
    result = simulate(shaken(tmp_path, name, sweep=sweep), MPI.COMM_SELF)
    lapse = result.lapses[0]
    assert lapse.frequency[0] == 0 and np.abs(lapse.displacement).max() > 0
    share = dropped.share
    figure("imaginary part of inverse transforms", share[np.dtype(np.complex128)], NOTHING)
    # Peaks may be found in single precision: its round-off, over a basis of some fifty directions.
    limit = 50 * np.finfo(np.float32).eps
    figure("imaginary part of peaks, in single precision", share[np.dtype(np.complex64)], limit)


def test_20_a_reduced_viscous_sweep_drops_no_more_than_its_error(tmp_path, figure):
    """Its basis is complex, and at rest no line has to be expanded: V y is real to the residual."""
    section = SECTION, {"boundary": DASHPOTS, "effects": VISCOUS}
    elastic = {soil: table | {"damping": 0.0} for soil, table in GROUND.items()}
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(CASES, "viscous", section)
        patch.setattr(f"{__name__}.GROUND", elastic)
        lapse = Lapse(shaken(tmp_path, "viscous"))
    found = reduced_sweep(lapse.system, lapse.loads, lapse.excitation.s, 1e-6)
    figure("imaginary part of h(0), viscous, reduced", imaginary_share(found.solution(0)), 1e-6)


@pytest.mark.parametrize("sweep", ["direct", "reduced"])
@pytest.mark.parametrize("dim", [2, 3])
def test_16_an_acceleration_with_a_mean(dim, sweep, tmp_path, figure):
    """Naively û/(−ω²) at rest is not a number, or the mean makes the ground drift away."""
    height, mean, cycle, cycles = 20.0, 0.3, 25, 8
    time = DT * np.arange(cycle * cycles)
    path = tmp_path / "mean.csv"
    np.savetxt(path, mean + np.sin(2 * np.pi * time / (cycle * DT)))
    kind = "quadrilateral" if dim == 2 else "hexahedron"
    wide = [4.0] * (dim - 1)
    tolerance = 1e-8
    result = simulate(
        scene(
            {"box": {"size": [*wide, height], "cells": [2] * (dim - 1) + [20], "cell": kind}},
            ("clay",),
            soil={"clay": SOIL | {"damping": 0.05}},
            motion=[{"direction": "x", "file": str(path), "dt": DT, "units": "m/s2"}],
            boundary=dict.fromkeys(("left", "right", "front", "back")[: 2 * (dim - 1)], "tied"),
            solver={"sweep": sweep, "tolerance": tolerance},
            output={"receivers": {"top": [*(x / 2 for x in wide), height]}},
        ),
        MPI.COMM_SELF,
    )
    lapse = result.lapses[0]
    assert list(lapse.frequency) == pytest.approx([0.0, 1 / (cycle * DT)])
    u, v = lapse.displacement[0, 0], lapse.velocity[0, 0]
    cycled = u.reshape(cycles, cycle)
    figure("steady: drift over the peak", np.abs(cycled - cycled[0]).max() / abs(u).max(), 1e-6)
    figure("steady: mean velocity over the peak", abs(v.mean()) / abs(v).max(), 1e-6)
    # At rest, with the real modulus: u = −ρ a H²/2G, which linear cells hit at their nodes.
    held = -mean * height**2 / (2 * SOIL["shear_wave_velocity"] ** 2)
    figure("steady: mean displacement off −ρaH²/2G", abs(u.mean() / held - 1), 10 * tolerance)
    total = lapse.total_acceleration[0, 0].mean()
    figure("steady: mean total acceleration", abs(total / mean - 1), 1e-12)
