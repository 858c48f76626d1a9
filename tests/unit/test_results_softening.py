# SPDX-License-Identifier: MIT
"""What is written and told of ground that softens for good: an estimate, apart from vibration."""

import json
from dataclasses import replace

import numpy as np
import pytest
from support.results_builder import make_result

from fenics_hytf.cli.closing import closing_words
from fenics_hytf.lapse import SofteningResult
from fenics_hytf.results import read_table
from tests.unit.test_results_report import text_of

EFFECTS = {"equivalent_linear": True, "gravity": True, "softening": True}


def softened():
    """Two lapses: after the second G is 0.4 of its small-strain value, receivers have moved."""
    result = make_result(lapses=2, effects=EFFECTS)
    lapses = []
    for lapse, (least, moved) in zip(result.lapses, ((0.6, 0.02), (0.4, 0.05)), strict=True):
        softest = np.linspace(least, 1.0, len(lapse.cells.region))
        told = SofteningResult(softest, np.outer([1.0, 0.5, 0.0], [moved, -moved / 5]), 1.1 * moved)
        lapses.append(replace(lapse, softening=told))
    return replace(result, lapses=tuple(lapses))


def test_every_place_tells_it_apart_and_what_it_is(tmp_path):
    result = softened()
    page = text_of(result, tmp_path / "r")
    summary = json.loads((tmp_path / "r/summary.json").read_text(encoding="utf-8"))
    told = summary["softening"]
    assert told == summary["lapses"][1]["softening"] != summary["lapses"][0]["softening"]
    assert told["softest"] == 0.4 and told["largest_m"] == pytest.approx(0.055)
    assert told["receivers_m"] == {"r0": [0.05, -0.01], "r1": [0.025, -0.005], "r2": [0.0, 0.0]}
    assert "no law of displacement" in told["note"]

    assert "given way by 0.0550 m" in page and "down to 0.400 of the small-strain one" in page
    assert "Permanent displacement of the receivers, estimated." in page
    assert "τ₀(1/G_min − 1/G₀)" in page
    assert page.count("no law of displacement") == 1
    assert "permanent displacement up to 0.055 m" in closing_words(summary, tmp_path, True)

    table = read_table(tmp_path / "r/cells.csv")
    for lapse in result.lapses:
        here = table["lapse"] == lapse.index
        np.testing.assert_allclose(table["softest"][here], lapse.softening.softest)


def test_ground_that_does_not_soften_says_nothing_of_it(tmp_path):
    page = text_of(make_result(), tmp_path / "r")
    summary = json.loads((tmp_path / "r/summary.json").read_text(encoding="utf-8"))
    assert summary["softening"] is summary["lapses"][0]["softening"] is None
    assert "ermanent displacement" not in page
    assert "softest" not in read_table(tmp_path / "r/cells.csv")
    assert "softening" not in closing_words(summary, tmp_path, True)
