# SPDX-License-Identifier: MIT
"""Scenes that are valid by construction: small ones, of every mesh, effect, base, side and law.

The rules that a scene has to keep are written here a second time, on purpose: a rule of the package
that refuses more than it should is found by a scene that keeps all of these.
"""

from dataclasses import dataclass, field
from typing import Any

from hypothesis import strategies as st

from fenics_hytf.scene import allowed_points_per_cell
from support.fuzz.meshes import Drawn
from support.fuzz.records import Files, motions, numbers, recorded
from support.fuzz.soils import soils

_CELLS = {2: ("quadrilateral", "triangle"), 3: ("hexahedron", "tetrahedron")}
_HELD = ("fixed", "rigid")
_MOST_DAMPING = {"dormieux": 0.49, "shake91": 0.7}


@dataclass
class Case:
    """A scene with the files beside it, and the mesh that it is of.

    Attributes:
        data: The raw table.
        files: Content of each file by its name.
        mesh: What the mesh file is called among those drawn, or ``None``.
    """

    data: dict[str, Any]
    files: Files = field(default_factory=dict, repr=False)
    mesh: str | None = None


@dataclass
class _Ground:
    """What the rest of a scene has to know of its mesh."""

    table: dict[str, Any]
    cell: str
    soils: tuple[str, ...]
    sides: tuple[str, ...]
    size: tuple[float, ...]
    tied: bool
    level: bool
    mesh: str | None = None

    @property
    def gdim(self) -> int:
        return len(self.size)


@dataclass
class _Choices:
    """What sections have to agree on."""

    antiplane: bool
    slides: bool
    softens: bool
    several: bool
    transient: bool
    law: str | None
    outcrop: bool
    compliant: bool
    loop: bool

    @property
    def causal(self) -> bool:
        """Whether the law is Maxwell's, by name or by default."""
        return self.law == "maxwell" or (
            self.law is None and ((self.transient and self.several) or self.slides)
        )


@st.composite
def scenes(draw: st.DrawFn, drawn: dict[str, Drawn]) -> Case:
    """A scene without a fault.

    Args:
        draw: From hypothesis.
        drawn: Mesh files by name.

    Returns:
        The scene; its mesh file, if it has one, is among its files.
    """
    case = Case({})
    ground = draw(_grounds(drawn))
    if ground.mesh is not None:
        file = drawn[ground.mesh]
        case.mesh, case.files[ground.table["file"]] = ground.mesh, file.content
    choices = draw(_choices(ground))
    directions = draw(_directions(ground, choices))
    kind = "outcrop" if choices.outcrop else "within"
    if "column" in ground.table and not choices.slides and draw(st.integers(0, 39)) == 0:
        tables = draw(recorded(directions[0], kind))
        directions = directions[:1]
    else:
        tables = draw(motions(directions, kind, case.files))
    most = _MOST_DAMPING.get(choices.law or "", 0.99)
    named = {}
    for i, name in enumerate(ground.soils):
        curved = choices.loop and i == 0
        named[name] = draw(soils(curved, choices.slides, most, case.files, f"curves{i}.csv"))
    boundary = draw(_boundaries(ground, choices))
    effects = draw(_effects(ground, choices, boundary))
    sections = {
        "mesh": ground.table,
        "soil": named,
        "motion": tables,
        "boundary": boundary,
        "lapses": draw(_lapses(choices)),
        "effects": effects,
        "points": draw(_points()),
        "solver": draw(_solvers(choices)),
        "output": draw(_outputs(ground)),
    }
    title = draw(st.sampled_from((None, "a scene", 'Größe <b>&amp;</b> "1"')))
    case.data = {"title": title} if title is not None else {}
    case.data |= {name: section for name, section in sections.items() if section}
    return case


