# SPDX-License-Identifier: MIT
"""Hybrid time-frequency ground response with material points, on FEniCSx.

from fenics_hytf import Scene, simulate
result = simulate(Scene.load("scene.toml"))
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fenics_hytf.scene import Scene
    from fenics_hytf.simulation import simulate

__version__ = "0.1.0"
__all__ = ["Scene", "__version__", "simulate"]


def __getattr__(name: str) -> Any:
    # Imported when asked for: the command line says what is missing before dolfinx is imported.
    if name == "Scene":
        from fenics_hytf.scene import Scene

        return Scene
    if name == "simulate":
        from fenics_hytf.simulation import simulate

        return simulate
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
