# SPDX-License-Identifier: MIT
"""The ``[soil.NAME]`` tables: elastic constants, damping, curves and strength of each soil."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from fenics_hytf.scene.faults import Fault, fault_from, join_key, name_key, toml_text
from fenics_hytf.scene.files import unusable
from fenics_hytf.scene.table import (
    LARGEST,
    NAME,
    SMALLEST,
    Fraction,
    NotNegative,
    Positive,
    Table,
    as_number,
    exactly_one,
    read_table,
)
from fenics_hytf.soil import (
    Curve,
    CurveFileError,
    Elastic,
    curve_from_model,
    limit_strength,
    read_curve_file,
)

MODULI = ("shear_wave_velocity", "shear_modulus", "youngs_modulus")
_TABLE = ("strain", "modulus", "damping")
_LIMIT = ("shear_strength", "transition_strain")
_CURVES = "a table with model and its parameters, or strain, modulus and damping, or file"


class Soil(Table):
    """One soil.

    Attributes:
        density: Mass density [kg/m^3].
        shear_wave_velocity: [m/s]; exactly one of the three moduli is not ``None``.
        shear_modulus: [Pa].
        youngs_modulus: [Pa].
        poisson: Poisson's ratio [-].
        damping: Damping ratio without curves [-], or ``None``.
        curves: The raw table of curves, or ``None``; see :attr:`curve`. A file's columns stand
            beside its name.
        friction_angle: [degrees], or ``None``.
        cohesion: [Pa], or ``None``.
        k0: Horizontal over vertical stress at rest [-]; that of elastic ground that cannot move
            sideways if ``None``.
    """

    density: Positive = Field(description="a positive number [kg/m3]")
    shear_wave_velocity: Positive | None = Field(None, description="a positive number [m/s]")
    shear_modulus: Positive | None = Field(None, description="a positive number [Pa]")
    youngs_modulus: Positive | None = Field(None, description="a positive number [Pa]")
    poisson: Annotated[float, Field(ge=0, lt=0.5)] = Field(
        description="a number from 0 to below 0.5 [-]"
    )
    damping: Fraction | None = Field(None, description="a damping ratio from 0 to below 1 [-]")
    curves: dict[str, Any] | None = Field(None, description=_CURVES)
    friction_angle: Annotated[float, Field(ge=0, lt=90)] | None = Field(
        None, description="an angle from 0 to below 90 [degrees]"
    )
    cohesion: NotNegative | None = Field(None, description="a number not below 0 [Pa]")
    k0: Annotated[float, Field(gt=0, le=3)] | None = Field(
        None, description="a number above 0, at most 3 [-]"
    )

    @classmethod
    def rules(cls, raw: dict[str, Any], key: str) -> Iterator[Fault]:
        """One modulus; curves that are curves."""
        yield from exactly_one(raw, key, *MODULI)
        if isinstance(raw.get("curves"), dict):
            yield from read_curves(raw["curves"], join_key(key, "curves"))[1]

    @cached_property
    def elastic(self) -> Elastic:
        """The small-strain elastic constants."""
        moduli = {name: getattr(self, name) for name in MODULI if getattr(self, name) is not None}
        return Elastic.from_constants(density=self.density, poisson=self.poisson, **moduli)

    @cached_property
    def curve(self) -> Curve | None:
        """G/G_max and damping against strain, limited by a shear strength if given, or ``None``."""
        if self.curves is None:
            return None
        return read_curves(self.curves, "curves", elastic=self.elastic)[0]

    @property
    def has_strength(self) -> bool:
        """Whether a cohesion or a friction angle is given."""
        return bool(self.cohesion or self.friction_angle)

    @property
    def at_rest(self) -> float:
        """Horizontal over vertical stress at rest [-]."""
        return self.poisson / (1 - self.poisson) if self.k0 is None else self.k0

    def damping_ratio(self, with_curves: bool) -> float:
        """Damping ratio at small strain [-].

        Args:
            with_curves: Whether the curves rule (the scene is equivalent linear). If not,
                ``damping`` holds.

        Returns:
            The curve's value at its smallest strain where the curves rule or no ``damping`` is
            given; ``damping`` otherwise; 0 if the soil has neither.
        """
        if self.curve is not None and (with_curves or self.damping is None):
            return self.curve.small_strain_damping
        return 0.0 if self.damping is None else self.damping


def read_soils(raw: object, folder: Path = Path()) -> tuple[dict[str, Soil | None], list[Fault]]:
    """Read all soils.

    Args:
        raw: What stands in the file, a table of tables.
        folder: Where relative paths start.

    Returns:
        The soils by name, ``None`` where one has a fault; and the faults.
    """
    if not isinstance(raw, dict) or not raw:
        return {}, [Fault("soil", toml_text(raw), "at least one table [soil.NAME]")]
    soils: dict[str, Soil | None] = {}
    faults: list[Fault] = []
    for name, table in raw.items():
        where = join_key("soil", name_key(name))
        with_columns, found = _read_file_of(table, folder, where)
        soil, others = read_table(Soil, with_columns, where)
        found += others
        if not NAME.fullmatch(str(name)):
            found.append(Fault(where, toml_text(name), "a name without comma, quote or new line"))
        if soil is not None:
            found += _constants_faults(soil, table, where)
        soils[str(name)] = None if found else soil
        faults += found
    return soils, faults


def read_curves(
    raw: dict[str, Any], key: str, folder: Path = Path(), elastic: Elastic | None = None
) -> tuple[Curve | None, list[Fault]]:
    """Build the curves of a soil.

    Args:
        raw: ``model`` and its parameters; or ``strain``, ``modulus`` and ``damping``; or ``file``,
            with or without the columns read from it. Each with ``shear_strength`` or without.
        key: Where it stands.
        folder: Where a relative path starts.
        elastic: Small-strain constants, which the limit by the shear strength needs; without them
            the curve is that without limit.

    Returns:
        The curve, or ``None`` if there is a fault; and the faults.
    """
    raw, faults = _with_columns(raw, folder, key)
    if faults:
        return None, faults
    limit = {name: raw[name] for name in _LIMIT if name in raw}
    faults = list(_limit_faults(limit, key))
    curve, found = _unlimited({name: raw[name] for name in raw if name not in limit}, key)
    faults += found
    if curve is None or faults or not limit or elastic is None:
        return (None if faults else curve), faults
    unlimited, modulus = curve, elastic.shear_modulus
    return _built(lambda: limit_strength(unlimited, modulus, **limit), raw, key)


def _limit_faults(limit: dict[str, Any], key: str) -> Iterator[Fault]:
    """A positive strength; a transition strain only beside it."""
    for name, value in limit.items():
        if (as_number(value) or 0.0) <= 0.0:
            unit = "[Pa]" if name == "shear_strength" else "[-]"
            yield Fault(join_key(key, name), toml_text(value), f"a positive number {unit}")
        elif "shear_strength" not in limit:
            yield Fault(join_key(key, name), toml_text(value), "nothing without shear_strength")


def _constants_faults(soil: Soil, table: object, key: str) -> list[Fault]:
    """Faults of constants that are in range one by one but make no soil together."""
    try:
        elastic = soil.elastic
    except (ValueError, ArithmeticError) as error:
        return [fault_from(error, key, toml_text(table))]
    if not SMALLEST <= elastic.shear_modulus <= LARGEST:
        found = f"a shear modulus of {elastic.shear_modulus:g} Pa"
        return [Fault(key, found, f"one from {SMALLEST:g} to {LARGEST:g} Pa")]
    if soil.curves is None:
        return []
    return read_curves(soil.curves, join_key(key, "curves"), elastic=elastic)[1]


def _read_file_of(table: object, folder: Path, key: str) -> tuple[object, list[Fault]]:
    """The raw table of a soil with the columns of a file of curves; without curves if at fault."""
    curves = table.get("curves") if isinstance(table, dict) else None
    if not isinstance(table, dict) or not isinstance(curves, dict):
        return table, []
    key = join_key(key, "curves")
    given = [name for name in ("model", *_TABLE) if "file" in curves and name in curves]
    faults = [Fault(join_key(key, n), toml_text(curves[n]), "nothing beside file") for n in given]
    if not faults:
        curves, faults = _with_columns(curves, folder, key)
    if faults:
        return {name: value for name, value in table.items() if name != "curves"}, faults
    return {**table, "curves": curves}, []


def _with_columns(
    raw: dict[str, Any], folder: Path, key: str
) -> tuple[dict[str, Any], list[Fault]]:
    """The raw table of curves with the columns of its file, if it names one."""
    if "file" not in raw or any(name in raw for name in _TABLE):
        return raw, []
    where, file = join_key(key, "file"), raw["file"]
    if not isinstance(file, str) or not file:
        return raw, [Fault(where, toml_text(file), "the path of a CSV file")]
    path = Path(folder, file)
    why = unusable(path)
    if why:
        found = f"{toml_text(file)}, {why}"
        return raw, [Fault(where, found, f"a CSV file of curves; looked for {path}")]
    try:
        columns = read_curve_file(path)
    except CurveFileError as error:
        text = toml_text(file)
        return raw, [fault_from(ValueError(problem), where, text) for problem in error.problems]
    faults = _table_faults(columns, raw, key) or _built(lambda: _curve(**columns), raw, key)[1]
    for i, fault in enumerate(faults):
        place = f"{path.name}{fault.key.removeprefix(key).replace('.', ', column ')}"
        faults[i] = Fault(where, f"{fault.found} ({place})", fault.expected)
    return {**raw, **columns}, faults


def _unlimited(raw: dict[str, Any], key: str) -> tuple[Curve | None, list[Fault]]:
    """The curves of a model or of a table."""
    if "model" in raw:
        faults = [
            Fault(join_key(key, name), toml_text(raw[name]), "no table beside a model")
            for name in ("modulus", "damping")
            if name in raw
        ]
        return (None, faults) if faults else _from_model(raw, key)
    expected = "model, or strain, modulus, damping, or file"
    faults = [
        Fault(join_key(key, name_key(name)), toml_text(value), expected)
        for name, value in raw.items()
        if name not in (*_TABLE, "file")
    ]
    columns: dict[str, list[float]] = {}
    for name in _TABLE:
        numbers = _numbers(raw.get(name))
        if numbers is None:
            faults.append(_no_numbers(raw.get(name), join_key(key, name)))
        else:
            columns[name] = numbers
    faults += _table_faults(columns, raw, key)
    return (None, faults) if faults else _built(lambda: _curve(**columns), raw, key)


def _table_faults(columns: dict[str, list[float]], raw: dict[str, Any], key: str) -> list[Fault]:
    """Faults of each column of a table."""
    return [
        fault
        for name, numbers in columns.items()
        for fault in _column_faults(name, numbers, raw, key)
    ]


def _curve(strain: list[float], modulus: list[float], damping: list[float]) -> Curve:
    return Curve(np.array(strain), np.array(modulus), np.array(damping))


def _column_faults(name: str, numbers: list[float], raw: dict[str, Any], key: str) -> list[Fault]:
    """Faults of one column, whatever the others hold: those beside it are made up."""
    size = len(numbers)
    columns = {
        "strain": [float(i + 1) for i in range(size)],
        "modulus": [1.0] * size,
        "damping": [0.0] * size,
    }
    return _built(lambda: _curve(**columns | {name: numbers}), raw, key)[1] if size > 1 else []


def _from_model(raw: dict[str, Any], key: str) -> tuple[Curve | None, list[Fault]]:
    """A curve by the name of its model."""
    model = raw["model"]
    if not isinstance(model, str):
        return None, [Fault(join_key(key, "model"), toml_text(model), "the name of a model")]
    parameters = {str(name): value for name, value in raw.items() if name != "model"}
    faults = [
        Fault(join_key(key, name_key(name)), toml_text(value), "a finite number")
        for name, value in parameters.items()
        if as_number(value) is None and _numbers(value) is None
    ]
    if faults:
        return None, faults
    return _built(lambda: curve_from_model(model, **parameters), raw, key)


def _built(
    build: Callable[[], Curve], raw: dict[str, Any], key: str
) -> tuple[Curve | None, list[Fault]]:
    """A curve, or the fault of building it; parameters may be so odd that arithmetic fails."""
    try:
        with np.errstate(all="ignore"):
            return build(), []
    except (ValueError, TypeError, ArithmeticError) as error:
        return None, [fault_from(error, key, toml_text(raw))]


def _numbers(values: object) -> list[float] | None:
    """A raw array of finite numbers, or ``None`` if it is none."""
    if not isinstance(values, list | tuple):
        return None
    numbers = [as_number(value) for value in values]
    return [n for n in numbers if n is not None] if None not in numbers else None


def _no_numbers(values: object, key: str) -> Fault:
    """The fault of a column that is no array of numbers, at the item that is none."""
    if isinstance(values, list | tuple):
        at = next(i for i, value in enumerate(values) if as_number(value) is None)
        return Fault(join_key(key, at), toml_text(values[at]), "a finite number [-]")
    return Fault(key, toml_text(values), "an array of numbers [-]")
