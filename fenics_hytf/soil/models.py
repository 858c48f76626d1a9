# SPDX-License-Identifier: MIT
"""Curve models by the name that a scene gives them."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Mapping
from types import MappingProxyType

from fenics_hytf.soil.curves import Curve
from fenics_hytf.soil.darendeli import darendeli
from fenics_hytf.soil.epri import EPRI_DEPTHS, epri_1993_pi
from fenics_hytf.soil.hyperbolic import hardin_drnevich, mkz
from fenics_hytf.soil.ishibashi_zhang import ishibashi_zhang
from fenics_hytf.soil.menq import menq
from fenics_hytf.soil.published import SEED_IDRISS_BOUNDS, seed_idriss_1970, vucetic_dobry_1991
from fenics_hytf.soil.regional import REGIONAL
from fenics_hytf.soil.shake91 import SHAKE91


def _seed_idriss(bound: str) -> Callable[[], Curve]:
    return lambda: seed_idriss_1970(bound)


def _fixed(curve: Curve) -> Callable[[], Curve]:
    return lambda: curve


CURVE_MODELS: Mapping[str, Callable[..., Curve]] = MappingProxyType(
    {
        "darendeli": darendeli,
        "menq": menq,
        "ishibashi_zhang": ishibashi_zhang,
        "hardin_drnevich": hardin_drnevich,
        "mkz": mkz,
        "vucetic_dobry_1991": vucetic_dobry_1991,
        **{f"seed_idriss_1970_{bound}": _seed_idriss(bound) for bound in SEED_IDRISS_BOUNDS},
        "epri_1993_pi": epri_1993_pi,
        **{f"epri_1993_{depth}": _fixed(curve) for depth, curve in EPRI_DEPTHS.items()},
        **{name: _fixed(curve) for name, curve in (*SHAKE91.items(), *REGIONAL.items())},
    }
)
"""Builder of each model, by name; what it takes are the model's parameters."""


def curve_from_model(model: str, **parameters: object) -> Curve:
    """Curves of a named model.

    Args:
        model: A key of `CURVE_MODELS`.
        parameters: The model's parameters by name.

    Returns:
        The curves.

    Raises:
        ValueError: If the model is unknown, a parameter is unknown, missing, of the wrong type or
            out of range.
    """
    if model not in CURVE_MODELS:
        close = difflib.get_close_matches(model, CURVE_MODELS, n=1)
        hint = f"; did you mean '{close[0]}'?" if close else ""
        raise ValueError(
            f"curves.model: found {model!r}; expected one of {', '.join(CURVE_MODELS)}{hint}"
        )
    builder = CURVE_MODELS[model]
    known = inspect.signature(builder).parameters
    unknown = [name for name in parameters if name not in known]
    missing = [
        name
        for name, parameter in known.items()
        if parameter.default is inspect.Parameter.empty and name not in parameters
    ]
    if unknown or missing:
        found = f"unknown {', '.join(unknown)}" if unknown else f"no {', '.join(missing)}"
        raise ValueError(
            f"curves: found {found} for the model '{model}'; expected "
            f"{', '.join(map(str, known)) or 'no parameters'}"
        )
    for name, value in parameters.items():
        _check_number(name, value)
    return builder(**parameters)


def _check_number(name: str, value: object) -> None:
    """Raise ValueError unless the value is a number or, for ``strain``, a list of numbers."""
    values = value if name == "strain" and isinstance(value, list | tuple) else [value]
    if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        raise ValueError(f"curves.{name}: found {value!r}; expected a number")