@st.composite
def _grounds(draw: st.DrawFn, drawn: dict[str, Drawn]) -> _Ground:
    kind = draw(st.sampled_from(("column", "column", "section", "section", "solid", "file")))
    names = tuple(f"soil{i}" for i in range(draw(st.integers(1, 3))))
    if kind == "column":
        ground = draw(_columns(names))
    elif kind == "file":
        name = draw(st.sampled_from(sorted(drawn)))
        file = drawn[name]
        table: dict[str, Any] = {"file": f"mesh{file.suffix}"}
        if file.empty:
            table["empty"] = list(file.empty)
        level, tied = name != "a slope", file.tied
        ground = _Ground(table, file.cell, file.soils, file.sides, file.size, tied, level, name)
    else:
        ground = draw(_boxes(names, 2 if kind == "section" else 3))
    table = ground.table
    degree = draw(st.sampled_from((1, 1, 2))) if ground.gdim == 2 else 1
    if ground.gdim == 3 and draw(st.integers(0, 5)) == 0:
        degree = 2
    if degree == 2 or draw(st.booleans()):
        table["degree"] = degree
    if draw(st.integers(0, 3)) == 0:
        counts = allowed_points_per_cell(ground.cell, degree)
        table["points_per_cell"] = draw(st.sampled_from(counts[:3]))
    if ground.gdim == 2 and draw(st.booleans()):
        table["kinematics"] = draw(st.sampled_from(("plane_strain", "antiplane")))
    return ground


@st.composite
def _columns(draw: st.DrawFn, names: tuple[str, ...]) -> _Ground:
    layers = [
        {"thickness": draw(numbers(0.5, 8)), "soil": name, "cells": draw(st.integers(1, 3))}
        for name in names
    ]
    width = draw(numbers(0.5, 4))
    size = (width, sum(layer["thickness"] for layer in layers))
    table = {"column": {"width": width, "layers": layers}}
    return _Ground(table, "quadrilateral", names, ("left", "right"), size, True, True)


@st.composite
def _boxes(draw: st.DrawFn, names: tuple[str, ...], gdim: int) -> _Ground:
    most = 4 if gdim == 2 else 2
    cells = [draw(st.integers(1, most)) for _ in range(gdim)]
    size = [draw(numbers(1, 12)) for _ in range(gdim)]
    cell = draw(st.sampled_from(_CELLS[gdim]))
    box: dict[str, Any] = {"size": size, "cells": cells}
    if cell != _CELLS[gdim][0] or draw(st.booleans()):
        box["cell"] = cell
    table: dict[str, Any] = {"box": box}
    names = names[: cells[-1]]
    straight = cell in ("quadrilateral", "hexahedron")
    top = size[-1]
    if len(names) > 1:
        rows = size[-1] / cells[-1]
        regions = [{"soil": n, "below": rows * (i + 1)} for i, n in enumerate(names)]
        air = straight and len(names) == cells[-1] and draw(st.booleans())
        last = "air" if air else names[-1]
        regions[-1] = {"soil": last}
        if gdim == 2 and draw(st.integers(0, 3)) == 0:
            corners = [[0.0, -1.0], [size[0], -1.0], [size[0], 9e3], [0.0, 9e3]]
            regions[-1]["polygon"] = corners
        if air:
            table["empty"], names, top = ["air"], names[:-1], size[-1] - rows
        table["regions"] = regions
    sides = ("left", "right", "front", "back")[: 2 * gdim - 2]
    level = straight or len(names) == 1
    return _Ground(table, cell, names, sides, (*size[:-1], top), True, level)


@st.composite
def _choices(draw: st.DrawFn, ground: _Ground) -> _Choices:
    antiplane = ground.table.get("kinematics") == "antiplane"
    permanent = "none" if antiplane else draw(st.sampled_from(("none",) * 5 + ("slip", "soft")))
    slides, softens = permanent == "slip", permanent == "soft"
    several, transient = draw(st.booleans()), slides or draw(st.booleans())
    laws = (None, "hysteretic", "kramer", "shake91", "dormieux", "maxwell")
    law = draw(st.sampled_from(laws))
    if slides or (softens and transient):
        law = draw(st.sampled_from((None, "maxwell")))
    compliant = draw(st.integers(0, 2)) == 0
    outcrop = compliant and draw(st.booleans())
    loop = softens or draw(st.booleans())
    return _Choices(antiplane, slides, softens, several, transient, law, outcrop, compliant, loop)


