# SPDX-License-Identifier: MIT
"""Motions by chance: harmonic, synthetic, recorded, and AT2 and CSV files, sound and damaged."""

from typing import Any

import numpy as np
from hypothesis import strategies as st

from fenics_hytf.motion import GRAVITY

Files = dict[str, bytes]

STEPS = (0.01, 0.02, 0.05)
_NAMES = ("Northridge_1994_PAC-175", "Cape_Mendocino_1992_PET-090")


def numbers(least: float, most: float) -> st.SearchStrategy[float]:
    """Numbers of the size of the bounds, or 0, with three digits: easier to read than sixteen."""
    tiny = 1e-6 * max(abs(least), abs(most))
    rounded = st.floats(least, most).map(lambda x: float(f"{x:.3g}") if abs(x) > tiny else 0.0)
    return rounded.filter(lambda x: least <= x <= most)


@st.composite
def motions(
    draw: st.DrawFn, directions: tuple[str, ...], input_kind: str, files: Files
) -> list[dict[str, Any]]:
    """Motions of one time step, one in each direction.

    Args:
        draw: From hypothesis.
        directions: Of the motions.
        input_kind: ``within`` or ``outcrop``.
        files: Where records that motions name are put.

    Returns:
        Tables ``[[motion]]``.
    """
    dt, samples = draw(st.sampled_from(STEPS)), draw(st.integers(80, 110))
    tables = []
    for i, direction in enumerate(directions):
        kind = draw(st.sampled_from(("harmonic", "synthetic", "at2", "csv", "column")))
        table: dict[str, Any] = {"direction": direction}
        if kind == "harmonic":
            table["harmonic"] = draw(_harmonics(dt, samples))
        elif kind == "synthetic":
            table["synthetic"] = draw(_synthetics(dt, samples))
        else:
            name = f"record{i}.{'at2' if kind == 'at2' else 'csv'}"
            table["file"] = name
            units = draw(st.sampled_from((None, "g", "m/s2"))) if kind != "at2" else None
            if units is not None:
                table["units"] = units
            if kind == "column":
                table["dt"] = dt
            acceleration = draw(_accelerations(samples)) * (GRAVITY if units == "m/s2" else 1.0)
            newer = draw(st.booleans())
            files[name] = _written(kind, acceleration, dt, newer)
        scaling = draw(st.sampled_from(("none", "pga", "scale")))
        if scaling == "pga" and kind != "harmonic":
            table["pga"] = draw(numbers(0.001, 0.4))
        elif scaling == "scale":
            table["scale"] = draw(numbers(-2, 2).filter(bool))
        if input_kind == "outcrop" or draw(st.booleans()):
            table["input"] = input_kind
        tables.append(table)
    return tables


@st.composite
def record_files(draw: st.DrawFn) -> tuple[str, bytes, float | None]:
    """A record as a file: its name, its content, and its time step if it does not tell that."""
    kind, dt = draw(st.sampled_from(("at2", "csv", "column"))), draw(st.sampled_from(STEPS))
    content = _written(kind, draw(_accelerations(12)), dt, draw(st.booleans()))
    return f"record.{'at2' if kind == 'at2' else 'csv'}", content, dt if kind == "column" else None


@st.composite
def recorded(draw: st.DrawFn, direction: str, input_kind: str) -> list[dict[str, Any]]:
    """One of the recorded motions, by name."""
    name = draw(st.sampled_from(_NAMES))
    return [{"direction": direction, "record": name, "input": input_kind}]


@st.composite
def _harmonics(draw: st.DrawFn, dt: float, samples: int) -> dict[str, Any]:
    cycles = draw(st.one_of(st.integers(1, samples // 4), numbers(0.5, samples / 4)))
    return {
        "amplitude": draw(numbers(-4, 4)),
        "frequency": cycles / (dt * samples),
        "cycles": cycles,
        "samples": samples,
    }


@st.composite
def _synthetics(draw: st.DrawFn, dt: float, samples: int) -> dict[str, Any]:
    table: dict[str, Any] = {"dt": dt, "n": samples, "f2": draw(numbers(1.0, 8.0))}
    if draw(st.booleans()):
        table |= {"f1": draw(numbers(0.2, 0.9)), "nf": draw(st.integers(2, 20))}
    if draw(st.booleans()):
        table |= {"t1": draw(numbers(0.1, 1)), "t2": draw(numbers(1, 2)), "c": draw(numbers(1, 9))}
    if draw(st.booleans()):
        table["pga_g"] = draw(numbers(0.01, 0.3))
    return table


@st.composite
def _accelerations(draw: st.DrawFn, samples: int) -> np.ndarray:
    """[g], never zero throughout, shape ``(n,)``; n from half as many samples on."""
    count = draw(st.integers(samples // 2, samples))
    seed, peak = draw(st.integers(0, 2**32 - 1)), draw(numbers(0.001, 0.4))
    noise = np.random.default_rng(seed).standard_normal(count)
    smooth = np.convolve(noise, np.ones(draw(st.integers(1, 8))), "same")
    return np.asarray(peak * smooth / np.abs(smooth).max())


def _written(kind: str, acceleration: np.ndarray, dt: float, newer: bool) -> bytes:
    values = [f"{a:.7e}" for a in acceleration]
    if kind == "column":
        return ("\n".join(values) + "\n").encode()
    if kind == "csv":
        rows = (f"{i * dt:.4f},{a}" for i, a in enumerate(values))
        return ("time_s,acceleration\n" * newer + "\n".join(rows) + "\n").encode()
    size = f"NPTS= {len(values)}, DT= {dt:.4f} SEC" if newer else f"{len(values)} {dt} NPTS, DT"
    rows = (" ".join(values[i : i + 5]) for i in range(0, len(values), 5))
    head = ("a record", "of nowhere", "ACCELERATION TIME SERIES IN UNITS OF G", size)
    return ("\n".join((*head, *rows)) + "\n").encode()


@st.composite
def damaged_records(draw: st.DrawFn, content: bytes) -> bytes:
    """A record cut off, with odd values or an odd header, or of something else."""
    how = draw(st.sampled_from(("cut", "value", "header", "noise", "junk")))
    if how == "cut":
        return content[: draw(st.integers(0, len(content)))]
    if how == "junk":
        return draw(
            st.sampled_from((b"", b"\0" * 99, b"\xff\xfe" + content, b"1\n", b"1,2,3\n1\n"))
        )
    if how == "noise":
        at = draw(st.integers(0, len(content) - 1))
        return content[:at] + draw(st.binary(max_size=8)) + content[at:]
    lines = content.split(b"\n")
    odd = (b"nan", b"inf", b"-1e999", b"1e300", b"1e-310", b"x", b"1_0", b"0x1p3", b"--", b"1,1,1")
    if how == "value":
        at = draw(st.integers(0, len(lines) - 2))
        parts = lines[at].replace(b",", b" ").split() or [b""]
        parts[draw(st.integers(0, len(parts) - 1))] = draw(st.sampled_from(odd))
        lines[at] = (b"," if b"," in lines[at] else b" ").join(parts)
        return b"\n".join(lines)
    size = draw(st.sampled_from((b"0", b"1", b"7", b"999999999999", b"-4", b"nan")))
    step = draw(st.sampled_from((b"0", b"0.0", b"-0.01", b"1e-300", b"1e300", b"nan", b"")))
    header = draw(st.sampled_from((b"NPTS= %b, DT= %b SEC", b"%b %b NPTS, DT")))
    lines[3:4] = [header % (size, step)]
    return b"\n".join(lines)
