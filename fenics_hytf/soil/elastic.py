# SPDX-License-Identifier: MIT
"""Isotropic elastic constants and mass density of a soil, given either way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Elastic:
    """Small-strain constants of an isotropic soil.

    Attributes:
        density: Mass density rho [kg/m^3].
        shear_modulus: Shear modulus G [Pa].
        poisson: Poisson's ratio nu [-].

    Raises:
        ValueError: If the density or the modulus is not positive, or nu not in (-1, 0.5).
    """

    density: float
    shear_modulus: float
    poisson: float

    def __post_init__(self) -> None:
        """Check."""
        _check_positive("density", self.density, "kg/m^3")
        _check_positive("shear_modulus", self.shear_modulus, "Pa")
        _check_poisson(self.poisson)

    @classmethod
    def from_constants(
        cls,
        *,
        density: float,
        poisson: float,
        shear_modulus: float | None = None,
        youngs_modulus: float | None = None,
        shear_wave_velocity: float | None = None,
    ) -> Elastic:
        """Constants from density, Poisson's ratio and one measure of stiffness.

        Args:
            density: Mass density rho [kg/m^3].
            poisson: Poisson's ratio nu [-].
            shear_modulus: G [Pa].
            youngs_modulus: E [Pa]; G = E / (2 (1 + nu)).
            shear_wave_velocity: V_s [m/s]; G = rho V_s².

        Returns:
            The constants.

        Raises:
            ValueError: If not exactly one measure of stiffness is given, or a number is out of
                range.
        """
        stiffness = {
            "shear_modulus": (shear_modulus, "Pa"),
            "youngs_modulus": (youngs_modulus, "Pa"),
            "shear_wave_velocity": (shear_wave_velocity, "m/s"),
        }
        given = [(name, v, unit) for name, (v, unit) in stiffness.items() if v is not None]
        if len(given) != 1:
            raise ValueError(
                f"stiffness: found {' and '.join(name for name, _, _ in given) or 'none'}; "
                f"expected exactly one of {', '.join(stiffness)}"
            )
        [(name, value, unit)] = given
        _check_positive("density", density, "kg/m^3")
        _check_poisson(poisson)
        _check_positive(name, value, unit)
        modulus = {
            "shear_modulus": value,
            "youngs_modulus": value / (2.0 * (1.0 + poisson)),
            "shear_wave_velocity": density * value**2,
        }
        return cls(density, modulus[name], poisson)

    @property
    def youngs_modulus(self) -> float:
        """E = 2 G (1 + nu) [Pa]."""
        return 2.0 * self.shear_modulus * (1.0 + self.poisson)

    @property
    def lame_lambda(self) -> float:
        """Lame constant 2 G nu / (1 - 2nu) [Pa]."""
        return 2.0 * self.shear_modulus * self.poisson / (1.0 - 2.0 * self.poisson)

    @property
    def bulk_modulus(self) -> float:
        """Bulk modulus 2 G (1 + nu) / (3 (1 - 2nu)) [Pa]."""
        return self.youngs_modulus / (3.0 * (1.0 - 2.0 * self.poisson))

    @property
    def shear_wave_velocity(self) -> float:
        """V_s = √(G / rho) [m/s]."""
        return float(np.sqrt(self.shear_modulus / self.density))

    @property
    def p_wave_velocity(self) -> float:
        """V_p = √((lambda + 2G) / rho) [m/s]."""
        return float(np.sqrt((self.lame_lambda + 2.0 * self.shear_modulus) / self.density))


def _check_positive(name: str, value: float, unit: str) -> None:
    """Raise ValueError unless the value is a positive finite number."""
    if not (np.isfinite(value) and value > 0.0):
        raise ValueError(f"{name}: found {value}; expected a positive number in {unit}")


def _check_poisson(poisson: float) -> None:
    """Raise ValueError unless the solid is stable and compressible."""
    if not -1.0 < poisson < 0.5:
        raise ValueError(
            f"poisson: found {poisson}; expected -1 < poisson < 0.5; for saturated soil use a "
            "value just below 0.5, such as 0.49"
        )
