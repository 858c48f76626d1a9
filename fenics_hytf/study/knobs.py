# SPDX-License-Identifier: MIT
"""The knobs of a scene: what trades accuracy for cost.

Which values each can take, and the overrides of the scene file that set them.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from fenics_hytf.motion import excited_lines, frequencies, to_frequency
from fenics_hytf.scene import Mesh, Scene, allowed_points_per_cell, default_points_per_cell
from fenics_hytf.study.overrides import Overrides, place

_CELLS = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the scene's own numbers of cells
_SWEEPS = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
_BANDS = (0.25, 0.5, 1.0, 2.0)  # of the scene's own highest frequency
_LAPSES = (1, 2, 4)
_STEPS = (0.25, 0.5, 1.0, 2.0)  # of the scene's own number of time steps of the slip a sample
_LOOPS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
_REFINED = 2  # times that cells of a file are divided
_FEWEST_SAMPLES = 32  # a lapse
_NO_TAIL = 1e-6  # of the record, in the norm: what a wider band may add without being another
_ITERATIONS = 200  # at least, of a loop that is to change less than the scene asks for


@dataclass(frozen=True)
class Setting:
    """One value of each knob.

    Attributes:
        cells: Numbers of cells along every edge, of the scene's own [-].
        degree: Degree of the displacement.
        points: How many rules of quadrature above the smallest that the degree allows.
        sweep: Tolerance of the reduced sweep [-]; 0 for the direct one.
        band: Highest frequency [Hz].
        lapses: Number of lapses.
        loop: Tolerance of the equivalent-linear loop [-]; 0 without it.
        step: Longest time step of the slip [s]; 0 where nothing slides.
    """

    cells: float
    degree: int
    points: int
    sweep: float
    band: float
    lapses: int
    loop: float
    step: float

    def turned(self, knob: str, value: float) -> Setting:
        """The same with another value of one knob."""
        return replace(self, **{knob: value})  # type: ignore[arg-type]  # keys are the fields

    def differing(self, other: Setting) -> list[str]:
        """Knobs that two settings do not share."""
        return [name for name in KNOBS if getattr(self, name) != getattr(other, name)]


KNOBS = tuple(field.name for field in fields(Setting))

MESH = ("cells", "degree")
"""Knobs of the mesh, which do not act one by one."""

LABELS = {
    "cells": "mesh size",
    "degree": "degree",
    "points": "points per cell",
    "sweep": "sweep tolerance",
    "band": "maximum frequency",
    "lapses": "number of lapses",
    "loop": "equivalent-linear tolerance",
    "step": "time step of the slip",
}

_DIMENSIONS = {"triangle": 2, "quadrilateral": 2, "tetrahedron": 3, "hexahedron": 3}


class Knobs:
    """What a scene can be set to.

    Args:
        scene: The scene.
        cell_type: Of its mesh, ``quadrilateral`` and the like.

    Attributes:
        scene: The scene.
        nyquist: The widest band [Hz].
        own: The scene's own setting.
        values: Values of each knob that the scene has, from coarse to fine.
        notes: What is left out, and why.
    """

    def __init__(self, scene: Scene, cell_type: str) -> None:
        self.scene, self._cell_type = scene, cell_type
        self.notes: list[str] = []
        mesh, solver, loop = scene.mesh, scene.solver, scene.effects.equivalent_linear
        sliding = scene.effects.sliding
        self.nyquist = 0.5 / scene.dt
        band = min(solver.max_frequency or self.nyquist, self.nyquist)
        self.own = Setting(
            cells=1.0,
            degree=mesh.degree,
            points=self._allowed(mesh.degree).index(self._own_points(mesh)),
            sweep=solver.tolerance if solver.sweep == "reduced" else 0.0,
            band=band,
            lapses=len(scene.segments),
            loop=loop.tolerance if loop is not None else 0.0,
            step=sliding.time_step if sliding is not None else 0.0,
        )
        values = {
            "cells": self._cells(),
            "degree": (1, 2),
            "points": sorted({0, 1, 2, self.own.points}),
            "sweep": sorted({*_SWEEPS, solver.tolerance}, reverse=True),
            "band": self._bands(),
            "lapses": self._lapses(),
            "loop": sorted({*_LOOPS, self.own.loop}, reverse=True) if loop is not None else (),
            "step": self._steps() if sliding is not None else (),
        }
        if sliding is None or not self.own.sweep:
            values["sweep"] = [*values["sweep"], 0.0]
        else:
            self.notes.append(
                "sweep tolerance: no direct sweep, as the kernel of the slip is reduced in any case"
            )
        self.values = {name: tuple(found) for name, found in values.items() if len(found) > 1}

    def overrides(self, setting: Setting) -> Overrides:
        """What in the scene file a setting changes.

        Args:
            setting: The setting.

        Returns:
            Values by their place in the file; nothing for the scene's own setting.
        """
        turned = setting.differing(self.own)
        changes: Overrides = {}
        if "cells" in turned:
            changes |= self._refined(setting.cells)
        if "degree" in turned:
            changes["mesh", "degree"] = setting.degree
        if "points" in turned or ("degree" in turned and self._states_points):
            changes["mesh", "points_per_cell"] = self.points_per_cell(setting)
        if "sweep" in turned:
            changes["solver", "sweep"] = "reduced" if setting.sweep else "direct"
            if setting.sweep:
                changes["solver", "tolerance"] = setting.sweep
        if "band" in turned:
            changes["solver", "max_frequency"] = setting.band
        if "lapses" in turned:
            if "duration" in self.scene.data.get("lapses", {}):
                samples = math.ceil(self._total / setting.lapses)
                changes["lapses", "duration"] = samples * self.scene.dt
            else:
                changes["lapses", "count"] = setting.lapses
            changes |= self._kept()
        if "loop" in turned:
            changes |= self._effect("equivalent_linear", self._looped(setting.loop))
        if "step" in turned:
            changes |= self._effect("sliding", {"time_step": setting.step})
        return changes

    def data(self, setting: Setting) -> dict[str, Any]:
        """The raw table of the scene with a setting.

        Receivers that ride a material point stand at a fixed place: which point is the nearest
        depends on the mesh.
        """
        data = copy.deepcopy(self.scene.data)
        for name, receiver in self.scene.output.receivers.items():
            data["output"]["receivers"][name] = list(receiver.place)
        if self.scene.effects.sliding is not None and self.scene.output.every > 1:
            data["output"]["every"] = 1  # where points come to is looked at, at the end
        for path, value in self.overrides(setting).items():
            place(data, path, value)
        return data

    def scene_with(self, setting: Setting) -> Scene:
        """The scene with a setting.

        Raises:
            SceneError: If the scene does not allow it.
        """
        return Scene.from_dict(self.data(setting), self.scene.folder)

    def points_per_cell(self, setting: Setting) -> int:
        """Material points a cell."""
        allowed = self._allowed(setting.degree)
        return allowed[min(setting.points, len(allowed) - 1)]

    def describe(self, knob: str, setting: Setting) -> str:
        """The value of a knob in words."""
        value = getattr(setting, knob)
        if knob == "cells":
            return "cells as given" if value == 1 else f"cells ×{_fraction(value)}"
        if knob == "points":
            return f"{self.points_per_cell(setting)} points per cell"
        if knob == "sweep":
            return f"reduced sweep to {value:g}" if value else "direct sweep"
        if knob == "band":
            return f"{value:.4g} Hz"
        if knob == "lapses":
            return f"{value} lapse{'s' if value > 1 else ''}"
        if knob == "step":
            return f"slip in steps of {1e3 * value:g} ms"
        return f"degree {value}" if knob == "degree" else f"loop to {value:g}"

    def name(self, setting: Setting) -> str:
        """A setting in words, by how it differs from the scene's own."""
        turned = [self.describe(knob, setting) for knob in setting.differing(self.own)]
        return ", ".join(turned) or "the scene's own settings"

    def value(self, knob: str, setting: Setting) -> float | str:
        """The value of a knob as the scene file would hold it."""
        if knob == "points":
            return self.points_per_cell(setting)
        value: float = getattr(setting, knob)
        return "direct" if knob == "sweep" and not value else value

    def up_to(self, knob: str, setting: Setting) -> tuple[float, ...]:
        """Values of a knob from the coarsest to that of a setting; all numbers of lapses."""
        values = self.values[knob]
        return values if knob == "lapses" else values[: values.index(getattr(setting, knob)) + 1]

    def lines_up_to(self, band: float) -> int:
        """Lines of the record, in one piece, that carry energy up to a frequency [Hz]."""
        spectra = to_frequency(self.scene.base_acceleration)
        excited = self.scene.solver.excited
        return len(excited_lines(spectra, self.scene.dt, self._total, excited, band))

    def leave_out(self, knob: str, value: float) -> None:
        """Take a value of a knob away, because it takes too long or fails."""
        self.notes.append(
            f"{LABELS[knob]}: left out {self.describe(knob, self.own.turned(knob, value))}, which "
            "fails or takes too long on the scene as it is"
        )
        self.values[knob] = tuple(each for each in self.values[knob] if each != value)

    def settle(self, knob: str) -> None:
        """Leave a knob as the scene has it, because it changes nothing."""
        low, *_, high = (
            self.describe(knob, self.own.turned(knob, value)) for value in self.values.pop(knob)
        )
        self.notes.append(f"{LABELS[knob]}: from {low} to {high} nothing changes; left as they are")

    def best(self, knob: str) -> float:
        """The value of a knob with the smallest error of its own.

        Cutting a record into lapses that are each periodic is a model of its own where moduli or
        points change from lapse to lapse: there the scene's number stands. Otherwise one lapse is
        what the others approximate.
        """
        if knob == "lapses" and self._lapses_differ:
            return self.own.lapses
        return self.values[knob][-1] if knob in self.values else getattr(self.own, knob)

    @property
    def dimension(self) -> int:
        """Number of directions that a finer mesh is finer in."""
        return 1 if self.scene.mesh.column is not None else _DIMENSIONS[self._cell_type]

    @property
    def _lapses_differ(self) -> bool:
        effects = self.scene.effects
        changing = (effects.equivalent_linear, effects.degradation)
        return effects.convection or any(effect is not None for effect in changing)

    @property
    def _states_points(self) -> bool:
        return self.scene.mesh.points_per_cell is not None

    @property
    def _total(self) -> int:
        """Samples of the record with what pads its last lapse."""
        return self.scene.segments[-1].stop

    def _allowed(self, degree: int) -> tuple[int, ...]:
        return allowed_points_per_cell(self._cell_type, degree)

    def _own_points(self, mesh: Mesh) -> int:
        return mesh.points_per_cell or default_points_per_cell(self._cell_type, mesh.degree)

    def _cells(self) -> list[float]:
        """Refinements that give meshes of their own, coarse to fine."""
        if self.scene.mesh.file is not None:
            if self.scene.effects.sliding is None:
                self.notes.append("mesh size: the mesh is a file, and is not meshed anew")
                return [1.0]
            self.notes.append("mesh size: the mesh is a file, whose cells are divided as they are")
            return [2.0**times for times in range(-self.scene.mesh.refine, _REFINED + 1)]
        found: dict[tuple[Any, ...], float] = {}
        for factor in (1.0, *_CELLS):  # the scene's own first: it stays where others are the same
            counts = tuple(_flat(self._refined(factor)))
            found.setdefault(counts, factor)
        return sorted(found.values())

    def _kept(self) -> Overrides:
        """What hangs on the number of lapses where the file does not name it, as the scene has it.

        Another number of lapses is not to be another law.
        """
        lapses, solver = self.scene.lapses, self.scene.solver
        kept = {
            ("lapses", "continuity"): lapses.continuity,
            ("solver", "complex_modulus"): solver.complex_modulus,
        }
        data = self.scene.data
        return {(a, b): value for (a, b), value in kept.items() if b not in data.get(a, {})}

    def _looped(self, tolerance: float) -> dict[str, Any]:
        """Another tolerance of the loop, with the iterations that a smaller one takes."""
        loop = self.scene.effects.equivalent_linear
        assert loop is not None
        table: dict[str, Any] = {"tolerance": tolerance}
        if tolerance < self.own.loop and loop.max_iterations < _ITERATIONS:
            table["max_iterations"] = _ITERATIONS
        return table

    def _effect(self, name: str, table: dict[str, Any]) -> Overrides:
        """Other keys of an effect, which the scene may have called for by ``true``."""
        if not isinstance(self.scene.data["effects"][name], dict):
            return {("effects", name): table}
        return {("effects", name, key): value for key, value in table.items()}

    def _steps(self) -> list[float]:
        """Time steps of the slip, long to short: a quarter to twice as many a sample, if whole."""
        own = math.ceil(self.scene.dt / self.own.step - 1e-9)
        counts = {own * factor for factor in _STEPS if float(own * factor).is_integer()}
        return [self.own.step if n == own else self.scene.dt / n for n in sorted(counts)]

    def _counts(self) -> Overrides:
        mesh = self.scene.mesh
        if mesh.column is not None:
            layers = enumerate(mesh.column.layers)
            return {("mesh", "column", "layers", i, "cells"): layer.cells for i, layer in layers}
        assert mesh.box is not None
        return {("mesh", "box", "cells"): list(mesh.box.cells)}

    def _refined(self, factor: float) -> Overrides:
        """Numbers of cells times a factor, at least one; cells of a file divided."""
        if self.scene.mesh.file is not None:
            return {("mesh", "refine"): self.scene.mesh.refine + round(math.log2(factor))}

        def times(count: int | list[int]) -> int | list[int]:
            if isinstance(count, list):
                return [max(1, round(n * factor)) for n in count]
            return max(1, round(count * factor))

        return {path: times(count) for path, count in self._counts().items()}

    def _tail(self, band: float) -> float:
        """Share of the record above a frequency, in the norm [-]."""
        spectra = np.abs(to_frequency(self.scene.base_acceleration)) ** 2
        above = frequencies(self._total, self.scene.dt) > band * (1 + 1e-12)
        return float(np.sqrt(spectra[:, above].sum() / spectra.sum()))

    def _bands(self) -> list[float]:
        """Bands that hold different lines, narrow to wide."""
        own = self.own.band
        bands = sorted({min(own * factor, self.nyquist) for factor in _BANDS} | {self.nyquist})
        kept: list[float] = []
        for band in bands:
            same = bool(kept) and self._tail(kept[-1]) - self._tail(band) <= _NO_TAIL
            if same and band == own:
                kept[-1] = own
            elif band == own or (not same and self.lines_up_to(band)):
                kept.append(band)
        return kept

    def _lapses(self) -> list[int]:
        """Numbers of lapses, the one with the smallest error last."""
        own = len(self.scene.segments)
        counts = {n for n in (*_LAPSES, own) if self._total >= n * _FEWEST_SAMPLES} | {own}
        if self._lapses_differ:
            return [*sorted(counts - {own}), own]
        return sorted(counts, reverse=True)


def _flat(overrides: Overrides) -> list[int]:
    return list(np.concatenate([np.atleast_1d(value) for value in overrides.values()]))


def _fraction(value: float) -> str:
    return f"{value:g}" if value >= 1 else f"1/{1 / value:g}"