@st.composite
def _directions(draw: st.DrawFn, ground: _Ground, choices: _Choices) -> tuple[str, ...]:
    if choices.antiplane:
        return ("z",)
    axes = ("x", "y", "z")[: ground.gdim]
    if choices.slides:  # vertical motion alone drives nothing that slides
        return ("x", *draw(st.sampled_from(((), axes[1:]))))
    return tuple(draw(st.lists(st.sampled_from(axes), min_size=1, unique=True)))


@st.composite
def _boundaries(draw: st.DrawFn, ground: _Ground, choices: _Choices) -> dict[str, Any]:
    boundary: dict[str, Any] = {}
    if choices.compliant:
        rock: dict[str, Any] = {
            "density": draw(numbers(2000, 2700)),
            "shear_wave_velocity": draw(numbers(500, 2500)),
            "poisson": draw(numbers(0, 0.45)),
        }
        if draw(st.booleans()):
            rock["damping"] = draw(numbers(0, 0.1))
        boundary["base"] = {"compliant": rock}
    elif draw(st.booleans()):
        boundary["base"] = draw(st.sampled_from(("rigid", "fixed")))
    kinds = ["free", "dashpot"]
    if not choices.outcrop:
        kinds += ["fixed", "roller", "rigid"]
    transient = choices.transient and choices.several
    if ground.level and (choices.causal or not transient):
        kinds.append("free_field")
    pairs = [ground.sides[i : i + 2] for i in range(0, len(ground.sides), 2)]
    for pair in pairs:
        if ground.tied and draw(st.booleans()):
            boundary |= dict.fromkeys(pair, "tied")
            continue
        # Between two sides that hold it a cell has nowhere to go.
        others = ("free",) if choices.slides else tuple(k for k in kinds if k not in _HELD)
        for side, allowed in zip(pair, (tuple(kinds), others), strict=True):
            kind = draw(st.sampled_from((None, *allowed)))
            if kind is not None:
                boundary[side] = kind
    return boundary


@st.composite
def _effects(
    draw: st.DrawFn, ground: _Ground, choices: _Choices, boundary: dict[str, Any]
) -> dict[str, Any]:
    effects: dict[str, Any] = {}
    rarely = st.integers(0, 3).map(lambda n: n == 0)
    if choices.loop:
        effects["equivalent_linear"] = draw(_loops())
    if draw(rarely):
        effects["rayleigh"] = {"alpha": draw(numbers(0, 1)), "beta": draw(numbers(0, 0.01))}
    if choices.several and draw(rarely):
        effects["degradation"] = draw(_degradations(ground.soils))
    loose = [s for s in ground.sides if boundary.get(s) in (None, "free", "dashpot", "fixed")]
    if loose and draw(rarely):
        side = draw(st.sampled_from(loose))
        across = ground.size[0 if side in ("left", "right") else 1]
        effects["calm"] = {"sides": [side], "thickness": 0.4 * across}
        if draw(st.booleans()):
            effects["calm"]["damping"] = draw(numbers(0.05, 0.4))
    if choices.antiplane:
        return effects
    if choices.slides or choices.softens or draw(st.booleans()):
        effects["gravity"] = draw(_gravities())
    for name in ("geometric_stiffness", "convection"):
        if draw(st.booleans()):
            effects[name] = draw(st.booleans())
    simplices = ground.cell in ("triangle", "tetrahedron")
    if not (simplices and ground.table.get("degree", 1) == 1) and draw(rarely):
        effects["locking"] = True
    if choices.softens:
        effects["softening"] = True
    if choices.slides:
        effects["sliding"] = {
            "time_step": draw(st.sampled_from((0.005, 0.01, 0.02))),
            "unstable_at_rest": True,
            "longest": draw(st.sampled_from((0.0, 0.5))),
        }
    return effects


