# SPDX-License-Identifier: MIT
"""What ``summary.json`` holds: the values that are read back, each with its type.

A result may come from elsewhere, or have been edited. It is looked through once, here, before
anything of it is used; what is not read is not looked at. A figure that does not exist is ``None``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from fenics_hytf.results.writers import QUANTITIES
from fenics_hytf.scene.faults import NOTHING, Fault, join_key, name_key, toml_text

_EXPECTED = {
    "missing": "a value",
    "model_type": "a table",
    "dict_type": "a table",
    "list_type": "a list",
    "string_type": "a text",
    "string_pattern_mismatch": "a name of letters, digits, _ and -",
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "bool_type": "true or false",
}
"""What is said of pydantic's complaints, by their kinds."""

_Count = Annotated[int, Field(ge=0)]
_Positive = Annotated[float, Field(gt=0)]
_Maybe = float | None
_Range = Annotated[list[_Maybe], Field(min_length=2, max_length=2)]
_Ends = Annotated[list[float], Field(min_length=2, max_length=2)]
_Name = Annotated[str, Field(pattern=r"^[\w-]+$")]
"""Of receivers, directions and components, as the scene allows them: they name files."""


class _Record(BaseModel):
    """A table of the summary: nothing is converted, numbers are finite, other keys do not count."""

    model_config = ConfigDict(extra="ignore", strict=True, allow_inf_nan=False)


class _MeshLayer(_Record):
    thickness_m: _Positive
    soil: str
    cells: _Count


class _Mesh(_Record):
    kind: str
    text: str
    kinematics: str | None
    layers: list[_MeshLayer] = []


class _Soil(_Record):
    density_kg_m3: float
    shear_wave_velocity_m_s: float
    shear_modulus_pa: float
    poisson: float
    damping: float
    cohesion_pa: _Maybe
    friction_angle_degrees: _Maybe
    curves: str | None


class _Rock(_Record):
    density: float
    shear_wave_velocity: float
    poisson: float
    damping: float


class _Contour(_Record):
    eta_1_s: float
    period_s: _Positive


class _Rayleigh(_Record):
    alpha: float
    beta: float


class _Degradation(_Record):
    soils: list[str] | None
    threshold: float
    s: float
    r: float
    minimum: float


class _Gravity(_Record):
    acceleration: float
    initial_stress: str | None


class _Sliding(_Record):
    time_step: float
    new_mechanism: float
    longest: float


class _Calm(_Record):
    sides: list[str]
    thickness: float
    damping: float


class _Solver(_Record):
    sweep: str
    complex_modulus: str
    keep: str
    tolerance: float
    reference_frequency: _Maybe
    max_frequency: _Maybe
    excited: float


class _Scene(_Record):
    mesh: _Mesh
    soils: dict[str, _Soil]
    boundary: dict[str, str]
    rock: _Rock | None
    continuity: str
    scheme: str
    contour: _Contour | None
    loop_tolerance: _Maybe
    strain_ratio: _Maybe
    magnitude: _Maybe
    strain_measure: str
    rayleigh: _Rayleigh | None
    degradation: _Degradation | None
    gravity: _Gravity | None
    sliding: _Sliding | None
    softening: bool
    calm: _Calm | None
    water_table_m: _Maybe
    solver: _Solver


class _Motion(_Record):
    direction: _Name
    name: str
    input: str
    pga_m_s2: float
    pga_g: float
    dt_s: _Positive
    samples: _Count


class _Intensity(_Record):
    pga_m_s2: _Maybe
    pgv_m_s: _Maybe
    pgd_m: _Maybe
    arias_m_s: _Maybe
    cav_m_s: _Maybe
    d5_95_s: _Maybe


class _Base(_Record):
    outcrop_pga_g: _Maybe
    outcrop_intensity: _Intensity | None
    within_pga_g: float
    within_intensity: _Intensity


class _Receiver(_Record):
    place_m: Annotated[list[float], Field(min_length=2, max_length=3)]
    rides: bool


class _Layer(_Record):
    soil: str
    depth_m: _Ends | None = None
    elevation_m: _Ends | None = None
    cells: _Count
    effective_strain: _Range
    g_over_gmax: _Range
    damping: _Range
    change: _Maybe
    converged: bool | None
    degradation: _Range | None


class _Energy(_Record):
    unit: str
    input: float
    damping: float
    rest: float
    slip: float
    seam: float
    imbalance: float


class _LapseEnergy(_Energy):
    kinetic: _Ends
    strain: _Ends


class _RunEnergy(_Energy):
    worst_imbalance: _Maybe


class _Slip(_Record):
    yield_coefficient: float
    direction: str
    sense: int
    slip_m: float
    rigid_m: float
    decoupled_m: float
    end_rate_m_s: float
    peak_driving_g: float
    yield_over_peak: _Maybe
    note: str | None
    iterations: _Count
    time_step_s: _Positive


