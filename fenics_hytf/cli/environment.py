# SPDX-License-Identifier: MIT
"""Whether what pip cannot install is there: dolfinx, and PETSc with complex numbers."""

from __future__ import annotations

import importlib
import os
from glob import glob

_DEBIAN = {
    "mpi4py": "python3-mpi4py",
    "petsc4py": "python3-petsc4py-complex",
    "dolfinx": "python3-dolfinx-complex",
}
_WAYS = "or run it in the environment of docker/Dockerfile: docker/run hytf ..."


def environment_faults() -> list[str]:
    """What is missing, and how to get it; empty if everything is there."""
    faults = _place_faults()
    for module, package in _DEBIAN.items():
        try:
            importlib.import_module(module)
        except Exception as error:  # a library that does not fit may raise anything
            faults.append(
                f"{module}: found that it cannot be imported ({error}); expected it installed. "
                f"On Debian 13: apt-get install {package}; {_WAYS}"
            )
    return faults or _scalar_faults()


def _place_faults() -> list[str]:
    try:
        os.getcwd()
    except OSError as error:
        return [
            f"the folder one stands in: found none ({error.strerror}); expected one that is there. "
            "Change to another"
        ]
    return []


def _scalar_faults() -> list[str]:
    import numpy as np
    from petsc4py import PETSc

    if np.issubdtype(PETSc.ScalarType, np.complexfloating):
        return []
    places = sorted(glob("/usr/lib/petscdir/petsc3.*/*-complex"))
    advice = (
        f"export PETSC_DIR={places[-1]}"
        if places
        else "on Debian 13: apt-get install python3-dolfinx-complex python3-petsc4py-complex"
    )
    return [
        f"petsc4py: found PETSc with real numbers; expected complex numbers. Choose the complex "
        f"build: {advice}; {_WAYS}"
    ]