@st.composite
def _loops(draw: st.DrawFn) -> dict[str, Any] | bool:
    loop: dict[str, Any] = {"max_iterations": 200}
    if draw(st.booleans()):
        loop["tolerance"] = draw(numbers(1e-3, 0.1))
    ratio = draw(st.sampled_from((None, "strain_ratio", "magnitude")))
    if ratio is not None:
        loop[ratio] = draw(numbers(0.2, 1) if ratio == "strain_ratio" else numbers(3, 9))
    if draw(st.booleans()):
        loop["strain"] = draw(st.sampled_from(("plane", "3d")))
    return draw(st.sampled_from((loop, True)))


@st.composite
def _degradations(draw: st.DrawFn, names: tuple[str, ...]) -> dict[str, Any] | bool:
    table: dict[str, Any] = {"threshold": draw(numbers(1e-5, 1e-2))}
    if draw(st.booleans()):
        table |= {"s": draw(numbers(0.01, 0.2)), "r": draw(numbers(0.3, 1))}
    if draw(st.booleans()):
        table["soils"] = [draw(st.sampled_from(names))]
    if draw(st.booleans()):
        table["minimum"] = draw(numbers(0.05, 0.9))
    return draw(st.sampled_from((table, True)))


@st.composite
def _gravities(draw: st.DrawFn) -> dict[str, Any] | bool:
    table: dict[str, Any] = {}
    if draw(st.booleans()):
        table["acceleration"] = draw(numbers(1, 20))
    if draw(st.booleans()):
        table["initial_stress"] = draw(st.sampled_from(("k0", "elastic")))
    return draw(st.sampled_from((table, True)))


@st.composite
def _lapses(draw: st.DrawFn, choices: _Choices) -> dict[str, Any]:
    """Two lapses, of 20 samples at least where they hand over: records have 40 and more."""
    lapses: dict[str, Any] = {"continuity": "transient" if choices.transient else "steady"}
    if choices.several:
        lapses["count"] = 2 if choices.transient else draw(st.integers(2, 4))
    elif draw(st.booleans()):
        lapses["count"] = 1
    return lapses


@st.composite
def _points(draw: st.DrawFn) -> dict[str, Any]:
    policies = ("error", "park", "delete")
    names = [n for n in ("outside", "detached") if draw(st.booleans())]
    return {name: draw(st.sampled_from(policies)) for name in names}


@st.composite
def _solvers(draw: st.DrawFn, choices: _Choices) -> dict[str, Any]:
    solver: dict[str, Any] = {}
    if draw(st.booleans()):
        solver["sweep"] = draw(st.sampled_from(("direct", "reduced")))
    if choices.law is not None:
        solver["complex_modulus"] = choices.law
    if choices.causal and draw(st.booleans()):
        solver["reference_frequency"] = draw(numbers(0.3, 5))
    if draw(st.booleans()):
        solver["keep"] = draw(st.sampled_from(("poisson", "bulk")))
    if draw(st.booleans()):
        solver["tolerance"] = draw(st.sampled_from((1e-3, 1e-6, 1e-8)))
    handed_over = choices.transient and choices.several
    if not handed_over and draw(st.integers(0, 3)) == 0:
        solver["max_frequency"] = draw(numbers(1, 10))
    if draw(st.integers(0, 3)) == 0:
        solver["excited"] = draw(st.sampled_from((0.0, 1e-12, 1e-3, 0.5)))
    return solver


@st.composite
def _outputs(draw: st.DrawFn, ground: _Ground) -> dict[str, Any]:
    output: dict[str, Any] = {}
    receivers = {}
    for i in range(draw(st.integers(0, 2))):
        part = st.sampled_from((0.0, 0.25, 0.5, 1.0))
        place = [float(s * draw(part)) for s in ground.size]
        receivers[f"r{i}"] = {"point": place} if draw(st.integers(0, 3)) == 0 else place
    if receivers:
        output["receivers"] = receivers
    if draw(st.integers(0, 3)) == 0:
        output["fields"] = True
    if draw(st.integers(0, 3)) == 0:
        output["every"] = draw(st.integers(1, 3))
    if draw(st.integers(0, 3)) == 0:
        output["water_table"] = draw(numbers(-2, 20))
    return output
