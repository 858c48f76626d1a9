# SPDX-License-Identifier: MIT
"""Checkpoints: whole or not there, whatever happens while one is written; only data; one scene."""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from support.results_builder import make_result, make_scene

from fenics_hytf.lapse.records import LapseResult
from fenics_hytf.motion.files import part_of
from fenics_hytf.results import CHECKPOINT, folder_faults, open_result
from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import CheckpointError, CheckpointFolder, Work
from fenics_hytf.simulation.checkpoint import (
    FILE,
    read_checkpoint,
    require_same_scene,
    take_checkpoint,
    write_checkpoint,
)

WORLD = MPI.COMM_WORLD
META = {"format": 2, "lapse": 4, "state": {"x": {"array": "points/x"}}, "names": ["ä", None, 0.1]}
ARRAYS = {
    "points/x": np.array([[0.1, np.nan], [-0.0, 5e-324]]),
    "points/id": np.arange(3),
    "spectrum": np.array([1 + 2j, np.inf]),
    "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "masses": np.array(["9" * 300, "-1"]),
    "none": np.zeros((0, 2)),
}


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def assert_same(found, arrays, meta=META):
    assert found is not None and found.meta == meta and list(found.arrays) == list(arrays)
    for name, values in arrays.items():
        there = found.arrays[name]
        assert there.dtype == values.dtype and there.shape == values.shape
        assert there.tobytes("A") == values.tobytes("A"), name
        assert there.flags.f_contiguous == values.flags.f_contiguous and there.flags.writeable


def sealed(content):
    """The file of an archive as a run would have sealed it."""
    return content[:-64] + hashlib.sha256(content[:-64]).hexdigest().encode()


def archive(members):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as made:
        made.comment = b"0" * 64
        for name, content in members.items():
            made.writestr(name, content)
    return sealed(file.getvalue())


def test_it_comes_back_to_the_last_bit(tmp_path):
    folder = tmp_path / "deep/er"
    assert read_checkpoint(folder) is None
    write_checkpoint(folder, META, ARRAYS)
    assert names(folder) == [FILE]
    assert_same(read_checkpoint(folder), ARRAYS)
    first = (folder / FILE).read_bytes()
    write_checkpoint(folder, META, ARRAYS)
    assert (folder / FILE).read_bytes() == first


def test_numpy_and_unzip_read_it(tmp_path):
    write_checkpoint(tmp_path, META, ARRAYS)
    with np.load(tmp_path / FILE, allow_pickle=False) as file:
        assert np.array_equal(file["points/x"], ARRAYS["points/x"], equal_nan=True)
    with zipfile.ZipFile(tmp_path / FILE) as file:
        assert file.testzip() is None and json.loads(file.read("meta.json")) == META


def test_any_bit_that_flips_is_found(tmp_path):
    write_checkpoint(tmp_path, META, ARRAYS)
    good = (tmp_path / FILE).read_bytes()
    random = np.random.default_rng(1)
    places = [0, 40, len(good) - 65, len(good) - 1, *random.integers(0, len(good), 60)]
    for place in places:
        bad = bytearray(good)
        bad[place] ^= 1 << int(random.integers(8))
        (tmp_path / FILE).write_bytes(bad)
        with pytest.raises(CheckpointError, match=r"state\.npz: found a file that is damaged"):
            read_checkpoint(tmp_path)


