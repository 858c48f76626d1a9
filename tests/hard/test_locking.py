# SPDX-License-Identifier: MIT
"""Hard case 22: soil that hardly changes its volume, in cells that should not lock.

Naively cells that may not change their volume anywhere cannot bend either: a pillar of saturated
clay is found nearly twice as stiff in frequency, however fine the mesh is within reason.
"""

from collections import Counter

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse
from scipy.sparse.linalg import eigsh
from support.meshes import scene

from fenics_hytf.domain import build
from fenics_hytf.lapse import Equations, Statics, material, seed_points, survey
from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import inspect, simulate

SHEAR_MODULUS, DENSITY, NU = 1e6, 1800.0, 0.4999
FIRST = 0.320  # Hz
SIZE = [5.0, 10.0]


def clay(poisson: float, damping: float = 0.0) -> dict:
    return {
        "density": DENSITY,
        "shear_modulus": SHEAR_MODULUS,
        "poisson": poisson,
        "damping": damping,
    }


def pillar(locking: bool, cells=(8, 16), degree: int = 1, poisson: float = NU, **sections) -> Scene:
    """A pillar of 5 m by 10 m, free but for its base."""
    cell = sections.pop("cell", "quadrilateral")
    damping = sections.pop("damping", 0.0)
    mesh = {"box": {"size": SIZE, "cells": list(cells), "cell": cell}, "degree": degree}
    effects = {"locking": locking} | sections.pop("effects", {})
    return scene(
        mesh, ("clay",), soil={"clay": clay(poisson, damping)}, effects=effects, **sections
    )


def csc(matrix) -> sparse.csc_matrix:
    start, columns, values = matrix.getValuesCSR()
    return sparse.csr_matrix((values.real.copy(), columns, start)).tocsc()


def first_frequency(case: Scene) -> float:
    """Of the undamped system that the sweep solves [Hz]."""
    domain = build(case, MPI.COMM_SELF)
    equations, points = Equations(case, domain, Counter()), seed_points(case, domain)
    equations.weigh(points)
    ground = survey(case, domain, points)
    law = material(ground, ground.secant(np.zeros(domain.num_cells)), case.solver)
    lapse = equations.assemble(ground, law)
    ((K, _),) = lapse.stiff
    square = eigsh(csc(K), 1, csc(lapse.system.mass), sigma=0.0, return_eigenvectors=False)[0]
    equations.destroy()
    return float(np.sqrt(square) / (2 * np.pi))


@pytest.mark.parametrize(("cells", "degree"), [((8, 16), 1), ((4, 8), 2)])
def test_22_a_pillar_does_not_lock(cells, degree, figure):
    """5 m by 10 m; naively 0.566 Hz instead of 0.320."""
    found = first_frequency(pillar(True, cells, degree))
    figure("f₁ of a pillar off 0.320 Hz", abs(found / FIRST - 1), 0.01)


def test_22_without_the_cure_it_does(figure):
    """8 cells across; the scene without it is told so beforehand."""
    found = first_frequency(pillar(False))
    figure("naive, without the cure: f₁ off 0.566 Hz", abs(found / 0.566 - 1), 0.02)


def test_22_the_cure_hardly_matters_in_compressible_ground(figure):
    """At ν = 0.3 both are on their way to the same frequency, from either side of 1 %."""
    cured, plain = (first_frequency(pillar(on, poisson=0.3)) for on in (True, False))
    figure("f₁ at ν = 0.3: cured off plain", abs(cured / plain - 1), 0.01)


def test_22_in_space(figure):
    """A slab of hexahedra that may not move sideways is the section."""
    mesh = {"box": {"size": [5.0, 0.6, 10.0], "cells": [8, 1, 16], "cell": "hexahedron"}}
    sides = {"front": "roller", "back": "roller"}
    block = scene(
        mesh, ("clay",), soil={"clay": clay(NU)}, effects={"locking": True}, boundary=sides
    )
    found = first_frequency(block)
    figure("f₁ of a slab in space off 0.320 Hz", abs(found / FIRST - 1), 0.01)


