# SPDX-License-Identifier: MIT
"""The sections that say how: lapses, effects, points and solver."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from fenics_hytf.scene.faults import Fault, join_key
from fenics_hytf.scene.table import (
    Count,
    Name,
    NotNegative,
    Positive,
    Several,
    Table,
    at_most_one,
    number,
)
from fenics_hytf.soil import DegradationLaw


class Lapses(Table):
    """How the motion is cut.

    Attributes:
        count: Number of lapses, or ``None`` where ``duration`` is given.
        duration: Length of a lapse [s], or ``None``.
        continuity: ``transient``: displacement, velocity and stress go on from lapse to lapse;
            ``steady``: each lapse is its own periodic steady state. Where none is named,
            ``transient`` for several lapses under anything but pure harmonics.
    """

    count: Count | None = Field(None, description="a whole number from 1")
    duration: Positive | None = Field(None, description="a positive time [s]")
    continuity: Literal["steady", "transient"] = Field(
        "steady", description='"steady" or "transient"'
    )

    @classmethod
    def rules(cls, raw: dict[str, Any], key: str) -> Iterator[Fault]:
        """``count`` and ``duration`` exclude each other."""
        yield from at_most_one(raw, key, "count", "duration")

    @classmethod
    def prepare(cls, raw: dict[str, Any]) -> dict[str, Any]:
        """One lapse unless something else is asked for."""
        return raw if raw.get("duration") is not None else {"count": 1, **raw}


class EquivalentLinear(Table):
    """Shear modulus and damping that fit the strain.

    Attributes:
        tolerance: On ``|G_new - G_old|/G_new`` and ``|dD|/D`` of every cell [-].
        strain_ratio: Effective over peak strain [-]; from ``magnitude`` where that is given.
        magnitude: Moment magnitude M, for the ratio (M - 1)/10 (Idriss & Sun 1992); or ``None``.
        max_iterations: After which the loop gives up and says so.
        strain: ``plane``: the in-plane shear strain in 2D; ``3d``: with zero as third principal.
    """

    tolerance: Annotated[float, Field(gt=0, lt=1)] = Field(
        1e-3, description="a number between 0 and 1 [-]"
    )
    strain_ratio: Annotated[float, Field(gt=0, le=1)] = Field(
        0.65, description="a number above 0, at most 1 [-]"
    )
    magnitude: Annotated[float, Field(gt=1, le=11)] | None = Field(
        None, description="a magnitude above 1, at most 11; the strain ratio is (M - 1)/10"
    )
    max_iterations: Count = Field(50, description="a whole number from 1")
    strain: Literal["plane", "3d"] = Field("plane", description='"plane" or "3d"')

    @classmethod
    def rules(cls, raw: dict[str, Any], key: str) -> Iterator[Fault]:
        """``strain_ratio`` and ``magnitude`` exclude each other."""
        yield from at_most_one(raw, key, "strain_ratio", "magnitude")

    @classmethod
    def prepare(cls, raw: dict[str, Any]) -> dict[str, Any]:
        """The strain ratio from the magnitude."""
        magnitude = number(raw, "magnitude")
        if magnitude is None or not 1 < magnitude <= 11 or "strain_ratio" in raw:
            return raw
        return {**raw, "strain_ratio": (magnitude - 1) / 10}


class Rayleigh(Table):
    """Viscous damping C = alpha M + beta K.

    Attributes:
        alpha: [1/s].
        beta: [s].
    """

    alpha: NotNegative = Field(0.0, description="a number not below 0 [1/s]")
    beta: NotNegative = Field(0.0, description="a number not below 0 [s]")


class Calm(Table):
    """A layer along some sides whose damping grows outwards and swallows waves.

    The Caughey absorbing layer of Semblat, Lenti and Gandomzadeh (2011), with hysteretic damping:
    ``damping·(1 − distance/thickness)²`` is added to the damping ratio of the soil.

    Attributes:
        sides: Names of vertical sides.
        thickness: Of the layer [m].
        damping: Damping ratio added at the side [-].
    """

    sides: Several[Name] = Field(min_length=1, description="names of sides")
    thickness: Positive = Field(description="a positive thickness [m]")
    damping: Positive = Field(0.5, description="a positive damping ratio [-]")


class Degradation(Table):
    """Shear modulus lowered from lapse to lapse by the cycles that the soil went through.

    See :mod:`fenics_hytf.soil.degradation`. ``true`` is the clay that its defaults are for.

    Attributes:
        threshold: Shear strain amplitude up to which nothing degrades [-].
        s: s of t = s (γ - γ_tv)^r, for strains in percent, as it is published [-].
        r: r of it [-].
        minimum: The modulus never falls below this part of the undegraded one [-].
        soils: Names of the soils that degrade, or ``None``: all of them.
    """

    threshold: Annotated[float, Field(gt=0, lt=0.1)] = Field(
        DegradationLaw.threshold,
        description="a shear strain above 0 and below 0.1 [-], not in percent",
    )
    s: Positive = Field(DegradationLaw.s, description="a positive number, for strains in percent")
    r: Positive = Field(DegradationLaw.r, description="a positive number [-]")
    minimum: Annotated[float, Field(gt=0, lt=1)] = Field(
        DegradationLaw.minimum, description="a number between 0 and 1 [-]"
    )
    soils: Several[Name] | None = Field(None, min_length=1, description="names of soils")

    @property
    def law(self) -> DegradationLaw:
        """The law with these parameters."""
        return DegradationLaw(self.threshold, self.s, self.r, self.minimum)


class Gravity(Table):
    """Weight, and the stress that the ground has before it is shaken.

    Attributes:
        acceleration: [m/s^2].
        initial_stress: ``k0``: vertical stress from the weight above, horizontal stress K0 times
            it, then brought into balance; ``elastic``: gravity switched on in elastic ground.
            ``None``: ``k0`` where the ground is level, ``elastic`` elsewhere.
    """

    acceleration: Positive = Field(9.80665, description="a positive acceleration [m/s2]")
    initial_stress: Literal["k0", "elastic"] | None = Field(None, description='"k0" or "elastic"')


class Sliding(Table):
    """Permanent displacement along a mechanism that yields; see :mod:`fenics_hytf.lapse.slip`.

    Attributes:
        time_step: Of the march of the slip, at most [s]. 5 ms are short enough for the slip of a
            lapse; for lapses that hand over what slip excites, 1.25 ms keep the seams to 0.5 %.
        new_mechanism: Slip after which a new mechanism is sought where points move, over the
            shortest edge of the mesh [-].
        unstable_at_rest: Whether the slope may be one that does not stand under its weight.
        longest: How long it may go on after the end of the motion to come to rest [s].
    """

    time_step: Annotated[float, Field(gt=0, le=0.05)] = Field(
        0.00125, description="a time step above 0, at most 0.05 [s]"
    )
    new_mechanism: Annotated[float, Field(gt=0, le=1)] = Field(
        0.3, description="a number above 0, at most 1 [-]"
    )
    unstable_at_rest: bool = Field(False, description="true or false")
    longest: NotNegative = Field(30.0, description="a time not below 0 [s]")


class Effects(Table):
    """What the scene calls for; what is absent costs nothing.

    Attributes:
        equivalent_linear: The loop's settings, or ``None``: linear.
        rayleigh: Its factors, or ``None``.
        geometric_stiffness: Stiffness from the stress that the points carry.
        convection: Points move between lapses.
        degradation: Its parameters, or ``None``.
        calm: The absorbing layer, or ``None``.
        gravity: Weight and initial stress, or ``None``.
        sliding: Permanent displacement, or ``None``.
        softening: Permanent displacement by the stiffness-reduction estimate.
        locking: Volumetric strain varies less within a cell than shear strain, at degree 1 not at
            all, against locking near ν = 0.5.
    """

    equivalent_linear: EquivalentLinear | None = Field(None, description="a table, true or false")
    rayleigh: Rayleigh | None = Field(None, description="a table with alpha and beta, or false")
    geometric_stiffness: bool = Field(False, description="true or false")
    convection: bool = Field(False, description="true or false")
    degradation: Degradation | None = Field(None, description="a table, true or false")
    calm: Calm | None = Field(None, description="a table with sides, thickness and damping")
    gravity: Gravity | None = Field(None, description="a table, true or false")
    sliding: Sliding | None = Field(None, description="a table, true or false")
    softening: bool = Field(False, description="true or false")
    locking: bool = Field(False, description="true or false")

    @classmethod
    def rules(cls, raw: dict[str, Any], key: str) -> Iterator[Fault]:
        """Rules of the tables below."""
        if isinstance(raw.get("equivalent_linear"), dict):
            where = join_key(key, "equivalent_linear")
            yield from EquivalentLinear.rules(raw["equivalent_linear"], where)

    @classmethod
    def prepare(cls, raw: dict[str, Any]) -> dict[str, Any]:
        """``true`` is a table of defaults, ``false`` none; Rayleigh factors of zero are none."""
        raw = dict(raw)
        loop, rayleigh = raw.get("equivalent_linear"), raw.get("rayleigh")
        if isinstance(loop, bool):
            raw["equivalent_linear"] = {} if loop else None
        elif isinstance(loop, dict):
            raw["equivalent_linear"] = EquivalentLinear.prepare(loop)
        for name in ("degradation", "gravity", "sliding"):
            if isinstance(raw.get(name), bool):
                raw[name] = {} if raw[name] else None
        factors = (
            [rayleigh.get(n, 0.0) for n in Rayleigh.model_fields]
            if (isinstance(rayleigh, dict) and set(rayleigh) <= set(Rayleigh.model_fields))
            else None
        )
        if raw.get("calm") is False:
            raw["calm"] = None
        if rayleigh is False or (factors and all(_is_zero(f) for f in factors)):
            raw["rayleigh"] = None
        return raw

    @property
    def named(self) -> tuple[str, ...]:
        """Names of the effects that are on, in the order of the file's documentation."""
        return tuple(name for name in type(self).model_fields if getattr(self, name))