def test_any_cut_is_found(tmp_path):
    write_checkpoint(tmp_path, META, ARRAYS)
    good = (tmp_path / FILE).read_bytes()
    for size in (0, 1, 63, 64, 65, len(good) // 2, len(good) - 64, len(good) - 1):
        (tmp_path / FILE).write_bytes(good[:size])
        with pytest.raises(CheckpointError, match="cut short"):
            read_checkpoint(tmp_path)
    (tmp_path / FILE).write_bytes(good + b"\0")
    with pytest.raises(CheckpointError, match="damaged"):
        read_checkpoint(tmp_path)


class _Trap:
    def __reduce__(self):
        return (os.mkdir, ("trapped",))


def test_nothing_in_it_is_executed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = io.BytesIO()
    np.lib.format.write_array(file, np.array([_Trap()], dtype=object), allow_pickle=True)
    meta = json.dumps(META)
    for members in (
        {"meta.json": meta, "points/x.npy": file.getvalue()},
        {"meta.json": meta, "points/x.npy": pickle.dumps(_Trap())},
        {"meta.json": pickle.dumps(_Trap())},
    ):
        Path(FILE).write_bytes(archive(members))
        with pytest.raises(CheckpointError, match="found no checkpoint"):
            read_checkpoint(Path())
    assert names(tmp_path) == [FILE]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (sealed(b"no archive" + 64 * b"0"), "found no checkpoint"),
        (archive({"other.json": "{}"}), "found no checkpoint"),
        (archive({"meta.json": "{"}), "found no checkpoint"),
        (archive({"meta.json": "[]"}), "of format None; expected 2"),
        (archive({"meta.json": '{"format": 1}'}), "of format 1; expected 2"),
        (archive({"meta.json": json.dumps(META), "x.npy": b"x"}), "found no checkpoint"),
    ],
)
def test_what_is_no_checkpoint_is_told(tmp_path, content, words):
    (tmp_path / FILE).write_bytes(content)
    with pytest.raises(CheckpointError, match=words) as error:
        read_checkpoint(tmp_path)
    assert "start anew" in str(error.value).lower()


@pytest.mark.parametrize("number", [28, 27, 122, 5])
def test_a_disk_that_fails_leaves_the_one_before(tmp_path, monkeypatch, number):
    write_checkpoint(tmp_path / "c", META, ARRAYS)

    def fail(_handle):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(CheckpointError, match="The checkpoint before is kept") as error:
        write_checkpoint(tmp_path / "c", {**META, "lapse": 5}, ARRAYS)
    assert os.strerror(number) in str(error.value)
    assert ("no room" in str(error.value)) == (number != 5)
    assert names(tmp_path / "c") == [FILE]
    assert_same(read_checkpoint(tmp_path / "c"), ARRAYS)
    with pytest.raises(CheckpointError, match="There is none before"):
        write_checkpoint(tmp_path / "d", META, ARRAYS)


def test_an_interrupt_leaves_the_one_before(tmp_path, monkeypatch):
    write_checkpoint(tmp_path, META, ARRAYS)

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_checkpoint(tmp_path, {**META, "lapse": 5}, ARRAYS)
    assert names(tmp_path) == [FILE]
    assert_same(read_checkpoint(tmp_path), ARRAYS)


def test_a_link_leads_no_checkpoint_elsewhere(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "checkpoint").symlink_to("elsewhere")
    with pytest.raises(CheckpointError, match="found a link"):
        write_checkpoint(tmp_path / "checkpoint", {}, {})
    assert not any((tmp_path / "elsewhere").iterdir())


def test_a_place_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    for place, words in (("file", "found a file"), ("file/below", "cannot be written")):
        with pytest.raises(CheckpointError, match=words):
            write_checkpoint(tmp_path / place, META, ARRAYS)
    assert read_checkpoint(tmp_path / "file") is None
    (tmp_path / FILE).mkdir()
    with pytest.raises(CheckpointError, match="cannot be read"):
        read_checkpoint(tmp_path)


LIMITED = """
import json, resource, signal, sys
from pathlib import Path
import numpy as np
from fenics_hytf.simulation import CheckpointError
from fenics_hytf.simulation.checkpoint import read_checkpoint, write_checkpoint
folder = Path(sys.argv[1])
arrays = {f"a{i}": np.full(20_000, float(i)) for i in range(4)}
write_checkpoint(folder, {"format": 2, "lapse": 0}, {})
size = 4 * (20_000 * 8 + 300)
said = set()
for limit in [0, 1, 100, 1000, *range(5000, size, 40_000), size - 500]:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        write_checkpoint(folder, {"format": 2, "lapse": 1}, arrays)
    except CheckpointError as error:
        said.add(str(error))
    else:
        said.add(f"written with a limit of {limit}")
    found = read_checkpoint(folder)
    assert found is not None and found.meta["lapse"] == 0
    assert [p.name for p in folder.iterdir()] == ["state.npz"]
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
write_checkpoint(folder, {"format": 2, "lapse": 1}, arrays)
assert read_checkpoint(folder).meta["lapse"] == 1
print(json.dumps(sorted(said)))
"""


