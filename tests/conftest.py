"""Figures that the tests measure, printed as one table at the end of the run."""

from collections.abc import Callable
from pathlib import Path

import pytest
from _pytest.terminal import TerminalReporter

_figures: list[tuple[str, float, float, str]] = []


@pytest.fixture
def figure() -> Callable[[str, float, float, str], None]:
    """Record a figure beside its limit, and require it: figure(name, measured, limit, unit)."""

    def require(name: str, measured: float, limit: float, unit: str = "") -> None:
        _figures.append((name, measured, limit, unit))
        assert measured <= limit, f"{name}: measured {measured:.4g}, at most {limit:.4g} {unit}"

    return require


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
    width = max(len(name) for name, *_ in _figures)
    for name, measured, limit, unit in _figures:
        terminalreporter.write_line(f"{name:<{width}}  {measured:12.4g}  <= {limit:<8.4g} {unit}")
