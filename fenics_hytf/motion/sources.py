# SPDX-License-Identifier: MIT
"""Records without a file: harmonic, a deterministic synthetic one, and the pyslammer suite."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np

from fenics_hytf.motion.formats import read_csv
from fenics_hytf.motion.records import Record, RecordError

_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
_INSTALL = "pip install fenics-hytf[records]"


def harmonic(amplitude: float, frequency: float, cycles: float, samples: int) -> Record:
    """Harmonic record, amplitude · sin(2πft) over a number of cycles, its end excluded.

    Over whole cycles the discrete transform has a single line. The phase is reduced to one cycle
    before the sine is taken, so that the others stay at round-off.

    Args:
        amplitude: [m/s^2].
        frequency: f [Hz].
        cycles: Number of cycles in the record.
        samples: Number of samples in the record; the time step is
            ``cycles / (frequency * samples)``.

    Returns:
        The record.

    Raises:
        ValueError: If a number is out of range, or there are not more than two samples a cycle.
    """
    _check_positive(frequency=frequency, cycles=cycles)
    if not np.isfinite(amplitude):
        raise ValueError(f"amplitude: found {amplitude}; expected a finite number in m/s^2")
    if samples != int(samples) or samples <= max(2.0 * cycles, 1.0):
        raise ValueError(
            f"samples: found {samples} for {cycles} cycles; expected a whole number, more than 2 "
            "a cycle"
        )
    samples = int(samples)
    phase = np.remainder(cycles * np.arange(samples), samples) / samples
    return Record(
        amplitude * np.sin(2.0 * np.pi * phase),
        cycles / (frequency * samples),
        f"harmonic {frequency:g} Hz",
    )


def synthetic(
    pga_g: float = 0.1,
    dt: float = 0.01,
    n: int = 2000,
    f1: float = 0.4,
    f2: float = 8.0,
    nf: int = 16,
    t1: float = 3.0,
    t2: float = 9.0,
    c: float = 0.6,
) -> Record:
    """Deterministic record: sines at log-spaced frequencies under a build-up, hold, decay envelope.

    a(t) = e(t) Σ_k sin(2πf_k t + φ_k), scaled to its peak, with f_k = f1 (f2/f1)^((k-1)/(nf-1)),
    φ_k = 2π frac(k (√5-1)/2) for k = 1…nf, and e(t) = (t/t1)² up to t1, 1 up to t2,
    exp(-c (t-t2)) after.

    Args:
        pga_g: Largest absolute acceleration [g].
        dt: Time step [s].
        n: Number of samples.
        f1: Lowest frequency [Hz].
        f2: Highest frequency [Hz].
        nf: Number of frequencies, at least 2.
        t1: End of the build-up [s].
        t2: Start of the decay [s].
        c: Rate of the decay [1/s].

    Returns:
        The record.

    Raises:
        ValueError: If a number is out of range.
    """
    _check_positive(pga_g=pga_g, dt=dt, f1=f1, t1=t1, c=c)
    if not f1 < f2 <= 0.5 / dt:
        raise ValueError(
            f"f2: found {f2} Hz; expected more than f1 = {f1} Hz and at most {0.5 / dt:g} Hz, "
            "half the sampling rate"
        )
    if not t1 <= t2:
        raise ValueError(f"t2: found {t2} s; expected at least t1 = {t1} s")
    for name, value in (("n", n), ("nf", nf)):
        if value != int(value) or value < 2:
            raise ValueError(f"{name}: found {value}; expected a whole number of at least 2")
    time = dt * np.arange(int(n))
    k = np.arange(1, int(nf) + 1)
    frequency = f1 * (f2 / f1) ** ((k - 1) / (nf - 1))
    phase = 2.0 * np.pi * np.remainder(_GOLDEN * k, 1.0)
    envelope = np.where(time < t1, (time / t1) ** 2, np.exp(-c * np.maximum(time - t2, 0.0)))
    waves = np.sin(2.0 * np.pi * np.outer(time, frequency) + phase).sum(axis=1)
    return Record(envelope * waves, dt, "synthetic").scaled(pga_g=pga_g)


def recorded_names() -> list[str]:
    """Names of the recorded motions that the PyPI package pyslammer brings.

    Returns:
        The names, sorted.

    Raises:
        RecordError: If the package is not installed.
    """
    return sorted(path.stem for path in _suite().glob("*.csv"))


def recorded(name: str) -> Record:
    """A recorded motion by name, from the suite that the PyPI package pyslammer brings.

    The package's files are read, its code is not imported.

    Args:
        name: For example ``"Kobe_1995_TAK-090"``.

    Returns:
        The record in m/s^2.

    Raises:
        RecordError: If the package is not installed or has no motion of that name.
    """
    names = recorded_names()
    if name not in names:
        raise RecordError(
            f"record: found '{name}'; expected one of {', '.join(names)}; choose one of these"
        )
    record = read_csv(_suite() / f"{name}.csv", units="g")
    return Record(record.acceleration, record.dt, name)


def _suite() -> Path:
    """Folder of the recorded motions."""
    spec = find_spec("pyslammer")
    if spec is None or not spec.submodule_search_locations:
        raise RecordError(
            "recorded motions: found no package pyslammer; expected it to be installed; "
            f"run '{_INSTALL}' or give a file instead"
        )
    folder = Path(next(iter(spec.submodule_search_locations))) / "sample_ground_motions"
    if not folder.is_dir():
        raise RecordError(
            f"recorded motions: found no folder {folder}; expected it in pyslammer; "
            f"run '{_INSTALL}' again or give a file instead"
        )
    return folder


def _check_positive(**values: float) -> None:
    """Raise ValueError for the first value that is not a positive finite number."""
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name}: found {value}; expected a positive number")