def test_a_limit_of_the_file_size_leaves_the_one_before(tmp_path):
    """Wherever it strikes; the signal that comes with it does not end the process."""
    command = [sys.executable, "-c", LIMITED, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    (said,) = json.loads(done.stdout)
    assert said == (
        f"{tmp_path}/state.npz: found no room for the checkpoint (File too large); expected a disk "
        "that holds it. The checkpoint before is kept: make room, then go on with --resume"
    )
    assert "Traceback" not in done.stderr


KILLED = """
import os, random, signal, sys, time
from pathlib import Path
import numpy as np
from fenics_hytf.simulation.checkpoint import read_checkpoint, write_checkpoint
folder = Path(sys.argv[1])
random.seed(3)

def write(number):
    arrays = {name: np.full(250_000, float(number)) for name in "abcd"}
    write_checkpoint(folder, {"format": 2, "lapse": number, "padding": number * "x"}, arrays)

write(0)
last, torn, replaced = 0, 0, 0
for _ in range(20):
    child = os.fork()
    if not child:
        for number in range(last + 1, last + 1000):
            write(number)
        os._exit(1)
    time.sleep(random.uniform(0.0, 0.15))
    os.kill(child, signal.SIGKILL)
    assert os.waitpid(child, 0)[1] == signal.SIGKILL
    torn += (folder / ".state.npz").exists()
    found = read_checkpoint(folder)
    number = found.meta["lapse"]
    assert number >= last and all((a == number).all() for a in found.arrays.values())
    replaced += number > last
    last = number
write(last + 1)
assert [p.name for p in folder.iterdir()] == ["state.npz"]
assert torn and replaced, (torn, replaced)
"""


def test_a_kill_at_any_moment_leaves_one_that_is_whole(tmp_path):
    command = [sys.executable, "-c", KILLED, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=200)
    assert done.returncode == 0, done.stderr


def test_what_a_run_has_comes_back(tmp_path):
    result = make_result(lapses=3)
    state = {"lapses": result.lapses, "work": result.work, "strain": None, "masses": 2**1500}
    taken = take_checkpoint(result.scene, 1, 2, 1, state)
    write_checkpoint(tmp_path, taken.meta, taken.arrays)
    found = read_checkpoint(tmp_path)
    assert found.lapse == 1 and found.meta["num_lapses"] == 3
    assert found.meta["ranks"] == 2 and found.meta["group_size"] == 1
    assert found.meta["scene_hash"] == result.scene.hash
    assert found.meta["scene"] == json.loads(json.dumps(result.scene.data))
    assert {"fenics_hytf", "numpy", "dolfinx", "petsc"} <= set(found.meta["versions"])
    lapses = found.load("lapses", tuple[LapseResult, ...])
    for lapse, before in zip(lapses, result.lapses, strict=True):
        assert np.array_equal(lapse.transfer, before.transfer) and lapse.loop == before.loop
    assert found.load("work", Work) == result.work
    assert found.load("masses", int) == 2**1500 and found.load("strain", float | None) is None
    with pytest.raises(CheckpointError, match="found no points"):
        found.load("points", dict)


def test_another_scene_is_refused_with_its_keys():
    scene = make_scene()
    taken = take_checkpoint(scene, 0, 1, 1, {})
    require_same_scene(taken, scene)
    other = make_scene(title="Another", solver={"tolerance": 1e-4}, points={"outside": "park"})
    with pytest.raises(SceneError) as error:
        require_same_scene(taken, other)
    assert [str(fault) for fault in error.value.faults] == [
        'points.outside: found "park"; expected "error", as in the checkpoint',
        "solver.tolerance: found 0.0001; expected 1e-06, as in the checkpoint",
    ]


def test_a_result_folder_knows_its_checkpoint(tmp_path):
    with open_result(tmp_path / "r") as folder:
        assert folder.checkpoint == tmp_path / "r" / CHECKPOINT
        write_checkpoint(folder.checkpoint, META, {})
        part_of(folder.checkpoint / FILE).write_bytes(b"torn")
    (fault,) = folder_faults(tmp_path / "r", force=False)
    assert "unfinished run" in fault and "--resume" in fault and "--force" in fault
    assert folder_faults(tmp_path / "r", force=False, resume=True) == []
    with open_result(tmp_path / "r", resume=True) as folder:
        folder.go_on()
        folder.clear()
        assert names(folder.checkpoint) == [f".{FILE}", FILE]
        folder.write(make_result())
    assert CHECKPOINT not in names(tmp_path / "r")


@pytest.mark.mpi
def test_every_rank_goes_on_from_the_same(shared_path):
    scene: Scene = make_scene(lapses=3)
    cleared = []
    folder = CheckpointFolder(
        shared_path / "c", scene, WORLD, resume=True, first=lambda: cleared.append(1)
    )
    assert (folder.found, folder.lapse, folder.group_size, folder.notes) == (None, None, None, [])
    for lapse in range(2):
        state = {"strain": np.arange(3.0) + lapse} if WORLD.rank == 0 else {"strain": None}
        folder.save(lapse, 1, state)
        assert folder.lapse == lapse and len(cleared) == (WORLD.rank == 0)
    again = CheckpointFolder(shared_path / "c", scene, WORLD, resume=True)
    assert again.lapse == 1 and again.group_size == 1 and again.notes == []
    assert again.found.load("strain", np.ndarray).tolist() == [1.0, 2.0, 3.0]
    again.save(2, 1, {})
    assert again.lapse == 2 and again.found is None
    assert CheckpointFolder(shared_path / "c", scene, WORLD).found is None
    alone = CheckpointFolder(shared_path / "c", scene, MPI.COMM_SELF, resume=True)
    assert (alone.group_size is None) == (WORLD.size > 1)
    assert any("ranks" in note for note in alone.notes) == (WORLD.size > 1)
    WORLD.Barrier()


def test_what_is_kept_is_told_as_soon_as_it_is(tmp_path, monkeypatch):
    """A run may be interrupted at any moment: naively the file is there, and the run says not."""
    folder, told = CheckpointFolder(tmp_path / "c", make_scene(lapses=3), MPI.COMM_SELF), []
    replace = os.replace

    def watched(part, path):
        told.append(folder.lapse)
        replace(part, path)
        told.append(folder.lapse)

    monkeypatch.setattr(os, "replace", watched)
    for lapse in range(2):
        folder.save(lapse, 1, {})
    assert told == [None, 0, 0, 1]


@pytest.mark.mpi
def test_what_fails_on_the_first_rank_stops_all(shared_path, monkeypatch):
    scene, place = make_scene(), shared_path / "c"
    folder = CheckpointFolder(place, scene, WORLD)
    with pytest.raises(TypeError if WORLD.rank == 0 else RuntimeError, match="found a object"):
        folder.save(0, 1, {"strain": object()})
    folder.save(0, 1, {})
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "full")))
        with pytest.raises(CheckpointError, match="no room"):
            folder.save(1, 1, {})
    assert folder.lapse == 0
    other = make_scene(solver={"tolerance": 1e-4})
    with pytest.raises(SceneError) as error:
        CheckpointFolder(place, other, WORLD, resume=True)
    assert [fault.key for fault in error.value.faults] == ["solver.tolerance"]
    if WORLD.rank == 0:
        (place / FILE).write_bytes(b"x")
    WORLD.Barrier()
    with pytest.raises(CheckpointError, match="damaged"):
        CheckpointFolder(place, scene, WORLD, resume=True)
    WORLD.Barrier()

    def fail():
        raise OSError(13, "Permission denied", "summary.json")

    with pytest.raises(CheckpointError, match=r"summary\.json: Permission denied"):
        CheckpointFolder(place, scene, WORLD, first=fail).save(0, 1, {})
    WORLD.Barrier()
