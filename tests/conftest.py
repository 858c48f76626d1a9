# SPDX-License-Identifier: MIT
"""Figures that the tests measure, printed as one table at the end; one rank that reports."""

import io
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from _pytest.terminal import TerminalReporter
from support.figures import Figure, kept_and_required

_figures: list[Figure] = []


_other_ranks = io.StringIO()


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Let the first rank report; the others keep what they would say until it is needed."""
    from mpi4py import MPI

    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if MPI.COMM_WORLD.rank and reporter is not None:
        reporter._tw._file = _other_ranks


def pytest_unconfigure() -> None:
    said = _other_ranks.getvalue()
    if " failed" in said or " error" in said:
        sys.stderr.write(said)


@pytest.fixture
def figure() -> Callable[..., None]:
    """Record a figure beside its limit, and require it: figure(name, measured, limit, unit)."""

    return kept_and_required(_figures.append)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder one stands in, empty, and no launcher of several ranks around."""
    monkeypatch.chdir(tmp_path)
    for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"):
        monkeypatch.delenv(name, raising=False)
    return tmp_path


@pytest.fixture
def hytf(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int | str | None, str, str]]:
    """Run the command line in this process: exit code, standard output and error."""

    def call(*arguments: object) -> tuple[int | str | None, str, str]:
        from fenics_hytf.cli import main

        with pytest.raises(SystemExit) as stop:
            main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        assert stop.value.code == 1 or "Traceback" not in err  # 1 is a bug, which shows where
        return stop.value.code, out, err

    return call


@pytest.fixture
def shared_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that is the same on every rank; write on rank 0 only, then meet at a barrier."""
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    return Path(comm.bcast(tmp_path_factory.mktemp("shared") if comm.rank == 0 else None))


def pytest_terminal_summary(terminalreporter: TerminalReporter) -> None:
    from mpi4py import MPI

    if not _figures or MPI.COMM_WORLD.rank:
        return
    terminalreporter.section("measured against limit")
    width = max(len(found.name) for found in _figures)
    for found in _figures:
        figures = f"{found.measured:12.4g}  {found.sign} {found.limit:<8.4g} {found.unit}"
        terminalreporter.write_line(f"{found.name:<{width}}  {figures}".rstrip())
