# SPDX-License-Identifier: MIT
"""A result that was changed by hand: found out before anything is drawn, exported or believed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.results_builder import DEGRADES, make_result, make_slide

from fenics_hytf.results import open_result, publish
from fenics_hytf.results.report import document
from fenics_hytf.results.schema import summary_faults
from fenics_hytf.results.summary import summarise
from fenics_hytf.scene import Scene

SCENE = """
[mesh]
column = { width = 1.0, layers = [ { thickness = 8.0, soil = "sand", cells = 4 } ] }
[soil.sand]
density = 1800.0
shear_wave_velocity = 160.0
poisson = 0.3
damping = 0.05
[[motion]]
direction = "x"
harmonic = { amplitude = 1.0, frequency = 2.0, cycles = 1, samples = 32 }
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A finished result of four lapses with pictures of before, in ``r``."""
    monkeypatch.chdir(tmp_path)
    with open_result(Path("r")) as folder:
        folder.write(make_result(lapses=4))
    Path("r/histories_x.png").write_text("before")
    Path("r/report.html").write_text("before")
    return tmp_path


def contents():
    return {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}


def replace_lines(name, change):
    path = Path("r", f"{name}.csv")
    path.write_text("".join(change(path.read_text().splitlines(keepends=True))))


def without_column(lines):
    return [line.rpartition(",")[0] + "\n" for line in lines]


def with_word(lines):
    return [*lines[:-1], lines[-1].rpartition(",")[0] + ",none\n"]


TABLES = [
    ("receivers", lambda lines: lines[:-50], "found 190 rows; expected 240, as summary.json says"),
    ("receivers", lambda lines: lines + lines[-1:], "found 241 rows; expected 240"),
    ("receivers", without_column, 'found no column "r2.A_y"; expected the 25 columns'),
    ("receivers", with_word, "found a value that is no finite number in the column r2.A_y"),
    ("base", lambda lines: lines[:1], "found 0 rows; expected 240"),
    ("base", lambda lines: ["time_s,time_s\n"], "two columns of the same name"),
]
DRAWN = [
    ("transfer", lambda lines: [], 'found no column "frequency_hz"'),
    ("transfer", lambda lines: lines[:-1], "found 59 rows of lapse 3; expected 60"),
    ("spectra", lambda lines: lines[:9], "found 8 rows; expected"),
    ("cells", lambda lines: lines[:15], "found 0 rows of lapse 1; expected 14"),
    ("cells", lambda lines: [*lines, "9" + lines[-1][1:]], "found 1 rows of other lapses"),
    ("cells", lambda lines: [*lines[:-1], "3,inf" + lines[-1][4:]], "in the column cell"),
]


@pytest.mark.parametrize(
    ("command", "table", "change", "words"),
    [(c, *case) for c in ("plot", "export") for case in TABLES] + [("plot", *i) for i in DRAWN],
)
def test_a_table_that_is_not_the_one_of_its_summary(here, hytf, command, table, change, words):
    replace_lines(table, change)
    before = contents()
    code, out, err = hytf(command, "r")
    assert (code, out) == (2, "") and f"{table}.csv" in err and words in err, err
    assert "Run the scene again" in err and contents() == before


SUMMARIES = {
    'lapses: found "a"; expected a list': {"lapses": "a"},
    "duration_s: found nan; expected a finite number": {"duration_s": float("nan")},
    "duration_s: found inf; expected a finite number": {"duration_s": float("inf")},
    "dt_s: found 0; expected greater than 0": {"dt_s": 0},
    "base: found null; expected a table": {"base": None},
    "scene.soils: found [7]; expected a table": {"scene": {"soils": [7]}},
    "wall_s.setup: found nan; expected a finite number": {"wall_s": {"setup": float("nan")}},
    "lapses[0].layers[0].damping[1]: found true; expected a number": {
        "lapses": {0: {"layers": {0: {"damping": {1: True}}}}}
    },
    "lapses: found the indices [0, 1, 7, 3]; expected one after the other from 0": {
        "lapses": {2: {"index": 7}}
    },
    "lapses[1].change: found 0 values; expected one for each of 4": {"lapses": {1: {"change": []}}},
    'directions[0]: found "../x"; expected a name of letters, digits, _ and -': {
        "directions": ["../x"]
    },
    'peaks: found []; expected ["r0", "r1", "r2"]': {"peaks": {}},
}


def change(value, changes):
    for key, new in changes.items():
        if isinstance(new, dict) and new:
            change(value[key], new)
        else:
            value[key] = new


@pytest.mark.parametrize("command", [("plot", "r"), ("export", "r"), ("run", "s.toml")])
@pytest.mark.parametrize("words", SUMMARIES)
def test_a_summary_that_no_run_writes_is_told_by_its_key(here, hytf, words, command):
    """Naively a run that is gone on with believes it, and plot tells an error of Python."""
    summary = json.loads(Path("r/summary.json").read_text())
    change(summary, SUMMARIES[words])
    if command[0] == "run":
        command = (*command, "-o", "r", "--resume")
        Path("s.toml").write_text(SCENE)
        summary["scene_hash"] = Scene.load(Path("s.toml")).hash
    Path("r/summary.json").write_text(json.dumps(summary))
    before = contents()
    code, out, err = hytf(*command)
    assert (code, out) == (2, "") and f"(summary.json, {words}" in err, err
    assert contents() == before


def test_figures_are_put_in_place_together(here, hytf, monkeypatch):
    """Naively the figures before the one that fails are new, and the report is old."""

    def fail(summary):
        raise KeyError("a value that nothing looks at")

    monkeypatch.setattr(document, "work_section", fail)
    before = contents()
    code, out, err = hytf("plot", "r")
    assert (code, out) == (2, "") and "its values do not belong together" in err
    assert "KeyError" not in err and contents() == before
    monkeypatch.undo()
    written = publish(here / "r")
    assert {"histories_x.png", "profiles.png", "report.html"} <= set(written)
    assert all((here / "r" / name).read_bytes() != b"before" for name in written)


@pytest.mark.parametrize(
    "result",
    [
        lambda: make_result(directions=("x", "y"), compliant=True, kind="box", loop=False),
        lambda: make_result(directions=("z",), receivers=0),
        lambda: make_result(gdim=3, kind="box", lapses=2),
        lambda: make_result(
            lapses=2, continuity="transient", solver={"complex_modulus": "maxwell"}
        ),
        lambda: make_result(lapses=2, effects=DEGRADES),
        lambda: make_slide(end_rate=0.1),
    ],
)
def test_what_runs_write_is_sound(result):
    assert summary_faults(json.loads(json.dumps(summarise(result())))) == []
