# SPDX-License-Identifier: MIT
"""Scenes, meshes, records, checkpoints and results from anywhere: read as data, never run.

What a file says stays text: it is no code, no path out of the result's folder, no markup in the
report, no formula of matplotlib. That pickles in a checkpoint are not loaded is in
``unit/test_checkpoint.py``.
"""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import zipfile
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import meshio
import pytest
from support.fuzz import toml
from support.meshes import SOIL, gmsh_section
from support.peaks import MIB, at_most_more
from support.results_builder import make_result, make_scene

from fenics_hytf.motion import RecordError, recorded
from fenics_hytf.results import open_result, publish, read_result
from fenics_hytf.results.report.document import report
from fenics_hytf.scene import Scene, SceneError
from fenics_hytf.simulation import CheckpointError
from fenics_hytf.simulation.checkpoint import (
    FILE,
    FORMAT,
    read_checkpoint,
    take_checkpoint,
    write_checkpoint,
)

EVIL = "<script>alert(1)</script>&\"'"
FORMULA = "$x^{2$ \\frac{1 $ %s {0} \u202e"  # that matplotlib would trip over
SCENE = """
title = "A box"
[mesh]
box = { size = [2.0, 8.0], cells = [1, 4] }
[soil.sand]
density = 1800.0
shear_wave_velocity = 160.0
poisson = 0.3
damping = 0.05
[[motion]]
direction = "x"
harmonic = { amplitude = 1.0, frequency = 2.0, cycles = 1, samples = 32 }
[boundary]
left = "tied"
right = "tied"
[output]
receivers = { top = [0.5, 8.0] }
fields = true
"""


@pytest.fixture
def here(here, monkeypatch):
    place = here / "a/b"  # so that ../.. is seen too
    place.mkdir(parents=True)
    monkeypatch.chdir(place)
    Path("s.toml").write_text(SCENE)
    return place


def tree(top: Path) -> set[str]:
    return {str(path.relative_to(top)) for path in top.rglob("*")}


# ---------------------------------------------------------------- checkpoints


