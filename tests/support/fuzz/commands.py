# SPDX-License-Identifier: MIT
"""Options of a run, what is done with its result, and ``hytf mesh``, by chance."""

from hypothesis import strategies as st

from support.fuzz.scenes import Case

_SOUND = ("title='another'", "output.fields=true", "solver.tolerance=1e-4", "points.outside=park")
_ODD = (
    "x",
    "=",
    "a=b=c",
    "mesh.degree=7",
    "motion.0.pga=nan",
    "motion[9].pga=1",
    "solver.tolerance=",
    "title=" + "[" * 3000,
    "lapses.count=1e9",
    "mesh={}",
    "mesh.column.layers=[]",
    "\u202e=1",
    "soil.=1",
)
_KINDS = ("slope", "slope3d", "terraces", "embankment", "canyon")
_OPTIONS = (
    "height",
    "depth",
    "size",
    "air",
    "behind",
    "before",
    "slope",
    "angle",
    "layers",
    "width",
    "steps",
    "rise",
    "cells",
    "radius",
    "wavelength",
    "max-frequency",
    "vs",
    "order",
    "x",
)
_VALUES = ("0", "-1", "nan", "inf", "1e300", "1e-300", "1e9", "", "x", "3", "2.5", "1e-9")


@st.composite
def sound_options(draw: st.DrawFn) -> tuple[str, ...]:
    """Options that any scene may be run with; figures, which take seconds, seldom."""
    chosen = ["--no-plots"] if draw(st.integers(0, 39)) else []
    if draw(st.integers(0, 4)) == 0:
        chosen.append("--quiet")
    if draw(st.integers(0, 4)) == 0:
        chosen += ["--set", draw(st.sampled_from(_SOUND))]
    return tuple(chosen)


@st.composite
def options(draw: st.DrawFn) -> tuple[str, ...]:
    """The same with an odd override here and there."""
    chosen = draw(sound_options())
    if draw(st.integers(0, 9)) == 0:
        chosen += ("--set", draw(st.sampled_from(_ODD)))
    return chosen


@st.composite
def uses(draw: st.DrawFn, case: Case, given: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Commands on the result of a sound scene run with options; each of them succeeds."""
    named = case.data.get("output", {}).get("receivers", {})
    commands = [("run", "scene.toml", "--resume", *given), ("plot", "scene-result")]
    if named:
        kind = draw(st.sampled_from(("at2", "csv")))
        quantity = draw(st.sampled_from(("total_acceleration", "velocity", "displacement")))
        if kind == "at2":
            quantity = "total_acceleration"
        commands.append(
            ("export", "scene-result", *named, "--format", kind, "--quantity", quantity)
        )
    chosen = draw(st.integers(0, 10 * len(commands)))  # seldom: figures take seconds
    return (commands[chosen],) if chosen < len(commands) else ()


@st.composite
def mesh_commands(draw: st.DrawFn) -> tuple[str, ...]:
    """``hytf mesh`` with options that may make a mesh, or none."""
    arguments = [draw(st.sampled_from((*_KINDS, "", "nothing")))]
    if draw(st.booleans()):  # a small one to begin with
        arguments += ["--height", "3", "--depth", "2", "--size", "2"]
    for _ in range(draw(st.integers(0, 2))):
        arguments += [f"--{draw(st.sampled_from(_OPTIONS))}", draw(st.sampled_from(_VALUES))]
    return ("mesh", *arguments)