@pytest.mark.parametrize("degree", [1, 2])
def test_22_shear_across_a_section_knows_no_volume(degree, figure):
    """SH transfer functions, of a section with a soft inclusion, at ν = 0.2 and 0.4999."""
    harmonic = {"amplitude": 1.0, "frequency": 0.5, "cycles": 1, "samples": 32}
    found = []
    for poisson in (0.2, NU):
        soft = clay(poisson, 0.03)
        case = scene(
            {
                "box": {"size": [20.0, 10.0], "cells": [20, 10], "cell": "quadrilateral"},
                "degree": degree,
                "kinematics": "antiplane",
                "regions": [{"soil": "clay", "below": 5.0}, {"soil": "sand"}],
            },
            soil={"clay": soft, "sand": soft | {"shear_modulus": 5e6}},
            motion=[{"direction": "z", "harmonic": harmonic}],
            solver={"sweep": "direct", "excited": 0.0},
            output={"receivers": {"top": [7.3, 10.0], "middle": [3.1, 4.2]}},
        )
        found.append(simulate(case, MPI.COMM_SELF).lapses[0].transfer)
    off = np.abs(found[1] - found[0]).max() / np.abs(found[0]).max()
    figure("SH transfer: change from ν = 0.2 to 0.4999", off, 1e-10)


# ---------------------------------------------------------------- through a whole run


@pytest.mark.parametrize("degree", [1, 2])
def test_22_weight_comes_into_balance(degree, figure):
    """The stress that points take is the one whose forces are integrated: one step spreads it."""
    case = pillar(True, (4, 8), degree, effects={"gravity": {"initial_stress": "elastic"}})
    domain = build(case, MPI.COMM_SELF)
    statics, points = Statics(case, domain), seed_points(case, domain)
    statics.settle(points, survey(case, domain, points))
    weight, left = statics.weight_of(points), statics.imbalance(points)
    off = np.linalg.norm(left) / np.linalg.norm(weight)
    figure("weight out of balance", off, 1e-9)
    # Naively points take λ tr ε as it is where they are: up to 480 times the overburden, of either
    # sign from point to point.
    pressure = -points["stress"][:, :2].mean(axis=1)
    assert pressure.min() > 0
    figure("largest pressure over ρgH", pressure.max() / (DENSITY * 9.81 * SIZE[1]), 1)
    statics.destroy()


def test_22_lapses_hand_over_what_they_should(figure):
    """Strain of the points is that of the stiffness: three lapses do as one."""
    synthetic = {"n": 600, "dt": 0.02, "f1": 0.2, "f2": 2.0, "t1": 2.0, "t2": 5.0, "c": 1.0}
    runs = []
    for count in (1, 3):
        case = pillar(
            True,
            (4, 8),
            damping=0.05,
            motion=[{"direction": "x", "synthetic": synthetic, "pga": 0.05}],
            lapses={"count": count, "continuity": "transient"},
            solver={
                "sweep": "reduced",
                "complex_modulus": "maxwell",
                "reference_frequency": 0.5,
                "max_frequency": 5.0,
            },
            output={"receivers": {"top": [2.5, 10.0]}},
        )
        result = simulate(case, MPI.COMM_SELF)
        runs.append(np.concatenate([lapse.displacement for lapse in result.lapses], axis=-1))
    off = np.abs(runs[1] - runs[0]).max() / np.abs(runs[0]).max()
    figure("three lapses against one", off, 5e-4)
    energies = [lapse.energy for lapse in result.lapses]
    scale = max(max(abs(energy.input), *energy.stored) for energy in energies)
    unknown = max(abs(energy.imbalance) for energy in energies) / scale
    figure("three lapses: energy not accounted for", unknown, 1e-3)


# ---------------------------------------------------------------- what a scene is told


def test_22_cells_that_cannot_be_cured_are_refused(figure):
    """Triangles of degree 1: naively they are run as they are, and lock."""
    with pytest.raises(SceneError) as caught:
        simulate(pillar(True, cell="triangle"))
    (fault,) = caught.value.faults
    others = [fault for fault in caught.value.faults if fault.key != "effects.locking"]
    figure("faults told of another key", len(others), 0)
    assert fault.key == "effects.locking" and fault.found == "triangles of degree 1"
    assert fault.expected == "quadrilaterals or hexahedra, or degree 2"
    assert any(
        "changes nothing" in n for n in inspect(pillar(True, (2, 4), 2, cell="triangle")).notes
    )


@pytest.mark.parametrize(
    ("locking", "poisson", "told"), [(False, 0.45, True), (False, 0.44, False), (True, NU, False)]
)
def test_22_the_cure_is_suggested(locking, poisson, told, figure):
    """From ν = 0.45 on, to a scene that is without it."""
    notes = [n for n in inspect(pillar(locking, poisson=poisson)).notes if "effects.locking" in n]
    figure("notes too many or too few", abs(len(notes) - told), 0)
    assert not told or notes[0].startswith("soil clay: Poisson's ratio is 0.45")