def npy(shape: str, data: bytes = b"", kind: str = "<f8") -> bytes:
    """An array file whose head claims what it likes."""
    head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    head += b" " * (-(len(head) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head + data


def sealed(members: list[tuple[str, bytes]], squeeze: int = zipfile.ZIP_STORED) -> bytes:
    """An archive with these members, with the digest that belongs to it."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", squeeze) as archive:
        archive.comment = b"0" * 64
        for name, content in members:
            archive.writestr(zipfile.ZipInfo(name), content, squeeze)
    body = file.getvalue()[:-64]
    return body + hashlib.sha256(body).hexdigest().encode()


EIGHT = npy("(1,)", bytes(8))
META = {
    "format": FORMAT,
    "lapse": 0,
    "num_lapses": 2,
    "ranks": 1,
    "group_size": 1,
    "versions": {},
    "decides": {},
    "state": {},
}
HEAD = ("meta.json", json.dumps(META).encode())
ARCHIVES = {
    "a shape beyond all memory": ([HEAD, ("x.npy", npy(f"({10**15},)"))], "claims a shape"),
    "a shape that overflows": ([HEAD, ("x.npy", npy(f"({2**40}, {2**40})"))], "claims a shape"),
    "negative shapes": ([HEAD, ("x.npy", npy("(-1, -1)", bytes(8)))], "no checkpoint"),
    "code for a shape": ([HEAD, ("x.npy", npy("__import__('os').mkdir('x')"))], "no checkpoint"),
    "objects": ([HEAD, ("x.npy", npy("(1,)", b"cos\nabort\n(tR.", "|O"))], "no checkpoint"),
    "a path out": ([HEAD, ("../../out.npy", EIGHT)], "that no run writes"),
    "an absolute path": ([HEAD, ("/tmp/hytf-out.npy", EIGHT)], "at an absolute place"),
    "two of a name": ([HEAD, ("x.npy", EIGHT), ("x.npy", EIGHT)], "two members"),
    "two heads": ([HEAD, HEAD], "two members"),
    "no head": ([("x.npy", EIGHT)], "no checkpoint"),
    "deep brackets": ([("meta.json", b"[" * 200_000)], "no checkpoint"),
    "deep tables": ([("meta.json", b'{"a":' * 200_000)], "no checkpoint"),
    "a huge number": ([("meta.json", b'{"format": ' + b"9" * 10_000 + b"}")], "no checkpoint"),
    "a program": ([HEAD, ("run.py", b"import os; os.mkdir('x')")], "that no run writes"),
}


def test_an_archive_that_does_not_lie_is_read(tmp_path):
    (tmp_path / FILE).write_bytes(sealed([HEAD, ("a/x.npy", npy("(2, 1)", bytes(16)))]))
    found = read_checkpoint(tmp_path)
    assert found.meta == META and found.arrays["a/x"].tolist() == [[0.0], [0.0]]


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("case", ARCHIVES)
def test_an_archive_that_lies_is_refused_and_writes_nothing(here, hytf, case):
    """With a digest that fits: whoever made it knew how."""
    members, words = ARCHIVES[case]
    place = Path("s-result/checkpoint")
    place.mkdir(parents=True)
    (place / FILE).write_bytes(sealed(members))
    before = tree(here.parents[1])
    with at_most_more(100 * MIB):
        code, out, error = hytf("run", "s.toml", "--resume", "--no-plots")
    assert (code, out) == (2, "") and words in error and "--force instead of --resume" in error
    assert tree(here.parents[1]) == before and not Path("/tmp/hytf-out.npy").exists()


@pytest.mark.parametrize("name", ["x.npy", "meta.json"])
def test_what_is_squeezed_is_refused_before_it_swells(tmp_path, name):
    """A bomb: 256 MiB of nothing in 256 KiB."""
    content = npy(f"({2**25},)") if name == "x.npy" else b'{"a": "'
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.comment = b"0" * 64
        if name != "meta.json":
            archive.writestr(*HEAD)
        with archive.open(name, "w", force_zip64=True) as member:
            member.write(content)
            for _ in range(64):
                member.write(bytes(2**22))
    body = file.getvalue()[:-64]
    (tmp_path / FILE).write_bytes(body + hashlib.sha256(body).hexdigest().encode())
    with at_most_more(100 * MIB), pytest.raises(CheckpointError, match="a squeezed member"):
        read_checkpoint(tmp_path)
    with pytest.raises(AssertionError, match="MiB more"), at_most_more(100 * MIB):  # naively
        zipfile.ZipFile(tmp_path / FILE).read(name)


def test_a_checkpoint_whose_state_is_not_what_it_should_be_is_refused(here, hytf):
    """Whole and of this scene, but tampered with and sealed again."""
    taken = take_checkpoint(Scene.load("s.toml"), 0, 1, 1, {})
    place = Path("s-result/checkpoint")
    for harm in (
        {"state": {"lapses": "x", "work": 3}},
        {"state": []},
        {"lapse": "x"},
        {"lapse": -5},
        {"ranks": None},
        {"group_size": "1"},
        {"versions": 7},
        {"decides": None},
    ):
        shutil.rmtree("s-result", ignore_errors=True)
        write_checkpoint(place, {**taken.meta, **harm}, taken.arrays)
        code, _, error = hytf("run", "s.toml", "--resume", "--no-plots", "--quiet")
        assert code == (3 if harm.get("state") else 2) and "--force" in error, (harm, error)


# ---------------------------------------------------------------- scenes, meshes, records

NAMES = [
    "../../x",
    "a/b",
    "/etc/x",
    "..",
    "a\u0000b",
    "a\nb",
    "long" * 100,
    EVIL,
    "\u202egnp.exe",
    "=cmd()",
    "$x^{2$",
    "__import__('os')",
]


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_a_name_is_never_a_path_nor_a_command(here, name):
    """Receivers are in names of columns and of exported files: letters, digits, _ and - alone."""
    named = {**Scene.load("s.toml").data, "output": {"receivers": {name: [0.5, 8.0]}}}
    with pytest.raises(SceneError, match="a name of letters, digits, _ and - only, at most 50"):
        Scene.from_dict(named)


def test_the_longest_name_is_a_file_s(here, hytf):
    """Naively a run is done, and only then its motions find no name that the disk takes."""
    name = 50 * "\U00010300"  # a letter of four bytes
    Path("s.toml").write_text(SCENE.replace("top = ", f'"{name}" = '), encoding="utf-8")
    assert hytf("run", "s.toml", "--quiet", "--no-plots")[0] == 0
    longest = ("--quantity", "displacement", "--format", "csv")
    assert hytf("export", "s-result", *longest)[0] == 0
    assert Path(f"s-result-motions/{name}_x_displacement.csv").exists()


HARMLESS = [name for name in NAMES if not set(name) & set('\u0000\n,"')]


@pytest.mark.parametrize("name", HARMLESS, ids=range(len(HARMLESS)))
def test_titles_soils_and_boundaries_of_any_name_stay_text(here, hytf, name):
    """Soils and titles may be called anything: they go into tables, figures and the report."""
    before = tree(here.parents[1])
    quoted = json.dumps(name)
    text = SCENE.replace('"A box"', quoted).replace("[soil.sand]", f"[soil.{quoted}]")
    Path("s.toml").write_text(text, encoding="utf-8")
    code, _, error = hytf("run", "s.toml", "--quiet", "--no-plots")
    assert code == 0, error
    left = tree(here.parents[1]) - before
    assert all(path.startswith("a/b/s-result") for path in left)
    assert json.loads(Path("s-result/summary.json").read_text())["title"] == name
    for path in Path("s-result").glob("*.vtu"):
        assert len(meshio.read(path).points)


def test_a_formula_for_a_spreadsheet_stays_a_soil_s_name(here, hytf):
    """Tables are for programs that read numbers: a name is written as it is, and read back so."""
    name = "=HYPERLINK(A1)"
    Path("s.toml").write_text(SCENE.replace("[soil.sand]", f'[soil."{name}"]'))
    assert hytf("run", "s.toml", "--quiet", "--no-plots")[0] == 0
    rows = Path("s-result/cells.csv").read_text().splitlines()
    assert all(row.split(",")[2] == name for row in rows[1:])


@pytest.mark.parametrize("depth", [500, 100_000])
@pytest.mark.parametrize(("start", "end"), [("[", "]"), ("{a=", "}")])
def test_a_scene_of_nothing_but_brackets(here, hytf, depth, start, end):
    Path("s.toml").write_text(f"title = {start * depth}1{end * depth}\n{SCENE[20:]}")
    code, out, error = hytf("check", "s.toml")
    assert (code, out) == (2, "") and len(error) < 3000


def test_a_script_of_gmsh_is_no_mesh(here, hytf):
    """gmsh would run it: SystemCall is one of its commands."""
    for name in ("slope.geo", "slope.msh", "slope.geo_unrolled"):
        Path(name).write_text('SystemCall "touch trapped";\nPoint(1) = {0, 0, 0};\n')
        Path("m.toml").write_text(
            SCENE.replace("box = { size = [2.0, 8.0], cells = [1, 4] }", f'file = "{name}"')
        )
        code, _, error = hytf("check", "m.toml")
        assert code == 2 and "mesh.file: found" in error and "not readable" in error
        assert not Path("trapped").exists()


def test_entities_of_a_mesh_in_xml_do_not_swell(here, hytf):
    bomb = '<!ENTITY a0 "' + 1000 * "x" + '">'
    for i in range(1, 10):
        bomb += f'<!ENTITY a{i} "{10 * f"&a{i - 1};"}">'
    secret = here / "secret"
    secret.write_text("what is in it")
    bomb += f'<!ENTITY f SYSTEM "file://{secret}">'
    for entity in ("a9", "f"):
        text = f'<?xml version="1.0"?><!DOCTYPE V [{bomb}]><VTKFile>&{entity};</VTKFile>'
        Path("m.vtu").write_text(text)
        Path("m.toml").write_text(
            SCENE.replace("box = { size = [2.0, 8.0], cells = [1, 4] }", 'file = "m.vtu"')
        )
        with at_most_more(100 * MIB):
            code, _, error = hytf("check", "m.toml")
        assert code == 2 and "not readable" in error and "what is in it" not in error


def test_a_recorded_motion_is_one_of_the_suite(here):
    Path("x.csv").write_text("0.1\n0.2\n")
    for name in ("../x", str(here / "x"), "x", "..", ""):
        with pytest.raises(RecordError):
            recorded(name)


# ---------------------------------------------------------------- the report


class Page(HTMLParser):
    """Elements, attributes and text of a page."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements: list[str] = []
        self.attributes: set[tuple[str, str]] = set()
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.elements.append(tag)
        self.attributes |= {(tag, name) for name, _ in attributes}

    def handle_data(self, data):
        self.text += data


NAMED = ("soils", "boundary", "receivers", "peaks", "intensity")
"""Tables of a summary whose keys are names that someone chose."""


def poisoned(value: object, table: str = "") -> object:
    """Part of a summary in which every text and every chosen name has markup at its end."""
    if isinstance(value, str):
        return value + EVIL
    if isinstance(value, list):
        return [poisoned(part) for part in value]
    if isinstance(value, dict):
        tail = EVIL if table in NAMED else ""
        return {key + tail: poisoned(part, key) for key, part in value.items()}
    return value


def test_no_text_of_a_scene_becomes_markup(tmp_path):
    """Title and soils, in tables and figures: with a script, and half a formula."""
    scene = make_scene(loop=True)
    data = json.loads(json.dumps(scene.data))
    data["title"] = f"{EVIL} {FORMULA}"
    tail = f"{EVIL} {FORMULA}".replace('"', "")
    soils = {f"{name}{tail}": soil for name, soil in data["soil"].items()}
    data["soil"] = soils
    names = list(soils)
    for layer, name in zip(data["mesh"]["column"]["layers"], names, strict=True):
        layer["soil"] = name
    result = make_result(loop=True)
    result = replace(result, scene=type(scene).from_dict(data), region_names=tuple(names))
    with open_result(tmp_path / "r") as folder:
        folder.write(result, publish)
    page = Page((tmp_path / "r/report.html").read_text(encoding="utf-8"))
    assert "script" not in page.elements and EVIL in page.text
    assert all(name in page.text for name in names)


def test_no_name_of_a_mesh_nor_line_of_a_record_becomes_markup(here, hytf):
    """Regions and sides of a mesh file; a record's file and its header, from another's archive."""
    tail = EVIL.replace('"', "")  # which ends a name in a mesh file
    clay, side = f"clay{tail}", f"left{tail}"
    groups = {clay: (2, [1]), "sand": (2, [2]), "base": (1, [1]), side: (1, [4, 7])}
    gmsh_section(here / "m.msh", groups=groups)
    record = f"{tail.replace('/', '')}.at2"
    size = "NPTS= 16, DT= 0.05 SEC"
    lines = (f"title{EVIL}", f"station{EVIL}", f"ACCELERATION IN UNITS OF G {EVIL}", size)
    Path(record).write_text("\n".join((*lines, *(f"{(-1) ** i}e-2" for i in range(16)))))
    scene = {
        "mesh": {"file": "m.msh"},
        "soil": dict.fromkeys((clay, "sand"), SOIL),
        "boundary": {side: "dashpot"},
        "motion": [{"direction": "x", "file": record}],
    }
    Path("s.toml").write_text(toml.document(scene))
    code, _, error = hytf("run", "s.toml", "--quiet", "--no-plots")
    assert code == 0, error
    page = Page(report(read_result(Path("s-result")), []))
    assert not {"script", "b"} & set(page.elements)
    assert all(name in page.text for name in (clay, side, Path(record).stem))


TEXTS = ["title", "warnings", "motions", "scene", "versions", "written", "effects", "lapses"]
TEXTS += ["receivers peaks intensity"]


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A result on rock, to be read, or copied and tampered with."""
    place = tmp_path_factory.mktemp("made") / "r"
    with open_result(place) as folder:
        folder.write(make_result(kind="box", compliant=True))
    return place


@pytest.mark.parametrize("parts", TEXTS)
def test_no_text_of_a_summary_becomes_markup(made, parts):
    """What a result from elsewhere says, wherever it says it: the page has the same elements."""
    stored = read_result(made)
    stored.summary["warnings"] = ["a warning"]
    clean = Page(report(stored, []))
    for part in parts.split():
        stored.summary[part] = poisoned(stored.summary[part], part)
    page = Page(report(stored, []))
    assert page.elements == clean.elements and page.attributes == clean.attributes
    assert "alert(1)" in page.text


# ---------------------------------------------------------------- results from elsewhere


HARMS = {
    "receivers that are paths": lambda s: s | {"receivers": {"../../x": {"place_m": [0, 0]}}},
    "no lapses": lambda s: {k: v for k, v in s.items() if k != "lapses"},
    "lapses that are words": lambda s: s | {"lapses": "many"},
    "a scene that is a number": lambda s: s | {"scene": 7},
    "numbers that are words": lambda s: s | {"dt_s": "x", "directions": 3},
    "directions that are paths": lambda s: s | {"directions": ["../../x"]},
    "peaks of others": lambda s: s | {"peaks": {"../y": {}}},
    "nothing": lambda s: {"format": s["format"]},
    "motions without names": lambda s: s | {"motions": [{}]},
    "sliding that is none": lambda s: s | {"sliding": {"slip_m": "x"}},
}


@pytest.mark.parametrize("command", ["plot", "export"])
@pytest.mark.parametrize("harm", HARMS)
def test_a_result_that_was_tampered_with_is_refused(here, hytf, made, command, harm):
    shutil.copytree(made, "r")
    summary = json.loads(Path("r/summary.json").read_text())
    Path("r/summary.json").write_text(json.dumps(HARMS[harm](summary)))
    before = tree(here.parents[1])
    code, out, error = hytf(command, "r")
    assert (code, out) == (2, "") and error.startswith("hytf: r: found a result that cannot be")
    assert "summary.json, " in error and tree(here.parents[1]) == before


@pytest.mark.parametrize("command", ["plot", "export"])
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"[]",
        b"{",
        b'{"format": NaN}',
        b"\xff\xfe",
        b"[" * 100_000,
        b'{"a":' * 100_000,
        b"9" * 10_000,
    ],
    ids=range(8),
)
def test_a_summary_that_is_none_is_refused(here, hytf, command, content):
    Path("r").mkdir()
    Path("r/summary.json").write_bytes(content)
    code, out, error = hytf(command, "r")
    assert (code, out) == (2, "") and "found a result that cannot be read" in error
    assert tree(here) == {"r", "r/summary.json", "s.toml"}


@pytest.mark.parametrize("command", ["plot", "export"])
@pytest.mark.parametrize("table", ["receivers", "base"])
@pytest.mark.parametrize("content", [None, b"", b"time_s\n", b"\xff\n1\n", b"a,b\n1\n", b"a\nx\n"])
def test_a_table_that_is_missing_or_none_is_refused(here, hytf, made, command, table, content):
    shutil.copytree(made, "r")
    path = Path("r", f"{table}.csv")
    path.unlink()
    if content is not None:
        path.write_bytes(content)
    code, out, error = hytf(command, "r")
    assert (code, out) == (2, "") and error.startswith("hytf: r: found"), error
