# SPDX-License-Identifier: MIT
"""A run that was stopped and gone on with is the run that was not, whatever a scene calls for.

At any lapse, after other ranks and in another order of points: hard case 31.
"""

import pytest
from mpi4py import MPI
from support.restart import Stop, arrays, counts, different, run, scene_with

SELF = MPI.COMM_SELF

ROCK = "{ density = 2200.0, shear_wave_velocity = 700.0, poisson = 0.3, damping = 0.01 }"


@pytest.mark.parametrize(
    "settings",
    [
        {"lapses__continuity": '"steady"'},
        {"lapses__continuity": '"transient"', "solver__complex_modulus": '"hysteretic"'},
        {"effects__convection": "false"},
        {"effects__equivalent_linear": "false", "effects__geometric_stiffness": "false"},
        {"effects__degradation": "{ threshold = 1e-6 }"},
        {"effects__softening": "true", "effects__gravity": "true"},
        {"effects__softening": "true", "effects__gravity": "true", "effects__convection": "false"},
        {
            "boundary__left": '"free_field"',
            "boundary__right": '"free_field"',
            "boundary__base": f"{{ compliant = {ROCK} }}",
            "motion__0__input": '"outcrop"',
            "points__outside": '"park"',
        },
        {"output__every": "2"},
    ],
    ids=lambda settings: ", ".join(f"{k.rsplit('__')[-1]} {v[:12]}" for k, v in settings.items()),
)
def test_whatever_a_scene_calls_for(tmp_path, settings):
    scene = scene_with(tmp_path, **settings)
    whole = run(scene, SELF, tmp_path / "a")
    for stop in (1, 3) if scene.output.every == 2 else (1, 2):
        with pytest.raises(Stop):
            run(scene, SELF, tmp_path / "b", resume=stop > 1, stop=stop)
    resumed = run(scene, SELF, tmp_path / "b", resume=True)
    expected, found = arrays(whole), arrays(resumed)
    assert different(expected, found) == 0
    for done in (before := counts(whole), after := counts(resumed)):
        del done["assemblies"]  # what lasts for a run is assembled in each
    assert before == after
