# SPDX-License-Identifier: MIT
"""Vertical waves through level layers: the closed form of a linear scene that is one-dimensional.

Plane waves in a layer, z down from its top, e^{+iωt}: u = A e^{ikz} + B e^{−ikz}, k = ω/V*, with
V* = √(modulus*/ρ) of S or of P waves (Thomson 1950; Haskell 1953; in soil dynamics Schnabel,
Lysmer and Seed 1972; Kramer 1996, §7.2). The free top reflects all, A = B. Going down, what is
carried along is the reflection B/A at the bottom of a layer and how much larger A is there than at
the top: both are products of e^{−ikh}, which decay, so that no frequency and no depth overflows.
The total motion follows over that of the base (within) or over twice the wave that comes up through
the rock (outcrop).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fenics_hytf.motion import frequencies, to_frequency, to_time
from fenics_hytf.scene import Scene, components_of
from fenics_hytf.soil import wave_factors

RealArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


class NoClosedForm(ValueError):
    """The scene is not one that vertical waves through level layers describe; says why."""


@dataclass(frozen=True)
class Stratum:
    """A level layer, or the rock below, for one kind of wave.

    Attributes:
        thickness: [m]; the rock has no end, and 0 here.
        density: [kg/m^3].
        modulus: Complex modulus of the wave at positive frequencies [Pa].
    """

    thickness: float
    density: float
    modulus: complex

    @property
    def velocity(self) -> complex:
        """V* [m/s]."""
        return complex(np.sqrt(self.modulus / self.density))

    @property
    def impedance(self) -> complex:
        """ρV* [kg/(m^2 s)]."""
        return self.density * self.velocity


def layered_transfer(
    strata: list[Stratum], rock: Stratum | None, omega: RealArray, depths: RealArray
) -> ComplexArray:
    """Total motion at some depths over the motion that is given.

    Args:
        strata: The layers, from the top down.
        rock: The half-space below, whose outcrop motion is given; ``None``: the motion of the base
            itself is.
        omega: Circular frequencies, none negative [rad/s], shape ``(num_lines,)``.
        depths: Below the top, at most the sum of the thicknesses [m], shape ``(n,)``.

    Returns:
        Shape ``(n, num_lines)``.
    """
    waves = []
    reflection = np.ones(len(omega), complex)  # B/A at the top of a layer, from the top down
    for stratum, below in zip(strata, [*strata[1:], rock], strict=True):
        ik = 1j * omega / stratum.velocity
        fall = np.exp(-ik * stratum.thickness)  # A at the top over A at the bottom
        up = np.ones_like(fall)  # A below the interface over A above it
        reflected = reflection * fall**2
        if below is not None:
            ratio = stratum.impedance / below.impedance
            up = ((1 + reflected) + ratio * (1 - reflected)) / 2
            reflected = ((1 + reflected) - ratio * (1 - reflected)) / (2 * up)
        waves.append((ik, fall, up, reflection))
        reflection = reflected
    # A of the rock is half the outcrop motion; a base that is held moves by A + B
    amplitude = 1 / (1 + reflection) if rock is None else np.full(len(omega), 0.5 + 0j)
    motion = np.empty((len(depths), len(omega)), complex)
    bottom = sum(stratum.thickness for stratum in strata)
    depths = np.minimum(depths, bottom)  # heights summed otherwise differ by rounding
    for stratum, (ik, fall, up, reflection) in zip(strata[::-1], waves[::-1], strict=True):
        amplitude = amplitude / up  # at the bottom of the layer
        top = bottom - stratum.thickness
        here = depths <= bottom
        under = np.maximum(depths[here] - top, 0.0)[:, None]  # higher ones are done again
        motion[here] = amplitude * (
            np.exp(-ik * (stratum.thickness - under)) + fall * reflection * np.exp(-ik * under)
        )
        amplitude, bottom = amplitude * fall, top
    return motion


def closed_form(scene: Scene) -> RealArray:
    """Total acceleration of the receivers, every line of the record, no mesh and no lapses.

    The record is periodic, as under ``steady`` continuity in one lapse of its padded length.

    Args:
        scene: The scene.

    Returns:
        [m/s^2], shape ``(num_receivers, num_components, num_samples)``.

    Raises:
        NoClosedForm: If the scene is not linear, or not one-dimensional.
    """
    _check(scene)
    gdim = scene.mesh.gdim
    assert gdim is not None and scene.mesh.size is not None
    components = components_of(gdim, scene.mesh.kinematics)
    acceleration = scene.base_acceleration
    num_samples = acceleration.shape[1]
    omega = 2 * np.pi * frequencies(num_samples, scene.dt)
    height = scene.mesh.size[gdim - 1]
    depths = height - np.array([r.place[-1] for r in scene.output.receivers.values()])
    response = np.zeros((len(depths), len(components), num_samples))
    for motion, record in zip(scene.motion, acceleration, strict=True):
        vertical = motion.direction == "xyz"[gdim - 1]
        rock = _rock(scene, vertical) if scene.supports.get("base") == "compliant" else None
        transfer = layered_transfer(
            _strata(scene, vertical), rock, omega, np.clip(depths, 0.0, height)
        )
        axis = components.index(motion.direction)
        response[:, axis] += to_time(transfer * to_frequency(record), num_samples)
    return response


def _check(scene: Scene) -> None:
    """Raise NoClosedForm unless the scene is linear, level and between sides that move alike."""
    if scene.lapses.continuity == "transient":
        raise NoClosedForm("its response is transient, not periodic")
    if scene.solver.complex_modulus == "maxwell":
        raise NoClosedForm("its complex modulus is maxwell, which hangs on frequency")
    # Only points that move carry a stress: without convection geometric stiffness is nought.
    effects = [name for name in scene.effects.named if name != "geometric_stiffness"]
    if effects:
        raise NoClosedForm(f"it calls for {' and '.join(effects)}")
    mesh = scene.mesh
    if mesh.boundaries is None:
        raise NoClosedForm("its mesh is a file")
    if any(region.polygon is not None for region in mesh.regions):
        raise NoClosedForm("its regions are polygons, not level layers")
    kinds = scene.supports
    level = {"tied", "free_field"}
    if all(motion.direction == "xyz"[len(mesh.size or ()) - 1] for motion in scene.motion):
        level.add("roller")  # nothing moves sideways under vertical waves
    for name in mesh.boundaries:
        if name not in ("base", "top") and kinds.get(name, "free") not in level:
            raise NoClosedForm(f"its side '{name}' is {kinds.get(name, 'free')}, not level ground")
    if kinds.get("top", "free") != "free":
        raise NoClosedForm(f"its top is {kinds['top']}, not free")
    if kinds.get("base", "rigid") not in ("rigid", "fixed", "compliant"):
        raise NoClosedForm(f"its base is {kinds['base']}, neither rigid nor compliant")


def _strata(scene: Scene, vertical: bool) -> list[Stratum]:
    """The layers from the top down, for P waves or S waves."""
    return [
        _stratum(
            scene,
            thickness,
            scene.soil[name].density,
            (
                scene.soil[name].elastic.p_wave_velocity,
                scene.soil[name].elastic.shear_wave_velocity,
            ),
            scene.soil[name].poisson,
            scene.soil[name].damping_ratio(with_curves=False),
            vertical,
        )
        for thickness, name in _layers(scene)
    ]


def _rock(scene: Scene, vertical: bool) -> Stratum:
    rock = scene.boundary.rock
    assert rock is not None
    velocities = (rock.p_wave_velocity, rock.shear_wave_velocity)
    return _stratum(scene, 0.0, rock.density, velocities, rock.poisson, rock.damping, vertical)


def _stratum(
    scene: Scene,
    thickness: float,
    density: float,
    velocities: tuple[float, float],
    poisson: float,
    damping: float,
    vertical: bool,
) -> Stratum:
    """A layer in the scene's convention of the complex modulus."""
    solver = scene.solver
    factors = wave_factors(damping, poisson, solver.complex_modulus, solver.keep)
    kind = 0 if vertical else 1
    return Stratum(thickness, density, density * velocities[kind] ** 2 * factors[kind])


def _layers(scene: Scene) -> list[tuple[float, str]]:
    """Thickness [m] and soil of each layer, from the top down."""
    mesh = scene.mesh
    if mesh.column is not None:
        return [(layer.thickness, layer.soil) for layer in mesh.column.layers]
    assert mesh.box is not None
    height = mesh.box.size[-1]
    if not mesh.regions:
        return [(height, next(iter(scene.soil)))]
    marks = {r.below for r in mesh.regions if r.below is not None and 0 < r.below < height}
    edges = np.array([0.0, *sorted(marks), height])
    middles = np.zeros((len(edges) - 1, len(mesh.box.size)))
    middles[:, -1] = (edges[1:] + edges[:-1]) / 2
    names = [mesh.regions[index].soil for index in mesh.region_index(middles)]
    thicknesses = [float(thickness) for thickness in np.diff(edges)]
    return list(zip(thicknesses[::-1], names[::-1], strict=True))
