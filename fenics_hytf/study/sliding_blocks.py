# SPDX-License-Identifier: MIT
"""Rigid, decoupled and coupled slips of recorded motions, beside those of pyslammer.

Ground is a column of 30 m with V_s = 200 m/s and 5 % of damping at its period, on a rigid base,
that slips where it stands. The program pyslammer (an optional extra, called as it is) takes its
first mode alone, after Rathje and Bray (1999, Can. Geotech. J. 36) where slip is coupled; here it
is cells of lumped mass, of all modes, whose slip is marched under Q_lin with their kernel P. The
same cells with an elastoplastic seam, marched in time, know nothing of either.

k_max is the peak of what drives a block: of the record for the rigid one, of the average
acceleration of the column for the others. Records are straight lines between their samples, and all
march on them in equal steps.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fenics_hytf.motion import (
    GRAVITY,
    ConvolutionQuadrature,
    Record,
    decoupled_slip,
    march,
    rigid_slip,
    straight_lines,
)
from fenics_hytf.results.figures.style import COLOURS, INK, figure_style, save
from fenics_hytf.study.sliding_column import Column, elastoplastic_column

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

RECORDS = (
    "Kobe_1995_TAK-090",
    "Northridge_1994_PAC-175",
    "Loma_Prieta_1989_HSP-000",
    "Chi-Chi_1999_TCU068-090",
)
RATIOS = tuple(round(0.1 * tenth, 1) for tenth in range(1, 9))
"""k_y over k_max."""

GROUND = Column(200.0)
STEP = 0.0025  # s

_PERIODS = 4  # of the motion, over which its linear response is computed
_DECAY = 1e-8  # of what comes round after them
_RIGID_BASE = 1e6  # m/s, of pyslammer's base


@dataclass(frozen=True)
class Slips:
    """Slips of one record at one k_y/k_max [m].

    Attributes:
        record: Its name.
        yield_over_peak: k_y/k_max [-].
        rigid_k_y: k_y of the rigid block [-].
        k_y: k_y of the others [-].
        rigid: Newmark's block.
        rigid_pyslammer: The same by pyslammer.
        decoupled: A block under the column's average acceleration.
        decoupled_pyslammer: The same by pyslammer, its column one mode.
        decoupled_same_drive: A block of this package under pyslammer's average acceleration.
        coupled: A block that slips under the column.
        coupled_pyslammer: The same by pyslammer, its column one mode.
        elastoplastic: The column on an elastoplastic seam, marched in time.
    """

    record: str
    yield_over_peak: float
    rigid_k_y: float
    k_y: float
    rigid: float
    rigid_pyslammer: float
    decoupled: float
    decoupled_pyslammer: float
    decoupled_same_drive: float
    coupled: float
    coupled_pyslammer: float
    elastoplastic: float


def slips(record: Record, ratios: Sequence[float] = RATIOS, step: float = STEP) -> Iterator[Slips]:
    """Slips of a record.

    Args:
        record: The motion; its acceleration drives the slip.
        ratios: k_y over k_max.
        step: Longest time step [s].

    Yields:
        Slips, a ratio each.
    """
    import pyslammer  # a second, and an optional extra

    substeps = int(np.ceil(record.dt / step - 1e-9))
    dt, drive = record.dt / substeps, straight_lines(record.acceleration, substeps)
    mass = float(GROUND.mass.sum())
    driving = _linear_force(GROUND, drive, dt)
    quadrature = ConvolutionQuadrature(drive.size, dt)
    weights = quadrature.weights(_force_over_drive(GROUND, quadrature.s))
    motion = pyslammer.GroundMotion(drive / GRAVITY, dt, record.name)
    ground = {
        "height": GROUND.height,
        "vs_slope": GROUND.shear_wave_velocity,
        "vs_base": _RIGID_BASE,
        "damp_ratio": GROUND.damping,
    }
    average = np.array(pyslammer.Decoupled(1.0, motion, **ground).HEA)
    for ratio in ratios:
        own, k_y = ratio * drive.max() / GRAVITY, ratio * driving.max() / mass / GRAVITY
        same = k_y * GRAVITY
        yield Slips(
            record=record.name,
            yield_over_peak=ratio,
            rigid_k_y=own,
            k_y=k_y,
            rigid=rigid_slip(drive, own * GRAVITY, dt).slip[-1],
            rigid_pyslammer=pyslammer.RigidAnalysis(own, motion).max_sliding_disp,
            decoupled=decoupled_slip(driving, mass * same, mass, dt).slip[-1],
            decoupled_pyslammer=pyslammer.Decoupled(k_y, motion, **ground).max_sliding_disp,
            decoupled_same_drive=rigid_slip(average, same, dt).slip[-1],
            coupled=march(driving, mass * same, weights, dt).slip[-1],
            coupled_pyslammer=pyslammer.Coupled(k_y, motion, **ground).max_sliding_disp,
            elastoplastic=elastoplastic_column(GROUND, drive, dt, same, substeps=2)[-1],
        )


def _force_over_drive(column: Column, s: ComplexArray) -> ComplexArray:
    """L − s²(Mφ)ᵀA⁻¹Mr with φ = r, which is Q̂_lin/â and P; shape of s."""
    M, K = column.mass, column.stiffness
    seam = np.zeros_like(K)
    seam[0, 0] = column.seam_stiffness
    z = s[:, None, None]
    A = z**2 * np.diag(M) + (1 + z * column.beta) * K + seam
    w = np.linalg.solve(A, M[:, None])[..., 0]
    return np.asarray(M.sum() - s**2 * (w @ M))


def _linear_force(column: Column, drive: RealArray, dt: float) -> RealArray:
    """Q_lin on a damped contour [N/m^2], shape of the drive."""
    period = _PERIODS * drive.size
    eta = -np.log(_DECAY) / (period * dt)
    s = eta + 2j * np.pi * np.fft.rfftfreq(period, dt)
    time = dt * np.arange(drive.size)
    transform = np.fft.rfft(drive * np.exp(-eta * time), period)
    force = np.fft.irfft(_force_over_drive(column, s) * transform, period)[: drive.size]
    return np.asarray(force * np.exp(eta * time))


def agreement(rows: Sequence[Slips], found: str, reference: str) -> tuple[float, float]:
    """The least and the largest ratio of two slips.

    Args:
        rows: The slips.
        found: A field of them.
        reference: Another one.

    Returns:
        [-].
    """
    ratios = [getattr(row, found) / getattr(row, reference) for row in rows]
    return min(ratios), max(ratios)


def write(path: Path, rows: Sequence[Slips]) -> None:
    """Write slips as CSV, a row each."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Slips)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def draw(path: Path, rows: Sequence[Slips]) -> None:
    """Draw slips over k_y/k_max as PNG, a panel a record."""
    names = list(dict.fromkeys(row.record for row in rows))
    with figure_style():
        figure = Figure(figsize=(11.0, 8.0))
        panels = figure.subplots(-(-len(names) // 2), 2, squeeze=False).ravel()
        for axes, name in zip(panels, names, strict=False):
            _panel(axes, name, [row for row in rows if row.record == name])
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        save(figure, path)


def _panel(axes: Axes, name: str, rows: Sequence[Slips]) -> None:
    x = [row.yield_over_peak for row in rows]
    for colour, kind in zip(COLOURS, ("rigid", "decoupled", "coupled"), strict=False):
        axes.plot(x, [getattr(row, kind) for row in rows], color=colour, label=kind)
        theirs = [getattr(row, f"{kind}_pyslammer") for row in rows]
        text = f"{kind}, pyslammer"
        axes.plot(x, theirs, "o", color=colour, markerfacecolor="none", markersize=7, label=text)
    marched = [row.elastoplastic for row in rows]
    axes.plot(x, marched, "x", color=INK, markersize=6, label="elastoplastic seam, in time")
    axes.set_yscale("log")
    axes.set_title(name.replace("_", " "))
    axes.set_xlabel("$k_y / k_{max}$")
    axes.set_ylabel("Slip [m]")