class _Slide(_Record):
    slip_m: float
    rigid_m: float
    decoupled_m: float
    factor_of_safety: _Maybe
    yield_coefficient: float
    yield_coefficient_last: float
    yield_over_peak: _Maybe
    at_rest_s: _Maybe
    note: str | None


class _Softening(_Record):
    softest: float
    largest_m: _Maybe
    receivers_m: dict[str, list[_Maybe]]
    note: str


class _MassLedger(_Record):
    imbalance: _Maybe


class _Lapse(_Record):
    index: _Count
    start_time_s: float
    samples: Annotated[int, Field(ge=1)]
    excited_lines: _Count
    solved_lines: _Count
    factorisations: _Count
    solves: _Count
    iterations: _Count
    final_change: _Maybe
    change: list[_Maybe]
    worst_cell: list[int]
    layers: list[_Layer]
    worst_residual: _Maybe
    seam_error: _Maybe
    energy: _LapseEnergy | None
    slip: _Slip | None
    points_lost: _Count
    points_parked: _Count
    mass_ledger: _MassLedger


class _Work(_Record):
    factorisations: _Count
    solves: _Count
    inverse_mappings: _Count
    assemblies: dict[str, _Count]


class _Summary(_Record):
    title: str
    written: str
    versions: dict[str, str | None]
    ranks: _Count
    scene_hash: str
    scene: _Scene
    effects: list[str]
    sizes: dict[str, _Count]
    components: Annotated[list[_Name], Field(min_length=1)]
    directions: Annotated[list[_Name], Field(min_length=1)]
    dt_s: _Positive
    samples: _Count
    duration_s: _Positive
    motions: Annotated[list[_Motion], Field(min_length=1)]
    base: dict[_Name, _Base]
    receivers: dict[_Name, _Receiver]
    lapses: Annotated[list[_Lapse], Field(min_length=1)]
    worst_seam_error: _Maybe
    energy: _RunEnergy | None
    sliding: _Slide | None
    softening: _Softening | None
    peaks: dict[str, dict[str, _Maybe]]
    intensity: dict[str, dict[str, _Intensity]]
    work: _Work
    wall_s: dict[str, float]
    peak_memory_bytes: _Count
    warnings: list[str]


def summary_faults(summary: Mapping[str, Any]) -> list[Fault]:
    """What a summary holds that no run writes.

    Args:
        summary: The content of ``summary.json``.

    Returns:
        Faults, each with its key, what was found and what was expected; those between the parts
        are looked for once the parts are sound.
    """
    try:
        _Summary.model_validate(summary)
    except ValidationError as error:
        return [_fault(e) for e in error.errors(include_url=False)]
    return list(_torn(summary))


def _torn(summary: Mapping[str, Any]) -> Iterator[Fault]:
    """Parts that do not belong to each other."""
    receivers, components = list(summary["receivers"]), summary["components"]
    peaks = [f"{letter}_{c}" for letter in QUANTITIES for c in components]
    yield from _same("base", summary["base"], summary["directions"])
    yield from _same("motions", [m["direction"] for m in summary["motions"]], summary["directions"])
    for part, names in (("peaks", peaks), ("intensity", components)):
        yield from _same(part, summary[part], receivers)
        for name, of_one in summary[part].items():
            yield from _same(f"{part}.{name}", of_one, names)
    lapses = summary["lapses"]
    if [lapse["index"] for lapse in lapses] != list(range(len(lapses))):
        indices = toml_text([lapse["index"] for lapse in lapses])
        yield Fault("lapses", f"the indices {indices}", "one after the other from 0")
    slides = summary["sliding"] is not None
    for i, lapse in enumerate(lapses):
        for name in ("change", "worst_cell"):
            if len(lapse[name]) != lapse["iterations"]:
                found = f"{len(lapse[name])} values"
                yield Fault(f"lapses[{i}].{name}", found, f"one for each of {lapse['iterations']}")
        if slides and lapse["slip"] is None:
            yield Fault(f"lapses[{i}].slip", "null", "a table, as sliding is one")
        if summary["energy"] is not None and lapse["energy"] is None:
            yield Fault(f"lapses[{i}].energy", "null", "a table, as energy is one")
    if slides and summary["scene"]["sliding"] is None:
        yield Fault("scene.sliding", "null", "a table, as sliding is one")


def _same(key: str, found: Iterable[object], expected: Iterable[object]) -> Iterator[Fault]:
    """A fault unless the same names are there, in whatever order."""
    there, wanted = set(found), set(expected)
    if there != wanted:
        yield Fault(key, toml_text(sorted(there, key=str)), toml_text(sorted(wanted, key=str)))


def _fault(error: ErrorDetails) -> Fault:
    """One of pydantic's complaints as a fault."""
    names = (name for name in error["loc"] if name != "[key]")
    key = join_key(*(name if isinstance(name, int) else name_key(name) for name in names))
    kind = error["type"]
    found = NOTHING if kind == "missing" else toml_text(error["input"])
    if error["input"] is None:
        found = "null"
    return Fault(key, found, _EXPECTED.get(kind, error["msg"].removeprefix("Input should be ")))
