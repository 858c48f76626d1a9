# SPDX-License-Identifier: MIT
"""Which lapses there are: those of the scene, or those that sliding makes of them.

What slides cuts a lapse short when a new mechanism is due, and lapses go on after the motion until
it rests.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

from fenics_hytf.lapse import LapseResult
from fenics_hytf.motion import Segment
from fenics_hytf.scene import Scene


def lapses_to_go(
    scene: Scene, done: Sequence[LapseResult], moving: Callable[[], bool] | None
) -> Iterator[Segment]:
    """The lapses that are left.

    Args:
        scene: The scene.
        done: Those that were solved; it grows from one lapse to the next.
        moving: Whether something slides as the next lapse begins; ``None`` without sliding.

    Yields:
        The lapses; with sliding one may turn out shorter.
    """
    planned = scene.segments
    if moving is None:
        yield from planned[len(done) :]
        return
    length, end = planned[0].num_samples, planned[-1].stop
    position = samples(done)
    while position < end or (moving() and position < end + scene.rest_samples):
        left = end - position if position < end else length
        yield Segment(len(done), position, min(length, left))
        position += done[-1].num_samples


def samples(lapses: Sequence[LapseResult]) -> int:
    """Samples of some lapses."""
    return sum(lapse.num_samples for lapse in lapses)


def motion_of(scene: Scene, lapses: Sequence[LapseResult]) -> npt.NDArray[np.float64]:
    """The motions, and nought where lapses go on after their end.

    Args:
        scene: The scene.
        lapses: The lapses.

    Returns:
        [m/s^2], shape ``(num_motions, num_samples)``.
    """
    given = scene.base_acceleration
    after = samples(lapses) - given.shape[1]
    return np.pad(given, ((0, 0), (0, max(after, 0))))
