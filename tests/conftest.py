"""Figures that the tests measure, printed as one table at the end of the run."""

from collections.abc import Callable

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


def pytest_terminal_summary(terminalreporter: TerminalReporter) -> None:
    from mpi4py import MPI

    if not _figures or MPI.COMM_WORLD.rank:
        return
    terminalreporter.section("measured against limit")
    width = max(len(name) for name, *_ in _figures)
    for name, measured, limit, unit in _figures:
        terminalreporter.write_line(f"{name:<{width}}  {measured:12.4g}  <= {limit:<8.4g} {unit}")
