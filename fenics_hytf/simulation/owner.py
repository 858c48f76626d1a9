# SPDX-License-Identifier: MIT
"""What a run makes that holds PETSc objects, and destroys when it ends."""

from __future__ import annotations

from typing import Protocol, TypeVar


class Destroyable(Protocol):
    """What holds PETSc objects."""

    def destroy(self) -> None:
        """Destroy them."""


Owned = TypeVar("Owned", bound=Destroyable)


class Owner:
    """Notes what is made, to destroy it in that order."""

    def __init__(self) -> None:
        self._owned: list[Destroyable] = []

    def __call__(self, made: Owned) -> Owned:
        """Note what is made, and hand it on."""
        self._owned.append(made)
        return made

    def destroy(self) -> None:
        """Destroy all PETSc objects (collective)."""
        for owned in self._owned:
            owned.destroy()
