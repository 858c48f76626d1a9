# SPDX-License-Identifier: MIT
"""A checked scene: what the file says, with defaults filled in and motions read."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from fenics_hytf import motion as records
from fenics_hytf.scene.axes import AXES
from fenics_hytf.scene.boundary import Boundary
from fenics_hytf.scene.check import Sections, check
from fenics_hytf.scene.faults import Fault, SceneError
from fenics_hytf.scene.mesh import Mesh
from fenics_hytf.scene.motion import MotionInput
from fenics_hytf.scene.output import Output
from fenics_hytf.scene.settings import Effects, Lapses, Points, Solver
from fenics_hytf.scene.soil import Soil
from fenics_hytf.scene.source import copy_data, read_source
from fenics_hytf.scene.table import is_given

RealArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene without faults; its attributes mirror the file.

    Attributes:
        title: Title; the file's name where none is given.
        folder: Where relative paths start.
        data: The raw table, after overrides.
        mesh: Mesh and discretisation.
        soil: Soils by name.
        motion: Motions of the base, one a direction, read and scaled.
        boundary: What holds the boundaries that the scene names.
        lapses: How the motion is cut.
        effects: What the scene calls for.
        points: Material points.
        solver: How lines are solved.
        output: What is written.
    """

    title: str
    folder: Path
    data: dict[str, Any] = field(repr=False)
    mesh: Mesh
    soil: dict[str, Soil]
    motion: tuple[MotionInput, ...]
    boundary: Boundary
    lapses: Lapses
    effects: Effects
    points: Points
    solver: Solver
    output: Output

    @classmethod
    def load(
        cls,
        path: Path | str,
        overrides: Sequence[str] = (),
        motion_file: Path | str | None = None,
    ) -> Self:
        """Read a scene file.

        Args:
            path: The file (TOML).
            overrides: ``key.path=value`` with TOML values.
            motion_file: Takes the place of the first motion's source; its direction, scaling and
                kind of input stay.

        Returns:
            The scene.

        Raises:
            SceneError: With every fault at once.
        """
        sections, faults = examine(path, overrides, motion_file)
        if faults:
            raise SceneError(faults)
        return cls.from_sections(sections)

    @classmethod
    def from_dict(cls, data: dict[str, Any], folder: Path | str = ".") -> Self:
        """Make a scene from a raw table.

        Args:
            data: What a scene file would hold.
            folder: Where relative paths start.

        Returns:
            The scene.

        Raises:
            SceneError: With every fault at once.
        """
        sections, faults = check(data, folder)
        if faults:
            raise SceneError(faults)
        return cls.from_sections(sections)

    @classmethod
    def from_sections(cls, sections: Sections) -> Self:
        """Make a scene from sections that :func:`check` found without fault.

        Raises:
            ValueError: If a section is missing because of a fault.
        """
        parts = {name: getattr(sections, name) for name in cls.__dataclass_fields__}
        parts["data"] = copy_data(sections.data)
        bad = [name for name, part in parts.items() if part is None]
        if bad or None in sections.soil.values() or None in sections.motion:
            raise ValueError(f"sections with faults ({', '.join(bad)}); expected a checked scene")
        return cls(**parts)

    @cached_property
    def hash(self) -> str:
        """SHA-256 of the raw table in canonical form (sorted keys, whole numbers as floats)."""
        text = json.dumps(_canonical(self.data), sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()

    @cached_property
    def segments(self) -> list[records.Segment]:
        """The lapses; together they cover the longest record, the last one may be longer."""
        num_samples = max(motion.record.num_samples for motion in self.motion)
        return records.split(
            num_samples, self.dt, count=self.lapses.count, duration=self.lapses.duration
        )

    @cached_property
    def base_acceleration(self) -> RealArray:
        """Motions padded with zeros to the end of the last lapse [m/s^2].

        Shape ``(num_motions, total_samples)``, read-only.
        """
        total = self.segments[-1].stop
        acceleration = np.stack([m.record.padded(total).acceleration for m in self.motion])
        acceleration.flags.writeable = False
        return acceleration

    @property
    def rest_samples(self) -> int:
        """Samples after the last lapse within which what slides must come to rest."""
        sliding = self.effects.sliding
        return 0 if sliding is None else int(np.ceil(sliding.longest / self.dt))

    @property
    def samples_after(self) -> int:
        """Samples after the last lapse that any lapse may reach, which no motion is in."""
        return self.rest_samples + self.segments[0].num_samples if self.rest_samples else 0

    @property
    def directions(self) -> tuple[str, ...]:
        """Direction of each motion."""
        return tuple(motion.direction for motion in self.motion)

    @property
    def input(self) -> str:
        """Kind of all motions: ``within`` or ``outcrop``."""
        return self.motion[0].input

    @property
    def supports(self) -> dict[str, str]:
        """What holds each boundary that the scene names under its motions."""
        return self.boundary.supports(self.input)

    @property
    def dt(self) -> float:
        """Time step of the motions [s]."""
        return float(self.motion[0].record.dt)

    def names(self, section: str, key: str) -> bool:
        """Whether the file has a value for a key of a section, so that no default stands there."""
        return is_given(self.data, section, key)

    def level_axes(self, gdim: int) -> list[int]:
        """Axes of the motions along the ground, which drive what slides, in the motions' order.

        Args:
            gdim: Dimension of the mesh; its last axis is up.
        """
        return [axis for axis in map(AXES.index, self.directions) if axis != gdim - 1]


def examine(
    path: Path | str,
    overrides: Sequence[str] = (),
    motion_file: Path | str | None = None,
) -> tuple[Sections, list[Fault]]:
    """Read and check a scene file without raising, so that faults of the mesh can be added.

    Args:
        path: The file (TOML).
        overrides: ``key.path=value`` with TOML values.
        motion_file: Takes the place of the first motion's source.

    Returns:
        The sections that are valid; and every fault.
    """
    path = Path(path)
    folder = path.absolute().parent
    data, faults = read_source(path, overrides, motion_file)
    if data is None:
        return Sections({}, folder), faults
    sections, found = check(data, folder)
    if sections.title == "":
        sections.title = path.stem
    return sections, faults + found


def _canonical(value: Any) -> Any:
    """A raw value with whole numbers as floats, so that 1 and 1.0 are the same scene."""
    if isinstance(value, dict):
        return {str(name): _canonical(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_canonical(item) for item in value]
    if isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return value
