# SPDX-License-Identifier: MIT
"""One scene through the command line, in this process, and what must hold however it ends."""

import io
import os
import resource
import shutil
import signal
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path

from fenics_hytf.cli import main
from support.fuzz.outcome import complaints_about

SECONDS = 20.0
"""Of this process's own time that any command may take of scenes as small as these."""

MEMORY = 8 * 2**30
"""Bytes that a scene may ask for on top of what the process has: far more than these need."""

LONGEST = 4000
"""Bytes of a file beside a scene that are shown: the meshes are drawn again by their names."""


class TooLong(BaseException):
    """A command took longer than it may; passes whatever catches exceptions."""


@dataclass
class Answer:
    """What a command left: exit code, standard output and error, seconds of a core."""

    code: int | str | None
    out: str
    err: str
    seconds: float

    @property
    def text(self) -> str:
        """All that was said."""
        return self.out + self.err


@dataclass
class Tally:
    """How many scenes ended in which way."""

    codes: Counter[int | str | None] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    last: Answer = field(default=None, repr=False)  # type: ignore[assignment]

    def count(self, answer: Answer) -> None:
        self.last = answer
        self.codes[answer.code] += 1
        if answer.code == 3:
            self.reasons[answer.err.strip().splitlines()[-1][:120]] += 1


def hytf(*arguments: object) -> Answer:
    """Run the command line in this process."""
    out, err, start = io.StringIO(), io.StringIO(), time.process_time()
    code: int | str | None = "too long"
    with redirect_stdout(out), redirect_stderr(err):
        try:
            with _limited(SECONDS):
                main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = 0 if stop.code is None else stop.code
        except TooLong:
            pass
        except Exception:  # as the interpreter would end
            traceback.print_exc()
            code = 1
    return Answer(code, out.getvalue(), err.getvalue(), time.process_time() - start)


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise after so many seconds of this process's own time, whatever else the machine does."""

    def stop(_number: int, _frame: object) -> None:
        raise TooLong

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@contextmanager
def limited_memory(more: int = MEMORY) -> Iterator[None]:
    """Let this process take so many bytes more and none beyond: an allocation fails instead."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    limit = pages * resource.getpagesize() + more
    resource.setrlimit(resource.RLIMIT_AS, (limit if hard < 0 else min(limit, hard), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


@contextmanager
def folder_with(parent: Path, files: Mapping[str, bytes | None]) -> Iterator[Path]:
    """A folder with these files, ``None`` for one that is a folder; one stands in it meanwhile."""
    folder = Path(tempfile.mkdtemp(dir=parent))
    for name, content in files.items():
        if content is None:
            (folder / name).mkdir()
        else:
            (folder / name).write_bytes(content)
    try:
        with chdir(folder):
            yield folder
    finally:
        shutil.rmtree(folder)


def try_scene(
    parent: Path,
    scene: bytes,
    files: Mapping[str, bytes | None],
    options: tuple[str, ...] = (),
    then: tuple[tuple[str, ...], ...] = (),
    tally: Callable[[Answer], None] = lambda answer: None,
    check: bool = True,
) -> list[str]:
    """Check and run a scene, and use its result if there is one.

    Args:
        parent: Where a folder may be made for it.
        scene: What the scene file holds.
        files: Files beside it.
        options: Of the run.
        then: Commands on the result, if the run comes to its end.
        tally: Told how the run ended.
        check: Whether it is checked as well, by a command of its own.

    Returns:
        What does not hold, empty if all is well.
    """
    with folder_with(parent, {"scene.toml": scene, **files}) as folder:
        before = _listing(folder)
        answer = hytf("run", "scene.toml", *options)
        tally(answer)
        complaints = complaints_about_answer("run", answer)
        written = sorted(_listing(folder) - before)
        if answer.code == 2 and written:
            complaints.append(f"run: exit code 2, and wrote {written}")
        if check:
            overrides = [o for o in options if o not in ("--no-plots", "--quiet")]
            complaints += _complaints_about_check(folder, overrides, answer.code)
        result = Path("scene-result")
        if answer.code in (0, 3) and result.is_dir():
            complaints += complaints_about(result, finished=answer.code == 0)
        if answer.code == 0:
            for command in then:
                told = hytf(*command)
                complaints += complaints_about_answer(" ".join(command), told)
                # where nothing moves there is no motion to write
                if told.code != 0 and not (command[0] == "export" and "that moves" in told.err):
                    complaints.append(f"{' '.join(command)}: exit code {told.code}: {told.err}")
    return complaints


def _complaints_about_check(
    folder: Path, options: list[str], code: int | str | None
) -> Iterator[str]:
    """What does not hold of ``hytf check`` beside a run that ended so."""
    before = _listing(folder)
    answer = hytf("check", "scene.toml", *options)
    yield from complaints_about_answer("check", answer)
    if _listing(folder) != before:
        yield f"check: left {sorted(_listing(folder) - before)}"
    if answer.code in (0, 2) and (answer.code == 2) != (code == 2):
        yield f"check: exit code {answer.code}, where run has {code}: {answer.err}"


def complaints_about_answer(command: str, answer: Answer) -> list[str]:
    """What holds of every command, whatever it was given."""
    found = []
    if answer.code not in (0, 2, 3):
        found.append(f"{command}: exit code {answer.code}: {answer.err[-3000:]}")
    if "Traceback" in answer.text:
        found.append(f"{command}: a traceback: {answer.text[-3000:]}")
    if answer.code != 0 and not answer.err.strip():
        found.append(f"{command}: exit code {answer.code} without a word")
    return found


def _listing(folder: Path) -> set[str]:
    return {
        os.path.join(Path(place).relative_to(folder), name)
        for place, folders, names in os.walk(folder)
        for name in folders + names
    }


def require(complaints: list[str], scene: bytes, files: Mapping[str, bytes | None]) -> None:
    """Fail with the scene that shows it, so that the test's output is all that one needs.

    Args:
        complaints: What does not hold.
        scene: What the scene file holds.
        files: Files beside it.
    """
    if not complaints:
        return
    told = [*complaints, "--- scene.toml", scene.decode(errors="backslashreplace")]
    for name, content in files.items():
        text = (
            "a folder" if content is None else content[:LONGEST].decode(errors="backslashreplace")
        )
        told += [f"--- {name}", text]
    raise AssertionError("\n".join(told))
