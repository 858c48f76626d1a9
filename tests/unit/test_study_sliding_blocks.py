# SPDX-License-Identifier: MIT
"""Rigid, decoupled and coupled slips of a record, beside those of pyslammer and a march in time."""

import csv

import numpy as np
import pytest

from fenics_hytf.motion import recorded
from fenics_hytf.study.sliding_blocks import agreement, draw, slips, write

NAME = "Northridge_1994_PAC-175"


@pytest.fixture(scope="module")
def rows():
    pytest.importorskip("pyslammer", reason="pyslammer, an optional extra")
    return list(slips(recorded(NAME), (0.1, 0.4, 0.8), step=0.005))


def off(rows, *pair) -> float:
    return max(abs(ratio - 1) for ratio in agreement(rows, *pair))


def test_blocks_under_one_drive(rows, figure):
    """One law, two integrators: at 5 ms they differ by where a slide starts and stops."""
    # a few samples of a hundred, which is what a slide of half a second has
    figure("rigid block and pyslammer's at 5 ms", off(rows, "rigid", "rigid_pyslammer"), 0.015)
    pair = ("decoupled_same_drive", "decoupled_pyslammer")
    # its decoupled block is integrated exactly between samples
    figure("decoupled block and pyslammer's at 5 ms", off(rows, *pair), 0.005)


def test_columns(rows, figure):
    """The column's slip is that of the march in time; one mode alone is not."""
    # 5 ms are short enough for 5 %, the limit of sliding columns; here the waves are longer
    figure("coupled slip and the elastoplastic seam", off(rows, "coupled", "elastoplastic"), 0.015)
    one_mode = off(rows, "coupled_pyslammer", "elastoplastic")
    figure("pyslammer's coupled slip and the elastoplastic seam", one_mode, 0.3)
    assert one_mode > 0.1
    slip = np.array([[row.rigid, row.decoupled, row.coupled] for row in rows])
    assert (np.diff(slip, axis=0) < 0).all()  # less, the more it takes to yield


def test_what_is_written(rows, tmp_path):
    write(tmp_path / "a.csv", rows)
    read = list(csv.DictReader((tmp_path / "a.csv").read_text().splitlines()))
    assert [float(row["coupled"]) for row in read] == [row.coupled for row in rows]
    assert {row["record"] for row in read} == {NAME}
    draw(tmp_path / "a.png", rows)
    assert (tmp_path / "a.png").stat().st_size > 10_000