class Points(Table):
    """Material points.

    Attributes:
        outside: What happens to a point that leaves the mesh: ``error``, ``park`` or ``delete``.
        detached: What happens to points whose cells no longer hang together with a boundary that
            holds them.
    """

    outside: Literal["error", "park", "delete"] = Field(
        "error", description='"error", "park" or "delete"'
    )
    detached: Literal["error", "park", "delete"] = Field(
        "park", description='"error", "park" or "delete"'
    )


class Solver(Table):
    """How the lines are solved.

    Attributes:
        sweep: ``direct``: one factorisation a line; ``reduced``: projected on a few directions, as
            the kernel of a mechanism always is.
        complex_modulus: Convention of the complex modulus; where none is named the causal
            ``maxwell`` for several transient lapses, else ``hysteretic``.
        keep: ``poisson``: the whole elasticity tensor is complex; ``bulk``: its deviator only.
        reference_frequency: At which the modulus of ``maxwell`` is the soil's G [Hz]; the dominant
            frequency of the motion where none is given. ``None`` for the other conventions.
        tolerance: Relative residual on every excited line [-].
        max_frequency: Highest line solved [Hz]; ``None`` for the Nyquist frequency.
        excited: A line is excited above this fraction of the spectral peak [-].
    """

    sweep: Literal["direct", "reduced"] = Field("reduced", description='"direct" or "reduced"')
    complex_modulus: Literal["hysteretic", "kramer", "shake91", "dormieux", "maxwell"] = Field(
        "hysteretic", description='"hysteretic", "kramer", "shake91", "dormieux" or "maxwell"'
    )
    keep: Literal["poisson", "bulk"] = Field("poisson", description='"poisson" or "bulk"')
    tolerance: Annotated[float, Field(gt=0, lt=1)] = Field(
        1e-6, description="a number between 0 and 1 [-]"
    )
    reference_frequency: Positive | None = Field(None, description="a positive number [Hz]")
    max_frequency: Positive | None = Field(None, description="a positive number [Hz]")
    excited: Annotated[float, Field(ge=0, lt=1)] = Field(
        1e-8, description="a number from 0 to below 1 [-]"
    )


def _is_zero(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value == 0
