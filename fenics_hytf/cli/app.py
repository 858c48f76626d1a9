# SPDX-License-Identifier: MIT
"""Commands and their options. What is heavy is imported when a command needs it, not before."""

from __future__ import annotations

import os
import re
import sys
import time
from contextlib import redirect_stdout
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NoReturn

import click
import typer

from fenics_hytf.cli.outcome import (
    INPUT,
    InputError,
    RunRequest,
    launched_rank,
    say,
    tell,
    tolerant_streams,
)

app = typer.Typer(
    name="hytf",
    help="Ground response with material points, solved in the frequency domain.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

SceneArgument = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).")]
OutputOption = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Result folder  [./<scene>-result]"),
]
MotionOption = Annotated[
    Path | None,
    typer.Option(
        "--motion", metavar="FILE", help="AT2 or CSV file in the place of the first motion."
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override values of the scene; repeatable."),
]
ForceOption = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Replace a finished result, or an unfinished run; try what takes more memory than "
        "there is.",
    ),
]
QuietOption = Annotated[bool, typer.Option("--quiet", help="No progress, no summary.")]
PlotsOption = Annotated[bool, typer.Option("--no-plots", help="No figures, no report.")]
PlotOption = Annotated[
    str | None,
    typer.Option(
        "--plot",
        metavar="[FILE]",
        help="Draw the curves of the soils, as PNG  [./<scene>-curves.png]",
    ),
]
ResumeOption = Annotated[
    bool,
    typer.Option("--resume", help="Go on after the last lapse that was done; without any, start."),
]
GroupOption = Annotated[
    int | None,
    typer.Option(
        "--group-size",
        metavar="K",
        help="Ranks that share a mesh; groups of them share out the lines  [by memory]",
    ),
]


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run ``hytf`` and leave with its exit code.

    Args:
        arguments: What follows ``hytf``; the process's own if ``None``.
    """
    tolerant_streams()
    given = sys.argv[1:] if arguments is None else arguments
    given = fill_plot(spread_overrides(given))
    if launched_rank() == 0:
        app(given, prog_name="hytf")
        raise AssertionError("typer returns by SystemExit")
    sys.exit(_run_silently(given))


def _run_silently(arguments: list[str]) -> int:
    """A further rank: it reads the same arguments, and leaves the talking to the first."""
    with open(os.devnull, "w", encoding="utf-8") as nowhere, redirect_stdout(nowhere):
        try:
            code = app(arguments, prog_name="hytf", standalone_mode=False) or 0
        except click.ClickException as error:
            code = error.exit_code
    if code and "mpi4py.MPI" not in sys.modules:
        time.sleep(1.0)  # mpirun ends all ranks when one fails: let the first say why
    return int(code)


def spread_overrides(arguments: list[str]) -> list[str]:
    """Let one ``--set`` take several ``key=value``: repeat it before each."""
    spread: list[str] = []
    follows = False
    for argument in arguments:
        if follows and re.match(r"[\w.\[\]\"'-]+=", argument) and not argument.startswith("-"):
            if spread[-1] != "--set":
                spread.append("--set")
        else:
            follows = argument == "--set"
        spread.append(argument)
    return spread


def fill_plot(arguments: list[str]) -> list[str]:
    """Let ``--plot`` stand without FILE: it takes the next word only if that ends in .png."""
    following = [*arguments[1:], ""]
    return [
        "--plot=" if word == "--plot" and not re.fullmatch(r"(?i)[^-].*\.png", after) else word
        for word, after in zip(arguments, following, strict=False)
    ]


@app.callback(invoke_without_command=True)
def _hytf(
    version: Annotated[bool, typer.Option("--version", help="Say the version and stop.")] = False,
) -> None:
    if version:
        from fenics_hytf.results.summary import own_version

        say(f"hytf {own_version()}")
        raise typer.Exit


@app.command()
def run(
    scene: SceneArgument,
    output: OutputOption = None,
    motion: MotionOption = None,
    overrides: SetOption = None,
    force: ForceOption = False,
    quiet: QuietOption = False,
    no_plots: PlotsOption = False,
    resume: ResumeOption = False,
    group_size: GroupOption = None,
) -> None:
    """Run a scene; under mpirun on all ranks."""
    folder = output if output is not None else default_folder(scene)
    settings = (motion, tuple(overrides or ()), force, quiet, not no_plots, group_size)
    _leave("run", RunRequest(scene, folder, *settings, resume=resume))


@app.command()
def check(
    scene: SceneArgument,
    motion: MotionOption = None,
    overrides: SetOption = None,
    plot: PlotOption = None,
) -> None:
    """Check a scene: its faults, or what running it would take."""
    request = RunRequest(scene, default_folder(scene), motion, tuple(overrides or ()))
    figure = None if plot is None else Path(plot or f"{scene.stem}-curves.png")
    _leave("check", request, plot=figure)


@app.command()
def plot(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a finished result.")],
) -> None:
    """Draw the figures and write report.html of a finished result again."""
    if launched_rank() != 0:
        return
    from fenics_hytf.cli.plot import plot_result

    raise typer.Exit(plot_result(folder))


@app.command()
def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a finished result.")],
    receivers: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[RECEIVER]...", help="Receivers, within, outcrop; all if none is named."
        ),
    ] = None,
    file_format: Annotated[
        str, typer.Option("--format", metavar="at2|csv", help="Kind of the files.")
    ] = "at2",
    quantity: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="total_acceleration, acceleration, velocity or displacement."
        ),
    ] = "total_acceleration",
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FOLDER", help="Where to  [./<DIR>-motions]"),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that are there.")] = False,
) -> None:
    """Write motions of a finished result as AT2 (in g) or CSV."""
    if launched_rank() != 0:
        return
    from fenics_hytf.cli.export import ExportRequest, export_motions

    names = tuple(dict.fromkeys(receivers or ()))
    request = ExportRequest(folder, names, file_format, quantity, output, force)
    raise typer.Exit(export_motions(request))


@app.command()
def demo(
    name: Annotated[str | None, typer.Argument(help="Name of the demo; none: list them.")] = None,
    output: OutputOption = None,
    motion: MotionOption = None,
    overrides: SetOption = None,
    force: ForceOption = False,
    quiet: QuietOption = False,
    no_plots: PlotsOption = False,
    resume: ResumeOption = False,
    group_size: GroupOption = None,
) -> None:
    """Copy a demo scene into this folder and run it; without NAME, list them."""
    from fenics_hytf.cli.demos import find_demo, list_demos

    if name is None:
        say(list_demos())
        return
    try:
        source = find_demo(name)
    except InputError as error:
        tell(error.faults)
        raise typer.Exit(INPUT) from None
    scene = Path(source.name)
    folder = output if output is not None else default_folder(scene)
    settings = (motion, tuple(overrides or ()), force, quiet, not no_plots, group_size)
    _leave("run", RunRequest(scene, folder, *settings, demo=source, resume=resume))


@app.command(
    add_help_option=False,
    context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False},
    options_metavar="",
)
def mesh(
    arguments: Annotated[
        list[str] | None, typer.Argument(metavar="[KIND] [OPTION]...", help="Kind and its options.")
    ] = None,
) -> None:
    """Draw a mesh with gmsh: a slope, terraces, ...; without KIND, list the kinds."""
    if launched_rank() != 0:
        return
    from fenics_hytf.cli.mesh import make_mesh

    raise typer.Exit(make_mesh(arguments or []))


@app.command()
def accuracy(
    scene: SceneArgument,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Folder  [./<scene>-accuracy]"),
    ] = None,
    motion: MotionOption = None,
    overrides: SetOption = None,
    force: Annotated[
        bool,
        typer.Option(
            "--force",
            help="Start anew; otherwise finished runs are kept. Try what takes more memory than "
            "there is.",
        ),
    ] = False,
    budget: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Start no run after that; run again to go on."),
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """What accuracy costs: error against cost of a scene over its settings."""
    _refuse_mpirun("accuracy")
    folder = output if output is not None else Path(f"{scene.stem}-accuracy")
    request = RunRequest(scene, folder, motion, tuple(overrides or ()), force, quiet)
    _leave("accuracy", request, budget=budget)


@app.command()
def stability(
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="DIR", help="Folder  [./stability]"),
    ] = Path("stability"),
    force: Annotated[bool, typer.Option("--force", help="Replace maps that are there.")] = False,
    quiet: QuietOption = False,
) -> None:
    """Where the method converges, drifts or blows up: its stability maps, in some ten minutes.

    Ctrl-C leaves a table of the runs that are done; figures are drawn at the end.
    """
    _refuse_mpirun("stability")
    _leave("stability", output, force, quiet)


def default_folder(scene: Path) -> Path:
    """``./<scene>-result``."""
    return Path(f"{scene.stem}-result")


def _refuse_mpirun(command: str) -> None:
    """End a study that mpirun has started, be it on one rank."""
    if any(re.fullmatch(r"(OMPI_COMM_WORLD|PMIX|PMI)_RANK", name) for name in os.environ):
        why = {"accuracy": "it starts its runs itself", "stability": "its runs are small"}[command]
        tell([f"{command}: found mpirun; expected to be run without: {why}"])
        raise typer.Exit(INPUT)


def _leave(command: str, *arguments: Any, **options: Any) -> NoReturn:
    """Check the environment, run a command that solves, and leave with its exit code."""
    from fenics_hytf.cli.environment import environment_faults
    from fenics_hytf.cli.interrupt import interruptible

    with interruptible(None):  # loading what is heavy takes seconds
        faults = environment_faults()
        if faults:
            tell(faults)
            raise typer.Exit(INPUT)
        from fenics_hytf.cli import accuracy, check, run, stability
    commands: dict[str, Any] = {
        "run": run.run_scene,
        "check": check.check_scene,
        "accuracy": accuracy.study_accuracy,
        "stability": stability.map_stability,
    }
    raise typer.Exit(run.guarded(partial(commands[command], *arguments, **options)))
