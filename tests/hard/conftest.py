# SPDX-License-Identifier: MIT
"""Collects the figures of the hard cases, and prints them as one table.

A test of case NN is named ``test_NN_what_holds``; tests of other names are listed beside the cases.
``HYTF_HARD_CSV`` names a file to which the figures are added; those that runs on other numbers of
ranks have left there are in the table too.
"""

import os
import re
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from _pytest.terminal import TerminalReporter
from mpi4py import MPI
from support.figures import Figure, kept_and_required
from support.hard_table import TITLES, Row, faults, lines, read, write
from support.small_run import COLUMN, FOLDER, HYTF, RUN

HERE = Path(__file__).parent
KEPT = os.environ.get("HYTF_HARD_CSV")

_rows: list[Row] = []
_wanted: set[int] = set()
_expected: list[tuple[str, bool]] = []
_chosen = False  # among the tests of this folder
_faults: list[str] = []


def _case(item: pytest.Item) -> int:
    """Number of the case that a test belongs to; 0 where to none."""
    number = re.match(r"test_(\d\d)_", item.name)
    if number is None:
        return 0
    if int(number[1]) not in TITLES:
        raise pytest.UsageError(f"{item.nodeid}: found case {number[1]}; expected 01 to 33")
    return int(number[1])


@pytest.fixture
def figure(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Record a figure of the test's case beside its limit, and require it; see the other one."""
    marker = request.node.get_closest_marker("xfail")
    reason = marker.kwargs.get("reason", "") if marker else ""
    case = _case(request.node)

    def keep(found: Figure) -> None:
        _rows.append(Row(case, request.node.name, MPI.COMM_WORLD.size, found, reason))

    return kept_and_required(keep)


@pytest.fixture
def here(here: Path) -> Path:
    """The folder one stands in, with the scene of a small column."""
    Path("s.toml").write_text(COLUMN)
    return here


@pytest.fixture(scope="session")
def whole(tmp_path_factory) -> str:
    """The result of the run that nothing befell."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "s.toml").write_text(COLUMN)
    start = time.perf_counter()
    subprocess.run([*HYTF, *RUN, "--quiet"], cwd=folder, check=True)
    (folder / "took").write_text(f"{time.perf_counter() - start}")
    return str(folder / FOLDER)


def pytest_deselected(items: list[pytest.Item]) -> None:
    global _chosen
    _chosen |= any(item.path.parent == HERE for item in items)


def pytest_collection_finish(session: pytest.Session) -> None:
    mine = [item for item in session.items if item.path.parent == HERE]
    _wanted.update(_case(item) for item in mine)
    for item in mine:
        for marker in item.iter_markers("xfail"):
            _expected.append((item.name, bool(marker.kwargs.get("strict"))))
    folders = [Path(argument).resolve() for argument in session.config.args]
    if not _chosen and any(folder in (HERE, *HERE.parents) for folder in folders):
        _wanted.update(TITLES)
    _wanted.discard(0)


def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.config.option.collectonly or MPI.COMM_WORLD.rank:
        return
    if KEPT is not None:
        others = [row for row in read(Path(KEPT)) if row.ranks != MPI.COMM_WORLD.size]
        write(Path(KEPT), _rows)
        _rows.extend(others)
    _faults.extend(faults(_rows, _wanted, _expected))
    if _faults and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: TerminalReporter) -> None:
    if MPI.COMM_WORLD.rank or not (_rows or _faults):
        return
    if MPI.COMM_WORLD.size == 1 or KEPT is None:  # else the table of the serial run has them
        terminalreporter.section("hard cases")
        for line, markup in lines(_rows):
            terminalreporter.write_line(line, **markup)
    for fault in _faults:
        terminalreporter.write_line(fault, red=True)
