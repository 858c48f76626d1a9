# SPDX-License-Identifier: MIT
"""Whatever a scene holds: an exit code with its reason, no traceback, no file but a good result.

Scenes by chance, half of them valid by construction, half with something wrong. HYTF_FUZZ is their
number, 200 by default and always the same; HYTF_FUZZ_SEED draws others (``docker/run fuzz``).
"""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st
from support.fuzz import toml
from support.fuzz.broken import broken_scenes
from support.fuzz.commands import mesh_commands, options, sound_options, uses
from support.fuzz.meshes import Drawn, damaged_meshes, draw_meshes
from support.fuzz.records import damaged_records, record_files
from support.fuzz.scenes import scenes
from support.fuzz.trial import (
    Tally,
    complaints_about_answer,
    folder_with,
    hytf,
    limited_memory,
    require,
    try_scene,
)

from fenics_hytf.motion import RecordError, read

HALF = max(1, int(os.environ.get("HYTF_FUZZ", "200")) // 2)
SEED = os.environ.get("HYTF_FUZZ_SEED")
STOPPED = 0.1
"""Part of the valid scenes that may end with a typed error: loops without a fixed point, ground
too weak for its weight, points that leave where that is an error. Of 100 scenes 2 and 7 did in two
draws; were it 7 in the long run, 3 more would be one standard deviation."""

pytestmark = pytest.mark.timeout(20 * max(HALF, 100))


def by_chance(number: int, test: Callable[[st.DataObject], None]) -> None:
    """Call a test with so many examples; the same ones each time unless a seed is given.

    Each comes from a seed of its own: of many examples of one seed most are near relatives.
    """

    def unless_simplest(data: st.DataObject) -> None:
        """The first example of every seed is the simplest one, alike for all: a nought here."""
        if data.draw(st.integers(0, 2**32)):
            test(data)

    once = settings(
        max_examples=2,  # that one, and one by chance
        deadline=None,  # each command is limited in seconds of its own
        database=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
    )
    first = 0 if SEED is None else int(SEED) * 1_000_003
    for k in range(first, first + max(number, 1)):
        seed(k)(once(given(st.data())(unless_simplest)))()


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Drawn]:
    return draw_meshes(tmp_path_factory.mktemp("meshes"))


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where scenes run; none of them may eat the machine's memory."""
    with limited_memory():
        yield tmp_path_factory.mktemp("scenes")


def test_scenes_that_are_valid_come_to_their_end(drawn, place, figure):
    tally = Tally()

    def run(data: st.DataObject) -> None:
        case = data.draw(scenes(drawn))
        given = data.draw(sound_options())
        then, check = data.draw(uses(case, given)), data.draw(st.booleans())
        text = toml.document(case.data).encode()
        found = try_scene(place, text, case.files, given, then, tally.count, check)
        if tally.last.code == 2:
            found.append(f"a valid scene is refused: {tally.last.err}")
        require(found, text, case.files)

    by_chance(HALF, run)
    print(f"\nvalid scenes: {tally}")
    figure("fuzz: valid scenes", tally.codes.total(), HALF, at_least=True)
    # of a handful one may stop
    figure("fuzz: of them stopped", tally.codes[3], max(1, STOPPED * HALF))


def test_whatever_is_wrong_with_a_scene_is_told(drawn, place, figure):
    tally = Tally()

    def run(data: st.DataObject) -> None:
        case, text = data.draw(broken_scenes(drawn))
        given, check = data.draw(options()), data.draw(st.booleans())
        found = try_scene(place, text, case.files, given, (), tally.count, check)
        require(found, text, case.files)

    by_chance(HALF, run)
    print(f"\nbroken scenes: {tally}")
    figure("fuzz: broken scenes", tally.codes.total(), HALF, at_least=True)
    # that the two halves differ: most of what is changed is seen
    figure("fuzz: broken scenes refused", tally.codes[2], HALF // 2, at_least=True)


def test_a_record_is_read_whole_or_refused(place):
    def run(data: st.DataObject) -> None:
        name, content, dt = data.draw(record_files())
        with folder_with(place, {name: data.draw(damaged_records(content))}):
            try:
                found = read(name, dt=dt)
            except RecordError as error:
                assert "record" in str(error)  # the file, or the record of its name
                return
        assert found.dt > 0 and np.isfinite(found.acceleration).all()

    by_chance(HALF, run)


def test_a_mesh_is_read_or_refused(drawn, place):
    def run(data: st.DataObject) -> None:
        mesh = drawn[data.draw(st.sampled_from(sorted(drawn)))]
        name = f"mesh{mesh.suffix}"
        soil = {"density": 1800.0, "shear_wave_velocity": 200.0, "poisson": 0.3}
        wave = {"amplitude": 1.0, "frequency": 1.0, "cycles": 1, "samples": 16}
        scene = {
            "mesh": {"file": name, "empty": list(mesh.empty)},
            "soil": dict.fromkeys(mesh.soils, soil),
            "motion": [{"direction": "x", "harmonic": wave}],
        }
        files = {"scene.toml": toml.document(scene).encode()}
        files[name] = data.draw(damaged_meshes(mesh))
        with folder_with(place, files):
            answer = hytf("check", "scene.toml")
        require(complaints_about_answer("check", answer), files.pop("scene.toml"), files)

    by_chance(HALF // 2, run)


def test_meshes_are_drawn_or_refused(place):
    def run(data: st.DataObject) -> None:
        command = data.draw(mesh_commands())
        with folder_with(place, {}) as folder:
            answer = hytf(*command)
            found = complaints_about_answer(" ".join(command), answer)
            assert not found, "\n".join(found)
            assert answer.code == 0 or not list(folder.iterdir())

    by_chance(HALF // 5, run)
